"""The file formats that recordings are read from: a table of what their files begin with.

The content decides, never the ending alone, and only the format that fits is imported. A row of `FORMATS` names the
module, and in it the function ``(path) -> Iterator[RawTable]``, which yields consecutive blocks, one where the format
cannot be read in bounded memory; it takes the names of topics as a second argument where a format has several. Rows
are asked in their order, so what recognises almost anything comes last.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import RecordingError, UsageError
from tumble.files import lines_of, opened
from tumble.recording.formats.table import BLOCK_ROWS, RawTable, hash_file, joined_tables, measurable
from tumble.recording.samples import Source
from tumble.records import dataclass

HEAD = 4096
"""Bytes at the beginning of a file that tell its format."""

_HEADER = 65536
_MOST_LINES = 50
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ZIP = b"PK\x03\x04"
_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")  # UTF-16 of either order, UTF-8


def _is_npz(head: bytes) -> bool:
    """Whether the first file of a zip archive is NPY, as that of NPZ is."""
    length = int.from_bytes(head[26:28], "little")
    return head.startswith(_ZIP) and len(head) >= 30 and head[30 : 30 + length].endswith(b".npy")


def _is_zip(head: bytes) -> bool:
    return head.startswith(_ZIP) and not _is_npz(head)


def _is_xsens(head: bytes) -> bool:
    return b"\0" not in head and (b"PacketCounter" in head or b"SampleTimeFine" in head)


def _is_labelled(head: bytes) -> bool:
    from tumble.recording.formats.lines import begins_labelled

    return begins_labelled(head)


def _is_text(head: bytes) -> bool:
    plain = b"\0" not in head and sum(b < 9 or 13 < b < 32 for b in head[:1024]) == 0
    return head.startswith(_MARKS) or plain


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : what it is called.
    ending : of its files, usually.
    begins : what its files begin with: one of these, or what the function says of the first bytes.
    module, reads : where it is read, and the function there.
    has_topics : whether the function takes the names of topics or streams, too.
    """

    name: str
    ending: str
    begins: tuple[bytes, ...] | Callable[[bytes], bool]
    module: str
    reads: str = "read_tables"
    has_topics: bool = False

    def fits(self, head: bytes) -> bool:
        """Say whether a file that begins so is of this format."""
        return self.begins(head) if callable(self.begins) else head.startswith(self.begins)

    def function(self, name: str) -> Any:
        """Return a function of the format's module."""
        return getattr(import_module(f"{__name__}.{self.module}"), name)


_PACKED = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b", b"BZh", b"\xfd7zXZ")
_ROS2 = "ROS 2 bag"
_FOLDER = "folder"
FORMATS: tuple[Format, ...] = (
    Format("zip", ".zip", _is_zip, "packed", "read_zip", has_topics=True),
    Format("MCAP", ".mcap", (b"\x89MCAP0\r\n",), "bags.files", has_topics=True),
    Format("ROS 1 bag", ".bag", (b"#ROSBAG V",), "bags.files", has_topics=True),
    Format(_ROS2, ".db3", (b"SQLite format 3\0",), "bags.files", has_topics=True),
    Format("compressed", ".gz", _PACKED, "packed", has_topics=True),
    Format("DataFlash", ".bin", (b"\xa3\x95\x80",), "logs.dataflash", has_topics=True),
    Format("ULog", ".ulg", (b"ULog\x01\x12\x35",), "logs.ulog", has_topics=True),
    Format("MATLAB", ".mat", (b"MATLAB ",), "arrays", "read_matlab"),
    Format("NPY", ".npy", (b"\x93NUMPY",), "arrays", "read_npy"),
    Format("NPZ", ".npz", _is_npz, "arrays", "read_npz"),
    Format("Parquet", ".parquet", (b"PAR1",), "frames"),
    Format("Xsens text", ".txt", _is_xsens, "text", "read_xsens"),
    Format("labelled lines", ".txt", _is_labelled, "labelled", has_topics=True),
    Format("text", ".csv", _is_text, "text"),
    Format(_FOLDER, "", (), "folder", has_topics=True),
)
"""All formats, in the order in which they are asked."""


@contextmanager
def _readable(path: Path) -> Generator[None]:
    """Make one sentence of what a disk says; a damaged file may hold any bits as numbers, which are left out later."""
    try:
        with np.errstate(all="ignore"):
            yield
    except FileNotFoundError as error:
        raise RecordingError(f"{error.filename or path} does not exist.") from error
    except PermissionError as error:
        raise RecordingError(f"{error.filename or path} cannot be read: permission denied.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}.") from error


