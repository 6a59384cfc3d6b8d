"""What is kept of a result, and how two of them are compared: numbers to 1e-9, sentences exactly."""

from __future__ import annotations

import difflib
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

LONG = 16
"""More numbers than these are kept as checksums."""
RELATIVE = 1e-9
OF_SIGMA = 1e-7
"""A value may move by this part of the standard uncertainty that stands beside it."""
SMALLEST = 1e-15
UNTOLD = ("created", "software", "computed_in_s", "seconds", "seconds_taken")
SUMS = ("count", "first", "last", "sum", "squares", "cosine")
LINES = 20


def checksums(values: Any) -> dict[str, Any]:
    """Of an array of any length."""
    flat = np.asarray(values, dtype=float).ravel()
    known = flat[np.isfinite(flat)]
    made: dict[str, Any] = {
        "count": len(flat),
        "first": _number(flat[0]) if len(flat) else None,
        "last": _number(flat[-1]) if len(flat) else None,
        "sum": _number(math.fsum(known)),
        "squares": _number(math.fsum(known**2)),
        "cosine": _number(math.fsum(known * np.cos(0.7 + 1.3 * np.arange(len(known))))),
    }
    if len(known) < len(flat):
        made["not finite"] = len(flat) - len(known)
    return made


def _number(value: Any) -> Any:
    """Twelve digits: three more than are compared."""
    if isinstance(value, bool | int):
        return value
    value = float(value)
    return float(f"{value:.12g}") if math.isfinite(value) else str(value)


def _numbers(value: Any) -> np.ndarray | None:
    """Return a list or a list of lists as an array, if it is one of numbers."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        return np.asarray(value, dtype=float)
    if not isinstance(value, list | tuple) or not len(value):
        return None
    flat: list[Any] = []
    for item in value:
        flat.extend(item if isinstance(item, list | tuple) else [item])
    if not all(isinstance(item, int | float) or item is None for item in flat) or all(
        i is None for i in flat
    ):
        return None
    return np.array([np.nan if item is None else item for item in flat], dtype=float)


def pinned(value: Any) -> Any:
    """Return what is kept: long lists of numbers as checksums, texts as lines, named records by their names."""
    if isinstance(value, Mapping):
        made = {str(k): pinned(v) for k, v in value.items() if k not in UNTOLD}
        if isinstance(value.get("covariance"), list):
            made["covariance"] = _covariance(np.array(value["covariance"], dtype=float))
        return made
    numbers = _numbers(value)
    if numbers is not None and numbers.size > LONG:
        return {"checksums": checksums(numbers)}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        names = [item.get("name") for item in value if isinstance(item, Mapping)]
        if len(names) == len(value) > 0 and all(names) and len(set(names)) == len(names):
            return {"by name": {str(item["name"]): pinned(item) for item in value}}
        return [pinned(item) for item in value]
    if isinstance(value, str):
        return value.splitlines() if "\n" in value else value
    if value is None or isinstance(value, bool):
        return value
    return _number(value)


def _covariance(matrix: np.ndarray) -> Any:
    """Sigmas and correlations: the covariance itself is of many units."""
    if matrix.ndim != 2:
        return checksums(matrix)
    sigmas = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(sigmas > 0.0, sigmas, 1.0)
    return {
        "sigmas": [_number(s) for s in sigmas],
        "correlations": checksums(matrix / np.outer(scale, scale)),
    }


def sha256(path: Path) -> str:
    """Return a file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def page(path: Path) -> dict[str, Any]:
    """Return what a page says: its lines of text, and the numbers and words of its figures."""
    html = path.read_text(encoding="utf-8").replace(str(Path(__file__).resolve().parents[2]), "ROOT")
    data = re.findall(r'<script type="application/json" id="([\w-]+)">(.*?)</script>', html, re.S)
    text = re.sub(r"<(script|style)\b.*?</\1>", "", html, flags=re.S)
    lines = [" ".join(unescape(line).split()) for line in re.split(r"<[^>]+>", text)]
    said = [re.sub(r"\d{4}-\d\d-\d\dT[\d:+]+( by tumble.*)?", "made", line) for line in lines if line]
    figures = {name: json.loads(content) for name, content in data if name != "calibration"}
    for name, drawn in figures.items():
        if isinstance(drawn, list):
            figures[name] = [
                {k: _leaves(v) for k, v in one.items() if k != "layout"} if isinstance(one, dict) else one
                for one in drawn
            ]
    return {"text": said, "figures": pinned(figures)}


def _leaves(value: Any) -> Any:
    """Return traces without their looks: names, kinds and numbers."""
    if isinstance(value, list):
        return [_leaves(item) for item in value]
    if isinstance(value, Mapping):
        kept = (
            "name",
            "type",
            "x",
            "y",
            "z",
            "base",
            "width",
            "text",
            "error_y",
            "error_x",
            "array",
            "customdata",
        )
        return {k: _leaves(v) for k, v in value.items() if k in kept}
    return value


def differences(before: Any, now: Any, key: str = "", floor: float = 0.0) -> Iterator[str]:
    """Say each difference in a line: its key and both values."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        yield from _of_mappings(before, now, key, floor)
    elif isinstance(before, list) and isinstance(now, list):
        yield from _of_lists(before, now, key, floor)
    elif _is_number(before) and _is_number(now):
        if abs(before - now) > RELATIVE * max(abs(before), abs(now)) + floor + SMALLEST:
            yield f"{key}: {before!r} was, {now!r} is ({now - before:+.3g})"
    elif before != now or type(before) is not type(now):
        yield f"{key}: {_short(before)} was, {_short(now)} is"


def _of_mappings(before: Mapping[str, Any], now: Mapping[str, Any], key: str, floor: float) -> Iterator[str]:
    floors = dict.fromkeys(before, floor)
    sigma = before.get("standard_uncertainty", before.get("sigma"))
    if _is_number(sigma):
        floors = dict.fromkeys(before, OF_SIGMA * sigma)
    if set(SUMS) <= set(before):
        size = math.sqrt(before["squares"]) if _is_number(before["squares"]) else 0.0
        floors |= {"first": RELATIVE * size, "last": RELATIVE * size}
        floors |= dict.fromkeys(("sum", "cosine"), RELATIVE * size * math.sqrt(before["count"] or 1))
    for name in sorted({*before, *now}):
        place = f"{key}.{name}" if key else name
        if name not in now:
            yield f"{place}: {_short(before[name])} was, is not there now"
        elif name not in before:
            yield f"{place}: was not there, {_short(now[name])} is"
        else:
            yield from differences(before[name], now[name], place, floors[name])


def _of_lists(before: Sequence[Any], now: Sequence[Any], key: str, floor: float) -> Iterator[str]:
    if all(isinstance(item, str) for item in (*before, *now)):
        if before != now:
            changes = difflib.unified_diff(before, now, lineterm="", n=0)
            yield from (f"{key}: {line}" for line in changes if not line.startswith(("---", "+++", "@@")))
        return
    if len(before) != len(now):
        yield f"{key}: {len(before)} entries were, {len(now)} are"
    numbers = [abs(item) for item in before if _is_number(item)]
    floor = max(floor, RELATIVE * max(numbers, default=0.0))
    for place, (old, new) in enumerate(zip(before, now, strict=False)):
        yield from differences(old, new, f"{key}[{place}]", floor)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 160 else f"{text[:157]}..."
