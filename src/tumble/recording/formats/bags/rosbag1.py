"""ROS 1 bags (version 2.0), chunk by chunk, without ROS; also bags without an index or cut short.

References
----------
ROS wiki, *Bags/Format/2.0*.
"""

from __future__ import annotations

import struct
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
from tumble.recording.formats.compression import decompress_bz2, decompress_lz4
from tumble.recording.formats.damage import CutShort, Damage, at_most, exactly
from tumble.recording.recording import Remark
from tumble.records import dataclass

NAME = "ROS 1 bag"
ENDINGS = (".bag",)
SUMMARY = "ROS 1 bag: topics of sensor_msgs/Imu, also split ones (lz4 with the extra `ros`)"
HAS_TOPICS = True

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
U32, U64 = struct.Struct("<I"), struct.Struct("<Q")


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a ROS bag."""
    return head.startswith(b"#ROSBAG V")


def header_fields(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header."""
    fields: dict[bytes, bytes] = {}
    position = 0
    while position + 4 <= len(header):
        (size,) = U32.unpack_from(header, position)
        name, _, value = header[position + 4 : position + 4 + size].partition(b"=")
        fields[name] = value
        position += 4 + size
    return fields


def _record_header(file: BinaryIO) -> dict[bytes, bytes] | None:
    """Read a record's header; None at the end of the file."""
    start = file.read(4)
    if not start:
        return None
    if len(start) < 4:
        raise CutShort
    return header_fields(exactly(file, U32.unpack(start)[0]))


def _record_size(file: BinaryIO) -> int:
    """Read how many bytes of data a record has."""
    return int(U32.unpack(exactly(file, 4))[0])


