"""MCAP files with ROS 1 or ROS 2 messages, chunk by chunk, without ROS; also unfinished ones.

References
----------
MCAP file format specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import field
from pathlib import Path
from typing import BinaryIO

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.bags.bag import Topic, bag_readers
from tumble.recording.formats.bags.ros_messages import plain_type
from tumble.recording.formats.compression import decompress_lz4, decompress_zstd, largest_chunk
from tumble.recording.formats.damage import CutShort, Damage, exactly
from tumble.recording.recording import Remark
from tumble.records import dataclass

NAME = "MCAP"
ENDINGS = (".mcap",)
SUMMARY = "MCAP with topics of sensor_msgs/Imu, also split ones (lz4 and zstd with the extra `ros`)"
HAS_TOPICS = True

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
CHUNK_INDEX, STATISTICS, DATA_END = 0x08, 0x0B, 0x0F
RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is MCAP."""
    return head.startswith(MAGIC)


def string_at(data: bytes, position: int) -> tuple[str, int]:
    """Return the text that begins at a place, and where it ends.

    Raises
    ------
    struct.error
        If there is none.
    """
    (size,) = struct.unpack_from("<I", data, position)
    end = position + 4 + size
    return data[position + 4 : end].decode("utf-8", "replace"), end


@dataclass(slots=True)
class McapFile:
    """An MCAP file: its channels and where its chunks are.

    Attributes
    ----------
    path : the file.
    topics : as found.
    """

    path: Path
    topics: list[Topic] = field(default_factory=list[Topic])
    _damage: Damage = field(default_factory=lambda: Damage(""))
    _unfinished: bool = False
    _schemas: dict[int, str] = field(default_factory=dict[int, str])
    _channels: dict[int, tuple[str, int, str]] = field(default_factory=dict[int, tuple[str, int, str]])
    _chunks: list[tuple[int, frozenset[int]]] = field(default_factory=list[tuple[int, frozenset[int]]])
    _counts: Counter[int] = field(default_factory=Counter[int])
    _span: tuple[int, int] = (0, 0)
    _end: int = 0

    @property
    def remarks(self) -> list[Remark]:
        """What was noticed, or left out, so far."""
        text = f"{self.path.name} is not finished or cut short; what is there is read."
        return [*([Remark("mended", text)] if self._unfinished else []), *self._damage.remarks()]

    def __post_init__(self) -> None:
        self._damage.name = self.path.name
        with opened(self.path) as file:
            try:
                if not self._has_summary(file):
                    self._scan(file)
            except (struct.error, IndexError) as error:
                raise RecordingError(f"{self.path.name} is a damaged MCAP file.") from error
        duration = 1e-9 * (self._span[1] - self._span[0])
        for number, (name, schema, encoding) in self._channels.items():
            count = self._counts[number]
            kind = plain_type(self._schemas.get(schema, "")) or encoding
            if encoding not in ("cdr", "ros1") and kind.startswith(("sensor_msgs/", "geometry_msgs/")):
                kind = f"{kind} as {encoding}"
            rate = (count - 1) / duration if duration > 0.0 and count > 1 else None
            self.topics.append(Topic(name, kind, count, cdr=encoding == "cdr", rate=rate))

    def _has_summary(self, file: BinaryIO) -> bool:
        try:
            return self._read_summary(file)
        except (struct.error, IndexError):
            # It only repeats what stands before it.
            return False

    def _read_summary(self, file: BinaryIO) -> bool:
        """Read channels and chunks from the summary; False if there is none that is whole."""
        file.seek(0, 2)
        size = file.tell()
        self._end = size
        if size < 45:
            return False
        file.seek(size - 37)
        footer = file.read(37)
        if footer[-8:] != MAGIC or footer[0] != FOOTER:
            return False
        (start,) = struct.unpack_from("<Q", footer, 9)
        if not 0 < start < size:
            return False
        file.seek(start)
        summary = file.read(size - 37 - start)
        (checksum,) = struct.unpack_from("<I", footer, 25)
        if checksum and zlib.crc32(footer[:25], zlib.crc32(summary)) != checksum:
            return False
        position, said = 0, False
        while position + 9 <= len(summary):
            code, length = RECORD.unpack_from(summary, position)
            record = summary[position + 9 : position + 9 + length]
            position += 9 + length
            self._take_summary(code, record)
            said = said or code == STATISTICS
        return bool(said and self._channels and self._chunks)

    def _take_summary(self, code: int, record: bytes) -> None:
        if code in (SCHEMA, CHANNEL):
            self._describe(code, record)
        elif code == STATISTICS:
            self._span = struct.unpack_from("<QQ", record, 26)
            self._counts = Counter(dict(struct.iter_unpack("<HQ", record[46:])))
        elif code == CHUNK_INDEX:
            (offset,) = struct.unpack_from("<Q", record, 16)
            (size,) = struct.unpack_from("<I", record, 32)
            channels = frozenset(c for c, _ in struct.iter_unpack("<HQ", record[36 : 36 + size]))
            self._chunks.append((offset, channels))

    def _describe(self, code: int, record: bytes) -> None:
        """Take in a schema or a channel."""
        if code == SCHEMA:
            (number,) = struct.unpack_from("<H", record)
            self._schemas[number] = string_at(record, 2)[0]
            return
        number, schema = struct.unpack_from("<HH", record)
        topic, end = string_at(record, 4)
        self._channels[number] = (topic, schema, string_at(record, end)[0])

    def _scan(self, file: BinaryIO) -> None:
        """Find channels and count messages where there is no summary."""
        self._schemas.clear()
        self._channels.clear()
        self._chunks.clear()
        self._counts = Counter()
        low, high = 2**64, 0
        for channel, time, _ in self._every_message(file, None):
            self._counts[channel] += 1
            low, high = min(low, time), max(high, time)
        self._span = (min(low, high), high)

    def _every_message(self, file: BinaryIO, wanted: set[int] | None) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of the whole file from its beginning; a file that is cut short ends early."""
        file.seek(len(MAGIC))
        try:
            while True:
                place = file.tell()
                code, length = RECORD.unpack(exactly(file, 9))
                if code in (FOOTER, DATA_END):
                    return
                if code == CHUNK:
                    yield from self._sound_messages(place, exactly(file, length), wanted)
                elif code in (SCHEMA, CHANNEL):
                    self._describe(code, exactly(file, length))
                elif code == MESSAGE:
                    record = exactly(file, length)
                    channel, _, time, _ = MESSAGE_HEAD.unpack_from(record)
                    if wanted is None or channel in wanted:
                        yield channel, time, record[22:]
                elif code == 0 or file.tell() + length > self._end:
                    raise CutShort
                else:
                    file.seek(length, 1)
        except CutShort:
            self._unfinished = True

    def _sound_messages(
        self, place: int, chunk: bytes, wanted: set[int] | None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of a chunk as far as it is sound; what is not is noted."""
        try:
            yield from self._chunk_messages(chunk, wanted)
        except (RecordingError, struct.error, IndexError) as error:
            self._damage.note(place, error)

    def _chunk_messages(self, chunk: bytes, wanted: set[int] | None) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, time and bytes of a chunk's messages."""
        body = self.body(chunk)
        position, stop = 0, len(body)
        unpack, head = RECORD.unpack_from, MESSAGE_HEAD.unpack_from
        while position + 9 <= stop:
            code, length = unpack(body, position)
            start = position + 9
            position = start + length
            if position > stop:
                raise RecordingError(f"{self.path.name}: a chunk is damaged.")
            if code == MESSAGE:
                channel, _, time, _ = head(body, start)
                if wanted is None or channel in wanted:
                    yield channel, time, body[start + 22 : position]
            elif code in (SCHEMA, CHANNEL):
                self._describe(code, body[start:position])

    def body(self, chunk: bytes) -> bytes:
        """Return the records of a chunk, decompressed and checked.

        Raises
        ------
        RecordingError
            If they are damaged, or compressed in an unknown way.
        UsageError
            If a library is missing.
        """
        size, checksum = struct.unpack_from("<QI", chunk, 16)
        compression, position = string_at(chunk, 28)
        data = chunk[position + 8 :]
        name = self.path.name
        if compression and size > largest_chunk(data):
            raise RecordingError(f"{name}: a chunk unpacks to {size >> 20} MB, which no recorder writes.")
        if compression == "zstd":
            data = decompress_zstd(data, name, size)
        elif compression == "lz4":
            try:
                data = decompress_lz4(data, name, size)
            except RuntimeError as error:
                raise RecordingError(f"{name}: a chunk is damaged ({error}).") from error
        elif compression:
            raise RecordingError(
                f"{name}: a chunk is compressed as {compression[:16]!r}, which is not known; known are lz4 and zstd."
            )
        if len(data) != size or (checksum and zlib.crc32(data) != checksum):
            raise RecordingError(f"{name}: a chunk is damaged: its content does not agree with its checksum.")
        return data

    def numbers_of(self, names: Iterable[str]) -> dict[int, str]:
        """Return the channels of some topics, by number."""
        wanted = set(names)
        return {n: topic for n, (topic, _, _) in self._channels.items() if topic in wanted}

    def messages_in_order(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield what `messages` does, as it stands in the file, whatever the index says."""
        topics = self.numbers_of(names)
        with opened(self.path) as file:
            for channel, time, data in self._every_message(file, set(topics)):
                yield topics[channel], time, data

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        topics = self.numbers_of(names)
        wanted = set(topics)
        self._damage.total = len(self._chunks) or None
        with opened(self.path) as file:
            if not self._chunks:
                yield from ((topics[c], time, data) for c, time, data in self._every_message(file, wanted))
                return
            for offset, channels in sorted(self._chunks):
                if channels and not channels & wanted:
                    continue
                try:
                    chunk = self._chunk_at(file, offset)
                except RecordingError as error:
                    self._damage.note(offset, error)
                    continue
                for channel, time, data in self._sound_messages(offset, chunk, wanted):
                    yield topics[channel], time, data

    def _chunk_at(self, file: BinaryIO, offset: int) -> bytes:
        try:
            if offset < self._end:
                file.seek(offset)
                code, length = RECORD.unpack(exactly(file, 9))
                if code == CHUNK and offset + length <= self._end:
                    return exactly(file, length)
        except CutShort:
            pass
        raise RecordingError(f"{self.path.name} is a damaged MCAP file: its index leads nowhere.")


read_table, read_table_blocks = bag_readers(lambda path: nullcontext(McapFile(path)))
