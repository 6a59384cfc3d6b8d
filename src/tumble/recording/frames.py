"""Data frames of pandas and polars, taken at the border as if they were files."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.formats.parquet import numeric_columns
from tumble.recording.formats.table import RawTable
from tumble.recording.recording import Source

NANOSECONDS = 1e-9


@runtime_checkable
class Frame(Protocol):
    """What a data frame is here: named columns, and a shape."""

    @property
    def columns(self) -> Any:
        """The names of its columns, in order."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        ...


def frame_table(frame: Frame) -> RawTable:
    """Return a data frame as the table that a reader makes of a file.

    Columns of numbers keep their names; dates become seconds of the Unix epoch, durations seconds; what is neither
    is left out. An index of pandas that is more than a row number is the first column.

    Parameters
    ----------
    frame : of pandas or polars.

    Raises
    ------
    RecordingError
        If it is of another library, or holds no column of numbers.
    """
    library = type(frame).__module__.partition(".")[0]
    if library == "polars":
        names, columns = numeric_columns(frame)  # pyright: ignore[reportArgumentType]  # what the name of its library says
    elif library == "pandas":
        names, columns = _pandas_columns(frame)
    else:
        raise RecordingError(
            f"A {type(frame).__name__} of {library} is no recording: give a file, or a data frame of pandas or polars."
        )
    if not columns:
        raise RecordingError(f"The data frame of {library} has no column of numbers.")
    digest = hashlib.sha256()
    for name, column in zip(names, columns, strict=True):
        digest.update(f"{name}\n".encode() + np.ascontiguousarray(column).tobytes())
    title = f"{library}.DataFrame"
    return RawTable(Path(title), names, columns, Source(title, digest.hexdigest()))


def frame_names(frame: Frame) -> list[str]:
    """Return the names of a frame's columns, as the header of a file would."""
    return [str(name) for name in frame.columns]


def input_name(one: Path | Frame) -> str:
    """Return what a sentence calls a file or a data frame."""
    return (
        one.name if isinstance(one, Path) else f"The data frame of {type(one).__module__.partition('.')[0]}"
    )


def _pandas_columns(frame: Any) -> tuple[tuple[str, ...], list[Series]]:
    """Return the columns of numbers of a pandas frame, its index first where that is more than a row number."""
    series = [(str(name), frame[name]) for name in frame.columns if frame[name].ndim == 1]
    if type(frame.index).__name__ != "RangeIndex":
        series.insert(0, (str(frame.index.name or "time"), frame.index.to_series()))
    names: list[str] = []
    columns: list[Series] = []
    for name, values in series:
        kind = getattr(values.dtype, "kind", "O")
        if kind in "mM":
            # in ns whatever the frame's own resolution; a missing stamp is NaN
            stamps = np.asarray(values.to_numpy(dtype=f"{kind}8[ns]"))
            column = np.where(np.isnat(stamps), np.nan, stamps.astype(np.int64) * NANOSECONDS)
            name = name if "[" in name or "(" in name else f"{name} [s]"
        elif kind in "iufb":
            column = values.to_numpy(dtype=np.float64, na_value=np.nan)
        else:
            continue
        names.append(name)
        columns.append(np.asarray(column, dtype=np.float64))
    return tuple(names), columns
