"""What the rest of a recording is judged by: means and scatter of blocks, steps of the converter, times.

A recording in memory gives them from its samples; one that is read block by block gathers them on the
first reading, in blocks of a second, so that both are judged alike.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Table
from tumble.noise.deviation import find_pieces
from tumble.noise.held import beyond_chance, equal_rows
from tumble.recording import Recording
from tumble.recording.doctor import channels_of
from tumble.recording.rest import block_statistics, sample_pieces, smallest_step
from tumble.records import dataclass

_LEAST_BLOCK = 20  # samples
_HEAD = 16_384  # samples of a block that is read that steps and roughness are taken from
_MOST_HEADS = 12
_LONE = 1.4826

Piece = tuple[int, int]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
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


@runtime_checkable
class RestEvidence(Protocol):
    """A recording as the judgement of its rest sees it.

    Attributes
    ----------
    rate : Hz.
    names, units : of the channels, ax to gz, and their raw units.
    alive : (channels,) whether each changes at all; level : its first value.
    pieces : ranges of samples without gap.
    step : (channels,) smallest step of each; rough : (channels,) scatter that neighbouring samples show.
    jitter : (channels,) standard deviation of a sample as its changes show it.
    repeats : share of rows that repeat the row before, beyond chance.
    """

    rate: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    alive: tuple[bool, ...]
    level: tuple[float, ...]
    pieces: list[Piece]
    step: Series
    rough: Series
    jitter: Series
    repeats: float

    def blocks(self, piece: Piece, size: int) -> Blocks:
        """Return the statistics of a piece's blocks of about `size` samples."""
        ...

    def temperature(self, piece: Piece, size: int) -> Series | None:
        """Return the mean temperature of the same blocks, or None without one."""
        ...

    def time_at(self, index: int) -> float:
        """Return the time of a sample, s."""
        ...

    def jump_place(self, start: int, stop: int, channel: int) -> int:
        """Return the sample between `start` and `stop` at which a channel jumps."""
        ...


class WholeEvidence:
    """Evidence from a recording in memory.

    Parameters
    ----------
    recording : as read; channels that never change count for nothing.
    """

    def __init__(self, recording: Recording) -> None:
        channels = channels_of(recording)
        self._recording = recording
        self.rate = recording.rate
        self.names = tuple(channels)
        self.units = units_of(recording, self.names)
        self.alive = tuple(_changes(values) for values in channels.values())
        self.level = tuple(float(values[0]) for values in channels.values())
        self._signals = np.column_stack(list(channels.values()))
        lively = self._signals[:, np.array(self.alive)]
        self.pieces = find_pieces(lively, recording.gaps) if lively.size else []
        cuts = [self._signals[cut] for cut in sample_pieces(len(recording))]
        self.step = np.array([smallest_step(values) for values in channels.values()])
        self.rough = _roughness(cuts)
        start, stop = max(self.pieces, key=lambda piece: piece[1] - piece[0], default=(0, 0))
        self.jitter = _jitter([self._signals[start : min(stop, start + 100_000)]])
        self.repeats = beyond_chance(*equal_rows(lively), len(lively) - 1)

    def blocks(self, piece: Piece, size: int) -> Blocks:
        """Return the statistics of a piece's blocks of `size` samples."""
        return Blocks(piece[0], size, *block_statistics(self._signals[piece[0] : piece[1]], size))

    def temperature(self, piece: Piece, size: int) -> Series | None:
        """Return the mean temperature of the same blocks, or None without one."""
        celsius = self._recording.temperature
        if celsius is None:
            return None
        count = (piece[1] - piece[0]) // size
        return celsius[piece[0] : piece[0] + count * size].reshape(count, size).mean(axis=1)

    def time_at(self, index: int) -> float:
        """Return the time of a sample, s."""
        return float(self._recording.time[min(index, len(self._recording) - 1)])

    def jump_place(self, start: int, stop: int, channel: int) -> int:
        """Return where two means fit best: the sum of what is left over is then farthest from zero."""
        values = self._signals[start:stop, channel]
        return start + int(np.argmax(np.abs(np.cumsum(values - values.mean())))) + 1


