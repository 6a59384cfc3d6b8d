"""Folders: EuRoC data sets, phones' logs with a file a sensor, and folders with one recording in them.

Phones' loggers (Sensor Logger, phyphox and the like) write one CSV a sensor, each with stamps of its own.

References
----------
Sensor Logger, *One-Page Unit Reference*; Android developer guide, *Motion sensors*; phyphox, export as CSV.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tumble.arrays import Vectors
from tumble.errors import RecordingError
from tumble.recording import formats
from tumble.recording.columns import NAMES, QUANTITY
from tumble.recording.formats import text
from tumble.recording.formats.streams import Stream, table_of_streams
from tumble.recording.formats.table import RawTable, hash_file, hash_files, joined_tables
from tumble.recording.samples import Samples, Source
from tumble.recording.stamps import seconds_of
from tumble.units import find_unit, specific_force_factor

_PHONES = {kind: tuple(names.split()) for kind, names in NAMES["phones, the best choice first"].items()}
_ACCELEROMETERS, _MAY_LACK_GRAVITY, _GYROS, _MAGNETOMETERS, _TIMES = _PHONES.values()
_GRAVITY = "gravity"
_FREE_OF_GRAVITY = (
    "is what the phone's system makes of the sensor by adding the gravity that it had taken out"
)
_LEAST_NORM = 5.0  # m/s² on average of an acceleration with gravity, unless it is thrown
_PHONES_OWN = "is what the phone's system left of the magnetometer, which it calibrates by itself"
_UNCALIBRATED = "is the sensor's own, without the corrections of the phone's system"


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def find_sensors(files: list[Path]) -> dict[str, Path]:
    """Return the files of a folder that are named after a sensor that is read, or gravity, by plain name."""
    named = {f: is_sensor(f.stem) for f in files if f.suffix.lower() in (".csv", ".txt")}
    return {name: f for f, name in named.items() if name}


def is_phone_log(files: list[Path]) -> bool:
    """Say whether the files of a folder are a phone's log: one of an accelerometer, one of a gyro."""
    sensors = find_sensors(files)
    return any(n in sensors for n in _ACCELEROMETERS) and any(n in sensors for n in _GYROS)


def is_sensor(name: str) -> str | None:
    """Return the plain name of a sensor that is read, or gravity, as phones' loggers write it; None of another.

    Parameters
    ----------
    name : of a file or a stream.
    """
    plain = _plain(name)
    return plain if plain in {*_ACCELEROMETERS, *_GYROS, *_MAGNETOMETERS, _GRAVITY} else None


def rank_sensor(name: str) -> tuple[str, int] | None:
    """Return which kind of sensor a name means and which choice it is among those; None of another.

    Parameters
    ----------
    name : as phones' loggers write it.

    Examples
    --------
    >>> rank_sensor("GyroscopeUncalibrated")
    ('rate', 0)
    """
    plain = _plain(name)
    ranked = ((kind, _PHONES[kind]) for kind in ("force", "rate", "field"))
    return next(((kind, names.index(plain)) for kind, names in ranked if plain in names), None)


def streams_of_tables(tables: dict[str, tuple[str, RawTable]]) -> tuple[list[Stream], list[str]]:
    """Return the streams of a phone's log, and the names of those that are read without an option.

    The accelerometer without corrections goes before the one with gravity, and that before the one whose
    gravity was taken out and stands in a file of its own.

    Parameters
    ----------
    tables : by plain name, the name and the table of each sensor: time, x, y and z.

    Raises
    ------
    RecordingError
        If a table has no time and three axes, or no accelerometer has gravity in it.
    """
    streams = {name: _stream(table, stem, name) for name, (stem, table) in tables.items()}
    first = next(n for n in _ACCELEROMETERS if n in streams)
    if first in _MAY_LACK_GRAVITY and _GRAVITY in streams:
        whole = _with_gravity(streams[first], streams[_GRAVITY])
        if whole is not None:
            streams[first] = whole
    streams.pop(_GRAVITY, None)
    _refuse_free_of_gravity(tables[first][1].path, streams[first], first)
    chosen = [next(streams[n].name for n in names if n in streams) for names in (_ACCELEROMETERS, _GYROS)]
    chosen += [streams[n].name for n in _MAGNETOMETERS if n in streams][:1]
    return list(streams.values()), chosen


def _refuse_free_of_gravity(path: Path, stream: Stream, name: str) -> None:
    """Refuse an acceleration without gravity where nothing else is there."""
    if name in _MAY_LACK_GRAVITY and not stream.note and _is_free(stream):
        raise RecordingError(
            f"{path.name} has gravity taken out, which a calibration needs; record TotalAcceleration or "
            "AccelerometerUncalibrated, or Gravity beside it."
        )


def _is_free(stream: Stream) -> bool:
    """Whether gravity is not in the numbers, which are in m/s² where nothing says another unit."""
    force = stream.samples.specific_force
    assert force is not None
    factor = specific_force_factor(stream.units.get("a") or "m/s^2")
    return factor is not None and factor * float(np.median(np.linalg.norm(force, axis=1))) < _LEAST_NORM


