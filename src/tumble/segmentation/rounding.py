"""What a converter's step leaves in a mean: rounding averages out only as far as noise dithers it.

Samples are rounded to multiples of a step Δ. The mean of many samples is off by as much as half a step where noise does
not dither it, and by nothing from half a step of noise on (Widrow and Kollár, Quantization Noise, 2008). How the
samples of a rest lie on the steps determines what can be known: with noise of standard deviation σ before the rounding
a share Φ(((j + 1/2)Δ - x) / σ) - Φ(((j - 1/2)Δ - x) / σ) of them is jΔ, and their mean is off x by so much. σ is that
of all rests together, x of each: over what the samples leave possible of both, the mean square of what the mean is off
is the variance. Rests that show the same number are off by the same: together they know no more than one.

Pulses of an integral are another thing: what is left of a step goes into the next sample, and a mean loses nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors

Item = Sequence[tuple[int, int]]
# So many rests, samples of each and samples before it, where the unit may move, show the step.
_RESTS, _SEEN, _BEFORE = 40, 500, 200
# Fewer differences say nothing: two levels without noise differ by a multiple of themselves.
_FEWEST = 6
# In steps: decimals that were cut off; so many of the differences are multiples to that.
_WHOLE, _MOST = 0.2, 0.9
# So many samples of a rest show how they lie: more, and that neighbours are alike would matter.
_SAMPLES = 64
# In steps squared: samples that scatter by more are dithered.
_DITHERED = 0.5
# In steps: the noise that may be there, each share of it as likely as any, and where the true value may be.
_NOISE = np.geomspace(0.01, 0.8, 20)
_PLACES = np.linspace(-0.75, 0.75, 61)
# Steps beyond those seen that noise may reach.
_BEYOND = 3
# Sums of so many samples scatter less than this share of what samples that do not know of one another would make them;
# chance does so more rarely than the third. Noise that makes up for itself but is rounded each sample keeps a third.
_SUMMED, _LESS, _CHANCE = 32, 0.25, 1e-4


def converter_step(values: Vectors) -> Vector:
    """Return (3,) the converter's step, of which all differences of values are multiples; 0 of numbers without one.

    Parameters
    ----------
    values : (samples, 3) raw.
    """
    made = np.zeros(3)
    for axis in range(3):
        steps = np.diff(np.unique(values[:, axis]))
        size = float(np.max(np.abs(values[:, axis]), initial=0.0))
        steps = steps[steps > 1e-7 * size]
        # A quantised signal has few values: each is seen several times. So is a signal without any noise at rest.
        if _FEWEST <= steps.size < len(values) / 3:
            least = float(np.mean(steps[steps < 1.5 * steps.min()]))
            whole = np.abs(steps / least - np.rint(steps / least)) < _WHOLE
            made[axis] = least if np.mean(whole) > _MOST else 0.0
    return made


def step_at_rests(signal: Vectors, items: Sequence[Item]) -> Vector:
    """Return (3,) the converter's step, raw, from samples of some rests and of what comes before each.

    Parameters
    ----------
    signal : (samples, 3) raw.
    items : half-open index ranges of each rest.
    """
    pieces = [signal[max(a - _BEFORE, 0) : min(a + _SEEN, b)] for a, b in _some(items)]
    return converter_step(np.concatenate(pieces)) if pieces else np.zeros(3)


def rounding_variance(signal: Vectors, items: Sequence[Item], means: Vectors) -> Vectors:
    """Return (items, 3) raw², what rounding leaves in the means of rests, for an adjustment that takes each by itself.

    Parameters
    ----------
    signal : (samples, 3) raw, as the converter wrote it.
    items : half-open index ranges of each rest.
    means : (items, 3) of the rests.
    """
    left = rounding_of_each(signal, items, means)
    if not np.any(left):
        return left
    half = 0.5 * step_at_rests(signal, items) * (1.0 - 1e-6)
    for axis in np.flatnonzero(np.any(left > 0.0, axis=0) & ~carries_remainder(signal, items)).tolist():
        order = np.argsort(means[:, axis])
        value, sums = means[order, axis], np.concatenate([[0.0], np.cumsum(left[order, axis])])
        alike = np.searchsorted(value, [value - half[axis], value + half[axis]])
        left[order, axis] = sums[alike[1]] - sums[alike[0]]
    return left


def rounding_of_each(signal: Vectors, items: Sequence[Item], means: Vectors) -> Vectors:
    """Return (items, 3) raw², variance of what rounding leaves in the mean of each rest alone.

    Parameters
    ----------
    signal, items, means : as for `rounding_variance`.
    """
    left = np.zeros((len(items), 3))
    step = step_at_rests(signal, items)
    if not np.any(step > 0.0):
        return left
    carried = carries_remainder(signal, items)
    # Of a carried remainder what is left at either end, as likely as any.
    samples = np.array([sum(b - a for a, b in item) for item in items])
    left[:, carried] = step[carried] ** 2 / 6.0 / samples[:, None] ** 2
    step = np.where(carried, 0.0, step)
    chosen = [_evenly(item) for item in items]
    counts = np.array([len(at) for at in chosen])
    first = np.cumsum(counts) - counts
    every = np.asarray(signal[np.concatenate(chosen)], dtype=float)
    for axis in np.flatnonzero(step > 0.0).tolist():
        own, seen = step[axis], every[:, axis] / step[axis]
        away = seen - np.repeat(np.add.reduceat(seen, first) / counts, counts)
        if np.median(np.add.reduceat(away**2, first) / counts) <= _DITHERED:
            left[:, axis] = own**2 * _mean_square(np.split(seen, first[1:]), means[:, axis] / own)
    return left


def carries_remainder(signal: Vectors, items: Sequence[Item]) -> np.ndarray:
    """Return (3,) of bool: whether each channel counts pulses of an integral.

    Such a converter carries what is left of a step on to the next sample, so that nothing is lost in a mean. Its
    samples make up for one another, and their sums scatter less than those of samples that are rounded each.

    Parameters
    ----------
    signal : (samples, 3) raw, as the converter wrote it.
    items : half-open index ranges of each rest.
    """
    from scipy.special import chdtrc

    square, degrees, own, count = np.zeros(3), 0, np.zeros(3), 0
    for first, last in _some(items):
        whole = min(last - first, _SEEN) // _SUMMED * _SUMMED
        if whole < 2 * _SUMMED:
            continue
        away = np.asarray(signal[first : first + whole], dtype=float)
        away = away - away.mean(axis=0)
        square += np.sum(away.reshape(-1, _SUMMED, 3).sum(axis=1) ** 2, axis=0)
        own += np.sum(away**2, axis=0)
        degrees, count = degrees + whole // _SUMMED - 1, count + whole - 1
    if not degrees:
        return np.zeros(3, dtype=bool)
    expected = np.maximum(_SUMMED * own / count, 1e-300)
    ratios: list[float] = (square / expected).tolist()
    chance = np.array([1.0 - float(chdtrc(float(degrees), one)) for one in ratios])
    return (own > 0.0) & (square < _LESS * degrees * expected) & (chance < _CHANCE)


def integral_variance(signal: Vectors, ranges: np.ndarray, left: Vector, jitter: float) -> Vectors:
    """Return (ranges, 3) variance of integrals by stamps that jitter, and by values that are rounded; raw² s².

    A stamp that is late by j makes an integral wrong by j times the change of the signal there. Neighbouring samples
    that show the same number are off by the same, as far as noise does not dither them.

    Parameters
    ----------
    signal : (samples, 3) raw, as the converter wrote it.
    ranges : (ranges, 2) half-open, of samples; one that begins below zero is none.
    left : (3,) raw² s², variance of what rounding leaves in a sample, times the square of the step of time.
    jitter : s, of a stamp.
    """
    made = np.zeros((len(ranges), 3))
    for k in np.flatnonzero(ranges[:, 0] >= 0).tolist():
        own = np.asarray(signal[ranges[k, 0] : ranges[k, 1]], dtype=float)
        made[k] = jitter**2 * np.sum((0.5 * (own[2:] - own[:-2])) ** 2, axis=0)
        for axis in np.flatnonzero(left > 0.0).tolist():
            ends = np.flatnonzero(np.diff(own[:, axis], prepend=np.nan, append=np.nan) != 0.0)
            made[k, axis] += left[axis] * float(np.sum(np.diff(ends) ** 2))
    return made


def _some(items: Sequence[Item]) -> list[tuple[int, int]]:
    """The first stretches of some of the rests."""
    chosen = np.unique(np.linspace(0, len(items) - 1, min(len(items), _RESTS)).astype(int))
    return [items[k][0] for k in chosen.tolist()]


def _evenly(item: Item) -> np.ndarray:
    """Some samples of a rest, evenly from all its stretches."""
    stops = np.array([b for _, b in item])
    ends = np.cumsum(np.array([b - a for a, b in item]))
    total = int(ends[-1])
    count = min(total, _SAMPLES)
    at = (np.arange(count) * ((total - 1) / max(count - 1, 1))).astype(int)
    at[-1] = total - 1
    stretch = np.searchsorted(ends, at, side="right")
    return at - ends[stretch] + stops[stretch]


def _mean_square(rests: list[AnyArray], means: AnyArray) -> AnyArray:
    """(rests,) mean square of what rounding puts a mean off by, in steps, over what the samples leave possible."""
    from scipy.special import ndtr

    likely, squares = np.empty((2, len(rests), _NOISE.size, _PLACES.size))
    half = 0.5 / _NOISE[:, None, None]
    for k, values in enumerate(rests):
        # Multiples are counted from some sample of the rest: a zero of the converter need not be one.
        first, last = round(float(values.min() - values[0])), round(float(values.max() - values[0]))
        numbers: Series = np.arange(first - _BEYOND, last + _BEYOND + 1, dtype=np.float64)
        counts = np.bincount(np.rint(values - values[0] - numbers[0]).astype(int), minlength=numbers.size)
        away: AnyArray = numbers - (means[k] - values[0]) - _PLACES[:, None]
        to = away / _NOISE[:, None, None]
        shares: AnyArray = np.asarray(ndtr(to + half) - ndtr(to - half))
        likely[k] = np.log(np.maximum(shares, 1e-12)) @ counts
        squares[k] = np.sum(shares * away, axis=2) ** 2
    highest = likely.max(axis=2, keepdims=True)
    of_place = np.exp(likely - highest)
    of_noise = np.sum(highest[:, :, 0] + np.log(of_place.sum(axis=2)), axis=0)
    weight = np.exp(of_noise - of_noise.max())
    return (np.sum(of_place * squares, axis=2) / of_place.sum(axis=2)) @ (weight / weight.sum())
