"""The one-sided power spectral density of a signal, by Welch's method in bounded memory.

References
----------
Welch, P. D., *The use of fast Fourier transform for the estimation of power spectra*, IEEE Trans. Audio
Electroacoust. AU-15 (1967) 70-73. Percival, D. B., and A. T. Walden, *Spectral Analysis for Physical
Applications*, Cambridge 1993, section 6.17: degrees of freedom with overlap.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table
from tumble.errors import UsageError
from tumble.noise.deviation import ONE_SIGMA
from tumble.noise.freedom import chi_square_interval
from tumble.records import dataclass

_LONGEST_SEGMENT = 1 << 20
_SEGMENTS = 8  # so many in the longest piece, where the caller does not say
_LEAST_SEGMENT = 8
# Squared correlation of neighbouring Hann segments that overlap by half: (1/6)².
_NEIGHBOURS = 1.0 / 36.0


@dataclass(frozen=True)
class PowerSpectrum:
    """One-sided density of all channels of a signal.

    Attributes
    ----------
    frequency : (frequencies,) Hz, zero left out; of a spectrum in bins the bins' mean frequencies.
    density : (frequencies, channels) in the square of the signal's unit per Hz, one-sided: its integral
        over positive frequencies is the variance. IEEE Std 952's two-sided density is half of it.
    edf : (frequencies,) equivalent degrees of freedom.
    low, high : (frequencies, channels) limits of the true density at the probability `ONE_SIGMA`.
    segment : samples of each segment; segments : how many were averaged.
    resolution : Hz, width of a line at half its height (Hann window).
    """

    frequency: Series
    density: Table
    edf: Series
    low: Table
    high: Table
    segment: int
    segments: int
    resolution: float


def segment_of(longest: int) -> int:
    """Return the samples of a segment where none are wanted: a power of two that fits eight times, or nearly.

    Parameters
    ----------
    longest : samples of the longest piece.
    """
    # not below what a spectrum needs where it fits at all
    wanted = max(longest // _SEGMENTS, _LEAST_SEGMENT)
    return min(1 << int(np.log2(wanted)), _LONGEST_SEGMENT)


class StreamedSpectrum:
    """Collects blocks of a signal and gives Welch's spectrum of them, in memory of a segment.

    Parameters
    ----------
    rate : samples a second.
    channels : how many.
    segment : samples of a segment.

    Raises
    ------
    UsageError
        If a segment is shorter than eight samples.
    """

    def __init__(self, rate: float, channels: int, segment: int) -> None:
        if segment < _LEAST_SEGMENT:
            raise UsageError(f"A spectrum needs a segment of {_LEAST_SEGMENT} samples without a gap.")
        self._rate, self._size = rate, segment
        self._window = _hann(segment)
        self._power = np.zeros((segment // 2 + 1, channels))
        self._held: Table = np.zeros((0, channels))
        self._several: list[int] = []

    def add(self, block: Table, *, after_gap: bool = False) -> None:
        """Take the next block.

        Parameters
        ----------
        block : (samples, channels), finite.
        after_gap : whether samples are missing before it.
        """
        if after_gap or not self._several:
            self._held = self._held[:0]
            self._several.append(0)
        rows = np.concatenate([self._held, block]) if len(self._held) else block
        size, stride = self._size, self._size - self._size // 2
        begins = range(0, rows.shape[0] - size + 1, stride)
        for begin in begins:
            for channel in range(rows.shape[1]):
                part = rows[begin : begin + size, channel]
                self._power[:, channel] += np.abs(np.fft.rfft(self._window * (part - part.mean()))) ** 2
        self._several[-1] += len(begins)
        self._held = rows[len(begins) * stride :].copy()

    def spectrum(self, *, bins_per_decade: int | None = None) -> PowerSpectrum:
        """Return the spectrum of all that was taken so far.

        Parameters
        ----------
        bins_per_decade : None for every frequency, or how many bins of equal logarithmic width to average them in.

        Raises
        ------
        UsageError
            If no piece had a whole segment.
        """
        size, rate, count = self._size, self._rate, sum(self._several)
        if not count:
            raise UsageError(f"A spectrum needs a segment of {size} samples without a gap.")
        edf = sum(2.0 * n / (1.0 + 2.0 * (n - 1) / n * _NEIGHBOURS) for n in self._several if n)
        # The window's power and the rate make a density; all frequencies but zero and Nyquist's stand for two.
        density = 2.0 * self._power / (count * rate * (self._window**2).sum())
        if size % 2 == 0:
            density[-1] *= 0.5
        frequency = np.arange(size // 2 + 1) * rate / size
        return _binned(frequency[1:], density[1:], edf, size, count, 1.44 * rate / size, bins_per_decade)


def _hann(size: int) -> Series:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)


def _binned(
    frequency: Series,
    density: Table,
    edf: float,
    size: int,
    count: int,
    resolution: float,
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
        density, np.broadcast_to(freedom[:, None], density.shape).copy(), ONE_SIGMA
    )
    return PowerSpectrum(frequency, density, freedom, low, high, size, count, resolution)
