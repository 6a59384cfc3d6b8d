"""Which calibrations a recording has been corrected by: its columns say so.

A corrected file has one more column for each calibration that it went through, named
``corrected_by_`` and the twelve digits of the calibration's identity, with the number 1 in every row.
A name in the header outlives copying, cutting, and being read and written by other programs. Bags say it topic by
topic, EuRoC's folders in `sensor.yaml`: columns of their own are not theirs to have.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from tumble.recording import rewriting
from tumble.recording.columns import role_of
from tumble.recording.formats import header_names, output
from tumble.recording.formats.frames import Frame, frame_names

PREFIX = "corrected_by_"
_MARK = re.compile(PREFIX + r"([0-9a-f]{12})$")
# Names of temperature's units in headers that nobody can convert.
_COUNTS = ("counts", "raw", "lsb")


def corrections_of(
    inputs: Iterable[Path | Frame], topics: str | Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return the identities of the calibrations that files or data frames were corrected by, first one first.

    Parameters
    ----------
    inputs : files, folders or data frames.
    topics : of bags, those that are read; None for whichever were corrected.
    """
    found: list[str] = []
    topics = (topics,) if isinstance(topics, str) else topics
    for one in inputs:
        marks = [_MARK.match(name) for name in _names(one)]
        found += [mark.group(1) for mark in marks if mark is not None]
        if isinstance(one, Path):
            found += _marks_beside(one, topics)
    return tuple(dict.fromkeys(found))


def _marks_beside(path: Path, topics: Sequence[str] | None) -> list[str]:
    """Return what formats without columns of their own say."""
    if path.is_dir() or path.name == "data.csv":
        found = output.euroc_corrections(path)
        if found or not path.is_dir():
            return list(found)
    if not path.is_dir() and path.suffix.lower() not in rewriting.ENDINGS:
        return []
    wanted = None if not topics else {t.strip("/") for t in topics}
    said = rewriting.corrections(path).items()
    return [m for topic, marks in said if wanted is None or topic.strip("/") in wanted for m in marks]


def _names(one: Path | Frame) -> list[str]:
    return header_names(one) if isinstance(one, Path) else frame_names(one)


def temperature_in_counts(inputs: Iterable[Path | Frame]) -> bool:
    """Return whether a header says that the temperature is in raw counts (other units are converted on reading)."""
    for one in inputs:
        for name in _names(one):
            role = role_of(name)
            if role is not None and role[0] == "temperature":
                words = re.split(r"[^a-z°]+", name.lower())
                said = (role[1] or words[-1]).lower().strip()
                return said in _COUNTS
    return False
