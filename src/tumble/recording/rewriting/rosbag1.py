"""ROS 1 bags written anew: chunk by chunk, with an index of their own.

Chunks keep their compression, their records and the order of these; connections keep their definitions. A
topic that was corrected says so by a field ``corrected_by`` of its connection.

References
----------
ROS wiki, *Bags/Format/2.0*.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.bags.rosbag1 import (
    BAG_HEADER,
    CHUNK_INFO,
    INDEX,
    MAGIC,
    MESSAGE,
    U32,
    U64,
    RosbagFile,
    header_fields,
)
from tumble.recording.rewriting.exchange import Exchange

FIELD = b"corrected_by"
_HEADER_SIZE = 4096  # bytes of the first record, filled up with blanks so that it can be written at the end
_Places = dict[int, list[tuple[bytes, int]]]


def corrections(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the calibrations that topics were corrected by.

    Parameters
    ----------
    path : of a bag.

    Raises
    ------
    RecordingError
        If it is none.
    OSError
        If it cannot be read.
    """
    found: dict[str, tuple[str, ...]] = {}
    for header, data in RosbagFile(path).connections.values():
        said = header_fields(data).get(FIELD)
        if said:
            found[header[b"topic"].decode("utf-8", "replace")] = tuple(
                said.decode("ascii", "replace").split()
            )
    return found


def rewrite(path: Path, target: Path, exchange: Exchange) -> None:
    """Write a bag anew with messages exchanged.

    Parameters
    ----------
    path, target : of the bag, and of the file to be written.
    exchange : what takes the place of what.

    Raises
    ------
    RecordingError
        If the bag cannot be copied.
    UsageError
        If a library is missing.
    OSError
        If a file cannot be read or written.
    """
    bag = RosbagFile(path)
    numbers = bag.numbers_of(exchange.marks)
    with opened(path) as file, target.open("wb") as made:
        made.write(MAGIC + _first_record(0, 0, 0))
        chunks: list[tuple[int, _Places]] = []
        for position, _ in bag.chunks:
            try:
                header, packed = bag.packed_at(file, position)
                body = bag.body(header, packed)
            except RecordingError:
                continue  # which the reader has counted, and says
            whole, places, changed = _exchanged(bag, body, numbers, exchange)
            if changed or len(whole) < len(body):
                packed = _packed(header.get(b"compression", b"none"), whole)
            chunks.append((made.tell(), places))
            _write(made, header | {b"size": U32.pack(len(whole))}, packed)
            _write_places(made, places)
        index = made.tell()
        for header, data in bag.connections.values():
            _write(made, header, _marked(header, data, exchange))
        for position, places in chunks:
            _write_chunk_info(made, position, places)
        made.seek(len(MAGIC))
        made.write(_first_record(index, len(bag.connections), len(chunks)))


def _exchanged(
    bag: RosbagFile, body: bytes, numbers: dict[int, str], exchange: Exchange
) -> tuple[bytes, _Places, bool]:
    """Return a chunk's records as far as they are sound, where its messages are, and whether any was exchanged."""
    made = bytearray(body)
    places: _Places = {}
    begin, changed = 0, False
    for header, start, stop in _sound_records(bag, body):
        if header[b"op"][0] == MESSAGE:
            number = int(U32.unpack(header[b"conn"])[0])
            places.setdefault(number, []).append((header[b"time"], begin))
            if number in numbers:
                made[start:stop] = exchange.of(numbers[number], body[start:stop])
                changed = True
        begin = stop
    return bytes(made[:begin]), places, changed


def _sound_records(bag: RosbagFile, body: bytes) -> Iterator[tuple[dict[bytes, bytes], int, int]]:
    """Yield a chunk's records up to the first damaged one, as the reader takes them."""
    records = bag.records(body)
    while True:
        try:
            record = next(records, None)
            if record is None:
                return
            if record[0][b"op"][0] == MESSAGE:
                U32.unpack(record[0][b"conn"])
                struct.unpack("<II", record[0][b"time"])
        except (RecordingError, KeyError, IndexError, struct.error):
            return
        yield record


def _packed(compression: bytes, body: bytes) -> bytes:
    if compression == b"bz2":
        return bz2.compress(body)
    if compression == b"lz4":
        library: Any = import_module("lz4.frame")
        packed: bytes = library.compress(body)
        return packed
    return body


def _record(fields: dict[bytes, bytes]) -> bytes:
    inside = b"".join(U32.pack(len(n) + 1 + len(v)) + n + b"=" + v for n, v in fields.items())
    return U32.pack(len(inside)) + inside


def _write(made: BinaryIO, fields: dict[bytes, bytes], data: bytes) -> None:
    made.write(_record(fields) + U32.pack(len(data)))
    made.write(data)


def _first_record(index: int, connections: int, chunks: int) -> bytes:
    head = _record(
        {
            b"op": bytes([BAG_HEADER]),
            b"index_pos": U64.pack(index),
            b"conn_count": U32.pack(connections),
            b"chunk_count": U32.pack(chunks),
        }
    )
    blanks = _HEADER_SIZE - len(head) - 4
    return head + U32.pack(blanks) + b" " * blanks


def _write_places(made: BinaryIO, places: _Places) -> None:
    """Write the index of a chunk, a record each connection."""
    for number, entries in places.items():
        fields = {
            b"op": bytes([INDEX]),
            b"ver": U32.pack(1),
            b"conn": U32.pack(number),
            b"count": U32.pack(len(entries)),
        }
        _write(made, fields, b"".join(time + U32.pack(at) for time, at in entries))


def _write_chunk_info(made: BinaryIO, position: int, places: _Places) -> None:
    times = [time for entries in places.values() for time, _ in entries] or [bytes(8)]
    first, last = (pick(times, key=lambda t: struct.unpack("<II", t)) for pick in (min, max))
    fields = {
        b"op": bytes([CHUNK_INFO]),
        b"ver": U32.pack(1),
        b"chunk_pos": U64.pack(position),
        b"start_time": first,
        b"end_time": last,
        b"count": U32.pack(len(places)),
    }
    _write(made, fields, b"".join(U32.pack(n) + U32.pack(len(e)) for n, e in places.items()))


def _marked(header: dict[bytes, bytes], data: bytes, exchange: Exchange) -> bytes:
    """Return what a connection says of itself, with what its topic was corrected by."""
    marks = exchange.marks.get(header[b"topic"].decode("utf-8", "replace"))
    if not marks:
        return data
    return _record(header_fields(data) | {FIELD: " ".join(marks).encode()})[4:]