def find_format(path: Path) -> Format:
    """Return the format that a file's or a folder's content is in.

    Raises
    ------
    RecordingError
        If the file is missing, unreadable, empty, HDF5 or in no known format.
    """
    with _readable(path):
        if path.is_dir():
            return _format_of_folder(path)
        with opened(path) as file:
            head = file.read(HEAD)
    if not head:
        raise RecordingError(f"{path.name} is empty; give a recording with one row a sample.")
    _refuse_hdf5(path.name, head)
    found = next((format_ for format_ in FORMATS if format_.fits(head)), None)
    if found is None:
        raise RecordingError(
            f"{path.name} is binary in a format that is not known; known are "
            f"{', '.join(f.name for f in FORMATS)}. Convert it to CSV (see the formats page)."
        )
    return found


def _refuse_hdf5(name: str, head: bytes) -> None:
    """Refuse HDF5, which begins at 0, 512, 1024, ... bytes, and MATLAB 7.3, which is HDF5 behind a header."""
    matlab = head.startswith(b"MATLAB 7.3")
    if not matlab and not any(head.startswith(_HDF5, at) for at in (0, 512, 1024, 2048)):
        return
    raise RecordingError(
        f"{name} is {'a MATLAB 7.3 file' if matlab else 'HDF5'}, which is not read. "
        f"Save {'it in MATLAB with `save -v7`, or ' if matlab else ''}its arrays from Python (h5py, `numpy.savez`) "
        "as t, acc and gyr, or as a CSV with the columns t,ax,ay,az,gx,gy,gz."
    )


def _format_of_folder(path: Path) -> Format:
    bag = any(p.name.endswith((".db3", ".mcap", ".db3.zstd", ".mcap.zstd")) for p in path.iterdir())
    return next(format_ for format_ in FORMATS if format_.name == (_ROS2 if bag else _FOLDER))


def source_of(path: Path) -> Source:
    """Return the name and the SHA-256 of a recording, a file or a folder.

    Raises
    ------
    RecordingError
        If a file cannot be read.
    """
    with _readable(path):
        if path.is_dir():
            source: Source = find_format(path).function("source")(path)
            return source
        return hash_file(path)


def _tables(path: Path, topics: Sequence[str]) -> Iterator[RawTable]:
    """Yield the tables that a file is read as."""
    format_ = find_format(path)
    if topics and not format_.has_topics:
        raise UsageError(
            f"--topic {topics[0]}: {path.name} is {format_.name}, which has no topics; leave it out."
        )
    arguments = (path, topics) if format_.has_topics else (path,)
    tables: Iterator[RawTable] = format_.function(format_.reads)(*arguments)
    while True:
        with _readable(path):
            table = next(tables, None)
        if table is None:
            return
        yield table


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read a file of any known format as a table.

    Parameters
    ----------
    path : the file.
    topics : names of the topics or streams to read, for formats that have several.

    Raises
    ------
    RecordingError
        If the file cannot be read as a table of numbers.
    UsageError
        If an optional library that the format needs is not installed, or a topic is not there.
    """
    tables = list(_tables(path, topics))
    if not tables:
        raise RecordingError(f"{path.name} has no rows.")
    with np.errstate(all="ignore"):
        return measurable(joined_tables(tables))


def read_table_blocks(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a file of any known format block by block; formats that cannot are read whole first.

    Parameters
    ----------
    path, topics : as for `read_table`.

    Raises
    ------
    RecordingError
        If the file cannot be read as a table of numbers.
    UsageError
        If an optional library that the format needs is not installed, or a topic is not there.
    """
    for table in _tables(path, topics):
        for start in range(0, len(table), BLOCK_ROWS):
            with np.errstate(all="ignore"):
                block = measurable(table.cut(start, min(start + BLOCK_ROWS, len(table))))
            yield block


def header_names(path: Path) -> list[str]:
    """Return the names that stand at the head of a text file, or of the columns of a Parquet file.

    Of any other format, and of a file that cannot be read, none: reading it says what is wrong.
    """
    import gzip
    import zlib

    from tumble.recording.formats.frames import read_names

    try:
        with opened(path) as file:
            head = file.read(_HEADER)
        if head.startswith(b"PAR1"):
            return read_names(path)
        if head.startswith(b"\x1f\x8b"):
            with gzip.open(path) as file:
                head = file.read(_HEADER)
    except (OSError, EOFError, zlib.error):
        return []
    if b"\0" in head:
        return []
    lines = lines_of(head.decode("utf-8", errors="replace"))[:_MOST_LINES]
    cells = [cell.strip().strip('"').strip() for line in lines for cell in re.split(r"[,;\t]", line)]
    return [cell for cell in cells if re.match(r"[A-Za-z]", cell)]
