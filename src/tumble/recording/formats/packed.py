"""Any format, compressed as a whole with gzip, bzip2, xz or zstd, and folders in a zip archive.

Both are unpacked to a temporary place first. The library for zstd is one of the extra `ros`.
"""

from __future__ import annotations

import bz2
import gzip
import lzma
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from tumble.errors import OutputError, RecordingError, UsageError, install
from tumble.files import opened, temporary_folder
from tumble.recording import formats
from tumble.recording.formats import folder
from tumble.recording.formats.table import RawTable, foreign, row_words
from tumble.recording.samples import Remark

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def needed(name: str, words: str) -> Any:
    """Return a module of the libraries of the extra `ros`.

    Parameters
    ----------
    name : of the module.
    words : what it is needed for, as the beginning of a sentence.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise UsageError(f"{words}; reading it needs {install('ros')}.") from error


def decompress_zstd(data: bytes, file: str) -> bytes:
    """Return the content of zstd data.

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    RecordingError
        If the data is damaged.
    """
    library = needed("zstandard", f"{file} is compressed with zstd")
    try:
        content: bytes = library.ZstdDecompressor().stream_reader(data).read()
    except library.ZstdError as error:
        raise RecordingError(f"{file} is compressed with zstd and damaged ({error}).") from error
    return content


class ZstdStream:
    """A file that is compressed with zstd, frame after frame, as a stream of unpacked bytes."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        """Begin at the file's place.

        Raises
        ------
        UsageError
            If zstandard is not installed; the message names the file and the extra.
        """
        self._file, self._library = file, needed("zstandard", f"{name} is compressed with zstd")
        self._frame: Any = None
        self._waiting = b""

    def read(self, size: int) -> bytes:
        """Return the next unpacked bytes, those of some thousand packed ones, none at the end.

        Raises
        ------
        EOFError
            If the file ends inside a frame, or a frame is damaged.
        """
        while piece := self._waiting or self._file.read(min(size, _PIECE)):
            self._frame = self._frame or self._library.ZstdDecompressor().decompressobj()
            try:
                content: bytes = self._frame.decompress(piece)
            except self._library.ZstdError as error:
                raise EOFError(str(error)) from error
            self._waiting = self._frame.unused_data if self._frame.eof else b""
            self._frame = None if self._frame.eof else self._frame
            if content:
                return content
        if self._frame is not None:
            raise EOFError("the file ends inside a frame")
        return b""


_ENDINGS = (".gz", ".bz2", ".xz", ".zst", ".zstd")

_PIECE = 1 << 13  # bytes; a damaged piece is lost as a whole
_OPENERS: dict[bytes, Callable[[BinaryIO], Any]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ": lzma.open,
}


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a compressed file in blocks, if the format inside can be read so.

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
    rows = 0
    with unpacked(path) as (inside, remarks):
        for table in formats.read_table_blocks(inside, topics):
            # The file inside is gone when somebody asks for the place of a row: it is unpacked again.
            table.path, table.place = path, partial(_place, path, topics, rows)
            rows += len(table)
            table.remarks += remarks
            remarks = []
            yield table


def _place(path: Path, topics: Sequence[str], start: int, row: int) -> str:
    with unpacked(path) as (inside, _):
        return formats.read_table(inside, topics).place(start + row)


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
        inside = folder / (path.stem if path.suffix.lower() in _ENDINGS else path.name)
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


def read_zip(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read the recording in an archive.

    Parameters
    ----------
    path : the archive.
    topics : as for a folder with the same files.

    Raises
    ------
    RecordingError
        If the archive is damaged, or holds no recording or several.
    UsageError
        If a topic is not there.
    OSError
        If the file cannot be read.
    """
    with temporary_folder() as unpacked:
        inside = unpacked / path.name
        with foreign(path, "zip archive"), opened(path) as file, zipfile.ZipFile(file) as archive:
            archive.extractall(inside)
        try:
            tables = list(folder.read_tables(inside, topics))
        except RecordingError as error:
            raise RecordingError(
                str(error).replace(str(inside), path.name).replace("is a folder", "is an archive")
            ) from error
    # The file inside is gone when somebody asks for the place of a row.
    for table in tables:
        table.path, table.place = path, row_words
        yield table
