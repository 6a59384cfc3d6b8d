"""What holds and the turns between them offer, in raw units, as arrays.

Frames: s is the body frame at the last sample of hold k, e that at the first sample of hold k + 1.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors, inverted
from tumble.attitude import Inverse, average_at_edge
from tumble.records import dataclass
from tumble.segmentation import RestParts


@dataclass(frozen=True)
class HoldsAndTurns:
    """What holds and the turns between them offer to the adjustment, in raw units.

    Attributes
    ----------
    time, raw_force, raw_rate : the samples.
    force_mean, force_covariance : (holds, 3), (holds, 3, 3) hold means.
    rate_mean, rate_covariance : the same of the gyro.
    hold_samples : (holds,) how many samples each mean is of.
    head, tail : (holds, 2) sample ranges at a hold's start and end, where turns join it.
    turn_start, turn_stop : (holds,) sample range of the turn after hold k, from the last sample of
        its tail to the first of the next head; -1 where there is none that can be used.
    force_sample_variance : (3,) per sample at rest, raw².
    rate_random_walk : (3,) N² of each gyro, raw² s, from the holds.
    force_floor, rate_floor : (3,) raw², what no averaging takes away: a bias that wanders.
    parts : means of the parts of the holds, which show how biases wander; None where nobody asks.
    turn_sampling : (holds, 3) raw² s², variance of each gyro's integral over the turn after hold k by stamps that
        jitter and by values that are rounded; None where both are exact.
    rate_rounding : (holds, 3) raw², what of the gyro's covariance rounding leaves; None where nothing is known.
    """

    time: Series
    raw_force: Vectors
    raw_rate: Vectors
    force_mean: Vectors
    force_covariance: Matrices
    rate_mean: Vectors
    rate_covariance: Matrices
    hold_samples: np.ndarray
    head: np.ndarray
    tail: np.ndarray
    turn_start: np.ndarray
    turn_stop: np.ndarray
    force_sample_variance: Vector
    rate_random_walk: Vector
    force_floor: Vector
    rate_floor: Vector
    parts: RestParts | None = None
    turn_sampling: Vectors | None = None
    rate_rounding: Vectors | None = None

    @property
    def holds(self) -> int:
        """Number of holds."""
        return int(self.force_mean.shape[0])

    @property
    def samples(self) -> tuple[Series, Vectors, Vectors]:
        """Their time, raw rate and raw specific force."""
        return self.time, self.raw_rate, self.raw_force

    @cached_property
    def step(self) -> float:
        """Usual time between samples, s: the median of some hundred thousand of them."""
        return float(np.median(np.diff(self.time)[:: max(1, self.time.size // 200_000)]))


def window_directions(
    data: HoldsAndTurns, force_matrix: Matrix, force_bias: Vector, gyro_inverse: Matrix
) -> tuple[Vectors, Vectors]:
    """Return the corrected specific force at the first and at the last sample of each hold.

    Each is the mean of a window at the hold's edge, every sample turned to the edge by the gyro's
    deviation from the hold's own mean rate: tremor and sway are followed, bias and Earth rate not.
    """
    inverse = Inverse(gyro_inverse, data.rate_mean, inverted(force_matrix), force_bias)
    first = average_at_edge(*data.samples, data.head, inverse, "first")
    return first, average_at_edge(*data.samples, data.tail, inverse, "last")


def tangent_bases(directions: Vectors) -> AnyArray:
    """Return (items, 3, 2): for each vector two unit vectors perpendicular to it and to each other."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    first = _cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, _cross(unit, first)], axis=2)


def _cross(a: Vectors, b: Vectors) -> Vectors:
    """Return the cross products of rows; numpy's own costs five times as much for few rows."""
    return np.column_stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ]
    )
