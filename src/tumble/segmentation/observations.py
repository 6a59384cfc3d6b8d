"""What a hold tells: the mean of each triad with the covariance of that mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.errors import SegmentationError
from tumble.recording.recording import Recording
from tumble.segmentation.timeline import Hold, Timeline


@dataclass(frozen=True, slots=True)
class HoldMeans:
    """One row per hold; raw units.

    Attributes
    ----------
    specific_force, angular_rate : (holds, 3) means, or None without the triad.
    specific_force_covariance, angular_rate_covariance : (holds, 3, 3) of those means.
    specific_force_dof, angular_rate_dof : (holds,) effective degrees of freedom of the covariance.
    duration : (holds,) s at rest, without what is excluded.
    time : (holds,) s, the middle of each hold.
    count : (holds,) samples averaged.
    temperature : (holds,) degrees Celsius, or None.
    """

    specific_force: Vectors | None
    specific_force_covariance: Matrices | None
    specific_force_dof: Series | None
    angular_rate: Vectors | None
    angular_rate_covariance: Matrices | None
    angular_rate_dof: Series | None
    duration: Series
    time: Series
    count: Series
    temperature: Series | None

    def __len__(self) -> int:
        return int(self.duration.shape[0])


@dataclass(frozen=True, slots=True)
class MeanCovariance:
    """Means of several stretches (items, 3) with covariances (items, 3, 3) and degrees of freedom."""

    mean: Vectors
    covariance: Matrices
    dof: Series


# Batches of a hold: at least this many, so that its own variance has seven degrees of freedom or more.
BATCHES = 8
# One hold in a thousand that is like the others is called noisier.
EXCESS_FALSE_ALARM = 1e-3


def observe_holds(recording: Recording, timeline: Timeline) -> HoldMeans:
    """Average each hold and say how well the averages are known.

    Parameters
    ----------
    recording, timeline : raw samples and the holds found in them.

    Raises
    ------
    SegmentationError
        If the timeline has no holds.
    """
    holds = timeline.holds
    if not holds:
        raise SegmentationError("The timeline has no holds: there is nothing to average.")
    counts = np.array([sum(b - a for a, b in hold.stretches()) for hold in holds], dtype=float)
    force = _mean(recording.specific_force, holds)
    rate = _mean(recording.angular_rate, holds)
    return HoldMeans(
        specific_force=force.mean if force else None,
        specific_force_covariance=force.covariance if force else None,
        specific_force_dof=force.dof if force else None,
        angular_rate=rate.mean if rate else None,
        angular_rate_covariance=rate.covariance if rate else None,
        angular_rate_dof=rate.dof if rate else None,
        duration=counts / recording.rate,
        time=np.array([0.5 * (recording.time[h.start] + recording.time[h.stop - 1]) for h in holds]),
        count=counts,
        temperature=_temperatures(recording.temperature, holds),
    )


def _mean(signal: Vectors | None, holds: tuple[Hold, ...]) -> MeanCovariance | None:
    return None if signal is None else mean_covariance(signal, [hold.stretches() for hold in holds])


def _temperatures(temperature: Series | None, holds: tuple[Hold, ...]) -> np.ndarray | None:
    if temperature is None:
        return None
    return np.array([np.mean(np.concatenate([temperature[a:b] for a, b in h.stretches()])) for h in holds])


def mean_covariance(signal: Vectors, items: list[list[tuple[int, int]]]) -> MeanCovariance:
    """Average a signal over each item's stretches and find the covariance of each average.

    Method: batch means. An item of n samples is cut into 8 to 15 batches of equal length B (a power
    of two times the shortest); the variance of batch means about their item's mean, times B / n, is
    the variance of the item's mean, whatever the correlation of the noise within B. That variance is
    pooled over all items at the same B, which gives it many degrees of freedom (batches less one,
    summed over the items). Items whose own variance is larger, axis by axis, than an F test at 0.1 %
    allows are left out of the pool and keep their own: a knock or a creep inflates its own item only.

    The covariance is diagonal: what the sensors themselves add is independent per axis, and the few
    batches of one item could not support a full matrix. What correlates the axes of one hold (a
    tremor about one direction) is in the variances in full. Noise correlated over longer than a
    batch (flicker, drift from hold to hold) is not in it: within one hold nothing shows it.

    Parameters
    ----------
    signal : (samples, 3) raw.
    items : the half-open index ranges of each item, in order and without overlap.

    Raises
    ------
    SegmentationError
        If an item has fewer than two samples.

    References
    ----------
    Law and Kelton, Simulation Modeling and Analysis, chapter 9 (batch means).
    """
    signal = np.asarray(signal, dtype=float)
    counts = np.array([sum(b - a for a, b in item) for item in items])
    if counts.min(initial=2) < 2:
        raise SegmentationError("A hold of fewer than two samples has no mean with an uncertainty.")
    base = max(1, int(counts.min()) // (2 * BATCHES))
    parts = [[_batches(signal, a, b, base) for a, b in item] for item in items]
    means = np.array([sum(total for _, total in part) / n for part, n in zip(parts, counts, strict=True)])
    # level of each item: the batch length base * 2**level that leaves 8 to 15 batches
    levels = np.maximum(np.floor(np.log2(np.maximum(counts / (BATCHES * base), 1.0))), 0).astype(int)
    covariance = np.zeros((len(items), 3, 3))
    dof = np.zeros(len(items))
    for level in np.unique(levels):
        size = base * 2 ** int(level)
        variance, own_dof = _variances(parts, means, int(level))
        pooled, pooled_dof, noisier = _pool(variance, own_dof)
        for k in np.flatnonzero(levels == level):
            own = np.where(noisier[k], variance[k], pooled)
            covariance[k] = np.diag(own) * size / counts[k]
            dof[k] = own_dof[k] if noisier[k].any() else pooled_dof
    return MeanCovariance(means, covariance, dof)


def _batches(signal: Vectors, start: int, stop: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Means of the whole batches in a stretch, and the sum of all its samples."""
    from tumble.segmentation.kernels import block_moments

    count = (stop - start) // size
    mean, unused = np.empty((count, 3)), np.empty((count, 3), dtype=np.float32)
    if count:
        block_moments(signal[start:stop], size, mean, unused)
    return mean, size * mean.sum(axis=0) + signal[start + count * size : stop].sum(axis=0)


