"""ROS 2 bags: databases of sqlite3, and the folders that hold them or MCAP files, without ROS.

References
----------
ros2/rosbag2: storage plugin sqlite3 (tables `topics` and `messages`), `metadata.yaml`.
"""

from __future__ import annotations

import re
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import quote

from tumble.errors import RecordingError
from tumble.recording.formats.bags import Bag, Topic, bag_blocks, bag_table
from tumble.recording.formats.compression import ZSTD_MAGIC, decompress_zstd
from tumble.recording.formats.mcap import McapFile
from tumble.recording.formats.ros_messages import plain_type
from tumble.recording.formats.table import RawTable, hash_file, hash_files
from tumble.recording.recording import Remark, Source

NAME = "ROS 2 bag"
ENDINGS = (".db3",)
SUMMARY = "ROS 2 bag (sqlite3, or a folder with metadata.yaml): topics of sensor_msgs/Imu, also split ones"
HAS_TOPICS = True

_MAGIC = b"SQLite format 3\0"


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a database of sqlite3."""
    return head.startswith(_MAGIC)


def recognises_folder(folder: Path) -> bool:
    """Say whether a folder is a ROS 2 bag."""
    return bool(_parts(folder))


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read a bag whole.

    Parameters
    ----------
    path : the database, or the folder.
    topics : one topic, or one of each triad; none where the bag holds one IMU.

    Raises
    ------
    RecordingError
        If the bag is damaged or holds no IMU, or several.
    UsageError
        If a topic is not there, or a library is missing.
    OSError
        If the file cannot be read.
    """
    try:
        return bag_table(_open(path), topics, source(path))
    except (sqlite3.Error, UnicodeDecodeError) as error:  # messages of sqlite3 may hold damaged names
        raise _damaged(path, error) from error


def read_table_blocks(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a bag in blocks of half a million rows (without SHA-256).

    Parameters
    ----------
    path, topics : as for `read_table`.

    Raises
    ------
    RecordingError
        If the bag is damaged or holds no IMU, or several.
    UsageError
        If a topic is not there, or a library is missing.
    OSError
        If the file cannot be read.
    """
    try:
        yield from bag_blocks(_open(path), topics, Source(path.name, ""))
    except (sqlite3.Error, UnicodeDecodeError) as error:  # messages of sqlite3 may hold damaged names
        raise _damaged(path, error) from error


def source(path: Path) -> Source:
    """Return name and SHA-256 of a database, or of a folder's files with messages.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return hash_files(path, _parts(path)) if path.is_dir() else hash_file(path)


def _text(octets: bytes) -> str:
    return octets.decode("utf-8", "replace")


def _damaged(path: Path, error: Exception) -> RecordingError:
    return RecordingError(
        f"{path.name} is a damaged or foreign database of sqlite3 ({str(error)[:80]}); give a ROS 2 bag."
    )


def _parts(folder: Path) -> list[Path]:
    """Return the files of a folder that hold messages, in the order of their numbers."""
    found = [p for p in folder.iterdir() if p.name.endswith((".db3", ".mcap", ".db3.zstd", ".mcap.zstd"))]
    names = {p.name for p in found}
    found = [p for p in found if not (p.suffix == ".zstd" and p.stem in names)]
    return sorted(found, key=lambda p: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", p.name)])


def _open(path: Path) -> Bag:
    if not path.is_dir():
        return _Database(path)
    for part in _parts(path):
        if part.suffix == ".zstd":
            raise RecordingError(f"{part} is compressed as a whole; unpack it first (zstd -d {part.name}).")
    return _Chain(path, [McapFile(p) if p.suffix == ".mcap" else _Database(p) for p in _parts(path)])


@dataclass(slots=True)
class _Database:
    """One database with its topics."""

    path: Path
    topics: list[Topic] = field(default_factory=list[Topic])
    remarks: list[Remark] = field(default_factory=list[Remark])

    def __post_init__(self) -> None:
        connection = self._connect()
        try:
            rows = connection.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            counted = connection.execute(
                "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
            ).fetchall()
        finally:
            connection.close()
        counts = {row[0]: row[1:] for row in counted}
        for number, name, kind, form in rows:
            count, low, high = counts.get(number, (0, 0, 0))
            rate = (count - 1) / (1e-9 * (high - low)) if count > 1 and high > low else None
            kind = plain_type(kind) if form == "cdr" else f"{plain_type(kind)} as {form}"
            self.topics.append(Topic(name, kind, count, cdr=True, rate=rate))

    def _connect(self) -> sqlite3.Connection:
        # A journal beside it holds what the recorder had not yet moved: then the file may change.
        journal = self.path.with_name(self.path.name + "-wal")
        unchanged = not (journal.exists() and journal.stat().st_size)
        uri = f"file:{quote(str(self.path.absolute()))}?mode=ro" + ("&immutable=1" if unchanged else "")
        connection = sqlite3.connect(uri, uri=True)
        connection.text_factory = _text
        return connection

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        connection = self._connect()
        try:
            wanted = set(names)
            topics = {n: t for n, t in connection.execute("SELECT id, name FROM topics") if t in wanted}
            if not topics:
                return
            marks = ",".join("?" * len(topics))
            rows = connection.execute(
                f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id",
                tuple(topics),
            )
            for number, time, data in rows:
                if not isinstance(data, bytes):
                    raise RecordingError(
                        f"{self.path.name} is a damaged ROS 2 bag: a message is no row of bytes."
                    )
                if data[:4] == ZSTD_MAGIC:  # no beginning of CDR
                    data = decompress_zstd(data, self.path.name)
                yield topics[number], time, data
        finally:
            connection.close()


@dataclass(slots=True)
class _Chain:
    """The files of a bag that was recorded in parts, one after another."""

    path: Path
    parts: list[Bag]
    topics: list[Topic] = field(default_factory=list[Topic])

    def __post_init__(self) -> None:
        counts: Counter[tuple[str, str, bool]] = Counter()
        for topic in (t for part in self.parts for t in part.topics):
            counts[topic.name, topic.kind, topic.cdr] += topic.count or 0
        self.topics = [Topic(name, kind, count, cdr) for (name, kind, cdr), count in counts.items()]
        if len(self.parts) == 1:
            self.topics = [replace(t) for t in self.parts[0].topics]

    @property
    def remarks(self) -> list[Remark]:
        """What the parts noticed."""
        return [r for part in self.parts for r in part.remarks]

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        chosen = list(names)
        for part in self.parts:
            yield from part.messages(chosen)
