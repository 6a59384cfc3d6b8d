"""Text whose lines say what their numbers are, or have a clock of a serial monitor before them; and JSON.

Lines are read one by one (`lines`). What is no sample is counted and said, and nothing is left out in silence:
greetings of a board before the first sample, damaged lines, and lines of another form than the others.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError, UsageError
from tumble.files import opened
from tumble.recording.columns import plan_from_names, role_of
from tumble.recording.formats.folder import is_sensor, streams_of_tables
from tumble.recording.formats.lines import (
    COMMENTS,
    Row,
    flattened,
    is_marked,
    row_of,
    without_clock,
    words_of,
)
from tumble.recording.formats.streams import table_of_streams
from tumble.recording.formats.table import RawTable
from tumble.recording.samples import Remark
from tumble.records import dataclass

_LARGEST = 512 << 20  # bytes
_SHOWN = 40  # characters of a line that is cited
_HALF_A_DAY = 43200.0
_Key = tuple[str, ...] | int


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read the file whole.

    Parameters
    ----------
    path : the file.
    topics : names of sensors, of files with lines of one sensor each.

    Raises
    ------
    RecordingError
        If there are no samples in it, or it is longer than 512 MB.
    UsageError
        If a topic is not there.
    OSError
        If the file cannot be read.
    """
    with opened(path) as file:
        raw = file.read(_LARGEST + 1)
    if len(raw) > _LARGEST:
        raise RecordingError(
            f"{path.name} is longer than {_LARGEST >> 20} MB, and its lines are read one by one. Cut it into parts, or "
            "save it as CSV."
        )
    text = raw.decode("utf-8-sig", "replace")
    begin = text.lstrip()[:1]
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    array = begin == "[" and not is_marked(text.lstrip().partition("\n")[0].strip())
    objects, lost = (_array(path, text), 0) if array else _json_lines(lines) if begin == "{" else ([], 0)
    if array or any("payload" in o or isinstance(o.get("sensor"), str) for o in objects[:20]):
        yield _of_objects(path, objects, topics, lost)
        return
    _refuse_topics(path, topics)
    gathered = _gathered(lines)
    apart = gathered.apart()
    yield _table(path, gathered) if apart is None else _merged(path, gathered, *apart)


def _refuse_topics(path: Path, topics: Sequence[str]) -> None:
    if topics:
        raise UsageError(
            f"--topic {topics[0]}: {path.name} is labelled lines, which has no topics; leave it out."
        )


@dataclass
class _Gathered:
    """Rows of lines, and what was no row.

    Attributes
    ----------
    rows : number of the line from 1, clock (s of the day, or NaN), names or count of numbers, values.
    greeting : lines without a sample before the first row.
    lost : number and text of lines without a sample after it.
    """

    rows: list[tuple[int, float, _Key, tuple[float, ...]]] = field(
        default_factory=list[tuple[int, float, _Key, tuple[float, ...]]]
    )
    kinds: dict[_Key, str] = field(default_factory=dict[_Key, str])
    greeting: int = 0
    lost: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])

    def counts(self) -> Counter[_Key]:
        """Return how many rows there are of each form."""
        return Counter(key for _, _, key, _ in self.rows)

    def apart(self) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
        """Return the forms of accelerometer and gyro where these stand in lines of their own."""
        counts = self.counts()
        plans = {k: plan for k in counts if isinstance(k, tuple) and (plan := plan_from_names(k)) is not None}
        forces, rates = ([k for k, plan in plans.items() if kind in plan.triads] for kind in "ag")
        if not forces or not rates or set(forces) & set(rates):
            return None
        return max(forces, key=counts.__getitem__), max(rates, key=counts.__getitem__)


def _gathered(lines: list[str]) -> _Gathered:
    made = _Gathered()
    header: tuple[str, ...] | None = None
    forms: dict[frozenset[str], tuple[str, ...]] = {}
    for number, line in enumerate(lines, start=1):
        text, clock = without_clock(line.strip())
        if not text:
            continue
        row = row_of(text)
        if row is None:
            words = words_of(text)
            if words is not None and plan_from_names(words) is not None and not made.rows:
                header = words
            elif not made.rows:
                made.greeting += not text.startswith(COMMENTS)
            elif not text.startswith(COMMENTS):
                made.lost.append((number, text))
            continue
        key, values = _keyed(row, header, forms)
        made.kinds.setdefault(key, row.kind)
        made.rows.append((number, np.nan if clock is None else clock, key, values))
    return made


def _keyed(
    row: Row, header: tuple[str, ...] | None, forms: dict[frozenset[str], tuple[str, ...]]
) -> tuple[_Key, tuple[float, ...]]:
    """Return the form of a row, and its numbers in the order in which the form was first seen."""
    names = (
        header if row.names is None and header is not None and len(header) == len(row.values) else row.names
    )
    if names is None:
        return len(row.values), row.values
    known = forms.setdefault(frozenset(names), names)
    if known == names:
        return names, row.values
    by_name = dict(zip(names, row.values, strict=True))
    return known, tuple(by_name[name] for name in known)