def _variances(
    parts: list[list[tuple[np.ndarray, np.ndarray]]], means: Vectors, level: int
) -> tuple[Vectors, Series]:
    """Variance of batch means of 2**level base batches per item and axis, and its degrees of freedom."""
    group = 2**level
    variance, dof = np.zeros((len(parts), 3)), np.zeros(len(parts))
    for k, part in enumerate(parts):
        batches = [m[: len(m) // group * group].reshape(-1, group, 3).mean(axis=1) for m, _ in part]
        values = np.concatenate(batches)
        if len(values) >= 2:
            dof[k] = len(values) - 1
            variance[k] = np.sum((values - values.mean(axis=0)) ** 2, axis=0) / dof[k]
    return variance, dof


def _pool(variance: Vectors, dof: Series) -> tuple[np.ndarray, float, np.ndarray]:
    """Pooled variance per axis, its degrees of freedom, and which items are noisier on which axis."""
    from scipy.special import fdtri

    told = dof > 0
    noisier = np.zeros(variance.shape, dtype=bool)
    if not told.any():
        return np.zeros(3), 0.0, noisier
    # the median over items starts the pool, so that a few knocked holds cannot set the standard
    pooled = np.median(variance[told], axis=0)
    pooled_dof = np.full(3, max(float(np.median(dof[told])), 1.0))
    for _ in range(10):
        limit = fdtri(dof[:, None].clip(1), pooled_dof[None, :], 1.0 - EXCESS_FALSE_ALARM)
        found = told[:, None] & (variance > limit * pooled)
        weight = np.where(found, 0.0, dof[:, None])
        total = weight.sum(axis=0)
        usable = total > 0
        pooled = np.where(usable, (weight * variance).sum(axis=0) / np.maximum(total, 1.0), pooled)
        pooled_dof = np.where(usable, total, pooled_dof)
        if np.array_equal(found, noisier):
            break
        noisier = found
    return pooled, float(pooled_dof.min()), noisier