class Survey:
    """Evidence gathered block by block: some hundred bytes for each second of the recording.

    After the last `add`, call `close` once.
    """

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.units: tuple[str, ...] = ()
        self.rate = 0.0
        self.samples = 0
        self.pieces: list[Piece] = []
        self.start_time, self.stop_time = 0.0, 0.0
        self._size = 1
        self._means: list[list[Table]] = []
        self._scatter: list[list[Table]] = []
        self._rest = np.zeros((0, 0))
        self._heads: list[Table] = []
        self._blocks = 0
        self._equal, self._each = 0, np.zeros(0)
        self._low, self._high = np.zeros(0), np.zeros(0)
        self._steady = [0.0, 0.0]  # steps between stamps outside gaps, and the time that they take

    def add(self, block: Recording, *, after_gap: bool) -> None:
        """Take the next block.

        Parameters
        ----------
        block : with finite values.
        after_gap : whether samples are missing before it.
        """
        channels = channels_of(block)
        signals = np.column_stack(list(channels.values()))
        if not self.names:
            self.names = tuple(channels)
            self.units = units_of(block, self.names)
            self.rate = block.rate
            self._size = max(_LEAST_BLOCK, round(block.rate))
            self.level = tuple(float(value) for value in signals[0])
            self._low, self._high = signals[0].copy(), signals[0].copy()
            self.start_time = float(block.time[0])
        self._low = np.minimum(self._low, signals.min(axis=0))
        self._high = np.maximum(self._high, signals.max(axis=0))
        rows_equal, each_equal = equal_rows(signals)
        self._equal += rows_equal
        self._each = each_equal if not len(self._each) else self._each + each_equal
        if self._blocks & (self._blocks - 1) == 0 and len(self._heads) < _MOST_HEADS:
            self._heads.append(signals[:_HEAD].copy())
        self._blocks += 1
        celsius = np.full(len(block), np.nan) if block.temperature is None else block.temperature
        rows = np.column_stack([signals, celsius, block.time])
        edges = [0, *block.gaps, len(block)]
        for k, (a, b) in enumerate(pairwise(edges)):
            self._extend(rows[a:b], new=k > 0 or after_gap or not self.pieces)
            self._steady[0] += b - a - 1
            self._steady[1] += float(block.time[b - 1] - block.time[a])
        self.stop_time = float(block.time[-1])

    def _extend(self, rows: Table, *, new: bool) -> None:
        if new:
            self.pieces.append((self.samples, self.samples))
            self._means.append([])
            self._scatter.append([])
            self._rest = rows[:0]
        rows_here = np.concatenate([self._rest, rows]) if len(self._rest) else rows
        means, scatter = block_statistics(rows_here, self._size)
        self._means[-1].append(means)
        self._scatter[-1].append(scatter[:, : len(self.names)])
        self._rest = rows_here[len(means) * self._size :].copy()
        self.samples += len(rows)
        self.pieces[-1] = (self.pieces[-1][0], self.samples)

    def close(self) -> None:
        """Sum up what was gathered."""
        self.alive = tuple(bool(change > 0.0) for change in self._high - self._low)
        self.step = np.array([smallest_step(self._heads[0][:, k]) for k in range(len(self.names))])
        self.rough = _roughness(self._heads)
        self.jitter = _jitter(self._heads)
        self.repeats = beyond_chance(self._equal, self._each, self.samples - 1)
        if self._steady[1] > 0.0:
            self.rate = self._steady[0] / self._steady[1]
        self._starts = np.array([start for start, _ in self.pieces], dtype=np.int64)
        self._joined = [np.concatenate(part) for part in self._means]
        self._scattered = [np.concatenate(part) for part in self._scatter]
        self._means, self._scatter = [], []

    def blocks(self, piece: Piece, size: int) -> Blocks:
        """Return the statistics of a piece's blocks of about `size` samples, whole blocks of a second put together."""
        which, first, last = self._range(piece)
        several = max(1, round(size / self._size))
        count = (last - first) // several
        width = len(self.names)
        means = self._joined[which][first : first + count * several, :width].reshape(count, several, width)
        scatter = self._scattered[which][first : first + count * several].reshape(count, several, width)
        together = means.mean(axis=1)
        within = np.mean(scatter**2, axis=1) + np.mean((means - together[:, None, :]) ** 2, axis=1)
        begin = int(self._starts[which]) + first * self._size
        return Blocks(begin, several * self._size, together, np.sqrt(within))

    def temperature(self, piece: Piece, size: int) -> Series | None:
        """Return the mean temperature of the same blocks, or None without one."""
        which, first, last = self._range(piece)
        several = max(1, round(size / self._size))
        count = (last - first) // several
        part = self._joined[which][first : first + count * several, -2].reshape(count, several).mean(axis=1)
        return None if np.all(np.isnan(part)) else part

    def time_at(self, index: int) -> float:
        """Return the time of a sample, s."""
        which = self._which(index)
        times = self._joined[which][:, -1]
        inside = index - int(self._starts[which]) - 0.5 * (self._size - 1)
        if not len(times):
            return self.start_time + index / self.rate
        at = min(max(round(inside / self._size), 0), len(times) - 1)
        return float(times[at] + (inside - at * self._size) / self.rate)

    def jump_place(self, start: int, stop: int, channel: int) -> int:
        """Return the border between two seconds at which two means fit best."""
        which, first, last = self._range((start, stop))
        values = self._joined[which][first:last, channel]
        if len(values) < 2:
            return (start + stop) // 2
        at = int(np.argmax(np.abs(np.cumsum(values - values.mean())))) + 1
        return int(self._starts[which]) + (first + at) * self._size

    def seconds(self) -> tuple[Table, Table]:
        """Return means of the channels over a second, and with each the temperature and the time."""
        every = np.concatenate(self._joined)
        return every[:, : len(self.names)], every[:, len(self.names) :]

    def starts(self) -> Integers:
        """Return the sample at which each of the same seconds begins."""
        places = zip(self._starts, self._joined, strict=True)
        return np.concatenate([start + self._size * np.arange(len(each)) for start, each in places])

    def straighten(self, slopes: Series, celsius: float) -> None:
        """Take a straight line in the temperature off the means.

        Parameters
        ----------
        slopes : (channels,) for each degree.
        celsius : temperature at which nothing is taken off.
        """
        for each in self._joined:
            each[:, : len(self.names)] -= np.outer(each[:, -2] - celsius, slopes)

    @property
    def block(self) -> int:
        """Samples of each block."""
        return self._size

    def _which(self, index: int) -> int:
        return max(int(np.searchsorted(self._starts, index, side="right")) - 1, 0)

    def _range(self, piece: Piece) -> tuple[int, int, int]:
        """The piece that a range lies in, and the whole blocks inside it."""
        which = self._which(piece[0])
        begin = int(self._starts[which])
        first = -(-(piece[0] - begin) // self._size)
        last = min((piece[1] - begin) // self._size, len(self._joined[which]))
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


def _changes(values: Series) -> bool:
    good = values if np.isfinite(values.sum()) else values[np.isfinite(values)]
    return bool(good.size) and float(np.ptp(good)) > 0.0


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
