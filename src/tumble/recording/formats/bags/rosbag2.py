"""ROS 2 bags: databases of sqlite3, and the folders that hold them or MCAP files, without ROS.

References
----------
ros2/rosbag2: storage plugin sqlite3 (tables `topics` and `messages`), `metadata.yaml`.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import struct
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import field, replace
from pathlib import Path
from urllib.parse import quote

from tumble.errors import RecordingError
from tumble.files import opened, temporary_folder
from tumble.recording.formats.bags.bag import Topic, bag_readers
from tumble.recording.formats.bags.mcap import McapFile
from tumble.recording.formats.bags.ros_messages import plain_type
from tumble.recording.formats.compressed import unpacked
from tumble.recording.formats.compression import ZSTD_MAGIC, decompress_zstd
from tumble.recording.formats.damage import Damage
from tumble.recording.formats.table import hash_file, hash_files
from tumble.recording.recording import Remark, Source
from tumble.records import dataclass

NAME = "ROS 2 bag"
ENDINGS = (".db3",)
SUMMARY = "ROS 2 bag (sqlite3, or a folder with metadata.yaml): topics of sensor_msgs/Imu, also split ones"
HAS_TOPICS = True

_MAGIC = b"SQLite format 3\0"
_LARGEST_STRIDE = 1 << 24  # rows


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a database of sqlite3."""
    return head.startswith(_MAGIC)


def recognises_folder(folder: Path) -> bool:
    """Say whether a folder is a ROS 2 bag."""
    return bool(parts_of(folder))


