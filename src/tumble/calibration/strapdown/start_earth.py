"""Where north and what latitude the gyros see at rest, against what they were told.

Before and after each sequence the gyros show their bias, their g-sensitivity and the Earth rate. The first is the same
for all, the others go with the attitude: attitudes that differ separate them. Gyros that see the Earth rate well
enough then contradict a wrong heading or a wrong latitude.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Series, Square, Table, Vector, inverted
from tumble.calibration.closed_forms.rotation_sequences import SequenceModel
from tumble.calibration.strapdown.recorded_sequences import RecordedSequence
from tumble.records import dataclass
from tumble.sensor import ImuModel

# Bias, horizontal Earth rate and g-sensitivity.
_UNKNOWNS = 3 + 2 + 9


@dataclass(frozen=True, slots=True)
class SeenEarth:
    """What the gyros see of the Earth rate beyond what was told.

    Attributes
    ----------
    heading, heading_sigma : rad, by which north is off, clockwise seen from above.
    sensitivity : (3, 3) (rad/s)/g, what goes with the specific force: an upward Earth rate that was not told, too.
    covariance : (9, 9) of it, row by row.
    """

    heading: float
    heading_sigma: float
    sensitivity: Matrix
    covariance: Square


def find_earth(
    sequences: list[RecordedSequence], models: list[SequenceModel], model: ImuModel, noise: float
) -> SeenEarth | None:
    """Return what the rests show of the Earth rate; None if nothing was told or too little is seen.

    Parameters
    ----------
    sequences, models : with the Earth rate as it was told, and the nominal attitudes.
    model : of the gyros, as good as known.
    noise : rad²/s, of the gyros' angle.
    """
    if any(s.unknown_rate > 0.0 for s in sequences):
        return None
    assert model.gyroscope is not None
    inverse = inverted(model.gyroscope.matrix)
    told: list[Vector] = []
    seen: list[Vector] = []
    seconds: list[float] = []
    for s, nominal in zip(sequences, models, strict=True):
        told += [s.earth_rate_start, nominal.C_start_end.T @ s.earth_rate_start]
        seen += [inverse @ np.mean(s.rate[a:b], axis=0) for a, b in (s.start, s.end)]
        seconds += [s.time_step * (b - a) for a, b in (s.start, s.end)]
    down = np.array([d for nominal in models for d in (nominal.down_start, nominal.down_end)])
    weight = np.repeat(np.sqrt(np.array(seconds) / noise), 3)
    earth = np.array(told)
    upward = np.sum(earth * down, axis=1, keepdims=True) * down
    north = earth - upward
    # Three of the bias, the horizontal Earth rate as told and a quarter turn from it, nine of the g-sensitivity.
    design = np.zeros((len(down), 3, _UNKNOWNS))
    design[:, :, :3] = np.eye(3)
    design[:, :, 3], design[:, :, 4] = north, np.cross(down, north)
    for i in range(3):
        design[:, i, 5 + 3 * i : 8 + 3 * i] = -down
    scaled: Table = weight[:, None] * design.reshape(-1, _UNKNOWNS)
    right: Series = weight * (np.array(seen) - upward).ravel()
    found, _, rank, _ = np.linalg.lstsq(scaled, right)
    values: Series = np.asarray(found, dtype=np.float64)
    if rank < _UNKNOWNS or right.size == _UNKNOWNS:
        return None
    factor = max(1.0, float(np.sum((right - scaled @ values) ** 2)) / (right.size - _UNKNOWNS))
    covariance = factor * inverted(scaled.T @ scaled)
    ahead, aside = values[3:5]
    across = np.array([-aside, ahead]) / np.hypot(ahead, aside)
    return SeenEarth(
        float(np.arctan2(aside, ahead)),
        float(np.sqrt(across @ covariance[3:5, 3:5] @ across)),
        values[5:].reshape(3, 3),
        covariance[5:, 5:],
    )


def earth_as_sensitivity(unknown_rate: float, gravity: float) -> Square:
    """Return (9, 9), ((rad/s)/(m/s²))², of a g-sensitivity by rows that an Earth rate which was not told looks like.

    Its vertical part goes with the specific force, the same for all gyros; its horizontal part with the attitudes,
    which on a fixture of one heading may go with the specific force, too.

    Parameters
    ----------
    unknown_rate : rad/s.
    gravity : m/s².
    """
    alike = np.eye(3).ravel()
    return (unknown_rate / gravity) ** 2 * (np.outer(alike, alike) + 0.5 * np.eye(9))
