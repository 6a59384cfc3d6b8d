"""Bags written anew with some messages exchanged: every other message that a reader gets stays what it was.

A ROS 1 bag is written by the library rosbags, an MCAP file by mcap; the database of a ROS 2 bag is copied page by page,
and its messages are exchanged in place. Each says what was corrected by which calibration: a ROS 1 bag in a comment of
the topic's message definition, MCAP in a record of metadata, a database in a table of its own.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import field
from pathlib import Path
from typing import Any

from tumble.errors import RecordingError, UsageError
from tumble.files import opened
from tumble.recording.formats import find_format
from tumble.recording.formats.bags.bag import Bag
from tumble.recording.formats.bags.files import (
    Chain,
    Database,
    McapFile,
    Rosbag1,
    connect,
    mcap_library,
    opened_rosbag1,
    parts_of,
    rosbags_library,
    unpacked_message,
)
from tumble.recording.formats.packed import ZSTD_MAGIC, needed
from tumble.records import dataclass

_ENDINGS = {"ROS 1 bag": ".bag", "MCAP": ".mcap", "ROS 2 bag": ".db3"}
BAG_ENDINGS = tuple(_ENDINGS.values())
"""Of files of bags; a ROS 2 bag is also a folder."""
_Marks = dict[str, tuple[str, ...]]
_COMMENT = re.compile(r"^# corrected by tumble: ([0-9a-f ]+)\n")
_METADATA, _KEY = "tumble", "corrected_by "
_TABLE = "tumble_corrections"
_BATCH = 4096


@dataclass
class Exchange:
    """What is exchanged in a bag.

    Attributes
    ----------
    name : of the bag, for messages.
    marks : identities of the calibrations that each exchanged topic has gone through then.
    pairs : topic, message as it was and as it becomes, in the order of the file.
    count : messages exchanged so far.
    """

    name: str
    marks: Mapping[str, Sequence[str]]
    pairs: Iterator[tuple[str, bytes, bytes]]
    count: int = field(default=0)

    def of(self, topic: str, data: bytes) -> bytes:
        """Return what takes the place of the next message.

        Parameters
        ----------
        topic, data : of the message.

        Raises
        ------
        RecordingError
            If it is not the message that was corrected.
        """
        expected, before, after = next(self.pairs, ("", b"", b""))
        if expected != topic or before != data or len(after) != len(data):
            raise RecordingError(
                f"{self.name} cannot be copied: its messages come in another order the second time. It was written "
                "to meanwhile, or its index is wrong: repair it first (rosbag reindex, mcap recover)."
            )
        self.count += 1
        return after


def ending_of(path: Path) -> str | None:
    """Return the ending that a copy of a bag has, "" of one that is a folder; None of what is no bag.

    Parameters
    ----------
    path : of a recording.
    """
    try:
        format_ = find_format(path)
    except RecordingError:
        return None
    ending = _ENDINGS.get(format_.name)
    return "" if ending is not None and path.is_dir() else ending


def corrections(path: Path) -> _Marks:
    """Return which calibrations the topics of a bag were corrected by; of what is no bag, or is unreadable, none.

    Parameters
    ----------
    path : of a recording.
    """
    try:
        ending = ending_of(path)
        if ending == "":
            return {topic: m for part in parts_of(path) for topic, m in corrections(part).items()}
        if ending == ".bag":
            with opened_rosbag1(path) as bag:
                said = {c.topic: _COMMENT.match(c.msgdef.data) for c in bag.reader.connections}
            return {topic: tuple(found.group(1).split()) for topic, found in said.items() if found}
        if ending == ".mcap":
            return _mcap_corrections(McapFile(path))
        if ending == ".db3":
            with closing(connect(path)) as connection:
                rows = connection.execute(f"SELECT topic, corrected_by FROM {_TABLE}").fetchall()
            return {str(topic): tuple(str(said).split()) for topic, said in rows}
    except (RecordingError, UsageError, OSError, sqlite3.Error):
        pass  # reading it says what is wrong
    return {}


def write_anew(bag: Bag, target: Path, exchange: Exchange) -> None:
    """Write a bag with some messages exchanged.

    Parameters
    ----------
    bag : as `opened_bag` opens it.
    target : the file, or a folder that is there.
    exchange : what is exchanged.

    Raises
    ------
    RecordingError
        If it is damaged, or its messages come in another order than before.
    OSError
        If it cannot be read or written.
    """
    if isinstance(bag, Chain):
        _write_folder(bag, target, exchange)
    elif isinstance(bag, Database):
        _write_database(bag, target, exchange)
    elif isinstance(bag, McapFile):
        _write_mcap(bag, target, exchange)
    else:
        assert isinstance(bag, Rosbag1)
        _write_rosbag1(bag, target, exchange)


def _write_rosbag1(bag: Rosbag1, target: Path, exchange: Exchange) -> None:
    made = rosbags_library(bag.path)
    writer = made.Writer(target)
    if bag.compression is not None:
        writer.set_compression(made.Writer.CompressionFormat[bag.compression.upper()])
    with writer, bag.damage_as_sentence():
        written: dict[Any, Any] = {}
        numbers: dict[int, Any] = {}
        for one in bag.reader.connections:
            definition = one.msgdef.data
            if one.topic in exchange.marks:
                marks = " ".join(exchange.marks[one.topic])
                definition = f"# corrected by tumble: {marks}\n" + _COMMENT.sub("", definition)
            said = {"msgdef": definition, "md5sum": one.digest} | one.ext._asdict()
            # A recorder that lost touch with a sender has two connections that say the same.
            key = (one.topic, one.msgtype, *said.values())
            if key not in written:
                written[key] = writer.add_connection(one.topic, one.msgtype, **said)
            numbers[one.id] = written[key]
        for connection, time, data in bag.reader.messages():
            put = exchange.of(connection.topic, data) if connection.topic in exchange.marks else data
            writer.write(numbers[connection.id], time, put)


def _mcap_corrections(file: McapFile) -> _Marks:
    """Return what a file says before any data."""
    made = mcap_library("records", file.path)
    for _, record in file.pieces():
        if isinstance(record, made.Metadata) and record.name == _METADATA:
            told: dict[str, str] = record.metadata
            return {k.removeprefix(_KEY): tuple(v.split()) for k, v in told.items() if k.startswith(_KEY)}
        if not isinstance(record, made.Header | made.Metadata):
            break
    return {}


def _write_mcap(file: McapFile, target: Path, exchange: Exchange) -> None:
    made, writing = (mcap_library(part, file.path) for part in ("records", "writer"))
    marks = _mcap_corrections(file) | dict(exchange.marks)
    said = {_KEY + topic: " ".join(ids) for topic, ids in marks.items()}
    packed = writing.CompressionType[file.compression.upper() or "NONE"]
    numbers: dict[type, dict[int, int]] = {made.Schema: {0: 0}, made.Channel: {}}
    topics: dict[int, str] = {}
    with target.open("wb") as copy:
        writer = writing.Writer(copy, compression=packed)
        for record in file.records():
            if isinstance(record, made.Header):
                writer.start(record.profile, record.library)
                writer.add_metadata(_METADATA, said)
            elif isinstance(record, made.Schema) and record.id not in numbers[made.Schema]:
                number = writer.register_schema(record.name, record.encoding, record.data)
                numbers[made.Schema][record.id] = number
            elif isinstance(record, made.Channel) and record.id not in topics:
                topics[record.id] = record.topic
                schema = numbers[made.Schema].get(record.schema_id, 0)
                number = writer.register_channel(
                    record.topic, record.message_encoding, schema, record.metadata
                )
                numbers[made.Channel][record.id] = number
            elif isinstance(record, made.Message) and record.channel_id in topics:
                topic = topics[record.channel_id]
                data = exchange.of(topic, record.data) if topic in exchange.marks else record.data
                number = numbers[made.Channel][record.channel_id]
                writer.add_message(number, record.log_time, data, record.publish_time, record.sequence)
            elif isinstance(record, made.Attachment):
                writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            elif isinstance(record, made.Metadata) and record.name != _METADATA:
                writer.add_metadata(record.name, record.metadata)
        writer.finish()


def _write_folder(bag: Chain, target: Path, exchange: Exchange) -> None:
    """Write the files of a bag anew into an empty folder."""
    for name, part in zip(parts_of(bag.path), bag.parts, strict=True):
        packed = name.suffix == ".zstd"
        made = target / (name.stem if packed else name.name)
        write_anew(part, made, exchange)
        if packed:
            library = needed("zstandard", f"{name.name} is compressed with zstd")
            with made.open("rb") as file, (target / name.name).open("wb") as copy:
                library.ZstdCompressor().copy_stream(file, copy, size=made.stat().st_size)
            made.unlink()
    metadata = bag.path / "metadata.yaml"
    if metadata.is_file():
        with opened(metadata) as file, (target / "metadata.yaml").open("wb") as copy:
            shutil.copyfileobj(file, copy)


def _write_database(part: Database, target: Path, exchange: Exchange) -> None:
    try:
        with closing(connect(part.path)) as source, closing(sqlite3.connect(target)) as made:
            source.backup(made)
            # The copy takes its place only when it is whole: it needs no journal.
            made.execute("PRAGMA journal_mode=DELETE")
            made.execute("PRAGMA journal_mode=OFF")
            made.execute("PRAGMA synchronous=OFF")
            _exchange_rows(part, made, exchange)
            made.execute(
                f"CREATE TABLE IF NOT EXISTS {_TABLE} (topic TEXT PRIMARY KEY, corrected_by TEXT NOT NULL)"
            )
            rows = [(topic, " ".join(marks)) for topic, marks in exchange.marks.items()]
            made.executemany(f"INSERT OR REPLACE INTO {_TABLE} VALUES (?, ?)", rows)
            made.commit()
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
            raise OSError(str(error)) from error
        raise RecordingError(f"{part.path.name} cannot be copied ({str(error)[:80]}).") from error


def _exchange_rows(part: Database, made: sqlite3.Connection, exchange: Exchange) -> None:
    """Exchange the messages of the marked topics, some thousands at a time."""
    marked = ",".join("?" * len(exchange.marks))
    query = (
        "SELECT messages.id, name, data FROM messages JOIN topics ON topic_id = topics.id "
        f"WHERE name IN ({marked}) AND messages.id > ? ORDER BY messages.id LIMIT {_BATCH}"
    )
    last = -(2**63)
    while rows := made.execute(query, (*exchange.marks, last)).fetchall():
        changed: list[tuple[bytes, int]] = []
        for row, topic, data in rows:
            put = exchange.of(topic, unpacked_message(data, part.path))
            if data[:4] == ZSTD_MAGIC:
                put = needed("zstandard", f"{part.path.name} is compressed with zstd").compress(put)
            changed.append((put, row))
        made.executemany("UPDATE messages SET data = ? WHERE id = ?", changed)
        last = rows[-1][0]
