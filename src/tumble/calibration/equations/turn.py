"""The conditions of a recording tumbled by hand: holds, and the turns between them.

Nothing is known of the motion but that the unit rests in the holds. Each hold k gives a group of six:

- norm: the hold's mean specific force, corrected, has the norm of gravity;
- rate (3): the hold's mean raw rate is the gyro's bias, its g-sensitivity times the specific force,
  and what it sees of the Earth's rotation;
- turn (2): the specific force at the end of hold k, carried by the integrated gyro over the turn to
  hold k + 1, is the specific force seen there; two components, perpendicular to it.

Frames: s is the body frame at the last sample of hold k, e that at the first sample of hold k + 1.
The Earth turns by ``earth_rate_s * T`` meanwhile, so that with C_se from the gyro

    C_se @ f_e = (1 + skew(earth_rate_s) T) @ f_s.

The Earth's rotation is three unknowns in the body frame of the first hold, carried along by the gyro;
their prior is what the site tells. Where the gyro cannot be integrated (a gap) the chain starts anew
with a prior-sized variance instead.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors, inverted
from tumble.attitude.integration import average_at_edge
from tumble.calibration.equations.triad_unknowns import COUNT
from tumble.records import dataclass
from tumble.segmentation.rest_wander import RestParts

# Where each unknown stands in the full list.
FORCE = slice(0, COUNT)
GYRO_MATRIX = slice(12, 21)
GYRO_BIAS = slice(21, 24)
G_SENSITIVITY = slice(24, 33)
EARTH = slice(33, 36)
TOTAL = 36

NORM, RATE, TURN = slice(0, 1), slice(1, 4), slice(4, 6)
GROUP = 6
# Of the flicker floor of a hold's mean, what lies between it and the mean of a part.
FLICKER_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class HoldsAndTurns:
    """What a hand-held recording offers to the adjustment, in raw units.

    Attributes
    ----------
    time, raw_force, raw_rate : the samples.
    force_mean, force_covariance : (holds, 3), (holds, 3, 3) hold means.
    rate_mean, rate_covariance : the same of the gyro.
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
    inverse = inverted(force_matrix)

    def at(window: np.ndarray, edge: str) -> Vectors:
        return average_at_edge(
            data.time,
            data.raw_rate,
            data.raw_force,
            window[:, 0],
            window[:, 1],
            edge=edge,
            gyro_inverse=gyro_inverse,
            gyro_bias=data.rate_mean,
            force_inverse=inverse,
            force_bias=force_bias,
        )

    return at(data.head, "first"), at(data.tail, "last")


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
