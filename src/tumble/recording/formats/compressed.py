"""Any format, compressed as a whole with gzip, bzip2, xz or zstd: unpacked to a temporary file first."""

from __future__ import annotations

import bz2
import gzip
import lzma
import tempfile
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from tumble.errors import OutputError, RecordingError
from tumble.files import opened, temporary_folder
from tumble.recording.formats.compression import ZSTD_MAGIC, ZstdStream
from tumble.recording.formats.table import RawTable, hash_file, row_words
from tumble.recording.recording import Remark

NAME = "compressed"
ENDINGS = (".gz", ".bz2", ".xz", ".zst", ".zstd")
HAS_TOPICS = True

_PIECE = 1 << 13  # bytes; a damaged piece is lost as a whole
_OPENERS: dict[bytes, Callable[[BinaryIO], Any]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ": lzma.open,
}


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is compressed and holds something else than text."""
    return head.startswith((ZSTD_MAGIC, *_OPENERS))


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read a compressed file.

    Parameters
    ----------
    path : the file.
    topics : as for the format inside.

    Raises
    ------
    RecordingError
        If the file is damaged, or what is in it is no recording.
    UsageError
        If a library is missing, or a topic is not there.
    OSError
        If the file cannot be read.
    """
    from tumble.recording.formats import read_table as read_file

    with unpacked(path) as (inside, remarks):
        table = read_file(inside, topics)
    # The file inside is gone when somebody asks for the place of a row: it is unpacked again.
    table.path, table.source, table.place = path, hash_file(path), partial(_place, path, topics)
    table.remarks += remarks
    return table


def _place(path: Path, topics: Sequence[str], row: int) -> str:
    from tumble.recording.formats import read_table as read_file

    with unpacked(path) as (inside, _):
        return read_file(inside, topics).place(row)


def read_table_blocks(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a compressed file in blocks, if the format inside can be read so (without SHA-256).

    Parameters
    ----------
    path, topics : as for `read_table`.

    Raises
    ------
    RecordingError
        If the file is damaged, or what is in it is no recording.
    UsageError
        If a library is missing, or a topic is not there.
    OSError
        If the file cannot be read.
    """
    from tumble.recording.formats import read_table_blocks as read_file_blocks

    rows = 0
    with unpacked(path) as (inside, remarks):
        for table in read_file_blocks(inside, topics):
            table.path = path
            table.place = lambda row, start=rows: row_words(start + row)
            rows += len(table)
            table.remarks += remarks
            remarks = []
            yield table


def _write(target: BinaryIO, piece: bytes, path: Path) -> None:
    """Write a piece, or with none what waits to be written; a full disk is no damage of the packed file."""
    try:
        target.write(piece)
        if not piece:
            target.flush()
    except OSError as error:
        raise OutputError(
            f"{path.name} could not be unpacked to {tempfile.gettempdir()}: {error.strerror or error}. Make room "
            "there, or set TMPDIR to a folder with more."
        ) from error


@contextmanager
def unpacked(path: Path) -> Generator[tuple[Path, list[Remark]]]:
    """Give the content of a compressed file as a file in a temporary folder, and what is to be said of it.

    Raises
    ------
    RecordingError
        If nothing of it can be read.
    UsageError
        If a library is missing.
    OutputError
        If there is no room to unpack it.
    OSError
        If the file cannot be read.
    """
    remarks: list[Remark] = []
    with temporary_folder() as folder:
        inside = folder / (path.stem if path.suffix.lower() in ENDINGS else path.name)
        with opened(path) as file, inside.open("wb") as target:
            start = file.read(6)
            file.seek(0)
            opener = next((o for magic, o in _OPENERS.items() if start.startswith(magic)), None)
            stream = ZstdStream(file, path.name) if opener is None else opener(file)
            while True:
                try:
                    piece = stream.read(_PIECE)
                except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
                    if not target.tell():
                        raise RecordingError(f"{path.name} is compressed and damaged ({error}).") from error
                    words = "the compressed file is cut short or damaged; what could be read is used."
                    remarks.append(Remark("mended", f"{path.name}: {words}"))
                    break
                if not piece:
                    break
                _write(target, piece, path)
            _write(target, b"", path)
        if not inside.stat().st_size:
            raise RecordingError(f"{path.name} is compressed and holds nothing that could be read.")
        yield inside, remarks
