"""DataFlash, ArduPilot's log on its card: messages that the file itself describes, read from a memory map.

References
----------
ArduPilot developer documentation, *Logging* (FMT messages and format characters) and *Onboard Message Log
Messages* (IMU, ACC, GYR, IMT, MAG).
"""

from __future__ import annotations

import mmap
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError
from tumble.recording.formats.logs.own_parameters import ArduPilot, OwnParameters
from tumble.recording.formats.streams import Stream, automatic, of_increments, table_of_streams
from tumble.recording.formats.table import RawTable, mapped
from tumble.recording.samples import Remark, Samples
from tumble.records import dataclass

_MAGIC = b"\xa3\x95"
_FMT, _FMT_LENGTH = 128, 89
# Format characters and their types. None of the characters whose numbers are multiplied is used by these messages.
_TYPES = {
    "a": "(32,)<i2", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8",
    "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "M": "u1",
    "q": "<i8", "Q": "<u8", "g": "<f2",
}  # fmt: skip
_READ = ("ACC", "GYR", "IMU", "IMT", "MAG")
_PARAMETERS = "PARM"
_BATCH = 200_000

_Rows = npt.NDArray[Any]


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a DataFlash log.

    Parameters
    ----------
    path : the file.
    topics : one message, or one of each triad, as ``IMU:1`` or ``ACC:0``.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no inertial message.
    UsageError
        If a message is not there.
    OSError
        If the file cannot be read.
    """
    data = mapped(path)
    log = _Log.of(data)
    names = [name for kind in _READ for name in sorted(log.offsets) if name.startswith(kind)]
    streams = _with_parameters(log, data, [s for name in names for s in _streams(log, data, name)])
    if not streams:
        there = ", ".join(sorted(log.names)[:12])
        raise RecordingError(
            f"{path.name} holds no message IMU, ACC, GYR or IMT; set LOG_BITMASK so that the IMU is logged. "
            f"It describes {there or 'no message at all'}{' and more' if len(log.names) > 12 else ''}."
        )
    remarks: list[Remark] = []
    if log.skipped:
        text = f"{path.name}: {log.skipped} bytes that are no message of the log are left out."
        remarks.append(Remark("mended", text))
    if log.cut:
        remarks.append(Remark("mended", f"{path.name}: the last message is cut short and is left out."))
    yield table_of_streams(path, streams, topics, automatic(streams, [("ACC", "GYR")]), remarks)


@dataclass
class _Log:
    """The messages of a log: their descriptions, and where those that are read begin.

    Attributes
    ----------
    names : of all messages that are described.
    layouts : type of numpy of each that is read.
    offsets : where the messages of each begin.
    skipped : bytes between messages.
    cut : whether the last message is cut short.
    """

    names: set[str] = field(default_factory=set[str])
    layouts: dict[str, np.dtype[Any]] = field(default_factory=dict[str, np.dtype[Any]])
    offsets: dict[str, array[int]] = field(default_factory=dict[str, "array[int]"])
    skipped: int = 0
    cut: bool = False

    @classmethod
    def of(cls, data: mmap.mmap) -> _Log:
        """Walk over a log from message to message."""
        log = cls()
        lengths = [0] * 256
        lengths[_FMT] = _FMT_LENGTH
        wanted: list[array[int] | None] = [None] * 256
        position, stop = 0, len(data)
        while position + 3 <= stop:
            length = lengths[data[position + 2]] if data[position : position + 2] == _MAGIC else 0
            if not length:
                found = data.find(_MAGIC, position + 1)
                position, before = (found if found >= 0 else stop), position
                log.skipped += position - before
                continue
            if position + length > stop:
                log.cut = True
                break
            kind = data[position + 2]
            if (offsets := wanted[kind]) is not None:
                offsets.append(position)
            elif kind == _FMT:
                log._describe(data[position : position + length], lengths, wanted)
            position += length
        return log

    def _describe(self, message: bytes, lengths: list[int], wanted: list[array[int] | None]) -> None:
        kind, length = message[3], message[4]
        name, form, labels = (
            message[a:b].split(b"\0")[0].decode("ascii", "replace") for a, b in ((5, 9), (9, 25), (25, 89))
        )
        lengths[kind] = length
        self.names.add(name)
        read = name == _PARAMETERS or (name[:3] in _READ and name[3:] in ("", "1", "2", "3"))
        if not read or any(c not in _TYPES for c in form):
            return
        columns = labels.split(",")
        if len(columns) != len(form):
            return
        layout = np.dtype([(c, _TYPES[f]) for c, f in zip(columns, form, strict=True)])
        if layout.itemsize + 3 == length:
            self.layouts[name] = layout
            wanted[kind] = self.offsets[name] = array("Q")

    def rows(self, data: mmap.mmap, name: str) -> _Rows:
        """Return all messages of a name as one structured array."""
        offsets, layout = np.frombuffer(self.offsets[name], np.uint64).astype(np.intp), self.layouts[name]
        rows = np.empty(offsets.size, layout)
        octets = np.frombuffer(data, np.uint8)
        inside = np.arange(3, 3 + layout.itemsize)
        for start in range(0, offsets.size, _BATCH):
            some = offsets[start : start + _BATCH]
            rows[start : start + _BATCH] = octets[some[:, None] + inside].view(layout)[:, 0]
        return rows


def _streams(log: _Log, data: mmap.mmap, name: str) -> Iterator[Stream]:
    """Yield the streams of a message, one for each instance; old logs number the messages instead."""
    rows = log.rows(data, name)
    labels = log.layouts[name].names or ()
    if not rows.size:
        return
    if "I" in labels:
        for instance in np.unique(rows["I"]):
            yield from _stream(f"{name}:{instance}", rows[rows["I"] == instance])
    else:
        yield from _stream(f"{name[:3]}:{int(name[3:] or 1) - 1}", rows)


def _stream(name: str, rows: _Rows) -> Iterator[Stream]:
    labels = rows.dtype.names or ()
    stamp = next((c for c in ("SampleUS", "TimeUS", "TimeMS") if c in labels and rows[c].any()), None)
    if stamp is None or rows.size < 2:
        return
    time = rows[stamp].astype(np.float64) / (1e3 if stamp == "TimeMS" else 1e6)
    celsius = rows["T"].astype(np.float64) if "T" in labels and rows["T"].any() else None
    if name.startswith("IMT"):
        yield from _increments(name, rows, time)
        return
    if name.startswith("MAG"):
        field, motors = _triad(rows, "Mag"), _triad(rows, "MO")
        if field is not None:
            # The motors' field is taken out last, after the compass's own parameters.
            samples = Samples(time, magnetic_field=field if motors is None else field - motors)
            yield Stream(name, samples, {"m": "mgauss"})
        return
    force, rate = _triad(rows, "Acc"), _triad(rows, "Gyr")
    if force is not None or rate is not None:
        yield Stream(name, Samples(time, force, rate, celsius))


def _increments(name: str, rows: _Rows, time: Series) -> Iterator[Stream]:
    force, rate = _triad(rows, "DelV"), _triad(rows, "DelA")
    if force is None or rate is None or not {"DelvT", "DelaT"} <= set(rows.dtype.names or ()):
        return
    yield of_increments(name, time, force, rate, [rows[c].astype(np.float64) for c in ("DelvT", "DelaT")])


def _with_parameters(log: _Log, data: mmap.mmap, streams: Sequence[Stream]) -> list[Stream]:
    """Return the streams with what the autopilot's parameters did to them; the first of each name is as it began."""
    first: dict[str, float] = {}
    changes: list[tuple[float, str, float]] = []
    rows = log.rows(data, _PARAMETERS) if _PARAMETERS in log.offsets else np.zeros(0, [("TimeUS", "<u8")])
    # Without these it is damaged, or of a firmware of long ago: its parameters count as not stated.
    for row in rows if {"TimeUS", "Name", "Value"} <= set(rows.dtype.names or ()) else ():
        name, value = row["Name"].decode("ascii", "replace"), float(row["Value"])
        if first.setdefault(name, value) != value or any(n == name for _, n, _ in changes):
            changes.append((float(row["TimeUS"]) / 1e6, name, value))
    warm = {s.name: (s.samples.time, s.samples.temperature) for s in streams}
    made: list[Stream] = []
    for stream in streams:
        instance = stream.name.partition(":")[2]
        time, celsius = warm.get(f"IMU:{instance}", (stream.samples.time, None))
        formula = ArduPilot(int(instance), None if celsius is None else (time, celsius))
        made.append(replace(stream, own=OwnParameters(first, changes, formula)))
    return made


def _triad(rows: _Rows, prefix: str) -> Vectors | None:
    if not {prefix + axis for axis in "XYZ"} <= set(rows.dtype.names or ()):
        return None
    return np.column_stack([rows[prefix + axis].astype(np.float64) for axis in "XYZ"])
