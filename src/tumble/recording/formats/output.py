"""Writing recordings as CSV or Parquet, whole or block by block in bounded memory."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tumble.arrays import Series
from tumble.counting import counted
from tumble.errors import OutputError, UsageError
from tumble.files import written_beside
from tumble.recording.formats.parquet import UNITS_KEY
from tumble.recording.recording import Recording
from tumble.units import COUNTS

if TYPE_CHECKING:
    import polars as pl


ENDINGS = (".csv", ".parquet", ".pq")
_ROWS = 1_000_000  # of a CSV, written at a time


FIELD_STAMPS = "mag_time"
"""Name of the column of the magnetometer's own stamps."""


def data_frame(columns: Mapping[str, Sequence[str] | Sequence[float]]) -> Any:
    """Return a data frame of polars.

    Parameters
    ----------
    columns : by name, of one length.
    """
    import polars as pl

    return pl.DataFrame(dict(columns))


def column_names(recording: Recording, *, all_units: bool = False) -> list[str]:
    """Return the names of the columns that a recording is written with.

    Plain names (``t, ax, …, gz, temperature``) stand for seconds, m/s², rad/s and degrees Celsius;
    any other unit follows in brackets, as in ``ax [g]`` or ``gx [counts]``, and is read back so.

    Parameters
    ----------
    recording : to be written.
    all_units : whether the plain units are written out too, so that nothing is judged anew on reading.
    """
    names = ["t [s]" if all_units else "t"]
    units = (("a", recording.specific_force, recording.specific_force_unit, "m/s^2"),
             ("g", recording.angular_rate, recording.angular_rate_unit, "rad/s"))  # fmt: skip
    for letter, triad, unit, plain in units:
        if triad is not None:
            # A lone or a mixed unit is always written out, so that nothing needs to be guessed on reading.
            tail = "" if unit == plain and not all_units else f" [{unit or COUNTS}]"
            names += [f"{letter}{axis}{tail}" for axis in "xyz"]
    if recording.temperature is not None:
        names.append("temperature [degC]" if all_units else "temperature")
    return names


def _field_columns(recording: Recording, *, stamped: bool) -> dict[str, Series]:
    """Return the magnetometer's samples as columns beside a recording's rows, none without a magnetometer.

    Each sample stands in the row whose stamp is nearest, and its own stamp beside it where the two differ; the other
    rows are not a number. Of several samples nearest to one row the nearest one is written.
    """
    field = recording.magnetic_field
    if field is None:
        return {}
    time, count = recording.time, len(recording)
    after = np.clip(np.searchsorted(time, field.time), 1, max(count - 1, 1))
    before_is_near = field.time - time[after - 1] <= time[min(1, count - 1) :][after - 1] - field.time
    rows = np.where(before_is_near, after - 1, np.minimum(after, count - 1))
    # The nearest of a row's samples comes last, and stays.
    order = np.argsort(-np.abs(field.time - time[rows]), kind="stable")
    values, stamps = np.full((count, 3), np.nan), np.full(count, np.nan)
    values[rows[order]], stamps[rows[order]] = field.values[order], field.time[order]
    columns = {f"m{axis} [{field.unit}]": values[:, i] for i, axis in enumerate("xyz")}
    own = np.isfinite(stamps) & (stamps != time)
    return columns | ({f"{FIELD_STAMPS} [s]": stamps} if own.any() or stamped else {})


def _judged_units(recording: Recording) -> dict[str, str]:
    """Return the unit of each column of a recording, whose reading has judged them."""
    names = column_names(recording)
    known = [("a", recording.specific_force_unit), ("g", recording.angular_rate_unit)]
    return {"t": "s"} | {n: unit or COUNTS for n in names for letter, unit in known if n[0] == letter}


def write_recording(recording: Recording, path: str | os.PathLike[str], *, all_units: bool = False) -> Path:
    """Write a recording as CSV or Parquet, by the ending of `path`, and return the path.

    The numbers are the recording's raw ones with all their digits; rows that reading left out are
    gone, and time is in seconds.

    Parameters
    ----------
    recording, path : what is written, and where to.
    all_units : whether the header of a CSV names the plain units too (Parquet notes them always).

    Raises
    ------
    UsageError
        If the ending is neither ``.csv`` nor ``.parquet``.
    OutputError
        If the file cannot be written; an earlier one is then intact.
    """
    target = Path(path)
    write_blocks([recording], target, all_units=all_units)
    return target