def _table(path: Path, gathered: _Gathered) -> RawTable:
    """Return the rows of the form that most of them have; of the others it is said how many there are."""
    counts = gathered.counts()
    if not counts:
        raise RecordingError(
            f"{path.name} holds no line with a sample; give one of lines such as ax:0.1 ay:0.2 az:9.8."
        )
    most = max(counts.values())
    # MotionCal's lines come in pairs of the same sample: `Uni:` has the finer steps.
    finer = (k for k in counts if isinstance(k, tuple) and k[0] == "ax [m/s^2]" and counts[k] >= 0.9 * most)
    key = next(finer, counts.most_common(1)[0][0])
    chosen = [(number, clock, values) for number, clock, form, values in gathered.rows if form == key]
    remarks = _remarks(path, gathered, key, counts)
    columns = list(np.array([values for _, _, values in chosen], dtype=np.float64).T)
    names, stamps = key if isinstance(key, tuple) else None, None
    if not (_grows(columns[0]) if names is None else any((role_of(n) or ("",))[0] == "t" for n in names)):
        stamps = _stamps(path, np.array([clock for _, clock, _ in chosen]), remarks)
    if stamps is not None:
        columns, names = [stamps, *columns], names and ("t [s]", *names)
    numbers = [number for number, _, _ in chosen]
    made = RawTable(path, names, columns, remarks, lambda row: f"line {numbers[row]}")
    return made if stamps is None else replace(made, clock="host")


def _grows(column: Series) -> bool:
    return column.size > 1 and bool(np.all(np.diff(column) > 0.0))


def _stamps(path: Path, clocks: Series, remarks: list[Remark]) -> Series | None:
    """Return a serial monitor's clock as stamps; rows that share one are spread evenly up to the next one."""
    if clocks.size < 3 or not np.isfinite(clocks).all():
        return None
    straight = clocks + 2.0 * _HALF_A_DAY * np.concatenate([[0.0], np.cumsum(np.diff(clocks) < -_HALF_A_DAY)])
    first = np.flatnonzero(np.concatenate([[True], np.diff(straight) > 0.0]))
    if np.any(np.diff(straight) < 0.0) or first.size < 2:
        return None
    places = np.arange(straight.size, dtype=np.float64)
    last = (straight[first[-1]] - straight[first[-2]]) / (first[-1] - first[-2])
    stamps = np.interp(places, first, straight[first]) + last * np.maximum(places - first[-1], 0.0)
    words = (
        "the stamps are the serial monitor's, of when a line arrived; lines that share one are spread evenly"
    )
    remarks.append(Remark("assumed", f"{path.name}: {words}."))
    return stamps


def _remarks(path: Path, gathered: _Gathered, key: _Key, counts: Counter[_Key]) -> list[Remark]:
    """Say what of a file is no sample, line by line."""
    made: list[Remark] = []
    if gathered.greeting:
        text = f"{gathered.greeting} line(s) before the first sample hold none, as a board's greeting does"
        made.append(Remark("found", f"{path.name}: {text}."))
    others = {form: count for form, count in counts.items() if form != key}
    for form, count in others.items():
        named = ", ".join(form) if isinstance(form, tuple) else f"{form} numbers without names"
        pair = gathered.kinds[form] == gathered.kinds[key] == "motioncal"
        why = "which repeat the same samples" if pair else "which the others do not have"
        made.append(
            Remark(
                "found" if pair else "mended",
                f"{path.name}: {count} line(s) with {named[:120]}, {why}, are not used.",
            )
        )
    made += _about_lost(path, gathered)
    return made


def _about_lost(path: Path, gathered: _Gathered) -> list[Remark]:
    if not gathered.lost:
        return []
    number, text = gathered.lost[0]
    words = f"{len(gathered.lost)} line(s) hold no sample and are left out (the first is line {number}"
    return [Remark("mended", f"{path.name}: {words}: {text[:_SHOWN]!r}).")]


