"""MAVLink telemetry logs: frames of versions 1 and 2 with the time of their arrival before each.

References
----------
MAVLink developer guide, *Packet Serialization* and *Common Message Set* (RAW_IMU, SCALED_IMU, SCALED_IMU2,
SCALED_IMU3, HIGHRES_IMU); the checksum is CRC-16/MCRF4XX.
"""

from __future__ import annotations

import mmap
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.errors import RecordingError
from tumble.recording.formats.logs.logged_streams import Stream, table_of_streams
from tumble.recording.formats.streams import Units
from tumble.recording.formats.table import RawTable, hash_file, mapped
from tumble.recording.recording import Remark
from tumble.recording.samples import Samples
from tumble.records import dataclass

NAME = "MAVLink log"
ENDINGS = (".tlog",)
ASKED = 1  # a MATLAB file of version 4 may begin as a stamp does
SUMMARY = "MAVLink .tlog: messages HIGHRES_IMU, RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3"
HAS_TOPICS = True

_VERSION_1, _VERSION_2 = 0xFE, 0xFD
_STAMP = 8  # bytes of the time before each frame
_EARLIEST, _LATEST = 631_152_000_000_000, 4_102_444_800_000_000  # µs from 1970 to 1990 and to 2100
_FEWEST_FRAMES = 3
_LATEST_ARRIVAL = (
    5.0  # s behind others that a message may arrive; more is a vehicle that was switched on again
)

_TRIADS = [(c + a, "<i2") for c in ("acc", "gyro") for a in "xyz"]
_SCALED = np.dtype([("time", "<u4"), *_TRIADS, ("mag", "(3,)<i2"), ("temperature", "<i2")])
_RAW = np.dtype([("time", "<u8"), *_TRIADS, ("mag", "(3,)<i2"), ("id", "u1"), ("temperature", "<i2")])
_HIGHRES = np.dtype(
    [
        ("time", "<u8"),
        *[(n, "<f4") for n, _ in _TRIADS],
        ("mag", "(3,)<f4"),
        ("more", "(3,)<f4"),
        ("temperature", "<f4"),
        ("updated", "<u2"),
        ("id", "u1"),
    ]
)


@dataclass(frozen=True, slots=True)
class _Message:
    """A message: its name, layout with extensions, checksum's seed, units, ticks a second and degrees a step."""

    name: str
    layout: np.dtype[Any]
    seed: int
    units: Units
    ticks: float
    degree: float
    note: str = ""


_MILLI = Units("mg", "mrad/s", "mgauss")
_UNSAID = "has units that MAVLink leaves to the vehicle (ArduPilot: --units mg,mrad/s,mgauss)"
_MESSAGES = {
    105: _Message("HIGHRES_IMU", _HIGHRES, 93, Units(magnetic_field="gauss"), 1e6, 1.0),
    26: _Message("SCALED_IMU", _SCALED, 170, _MILLI, 1e3, 0.01),
    27: _Message("RAW_IMU", _RAW, 144, Units(None, None, None), 1e6, 0.01, _UNSAID),
    116: _Message("SCALED_IMU2", _SCALED, 76, _MILLI, 1e3, 0.01),
    129: _Message("SCALED_IMU3", _SCALED, 46, _MILLI, 1e3, 0.01),
}


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a telemetry log: stamps and frames follow one another."""
    position, frames = 0, 0
    while position + _STAMP + 3 <= len(head) and frames < _FEWEST_FRAMES:
        stamp = int.from_bytes(head[position : position + _STAMP], "big")
        length = _frame_length(head, position + _STAMP)
        if not length or not (stamp < _LATEST and (stamp > _EARLIEST or frames)):
            return False
        position += _STAMP + length
        frames += 1
    return frames == _FEWEST_FRAMES


def _frame_length(data: bytes | mmap.mmap, position: int) -> int:
    """Return the length of the frame that begins there, 0 for none."""
    if data[position] == _VERSION_1:
        return 8 + data[position + 1]
    if data[position] == _VERSION_2:
        return 12 + data[position + 1] + (13 if data[position + 2] & 1 else 0)
    return 0


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read a telemetry log.

    Parameters
    ----------
    path : the file.
    topics : one message, as ``SCALED_IMU2``.

    Raises
    ------
    RecordingError
        If the file holds no inertial message.
    UsageError
        If a message is not there.
    OSError
        If the file cannot be read.
    """
    data = mapped(path)
    frames, skipped, known = _walk(data)
    wrong, late = 0, 0
    streams: list[Stream] = []
    systems = len({system for _, system in frames})
    for (kind, system), offsets in frames.items():
        rows, bad = _rows(data, offsets, _MESSAGES[kind])
        rows, moved = _in_order(rows, _MESSAGES[kind].ticks)
        wrong, late = wrong + bad, late + moved
        streams += _streams(rows, _MESSAGES[kind], f"@{system}" if systems > 1 else "")
    if not streams:
        raise RecordingError(
            f"{path.name} holds {known} MAVLink message(s) and none of {', '.join(m.name for m in _MESSAGES.values())} "
            "that is whole; have the vehicle send one of them."
        )
    remarks: list[Remark] = []
    if skipped or wrong:
        text = f"{path.name}: {skipped} bytes between frames and {wrong} messages with a wrong checksum are left out."
        remarks.append(Remark("mended", text))
    if late:
        text = (
            f"{path.name}: {late} message(s) that arrived late or twice are put in their place, or left out."
        )
        remarks.append(Remark("mended", text))
    return table_of_streams(path, streams, topics, [_automatic(streams)], hash_file(path), remarks)


