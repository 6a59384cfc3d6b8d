"""Binary files of float64 without a header: time and six numbers a row, as navigation programs keep increments.

Which columns and units there are, such a file does not say: the clock is the first or the last of seven
columns, the rest is found as in a text without names (KF-GINS: time, angles, velocities; PSINS: angles,
velocities, time).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tumble.errors import RecordingError
from tumble.recording.formats.table import RawTable, as_columns, hash_file
from tumble.recording.recording import Remark, Source

NAME = "binary float64"
ENDINGS = (".bin", ".imu", ".dat")
ASKED = 3  # bare numbers have no mark at all
SUMMARY = (
    "binary rows of seven float64 (time and six numbers, or six and time), as KF-GINS and PSINS keep them"
)

_COLUMNS = 7
_ROW = 8 * _COLUMNS
_FEWEST_ROWS = 8
_LARGEST = 1e7  # of any number of such a file: seconds of a week, increments, counts in a float
_BLOCK_ROWS = 500_000


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is rows of seven float64 with a clock in the first or last column."""
    rows = len(head) // _ROW
    return rows >= _FEWEST_ROWS and _has_clock(
        np.frombuffer(head[: rows * _ROW], "<f8").reshape(rows, _COLUMNS)
    )


def _has_clock(rows: npt.NDArray[np.float64]) -> bool:
    """Whether all numbers are ordinary ones and the first or last column grows by nearly equal steps."""
    size = np.abs(rows)
    if not np.all(np.isfinite(rows)) or np.any(size > _LARGEST) or np.any((size < 1e-30) & (size > 0.0)):
        return False
    for column in (rows[:, 0], rows[:, -1]):
        steps = np.diff(column)
        if steps.min() > 0.0 and steps.max() < 10.0 * float(np.median(steps)):
            return True
    return False


def read_table(path: Path) -> RawTable:
    """Read a file whole.

    Raises
    ------
    RecordingError
        If a number of the file is none.
    OSError
        If the file cannot be read.
    """
    rows, remarks = _rows(path)
    table = RawTable(path, None, as_columns(np.array(rows, dtype=np.float64)), hash_file(path), remarks)
    _refuse_foreign(table)
    return table


def read_table_blocks(path: Path) -> Iterator[RawTable]:
    """Read a file in blocks from its memory map (without SHA-256).

    Raises
    ------
    RecordingError
        If a number of the file is none.
    OSError
        If the file cannot be read.
    """
    rows, remarks = _rows(path)
    for start in range(0, len(rows), _BLOCK_ROWS):
        columns = as_columns(np.array(rows[start : start + _BLOCK_ROWS], dtype=np.float64))
        table = RawTable(path, None, columns, Source(path.name, ""), remarks if start == 0 else [])
        _refuse_foreign(table)
        table.place = lambda row, at=start: f"row {at + row + 1}"
        yield table


def _rows(path: Path) -> tuple[npt.NDArray[np.float64], list[Remark]]:
    count, rest = divmod(path.stat().st_size, _ROW)
    remarks = [Remark("found", f"{path.name}: binary, {count} rows of {_COLUMNS} numbers.")]
    if rest:
        remarks.append(Remark("mended", f"{path.name}: the last row is cut short and is left out."))
    return np.memmap(path, "<f8", "r", shape=(count, _COLUMNS)), remarks


def _refuse_foreign(table: RawTable) -> None:
    """Refuse numbers that no such file holds: then it is binary of another kind."""
    for number, column in enumerate(table.columns):
        wrong = ~(np.abs(column) < 1e3 * _LARGEST)
        if np.any(wrong):
            row = int(np.argmax(wrong))
            raise RecordingError(
                f"{table.path.name}, row {row + 1}: column {number + 1} holds {column[row]:.3g}; the file is damaged, "
                f"or no table of {_COLUMNS} float64 a row."
            )
