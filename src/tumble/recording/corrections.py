"""Which calibrations a recording has been corrected by: its columns say so.

A corrected file has one more column for each calibration that it went through, named
``corrected_by_`` and the twelve digits of the calibration's identity, with the number 1 in every row.
A name in the header outlives copying, cutting, and being read and written by other programs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from tumble.recording.columns import role_of
from tumble.recording.formats.header import header_names
from tumble.recording.frames import Frame, frame_names

PREFIX = "corrected_by_"
_MARK = re.compile(PREFIX + r"([0-9a-f]{12})$")
# Names of temperature's units in headers that nobody can convert.
_COUNTS = ("counts", "raw", "lsb")


def corrections_of(inputs: Iterable[Path | Frame]) -> tuple[str, ...]:
    """Return the identities of the calibrations that files or data frames were corrected by, first one first."""
    marks = [_MARK.match(name) for one in inputs for name in _names(one)]
    return tuple(dict.fromkeys(mark.group(1) for mark in marks if mark is not None))


def _names(one: Path | Frame) -> list[str]:
    return header_names(one) if isinstance(one, Path) else frame_names(one)


def temperature_in_counts(inputs: Iterable[Path | Frame]) -> bool:
    """Tell whether a header says that the temperature is in raw counts (other units are converted on reading)."""
    for one in inputs:
        for name in _names(one):
            role = role_of(name)
            if role is not None and role[0] == "temperature":
                words = re.split(r"[^a-z°]+", name.lower())
                said = (role[1] or words[-1]).lower().strip()
                return said in _COUNTS
    return False
