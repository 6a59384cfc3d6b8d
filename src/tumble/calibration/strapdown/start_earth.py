"""Where north and what latitude the gyros see at rest, against what they were told.

Before each sequence the gyros show their bias and the Earth rate. The bias is the same for all, the Earth rate
goes with the attitude: attitudes that differ tell the two apart, and gyros that see the Earth rate well
enough contradict a wrong heading or a wrong site.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors, inverted
from tumble.calibration.strapdown.recorded_sequences import RecordedSequence
from tumble.sensor import ImuModel

FEWEST = 4
_STEP = float(np.radians(2.0))


@dataclass(frozen=True, slots=True)
class SeenEarth:
    """What the gyros see of the Earth rate beyond what was told.

    Attributes
    ----------
    heading, heading_sigma : rad, by which north is off, clockwise seen from above.
    vertical, vertical_sigma : rad/s, the upward Earth rate beyond that of the latitude.
    """

    heading: float
    heading_sigma: float
    vertical: float
    vertical_sigma: float


def find_earth(sequences: list[RecordedSequence], model: ImuModel, noise: float) -> SeenEarth | None:
    """Return what the starts of the sequences show of the Earth rate; None if nothing was told or too little is seen.

    Parameters
    ----------
    sequences : with the Earth rate as it was told.
    model : of the gyros, as good as known.
    noise : rad²/s, of the gyros' angle.
    """
    if any(s.unknown_rate > 0.0 for s in sequences) or len(sequences) < FEWEST:
        return None
    assert model.gyroscope is not None
    inverse = inverted(model.gyroscope.matrix)
    told = np.array([s.earth_rate_start for s in sequences])
    down = np.array([s.down_start for s in sequences])
    seen = np.array([inverse @ np.mean(s.rate[s.start[0] : s.start[1]], axis=0) for s in sequences])
    seconds = np.array([s.time_step * (s.start[1] - s.start[0]) for s in sequences])
    weight = np.repeat(np.sqrt(seconds / noise), 3)
    across = told - np.einsum("ki,ki->k", told, down)[:, None] * down
    if np.max(np.linalg.norm(across, axis=1)) == 0.0:
        return None

    def fit(angle: float) -> tuple[float, Series, Table]:
        """Square sum, (bias, upward rate) and their cofactor with north off by an angle."""
        turned = _turned(across, down, angle) - across
        right = weight * (seen - told - turned).ravel()
        design = np.zeros((len(down), 3, 4))
        design[:, :, :3] = np.eye(3)
        design[:, :, 3] = -down
        scaled = weight[:, None] * design.reshape(-1, 4)
        cofactor = np.asarray(np.linalg.pinv(scaled.T @ scaled), dtype=np.float64)
        values = cofactor @ (scaled.T @ right)
        return float(np.sum((right - scaled @ values) ** 2)), values, cofactor

    angles: list[float] = np.arange(-np.pi, np.pi, _STEP).tolist()
    best = _refined(lambda a: fit(a)[0], min(angles, key=lambda a: fit(a)[0]))
    square, values, cofactor = fit(best)
    slope = (_turned(across, down, best + 0.5 * np.pi)).ravel() * weight
    factor = max(1.0, square / max(3 * len(down) - 5, 1))
    return SeenEarth(
        best,
        float(np.sqrt(factor / np.sum(slope**2))),
        float(values[3]),
        float(np.sqrt(factor * cofactor[3, 3])),
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


def _turned(across: Vectors, down: Vectors, angle: float) -> Vectors:
    """Horizontal vectors in b with north turned clockwise, which is about down."""
    return np.cos(angle) * across + np.sin(angle) * np.cross(down, across)


def _refined(cost: Callable[[float], float], start: float) -> float:
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        cost, bounds=(start - _STEP, start + _STEP), method="bounded", options={"xatol": 1e-8}
    )
    return float(found.x)
