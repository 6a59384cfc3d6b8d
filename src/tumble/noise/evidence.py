"""What the rest of a recording is judged by: means and scatter of blocks, steps of the converter, times.

It is gathered from the recording's blocks: in grains of a second, or of a sample where the whole recording is one
block, so that both are judged alike.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Table
from tumble.noise.deviation import find_pieces
from tumble.noise.held import beyond_chance, equal_rows
from tumble.recording import Recording, block_statistics, sample_pieces, smallest_step
from tumble.records import dataclass

_LEAST_GRAIN = 20  # samples
_HEAD = 16_384  # samples of a block that is read that steps and roughness are taken from
_MOST_HEADS = 12
_LONE = 1.4826

Piece = tuple[int, int]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Blocks:
    """Statistics of consecutive blocks of one piece of a recording.

    Attributes
    ----------
    first, size : sample at which the first block begins, and samples of each block.
    means, scatter : (blocks, channels) in the recording's units.
    """

    first: int
    size: int
    means: Table
    scatter: Table


class RestEvidence:
    """A recording as the judgement of its rest sees it: some hundred bytes for each grain.

    After the last `add`, call `close` once.

    Attributes
    ----------
    rate : Hz.
    names, units : of the channels, ax to gz, and their raw units.
    alive : (channels,) whether each changes at all; level : its first value.
    pieces : ranges of samples without gap.
    step : (channels,) smallest step of each; rough : (channels,) scatter that neighbouring samples show.
    jitter : (channels,) standard deviation of a sample as its changes show it.
    repeats : share of rows that repeat the row before, beyond chance.
    grain : samples whose means are kept.
    samples, start_time, stop_time : of the recording; the latter in s.
    """

    def __init__(self, *, whole: bool = False) -> None:
        self.names: tuple[str, ...] = ()
        self.pieces: list[Piece] = []
        self.samples, self.grain = 0, 1
        self._whole = whole
        self._means: list[list[Table]] = []
        self._scatter: list[list[Table]] = []
        self._rest = np.zeros((0, 0))
        self._heads: list[Table] = []
        self._blocks = 0
        self._steady = [0.0, 0.0]  # steps between stamps outside gaps, and the time that they take

    @staticmethod
    def of(recording: Recording) -> RestEvidence:
        """Return the evidence of a recording in memory."""
        evidence = RestEvidence(whole=True)
        evidence.add(recording, after_gap=False)
        evidence.close()
        return evidence

    def add(self, block: Recording, *, after_gap: bool) -> None:
        """Take the next block.

        Parameters
        ----------
        block : rows that are not finite part it as gaps do.
        after_gap : whether samples are missing before it.
        """
        channels = block.channels
        celsius = np.full(len(block), np.nan) if block.temperature is None else block.temperature
        rows = np.column_stack([*channels.values(), celsius, block.time])
        signals = rows[:, : len(channels)]
        lowest, highest = np.fmin.reduce(signals, axis=0), np.fmax.reduce(signals, axis=0)
        if not self.names:
            self._begin(block, tuple(channels), signals[0])
        self._low, self._high = np.fmin(self._low, lowest), np.fmax(self._high, highest)
        rows_equal, each_equal = equal_rows(signals)
        self._equal, self._each = self._equal + rows_equal, self._each + each_equal
        if self._whole:
            self._heads += [signals[cut] for cut in sample_pieces(len(block))]
        elif self._blocks & (self._blocks - 1) == 0 and len(self._heads) < _MOST_HEADS:
            self._heads.append(signals[:_HEAD].copy())
        self._blocks += 1
        for k, (a, b) in enumerate(find_pieces(signals[:, ~np.isnan(lowest)], block.gaps)):
            self._extend(rows[a:b], self.samples + a, new=k > 0 or after_gap or not self.pieces)
            self._steady[0] += b - a - 1
            self._steady[1] += float(block.time[b - 1] - block.time[a])
        self.samples += len(block)
        self.stop_time = float(block.time[-1])

    def _begin(self, block: Recording, names: tuple[str, ...], values: Series) -> None:
        self.names, self.units, self.rate = names, units_of(block, names), block.rate
        self.grain = 1 if self._whole else max(_LEAST_GRAIN, round(block.rate))
        self.level = tuple(float(value) for value in values)
        self._low, self._high = values, values
        self._equal, self._each = 0, np.zeros(len(names))
        self.start_time = float(block.time[0])

    def _extend(self, rows: Table, begin: int, *, new: bool) -> None:
        if new:
            self.pieces.append((begin, begin))
            self._means.append([])
            self._scatter.append([])
            self._rest = rows[:0]
        self.pieces[-1] = (self.pieces[-1][0], begin + len(rows))
        if self.grain == 1:
            self._means[-1].append(rows)
            return
        rows = np.concatenate([self._rest, rows]) if len(self._rest) else rows
        means, scatter = block_statistics(rows, self.grain)
        self._means[-1].append(means)
        self._scatter[-1].append(scatter[:, : len(self.names)])
        self._rest = rows[len(means) * self.grain :].copy()

    def close(self) -> None:
        """Sum up what was gathered."""
        self.alive = tuple(bool(change > 0.0) for change in self._high - self._low)
        self.step = np.array([smallest_step(self._heads[0][:, k]) for k in range(len(self.names))])
        self.rough = _roughness(self._heads)
        self.jitter = _jitter(self._heads)
        self.repeats = beyond_chance(self._equal, self._each, self.samples - 1)
        if not self._whole and self._steady[1] > 0.0:
            self.rate = self._steady[0] / self._steady[1]
        self._starts = np.array([start for start, _ in self.pieces], dtype=np.int64)
        self._joined = [part[0] if len(part) == 1 else np.concatenate(part) for part in self._means]
        self._scattered = [np.concatenate(part) for part in self._scatter if part]
        self._means, self._scatter = [], []

    def blocks(self, piece: Piece, size: int) -> Blocks:
        """Return the statistics of a piece's blocks of about `size` samples, whole grains put together."""
        which, first, last = self._range(piece)
        several = max(1, round(size / self.grain))
        count = (last - first) // several
        width = len(self.names)
        begin = int(self._starts[which]) + first * self.grain
        means = self._joined[which][first : first + count * several, :width]
        if self.grain == 1:
            return Blocks(begin, several, *block_statistics(means, several))
        means = means.reshape(count, several, width)
        scatter = self._scattered[which][first : first + count * several].reshape(count, several, width)
        together = means.mean(axis=1)
        within = np.mean(scatter**2, axis=1) + np.mean((means - together[:, None, :]) ** 2, axis=1)
        return Blocks(begin, several * self.grain, together, np.sqrt(within))

    def temperature(self, piece: Piece, size: int) -> Series | None:
        """Return the mean temperature of the same blocks, or None without one."""
        which, first, last = self._range(piece)
        several = max(1, round(size / self.grain))
        count = (last - first) // several
        part = self._joined[which][first : first + count * several, -2].reshape(count, several).mean(axis=1)
        return None if np.all(np.isnan(part)) else part

    def time_at(self, index: int) -> float:
        """Return the time of a sample, s."""
        which = self._which(index)
        times = self._joined[which][:, -1]
        inside = index - int(self._starts[which]) - 0.5 * (self.grain - 1)
        if not len(times):
            return self.start_time + index / self.rate
        at = min(max(round(inside / self.grain), 0), len(times) - 1)
        return float(times[at] + (inside - at * self.grain) / self.rate)

    def jump_place(self, start: int, stop: int, channel: int) -> int:
        """Return where two means fit best: the sum of what is left over is then farthest from zero."""
        which, first, last = self._range((start, stop))
        values = self._joined[which][first:last, channel]
        if len(values) < 2:
            return (start + stop) // 2
        at = int(np.argmax(np.abs(np.cumsum(values - values.mean())))) + 1
        return int(self._starts[which]) + (first + at) * self.grain

    def grains(self) -> tuple[Table, Table]:
        """Return means of the channels over each grain, and with each the temperature and the time."""
        every = self._joined[0] if len(self._joined) == 1 else np.concatenate(self._joined)
        return every[:, : len(self.names)], every[:, len(self.names) :]

    def starts(self) -> Integers:
        """Return the sample at which each grain begins."""
        places = zip(self._starts, self._joined, strict=True)
        return np.concatenate([start + self.grain * np.arange(len(each)) for start, each in places])

    def straighten(self, slopes: Series, celsius: float) -> None:
        """Take a straight line in the temperature off the means.

        Parameters
        ----------
        slopes : (channels,) for each degree.
        celsius : temperature at which nothing is taken off.
        """
        for each in self._joined:
            each[:, : len(self.names)] -= np.outer(each[:, -2] - celsius, slopes)

    def _which(self, index: int) -> int:
        return max(int(np.searchsorted(self._starts, index, side="right")) - 1, 0)

    def _range(self, piece: Piece) -> tuple[int, int, int]:
        """The piece that a range lies in, and the whole grains inside it."""
        which = self._which(piece[0])
        begin = int(self._starts[which])
        first = -(-(piece[0] - begin) // self.grain)
        last = min((piece[1] - begin) // self.grain, len(self._joined[which]))
        return which, min(first, last), last


def units_of(recording: Recording, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the raw unit of each channel.

    Parameters
    ----------
    recording : as read.
    names : of channels.
    """
    return tuple(
        recording.angular_rate_unit if name.startswith("g") else recording.specific_force_unit
        for name in names
    )


def _roughness(parts: list[Table]) -> Series:
    """Scatter of white noise whose second differences are those of the samples: a hand leaves none."""
    bends = np.concatenate([np.abs(np.diff(part, 2, axis=0)) for part in parts])
    bends = bends[np.all(np.isfinite(bends), axis=1)]
    if not len(bends):
        return np.zeros((parts[0].shape[1],), dtype=np.float64)
    return np.asarray(_LONE * np.median(bends, axis=0) / np.sqrt(6.0), dtype=np.float64)


def _jitter(parts: list[Table]) -> Series:
    changes = np.concatenate([np.diff(part, axis=0) for part in parts])
    changes = changes[np.all(np.isfinite(changes), axis=1)]
    if not len(changes):
        return np.zeros((parts[0].shape[1],), dtype=np.float64)
    return np.asarray(np.std(changes, axis=0) / np.sqrt(2.0), dtype=np.float64)
