"""The one-sided power spectral density of a signal, by Welch's method in bounded memory.

References
----------
Welch, P. D., *The use of fast Fourier transform for the estimation of power spectra*, IEEE Trans. Audio
Electroacoust. AU-15 (1967) 70-73. Percival, D. B., and A. T. Walden, *Spectral Analysis for Physical
Applications*, Cambridge 1993, section 6.17: degrees of freedom with overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import UsageError
from tumble.noise.deviation import ONE_SIGMA, find_pieces
from tumble.noise.freedom import chi_square_interval

_LONGEST_SEGMENT = 1 << 20
_SEGMENTS = 8  # so many in the longest piece, where the caller does not say
_LEAST_SEGMENT = 8
# Squared correlation of neighbouring Hann segments that overlap by half: (1/6)².
_NEIGHBOURS = 1.0 / 36.0


@dataclass(frozen=True, slots=True)
class PowerSpectrum:
    """One-sided density of all channels of a signal.

    Attributes
    ----------
    frequency : (frequencies,) Hz, zero left out; of a spectrum in bins the bins' mean frequencies.
    density : (frequencies, channels) in the square of the signal's unit per Hz, one-sided: its integral
        over positive frequencies is the variance. IEEE Std 952's two-sided density is half of it.
    edf : (frequencies,) equivalent degrees of freedom.
    low, high : (frequencies, channels) limits of the true density at the probability `confidence`.
    segment : samples of each segment; segments : how many were averaged.
    resolution : Hz, width of a line at half its height (Hann window).
    confidence : probability of each interval.
    """

    frequency: Series
    density: Table
    edf: Series
    low: Table
    high: Table
    segment: int
    segments: int
    resolution: float
    confidence: float


def power_spectrum(
    signal: AnyArray,
    rate: float,
    *,
    segment: int | None = None,
    bins_per_decade: int | None = None,
    gaps: Sequence[int] = (),
    confidence: float = ONE_SIGMA,
) -> PowerSpectrum:
    """Return Welch's spectrum: Hann window, half overlap, each segment less its own mean.

    Parameters
    ----------
    signal : (samples,) or (samples, channels), any unit. Rows that are not finite part it as gaps do.
    rate : samples a second.
    segment : samples of a segment; None for an eighth of the longest piece, a power of two, a million at most.
    bins_per_decade : None for every frequency, or how many bins of equal logarithmic width to average them in.
    gaps : indices i where samples are missing between i - 1 and i; no segment lies across one.
    confidence : probability of the intervals.

    Raises
    ------
    UsageError
        If no piece of the signal has a whole segment, or the rate is not positive.
    """
    columns = np.asarray(signal, dtype=np.float64).reshape(signal.shape[0], -1)
    if not (np.isfinite(rate) and rate > 0.0):
        raise UsageError(f"A sampling rate of {rate} Hz cannot be.")
    pieces = find_pieces(columns, gaps)
    longest = max((stop - start for start, stop in pieces), default=0)
    size = _segment(longest) if segment is None else segment
    if size < _LEAST_SEGMENT or longest < size:
        raise UsageError(f"A spectrum needs a segment of {max(size, _LEAST_SEGMENT)} samples without a gap.")
    power, count, edf = _averaged(columns, pieces, size)
    # The window's power and the rate make a density; all frequencies but zero and Nyquist's stand for two.
    density = 2.0 * power / (rate * (_hann(size) ** 2).sum())
    if size % 2 == 0:
        density[-1] *= 0.5
    frequency = np.arange(size // 2 + 1) * rate / size
    return _binned(
        frequency[1:], density[1:], edf, size, count, 1.44 * rate / size, confidence, bins_per_decade
    )


def _segment(longest: int) -> int:
    """Power of two that fits eight times, not below what a spectrum needs where it fits at all."""
    wanted = max(longest // _SEGMENTS, _LEAST_SEGMENT)
    return min(1 << int(np.log2(wanted)), _LONGEST_SEGMENT)


def _hann(size: int) -> Series:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)


def _averaged(signal: Table, pieces: Sequence[tuple[int, int]], size: int) -> tuple[Table, int, float]:
    """Mean of the segments' squared transforms, how many there are, and the degrees of freedom."""
    window = _hann(size)
    power = np.zeros((size // 2 + 1, signal.shape[1]))
    count, edf = 0, 0.0
    for start, stop in pieces:
        begins = range(start, stop - size + 1, size - size // 2)
        for begin in begins:
            for channel in range(signal.shape[1]):
                part = signal[begin : begin + size, channel]
                power[:, channel] += np.abs(np.fft.rfft(window * (part - part.mean()))) ** 2
        several = len(begins)
        count += several
        if several:
            edf += 2.0 * several / (1.0 + 2.0 * (several - 1) / several * _NEIGHBOURS)
    return power / count, count, edf


def _binned(
    frequency: Series,
    density: Table,
    edf: float,
    size: int,
    count: int,
    resolution: float,
    confidence: float,
    per_decade: int | None,
) -> PowerSpectrum:
    """Average the frequencies in bins, if wanted, and add the intervals."""
    freedom = np.full(frequency.size, edf)
    if per_decade is not None:
        # The lowest line has lost what went with the segment's mean.
        frequency, density, freedom = frequency[1:], density[1:], freedom[1:]
        place = np.floor(np.log10(frequency / frequency[0]) * per_decade + 1e-9).astype(int)
        starts = np.flatnonzero(np.diff(place, prepend=-1))
        members = np.diff(np.append(starts, frequency.size))
        frequency = np.add.reduceat(frequency, starts) / members
        density = np.add.reduceat(density, starts, axis=0) / members[:, None]
        # Neighbours share some of a Hann window's lines: two thirds of them count as independent.
        freedom = edf * np.maximum(1.0, members / 1.5)
    low, high = chi_square_interval(
        density, np.broadcast_to(freedom[:, None], density.shape).copy(), confidence
    )
    return PowerSpectrum(frequency, density, freedom, low, high, size, count, resolution, confidence)


__all__ = ["PowerSpectrum", "power_spectrum"]
