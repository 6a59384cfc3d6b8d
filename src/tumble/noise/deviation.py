"""Allan deviation of a signal at rest, at every overlapping place, or block by block in memory that does not grow.

Its square is twice the Haar wavelet variance (maximal overlap). The signal is a rate (rad/s, m/s²): the deviation has
its unit. A signal with gaps is a set of pieces: differences are taken within each, and their squares are pooled.

Block by block, long averaging times are taken of averaged data. The mean over m samples is also the mean of m/2 means
over two: averaging pairs changes no cluster mean, so that Allan statistics of averaged data at whole multiples of the
averaging are those of the data themselves. Nothing aliases, as it would if every other sample were dropped. What is
given up is overlap: at long averaging times differences begin at every 128th part of the averaging time instead of at
every sample, which costs less than a thousandth of the degrees of freedom.

References
----------
Riley, W. J., *Handbook of Frequency Stability Analysis*, NIST SP 1065, 2008, section 5.2.4. IEEE Std 952-2020,
annex C. Percival, D. B., *On estimation of the wavelet variance*, Biometrika 82 (1995) 619-631.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, fields, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import UsageError
from tumble.noise.freedom import EXPONENTS, chi_square_interval, degrees_of_freedom
from tumble.records import dataclass

Taus: TypeAlias = "str | Series | Sequence[float]"
Integers: TypeAlias = npt.NDArray[np.int64]

PLACES = 128
"""Differences begun in each averaging time, at least, once it is that long; a power of two."""

ONE_SIGMA = 0.682689492137086
"""Probability within one standard deviation of a normal distribution."""

_PER_DECADE = 10
_SLOPE_REACH = 4.2  # a slope is taken over averaging times up to two octaves away
_LONGEST = 1 << 48  # samples: longer than any recording
_LEAST_CLUSTERS = 12  # with fewer, a slope is chance


@dataclass(frozen=True)
class Deviation:
    """The overlapping Allan deviation over averaging times, of all channels of a signal.

    Attributes
    ----------
    tau : (taus,) averaging times, s.
    averaging : (taus,) the same in samples.
    deviation : (taus, channels) in the signal's unit.
    count : (taus,) differences that were averaged.
    edf : (taus, channels) equivalent degrees of freedom of the variance, for the noise in `exponent`.
    low, high : (taus, channels) limits of the true deviation at the probability `ONE_SIGMA`, two-sided.
    exponent : (taus, channels) α of the noise assumed, S(f) ~ f^α.
    rate : samples a second.
    samples : of the signal, gaps left out.
    pieces : lengths of the pieces without gaps, in samples.
    """

    tau: Series
    averaging: Integers
    deviation: Table
    count: Integers
    edf: Table
    low: Table
    high: Table
    exponent: Integers
    rate: float
    samples: int
    pieces: tuple[int, ...]

    @property
    def confidence(self) -> float:
        """Probability of each interval, two-sided."""
        return ONE_SIGMA

    def __len__(self) -> int:
        return int(self.tau.size)

    def from_tau(self, shortest: float) -> Deviation:
        """Return the same from an averaging time in s on.

        Parameters
        ----------
        shortest : s.
        """
        return self._cut(self.tau >= shortest * (1.0 - 1e-9), slice(None))

    def channel(self, index: int) -> Deviation:
        """Return the same of one channel alone, arrays of two dimensions still.

        Parameters
        ----------
        index : of the channel.
        """
        return self._cut(slice(None), slice(index, index + 1))

    def _cut(self, taus: Any, channels: slice) -> Deviation:
        arrays: dict[str, AnyArray] = {
            each.name: values
            for each in fields(self)
            if isinstance(values := getattr(self, each.name), np.ndarray)
        }
        cut = {
            name: each[taus] if each.ndim == 1 else each[taus][:, channels] for name, each in arrays.items()
        }
        return replace(self, **cut)


def allan_deviation(
    signal: AnyArray,
    rate: float,
    *,
    taus: Taus = "octave",
    gaps: Sequence[int] = (),
    noise: int | None = None,
) -> Deviation:
    """Return the overlapping Allan deviation of all channels of a signal, with degrees of freedom and intervals.

    Parameters
    ----------
    signal : (samples,) or (samples, channels), any unit. Rows that are not finite are left out, and part
        the signal as a gap does.
    rate : samples a second.
    taus : "octave" (1, 2, 4, ... samples), "log" (ten a decade), or averaging times in s, taken to the next whole
        sample; those that do not fit into the longest piece are left out.
    gaps : indices i where samples are missing between i - 1 and i.
    noise : exponent α assumed for the degrees of freedom, S(f) ~ f^α; None takes it from the slope of the
        curve about each averaging time.

    Raises
    ------
    UsageError
        If the signal is shorter than one difference, or an argument is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> float(allan_deviation(np.array([0.0, 2.0, 0.0, 2.0]), 1.0, taus=[1.0]).deviation[0, 0])
    1.4142135623730951
    """
    columns = _columns(signal)
    _check(rate, noise)
    pieces = find_pieces(columns, gaps)
    longest = max((stop - start for start, stop in pieces), default=0)
    choose_averaging(taus, rate, longest // 2)
    collector = StreamedDeviation(rate, columns.shape[1], taus, None, noise)
    for start, stop in pieces:
        collector.add(columns[start:stop], after_gap=True)
    return collector.deviation()


@dataclass
class _Floor:
    """One level of averaging: the last rows before the next block, and the sums so far."""

    steps: Integers
    held: Table
    odd: Table
    sums: Table
    counts: Integers


@dataclass
class StreamedDeviation:
    """Collects blocks of a signal and gives the deviation at octaves of the sampling interval, or as wanted.

    Parameters
    ----------
    rate : samples a second.
    channels : how many.
    taus : as for `allan_deviation`. Above `places` samples they are taken to the next multiple of the samples that
        are averaged there, which is within 0.8 %.
    places : differences begun in each averaging time, at least; None for one at every sample, however long it is.
    noise : as for `allan_deviation`.

    Raises
    ------
    UsageError
        If no averaging time fits.

    Examples
    --------
    >>> import numpy as np
    >>> collector = StreamedDeviation(1.0, 1)
    >>> for block in (np.array([[0.0], [2.0]]), np.array([[0.0], [2.0]])):
    ...     collector.add(block)
    >>> float(collector.deviation().deviation[0, 0])
    1.4142135623730951
    """

    rate: float
    channels: int
    taus: Taus = "octave"
    places: int | None = PLACES
    noise: int | None = None
    _wanted: list[list[int]] = field(default_factory=list[list[int]])
    _floors: list[_Floor] = field(default_factory=list[_Floor])
    _lengths: list[int] = field(default_factory=list[int])
    _level: AnyArray | None = None

    def __post_init__(self) -> None:
        self._wanted = _by_floor(choose_averaging(self.taus, self.rate, _LONGEST), self.places)

    def add(self, block: Table, *, after_gap: bool = False) -> None:
        """Take the next block.

        Parameters
        ----------
        block : (samples, channels), finite.
        after_gap : whether samples are missing before it.
        """
        if not block.shape[0]:
            return
        if after_gap or not self._lengths:
            self._lengths.append(0)
            for floor in self._floors:
                floor.held = floor.held[:0]
                floor.odd = floor.odd[:0]
        self._lengths[-1] += block.shape[0]
        if self._level is None:
            # No deviation sees the level, and without it the running sum keeps its digits.
            self._level = np.asarray(block.mean(axis=0))
        rows = block
        for height, steps in enumerate(self._wanted):
            if not rows.shape[0]:
                break
            if height:
                rows = _pair_means(self._floors[height - 1], rows)
            if height == len(self._floors):
                none = np.zeros((0, self.channels))
                sums, counts = np.zeros((len(steps), self.channels)), np.zeros(len(steps), dtype=np.int64)
                self._floors.append(_Floor(np.array(steps, dtype=np.int64), none, none, sums, counts))
            self._count_differences(self._floors[height], rows, self._level)

    def _count_differences(self, floor: _Floor, rows: Table, level: Series) -> None:
        """Add the differences that end in the new rows."""
        from tumble.noise import kernels

        before = floor.held.shape[0]
        joined = np.concatenate([floor.held, rows]) if before else rows
        phase = np.empty(joined.shape[0] + 1)
        # Differences that lie in the rows before as a whole were counted.
        begins = np.maximum(0, before - 2 * floor.steps + 1)
        fits = 2 * floor.steps + begins < phase.size
        floor.counts[fits] += (phase.size - begins - 2 * floor.steps)[fits]
        for channel in range(self.channels if np.any(fits) else 0):
            kernels.running_sum(joined[:, channel], level[channel], phase)
            for begin in np.unique(begins[fits]).tolist():
                together = fits & (begins == begin)
                total = np.zeros(np.count_nonzero(together))
                kernels.second_difference_squares(phase[begin:], floor.steps[together], total)
                floor.sums[together, channel] += total
        held = joined[max(0, joined.shape[0] - 2 * int(floor.steps.max(initial=0))) :]
        # Of a few rows the rest of the block need not stay.
        floor.held = held.copy() if 2 * len(held) < len(joined) else held

    def deviation(self) -> Deviation:
        """Return the deviation of all that was taken so far.

        Raises
        ------
        UsageError
            If too few samples were taken for one difference.
        """
        found = [
            # running sums of means over 2^h samples are 2^h times as small
            (m << height, m, 4.0**height * floor.sums[k], floor.counts[k])
            for height, floor in enumerate(self._floors)
            for k, m in enumerate(floor.steps.tolist())
            if floor.counts[k] > 0
        ]
        if not found:
            raise UsageError("The signal has too few samples in a row for a deviation: two at least.")
        averaging, strides, sums, counts = (np.array(each) for each in zip(*found, strict=True))
        return _finish(sums, counts, averaging, self.rate, tuple(self._lengths), self.noise, strides)


def _finish(
    sums: Table,
    counts: Integers,
    averaging: Integers,
    rate: float,
    lengths: tuple[int, ...],
    noise: int | None,
    strides: Integers,
) -> Deviation:
    """Return a deviation from the sums (taus, channels) of squared differences of the running sum."""
    size = averaging.astype(np.float64)
    # SP 1065 equation 10 in units of samples
    variance = sums / (2.0 * size**2 * counts)[:, None]
    exponent = _assumed(variance, averaging, lengths, noise)
    edf = _freedom(exponent, averaging, lengths, strides)
    low, high = chi_square_interval(variance, edf, ONE_SIGMA)
    return Deviation(
        tau=size / rate,
        averaging=averaging,
        deviation=np.sqrt(variance),
        count=counts,
        edf=edf,
        low=np.sqrt(low),
        high=np.sqrt(high),
        exponent=exponent,
        rate=rate,
        samples=sum(lengths),
        pieces=lengths,
    )


def find_pieces(signal: AnyArray, gaps: Sequence[int] = ()) -> list[tuple[int, int]]:
    """Return the half-open ranges of samples without a gap or a value that is not finite.

    Parameters
    ----------
    signal : (samples,) or (samples, channels).
    gaps : indices i where samples are missing between i - 1 and i.
    """
    length = signal.shape[0]
    edges = np.unique(np.clip(np.asarray([0, *gaps, length], dtype=np.int64), 0, length))
    # One number shows that all are finite, without a mask as long as the signal.
    with np.errstate(invalid="ignore"):
        total = np.sum(signal)
    if np.isfinite(total):
        return [(int(a), int(b)) for a, b in pairwise(edges)]
    good: npt.NDArray[np.bool_] = np.all(np.isfinite(signal).reshape(length, -1), axis=1)
    turns = np.flatnonzero(np.diff(good)) + 1
    edges = np.unique(np.concatenate([edges, turns]))
    return [(int(a), int(b)) for a, b in pairwise(edges) if good[a]]


def choose_averaging(taus: Taus, rate: float, longest: int) -> Integers:
    """Return averaging times in whole samples, in order, none twice.

    Parameters
    ----------
    taus : as for `allan_deviation`.
    rate : samples a second.
    longest : the most samples that an averaging time may have.

    Raises
    ------
    UsageError
        If none fits, or the name is not known.
    """
    if longest < 1:
        raise UsageError("The signal has too few samples in a row for a deviation: two at least.")
    if isinstance(taus, str):
        chosen = _named(taus, longest)
    else:
        wanted = np.asarray(taus, dtype=np.float64) * rate
        if wanted.size == 0 or not np.all(np.isfinite(wanted)):
            raise UsageError("Averaging times must be finite numbers in s.")
        chosen = np.unique(np.rint(wanted).astype(np.int64))
    chosen = chosen[(chosen >= 1) & (chosen <= longest)]
    if not chosen.size:
        raise UsageError(
            f"No averaging time fits: from {1.0 / rate:.3g} s (one sample) to {longest / rate:.3g} s can be had."
        )
    return chosen


def _named(name: str, longest: int) -> Integers:
    decades = int(np.log10(longest)) + 1
    if name == "octave":
        return 2 ** np.arange(int(np.log2(longest)) + 1, dtype=np.int64)
    if name == "log":
        steps = np.arange(_PER_DECADE * decades + 1) / _PER_DECADE
        return np.unique(np.rint(10.0**steps).astype(np.int64))
    raise UsageError(f"{name!r} names no averaging times: octave or log, or give them in s.")


def _columns(signal: AnyArray) -> Table:
    if signal.ndim not in (1, 2):
        raise UsageError("A signal has one dimension, or two: samples and channels.")
    return np.asarray(signal, dtype=np.float64).reshape(signal.shape[0], -1)


def _check(rate: float, noise: int | None) -> None:
    if not (np.isfinite(rate) and rate > 0.0):
        raise UsageError(f"A sampling rate of {rate} Hz cannot be.")
    if noise is not None and noise not in EXPONENTS:
        known = ", ".join(str(exponent) for exponent in EXPONENTS)
        raise UsageError(f"{noise} is no exponent of noise that this deviation can see: {known}.")


def _by_floor(averaging: Integers, places: int | None) -> list[list[int]]:
    """Averaging times in the samples of each floor: up to 128 on the first, 65 to 128 on the others."""
    if places is None:
        return [averaging.tolist()]
    found: list[list[int]] = [[]]
    for m in averaging:
        height = max(0, int(np.ceil(np.log2(m / places) - 1e-12)))
        while len(found) <= height:
            found.append([])
        each = int(np.rint(m / 2.0**height))
        if each not in found[height]:
            found[height].append(each)
    return found


def _pair_means(floor: _Floor, rows: Table) -> Table:
    """Return the means of pairs, a row left over from before first; the last odd one waits."""
    joined = np.concatenate([floor.odd, rows]) if len(floor.odd) else rows
    even = joined.shape[0] // 2 * 2
    floor.odd = joined[even:].copy()
    return 0.5 * (joined[0:even:2] + joined[1:even:2])


def _assumed(variance: Table, averaging: Integers, lengths: tuple[int, ...], noise: int | None) -> Integers:
    """Exponents of the noise, from the slope of the curve: var ~ tau^μ, α = -μ - 1 (or as `noise` says)."""
    if noise is not None:
        return np.full(variance.shape, noise, dtype=np.int64)
    allowed = np.array(EXPONENTS)
    slopes = np.where(allowed == 2, -2.0, -allowed - 1.0)  # SP 1065 table 4
    clusters = sum(lengths) / averaging
    last = max(int(np.count_nonzero(clusters >= _LEAST_CLUSTERS)) - 1, 0)
    centre: Integers = np.minimum(np.arange(len(averaging)), last)
    x: Series = np.log(averaging)
    reach = float(np.log(_SLOPE_REACH))
    first: Integers = np.searchsorted(x, np.asarray(x[centre] - reach))
    stop: Integers = np.minimum(np.searchsorted(x, np.asarray(x[centre] + reach), "right"), last + 1)

    def near(values: Table) -> Table:
        """Sums over the near averaging times, by their clusters."""
        running: Table = np.cumsum(np.vstack([np.zeros_like(values[:1]), clusters[:, None] * values]), axis=0)
        return running[stop] - running[first]

    y: Table = np.log(np.maximum(variance, np.finfo(float).tiny))
    total, middle = near(np.ones((len(x), 1))), near(x[:, None])
    spread = near(x[:, None] ** 2) - middle**2 / total
    # that of white noise where one stands alone
    alone: npt.NDArray[np.bool_] = (stop - first < 2)[:, None]
    slope = np.where(
        alone, -1.0, (near(x[:, None] * y) - middle * near(y) / total) / np.where(alone, 1.0, spread)
    )
    return allowed[np.argmin(np.abs(slopes - slope[:, :, None]), axis=2)]


def _freedom(exponent: Integers, averaging: Integers, lengths: tuple[int, ...], strides: Integers) -> Table:
    """Degrees of freedom of each variance: those of the pieces, added."""
    alike, repeats = np.unique(np.array(lengths, dtype=np.int64), return_counts=True)
    result = np.zeros(exponent.shape)
    for k, (m, stride) in enumerate(zip(averaging.tolist(), strides.tolist(), strict=True)):
        for alpha in set(exponent[k].tolist()):
            each = [degrees_of_freedom(alpha, m, n, stride) for n in alike.tolist()]
            result[k, exponent[k] == alpha] = repeats @ np.array(each)
    return result
