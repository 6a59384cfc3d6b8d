"""What two calibrations of one unit share without seeing it: a nominal sample rate, an assumed magnetic field.

Both take the unit's own clock, or the norm of the field, to be what a data sheet or somebody says. By whatever that is
wrong, both are wrong alike: in a difference it cancels. With V the covariance of one of them and
g = d(parameters)/d(share), that part of V is at most 1/(gᵀ V⁻¹ g). Where the recording has determined the clock
itself, as a table does, that is less than what was assumed, and nothing is common.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table
from tumble.document.entries import PLACES
from tumble.document.magnetometer_block import FieldBlock
from tumble.document.result import Calibration, ParameterBlock
from tumble.parameters.family import parameter_of

_UNDETERMINED = 0.9  # of the assumed variance that a recording leaves, where it did not determine the clock
_SAME = (
    1e-5  # of a rate: regular stamps of two recordings give one data sheet rate to the digits that they have
)
_MATRIX = PLACES["gyroscope.matrix"][0]


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
    one, other = assumed
    if one is None or other is None or one[1] != other[1] or abs(one[0] / other[0] - 1.0) > _SAME:
        return 0.0
    variance = one[1] ** 2
    left = [_largest_part(spread, along_clock(own)) for own, spread in zip(values, spreads, strict=True)]
    return min(variance, *left) if min(left) >= _UNDETERMINED * variance else 0.0


def common_norm(
    fields: tuple[FieldBlock | None, FieldBlock | None], along: list[Series], spreads: tuple[Table, Table]
) -> float:
    """Return the variance of what both norms of the field are off alike, as a share squared; zero where nothing is.

    Parameters
    ----------
    fields : in which the magnetometers were found.
    along, spreads : (n,) numbers of which each moves as its own size, the others zero; and their covariances.
    """
    one, other = fields
    if one is None or other is None or one.norm_given != other.norm_given:
        return 0.0
    # A norm that is not given is by the mean scale that data sheets promise: of one unit it is one and the same.
    if one.norm_given and (one.source, one.norm) != (other.source, other.norm):
        return 0.0
    assumed = min((field.norm_standard_uncertainty / field.norm) ** 2 for field in (one, other))
    return min(assumed, *(_largest_part(spread, own) for own, spread in zip(along, spreads, strict=True)))


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
    """Return by how much a parameter moves per share that a clock, or the norm of the magnetic field, is off.

    Parameters
    ----------
    parameter : of any kind.
    """
    family = parameter_of(parameter.name).family
    if family.triad == "accelerometer" or family.kind not in ("scale factor", "scale factor error"):
        return 0.0
    return parameter.value + (1.0 if family.kind == "scale factor error" else 0.0)


def _largest_part(spread: Table, along: Series) -> float:
    """The largest c for which ``V - c g gᵀ`` is a covariance."""
    known = np.flatnonzero(np.diag(spread) > 0.0)
    if not np.any(along[known]) or np.any(along[np.setdiff1d(np.arange(along.size), known)]):
        return 0.0
    scaled = np.sqrt(np.diag(spread)[known])
    unit = spread[np.ix_(known, known)] / np.outer(scaled, scaled)
    slope = along[known] / scaled
    return float(1.0 / (slope @ np.linalg.pinv(unit, hermitian=True) @ slope))


def _assumed(calibration: Calibration) -> tuple[float, float] | None:
    """The rate that is taken as nominal, in Hz, and its relative standard uncertainty."""
    for one in calibration.quality.unseen:
        if one.nominal_rate_hz is not None:
            return one.nominal_rate_hz, one.relative_standard_uncertainty
    return None
