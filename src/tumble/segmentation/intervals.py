"""Holds given by the user: a text file of start and stop times, instead of the search."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.errors import SegmentationError
from tumble.files import lines_of, number_of, read_text, reading
from tumble.recording import Recording
from tumble.segmentation.timeline import Hold


def read_intervals(path: str | Path) -> list[tuple[float, float]]:
    """Read the holds' start and stop times from a text file, one hold a line.

    Columns are separated by spaces, tabs, commas or semicolons; empty lines and lines that begin
    with ``#`` are skipped, and so is one line of column names at the top.

    Parameters
    ----------
    path : of the file; seconds on the recording's own clock.

    Raises
    ------
    SegmentationError
        If the file cannot be read or is empty, or a line is not two numbers, stops before it starts,
        or overlaps or precedes the line before it; the message names the line.
    """
    with reading(Path(path), "a list of intervals", SegmentationError):
        lines = lines_of(read_text(Path(path)))
    intervals: list[tuple[float, float]] = []
    names_allowed = True
    for number, line in enumerate(lines, start=1):
        words = re.split(r"[,;\s]+", line.strip().strip(",;"))
        if words == [""] or words[0].startswith("#"):
            continue
        values = [value for value in map(_number, words) if value is not None]
        is_names = names_allowed and len(words) == 2 and not values
        names_allowed = False
        if is_names:
            continue
        where = f"{path}, line {number}"
        if not len(words) == len(values) == 2:
            raise SegmentationError(
                f"{where}: {line.strip()[:40]!r} is not two numbers, start and stop in seconds."
            )
        start, stop = values
        if stop <= start:
            raise SegmentationError(f"{where}: the interval ends at {stop:g} s, not after {start:g} s.")
        if intervals and start < intervals[-1][1]:
            raise SegmentationError(
                f"{where}: the interval starts at {start:g} s, before the one above it "
                f"stops ({intervals[-1][1]:g} s); put the holds in order and apart."
            )
        intervals.append((start, stop))
    if not intervals:
        raise SegmentationError(
            f"{path}: the interval file holds no intervals; write start and stop in seconds, one hold a line."
        )
    return intervals


def _number(word: str) -> float | None:
    try:
        return number_of(word)
    except ValueError:
        return None


def holds_of_intervals(recording: Recording, intervals: Sequence[tuple[float, float]]) -> list[Hold]:
    """Return the holds that the user's intervals name.

    Parameters
    ----------
    recording : whose clock the intervals are on.
    intervals : (start, stop) in seconds, in order.

    Raises
    ------
    SegmentationError
        If an interval is empty, overlaps the one before, reaches beyond the recording or has fewer
        than two samples.
    """
    if not intervals:
        raise SegmentationError(
            "No intervals were given; name at least one hold by its start and stop in seconds."
        )
    holds: list[Hold] = []
    first, last = float(recording.time[0]), float(recording.time[-1])
    # half a sample: stamps that were rounded on their way through a text file still fit
    slack = 0.5 / recording.rate
    stopped = -np.inf
    for number, (start, stop) in enumerate(intervals, start=1):
        told = f"Interval {number} ({start:g} to {stop:g} s)"
        if not start < stop:
            raise SegmentationError(f"{told} stops before it starts.")
        if start < stopped:
            raise SegmentationError(f"{told} overlaps the one before it, which stops at {stopped:g} s.")
        if start < first - slack or stop > last + 2 * slack + slack:
            raise SegmentationError(
                f"{told} reaches beyond the recording, which goes from {first:g} to {last:g} s."
            )
        a, b = (int(i) for i in np.searchsorted(recording.time, [start, stop]))
        if b - a < 2:
            raise SegmentationError(f"{told} holds {b - a} samples; a hold takes at least two.")
        holds.append(Hold(a, b))
        stopped = stop
    return holds
