"""One line of text with a sample in it: ``name:value``, ``name=value``, JSON, MotionCal's lines, or bare numbers.

Serial monitors put the time of day before a line (``17:50:07.211 -> ``). It is taken off, as a time of arrival.
"""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from typing import Any, cast

from tumble.files import number_of
from tumble.recording.columns import role_of
from tumble.records import dataclass

LONGEST_LINE = 4096
"""Characters; a longer line has no sample in it."""
COMMENTS = ("#", "//", "%")

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UNIT = r"m/s\^?2|m/s²|rad/s|deg/s|°/s|dps|mg|g|[uµ]T|°?C"
_PAIR = re.compile(rf"([A-Za-z_][\w.\[\]/°²^ -]*?)\s*[:=]\s*({_NUMBER})(?:\s*({_UNIT}))?(?=\s|[,;|]|$)")
_TRIPLE = re.compile(
    rf"([A-Za-z_][\w ]*?)\s*[:=]?\s*[\[(]?\s*({_NUMBER})[\s,;]+({_NUMBER})[\s,;]+({_NUMBER})(?![\s,;]*[-+.\d])"
)
_SEPARATOR = re.compile(r"\s*[,;\t|]\s*|\s+")
# Arduino IDE 2 and 1, PlatformIO's filter `time`, and terminals that put the time into brackets.
_CLOCK = re.compile(
    r"(?:\d{4}-\d\d-\d\d[ T])?(\d\d?):(\d\d):(\d\d)(?:[.,](\d{1,6}))?\s*(?:->|>)\s?"
    r"|\[(?:\d{4}-\d\d-\d\d[ T])?(\d\d?):(\d\d):(\d\d)(?:[.,](\d{1,6}))?\]\s*"
)
# MotionCal's imuread.h: counts of 1/8192 g, 1/16 °/s and 0.1 µT. Its `Uni:` lines are those of Adafruit's sketch: m/s²,
# rad/s and µT.
_MOTIONCAL = {
    "Raw": (("g", "deg/s", "uT"), (1 / 8192.0, 1 / 16.0, 0.1)),
    "Uni": (("m/s^2", "rad/s", "uT"), (1.0, 1.0, 1.0)),
}
_MOST_NUMBERS = 64


@dataclass(frozen=True)
class Row:
    """What one line says.

    Attributes
    ----------
    names : of its numbers, or None where it says none.
    values : the numbers.
    kind : "json", "motioncal", "pairs", "triad" (one sensor's three numbers after its name) or "numbers".
    """

    names: tuple[str, ...] | None
    values: tuple[float, ...]
    kind: str


def without_clock(text: str) -> tuple[str, float | None]:
    """Return a line without the time of day that a serial monitor put before it, and that time in seconds.

    Examples
    --------
    >>> without_clock("17:50:07.211 -> ax:1")
    ('ax:1', 64207.211)
    """
    match = _CLOCK.match(text)
    if match is None:
        return text, None
    hours, minutes, seconds, part = match.groups()[:4] if match[1] is not None else match.groups()[4:]
    fraction = float(f"0.{part}") if part else 0.0
    return text[match.end() :], 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + fraction


def words_of(text: str) -> tuple[str, ...] | None:
    """Return the cells of a header, or None: three words or more, none of them a number, nor a label with one."""
    cells = tuple(cell.strip().strip('"') for cell in re.split(r"[,;\t|]", text))
    if len(cells) < 3:
        cells = tuple(text.split())
    if len(cells) < 3 or not text.isprintable() or "{" in text:
        return None
    named = all(re.match(r"[A-Za-z_]", cell) and not re.search(r"[:=]\s*[-\d]", cell) for cell in cells)
    return cells if named else None


