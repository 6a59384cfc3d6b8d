"""Parquet, whole or a slice of rows at a time, and data frames of polars and pandas as if they were files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.formats.table import BLOCK_ROWS, RawTable, row_words
from tumble.recording.samples import Source

if TYPE_CHECKING:
    import polars as pl
import hashlib
from typing import Protocol, runtime_checkable

UNITS_KEY = "tumble.units"
"""Key of the file's metadata under which tumble notes the units, by column, that it has judged."""


def numeric_columns(frame: pl.DataFrame) -> tuple[tuple[str, ...], list[Series]]:
    """Return the columns of numbers; dates become seconds of the Unix epoch, durations and times of day seconds."""
    import polars as pl

    names: list[str] = []
    columns: list[Series] = []
    for series in frame.iter_columns():
        name, seconds = series.name, _in_seconds(series)
        if seconds is not None:
            series, name = seconds, name if "[" in name or "(" in name else f"{name} [s]"
        elif not (series.dtype.is_numeric() or series.dtype == pl.Boolean):
            continue
        names.append(name)
        columns.append(np.asarray(series.cast(pl.Float64).to_numpy(), dtype=np.float64))
    return tuple(names), columns


def _in_seconds(series: pl.Series) -> pl.Series | None:
    """Return dates, durations and times of day in seconds, None of any other column."""
    import polars as pl

    if series.dtype == pl.Duration:
        return series.dt.total_nanoseconds().cast(pl.Float64) * 1e-9
    if series.dtype == pl.Time:
        return series.cast(pl.Int64).cast(pl.Float64) * 1e-9
    if series.dtype.is_temporal():
        return series.cast(pl.Datetime("ns")).dt.epoch("ns").cast(pl.Float64) * 1e-9
    return None


def _noted_units(path: Path) -> dict[str, str]:
    """Return the units by column as tumble noted them, of a file of others none."""
    import polars as pl

    try:
        units: Any = json.loads(pl.read_parquet_metadata(path).get(UNITS_KEY, "{}"))
    except (ValueError, RecursionError):
        return {}
    by_column = cast("dict[Any, Any]", units) if isinstance(units, dict) else {}
    return {str(column): str(unit) for column, unit in by_column.items()}


def read_names(path: Path) -> list[str]:
    """Return the names of the columns; of a damaged file none."""
    import polars as pl

    try:
        return list(pl.read_parquet_schema(path))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return []


def read_tables(path: Path, rows: int = BLOCK_ROWS) -> Iterator[RawTable]:
    """Read a Parquet file `rows` rows at a time.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no column of numbers.
    OSError
        If the file cannot be read.
    """
    import polars as pl

    start = 0
    try:
        units, lazy = _noted_units(path), pl.scan_parquet(path)
        total = int(lazy.select(pl.len()).collect().item())
        while start < total:
            names, columns = numeric_columns(lazy.slice(start, rows).collect())
            if not columns:
                raise RecordingError(f"{path.name} has no column of numbers.")
            noted = tuple(f"{n} [{units[n]}]" if n in units and "[" not in n else n for n in names)
            words = partial(row_words, start=start)
            yield RawTable(path, noted, columns, place=words, judged=bool(units))
            start += rows
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        words = str(error).splitlines()[0][:120]
        raise RecordingError(f"{path.name} is a damaged Parquet file ({words}).") from error


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
    """Return a data frame as the table that a reader makes of a file; `frame_source` is where it is from.

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
    return RawTable(Path(f"{library}.DataFrame"), names, columns)


def frame_source(frame: Frame) -> Source:
    """Return the name of a data frame's kind, and the SHA-256 of its columns."""
    table, digest = frame_table(frame), hashlib.sha256()
    for name, column in zip(table.names or (), table.columns, strict=True):
        digest.update(f"{name}\n".encode() + np.ascontiguousarray(column).tobytes())
    return Source(table.path.name, digest.hexdigest())


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
