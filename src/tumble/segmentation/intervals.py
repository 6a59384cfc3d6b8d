"""Holds given by the user: a text file of start and stop times, instead of the search."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.errors import SegmentationError
from tumble.files import lines_of, number_of, read_text, reading
from tumble.recording.recording import Recording
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
        values = _numbers(words)
        if values is None and names_allowed and len(words) == 2 and not any(map(_is_number, words)):
            names_allowed = False
            continue
        names_allowed = False
        intervals.append(_interval(path, number, line, values, intervals))
    if not intervals:
        raise SegmentationError(
            f"{path}: the interval file holds no intervals; write start and stop in seconds, one hold a line."
        )
    return intervals


def _is_number(word: str) -> bool:
    try:
        number_of(word)
    except ValueError:
        return False
    return True


def _numbers(words: list[str]) -> tuple[float, float] | None:
    if len(words) != 2 or not all(map(_is_number, words)):
        return None
    start, stop = float(words[0]), float(words[1])
    return (start, stop) if np.isfinite(start) and np.isfinite(stop) else None


def _interval(
    path: str | Path,
    number: int,
    line: str,
    values: tuple[float, float] | None,
    earlier: list[tuple[float, float]],
) -> tuple[float, float]:
    if values is None:
        raise SegmentationError(
            f"{path}, line {number}: {line.strip()[:40]!r} is not two numbers, start and stop in seconds."
        )
    if values[1] <= values[0]:
        raise SegmentationError(
            f"{path}, line {number}: the interval ends at {values[1]:g} s, not after {values[0]:g} s."
        )
    if earlier and values[0] < earlier[-1][1]:
        raise SegmentationError(
            f"{path}, line {number}: the interval starts at {values[0]:g} s, before the one above it "
            f"stops ({earlier[-1][1]:g} s); put the holds in order and apart."
        )
    return values


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