@dataclass(slots=True)
class RosbagFile:
    """A bag: its connections and where its chunks are.

    Attributes
    ----------
    path, topics : the file, and what it holds.
    damage : what could not be read so far.
    connections : header and data of the record of each connection, by its number.
    chunks : where each begins, and the connections in it, None where no index says them.
    """

    path: Path
    topics: list[Topic] = field(default_factory=list[Topic])
    damage: Damage = field(default_factory=lambda: Damage(""))
    _unfinished: bool = False
    connections: dict[int, tuple[dict[bytes, bytes], bytes]] = field(
        default_factory=dict[int, tuple[dict[bytes, bytes], bytes]]
    )
    _named: dict[int, tuple[str, str]] = field(default_factory=dict[int, tuple[str, str]])
    chunks: list[tuple[int, frozenset[int] | None]] = field(
        default_factory=list[tuple[int, frozenset[int] | None]]
    )
    _counts: Counter[int] = field(default_factory=Counter[int])
    _span: float = 0.0

    @property
    def remarks(self) -> list[Remark]:
        """What was noticed, or left out, so far."""
        text = f"{self.path.name} has no index (the recording was not closed, or is cut short); what is there is read."
        return [*([Remark("mended", text)] if self._unfinished else []), *self.damage.remarks()]

    def __post_init__(self) -> None:
        self.damage.name = self.path.name
        with opened(self.path) as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(
                    f"{self.path.name} is a ROS bag of another version than 2.0; convert it with rosbag fix."
                )
            try:
                indexed = self._read_index(file)
            except (CutShort, struct.error, KeyError, ValueError):
                indexed = False
            if not indexed:
                self._scan(file)
        self._list_topics()

    def _read_index(self, file: BinaryIO) -> bool:
        """Read connections and chunks from the end of the file; False if there is no index."""
        header = _record_header(file)
        position = 0 if header is None else int(U64.unpack(header[b"index_pos"])[0])
        file.seek(0, 2)
        if not position or position >= file.tell():
            return False
        file.seek(position)
        times: list[bytes] = []
        while (header := _record_header(file)) is not None:
            data = exactly(file, _record_size(file))
            if header[b"op"][0] == CONNECTION:
                self._connect(header, data)
            elif header[b"op"][0] == CHUNK_INFO:
                pairs = list(struct.iter_unpack("<II", data))
                self._counts.update(dict(pairs))
                self.chunks.append((int(U64.unpack(header[b"chunk_pos"])[0]), frozenset(c for c, _ in pairs)))
                times += [header[b"start_time"], header[b"end_time"]]
        seconds = [s + 1e-9 * ns for s, ns in (struct.unpack("<II", t) for t in times)]
        self._span = max(seconds) - min(seconds) if seconds else 0.0
        self.chunks.sort(key=lambda c: c[0])
        return bool(self.chunks and self._named)

    def _scan(self, file: BinaryIO) -> None:
        """Find chunks and connections where the recorder wrote no index, or the file is cut short."""
        self._named.clear()
        self.connections.clear()
        self.chunks.clear()
        self._counts.clear()
        self._unfinished = True
        file.seek(len(MAGIC))
        try:
            while True:
                position = file.tell()
                header = _record_header(file)
                if header is None:
                    return
                size = _record_size(file)
                if header[b"op"][0] == CHUNK:
                    self._scan_chunk(position, header, at_most(file, size))
                    self.chunks.append((position, None))
                elif header[b"op"][0] == CONNECTION:
                    self._connect(header, exactly(file, size))
                else:
                    file.seek(size, 1)
        except CutShort:
            return
        except (KeyError, IndexError, struct.error) as error:
            if not self.chunks:
                raise RecordingError(f"{self.path.name} is a damaged ROS bag.") from error

    def _scan_chunk(self, position: int, header: dict[bytes, bytes], data: bytes) -> None:
        """Take in the connections of a chunk and count its messages, as far as it is sound."""
        try:
            body = self.body(header, data)
            for inner, start, stop in self.records(body):
                if inner[b"op"][0] == CONNECTION:
                    self._connect(inner, body[start:stop])
                elif inner[b"op"][0] == MESSAGE:
                    self._counts[int(U32.unpack(inner[b"conn"])[0])] += 1
        except (RecordingError, KeyError, IndexError, struct.error) as error:
            self.damage.note(position, error)

    def numbers_of(self, names: Iterable[str]) -> dict[int, str]:
        """Return the connections of some topics, by number."""
        wanted = set(names)
        return {n: topic for n, (topic, _) in self._named.items() if topic in wanted}

    def _connect(self, header: dict[bytes, bytes], data: bytes) -> None:
        said = header_fields(data)
        kind = plain_type(said.get(b"type", b"?").decode("utf-8", "replace"))
        number = int(U32.unpack(header[b"conn"])[0])
        self._named[number] = (header[b"topic"].decode("utf-8", "replace"), kind)
        self.connections[number] = (header, data)

    def _list_topics(self) -> None:
        counts: Counter[tuple[str, str]] = Counter()
        for number, topic in self._named.items():
            counts[topic] += self._counts[number]
        for (name, kind), count in counts.items():
            rate = (count - 1) / self._span if self._span > 0.0 and count > 1 else None
            self.topics.append(Topic(name, kind, count, cdr=False, rate=rate))

    def body(self, header: dict[bytes, bytes], data: bytes) -> bytes:
        """Return a chunk's records, decompressed.

        Raises
        ------
        RecordingError
            If they are damaged, or compressed in an unknown way.
        """
        compression = header.get(b"compression", b"none")
        try:
            if compression == b"none":
                return data
            if compression == b"bz2":
                return decompress_bz2(data, self.path.name)
            if compression == b"lz4":
                return decompress_lz4(data, self.path.name)
        except (OSError, ValueError, RuntimeError, EOFError) as error:
            raise RecordingError(f"{self.path.name}: a chunk of the bag is damaged ({error}).") from error
        raise RecordingError(
            f"{self.path.name}: chunks are compressed as {compression[:16].decode('utf-8', 'replace')!r}, which is "
            "not known; known are bz2 and lz4."
        )

    def records(self, body: bytes) -> Iterator[tuple[dict[bytes, bytes], int, int]]:
        """Yield header, start and stop of the data of a chunk's records.

        Raises
        ------
        RecordingError
            If the chunk is damaged.
        """
        position = 0
        try:
            while position < len(body):
                (size,) = U32.unpack_from(body, position)
                start = position + 4 + size
                (length,) = U32.unpack_from(body, start)
                position = start + 4 + length
                if position > len(body):
                    raise RecordingError(f"{self.path.name}: a chunk of the bag is damaged.")
                yield header_fields(body[start - size : start]), start + 4, position
        except struct.error as error:
            raise RecordingError(f"{self.path.name}: a chunk of the bag is damaged.") from error

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        numbers = self.numbers_of(names)
        self.damage.total = len(self.chunks)
        with opened(self.path) as file:
            for position, connections in self.chunks:
                if connections is not None and not connections & numbers.keys():
                    continue
                try:
                    yield from self._messages_of(self._chunk_at(file, position), numbers)
                except RecordingError as error:
                    self.damage.note(position, error)

    def _chunk_at(self, file: BinaryIO, position: int) -> bytes:
        """Return the records of the chunk that begins at a place."""
        return self.body(*self.packed_at(file, position))

    def packed_at(self, file: BinaryIO, position: int) -> tuple[dict[bytes, bytes], bytes]:
        """Return header and data of the chunk that begins at a place, as they are in the file.

        Raises
        ------
        RecordingError
            If there is none.
        """
        file.seek(position)
        try:
            header = _record_header(file)
            data = at_most(file, _record_size(file))
        except (CutShort, struct.error, OverflowError, MemoryError) as error:
            raise RecordingError(f"{self.path.name}: a chunk is missing.") from error
        if header is None or header.get(b"op") != bytes([CHUNK]):
            raise RecordingError(f"{self.path.name}: the index leads nowhere.")
        return header, data

    def _messages_of(self, body: bytes, numbers: dict[int, str]) -> Iterator[tuple[str, int, bytes]]:
        try:
            for header, start, stop in self.records(body):
                if header[b"op"][0] == MESSAGE:
                    topic = numbers.get(U32.unpack(header[b"conn"])[0])
                    if topic is not None:
                        seconds, rest = struct.unpack("<II", header[b"time"])
                        yield topic, seconds * 1_000_000_000 + rest, body[start:stop]
        except (KeyError, IndexError, struct.error) as error:
            raise RecordingError(f"{self.path.name}: a chunk of the bag is damaged.") from error


read_table, read_table_blocks = bag_readers(lambda path: nullcontext(RosbagFile(path)))
