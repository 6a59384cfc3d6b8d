"""What two calibrations of one unit share without seeing it: the assumption of one nominal sample rate.

Both take the unit's own clock to be as fast as its data sheet says. By whatever that is wrong, both are wrong alike: in
a difference it cancels. With V the covariance of one of them and g = d(parameters)/d(share), the clock's part of V is
at most 1/(gᵀ V⁻¹ g). Where the recording has determined the clock itself, as a table does, that is less than what
was assumed, and nothing is common.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table
from tumble.calibration.equations.causes import SAMPLE_RATE
from tumble.document.entries import PLACES
from tumble.document.result import Calibration, ParameterBlock

_UNDETERMINED = 0.9  # of the assumed variance that a recording leaves, where it did not determine the clock
_MATRIX = PLACES["gyroscope.matrix"][0]
_SCALE = "gyro scale factor"


def common_clock(
    calibrations: tuple[Calibration, Calibration], values: tuple[Series, Series], spreads: tuple[Table, Table]
) -> float:
    """Return the variance of what both clocks are off alike, as a share squared; zero where nothing is common.

    Parameters
    ----------
    calibrations : of one unit.
    values, spreads : (parameters,) and their covariances, as `entries.stacked` gives them.
    """
    assumed = [_assumed(calibration) for calibration in calibrations]
    if assumed[0] is None or assumed[0] != assumed[1]:
        return 0.0
    variance = assumed[0][1] ** 2
    left = [_largest_part(spread, along_clock(own)) for own, spread in zip(values, spreads, strict=True)]
    return min(variance, *left) if min(left) >= _UNDETERMINED * variance else 0.0


def along_clock(values: Series) -> Series:
    """Return by how much each number moves per share that a clock is off: the gyros' matrix does.

    Parameters
    ----------
    values : (parameters,) as `entries.stacked` gives them.
    """
    along = np.zeros_like(values)
    along[_MATRIX] = values[_MATRIX]
    return along


def scale_slope(parameter: ParameterBlock) -> float:
    """Return by how much a parameter moves per share that a clock is off.

    Parameters
    ----------
    parameter : of any kind.
    """
    if not parameter.name.startswith(_SCALE):
        return 0.0
    return parameter.value + (1.0 if parameter.name.startswith(f"{_SCALE} error") else 0.0)


def _largest_part(spread: Table, along: Series) -> float:
    """The largest c for which ``V - c g gᵀ`` is a covariance."""
    known = np.flatnonzero(np.diag(spread) > 0.0)
    if not np.any(along[known]) or np.any(along[np.setdiff1d(np.arange(along.size), known)]):
        return 0.0
    scaled = np.sqrt(np.diag(spread)[known])
    unit = spread[np.ix_(known, known)] / np.outer(scaled, scaled)
    slope = along[known] / scaled
    return float(1.0 / (slope @ np.linalg.pinv(unit, hermitian=True) @ slope))


def _assumed(calibration: Calibration) -> tuple[str, float] | None:
    """The rate that is taken as nominal, in words, and its relative standard uncertainty."""
    for one in calibration.quality.unseen:
        _, nominal, rate = one.because.partition("nominal")
        if one.source == SAMPLE_RATE and nominal:
            return rate.strip(), one.relative_standard_uncertainty
    return None
