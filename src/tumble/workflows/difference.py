"""What changed from one calibration to another, and whether it matters."""

from __future__ import annotations

import os

import numpy as np

from tumble.document import read_calibration
from tumble.document.difference import Difference, compare_calibrations
from tumble.parameters.measures import Measure, amount, said
from tumble.units import STANDARD_GRAVITY

PathLike = str | os.PathLike[str]


def difference(first: PathLike, second: PathLike) -> Difference:
    """Return what changed from one calibration to another.

    Raises
    ------
    UsageError
        If they cannot be compared.
    CalibrationFileError
        If a file cannot be read.
    """
    return compare_calibrations(read_calibration(first), read_calibration(second))


_FORCE_ROUNDING = 1e-9 * STANDARD_GRAVITY  # m/s²
_RATE_ROUNDING = 1e-12  # rad/s


def verdict(found: Difference, allowed: tuple[float, float] | None) -> tuple[bool, list[str]]:
    """Return whether the change matters, and why, in sentences.

    Parameters
    ----------
    found : the change.
    allowed : m/s² at 1 g and rad/s at rest that do no harm; None: whatever is more than its uncertainty matters.
    """
    sentences: list[str] = []
    matters = False
    for effect, limit, rounding, text in (
        (found.force, None if allowed is None else allowed[0], _FORCE_ROUNDING, _force_text),
        (found.rest_rate, None if allowed is None else allowed[1], _RATE_ROUNDING, _rate_text),
    ):
        if effect is None:
            continue
        certain = effect.standard_uncertainty <= 0.0
        above = effect.value > max(2.0 * effect.standard_uncertainty, rounding)
        # The worst of many directions is beyond two sigmas more often than one: the parameters have to agree.
        seen = above and (certain or found.significant or not found.groups)
        large = seen if limit is None else effect.value > limit
        matters = matters or (large and seen)
        if certain:
            said = "no uncertainty of it is known" if above else "no more than rounding"
        else:
            said = "more than its uncertainty" if seen else "not more than its uncertainty explains"
        allowance = "" if limit is None else f", {'above' if large else 'within'} what is allowed"
        sentences.append(f"{text(effect.value, effect.standard_uncertainty)}: {said}{allowance}.")
    if found.groups:
        chance = "more" if found.significant else "no more"
        sentences.insert(0, f"The parameters differ by {chance} than chance (5 %, all groups together).")
    return matters, sentences


def _force_text(value: float, sigma: float) -> str:
    metres = 0.5 * value * 60.0**2
    return (
        f"Corrected specific forces of 1 g differ by up to {_said(value, sigma, 'm/s^2')}, a tilt of "
        f"{amount(value / STANDARD_GRAVITY, 'rad')} or {metres:.2g} m after a minute of dead reckoning"
    )


def _rate_text(value: float, sigma: float) -> str:
    return (
        f"Corrected rates at rest differ by up to {_said(value, sigma, 'rad/s')}, "
        f"{np.degrees(value) * 60.0:.2g}° a minute"
    )


def _said(value: float, sigma: float, unit: str) -> str:
    """A size with its uncertainty; what is certain is said to be so elsewhere."""
    return said([Measure(value, sigma, unit)])[0].text if sigma > 0.0 else amount(value, unit)
