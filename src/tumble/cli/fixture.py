"""What the options about a two-axis fixture mean: they are in the field's units, and the core's are SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.simulation import FixtureErrors

_DEGREE = math.pi / 180.0
# Option, its smallest and largest sensible value and unit, the factor to SI.
_OPTIONS = {
    "azimuth": ("fixture-azimuth-deg", -360.0, 360.0, "degrees", _DEGREE),
    "installation": ("fixture-installation-mrad", 0.0, 100.0, "milliradians", 1e-3),
    "orthogonality": ("fixture-orthogonality-mrad", 0.0, 100.0, "milliradians", 1e-3),
    "zero": ("fixture-zero-mrad", 0.0, 100.0, "milliradians", 1e-3),
    "mounting": ("fixture-mounting-mrad", 0.0, 100.0, "milliradians", 1e-3),
    "execution": ("fixture-execution-mrad", 0.0, 100.0, "milliradians", 1e-3),
    "rate": ("fixture-rate-deg-per-s", 0.1, 5000.0, "degrees per second", _DEGREE),
    "ramp": ("fixture-ramp-s", 0.0, 600.0, "seconds", 1.0),
    "pause": ("fixture-pause-s", 0.0, 600.0, "seconds", 1.0),
}


def fixture_errors(**amounts: float | None) -> tuple[FixtureErrors | None, float | None]:
    """Return the quality of the fixture, one sigma of each error, and rad, where its outer axis points.

    Without any option there is no fixture, with any the others are without error.

    Parameters
    ----------
    amounts : each option's number in its own unit; None for one that was not given.

    Raises
    ------
    UsageError
        If a number is not one that a fixture has.
    """
    si = {name: _in_si(name, amount) for name, amount in amounts.items() if amount is not None}
    if not si:
        return None, None
    from tumble.simulation import FixtureErrors

    installation, zero, mounting = (si.get(name, 0.0) for name in ("installation", "zero", "mounting"))
    usual = FixtureErrors()
    quality = FixtureErrors(
        heading=installation,
        tilt=(installation, installation),
        orthogonality=si.get("orthogonality", 0.0),
        inner_zero=zero,
        outer_zero=zero,
        mounting=(mounting, mounting, mounting),
        execution=si.get("execution", 0.0),
        rate=si.get("rate"),
        ramp=si.get("ramp", usual.ramp),
        pause=si.get("pause", usual.pause),
    )
    return quality, si.get("azimuth")


def _in_si(name: str, amount: float) -> float:
    option, smallest, largest, unit, factor = _OPTIONS[name]
    if not smallest <= amount <= largest:
        raise UsageError(f"--{option} {amount:g}: {unit} from {smallest:g} to {largest:g}.")
    return amount * factor