def source(path: Path) -> Source:
    """Return name and SHA-256 of a database, or of a folder's files with messages.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return hash_files(path, parts_of(path)) if path.is_dir() else hash_file(path)


def _text(octets: bytes) -> str:
    return octets.decode("utf-8", "replace")


def _damaged(path: Path, error: Exception) -> RecordingError:
    return RecordingError(
        f"{path.name} is a damaged or foreign database of sqlite3 ({str(error)[:80]}); give a ROS 2 bag."
    )


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
    try:
        with ExitStack() as stack:
            remarks: list[Remark] = []
            if not path.is_dir():
                yield Database(path, _whole_pages(path, stack, remarks), said=remarks)
                return
            parts: list[Database | McapFile] = []
            for part in parts_of(path):
                file = part
                if part.suffix == ".zstd":
                    file, said = stack.enter_context(unpacked(part))
                    remarks += said
                if file.suffix == ".mcap":
                    parts.append(McapFile(file))
                else:
                    parts.append(Database(file, _whole_pages(file, stack, remarks)))
            yield Chain(path, parts, remarks)
    except (sqlite3.Error, UnicodeDecodeError) as error:  # messages of sqlite3 may hold damaged names
        raise _damaged(path, error) from error


def _whole_pages(path: Path, stack: ExitStack, remarks: list[Remark]) -> Path:
    """Return a database that ends with a whole page: of one that does not, a copy without the last piece.

    sqlite3 would fill a page up with zeros, and numbers with it.
    """
    with opened(path) as file:
        head = file.read(100)
        (page,) = struct.unpack_from(">H", head.ljust(100, b"\0"), 16)
        page = 65536 if page == 1 else page
        (pages,) = struct.unpack_from(">I", head.ljust(100, b"\0"), 28)
        size = path.stat().st_size
        if not head.startswith(_MAGIC) or page < 512 or size >= page * pages or _journal(path):
            return path
        remarks.append(Remark("mended", f"{path.name} is cut short; what is there is read."))
        if size % page == 0:
            return path
        whole = stack.enter_context(temporary_folder()) / path.name
        file.seek(0)
        with whole.open("wb") as target:
            shutil.copyfileobj(file, target, 1 << 20)
            target.truncate(size // page * page)
        return whole


def _journal(path: Path) -> bool:
    """Whether a journal beside a database holds what the recorder had not yet moved."""
    journal = path.with_name(path.name + "-wal")
    return journal.exists() and journal.stat().st_size > 0


@dataclass(slots=True)
class Database:
    """One database with its topics; `file` is what is read of it."""

    path: Path
    file: Path
    said: list[Remark] = field(default_factory=list[Remark])
    topics: list[Topic] = field(default_factory=list[Topic])
    _damage: Damage = field(default_factory=lambda: Damage("", "piece"))

    @property
    def remarks(self) -> list[Remark]:
        """What was left out so far."""
        return [*self.said, *self._damage.remarks()]

    def __post_init__(self) -> None:
        self._damage.name = self.path.name
        connection = self.connect()
        try:
            rows = connection.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            counts = _counted(connection)
        finally:
            connection.close()
        for number, *words in rows:
            name, kind, form = (str(word or "?") for word in words)
            count, low, high = (None, 0, 0) if counts is None else counts.get(number, (0, 0, 0))
            rate = (
                (count - 1) / (1e-9 * (high - low))
                if count is not None and count > 1 and high > low
                else None
            )
            kind = plain_type(kind) if form == "cdr" else f"{plain_type(kind)} as {form}"
            self.topics.append(Topic(name, kind, count, cdr=True, rate=rate))

    def connect(self) -> sqlite3.Connection:
        """Return a connection that reads, and changes nothing."""
        unchanged = not _journal(self.file)  # else the file may change
        uri = f"file:{quote(str(self.file.absolute()))}?mode=ro" + ("&immutable=1" if unchanged else "")
        connection = sqlite3.connect(uri, uri=True)
        connection.text_factory = _text
        connection.execute("PRAGMA writable_schema=ON")  # else a file that is cut short is refused as a whole
        return connection

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics.

        Raises
        ------
        RecordingError
            If a message is no bytes.
        """
        connection = self.connect()
        try:
            wanted = set(names)
            topics = {n: t for n, t in connection.execute("SELECT id, name FROM topics") if t in wanted}
            if not topics:
                return
            for number, time, data in self._rows(connection, tuple(topics)):
                if not isinstance(data, bytes):
                    raise RecordingError(
                        f"{self.path.name} is a damaged ROS 2 bag: a message is no row of bytes."
                    )
                if data[:4] == ZSTD_MAGIC:  # no beginning of CDR
                    data = decompress_zstd(data, self.path.name)
                yield topics[number], time, data
        finally:
            connection.close()

    def _rows(
        self, connection: sqlite3.Connection, topics: tuple[int, ...]
    ) -> Iterator[tuple[int, int, object]]:
        """Yield the rows of some topics; where a page of the database is damaged, what lies beyond it."""
        query = (
            f"SELECT topic_id, timestamp, data, id FROM messages WHERE topic_id IN ({','.join('?' * len(topics))}) "
            "AND id >= ? ORDER BY id"
        )
        start, stride = 0, 1
        while True:
            try:
                for number, time, data, row in connection.execute(query, (*topics, start)):
                    start, stride = row + 1, 1
                    yield number, time, data
                return
            except sqlite3.DatabaseError as error:
                if stride == 1:
                    self._damage.note(start, error)
            # Beyond what cannot be read, in steps that grow until something can be.
            start, stride = start + stride, 2 * stride
            if stride > _LARGEST_STRIDE:
                return


def _counted(connection: sqlite3.Connection) -> dict[int, tuple[int, int, int]] | None:
    """Return number, first and last time of the messages by topic; None where the database is damaged."""
    try:
        rows = connection.execute(
            "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
        ).fetchall()
    except sqlite3.DatabaseError as error:
        if "malformed" not in str(error):
            raise
        return None
    return {row[0]: row[1:] for row in rows}


@dataclass(slots=True)
class Chain:
    """The files of a bag that was recorded in parts, one after another."""

    path: Path
    parts: list[Database | McapFile]
    said: list[Remark] = field(default_factory=list[Remark])
    topics: list[Topic] = field(default_factory=list[Topic])

    def __post_init__(self) -> None:
        counts: dict[tuple[str, str, bool], int | None] = {}
        for topic in (t for part in self.parts for t in part.topics):
            kind = topic.name, topic.kind, topic.cdr
            before = counts.get(kind, 0)
            counts[kind] = None if before is None or topic.count is None else before + topic.count
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


read_table, read_table_blocks = bag_readers(opened_bag, source)
