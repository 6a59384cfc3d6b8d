"""Files of messages: which kind a path holds, and the tables that it is read as.

ROS 1 bags (version 2.0), read by the library rosbags, without ROS.

MCAP files with ROS 1 or ROS 2 messages, read by the library mcap; also unfinished ones.

The library reads a file's records one after another, which a file that is cut short allows, too; the summary at the
end is for the list of topics alone.

ROS 2 bags: databases of sqlite3, and the folders that hold them or MCAP files, without ROS.

References
----------
ros2/rosbag2: storage plugin sqlite3 (tables `topics` and `messages`), `metadata.yaml`.
"""

from __future__ import annotations

import re
import sqlite3
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from dataclasses import field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from tumble.errors import RecordingError
from tumble.files import opened, size_of
from tumble.recording.formats import find_format
from tumble.recording.formats.bags.bag import Bag, Topic, bag_tables, plain_type
from tumble.recording.formats.packed import ZSTD_MAGIC, decompress_zstd, needed, unpacked
from tumble.recording.formats.table import RawTable, foreign, hash_file, hash_files
from tumble.recording.samples import Remark, Source
from tumble.records import dataclass


def opened_bag(path: Path) -> AbstractContextManager[Bag]:
    """Open a file or folder as a bag.

    Parameters
    ----------
    path : of a bag.

    Raises
    ------
    RecordingError
        If it is damaged.
    UsageError
        If a library is missing.
    OSError
        If it cannot be read.
    """
    kind = find_format(path).name
    if kind == "MCAP":
        return nullcontext(McapFile(path))
    return opened_rosbag1(path) if kind == _NAME else opened_rosbag2(path)


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a bag in blocks of half a million rows.

    Parameters
    ----------
    path : the file, or the folder.
    topics : one topic, or one of each triad; none where it holds one IMU.

    Raises
    ------
    RecordingError
        If it is damaged or holds no IMU, or several.
    UsageError
        If a topic is not there, or a library is missing.
    OSError
        If the file cannot be read.
    """
    with opened_bag(path) as bag:
        yield from bag_tables(bag, topics)


_NAME = "ROS 1 bag"


def rosbags_library(path: Path) -> Any:
    """Return the library that reads and writes a bag.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    return needed("rosbags.rosbag1", f"{path.name} is a {_NAME}")


@dataclass
class Rosbag1:
    """An opened bag.

    Attributes
    ----------
    path, reader : the file, and the library's reader of it.
    topics : what it holds.
    compression : of its first chunk, "bz2" or "lz4"; None without.
    remarks : none, for a bag that is not whole is refused.
    """

    path: Path
    reader: Any
    topics: list[Topic] = field(default_factory=list[Topic])
    compression: str | None = None
    remarks: list[Remark] = field(default_factory=list[Remark])

    def __post_init__(self) -> None:
        counts: Counter[tuple[str, str]] = Counter()
        for connection in self.reader.connections:
            counts[connection.topic, plain_type(connection.msgtype)] += connection.msgcount
        span = self.reader.duration - 1
        self.topics += [Topic(name, kind, count, False, span) for (name, kind), count in counts.items()]
        known = {d: n for n, d in needed("rosbags.rosbag1.reader", "").decompressors.items()}
        packed = (known[chunk.decompressor] for chunk in self.reader.chunks.values())
        self.compression = next((name for name in packed if name != "none"), None)

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        wanted = set(names)
        chosen = [c for c in self.reader.connections if c.topic in wanted]
        if chosen:
            with self.damage_as_sentence():
                for connection, time, data in self.reader.messages(chosen):
                    yield connection.topic, time, data

    def damage_as_sentence(self) -> AbstractContextManager[None]:
        """Turn what the library makes of a damaged file into a sentence."""
        return foreign(self.path, _NAME, _mend_rosbag1(self.path))


