"""Sinusoidal lines in a signal at rest, such as vibrations: found in its spectrum, and their Allan variance.

A line stands out of the spectrum around it. It is looked for at three resolutions, because a motor that
wanders spreads its power over a band that only a coarse spectrum gathers. All frequencies at all
resolutions together call a signal without a line one with a line no more often than the stated false alarm.

References
----------
Percival and Walden, Spectral Analysis for Physical Applications, sections 10.9 (tests for lines) and 6.17
(Welch's degrees of freedom). Rife and Boorstyn, IEEE Trans. Inf. Theory IT-20 (1974) 591-598, for the
uncertainty of a line's frequency and amplitude, here with the window's weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.noise.deviation import Integers, find_pieces
from tumble.noise.terms import Line
from tumble.records import dataclass

LINE_FALSE_ALARM = 0.01
"""Probability that a line is found in a signal that has none, all frequencies tried together."""

_LONGEST_SEGMENT = 1 << 20
_COARSER = (1, 16, 256)  # times shorter segments
_LEAST_SEGMENT = 1024
_LOWEST = 32  # bin: below, a signal that wanders has no level to stand out of
_NEIGHBOURS = 48  # bins on either side that make the level, at least
_WIDTH = 0.06  # of the frequency, that they reach at least
_LOBE = 2  # bins on either side that a line's power is in, Hann window
_STANDING_OUT = 1.5  # times the level: less has nothing to say in any curve
_MOST = 20
_LOBE_SPREAD = 1.0 / 3.0  # bins squared, mean square distance of a steady line's power from its place
_BLUR = 0.4  # of the resolution: the frequency's standard deviation within it
_STEADY = 0.7  # of a line's power in one lobe: it does not wander by more
_WIDEST = 64  # bins on either side that a line may wander
_TOGETHER = 1 << 15  # samples that are transformed at once, so that they stay in the cache
_ENOUGH = 16  # segments, for their scatter to say how well their mean is known


@dataclass(frozen=True)
class FoundLine:
    """A line that stands out of the spectrum.

    Attributes
    ----------
    frequency, frequency_sigma : Hz.
    amplitude, amplitude_sigma : of the peak, in the signal's unit u.
    excess : how many times higher than the spectrum around it its peak is.
    false_alarm : probability that chance makes such a peak at any frequency tried.
    resolution : Hz, of the spectrum that shows it best, or over which its power is spread where that is more:
        much more than 1 over the signal's length says that it wanders by about as much.
    """

    frequency: float
    frequency_sigma: float
    amplitude: float
    amplitude_sigma: float
    excess: float
    false_alarm: float
    resolution: float

    @property
    def line(self) -> Line:
        """The term of a noise model."""
        return Line(self.amplitude, self.frequency)


@dataclass(frozen=True)
class _Spectrum:
    """Hann periodograms of a signal's segments, averaged."""

    size: int
    starts: list[int]
    power: Series
    edf: float


