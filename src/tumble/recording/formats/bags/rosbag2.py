"""ROS 2 bags: databases of sqlite3, and the folders that hold them or MCAP files, without ROS.

References
----------
ros2/rosbag2: storage plugin sqlite3 (tables `topics` and `messages`), `metadata.yaml`.
"""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import field, replace
from pathlib import Path
from urllib.parse import quote

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.bags.bag import Topic, bag_reader, plain_type
from tumble.recording.formats.bags.mcap import McapFile
from tumble.recording.formats.packed import ZSTD_MAGIC, decompress_zstd, unpacked
from tumble.recording.formats.table import hash_file, hash_files
from tumble.recording.samples import Remark, Source
from tumble.records import dataclass


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
def opened_bag(path: Path) -> Generator[Database | Chain]:
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
            raise RecordingError(f"{path.name} is cut short. {_mend(path)}.")
    uri = f"file:{quote(str(path.absolute()))}?mode=ro" + ("&immutable=1" if unchanged else "")
    return sqlite3.connect(uri, uri=True)


def _mend(path: Path) -> str:
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
            f"one: {_mend(path)[:1].lower()}{_mend(path)[1:]}."
        ) from error


@dataclass(slots=True)
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
            rate = (count - 1) / (1e-9 * (high - low)) if count > 1 and high > low else None
            kind = plain_type(str(kind)) if form == "cdr" else f"{plain_type(str(kind))} as {form}"
            self.topics.append(Topic(str(name), kind, count, cdr=True, rate=rate))

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


@dataclass(slots=True)
class Chain:
    """The files of a bag that was recorded in parts, one after another."""

    path: Path
    parts: list[Database | McapFile]
    said: list[Remark] = field(default_factory=list[Remark])
    topics: list[Topic] = field(default_factory=list[Topic])

    def __post_init__(self) -> None:
        counts: dict[tuple[str, str, bool], int] = {}
        for topic in (t for part in self.parts for t in part.topics):
            kind = topic.name, topic.kind, topic.cdr
            counts[kind] = counts.get(kind, 0) + topic.count
        self.topics = [Topic(name, kind, count, cdr) for (name, kind, cdr), count in counts.items()]
        if len(self.parts) == 1:
            self.topics = [replace(t) for t in self.parts[0].topics]

    @property
    def remarks(self) -> list[Remark]:
        """What the parts noticed."""
        return [*self.said, *(r for part in self.parts for r in part.remarks)]

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        chosen = list(names)
        for part in self.parts:
            yield from part.messages(chosen)


read_tables = bag_reader(opened_bag)
