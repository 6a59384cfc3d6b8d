"""Deviations of a recording of any length, block by block, in memory that does not grow.

The mean over m samples is also the mean of m/2 means over two: averaging pairs changes no cluster mean, so
that Allan statistics of averaged data at whole multiples of the averaging are those of the
data themselves. Nothing aliases, as it would if every other sample were dropped. What is given up is
overlap: at long averaging times differences begin at every 128th part of the averaging time instead of at
every sample, which costs less than a thousandth of the degrees of freedom.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Table
from tumble.errors import UsageError
from tumble.noise.deviation import Deviation, Integers, Taus, choose_averaging, finish
from tumble.records import dataclass

PLACES = 128
"""Differences begun in each averaging time, at least, once it is that long; a power of two."""

_LONGEST = 1 << 48  # samples: longer than any recording


@dataclass(slots=True)
class _Floor:
    """One level of averaging: the last rows before the next block, and the sums so far."""

    steps: list[int]
    held: Table
    odd: Table
    sums: Table
    counts: list[int]


@dataclass(slots=True)
class StreamedDeviation:
    """Collects blocks of a signal and gives the deviation at octaves of the sampling interval, or as wanted.

    Parameters
    ----------
    rate : samples a second.
    channels : how many.
    taus : as for `tumble.noise.deviation.allan_deviation`. Above 128 samples they are taken to
        the next multiple of the samples that are averaged there, which is within 0.8 %.

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
    _wanted: list[list[int]] = field(default_factory=list[list[int]])
    _floors: list[_Floor] = field(default_factory=list[_Floor])
    _lengths: list[int] = field(default_factory=list[int])
    _level: AnyArray | None = None

    def __post_init__(self) -> None:
        averaging = choose_averaging(self.taus, self.rate, _LONGEST)
        self._wanted = _by_floor(averaging)

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
        level = self._level
        if level is None:
            # The level that is taken off keeps digits; which it is makes no difference.
            level = self._level = np.asarray(block.mean(axis=0))
        rows = block - level
        height = 0
        while rows.shape[0] and height < len(self._wanted):
            if height == len(self._floors):
                self._floors.append(self._new_floor(height))
            floor = self._floors[height]
            self._count_differences(floor, rows)
            rows = _pair_means(floor, rows)
            height += 1

    def _new_floor(self, height: int) -> _Floor:
        steps = self._wanted[height]
        none = np.zeros((0, self.channels))
        return _Floor(steps, none, none, np.zeros((len(steps), self.channels)), [0] * len(steps))

    def _count_differences(self, floor: _Floor, rows: Table) -> None:
        """Add the differences that end in the new rows."""
        from tumble.noise import kernels

        joined = np.concatenate([floor.held, rows])
        before, total = floor.held.shape[0], np.zeros(1)
        phase = np.empty(joined.shape[0] + 1)
        for channel in range(self.channels):
            kernels.running_sum(joined[:, channel], 0.0, phase)
            for k, m in enumerate(floor.steps):
                begin = max(0, before - 2 * m + 1)
                total[0] = 0.0
                kernels.second_difference_squares(phase[begin:], np.array([m]), total)
                floor.sums[k, channel] += total[0]
                if channel == 0:
                    floor.counts[k] += max(0, phase.size - begin - 2 * m)
        reach = 2 * floor.steps[-1] if floor.steps else 0
        floor.held = joined[max(0, joined.shape[0] - reach) :].copy()

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
            for k, m in enumerate(floor.steps)
            if floor.counts[k] > 0
        ]
        if not found:
            raise UsageError("The signal has too few samples in a row for a deviation: two at least.")
        averaging, strides, sums, counts = zip(*found, strict=True)
        return finish(
            np.array(sums),
            np.array(counts, dtype=np.int64),
            np.array(averaging, dtype=np.int64),
            self.rate,
            tuple(self._lengths),
            None,
            np.array(strides, dtype=np.int64),
        )


def _by_floor(averaging: Integers) -> list[list[int]]:
    """Averaging times in the samples of each floor: up to 128 on the first, 65 to 128 on the others."""
    found: list[list[int]] = [[]]
    for m in averaging:
        height = max(0, int(np.ceil(np.log2(m / PLACES) - 1e-12)))
        while len(found) <= height:
            found.append([])
        each = int(np.rint(m / 2.0**height))
        if each not in found[height]:
            found[height].append(each)
    return found


def _pair_means(floor: _Floor, rows: Table) -> Table:
    """Return the means of pairs, a row left over from before first; the last odd one waits."""
    joined = np.concatenate([floor.odd, rows])
    even = joined.shape[0] // 2 * 2
    floor.odd = joined[even:].copy()
    return 0.5 * (joined[0:even:2] + joined[1:even:2])