def find_lines(signal: AnyArray, rate: float) -> tuple[FoundLine, ...]:
    """Return the lines of a signal, strongest first, twenty at most.

    Lines above half the rate are seen where they fold to. Below 32 periods in the signal none is looked for.

    Parameters
    ----------
    signal : (samples,) at rest, any unit. Values that are not finite part it as gaps do.
    rate : Hz.
    """
    column = np.asarray(signal, dtype=np.float64).reshape(-1, 1)
    pieces = find_pieces(column)
    longest = max((stop - start for start, stop in pieces), default=0)
    sizes = [min(longest, _LONGEST_SEGMENT) // coarser for coarser in _COARSER]
    sizes = [size for size in sizes if size >= _LEAST_SEGMENT]
    flat = column[:, 0]
    found: list[FoundLine] = []
    for size in sizes:
        spectrum = _averaged(flat, pieces, _smooth(size))
        found += _peaks(flat, rate, spectrum, LINE_FALSE_ALARM / len(sizes))
    # A coarser spectrum's line that a finer one shows whole is steady, and the finer one knows it better.
    found = [line for line in found if not any(_is_whole(finer, line) for finer in found)]
    # Of one that wanders a finer spectrum shows splinters.
    found = [line for line in found if not any(_is_finer(line, other) for other in found)]
    found.sort(key=lambda line: (line.false_alarm, -line.excess))
    kept: list[FoundLine] = []
    for line in found:
        if not any(_same(line, other) for other in kept):
            kept.append(line)
    return tuple(sorted(kept, key=lambda line: -line.amplitude)[:_MOST])


def _same(line: FoundLine, other: FoundLine) -> bool:
    return abs(line.frequency - other.frequency) <= 4.0 * max(line.resolution, other.resolution)


def _is_finer(line: FoundLine, other: FoundLine) -> bool:
    return line.resolution < other.resolution and _same(line, other)


def _is_whole(finer: FoundLine, line: FoundLine) -> bool:
    """Whether one peak of a finer spectrum has the power that a line has."""
    lacking = line.amplitude - finer.amplitude
    sigma = float(np.hypot(line.amplitude_sigma, finer.amplitude_sigma))
    whole = finer.amplitude**2 > _STEADY * line.amplitude**2 or lacking < 3.0 * sigma
    return _is_finer(finer, line) and whole


def _smooth(size: int) -> int:
    """The next smaller length that a fast transform likes, an even one."""
    from scipy.fft import prev_fast_len

    return 2 * int(prev_fast_len(size // 2, real=True))


@lru_cache(maxsize=4)
def _hann(size: int) -> Series:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size)


def _windowed(signal: Series, starts: Sequence[int], size: int) -> Table:
    """Segments in the window, (segments, size), less a straight line each, which would leak into every frequency."""
    window, steady = _hann(size), np.arange(size) - 0.5 * (size - 1)
    parts = np.stack([signal[start : start + size] for start in starts])
    parts = parts - parts.mean(axis=1)[:, None]
    return np.asarray(window * (parts - np.outer(parts @ steady / (steady @ steady), steady)))


def _averaged(signal: Series, pieces: Sequence[tuple[int, int]], size: int) -> _Spectrum:
    from scipy.fft import rfft

    starts = [b for start, stop in pieces for b in range(start, stop - size + 1, size // 2)]
    power = np.zeros(size // 2 + 1)
    count, together = len(starts), max(1, _TOGETHER // size)
    for k in range(0, count, together):
        parts = _windowed(signal, starts[k : k + together], size)
        power += np.sum(np.abs(np.asarray(rfft(parts, axis=1), dtype=np.complex128)) ** 2, axis=0)
    edf = 2.0 * count / (1.0 + 2.0 * (count - 1) / count / 36.0)
    return _Spectrum(size, starts, power / count, edf)


def _levels(power: Series, edf: float) -> tuple[Series, Series]:
    """Level around each bin without the bin's own neighbourhood, and the degrees of freedom of that level."""
    from scipy.ndimage import median_filter
    from scipy.special import gammaincinv

    size = len(power)
    logs = np.log(np.maximum(power, 1e-300))
    level, known = np.empty(size), np.empty(size)
    # pieces of the axis whose bins are judged by as many neighbours
    begin = 0
    while begin < size:
        half = max(_NEIGHBOURS, int(_WIDTH * begin))
        half = min(half, 2000)
        end = min(size, max(int(1.3 * begin), begin + _NEIGHBOURS))
        left, right = max(begin - 2 * half, 0), min(end + 2 * half, size)
        # a slope in the logarithm of the frequency is taken off first: it is not a line
        at = np.log(np.arange(left, right) + 0.5)
        slope = _slope(at, logs[left:right])
        tilted = logs[left:right] - slope * at
        medians = median_filter(tilted, size=2 * half + 1, mode="reflect")
        level[begin:end] = medians[begin - left : end - left] + slope * at[begin - left : end - left]
        # a median is 0.48 as sure as a mean, and windowed bins are half as many as there seem
        known[begin:end] = 0.48 * (half + 1) * edf
        begin = end
    # the median of chi square over its mean
    return np.exp(level) / (gammaincinv(0.5 * edf, 0.5) / (0.5 * edf)), known


def _slope(at: Series, values: Series) -> float:
    """Robust slope, by medians of thirds."""
    third = max(len(at) // 3, 1)
    rise = np.median(values[-third:]) - np.median(values[:third])
    return float(rise / max(np.median(at[-third:]) - np.median(at[:third]), 1e-9))


def _peaks(signal: Series, rate: float, spectrum: _Spectrum, false_alarm: float) -> list[FoundLine]:
    """Lines at one resolution."""
    from scipy.special import fdtrc

    power = spectrum.power
    level, known = _levels(power, spectrum.edf)
    tried = np.arange(_LOWEST, len(power) - 1 - _LOBE)
    ratio = power[tried] / level[tried]
    chance = np.minimum(fdtrc(spectrum.edf, known[tried], ratio) * len(tried), 1.0)
    above = (chance < false_alarm) & (ratio > _STANDING_OUT)
    top = (power[tried] >= power[tried - 1]) & (power[tried] >= power[tried + 1])
    order = np.flatnonzero(above & top)
    order = order[np.argsort(-ratio[order])]
    found: list[FoundLine] = []
    taken: list[int] = []
    bands: list[tuple[int, int]] = []
    for place in order:
        k = int(tried[place])
        if len(taken) >= 2 * _MOST or any(abs(k - other) <= 2 * _LOBE for other in taken):
            continue
        # a side lobe of a strong one
        if any(ratio[place] < 1e-3 * power[o] / level[o] and abs(k - o) < 64 for o in taken):
            continue
        if any(low <= k <= high for low, high in bands):
            continue
        taken.append(k)
        bands.append(_band(power, level, k) if len(spectrum.starts) >= _ENOUGH else (k, k))
        least = float(level[k]), float(ratio[place]), float(chance[place])
        found.append(_measured(signal, rate, spectrum, k, bands[-1], *least))
    return found


def _measured(
    signal: Series,
    rate: float,
    spectrum: _Spectrum,
    k: int,
    band: tuple[int, int],
    level: float,
    ratio: float,
    chance: float,
) -> FoundLine:
    """Frequency and amplitude of a peak."""
    size = spectrum.size
    stride = max(1, len(spectrum.starts) // 32)
    parts = _windowed(signal, spectrum.starts[::stride], size)
    t = np.arange(size) - 0.5 * (size - 1)

    def power_at(place: float) -> Series:
        return np.abs(parts @ np.exp(-2j * np.pi * place / size * t)) ** 2

    wide = 1.0
    if len(spectrum.starts) < _ENOUGH:
        place = _highest(lambda at: float(np.mean(power_at(at))), k - 1.0, k + 1.0)
        amplitude, amplitude_sigma, place_sigma = _of_a_sine(power_at(place), spectrum, level)
    else:
        independent = 0.5 * spectrum.edf if stride == 1 else float(len(parts))
        place, amplitude, amplitude_sigma, place_sigma, wide = _of_a_band(parts, level, band, independent)
    bin_ = rate / size
    return FoundLine(place * bin_, place_sigma * bin_, amplitude, amplitude_sigma, ratio, chance, wide * bin_)


def _of_a_sine(powers: Series, spectrum: _Spectrum, level: float) -> tuple[float, float, float]:
    """Amplitude, its uncertainty and that of the place in bins, of a sine that lasts, from the powers at its peak.

    By linear propagation of white noise of the level around; without a window they were the Cramér-Rao bound,
    and the window makes them 1.22 and 1.39 times as large.
    """
    size, window = spectrum.size, _hann(spectrum.size)
    t = np.arange(size) - 0.5 * (size - 1)
    independent = 0.5 * spectrum.edf
    area, squares, inertia = float(np.sum(window)), float(window @ window), float(window @ t**2)
    moment = float(np.sum((window * t) ** 2))
    # noise adds its own power, and what the search for the highest place gains; a root is below the mean's
    found = 0.5 * area * moment / (inertia * squares)
    own = level * (1.0 + (found - 0.5) / independent)
    amplitude = 2.0 * float(np.sqrt(max(float(np.mean(powers)) - own, 0.1 * level))) / area
    variance = 2.0 * level / squares / independent
    place_sigma = np.sqrt(variance * moment) / (inertia * amplitude) * size / (2.0 * np.pi)
    return amplitude, float(np.sqrt(variance * squares)) / area, float(place_sigma)


def _band(power: Series, level: Series, k: int) -> tuple[int, int]:
    """First and last bin of a line that wanders: as far as its power stands out without a break."""
    low, high = k - _LOBE, k + _LOBE
    while low > max(k - _WIDEST, 1) and power[low - 1] > _STANDING_OUT * level[low - 1]:
        low -= 1
    while high < min(k + _WIDEST, len(power) - 2) and power[high + 1] > _STANDING_OUT * level[high + 1]:
        high += 1
    return low, high


def _of_a_band(
    parts: Table, level: float, band: tuple[int, int], independent: float
) -> tuple[float, float, float, float, float]:
    """Place in bins, amplitude, their uncertainties and the width, by a band's power and its scatter over segments."""
    size = parts.shape[1]
    near: Series = np.arange(band[0], band[1] + 1, dtype=np.float64)
    # half of the amplitude squared is the line's power
    factor = 4.0 / (size * float(np.sum(_hann(size) ** 2)))
    angle: Table = 2.0 * np.pi / size * np.outer(np.arange(size, dtype=np.float64), near)
    turns = np.cos(angle) - 1j * np.sin(angle)
    each: Table = np.asarray(np.abs(parts @ turns) ** 2, dtype=np.float64)
    excess = np.mean(each, axis=0) - level
    power = max(float(np.sum(excess)), 0.1 * level)
    place = float(np.clip(near @ excess / power, near[0], near[-1]))
    amplitude = float(np.sqrt(factor * power))
    scatter = float(np.std(np.sum(each, axis=1), ddof=1)) / np.sqrt(independent)
    moved = float(np.std(each @ (near - place), ddof=1)) / power / np.sqrt(independent)
    spread = float((near - place) ** 2 @ excess) / power - _LOBE_SPREAD
    wide = max(1.0, float(np.sqrt(max(spread, 0.0))) / _BLUR)
    return place, amplitude, float(0.5 * factor * scatter / amplitude), min(moved, float(len(near))), wide


def _highest(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda place: -function(place), bounds=(low, high), method="bounded", options={"xatol": 1e-5}
    )
    return float(found.x)


def allan_variance_of_lines(
    lines: Sequence[FoundLine], averaging: Integers, rate: float, counts: Series
) -> tuple[Series, Square]:
    """Return what lines add to Allan variances, and the covariance of that from their amplitudes'.

    Over a frequency that is known to σ, or wanders by 0.4 of the resolution at which the line is best seen,
    the oscillation of sin⁴(πfτ) is averaged: cos(2πfτ) keeps e^(-2(πτσ)²) of itself.

    Parameters
    ----------
    lines : as found.
    averaging : (taus,) samples.
    rate : Hz.
    counts : (taus,) differences that each variance is the mean of: they are no whole number of periods.
    """
    m = np.asarray(averaging, dtype=float)
    total, covariance = np.zeros(len(m)), np.zeros((len(m), len(m)))
    for line in lines:
        turn = np.pi * line.frequency * m / rate
        blur = (np.pi * m / rate * max(line.frequency_sigma, _BLUR * line.resolution)) ** 2
        fourth = (
            0.375
            - 0.5 * np.cos(2.0 * turn) * np.exp(-2.0 * blur)
            + 0.125 * np.cos(4.0 * turn) * np.exp(-8.0 * blur)
        )
        column = np.maximum(fourth, 0.0) / (m * np.sin(np.pi * line.frequency / rate)) ** 2
        total += line.amplitude**2 * column
        covariance += (2.0 * line.amplitude * line.amplitude_sigma) ** 2 * np.outer(column, column)
        # the mean of sin² over the differences is a half but for 1 / (2 count sin(2πf/rate)), by their phase
        rest = 0.5 / np.maximum(counts * abs(np.sin(2.0 * np.pi * line.frequency / rate)), 0.5)
        covariance += np.diag((line.amplitude**2 * column * rest) ** 2)
    return total, covariance
