"""What an earlier calibration of the same unit still knows.

Biases and scale factors change with every power cycle and with temperature; the angles between the
sensing axes are set by the assembly and stay (Hayal, chapter 6). An earlier calibration therefore
gives its non-orthogonalities, with their covariance, and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tumble.arrays import Square, Vector, inverted
from tumble.errors import CalibrationFileError
from tumble.sensor import propagate
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.gauge import lower_factor


@dataclass(frozen=True, slots=True)
class StableKnowledge:
    """Accelerometer angles yz, zx, zy (rad) with their covariance (3, 3); of the unit itself, or of its fleet."""

    angles: Vector
    angle_covariance: Square
    of_fleet: bool = False


def stable_knowledge(matrix: np.ndarray, covariance: Square) -> StableKnowledge:
    """Return the angles of an accelerometer matrix with the covariance of its nine entries.

    Raises
    ------
    CalibrationFileError
        If the covariance determines nothing of the angles.
    """
    angles, spread = propagate(
        lambda x: shin_from_matrix(lower_factor(x.reshape(3, 3)))[1], matrix.ravel(), covariance
    )
    if not np.all(np.diag(spread) > 0):
        raise CalibrationFileError(
            "The calibration given as prior states no uncertainty for its non-orthogonalities, "
            "so that it cannot be weighed: give one that has a covariance of the accelerometer matrix."
        )
    return StableKnowledge(np.real(angles), spread)


def weighted_knowledge(each: Sequence[StableKnowledge]) -> StableKnowledge:
    """Return what several recordings of one unit know together.

    Parameters
    ----------
    each : one or more, independent of one another.
    """
    precisions = [inverted(one.angle_covariance) for one in each]
    covariance = inverted(np.sum(precisions, axis=0))
    right = np.sum([p @ one.angles for p, one in zip(precisions, each, strict=True)], axis=0)
    return StableKnowledge(covariance @ right, covariance)


# Chance of objecting to a prior that is the unit's own.
CONTRADICTION_FALSE_ALARM = 1e-3


def find_contradiction(prior: StableKnowledge, own: StableKnowledge) -> str | None:
    """Return a sentence if the recording's own angles contradict the prior's (chi-square, 3 degrees)."""
    from scipy.special import chdtrc

    difference = own.angles - prior.angles
    spread = own.angle_covariance + prior.angle_covariance
    statistic = float(difference @ np.linalg.solve(spread, difference))
    if float(chdtrc(3.0, statistic)) >= CONTRADICTION_FALSE_ALARM:
        return None
    worst = float(np.max(np.abs(difference) / np.sqrt(np.diag(spread))))
    cause = (
        "The unit is of another kind than the fleet's, or it was damaged"
        if prior.of_fleet
        else "It is another unit's, or this unit has been dropped"
    )
    return (
        "The prior contradicts the recording: its non-orthogonalities differ from those of these "
        f"poses by up to {1e3 * np.max(np.abs(difference)):.2g} mrad, {worst:.0f} standard "
        f"uncertainties. {cause}: calibrate without --prior."
    )
