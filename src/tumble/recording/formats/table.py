"""What a format hands over: columns of numbers with their names, before anyone says what they are."""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import field as made, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.counting import counted
from tumble.errors import RecordingError, TumbleError
from tumble.files import opened, shown, size_of
from tumble.recording.samples import MagneticField, Remark, Source
from tumble.recording.stamps import Known
from tumble.records import dataclass

_LARGEST, _SMALLEST = 1e19, 1e-30
_HASHED = 1 << 20  # bytes at a time
BLOCK_ROWS = 500_000
"""Rows of a block of a recording that is read in bounded memory."""


def row_words(row: int, start: int = 0) -> str:
    """Return a row's number, from 1, in words; the rows of a later piece begin with `start`."""
    return f"row {start + row + 1}"


@dataclass
class RawTable:
    """Columns of equal length as a file holds them.

    Attributes
    ----------
    path : the file.
    names : one name a column, or None where the file names nothing.
    columns : one array of float64 a column; missing cells are NaN.
    remarks : what the format noticed or mended.
    place : turns a row number (from 0) into words, "line 17" for text, "row 15" otherwise.
    rate : sampling rate in Hz if the file states one.
    judged : whether the units in the names were judged when tumble wrote the file.
    field : the magnetometer's samples where they have stamps of their own; the first column is time then.
    clock : what the kind of file says of the clock, see `tumble.recording.stamps.clock_of_stamps`.
    topic : of a bag that one topic alone was read of.
    """

    path: Path
    names: tuple[str, ...] | None
    columns: list[Series]
    remarks: list[Remark] = made(default_factory=list[Remark])
    place: Callable[[int], str] = row_words
    rate: float | None = None
    judged: bool = False
    field: MagneticField | None = None
    clock: Known = None
    topic: str | None = None

    def __len__(self) -> int:
        return int(self.columns[0].shape[0]) if self.columns else 0

    def column_name(self, index: int) -> str:
        """Return a column's name in quotes, or its number from 1."""
        return f"column {index + 1}" if self.names is None else f"column {self.names[index]!r}"

    def cut(self, start: int, stop: int) -> RawTable:
        """Return rows `start` up to `stop` as a table (views, no copies), with all of the magnetometer beside it."""

        def moved(row: int) -> str:
            return self.place(row + start)

        columns = [column[start:stop] for column in self.columns]
        return replace(self, columns=columns, place=moved)


def joined_tables(tables: Sequence[RawTable]) -> RawTable:
    """Return consecutive tables of one file as one, with what is said of each.

    Parameters
    ----------
    tables : one at least.
    """
    first = tables[0]
    if len(tables) == 1:
        return first
    columns = [np.concatenate(parts) for parts in zip(*(t.columns for t in tables), strict=True)]
    remarks = list(dict.fromkeys(remark for table in tables for remark in table.remarks))
    return replace(first, columns=columns, remarks=remarks)


def measurable(table: RawTable) -> RawTable:
    """Return a table in which numbers that no sensor gives, beyond 1e19, are none, and columns below 1e-30 are zero.

    A counter of 64 bits and nanoseconds since 1970 stay below; squares of what is beyond are no 32-bit floats, in which
    the roughness of a recording is kept.
    """
    for number, column in enumerate(table.columns):
        if not column.size:
            continue
        # NaN makes the comparison false; the slow way then looks at each number.
        low, high = float(column.min()), float(column.max())
        if -_LARGEST <= low <= high <= _LARGEST and max(high, -low) >= _SMALLEST:
            continue
        # A NaN of the file's own may be a signalling one, of which numpy would warn.
        size = np.where(np.isnan(column), np.nan, np.abs(column))
        sound = np.where(size <= _LARGEST, column, np.nan)
        table.columns[number] = sound if np.any(size >= _SMALLEST) else 0.0 * sound
    return table


def hash_file(path: Path) -> Source:
    """Return a file's name and SHA-256.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    digest = hashlib.sha256()
    with opened(path) as file:
        for piece in counted(iter(lambda: file.read(_HASHED), b""), size_of(path), len):
            digest.update(piece)
    return Source(shown(path.name), digest.hexdigest())


def mapped(path: Path) -> mmap.mmap:
    """Return a file's bytes, mapped from the disk; the map is closed when nothing refers to it any more.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with opened(path) as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def hash_files(path: Path, parts: Sequence[Path]) -> Source:
    """Return a folder's name, and one SHA-256 over the names and SHA-256 of its files.

    Parameters
    ----------
    path : the folder.
    parts : its files that are read, in order.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    digest = hashlib.sha256()
    for part in parts:
        digest.update(
            f"{hash_file(part).sha256}  {part.relative_to(path).as_posix()}\n".encode(
                errors="surrogateescape"
            )
        )
    return Source(shown(path.name), digest.hexdigest())


def as_columns(matrix: npt.NDArray[np.float64]) -> list[Series]:
    """Return the columns of a (rows, columns) array as views."""
    return [matrix[:, i] for i in range(matrix.shape[1])]


@contextmanager
def foreign(path: Path, format_: str, mend: str = "") -> Generator[None]:
    """Run a library's reader: whatever it makes of a damaged file is one sentence.

    Parameters
    ----------
    path : of the file.
    format_ : what it should be.
    mend : what mends a damaged one, as a sentence without its point.

    Raises
    ------
    RecordingError
        If the library fails, in whichever way.
    """
    try:
        yield
    except TumbleError:
        raise
    except MemoryError as error:
        raise RecordingError(
            f"{path.name} is a damaged or too large {format_}: what it says that it holds does not fit into memory."
        ) from error
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the disk's; bz2 has one without a number for damaged bytes
        words = " ".join(str(error).split())[:80].rstrip(".") or type(error).__name__
        more = f" {mend}." if mend else ""
        raise RecordingError(f"{path.name} is a damaged or unsupported {format_} ({words}).{more}") from error