def row_of(text: str) -> Row | None:
    """Return what a line says, or None if it has no sample.

    Parameters
    ----------
    text : of the line, without a clock.
    """
    if len(text) > LONGEST_LINE:
        return None
    kind, colon, rest = text.partition(":")
    if colon and kind in _MOTIONCAL:
        return _of_motioncal(kind, rest)
    if text.startswith("{"):
        return _of_json(text)
    try:
        values = tuple(map(float, _SEPARATOR.split(text.strip(",;| "))))
    except ValueError:
        return _of_labels(text)
    return (
        Row(None, values, "numbers")
        if 3 <= len(values) <= _MOST_NUMBERS and all(map(math.isfinite, values))
        else None
    )


def _of_labels(text: str) -> Row | None:
    pairs = cast("list[tuple[str, str, str]]", _PAIR.findall(text))
    if len(pairs) >= 3:
        names = tuple(name.strip() + (f" [{unit}]" if unit else "") for name, _, unit in pairs)
        values = tuple(float(value) for _, value, _ in pairs)
        if len(set(names)) == len(names) and all(map(math.isfinite, values)):
            return Row(names, values, "pairs")
    triads = cast("list[tuple[str, str, str, str]]", _TRIPLE.findall(text))
    # Any sentence may have three numbers in it: the words before them are to name a sensor.
    if not triads or any(role_of(f"{name.strip()}_x") is None for name, *_ in triads):
        return None
    names = tuple(f"{name.strip()}_{axis}" for name, *_ in triads for axis in "xyz")
    if len(set(names)) < len(names):
        return None
    return Row(names, tuple(float(v) for _, *three in triads for v in three), "triad")


def _of_motioncal(kind: str, rest: str) -> Row | None:
    units, factors = _MOTIONCAL[kind]
    try:
        values = [float(cell) for cell in rest.split(",")]
    except ValueError:
        return None
    if len(values) not in (6, 9) or not all(map(math.isfinite, values)):
        return None
    names = [f"{letter}{axis} [{unit}]" for letter, unit in zip("agm", units, strict=True) for axis in "xyz"]
    return Row(
        tuple(names[: len(values)]),
        tuple(factors[i // 3] * value for i, value in enumerate(values)),
        "motioncal",
    )


def _of_json(text: str) -> Row | None:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    flat = flattened(found)
    return Row(tuple(flat), tuple(flat.values()), "json") if len(flat) >= 3 else None


def flattened(found: Any) -> dict[str, float]:
    """Return the numbers of a JSON object by name: ``{"accel": {"x": 1}}`` is ``accel_x``.

    Parameters
    ----------
    found : as read; three numbers in a list are x, y and z, and a text that is a number is that number.
    """
    flat: dict[str, float] = {}
    _flatten("", found, flat, 0)
    return flat


def _flatten(name: str, value: Any, flat: dict[str, float], depth: int) -> None:
    if depth > 8 or len(flat) >= _MOST_NUMBERS:
        return
    if isinstance(value, dict):
        for key, inner in cast("dict[str, Any]", value).items():
            _flatten(f"{name}_{key}" if name else key, inner, flat, depth + 1)
    elif isinstance(value, list) and len(cast("list[Any]", value)) == 3:
        for axis, inner in zip("xyz", cast("list[Any]", value), strict=True):
            _flatten(f"{name}_{axis}", inner, flat, depth + 1)
    else:
        with suppress(ValueError):
            flat[name] = number_of(cast("object", value))


def begins_labelled(head: bytes) -> bool:
    """Say whether a file that begins so is lines with labels or clocks, or JSON."""
    if b"\0" in head:
        return False
    text = head.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "replace").lstrip()
    if text.startswith(("{", "[{", "[\n", "[ ", "[\r")):
        return True
    lines = [line.strip() for line in text.replace("\r", "\n").split("\n")]
    lines = [line for line in (lines if len(head) < 4096 else lines[:-1]) if line]
    marked = sum(is_marked(line) for line in lines)
    return marked >= 2 and 2 * marked >= len(lines)


def is_marked(line: str) -> bool:
    """Say whether a line has a sample with labels, or behind a clock."""
    rest, clock = without_clock(line)
    row = row_of(rest)
    return row is not None and (clock is not None or row.kind != "numbers")
