"""The file formats that recordings are read from, one module a format.

Each module has `NAME`, `ENDINGS`, `SUMMARY`, ``recognises(head) -> bool`` on the first bytes of a
file, ``read_table(path) -> RawTable`` and, where the format allows it in bounded memory,
``read_table_blocks(path) -> Iterator[RawTable]``. The content decides, never the ending alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from tumble.errors import RecordingError
from tumble.recording.formats import matlab, npy, npz, parquet, text
from tumble.recording.formats.table import RawTable

FORMATS: tuple[ModuleType, ...] = (parquet, npy, npz, matlab, text)
"""All formats, in the order in which they are asked; text recognises almost anything and comes last."""

_BLOCK_ROWS = 500_000


def find_format(path: Path) -> ModuleType:
    """Return the module of the format that a file's content is in.

    Raises
    ------
    RecordingError
        If the file is missing, a folder, unreadable, empty or in no known format.
    """
    try:
        if path.is_dir():
            raise RecordingError(f"{path} is a folder; name the recording's file in it.")
        with path.open("rb") as file:
            head = file.read(4096)
    except FileNotFoundError as error:
        raise RecordingError(f"{path} does not exist.") from error
    except PermissionError as error:
        raise RecordingError(f"{path} cannot be read: permission denied.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}.") from error
    if not head:
        raise RecordingError(f"{path.name} is empty; give a recording with one row a sample.")
    for format_ in FORMATS:
        if format_.recognises(head):
            return format_
    raise RecordingError(
        f"{path.name} is binary in a format that is not known; known are "
        f"{', '.join(f.NAME for f in FORMATS)}. Convert it to CSV (see the formats page)."
    )


def read_table(path: Path) -> RawTable:
    """Read a file of any known format as a table.

    Raises
    ------
    RecordingError
        If the file cannot be read as a table of numbers.
    UsageError
        If an optional library that the format needs is not installed.
    """
    format_ = find_format(path)
    try:
        return format_.read_table(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}.") from error


def read_table_blocks(path: Path) -> Iterator[RawTable]:
    """Read a file of any known format block by block; formats that cannot are read whole first.

    Raises
    ------
    RecordingError
        If the file cannot be read as a table of numbers.
    UsageError
        If an optional library that the format needs is not installed.
    """
    format_ = find_format(path)
    try:
        if hasattr(format_, "read_table_blocks"):
            yield from format_.read_table_blocks(path)
            return
        table = format_.read_table(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}.") from error
    for start in range(0, len(table), _BLOCK_ROWS):
        yield table.cut(start, min(start + _BLOCK_ROWS, len(table)))