def _mend_rosbag1(path: Path) -> str:
    return f"If it was cut short or not closed, repair it first: rosbag reindex {path.name}"


@contextmanager
def opened_rosbag1(path: Path) -> Generator[Rosbag1]:
    """Open a bag; one that is cut short, was not closed, or is damaged is refused."""
    made = rosbags_library(path)
    with foreign(path, _NAME, _mend_rosbag1(path)):
        reader = made.Reader(path)
        reader.open()
        bag = Rosbag1(path, reader)
    try:
        yield bag
    finally:
        reader.close()


MAGIC = b"\x89MCAP0\r\n"
_FOOTER_SIZE = 37  # bytes, of the footer and the magic after it
_MESSAGE = 0x05
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


def mcap_library(part: str, path: Path) -> Any:
    """Return a module of the library that reads and writes a file.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    return needed(f"mcap.{part}", f"{path.name} is an MCAP file")


@dataclass
class _Whole:
    """An open file whose reads are as long as was asked for, or end the reading."""

    file: BinaryIO
    size: int

    def read(self, length: int) -> bytes:
        if self.file.tell() + length > self.size:
            raise EOFError
        return self.file.read(length)


@dataclass
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
        made = mcap_library("records", self.path)
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
            self._named[number] = channel.topic
            self.topics.append(Topic(channel.topic, kind, count, encoding == "cdr", high - low))

    def _summary(self) -> list[Any]:
        """Return the records of the summary; none where it is missing or damaged, for it only repeats the others."""
        made = mcap_library("records", self.path)
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
            reader = mcap_library("stream_reader", self.path).StreamReader
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
        made = mcap_library("records", self.path)
        size = size_of(self.path)
        with opened(self.path) as file:
            whole: Any = _Whole(file, size)
            stream = mcap_library("stream_reader", self.path).StreamReader(
                whole, emit_chunks=True, record_size_limit=size
            )
            records = iter(stream.records)
            unpack = mcap_library("stream_reader", self.path).get_chunk_data_stream
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
        chunk = mcap_library("records", self.path).Chunk
        breakup = mcap_library("stream_reader", self.path).breakup_chunk
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
        made = mcap_library("records", self.path)
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


def source(path: Path) -> Source:
    """Return name and SHA-256 of a database, or of a folder's files with messages.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return hash_files(path, parts_of(path)) if path.is_dir() else hash_file(path)


