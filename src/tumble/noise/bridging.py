"""A few lost samples filled in, so that they do not bound the averaging times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray
from tumble.noise.held import of_each
from tumble.recording import Recording, find_gaps

BRIDGED = 1e-3
"""Share of samples that may be filled in: less than any interval is wide."""

_LONGEST = 1.0  # s, of a gap that is filled in
_HEAD_START = 100_000  # samples that count as read before the first, so that an early gap may be filled in
_STAMPS = 2000  # on either side of the border of two blocks, by which a gap between them is judged

Integers = npt.NDArray[np.int64]


def _lost_samples(recording: Recording) -> Integers:
    """Return how many samples are missing at each gap of a recording."""
    index = np.array(recording.gaps, dtype=np.int64)
    return np.rint(np.diff(recording.time)[index - 1] * recording.rate).astype(np.int64) - 1


def bridge(recording: Recording, budget: float) -> tuple[Recording, int, int]:
    """Fill short gaps in on a straight line; return the recording, the samples filled in and in how many places.

    Parameters
    ----------
    recording : as read.
    budget : samples that may be filled in. Where it does not suffice, nothing is filled in.
    """
    if not recording.gaps:
        return recording, 0, 0
    lost = _lost_samples(recording)
    short = (lost >= 1) & (lost <= _LONGEST * recording.rate)
    total = int(lost[short].sum())
    if total == 0 or total > budget:
        return recording, 0, 0
    index = np.array(recording.gaps, dtype=np.int64)
    added = np.bincount(index[short], lost[short], minlength=len(recording))[: len(recording)].cumsum()
    grid = np.arange(len(recording), dtype=np.float64) + added
    full = np.arange(float(grid[-1]) + 1.0)

    def filled(values: AnyArray) -> AnyArray:
        result = np.empty((len(full), *values.shape[1:]))
        for place in np.ndindex(values.shape[1:]):
            result[:, *place] = np.interp(full, grid, values[:, *place])
        return result

    gaps = tuple(int(grid[i]) for i in index[~short])
    bridged = of_each(recording, filled, time=np.interp(full, grid, recording.time), gaps=gaps)
    return bridged, total, int(np.count_nonzero(short))


def say_bridged(total: int, places: int, samples: int) -> str:
    """Return the sentence about samples that were filled in.

    Parameters
    ----------
    total, places : samples filled in, and in how many places.
    samples : of the recording.
    """
    return (
        f"{total} lost sample(s) in {places} place(s) are filled in on a straight line, which takes that share "
        f"({100.0 * total / samples:.2g} %) off the variance at short averaging times."
    )


class BridgedBlocks:
    """Blocks of a recording one after another, short gaps filled in, what is to be skipped left out.

    Every reading gives the same blocks.

    Parameters
    ----------
    read : begins a reading anew.
    skip : s at the start to leave out.
    whole : the recording is one block.
    """

    def __init__(
        self, read: Callable[[], Iterable[Recording]], skip: float = 0.0, *, whole: bool = False
    ) -> None:
        self._read, self._skip = read, skip
        self._head_start = 0 if whole else _HEAD_START
        self.filled, self.places, self.samples = 0, 0, 0

    def __iter__(self) -> Iterator[tuple[Recording, bool]]:
        """Yield each block, and whether samples are missing before it."""
        self.filled, self.places, self.samples = 0, 0, 0
        before: Recording | None = None
        begin: float | None = None
        for block in self._read():
            begin = float(block.time[0]) + self._skip if begin is None else begin
            first = int(np.searchsorted(block.time, begin)) if self._skip > 0.0 else 0
            if first >= len(block):
                continue
            taken = block.between(first, len(block))
            after_gap, joined = _joined(before, taken)
            budget = BRIDGED * (self.samples + len(taken) + self._head_start) - self.filled
            whole, total, places = bridge(joined, budget)
            self.filled, self.places = self.filled + total, self.places + places
            self.samples += len(taken)
            before = taken.between(max(0, len(taken) - _STAMPS), len(taken))
            if joined is taken:
                yield whole, after_gap
            else:
                # The row before the gap was lent for the line across it, and has been handed over.
                still = 1 in whole.gaps
                rest = whole.between(1, len(whole))
                yield rest, still


def _joined(before: Recording | None, block: Recording) -> tuple[bool, Recording]:
    """Whether samples are missing before a block; and the block, with the row before it if they are."""
    if before is None:
        return False, block
    stamps = np.concatenate([before.time, block.time[:_STAMPS]])
    if len(before) not in find_gaps(stamps, block.rate):
        return False, block
    last = before.between(len(before) - 1, len(before))

    def put_together(a: AnyArray | None, b: AnyArray | None) -> AnyArray | None:
        return None if a is None or b is None else np.concatenate([a, b])

    joined = replace(
        block,
        time=np.concatenate([last.time, block.time]),
        specific_force=put_together(last.specific_force, block.specific_force),
        angular_rate=put_together(last.angular_rate, block.angular_rate),
        temperature=put_together(last.temperature, block.temperature),
        gaps=(1, *(i + 1 for i in block.gaps)),
    )
    return True, joined
