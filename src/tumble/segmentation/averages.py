"""Averages over stretches of samples, with the covariance of each average from the samples alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tumble.arrays import Matrices, Series, Vectors, block_means
from tumble.errors import SegmentationError
from tumble.segmentation.rounding import rounding_variance

# Batches of a hold: at least this many, so that its own variance has seven degrees of freedom or more.
BATCHES = 8
# One hold in a thousand that is like the others is called noisier.
EXCESS_FALSE_ALARM = 1e-3
# Sigmas by which the Allan variance has to lie above white noise for a flicker floor to be believed.
FLOOR_SIGMAS = 2.3

# Share of the largest mean below which a mean is not believed, whatever its scatter.
DIGITS = 1e-8


class MeanCovariance(NamedTuple):
    """Means of several stretches (items, 3) with covariances (items, 3, 3).

    `rounding` (items, 3) is what of the variances rounding leaves: no wander of the signal.
    """

    mean: Vectors
    covariance: Matrices
    rounding: Vectors


def mean_covariance(
    signal: Vectors,
    items: list[list[tuple[int, int]]],
    *,
    span: int | None = None,
    rounding: Vectors | None = None,
) -> MeanCovariance:
    """Average a signal over each item's stretches and find the covariance of each average.

    Three things are added. *Batch means*: an item of n samples is cut into 8 to 15 batches of equal
    length B (a power of two times the shortest); the variance of batch means about their item's mean,
    times B / n, is the variance of the item's mean, whatever the correlation of the noise within B.
    It is pooled over all items at the same B, which gives it many degrees of freedom (batches less
    one, summed over the items). Items whose own variance is larger, axis by axis, than an F test at
    0.1 % allows are left out of the pool and keep their own: a knock or a creep inflates its own item
    only. *A flicker floor*: where the pooled Allan variance at the longest batches lies significantly
    above white noise, N²/τ + F, the means of items wander against one another by more than batches
    within one can tell; for 1/f noise by F ln(T/n) / (2 ln 2), T the samples from the first item to
    the last. A floor much below the white noise of an item's mean is not seen, and hardly matters. *Rounding*: what the
    converter's step leaves where noise does not dither it (`tumble.segmentation.rounding`).

    The covariance is diagonal: what the sensors themselves add is independent per axis, and the few
    batches of one item could not support a full matrix. What correlates the axes of one hold (a
    tremor about one direction) is in the variances in full. Wander that is common to neighbouring
    items correlates them; each covariance is that of one item alone.

    Parameters
    ----------
    signal : (samples, 3) raw.
    items : the half-open index ranges of each item, in order and without overlap.
    span : samples from the first item to the end of the last on the recording's clock, where `signal`
        holds the items alone.
    rounding : (items, 3) what rounding leaves, raw units squared, where `signal` is no longer as the converter
        wrote it; None finds it.

    Raises
    ------
    SegmentationError
        If an item has fewer than two samples.

    References
    ----------
    Law and Kelton, Simulation Modeling and Analysis, chapter 9 (batch means). IEEE Std 952, annex C:
    the density B²/(2πf) has the Allan floor (2 ln 2 / π) B²; between the frequencies 1/T and 1/n it
    has the variance B²/π ln(T/n).
    """
    signal = np.asarray(signal, dtype=float)
    counts = np.array([sum(b - a for a, b in item) for item in items])
    if counts.min(initial=2) < 2:
        raise SegmentationError("A hold of fewer than two samples has no mean with an uncertainty.")
    base = _shortest_batch(int(counts.min()))
    parts = [[batches(signal, a, b, base) for a, b in item] for item in items]
    means = np.array([sum(total for _, total in part) / n for part, n in zip(parts, counts, strict=True)])
    # level of each item: the batch length base * 2**level that leaves 8 to 15 batches
    levels = np.array([_level(int(count), base) for count in counts])
    variances = np.zeros((len(items), 3))
    disturbed = np.zeros(len(items), dtype=bool)
    for level in np.unique(levels):
        variance, own_dof = _variances(parts, int(level))
        pooled, _, noisier = _pool(variance, own_dof)
        here = levels == level
        disturbed |= here & noisier.any(axis=1)
        variances[here] = np.where(noisier, variance, pooled)[here] * base * 2 ** int(level)
    calm = [part for part, out in zip(parts, disturbed, strict=True) if not out]
    floor = _flicker_floor(calm, int(np.median(levels)))
    if span is None:
        span = max(item[-1][1] for item in items) - min(item[0][0] for item in items)
    wander = np.maximum(np.log(span / counts), 0.0)[:, None] * floor / (2.0 * np.log(2.0))
    # A signal without any noise (simulated, or a sensor that stands still) is still written in digits.
    digits = (DIGITS * float(np.max(np.abs(means)))) ** 2
    if rounding is None:
        rounding = rounding_variance(signal, items, means)
    variances = np.maximum(variances / counts[:, None] + wander + rounding, digits)
    return MeanCovariance(means, variances[:, :, None] * np.eye(3), rounding)


def batch_length(count: int, least: int) -> int:
    """Return the samples of a batch that `mean_covariance` cuts an item into.

    Parameters
    ----------
    count, least : samples of the item, and of the shortest item beside it.
    """
    base = _shortest_batch(least)
    return base * 2 ** _level(count, base)


def _shortest_batch(least: int) -> int:
    return max(1, least // (2 * BATCHES))


def _level(count: int, base: int) -> int:
    return max(int(np.floor(np.log2(max(count / (BATCHES * base), 1.0)))), 0)


def batches(signal: Vectors, start: int, stop: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of the whole batches in a stretch, and the sum of all its samples.

    Parameters
    ----------
    signal, start, stop : (samples, 3), and the half-open range.
    size : samples of a batch.
    """
    from tumble.segmentation.kernels import block_moments

    count = (stop - start) // size
    mean, unused = np.empty((count, 3)), np.empty((count, 3), dtype=np.float32)
    if count:
        block_moments(signal[start:stop], size, mean, unused)
    return mean, size * mean.sum(axis=0) + signal[start + count * size : stop].sum(axis=0)


