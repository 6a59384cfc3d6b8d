"""The blocks of a recording that is still going on: what the search for holds looks at, in bounded memory."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vectors
from tumble.capture.source import Channels
from tumble.recording.recording import Recording
from tumble.recording.samples import Samples, joined
from tumble.segmentation.blocks import BlockCut, Blocks, TriadBlocks
from tumble.segmentation.search import LONGEST_HARMLESS_GAP
from tumble.units import COUNTS, angular_rate_factor, specific_force_factor

# An hour of blocks of 0.05 s: some 6 MB. Then the oldest quarter is let go.
MOST_BLOCKS = 72_000
_FEWEST = 1_024


class LiveBlocks:
    """Means and roughness of consecutive blocks, the newest `MOST_BLOCKS` of them.

    Blocks are numbered from the first sample on; `first` is the oldest that is kept, `count` the one that comes
    next. What is cut is what `tumble.segmentation` cuts from the file.

    Parameters
    ----------
    channels : units and rate.
    most : blocks that are kept.
    """

    def __init__(self, channels: Channels, most: int = MOST_BLOCKS) -> None:
        self.channels = channels
        self.cut = BlockCut.at_rate(channels.rate)
        self.first = self.count = 0
        self.samples = 0
        self._most = most
        self._walls: list[int] = []
        self._rest: list[Samples] = []
        self._last: Samples | None = None
        # The last sample of each triad that is in a block.
        self._before: dict[str, Vectors] = {}
        room = min(_FEWEST, most)
        self._time = np.empty(room)
        self._triads = {
            name: (np.empty((room, 3)), np.empty((room, 3), dtype=np.float32))
            for name, unit in self._units()
            if unit is not None
        }

    def _units(self) -> tuple[tuple[str, str | None], ...]:
        return ("force", self.channels.specific_force_unit), ("rate", self.channels.angular_rate_unit)

    @property
    def last_time(self) -> float | None:
        """Stamp of the newest sample, s."""
        return None if self._last is None else float(self._last.time[-1])

    def add(self, samples: Samples) -> int:
        """Take samples and return how many blocks they completed.

        Parameters
        ----------
        samples : in time order, after those before.
        """
        if not len(samples):
            return 0
        size = self.cut.size
        before = samples.time[0] if self._last is None else self._last.time[-1]
        long = np.flatnonzero(np.diff(samples.time, prepend=before) > LONGEST_HARMLESS_GAP)
        self._walls += [(self.samples + int(i)) // size for i in long]
        self._rest.append(samples)
        self.samples += len(samples)
        self._last = samples.cut(np.array([-1]))
        blocks = self.samples // size - self.count
        if blocks:
            waiting = joined(self._rest)
            self._put(waiting, blocks)
            self._rest = [waiting.cut(np.arange(blocks * size, len(waiting)))]
        return blocks

    def _put(self, samples: Samples, blocks: int) -> None:
        self._make_room(blocks)
        size, at = self.cut.size, slice(self.count - self.first, self.count - self.first + blocks)
        self._time[at] = samples.time[: blocks * size : size]
        for name, signal in (("force", samples.specific_force), ("rate", samples.angular_rate)):
            if name not in self._triads or signal is None:
                continue
            mean, roughness = self._triads[name]
            values = signal[: blocks * size]
            mean[at] = values.reshape(blocks, size, 3).mean(axis=1)
            before = self._before.get(name, values[:1])
            steps = np.diff(np.concatenate([before, values]), axis=0).reshape(blocks, size, 3)
            roughness[at] = 0.5 * np.mean(steps**2, axis=1)
            self._before[name] = values[-1:].copy()
        self.count += blocks

    def _make_room(self, blocks: int) -> None:
        kept, capacity = self.count - self.first, self._time.shape[0]
        if kept + blocks <= capacity:
            return
        drop = min(self._most // 4, kept) if kept + blocks > self._most else 0
        room = max(min(2 * capacity, self._most), kept - drop + blocks)
        self._time = _moved(self._time, drop, kept, room)
        for name, (mean, roughness) in self._triads.items():
            self._triads[name] = (_moved(mean, drop, kept, room), _moved(roughness, drop, kept, room))
        self.first += drop
        self._walls = [wall for wall in self._walls if wall >= self.first]

    def blocks(self, start: int) -> Blocks:
        """Return the blocks from number `start` on, as the search takes them.

        Parameters
        ----------
        start : not before `first`.
        """
        span = slice(start - self.first, self.count - self.first)
        found: dict[str, TriadBlocks] = {
            name: self.cut.smoothed(mean[span], roughness[span])
            for name, (mean, roughness) in self._triads.items()
        }
        return Blocks(
            self.cut.size,
            self.cut.seconds,
            self.cut.half_width,
            found.get("force"),
            found.get("rate"),
            specific_force_factor(self.channels.specific_force_unit or COUNTS),
            angular_rate_factor(self.channels.angular_rate_unit or COUNTS),
        )

    def walls(self, start: int) -> np.ndarray:
        """Return the blocks, counted from `start`, that a hold may not go across: samples are missing there.

        Parameters
        ----------
        start : not before `first`.
        """
        walls = np.array([w for w in self._walls if w >= start], dtype=int) - start
        return np.minimum(walls, self.count - start - 1)

    def time_of(self, sample: int) -> float:
        """Return the stamp of a sample, by its block, s.

        Parameters
        ----------
        sample : number from the first sample on.
        """
        block, beyond = divmod(sample, self.cut.size)
        block = min(max(block, self.first), self.count - 1)
        return float(self._time[block - self.first]) + min(beyond, self.cut.size) / self.channels.rate

    def newest(self, name: str, blocks: int) -> Vectors | None:
        """Return the means of the newest blocks of a triad, raw; None where there is no such triad.

        Parameters
        ----------
        name : "force" or "rate".
        blocks : how many at most.
        """
        if name not in self._triads:
            return None
        stop = self.count - self.first
        return self._triads[name][0][max(stop - blocks, 0) : stop]

    def averaged(self) -> Recording:
        """Return the means of all blocks that are kept as a recording of its own, raw, of 1 / 0.05 s."""
        span = slice(0, self.count - self.first)
        means = {name: triad[0][span] for name, triad in self._triads.items()}
        return Recording(
            time=self._time[span],
            specific_force=means.get("force"),
            angular_rate=means.get("rate"),
            specific_force_unit=self.channels.specific_force_unit or COUNTS,
            angular_rate_unit=self.channels.angular_rate_unit or COUNTS,
            rate=1.0 / self.cut.seconds,
            gaps=tuple(int(w) for w in np.unique(self.walls(self.first)) if w > 0),
        )


def _moved(values: np.ndarray, drop: int, kept: int, room: int) -> np.ndarray:
    """The rows from `drop` on, at the start of an array of `room` rows."""
    made = np.empty((room, *values.shape[1:]), dtype=values.dtype)
    made[: kept - drop] = values[drop:kept]
    return made