def _merged(path: Path, gathered: _Gathered, force: tuple[str, ...], rate: tuple[str, ...]) -> RawTable:
    """Return lines of one sensor each as one table, by their stamps or, without any, in pairs as they come."""
    remarks = _about_lost(path, gathered)
    for form, count in gathered.counts().items():
        if form not in (force, rate):
            named = ", ".join(form) if isinstance(form, tuple) else f"{form} numbers without names"
            remarks.append(Remark("mended", f"{path.name}: {count} line(s) with {named[:120]} are not used."))
    rows: list[tuple[float, ...]] = []
    clocks: list[float] = []
    held: dict[_Key, tuple[float, tuple[float, ...]]] = {}
    alone = 0
    for _, clock, form, values in gathered.rows:
        if form not in (force, rate):
            continue
        alone += form in held
        held[form] = (clock, values)
        if len(held) == 2:
            rows.append((*held[force][1], *held[rate][1]))
            clocks.append(held[force][0])
            held.clear()
    alone += len(held)
    remarks.append(
        Remark("found", f"{path.name}: accelerometer and gyro stand in lines of their own, read in pairs.")
    )
    if alone:
        remarks.append(Remark("mended", f"{path.name}: {alone} line(s) without a partner are left out."))
    if not rows:
        raise RecordingError(
            f"{path.name} holds no pair of lines with an accelerometer's and a gyro's sample."
        )
    times = {i for i, name in enumerate((*force, *rate)) if (role_of(name) or ("",))[0] == "t"}
    drop = {i for i in times if i >= len(force)}
    names = tuple(n for i, n in enumerate((*force, *rate)) if i not in drop)
    columns = [c for i, c in enumerate(np.array(rows, dtype=np.float64).T) if i not in drop]
    stamps = None if times - drop else _stamps(path, np.array(clocks), remarks)
    if stamps is not None:
        names, columns = ("t [s]", *names), [stamps, *columns]
    return RawTable(path, names, columns, remarks)


def _array(path: Path, text: str) -> list[dict[str, Any]]:
    """Return the objects of a JSON array."""
    try:
        found: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(
            f"{path.name} is no whole JSON ({str(error)[:60]}). Export it again, or give JSON lines."
        ) from None
    return [one for one in cast("list[Any]", found) if isinstance(one, dict)]


def _json_lines(lines: list[str]) -> tuple[list[dict[str, Any]], int]:
    """Return the objects of JSON lines, and how many lines are none."""
    made: list[dict[str, Any]] = []
    lost = 0
    for line in lines:
        try:
            found: Any = json.loads(line)
        except (ValueError, RecursionError):
            lost += bool(line.strip())
            continue
        if isinstance(found, dict):
            made.append(cast("dict[str, Any]", found))
    return made, lost


def _of_objects(path: Path, objects: list[dict[str, Any]], topics: Sequence[str], lost: int = 0) -> RawTable:
    """Return the table of JSON objects: with both triads each, or of one sensor each as Sensor Logger writes them."""
    entries = [entry for one in objects for entry in _payload(one)]
    sensors: dict[str, tuple[str, list[tuple[float, ...]]]] = {}
    for entry in entries:
        name = entry.get("sensor", entry.get("name"))
        plain = is_sensor(name) if isinstance(name, str) else None
        if plain is None:
            continue
        values = _of_sensor(entry)
        if values is None:
            lost += 1
            continue
        sensors.setdefault(plain, (str(name), []))[1].append(values)
    if not sensors:
        _refuse_topics(path, topics)
        return _table(path, _gathered([json.dumps(one) for one in objects]))
    tables = {
        plain: (name, RawTable(path, ("seconds_elapsed", "x", "y", "z"), list(np.array(rows).T)))
        for plain, (name, rows) in sensors.items()
    }
    try:
        streams, chosen = streams_of_tables(tables)
    except StopIteration:
        listed = ", ".join(name for name, _ in sensors.values())
        raise RecordingError(
            f"{path.name} holds {listed}: a calibration needs an accelerometer and a gyro."
        ) from None
    remarks = (
        [Remark("mended", f"{path.name}: {lost} line(s) or sample(s) without numbers are left out.")]
        if lost
        else []
    )
    return table_of_streams(path, streams, topics, chosen, remarks)


def _payload(one: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the samples in a message that an app has pushed, or the object itself."""
    inside: Any = one.get("payload")
    if not isinstance(inside, list):
        return [one]
    return [cast("dict[str, Any]", each) for each in cast("list[Any]", inside) if isinstance(each, dict)]


def _of_sensor(entry: dict[str, Any]) -> tuple[float, ...] | None:
    """Return seconds, x, y and z of a sample of one sensor."""
    inside: Any = entry.get("values")
    flat = flattened(entry | cast("dict[str, Any]", inside) if isinstance(inside, dict) else entry)
    if "seconds_elapsed" in flat:
        time = flat["seconds_elapsed"]
    elif "time" in flat:
        # Nanoseconds since 1970 have more digits than a float: whole seconds apart.
        nanoseconds = int(str(entry["time"]).partition(".")[0])
        time = nanoseconds // 10**9 + nanoseconds % 10**9 / 1e9 if nanoseconds > 10**15 else flat["time"]
    else:
        return None
    if not all(axis in flat for axis in "xyz"):
        return None
    return (time, *(flat[axis] for axis in "xyz"))