def _stream(table: RawTable, stem: str, name: str) -> Stream:
    time, axes, unit = _layout(table)
    values = np.column_stack([table.columns[i] for i in axes])
    finite = np.isfinite(values).all(axis=1) & np.isfinite(time)
    keep = finite & np.concatenate([[True], np.diff(time) > 0.0])
    kind = "m" if name in _MAGNETOMETERS else "g" if name in _GYROS else "a"
    note = _PHONES_OWN if kind == "m" else ""
    note = _UNCALIBRATED if name.endswith("uncalibrated") else note
    known = find_unit(QUANTITY[kind], unit) if unit else {"g": "rad/s", "m": "uT"}.get(kind)
    triad = {QUANTITY[kind].replace(" ", "_"): values[keep]}
    return Stream(stem, Samples(time[keep], **triad), {kind: known}, note)


def _layout(table: RawTable) -> tuple[np.ndarray, list[int], str | None]:
    """Return the time in seconds, which columns are x, y and z, and the unit that stands at them."""
    axes: dict[str, int] = {}
    time: dict[str, tuple[int, str | None]] = {}
    unit = None
    for number, name in enumerate(table.names or ()):
        bare, _, rest = name.partition("(") if "(" in name else name.partition("[")
        words = re.findall(r"[a-z0-9]+", bare.lower())
        if words and words[-1] in ("x", "y", "z") and "absolute" not in words:
            axes.setdefault(words[-1], number)
            unit = rest.strip(" )]") or unit
        elif _plain(bare) in _TIMES:
            time.setdefault(_plain(bare), (number, find_unit("time", rest.strip(" )]"))))
    if len(axes) < 3 or not time:
        listed = ", ".join(repr(n) for n in (table.names or ())[:8]) or "none"
        raise RecordingError(f"{table.path.name} has no columns of time, x, y and z (it has {listed}).")
    named = min(time, key=_TIMES.index)
    number, said = time[named]
    column = table.columns[number]
    if named != "secondselapsed":
        column = seconds_of(column, said)
    return column, [axes[a] for a in "xyz"], unit


def _with_gravity(free: Stream, gravity: Stream) -> Stream | None:
    """Return the specific force where the phone's system has taken gravity out of it."""
    force, taken = free.samples.specific_force, gravity.samples.specific_force
    assert force is not None
    assert taken is not None
    if not _is_free(free):
        return None  # with gravity, as apps other than Sensor Logger have it
    time = gravity.samples.time
    parts = [np.interp(free.samples.time, time, taken[:, axis]) for axis in range(3)]
    whole: Vectors = force + np.column_stack(parts)
    return Stream(free.name, Samples(free.samples.time, whole), free.units, _FREE_OF_GRAVITY)


_EUROC = ("mav0/imu0/data.csv", "imu0/data.csv", "data.csv")
_NOT_RECORDINGS = {
    ".yaml", ".yml", ".json", ".md", ".pdf", ".png", ".jpg", ".jpeg", ".html", ".m", ".py", ".ini", ".xml",
}  # fmt: skip
_MOST_DEEP = 3


def source(path: Path) -> Source:
    """Return name and SHA-256 of what is read of a folder.

    Raises
    ------
    RecordingError
        If there is no recording in it, or several.
    OSError
        If a file cannot be read.
    """
    path = _descended(path)
    files = _files(path)
    if (euroc := _euroc(path)) is not None:
        return hash_file(euroc)
    if is_phone_log(files):
        return hash_files(path, sorted(find_sensors(files).values()))
    return hash_file(_only(path, files))


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read the recording that a folder holds.

    Parameters
    ----------
    path : the folder.
    topics : names of a phone's files without ending, one for each triad; or topics of the one recording in it.

    Raises
    ------
    RecordingError
        If there is no recording in it, or several.
    UsageError
        If a topic is not there.
    OSError
        If a file cannot be read.
    """
    path = _descended(path)
    files = _files(path)
    if (euroc := _euroc(path)) is not None:
        yield from text.read_tables(euroc)
    elif is_phone_log(files):
        sensors = find_sensors(files)
        tables = {n: (f.stem, joined_tables(list(text.read_tables(f)))) for n, f in sensors.items()}
        streams, chosen = streams_of_tables(tables)
        yield table_of_streams(path, streams, topics, chosen)
    else:
        yield from formats.read_table_blocks(_only(path, files), topics)


def _descended(path: Path) -> Path:
    """Go down while a folder holds nothing but one folder."""
    for _ in range(_MOST_DEEP):
        inside = [p for p in path.iterdir() if not p.name.startswith((".", "__"))]
        if len(inside) != 1 or not inside[0].is_dir():
            break
        path = inside[0]
    return path


def _files(path: Path) -> list[Path]:
    return sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))


def euroc_file(folder: Path) -> Path | None:
    """Return the file with an IMU's samples in an EuRoC folder, None in any other.

    Parameters
    ----------
    folder : of the data set, of `mav0`, or of the sensor.
    """
    path = _descended(folder)
    inside = Path(*path.parts[:-2]) if path.parts[-2:] == ("mav0", "imu0") else path
    return _euroc(path) or _euroc(inside)


def _euroc(path: Path) -> Path | None:
    for name in _EUROC:
        file = path / name
        if file.is_file() and (name != "data.csv" or (path / "sensor.yaml").is_file()):
            return file
    return None


def _only(path: Path, files: list[Path]) -> Path:
    """Return the one file of a folder that may be a recording."""
    found = [f for f in files if f.suffix.lower() not in _NOT_RECORDINGS]
    if len(found) == 1:
        return found[0]
    if not found:
        raise RecordingError(f"{path} is a folder without a recording in it; name the recording's file.")
    listed = ", ".join(f.name for f in found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")
    raise RecordingError(
        f"{path} is a folder with several files ({listed}); name the recording's file in it."
    )