def parts_of(folder: Path) -> list[Path]:
    """Return the files of a folder that hold messages, in the order of their numbers."""
    found = [p for p in folder.iterdir() if p.name.endswith((".db3", ".mcap", ".db3.zstd", ".mcap.zstd"))]
    names = {p.name for p in found}
    found = [p for p in found if not (p.suffix == ".zstd" and p.stem in names)]
    return sorted(found, key=lambda p: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", p.name)])


@contextmanager
def opened_rosbag2(path: Path) -> Generator[Database | Chain]:
    """Open a database or a folder; files that are compressed as a whole are unpacked for the while.

    Raises
    ------
    RecordingError
        If a file is damaged or foreign.
    UsageError
        If a library is missing.
    OSError
        If a file cannot be read.
    """
    with ExitStack() as stack:
        if not path.is_dir():
            yield Database(path)
            return
        remarks: list[Remark] = []
        parts: list[Database | McapFile] = []
        for part in parts_of(path):
            file = part
            if part.suffix == ".zstd":
                file, said = stack.enter_context(unpacked(part))
                remarks += said
            parts.append(McapFile(file) if file.suffix == ".mcap" else Database(file))
        yield Chain(path, parts, remarks)


def connect(path: Path) -> sqlite3.Connection:
    """Return a connection to a database that reads, and changes nothing.

    Raises
    ------
    RecordingError
        If it ends before its last page, which sqlite3 would fill up with zeros.
    OSError
        If it cannot be read.
    """
    journal = path.with_name(path.name + "-wal")
    unchanged = not (journal.exists() and journal.stat().st_size)  # what the recorder had not yet moved
    with opened(path) as file:
        size, pages = struct.unpack_from(">H10xI", file.read(100).ljust(100, b"\0"), 16)
        size = 65536 if size == 1 else size
        if unchanged and file.seek(0, 2) < size * pages:
            raise RecordingError(f"{path.name} is cut short. {_mend_database(path)}.")
    uri = f"file:{quote(str(path.absolute()))}?mode=ro" + ("&immutable=1" if unchanged else "")
    return sqlite3.connect(uri, uri=True)


def _mend_database(path: Path) -> str:
    return f"Save what is there first: sqlite3 {path.name} .recover | sqlite3 mended.db3"


@contextmanager
def damage_as_sentence(path: Path) -> Generator[None]:
    """Turn what sqlite3 says of a database into a sentence.

    Raises
    ------
    RecordingError
        If it is damaged or foreign.
    """
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:  # messages of sqlite3 may hold damaged names
        raise RecordingError(
            f"{path.name} is a damaged or foreign database of sqlite3 ({str(error)[:80]}); give a ROS 2 bag. If it is "
            f"one: {_mend_database(path)[:1].lower()}{_mend_database(path)[1:]}."
        ) from error


@dataclass
class Database:
    """One database with its topics."""

    path: Path
    topics: list[Topic] = field(default_factory=list[Topic])
    remarks: list[Remark] = field(default_factory=list[Remark])

    def __post_init__(self) -> None:
        with damage_as_sentence(self.path), closing(connect(self.path)) as connection:
            rows = connection.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            counts = connection.execute(
                "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
            ).fetchall()
        found = {number: spans for number, *spans in counts}
        for number, name, kind, form in rows:
            count, low, high = found.get(number, (0, 0, 0))
            kind = plain_type(str(kind)) if form == "cdr" else f"{plain_type(str(kind))} as {form}"
            self.topics.append(Topic(str(name), kind, count, True, high - low))

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics.

        Raises
        ------
        RecordingError
            If the database is damaged.
        """
        wanted = list(names)
        query = (
            "SELECT name, timestamp, data FROM messages JOIN topics ON topic_id = topics.id "
            f"WHERE name IN ({','.join('?' * len(wanted))}) ORDER BY messages.id"
        )
        with damage_as_sentence(self.path), closing(connect(self.path)) as connection:
            for name, time, data in connection.execute(query, wanted):
                if not isinstance(data, bytes):
                    raise sqlite3.DataError("a message is no row of bytes")
                yield name, time, unpacked_message(data, self.path)


def unpacked_message(data: bytes, path: Path) -> bytes:
    """Return a message of a bag whose messages may be compressed one by one.

    Raises
    ------
    RecordingError
        If it is damaged.
    UsageError
        If a library is missing.
    """
    return decompress_zstd(data, path.name) if data[:4] == ZSTD_MAGIC else data  # no beginning of CDR


@dataclass
class Chain:
    """The files of a bag that was recorded in parts, one after another."""

    path: Path
    parts: list[Database | McapFile]
    said: list[Remark] = field(default_factory=list[Remark])
    topics: list[Topic] = field(default_factory=list[Topic])

    def __post_init__(self) -> None:
        counts: Counter[tuple[str, str, bool]] = Counter()
        for topic in (t for part in self.parts for t in part.topics):
            counts[topic.name, topic.kind, topic.cdr] += topic.count
        self.topics = [Topic(name, kind, count, cdr) for (name, kind, cdr), count in counts.items()]
        if len(self.parts) == 1:
            self.topics = self.parts[0].topics

    @property
    def remarks(self) -> list[Remark]:
        """What the parts noticed."""
        return [*self.said, *(r for part in self.parts for r in part.remarks)]

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        chosen = list(names)
        for part in self.parts:
            yield from part.messages(chosen)
