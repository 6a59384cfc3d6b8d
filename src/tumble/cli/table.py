"""What the options about a turntable mean: they are in the field's units, and the core's are SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.errors import UsageError
from tumble.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from tumble.arrays import AnyArray
    from tumble.simulation import TableErrors

_DEGREE = math.pi / 180.0
# Option, its largest sensible value and unit, the factor to SI.
_OPTIONS = {
    "angle": ("table-angle-arcsec", 36_000.0, "arc-seconds", _DEGREE / 3600.0),
    "once": ("table-once-arcsec", 36_000.0, "arc-seconds", _DEGREE / 3600.0),
    "twice": ("table-twice-arcsec", 36_000.0, "arc-seconds", _DEGREE / 3600.0),
    "tilt": ("table-tilt-deg", 45.0, "degrees", _DEGREE),
    "wobble": ("table-wobble-arcsec", 36_000.0, "arc-seconds", _DEGREE / 3600.0),
    "ripple": ("table-ripple-ppm", 500_000.0, "ppm", 1e-6),
    "ramps": ("table-ramps", 50.0, "per cent", 1e-2),
    "shake": ("table-shake-ug", 100_000.0, "millionths of g", 1e-6 * STANDARD_GRAVITY),
}


def table_errors(*, cycles: int, stops: list[str], **amounts: float | None) -> TableErrors | None:
    """Return what the options say of the table; None where they say nothing.

    Parameters
    ----------
    cycles : of the ripple, per revolution.
    stops : each ``SPIN:PERCENT``.
    amounts : each option's number in its own unit; None for one that was not given.

    Raises
    ------
    UsageError
        If a number is not one that a table has.
    """
    if amounts.get("angle") is None and not stops and not any(amounts.values()):
        return None
    from tumble.simulation import TableErrors

    si = {name: _in_si(name, amount) for name, amount in amounts.items() if amount is not None}
    if cycles < 1:
        raise UsageError(f"--table-ripple-cycles {cycles}: give a whole number from 1 on.")
    return TableErrors(
        angle_sigma=si.get("angle"),
        once=si["once"],
        twice=si["twice"],
        axis_tilt=si["tilt"],
        wobble=si["wobble"],
        ripple=si["ripple"],
        ripple_cycles=cycles,
        ramp_spread=si["ramps"],
        shake=si["shake"],
        stops_early=tuple(_stop(word) for word in stops),
    )


def _in_si(name: str, amount: float) -> float:
    option, largest, unit, factor = _OPTIONS[name]
    if not 0.0 <= amount <= largest:
        raise UsageError(f"--{option} {amount:g}: {unit} from 0 to {largest:g}.")
    return amount * factor


def _stop(word: str) -> tuple[int, float]:
    spin, _, percent = word.partition(":")
    try:
        number, share = int(spin), float(percent) / 100.0
    except ValueError:
        number, share = 0, 0.0
    if number < 1 or not 0.0 < share < 1.0:
        raise UsageError(
            f"--table-stops {word}: write the number of a spin, from 1, and after how many per cent of its "
            "angle it stops, such as 2:60."
        )
    return number - 1, share


def lever_arm(word: str | None) -> AnyArray | None:
    """Return a lever arm in m, (3,), or (3, 3) with a row for each accelerometer; None without.

    Parameters
    ----------
    word : three or nine numbers in cm with commas between them.

    Raises
    ------
    UsageError
        If it is anything else.
    """
    if word is None:
        return None
    import numpy as np

    try:
        numbers = 1e-2 * np.array([float(part) for part in word.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.size not in (3, 9) or not np.all(np.abs(numbers) <= 10.0):
        raise UsageError(
            f"--lever-arm-cm {word}: write three numbers in cm, such as 3,-2,1, or nine, three for each "
            "accelerometer; each at most 1000."
        )
    return numbers if numbers.size == 3 else numbers.reshape(3, 3)