def _automatic(streams: Sequence[Stream]) -> str:
    """Return the fastest stream, of nearly equal ones the first in the order of the messages."""
    order = [m.name for m in _MESSAGES.values()]
    fastest = max(s.rate for s in streams)
    useful = [s for s in streams if s.rate > 0.9 * fastest]
    return min(useful, key=lambda s: order.index(s.name.split("@")[0].split(":")[0])).name


def _walk(data: mmap.mmap) -> tuple[dict[tuple[int, int], array[int]], int, int]:
    """Return where the frames with inertial messages begin, the bytes between frames, and the number of frames."""
    frames: dict[tuple[int, int], array[int]] = {}
    position, stop, skipped, known = _STAMP, len(data), 0, 0
    while position + 8 <= stop:
        length = _frame_length(data, position)
        if not length or position + length > stop:
            position += 1
            skipped += 1
            continue
        if data[position] == _VERSION_1:
            kind, system = data[position + 5], data[position + 3]
        else:
            kind = int.from_bytes(data[position + 7 : position + 10], "little")
            system = data[position + 5]
        if kind in _MESSAGES:
            frames.setdefault((kind, system), array("Q")).append(position)
        known += 1
        position += length + _STAMP
    return frames, skipped, known


def _rows(data: mmap.mmap, offsets: array[int], message: _Message) -> tuple[npt.NDArray[Any], int]:
    """Return messages as a structured array, those with a wrong checksum left out, and their number."""
    size = message.layout.itemsize
    payloads = np.zeros((len(offsets), size), np.uint8)
    right = np.zeros(len(offsets), bool)
    heads = np.array([(data[o], data[o + 1]) for o in offsets])
    octets = np.frombuffer(data, np.uint8)
    starts = np.frombuffer(offsets, np.uint64).astype(np.intp)
    for version, length in {(int(v), int(n)) for v, n in heads}:
        same = np.flatnonzero((heads[:, 0] == version) & (heads[:, 1] == length))
        head = 6 if version == _VERSION_1 else 10
        frame = octets[starts[same][:, None] + np.arange(head + length + 2)]
        sums = frame[:, -2].astype(np.intp) + 256 * frame[:, -1].astype(np.intp)
        right[same] = _checksums(frame[:, 1:-2], message.seed) == sums
        used = min(length, size)  # version 2 leaves out zeros at the end
        payloads[same, :used] = frame[:, head : head + used]
    rows = payloads[right].view(message.layout)[:, 0]
    return rows, int(right.size - right.sum())


def _in_order(rows: npt.NDArray[Any], ticks: float) -> tuple[npt.NDArray[Any], int]:
    """Put messages that a radio delivered late or twice in order; a clock that begins anew is left as it is."""
    time = rows["time"].astype(np.float64) / ticks
    steps = np.diff(time)
    back = int(np.count_nonzero(steps <= 0.0))
    if not back or float(steps.min()) < -_LATEST_ARRIVAL:
        return rows, 0
    order = np.argsort(time, kind="stable")
    keep = np.concatenate([[True], np.diff(time[order]) > 0.0])
    return rows[order][keep], back


def _checksums(octets: npt.NDArray[np.uint8], seed: int) -> npt.NDArray[np.intp]:
    """Return the CRC-16/MCRF4XX of each row, followed by the message's seed."""
    table = np.arange(256)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ 0x8408, table >> 1)
    sums = np.full(octets.shape[0], 0xFFFF)
    for column in [*octets.T, np.full(octets.shape[0], seed)]:
        sums = (sums >> 8) ^ table[(sums ^ column) & 0xFF]
    return sums


def _streams(rows: npt.NDArray[Any], message: _Message, system: str) -> Iterator[Stream]:
    """Yield a stream for each sensor that a message is of."""
    numbers = rows["id"] if "id" in (message.layout.names or ()) else np.zeros(rows.size, np.uint8)
    instances = np.unique(numbers)
    for number in instances:
        some = rows[numbers == number]
        force, rate = (
            np.column_stack([some[c + a].astype(np.float64) for a in "xyz"]) for c in ("acc", "gyro")
        )
        celsius = (
            some["temperature"].astype(np.float64) * message.degree if some["temperature"].any() else None
        )
        time = some["time"].astype(np.float64) / message.ticks
        if some.size > 1:
            name = message.name + (f":{number}" if instances.size > 1 else "") + system
            field = some["mag"].astype(np.float64)
            samples = Samples(time, force, rate, celsius, field if field.any() else None)
            yield Stream(name, samples, message.units, message.note)