def write_blocks(
    blocks: Iterable[Recording],
    target: Path,
    marks: Sequence[str] = (),
    *,
    all_units: bool = False,
    stamped: bool = False,
) -> None:
    """Write consecutive blocks as one CSV or Parquet file, by the ending of `target`.

    Parameters
    ----------
    blocks, target : pieces of one recording in time order, and the file.
    marks : names of columns that hold the number 1 in every row: what was done to the recording.
    all_units : whether the header of a CSV names the plain units too.
    stamped : whether the magnetometer's own stamps are written in any case, and not only where they are needed.

    Raises
    ------
    UsageError
        If the ending is neither ``.csv`` nor ``.parquet``.
    OutputError
        If the file cannot be written; an earlier one is then intact.
    """
    if target.suffix.lower() not in ENDINGS:
        raise UsageError(f"{target.name}: recordings are written as .csv or .parquet.")
    if not target.parent.is_dir():
        raise OutputError(f"{target} could not be written: the folder {target.parent} does not exist.")
    with written_beside(target) as beside, beside.open("wb") as file:
        if target.suffix.lower() == ".csv":
            for number, block in enumerate(blocks):
                frame = _frame_of(block, marks, all_units=all_units, stamped=stamped)
                pieces = range(0, max(frame.height, 1), _ROWS)
                for first in counted(pieces, len(pieces)) if len(pieces) > 1 else pieces:
                    header = number == 0 and first == 0
                    frame.slice(first, _ROWS).write_csv(file, include_header=header)
        else:
            _write_parquet(blocks, file, target.parent, marks, stamped)
        file.flush()
        os.fsync(file.fileno())


def _frame_of(
    recording: Recording, marks: Sequence[str], *, all_units: bool = False, stamped: bool
) -> pl.DataFrame:
    """Return the recording's columns as a data frame, with a column of ones for each mark."""
    import polars as pl

    columns = [recording.time]
    for triad in (recording.specific_force, recording.angular_rate):
        if triad is not None:
            columns += [triad[:, axis] for axis in range(3)]
    if recording.temperature is not None:
        columns.append(recording.temperature)
    named = dict(zip(column_names(recording, all_units=all_units), columns, strict=True))
    frame = pl.DataFrame(named | _field_columns(recording, stamped=stamped))
    return frame.with_columns([pl.lit(1, dtype=pl.Int8).alias(mark) for mark in marks])


def _write_parquet(
    blocks: Iterable[Recording], file: BinaryIO, folder: Path, marks: Sequence[str], stamped: bool
) -> None:
    """Write parts to a folder beside the target, then join them as a stream."""
    import polars as pl

    with tempfile.TemporaryDirectory(dir=folder, prefix=".tumble-parts-") as parts:
        try:
            units: dict[str, str] = {}
            for number, block in enumerate(blocks):
                units = _judged_units(block)
                part = Path(parts) / f"{number:08d}.parquet"
                _frame_of(block, marks, stamped=stamped).write_parquet(part, compression="lz4")
            # Not compressed, for samples hardly do.
            pl.scan_parquet(str(Path(parts) / "*.parquet")).sink_parquet(
                file, compression="uncompressed", metadata={UNITS_KEY: json.dumps(units)}
            )
        except pl.exceptions.PolarsError as error:  # a full disk arrives as polars' own error
            raise OutputError(f"The Parquet file could not be written to {folder}: {error}.") from error


def write_table(
    path: Path, columns: Mapping[str, Sequence[str | float | None]], numbers: Collection[str]
) -> None:
    """Write columns of texts and numbers as one Parquet file.

    Parameters
    ----------
    path : of the file.
    columns : by name, equally long; None is a missing number.
    numbers : names of the columns of numbers.

    Raises
    ------
    OutputError
        If the file cannot be written; an earlier one is then intact.
    """
    import polars as pl

    kinds = {name: pl.Float64 if name in numbers else pl.String for name in columns}
    frame = pl.DataFrame(dict(columns), schema=kinds)
    with written_beside(path) as beside, beside.open("wb") as file:
        frame.write_parquet(file)
        file.flush()
        os.fsync(file.fileno())
