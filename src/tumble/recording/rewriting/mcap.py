"""MCAP files written anew: record by record, with a summary of their own.

Messages keep their length, so that the indexes of messages inside chunks stay right; schemas, channels,
attachments and metadata are copied. What was corrected by which calibration stands in a record of metadata.

References
----------
MCAP file format specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import field
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.bags.mcap import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    RECORD,
    SCHEMA,
    STATISTICS,
    McapFile,
    string_at,
)
from tumble.recording.formats.damage import CutShort, exactly
from tumble.recording.rewriting.exchange import Exchange
from tumble.records import dataclass

_HEADER, _MESSAGE_INDEX, _ATTACHMENT, _ATTACHMENT_INDEX = 0x01, 0x07, 0x09, 0x0A
_METADATA, _METADATA_INDEX, _SUMMARY_OFFSET = 0x0C, 0x0D, 0x0E
_NAME = "tumble"
_KEY = "corrected_by "
_FEW = 1 << 20  # bytes of a record of metadata that is looked into


def corrections(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the calibrations that topics were corrected by.

    Parameters
    ----------
    path : of an MCAP file.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    found: dict[str, tuple[str, ...]] = {}
    with opened(path) as file:
        file.seek(len(MAGIC))
        try:
            # They stand at the beginning of the file, before any data.
            while (head := RECORD.unpack(exactly(file, 9)))[0] in (_HEADER, _METADATA) and head[1] < _FEW:
                record = exactly(file, head[1])
                if head[0] == _METADATA:
                    found |= _told(record)
        except (CutShort, struct.error, IndexError):
            return found
    return found


def _told(record: bytes) -> dict[str, tuple[str, ...]]:
    name, at = string_at(record, 0)
    if name != _NAME:
        return {}
    stop = at + 4 + struct.unpack_from("<I", record, at)[0]
    at += 4
    told: dict[str, tuple[str, ...]] = {}
    while at < stop:
        key, at = string_at(record, at)
        value, at = string_at(record, at)
        if key.startswith(_KEY):
            told[key.removeprefix(_KEY)] = tuple(value.split())
    return told


def rewrite(path: Path, target: Path, exchange: Exchange) -> None:
    """Write an MCAP file anew with messages exchanged.

    Parameters
    ----------
    path, target : of the file, and of the one to be written.
    exchange : what takes the place of what.

    Raises
    ------
    RecordingError
        If the file cannot be copied.
    UsageError
        If a library is missing.
    OSError
        If a file cannot be read or written.
    """
    source = McapFile(path)
    before = corrections(path)
    with opened(path) as file, target.open("wb") as made:
        copy = _Copy(source, made, exchange, source.numbers_of(exchange.marks))
        made.write(MAGIC)
        file.seek(len(MAGIC))
        try:
            while True:
                code, length = RECORD.unpack(exactly(file, 9))
                if code in (FOOTER, DATA_END):
                    break
                if code == 0 or file.tell() + length > path.stat().st_size:
                    raise CutShort
                copy.take(code, exactly(file, length))
                if code == _HEADER:
                    copy.take(_METADATA, _metadata(before | dict(exchange.marks)))
        except CutShort:
            pass  # which the reader says
        copy.close()


def _text(words: str) -> bytes:
    octets = words.encode()
    return struct.pack("<I", len(octets)) + octets


def _metadata(marks: dict[str, Any]) -> bytes:
    inside = b"".join(_text(_KEY + topic) + _text(" ".join(ids)) for topic, ids in marks.items())
    return _text(_NAME) + struct.pack("<I", len(inside)) + inside


@dataclass(slots=True)
class _Chunk:
    """What the index says of a chunk."""

    start: int
    length: int
    first: int
    last: int
    packed: bytes  # compression, and both sizes
    places: dict[int, int] = field(default_factory=dict[int, int])
    places_length: int = 0

    def record(self) -> bytes:
        offsets = b"".join(struct.pack("<HQ", n, at) for n, at in self.places.items())
        head = struct.pack("<QQQQI", self.first, self.last, self.start, self.length, len(offsets))
        return head + offsets + struct.pack("<Q", self.places_length) + self.packed


@dataclass(slots=True)
class _Copy:
    """A file in the making, and what its summary will say."""

    source: McapFile
    made: BinaryIO
    exchange: Exchange
    numbers: dict[int, str]
    counts: Counter[int] = field(default_factory=Counter[int])
    first: int = 2**64 - 1
    last: int = 0
    schemas: dict[int, bytes] = field(default_factory=dict[int, bytes])
    channels: dict[int, bytes] = field(default_factory=dict[int, bytes])
    chunks: list[_Chunk] = field(default_factory=list[_Chunk])
    attachments: list[bytes] = field(default_factory=list[bytes])
    metadata: list[bytes] = field(default_factory=list[bytes])

    def take(self, code: int, record: bytes) -> None:
        """Write the next record of the data section, with its messages exchanged."""
        if code == CHUNK:
            self._take_chunk(record)
        elif code == _MESSAGE_INDEX:
            return  # made anew with its chunk
        elif code == MESSAGE:
            changed = bytearray(record)
            self._exchange(changed, 0, len(record))
            self._write(code, bytes(changed))
        elif code == _METADATA and string_at(record, 0)[0] == _NAME and self.metadata:
            return  # that of an earlier correction, which the new one repeats
        else:
            self._describe(code, record)
            self._note(code, record)
            self._write(code, record)

    def _write(self, code: int, record: bytes) -> None:
        self.made.write(RECORD.pack(code, len(record)))
        self.made.write(record)

    def _describe(self, code: int, record: bytes) -> None:
        if code in (SCHEMA, CHANNEL):
            (number,) = struct.unpack_from("<H", record)
            (self.schemas if code == SCHEMA else self.channels)[number] = record

    def _note(self, code: int, record: bytes) -> None:
        place = struct.pack("<QQ", self.made.tell(), 9 + len(record))
        if code == _METADATA:
            self.metadata.append(place + _text(string_at(record, 0)[0]))
        elif code == _ATTACHMENT:
            times = record[:16]
            name, at = string_at(record, 16)
            media, at = string_at(record, at)
            self.attachments.append(place + times + record[at : at + 8] + _text(name) + _text(media))

    def _exchange(self, body: bytearray, start: int, stop: int) -> tuple[int, int, bool]:
        """Exchange the message that begins at a place; return its channel, its time, and whether it was."""
        channel, _, time, _ = MESSAGE_HEAD.unpack_from(body, start)
        self.counts[channel] += 1
        self.first, self.last = min(self.first, time), max(self.last, time)
        topic = self.numbers.get(channel)
        if topic is not None:
            body[start + 22 : stop] = self.exchange.of(topic, bytes(body[start + 22 : stop]))
        return channel, time, topic is not None

    def _take_chunk(self, chunk: bytes) -> None:
        """Write a chunk and the indexes of its messages."""
        try:
            body = bytearray(self.source.body(chunk))
        except (RecordingError, struct.error, IndexError):
            return  # which the reader has counted, and says
        entries: dict[int, list[tuple[int, int]]] = {}
        at, changed = 0, False
        while at + 9 <= len(body):
            code, length = RECORD.unpack_from(body, at)
            start, stop = at + 9, at + 9 + length
            if stop > len(body):
                break
            if code == MESSAGE:
                if length < MESSAGE_HEAD.size:
                    break
                channel, time, exchanged = self._exchange(body, start, stop)
                entries.setdefault(channel, []).append((time, at))
                changed = changed or exchanged
            else:
                self._describe(code, bytes(body[start:stop]))
            at = stop
        self._write_chunk(chunk, bytes(body[:at]), entries, changed or at < len(body))

    def _write_chunk(
        self, chunk: bytes, body: bytes, entries: dict[int, list[tuple[int, int]]], changed: bool
    ) -> None:
        compression, at = string_at(chunk, 28)
        (checksum,) = struct.unpack_from("<I", chunk, 24)
        data = chunk[at + 8 :]
        if changed:
            data = _packed(compression, body)
            checksum = zlib.crc32(body) if checksum else 0
        times = [time for pairs in entries.values() for time, _ in pairs] or [0]
        first, last = min(times), max(times)
        head = struct.pack("<QQQI", first, last, len(body), checksum)
        noted = _Chunk(self.made.tell(), 0, first, last, _text(compression))
        noted.packed += struct.pack("<QQ", len(data), len(body))
        self._write(CHUNK, head + _text(compression) + struct.pack("<Q", len(data)) + data)
        begin = self.made.tell()
        noted.length = begin - noted.start
        for channel, pairs in entries.items():
            noted.places[channel] = self.made.tell()
            inside = b"".join(struct.pack("<QQ", *pair) for pair in pairs)
            self._write(_MESSAGE_INDEX, struct.pack("<HI", channel, len(inside)) + inside)
        noted.places_length = self.made.tell() - begin
        self.chunks.append(noted)

    def close(self) -> None:
        """Write the end of the data section, the summary and the footer."""
        self._write(DATA_END, bytes(4))
        start = self.made.tell()
        groups = (
            (SCHEMA, list(self.schemas.values())),
            (CHANNEL, list(self.channels.values())),
            (STATISTICS, [self._statistics()]),
            (CHUNK_INDEX, [c.record() for c in self.chunks]),
            (_ATTACHMENT_INDEX, self.attachments),
            (_METADATA_INDEX, self.metadata),
        )
        summary, offsets = bytearray(), bytearray()
        for code, records in groups:
            begin = len(summary)
            for record in records:
                summary += RECORD.pack(code, len(record)) + record
            if records:
                place = struct.pack("<BQQ", code, start + begin, len(summary) - begin)
                offsets += RECORD.pack(_SUMMARY_OFFSET, len(place)) + place
        foot = RECORD.pack(FOOTER, 20) + struct.pack("<QQ", start, start + len(summary))
        checksum = zlib.crc32(bytes(summary + offsets) + foot)
        self.made.write(bytes(summary + offsets) + foot + struct.pack("<I", checksum) + MAGIC)

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", n, count) for n, count in self.counts.items())
        total = sum(self.counts.values())
        sizes = struct.pack(
            "<QHIIII",
            total,
            len(self.schemas),
            len(self.channels),
            len(self.attachments),
            len(self.metadata),
            len(self.chunks),
        )
        span = struct.pack("<QQ", self.first if total else 0, self.last)
        return sizes + span + struct.pack("<I", len(counts)) + counts


def _packed(compression: str, body: bytes) -> bytes:
    if compression == "zstd":
        library: Any = import_module("zstandard")
        body = library.ZstdCompressor().compress(body)
    if compression == "lz4":
        library = import_module("lz4.frame")
        body = library.compress(body)
    return body
