"""MCAP files with ROS 1 or ROS 2 messages, read by the library mcap; also unfinished ones.

The library reads a file's records one after another, which a file that is cut short allows, too; the summary at the
end is for the list of topics alone.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from tumble.errors import RecordingError
from tumble.files import opened, size_of
from tumble.recording.formats.bags.bag import Topic, bag_reader, plain_type
from tumble.recording.formats.packed import needed
from tumble.recording.samples import Remark
from tumble.records import dataclass

MAGIC = b"\x89MCAP0\r\n"
_FOOTER_SIZE = 37  # bytes, of the footer and the magic after it
_MESSAGE = 0x05
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


def library(part: str, path: Path) -> Any:
    """Return a module of the library that reads and writes a file.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    return needed(f"mcap.{part}", f"{path.name} is an MCAP file")


@dataclass(slots=True)
class _Whole:
    """An open file whose reads are as long as was asked for, or end the reading."""

    file: BinaryIO
    size: int

    def read(self, length: int) -> bytes:
        if self.file.tell() + length > self.size:
            raise EOFError
        return self.file.read(length)


@dataclass(slots=True)
class McapFile:
    """An MCAP file and its topics; the compression is that of the chunks that were read so far."""

    path: Path
    topics: list[Topic] = field(default_factory=list[Topic])
    _damaged: dict[int, str] = field(default_factory=dict[int, str])
    _chunks: int | None = None
    compression: str = ""
    _unfinished: bool = False
    _named: dict[int, str] = field(default_factory=dict[int, str])

    @property
    def remarks(self) -> list[Remark]:
        """What was noticed, or left out, so far."""
        text = f"{self.path.name} is not finished or cut short; what is there is read."
        said = [Remark("mended", text)] if self._unfinished else []
        if self._damaged:
            of = "" if self._chunks is None else f" of {self._chunks}"
            verb = "are" if len(self._damaged) > 1 else "is"
            first = self._damaged[min(self._damaged)].rstrip(".")
            text = f"{len(self._damaged)}{of} chunk(s) {verb} damaged ({first}); what could be read is used."
            said.append(Remark("mended", f"{self.path.name}: {text}"))
        return said

    def _note(self, chunk: int, error: Exception) -> None:
        self._damaged.setdefault(chunk, str(error) or type(error).__name__)

    def __post_init__(self) -> None:
        made = library("records", self.path)
        schemas: dict[int, str] = {}
        channels: dict[int, Any] = {}
        counts: Counter[int] = Counter()
        low, high = 2**64, 0
        for record in self._summary() or self.records():
            if isinstance(record, made.Schema):
                schemas[record.id] = plain_type(record.name)
            elif isinstance(record, made.Channel):
                channels[record.id] = record
            elif isinstance(record, made.Message):
                counts[record.channel_id] += 1
                low, high = min(low, record.log_time), max(high, record.log_time)
            elif isinstance(record, made.Statistics):
                counts.update(record.channel_message_counts)
                low, high = record.message_start_time, record.message_end_time
                self._chunks = record.chunk_count or None
        for number, channel in channels.items():
            encoding, count = channel.message_encoding, counts[number]
            kind = schemas.get(channel.schema_id) or encoding
            if encoding not in ("cdr", "ros1") and kind.startswith(("sensor_msgs/", "geometry_msgs/")):
                kind = f"{kind} as {encoding}"
            rate = (count - 1) / (1e-9 * (high - low)) if high > low and count > 1 else None
            self._named[number] = channel.topic
            self.topics.append(Topic(channel.topic, kind, count, cdr=encoding == "cdr", rate=rate))

    def _summary(self) -> list[Any]:
        """Return the records of the summary; none where it is missing or damaged, for it only repeats the others."""
        made = library("records", self.path)
        try:
            with opened(self.path) as file:
                end = file.seek(-_FOOTER_SIZE, 2)
                start, _, checksum = struct.unpack_from("<QQI", file.read(_FOOTER_SIZE), 9)
                if not 0 < start < end:
                    return []
                file.seek(start)
                content = file.read()
            if checksum and zlib.crc32(content[: -4 - len(MAGIC)]) != checksum:
                return []
            reader = library("stream_reader", self.path).StreamReader
            records: list[Any] = list(reader(BytesIO(content), skip_magic=True).records)
        except Exception:  # noqa: BLE001 - whatever the library makes of damaged bytes
            return []
        wanted = made.Statistics, made.Channel
        return records if all(any(isinstance(r, kind) for r in records) for kind in wanted) else []

    def pieces(self) -> Iterator[tuple[int, Any]]:
        """Yield number and content of the records of the data section, chunks unpacked; a cut file ends early.

        Raises
        ------
        UsageError
            If a library is missing.
        """
        made = library("records", self.path)
        size = size_of(self.path)
        with opened(self.path) as file:
            whole: Any = _Whole(file, size)
            stream = library("stream_reader", self.path).StreamReader(
                whole, emit_chunks=True, record_size_limit=size
            )
            records = iter(stream.records)
            unpack = library("stream_reader", self.path).get_chunk_data_stream
            for number in range(size):
                try:
                    record = next(records)
                    if isinstance(record, made.DataEnd | made.Footer):
                        return
                except OSError:
                    raise
                except Exception:  # noqa: BLE001 - whatever the library makes of damaged bytes
                    self._unfinished = True
                    return
                if isinstance(record, made.Chunk):
                    content = _unpacked(record, unpack)
                    if content is None:
                        words = "a chunk is damaged: its content is not what it says"
                        self._note(number, RecordingError(words))
                        continue
                    self.compression = record.compression
                    record = replace(record, compression="", data=content)
                yield number, record

    def records(self) -> Iterator[Any]:
        """Yield the library's records of the data section, those in chunks, too."""
        chunk = library("records", self.path).Chunk
        breakup = library("stream_reader", self.path).breakup_chunk
        for number, piece in self.pieces():
            if not isinstance(piece, chunk):
                yield piece
                continue
            try:
                inside = breakup(piece)
            except Exception as error:  # noqa: BLE001 - as above
                self._note(number, error)
                continue
            yield from inside

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics, as they stand in the file."""
        wanted = set(names)
        topics = {n: topic for n, topic in self._named.items() if topic in wanted}
        made = library("records", self.path)
        for number, piece in self.pieces():
            if isinstance(piece, made.Message) and piece.channel_id in topics:
                yield topics[piece.channel_id], piece.log_time, piece.data
            elif isinstance(piece, made.Chunk):
                try:
                    yield from _messages_in(piece.data, topics)
                except struct.error as error:
                    self._note(number, error)


def _unpacked(chunk: Any, unpack: Callable[..., tuple[Any, int]]) -> bytes | None:
    """Return the records of a chunk, unpacked and checked by the library; None of a damaged one."""
    try:
        content, size = unpack(chunk, validate_crc=True)
    except Exception:  # noqa: BLE001 - whatever the library makes of damaged bytes
        return None
    data: bytes = content.read(size)
    return data if size == chunk.uncompressed_size else None


def _messages_in(body: bytes, topics: dict[int, str]) -> Iterator[tuple[str, int, bytes]]:
    """Yield topic, time and bytes of a chunk's messages: the library's own loop takes five times as long."""
    position, stop = 0, len(body)
    unpack, head = _RECORD.unpack_from, _MESSAGE_HEAD.unpack_from
    while position + _RECORD.size <= stop:
        code, length = unpack(body, position)
        start = position + _RECORD.size
        position = start + length
        if position > stop:
            raise struct.error("a chunk is damaged")
        if code == _MESSAGE:
            channel, _, time, _ = head(body, start)
            if channel in topics:
                yield topics[channel], time, body[start + _MESSAGE_HEAD.size : position]


read_tables = bag_reader(lambda path: nullcontext(McapFile(path)))
