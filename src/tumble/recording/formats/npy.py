"""NPY: one array, mapped from the disk; a structured array brings its names along."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.errors import RecordingError
from tumble.recording.formats.damage import foreign
from tumble.recording.formats.table import RawTable, as_columns, hash_file
from tumble.recording.recording import Source

NAME = "NPY"
ENDINGS = (".npy",)


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is NPY."""
    return head.startswith(b"\x93NUMPY")


def _mapped(path: Path) -> tuple[tuple[str, ...] | None, npt.NDArray[Any]]:
    with foreign(path, "NPY file"):
        array: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    if array.dtype.names:
        return array.dtype.names, array
    if array.ndim != 2 or array.dtype.kind not in "iufb":
        raise RecordingError(
            f"{path.name} holds an array of shape {array.shape} and type {array.dtype}; "
            "give numbers with one row a sample and one column a channel."
        )
    return None, array.T if array.shape[0] < 12 < array.shape[1] else array


def _table(path: Path, names: tuple[str, ...] | None, rows: npt.NDArray[Any], source: Source) -> RawTable:
    if names is None:
        return RawTable(path, None, as_columns(np.asarray(rows, dtype=np.float64)), source)
    with foreign(path, "NPY file"):
        columns = [np.asarray(rows[n], dtype=np.float64).reshape(len(rows)) for n in names]
    return RawTable(path, names, columns, source)


def read_table(path: Path) -> RawTable:
    """Read an NPY file whole.

    Raises
    ------
    RecordingError
        If the array is not a table of numbers.
    OSError
        If the file cannot be read.
    """
    names, array = _mapped(path)
    return _table(path, names, array, hash_file(path))


def read_table_blocks(path: Path, rows: int = 500_000) -> Iterator[RawTable]:
    """Read an NPY file `rows` rows at a time from its memory map (without SHA-256).

    Raises
    ------
    RecordingError
        If the array is not a table of numbers.
    OSError
        If the file cannot be read.
    """
    names, array = _mapped(path)
    for start in range(0, len(array), rows):
        table = _table(path, names, array[start : start + rows], Source(path.name, ""))
        table.place = lambda row, at=start: f"row {at + row + 1}"
        yield table
