"""What a magnetometer shows in each hold: the mean of its samples, with what noise and resolution leave uncertain."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Series, Vector, Vectors
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.records import dataclass
from tumble.segmentation.rounding import rounding_variance, step_at_rests

# A hold with fewer samples of the magnetometer takes no part.
FEWEST_SAMPLES = 3


@dataclass(frozen=True, slots=True)
class FieldMeans:
    """The magnetometer's mean in each hold.

    Attributes
    ----------
    mean, covariance : (holds, 3), (holds, 3, 3) raw; of a hold without samples zero and one.
    count : (holds,) samples.
    time : (holds,) s, the middle of each hold.
    """

    mean: Vectors
    covariance: Matrices
    count: np.ndarray
    time: Series

    @property
    def seen(self) -> np.ndarray:
        """(holds,) whether there are samples enough."""
        return self.count >= FEWEST_SAMPLES


def field_means(time: Series, values: Vectors, base: HoldsAndTurns) -> FieldMeans:
    """Return the means of a magnetometer over the holds.

    Parameters
    ----------
    time, values : (samples,) s on the recording's own time axis, and (samples, 3) raw; rows that are not finite are
        left out.
    base : the holds.

    Notes
    -----
    White noise falls with the root of the samples, by the scatter within the holds, the same for all of them. What
    rounding leaves stays (`tumble.segmentation.rounding`).
    """
    finite = np.isfinite(time) & np.all(np.isfinite(values), axis=1)
    time, values = time[finite], values[finite]
    edges = np.column_stack([base.time[base.head[:, 0]], base.time[base.tail[:, 1] - 1]])
    first = np.searchsorted(time, edges[:, 0], side="left")
    last = np.searchsorted(time, edges[:, 1], side="right")
    count = last - first
    mean = np.zeros((base.holds, 3))
    scatter: list[Vector] = []
    some = count >= FEWEST_SAMPLES
    for k in np.flatnonzero(some).tolist():
        rows = values[first[k] : last[k]]
        mean[k] = rows.mean(axis=0)
        # Of neighbours: what drifts slowly is no noise of a sample.
        scatter.append(0.5 * np.mean(np.diff(rows, axis=0) ** 2, axis=0))
    variance = np.median(scatter, axis=0) if scatter else np.ones(3)
    rests = [[(int(a), int(b))] for a, b in zip(first[some], last[some], strict=True)]
    white = np.maximum(variance, step_at_rests(values, rests) ** 2 / 12.0)
    stays = np.zeros((base.holds, 3))
    stays[some] = rounding_variance(values, rests, mean[some])
    samples = np.maximum(count, 1)[:, None]
    spread = np.maximum(white / samples + stays, (1e-9 * max(float(np.max(np.abs(mean))), 1e-300)) ** 2)
    spread = np.where(some[:, None], spread, 1.0)
    return FieldMeans(mean, spread[:, :, None] * np.eye(3), count, edges.mean(axis=1))
