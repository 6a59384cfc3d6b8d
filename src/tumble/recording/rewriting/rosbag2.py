"""ROS 2 bags written anew: databases are copied page by page and their messages exchanged in place.

Topics, qualities of service, definitions and `metadata.yaml` are copied as they are. What was corrected by which
calibration stands in a table of its own, `tumble_corrections`, which rosbag2 passes over.
"""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import quote

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.bags.mcap import McapFile
from tumble.recording.formats.bags.rosbag2 import Chain, Database, parts_of
from tumble.recording.formats.compression import ZSTD_MAGIC, decompress_zstd
from tumble.recording.rewriting import mcap
from tumble.recording.rewriting.exchange import Exchange

_TABLE = "tumble_corrections"
_BATCH = 4096
_PAGES = 2048


def corrections(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the calibrations that topics were corrected by.

    Parameters
    ----------
    path : of a database, or of the folder of a bag.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    if path.is_dir():
        found: dict[str, tuple[str, ...]] = {}
        for part in parts_of(path):
            if part.suffix == ".mcap":
                found |= mcap.corrections(part)
            elif part.suffix == ".db3":
                found |= corrections(part)
        return found
    try:
        with closing(sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro", uri=True)) as connection:
            rows = connection.execute(f"SELECT topic, corrected_by FROM {_TABLE}").fetchall()
    except sqlite3.Error:
        return {}
    return {str(topic): tuple(str(said).split()) for topic, said in rows}


def rewrite_folder(bag: Chain, target: Path, exchange: Exchange) -> None:
    """Write the files of a bag anew into a folder, with messages exchanged.

    Parameters
    ----------
    bag : opened.
    target : an empty folder.
    exchange : what takes the place of what, over all files.

    Raises
    ------
    RecordingError
        If a file cannot be copied.
    UsageError
        If a library is missing.
    OSError
        If a file cannot be read or written.
    """
    for name, part in zip(parts_of(bag.path), bag.parts, strict=True):
        packed = name.suffix == ".zstd"
        made = target / (name.stem if packed else name.name)
        if isinstance(part, McapFile):
            mcap.rewrite(part.path, made, exchange)
        else:
            rewrite_database(part, made, exchange)
        if packed:
            _pack(made, target / name.name)
    metadata = bag.path / "metadata.yaml"
    if metadata.is_file():
        with opened(metadata) as file, (target / "metadata.yaml").open("wb") as copy:
            shutil.copyfileobj(file, copy)


def _pack(made: Path, target: Path) -> None:
    """Compress a file as a whole, as rosbag2 does."""
    library: Any = import_module("zstandard")
    with made.open("rb") as file, target.open("wb") as packed:
        library.ZstdCompressor().copy_stream(file, packed, size=made.stat().st_size)
    made.unlink()


def rewrite_database(part: Database, target: Path, exchange: Exchange) -> None:
    """Write a database anew with messages exchanged.

    Parameters
    ----------
    part : opened.
    target : the file to be written.
    exchange : what takes the place of what.

    Raises
    ------
    RecordingError
        If the database is damaged.
    UsageError
        If a library is missing.
    OSError
        If a file cannot be written.
    """
    if part.remarks:
        raise RecordingError(
            f"{part.path.name} is cut short or damaged, and a database is copied whole or not at all: mend it first "
            f"(sqlite3 {part.path.name} .recover), or write a .csv."
        )
    try:
        with closing(part.connect()) as source, closing(sqlite3.connect(target)) as made:
            source.backup(made, pages=_PAGES)
            made.text_factory = source.text_factory
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
        raise RecordingError(
            f"{part.path.name} is a damaged database ({str(error)[:80]}): mend it first "
            f"(sqlite3 {part.path.name} .recover), or write a .csv."
        ) from error


def _exchange_rows(part: Database, made: sqlite3.Connection, exchange: Exchange) -> None:
    """Exchange the messages of the marked topics, some thousands at a time."""
    known = made.execute("SELECT id, name FROM topics").fetchall()
    topics = {number: name for number, name in known if name in exchange.marks}
    if not topics:
        return
    query = (
        f"SELECT id, topic_id, data FROM messages WHERE topic_id IN ({','.join('?' * len(topics))}) AND id > ? "
        f"ORDER BY id LIMIT {_BATCH}"
    )
    last = -(2**63)
    while rows := made.execute(query, (*topics, last)).fetchall():
        changed: list[tuple[bytes, int]] = []
        for row, number, data in rows:
            changed.append((_exchanged(part, topics[number], data, exchange), row))
        made.executemany("UPDATE messages SET data = ? WHERE id = ?", changed)
        last = rows[-1][0]


def _exchanged(part: Database, topic: str, data: bytes, exchange: Exchange) -> bytes:
    if data[:4] != ZSTD_MAGIC:
        return exchange.of(topic, data)
    library: Any = import_module("zstandard")
    packed: bytes = library.ZstdCompressor().compress(
        exchange.of(topic, decompress_zstd(data, part.path.name))
    )
    return packed
