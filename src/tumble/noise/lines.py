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
from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.noise.deviation import Integers, find_pieces
from tumble.noise.terms import Line

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


@dataclass(frozen=True, slots=True)
class FoundLine:
    """A line that stands out of the spectrum.

    Attributes
    ----------
    frequency, frequency_sigma : Hz.
    amplitude, amplitude_sigma : of the peak, in the signal's unit u.
    excess : how many times higher than the spectrum around it its peak is.
    false_alarm : probability that chance makes such a peak at any frequency tried.
    resolution : Hz, of the spectrum that shows it best: much more than 1 over the signal's length says that
        it wanders by about as much.
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

    def limits(self, confidence: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the intervals of the amplitude and of the frequency.

        Parameters
        ----------
        confidence : probability of each.
        """
        from scipy.special import ndtri

        z = float(ndtri(0.5 + 0.5 * confidence))
        amplitude = (
            max(self.amplitude - z * self.amplitude_sigma, 0.0),
            self.amplitude + z * self.amplitude_sigma,
        )
        return amplitude, (
            self.frequency - z * self.frequency_sigma,
            self.frequency + z * self.frequency_sigma,
        )

    def scaled(self, factor: float) -> FoundLine:
        """Return the same line in a unit of which a number is `factor` times as large."""
        return FoundLine(
            self.frequency,
            self.frequency_sigma,
            factor * self.amplitude,
            factor * self.amplitude_sigma,
            self.excess,
            self.false_alarm,
            self.resolution,
        )


@dataclass(frozen=True, slots=True)
class _Spectrum:
    """Hann periodograms of a signal's segments, averaged."""

    size: int
    starts: list[int]
    power: Series
    edf: float


def find_lines(
    signal: AnyArray, rate: float, *, gaps: Sequence[int] = (), false_alarm: float = LINE_FALSE_ALARM
) -> tuple[FoundLine, ...]:
    """Return the lines of a signal, strongest first, twenty at most.

    Lines above half the rate are seen where they fold to. Below 32 periods in the signal none is looked for.

    Parameters
    ----------
    signal : (samples,) at rest, any unit. Values that are not finite part it as gaps do.
    rate : Hz.
    gaps : indices i where samples are missing between i - 1 and i.
    false_alarm : probability that any line is found where there is none.
    """
    column = np.asarray(signal, dtype=np.float64).reshape(-1, 1)
    pieces = find_pieces(column, gaps)
    longest = max((stop - start for start, stop in pieces), default=0)
    sizes = [min(longest, _LONGEST_SEGMENT) // coarser for coarser in _COARSER]
    sizes = [size for size in sizes if size >= _LEAST_SEGMENT]
    flat = column[:, 0]
    found: list[tuple[_Spectrum, FoundLine]] = []
    for size in sizes:
        spectrum = _averaged(flat, pieces, _smooth(size))
        for line in _peaks(flat, rate, spectrum, false_alarm / len(sizes)):
            found.append((spectrum, line))
    # the resolution at which a line is least like chance is its own
    found.sort(key=lambda pair: (pair[1].false_alarm, -pair[1].excess))
    kept: list[FoundLine] = []
    for _, line in found:
        apart = [
            abs(line.frequency - other.frequency) > 4.0 * max(line.resolution, other.resolution)
            for other in kept
        ]
        if all(apart):
            kept.append(line)
    return tuple(sorted(kept, key=lambda line: -line.amplitude)[:_MOST])


def _smooth(size: int) -> int:
    """The next smaller length that a fast transform likes, an even one."""
    from scipy.fft import prev_fast_len

    return 2 * int(prev_fast_len(size // 2, real=True))


def _hann(size: int) -> Series:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size)


def _averaged(signal: Series, pieces: Sequence[tuple[int, int]], size: int) -> _Spectrum:
    from scipy.fft import rfft

    window = _hann(size)
    starts = [b for start, stop in pieces for b in range(start, stop - size + 1, size // 2)]
    power = np.zeros(size // 2 + 1)
    steady = np.arange(size) - 0.5 * (size - 1)
    for start in starts:
        part = signal[start : start + size]
        # a trend leaks into every frequency
        part = part - part.mean() - steady * (steady @ part) / (steady @ steady)
        power += np.abs(np.asarray(rfft(window * part), dtype=np.complex128)) ** 2
    count = len(starts)
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
    for place in order:
        k = int(tried[place])
        if len(taken) >= 2 * _MOST or any(abs(k - other) <= 2 * _LOBE for other in taken):
            continue
        # a side lobe of a strong one
        if any(ratio[place] < 1e-3 * power[o] / level[o] and abs(k - o) < 64 for o in taken):
            continue
        taken.append(k)
        found.append(
            _measured(signal, rate, spectrum, k, float(level[k]), float(ratio[place]), float(chance[place]))
        )
    return found


def _measured(
    signal: Series, rate: float, spectrum: _Spectrum, k: int, level: float, ratio: float, chance: float
) -> FoundLine:
    """Frequency and amplitude of a peak by the power in and around it."""
    size, window = spectrum.size, _hann(spectrum.size)
    t = np.arange(size) - 0.5 * (size - 1)
    few = spectrum.starts[:: max(1, len(spectrum.starts) // 32)]
    parts = [signal[start : start + size] for start in few]
    parts = [window * (part - part.mean()) for part in parts]

    def power_at(place: float) -> float:
        turn = np.exp(-2j * np.pi * place / size * t)
        return float(np.mean([np.abs(part @ turn) ** 2 for part in parts]))

    place = _highest(power_at, k - 1.0, k + 1.0)
    near = slice(k - _LOBE, k + _LOBE + 1)
    # half of the amplitude squared is the line's power, all of which is in its lobe
    excess = max(float(np.sum(spectrum.power[near])) - (2 * _LOBE + 1) * level, 0.1 * level)
    squares = float(window @ window)
    amplitude = float(np.sqrt(4.0 * excess / (size * squares)))
    # noise in the window, as white noise of the level around it; segments that overlap by half count half
    variance = level / squares
    independent = 0.5 * spectrum.edf
    amplitude_sigma = np.sqrt(2.0 * variance * 1.5 / size / independent)
    spread = float(np.sum(window**2 * t**2)) / float(np.sum(window * t**2)) ** 2
    frequency_sigma = np.sqrt(2.0 * variance * spread / independent) / amplitude * rate / (2.0 * np.pi)
    return FoundLine(
        place * rate / size,
        float(frequency_sigma),
        amplitude,
        float(amplitude_sigma),
        ratio,
        chance,
        rate / size,
    )


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
        blur = (np.pi * m / rate * max(line.frequency_sigma, 0.4 * line.resolution)) ** 2
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


__all__ = ["LINE_FALSE_ALARM", "FoundLine", "allan_variance_of_lines", "find_lines"]