def _variances(parts: list[list[tuple[np.ndarray, np.ndarray]]], level: int) -> tuple[Vectors, Series]:
    """Variance of batch means of 2**level base batches per item and axis, and its degrees of freedom."""
    group = 2**level
    variance, dof = np.zeros((len(parts), 3)), np.zeros(len(parts))
    for k, part in enumerate(parts):
        batches = [block_means(m, group) for m, _ in part]
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


def _flicker_floor(parts: list[list[tuple[np.ndarray, np.ndarray]]], top: int) -> np.ndarray:
    """The floor F of the Allan variance N²/τ + F per axis, or zero where white noise explains it.

    Decided for the three axes together, which are of one make: each is measured by its own N², and
    what they have in common has three times the degrees of freedom of one.
    """
    levels: list[int] = []
    dofs: list[float] = []
    variances: list[np.ndarray] = []
    for level in range(max(top - 1, 0), top + 4):
        variance, pairs = _allan(parts, level)
        if np.count_nonzero(pairs) >= 4:
            pooled, dof, _ = _pool(variance, pairs)
            levels.append(level)
            dofs.append(dof)
            variances.append(pooled)
    # in units of the variance of the shortest batch's white noise
    length = 2.0 ** (np.array(levels) - levels[0]) if levels else np.ones(0)
    if len(levels) < 2 or min(float(v.min()) for v in variances) <= 0.0:
        return np.zeros(3)
    common = np.mean(np.array(variances) / variances[0], axis=1)
    # neighbouring differences share a mean: two thirds of the degrees of freedom that they seem to have
    weight = np.array(dofs) / common**2
    # normal equations of the weighted fit of 1/τ and 1, written out
    aa, ab, bb = np.sum(weight / length**2), np.sum(weight / length), np.sum(weight)
    determinant = aa * bb - ab**2
    floor = float((aa * np.sum(weight * common) - ab * np.sum(weight * common / length)) / determinant)
    # Grows from nothing where it begins to be significant: a yes or no here would double or halve every
    # stated uncertainty for the loss of a few samples.
    limit = FLOOR_SIGMAS * float(np.sqrt(aa / determinant))
    return variances[0] * floor * (1.0 - (limit / floor) ** 2) if floor > limit else np.zeros(3)


def _allan(parts: list[list[tuple[np.ndarray, np.ndarray]]], level: int) -> tuple[Vectors, Series]:
    """Allan variance at 2**level base batches per item and axis, and the number of differences."""
    group = 2**level
    variance, pairs = np.zeros((len(parts), 3)), np.zeros(len(parts))
    for k, part in enumerate(parts):
        steps = [np.diff(block_means(m, group), axis=0) for m, _ in part]
        values = np.concatenate(steps)
        if len(values):
            pairs[k] = len(values)
            variance[k] = 0.5 * np.mean(values**2, axis=0)
    return variance, pairs
