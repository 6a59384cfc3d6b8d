"""Parquet, read by polars, whole or a slice of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.formats.table import RawTable, hash_file
from tumble.recording.recording import Source

if TYPE_CHECKING:
    import polars as pl

NAME = "Parquet"
ENDINGS = (".parquet", ".pq")
SUMMARY = "Parquet with one column a channel"


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is Parquet."""
    return head.startswith(b"PAR1")


def numeric_columns(frame: pl.DataFrame) -> tuple[tuple[str, ...], list[Series]]:
    """Return the columns of numbers; dates become seconds of the Unix epoch."""
    import polars as pl

    names: list[str] = []
    columns: list[Series] = []
    for series in frame.iter_columns():
        if series.dtype.is_temporal():
            series = series.cast(pl.Datetime("ns")).dt.epoch("ns").cast(pl.Float64) * 1e-9
        elif not (series.dtype.is_numeric() or series.dtype == pl.Boolean):
            continue
        names.append(series.name)
        columns.append(np.asarray(series.cast(pl.Float64).to_numpy(), dtype=np.float64))
    return tuple(names), columns


def read_table(path: Path) -> RawTable:
    """Read a Parquet file whole.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no column of numbers.
    OSError
        If the file cannot be read.
    """
    import polars as pl

    try:
        names, columns = numeric_columns(pl.read_parquet(path))
    except pl.exceptions.PolarsError as error:
        raise _damaged(path, error) from error
    _need_columns(path, columns)
    return RawTable(path, names, columns, hash_file(path))


def read_table_blocks(path: Path, rows: int = 500_000) -> Iterator[RawTable]:
    """Read a Parquet file `rows` rows at a time (without SHA-256).

    Raises
    ------
    RecordingError
        If the file is damaged or holds no column of numbers.
    OSError
        If the file cannot be read.
    """
    import polars as pl

    start = 0
    lazy = pl.scan_parquet(path)
    try:
        total = int(lazy.select(pl.len()).collect().item())
        while start < total:
            names, columns = numeric_columns(lazy.slice(start, rows).collect())
            _need_columns(path, columns)
            yield RawTable(
                path, names, columns, Source(path.name, ""), place=lambda row, at=start: f"row {at + row + 1}"
            )
            start += rows
    except pl.exceptions.PolarsError as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{path.name} is a damaged Parquet file ({str(error).splitlines()[0][:120]}).")


def _need_columns(path: Path, columns: list[Series]) -> None:
    if not columns:
        raise RecordingError(f"{path.name} has no column of numbers.")
