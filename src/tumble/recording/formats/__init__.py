"""The file formats that recordings are read from, one module a format.

Each module has `NAME`, `ENDINGS`, ``recognises(head) -> bool`` on the first bytes of a file,
``read_table(path) -> RawTable`` and, where the format allows it in bounded memory,
``read_table_blocks(path) -> Iterator[RawTable]``. The content decides, never the ending alone.

A module with `recognises` is a format: nothing else names it. Where its first bytes could be another format's too,
`ASKED` says how late it is asked (0 without it): text recognises almost anything, and comes last.

A format of several topics or streams says so by `HAS_TOPICS`; both functions then take their names as a
second argument. One that reads folders has ``recognises_folder(path) -> bool`` and ``source(path)``,
which says what of a folder is read.
"""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import numpy as np

from tumble.errors import RecordingError, UsageError
from tumble.files import opened
from tumble.recording.formats.table import RawTable, hash_file, measurable
from tumble.recording.recording import Source


def _found(room: ModuleType) -> Iterator[ModuleType]:
    """Yield the formats of a room and of the rooms in it."""
    for entry in iter_modules(room.__path__, f"{room.__name__}."):
        module = import_module(entry.name)
        if entry.ispkg:
            yield from _found(module)
        elif hasattr(module, "recognises"):
            yield module


FORMATS: tuple[ModuleType, ...] = tuple(
    sorted(_found(sys.modules[__name__]), key=lambda format_: getattr(format_, "ASKED", 0))
)
"""All formats, in the order in which they are asked."""

HEAD = 4096
"""Bytes at the beginning of a file that tell its format."""

_BLOCK_ROWS = 500_000
_HDF5 = b"\x89HDF\r\n\x1a\n"


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


def find_format(path: Path) -> ModuleType:
    """Return the module of the format that a file's content is in.

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
    for format_ in FORMATS:
        if format_.recognises(head):
            return format_
    raise RecordingError(
        f"{path.name} is binary in a format that is not known; known are "
        f"{', '.join(f.NAME for f in FORMATS)}. Convert it to CSV (see the formats page)."
    )


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


def _format_of_folder(path: Path) -> ModuleType:
    for format_ in FORMATS:
        if hasattr(format_, "recognises_folder") and format_.recognises_folder(path):
            return format_
    raise RecordingError(f"{path} is a folder; name the recording's file in it.")


def _arguments(
    format_: ModuleType, path: Path, topics: Sequence[str]
) -> tuple[Path] | tuple[Path, Sequence[str]]:
    """Return what a format's functions are called with."""
    if getattr(format_, "HAS_TOPICS", False):
        return path, topics
    if topics:
        raise UsageError(
            f"--topic {topics[0]}: {path.name} is {format_.NAME}, which has no topics; leave it out."
        )
    return (path,)


def source_of(path: Path) -> Source:
    """Return the name and the SHA-256 of a recording, a file or a folder.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    if path.is_dir():
        source: Source = find_format(path).source(path)
        return source
    return hash_file(path)


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
    format_ = find_format(path)
    arguments = _arguments(format_, path, topics)
    with _readable(path):
        return measurable(format_.read_table(*arguments))


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
    format_ = find_format(path)
    arguments = _arguments(format_, path, topics)
    if not hasattr(format_, "read_table_blocks"):
        table = read_table(path, topics)
        for start in range(0, len(table), _BLOCK_ROWS):
            yield table.cut(start, min(start + _BLOCK_ROWS, len(table)))
        return
    blocks: Iterator[RawTable] = format_.read_table_blocks(*arguments)
    while True:
        with _readable(path):
            block = next(blocks, None)
            block = None if block is None else measurable(block)
        if block is None:
            return
        yield block
