"""Parquet, read by polars, whole or a slice of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.files import size_of
from tumble.recording.formats.compression import refuse_unmeasured
from tumble.recording.formats.parquet_plain import Damaged, column_groups, read_footer, read_plain
from tumble.recording.formats.table import RawTable, hash_file
from tumble.recording.recording import Source

if TYPE_CHECKING:
    import polars as pl

NAME = "Parquet"
ENDINGS = (".parquet", ".pq")
SUMMARY = "Parquet with one column a channel"

_GATHERED_ROWS = 65_536  # three columns of so many rows stay in the cache while they are put side by side


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is Parquet."""
    return head.startswith(b"PAR1")


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


def read_table(path: Path) -> RawTable:
    """Read a Parquet file whole.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no column of numbers.
    OSError
        If the file cannot be read.
    """
    with ThreadPoolExecutor(1) as pool:
        hashing = pool.submit(hash_file, path)
        try:
            plain = read_plain(path)
        except Damaged as error:
            raise RecordingError(f"{path.name} is a damaged Parquet file.") from error
        if plain is not None:
            footer, columns = plain
            named = _with_units(footer.names, footer.units)
            return RawTable(path, named, columns, hashing.result(), judged=True)
        import polars as pl

        try:
            footer = read_footer(path)
            refuse_unmeasured(8 * footer.rows * len(footer.names), size_of(path), path.name)
            units, frame = footer.units, pl.read_parquet(path)
            names, columns = _own_columns(frame) if units else numeric_columns(frame)
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise _damaged(path, error) from error
        source = hashing.result()
    _need_columns(path, columns)
    return RawTable(path, _with_units(names, units), columns, source, judged=bool(units))


def _own_columns(frame: pl.DataFrame) -> tuple[tuple[str, ...], list[Series]]:
    """Return the columns of a file of tumble's own, those of a triad as views of one (rows, 3) array."""
    names = tuple(frame.columns)
    groups = column_groups(names)
    blocks = [np.empty((frame.height, len(group))) for group in groups]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(partial(_side_by_side, frame), groups, blocks))
    return names, [block[:, i] for block in blocks for i in range(block.shape[1])]


def _side_by_side(frame: pl.DataFrame, names: Sequence[str], block: npt.NDArray[np.float64]) -> None:
    """Copy columns of a frame into a (rows, columns) array, piece by piece."""
    for start in range(0, frame.height, _GATHERED_ROWS):
        piece = frame.slice(start, _GATHERED_ROWS)
        for j, name in enumerate(names):
            block[start : start + piece.height, j] = piece[name].to_numpy()


def _with_units(names: tuple[str, ...], units: dict[str, str]) -> tuple[str, ...]:
    return tuple(f"{name} [{units[name]}]" if name in units and "[" not in name else name for name in names)


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
    try:
        footer = read_footer(path)
    except Damaged as error:
        raise RecordingError(f"{path.name} is a damaged Parquet file.") from error
    units = footer.units
    refuse_unmeasured(8 * footer.rows * len(footer.names), size_of(path), path.name)
    lazy = pl.scan_parquet(path)
    try:
        total = int(lazy.select(pl.len()).collect().item())
        while start < total:
            names, columns = numeric_columns(lazy.slice(start, rows).collect())
            _need_columns(path, columns)
            yield RawTable(
                path,
                _with_units(names, units),
                columns,
                Source(path.name, ""),
                place=lambda row, at=start: f"row {at + row + 1}",
                judged=bool(units),
            )
            start += rows
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{path.name} is a damaged Parquet file ({str(error).splitlines()[0][:120]}).")


def _need_columns(path: Path, columns: list[Series]) -> None:
    if not columns:
        raise RecordingError(f"{path.name} has no column of numbers.")
