"""Lines of text: CSV, ``name:value``, ``name=value``, JSON, and MotionCal's ``Raw:`` and ``Uni:``."""

from __future__ import annotations

import json
import math
import re
from typing import Any, cast

from tumble.capture.link import Format
from tumble.capture.rows import Rows
from tumble.capture.source import Piece, SourceOptions

# A line that is longer is none of samples, and what has no line end by then is thrown away.
LONGEST_LINE = 4096
_PAIR = re.compile(
    r"([A-Za-z_][\w.\[\]/°² -]*?)\s*[:=]\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?=\s|[,;]|$)"
)
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")
# MotionCal's imuread.h: counts of 1/8192 g and 1/16 °/s. Its `Uni:` lines are those of Adafruit's sketch: m/s², rad/s.
_MOTIONCAL = {
    "Raw": (("ax [g]", "ay [g]", "az [g]", "gx [deg/s]", "gy [deg/s]", "gz [deg/s]"), (1 / 8192.0, 1 / 16.0)),
    "Uni": (("ax [m/s^2]", "ay [m/s^2]", "az [m/s^2]", "gx [rad/s]", "gy [rad/s]", "gz [rad/s]"), (1.0, 1.0)),
}


class TextLines:
    """Lines in, samples out.

    Parameters
    ----------
    options, name : what the lines do not say themselves, and what they are called.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.rows = Rows(options, name)
        self.good = self.damaged = 0
        self._rest = b""
        self._header: tuple[str, ...] | None = None

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return the samples of the lines that are complete."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = b""
            self.damaged += 1
        for line in lines:
            self._take(line)
        return self.rows.flush(arrived)

    def end(self) -> list[Piece]:
        """Return what is left; a last line without its end is a line."""
        self._take(self._rest)
        return self.rows.end()

    def _take(self, raw: bytes) -> None:
        line = raw.strip()
        if not line:
            return
        text = line.decode("ascii", "replace") if len(line) <= LONGEST_LINE else ""
        if _words(text) is not None and self._header is None and not self.rows.decided:
            self._header = _words(text)
            return
        row = _row(text)
        if row is None:
            self.damaged += not text.startswith(("#", "//", "Cal"))
            return
        names, values = row
        if names is None and self._header is not None and len(self._header) == len(values):
            names = self._header
        if self.rows.add(names, values):
            self.good += 1
        else:
            self.damaged += 1


def _words(text: str) -> tuple[str, ...] | None:
    """The cells of a header, or None: three words or more, none of them a number."""
    cells = tuple(cell.strip().strip('"') for cell in re.split(r"[,;\t]", text))
    if len(cells) < 3:
        cells = tuple(text.split())
    if len(cells) < 3 or not text.isprintable() or "{" in text:
        return None
    return (
        cells
        if all(re.match(r"[A-Za-z_]", cell) and not re.search(r"[:=]\s*[-\d]", cell) for cell in cells)
        else None
    )


def _row(text: str) -> tuple[tuple[str, ...] | None, tuple[float, ...]] | None:
    """Names (None without) and numbers of a line, or None if it is no row."""
    kind, colon, rest = text.partition(":")
    if colon and kind in _MOTIONCAL:
        return _of_motioncal(kind, rest)
    if text.startswith("{"):
        return _of_json(text)
    cells = _SEPARATOR.split(text.strip(",; "))
    try:
        values = tuple(map(float, cells))
    except ValueError:
        pairs = cast("list[tuple[str, str]]", _PAIR.findall(text))
        if len(pairs) < 3:
            return None
        return tuple(name.strip() for name, _ in pairs), tuple(float(value) for _, value in pairs)
    return (None, values) if len(values) >= 3 and all(map(math.isfinite, values)) else None


def _of_motioncal(kind: str, rest: str) -> tuple[tuple[str, ...], tuple[float, ...]] | None:
    names, (force, rate) = _MOTIONCAL[kind]
    try:
        values = [float(cell) for cell in rest.split(",")]
    except ValueError:
        return None
    if len(values) < 6 or not all(map(math.isfinite, values)):
        return None
    return names, tuple([force * v for v in values[:3]] + [rate * v for v in values[3:6]])


def _of_json(text: str) -> tuple[tuple[str, ...], tuple[float, ...]] | None:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    flat: dict[str, float] = {}
    _flatten("", found, flat)
    return (tuple(flat), tuple(flat.values())) if len(flat) >= 3 else None


def _flatten(name: str, value: Any, flat: dict[str, float]) -> None:
    """Numbers by name: ``{"accel": {"x": 1}}`` is ``accel_x``, ``{"gyro": [1, 2, 3]}`` is ``gyro_x`` and so on."""
    if isinstance(value, dict):
        for key, inner in cast("dict[str, Any]", value).items():
            _flatten(f"{name}_{key}" if name else key, inner, flat)
    elif isinstance(value, list) and len(cast("list[Any]", value)) == 3:
        for axis, inner in zip("xyz", cast("list[Any]", value), strict=True):
            _flatten(f"{name}_{axis}", inner, flat)
    elif (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and len(flat) < 64
    ):
        flat[name] = float(value)


FORMAT = Format("text", "lines of text", lambda head: False, TextLines)
