"""Writing recordings as CSV, Parquet or an EuRoC folder, whole or block by block in bounded memory.

The folder of an IMU in EuRoC's form has `mav0/imu0/data.csv` and `sensor.yaml`.

References
----------
Burri et al. (2016), *The EuRoC micro aerial vehicle datasets*, IJRR 35(10): stamps in ns, angular rate in rad/s,
then specific force in m/s².
"""

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
from tumble.recording.formats.frames import UNITS_KEY
from tumble.recording.recording import Recording
from tumble.units import COUNTS

if TYPE_CHECKING:
    import polars as pl
import re
from itertools import chain

import numpy.typing as npt

from tumble.files import check_target, filled_folder, put_text
from tumble.recording.formats.folder import euroc_file

TABLE_ENDINGS = (".csv", ".parquet", ".pq")
_PLAIN = {"a": "m/s^2", "g": "rad/s"}
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
    for triad in recording.triads:
        # A lone or a mixed unit is always written out, so that nothing needs to be guessed on reading.
        tail = "" if triad.unit == _PLAIN[triad.letter] and not all_units else f" [{triad.unit or COUNTS}]"
        names += [f"{triad.letter}{axis}{tail}" for axis in "xyz"]
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
    units = {triad.letter: triad.unit or COUNTS for triad in recording.triads}
    return {"t": "s"} | {n: units[n[0]] for n in column_names(recording) if n[0] in units}


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
    if target.suffix.lower() not in TABLE_ENDINGS:
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

    columns = [recording.time, *recording.channels.values()]
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


PLACE = Path("mav0", "imu0")
_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)
_MARK = "corrected_by"
_SAID = re.compile(rf"^{_MARK}:\s*\[([0-9a-f, ]*)\]", re.MULTILINE)
_NEAR = 1e-6  # s, by which a stamp of a float may be off the one in ns
_SENSOR = """sensor_type: imu
comment: corrected by tumble
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0,
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
"""


def write_euroc(
    blocks: Iterable[Recording],
    target: Path,
    marks: Sequence[str] = (),
    *,
    like: Path | None = None,
) -> None:
    """Write consecutive blocks as the IMU of an EuRoC folder; other sensors that are there stay.

    Parameters
    ----------
    blocks, target : pieces of one recording in time order with both triads, SI, and the folder.
    marks : identities of the calibrations that the recording went through.
    like : an EuRoC folder, whose stamps and `sensor.yaml` are kept.

    Raises
    ------
    UsageError
        If a triad is missing, or a place is none for a result.
    OutputError
        If it cannot be written; what was there is intact.
    """
    source = None if like is None else euroc_file(like)
    exact = None if source is None else _exact_stamps(source)
    consecutive = iter(blocks)
    first = next(consecutive)
    if first.specific_force is None or first.angular_rate is None:
        raise UsageError(
            "EuRoC's form has both triads in each row, and one is missing here: write .csv or .parquet."
        )
    place = target / PLACE
    for name in ("data.csv", "sensor.yaml"):
        check_target(place / name)
    try:
        with filled_folder(place) as folder:
            with (folder / "data.csv").open("w", encoding="utf-8", newline="\n") as file:
                file.write(_HEADER)
                for block in chain([first], consecutive):
                    _write_rows(file, block, exact)
                file.flush()
                os.fsync(file.fileno())
            put_text(folder / "sensor.yaml", _sensor(source, first.rate, marks))
    except OSError as error:
        raise OutputError(f"{place} could not be written: {error.strerror or error}.") from error


def _write_rows(file: object, block: Recording, exact: npt.NDArray[np.int64] | None) -> None:
    import polars as pl

    assert block.specific_force is not None
    assert block.angular_rate is not None
    columns: dict[str, np.ndarray] = {"t": _nanoseconds(block.time, exact)}
    columns |= {f"w{i}": block.angular_rate[:, i] for i in range(3)}
    columns |= {f"a{i}": block.specific_force[:, i] for i in range(3)}
    pl.DataFrame(columns).write_csv(file, include_header=False)  # pyright: ignore[reportArgumentType, reportCallIssue]


def _exact_stamps(data: Path) -> npt.NDArray[np.int64] | None:
    """Return the stamps of a file in ns, which seconds as a float do not hold; None where they are no whole numbers."""
    import polars as pl

    try:
        texts = pl.scan_csv(data, infer_schema=False, truncate_ragged_lines=True).select(pl.first())
        stamps = texts.cast(pl.Int64, strict=False).collect().to_series().drop_nulls().to_numpy()
    except (pl.exceptions.PolarsError, OSError):
        return None
    return np.sort(stamps.astype(np.int64)) if stamps.size else None


def _nanoseconds(time: Series, exact: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
    """Return stamps in ns: those of the source where they are the same instants."""
    made = np.round(time * 1e9).astype(np.int64)
    if exact is None:
        return made
    after = (
        np.clip(np.searchsorted(exact, made), 1, exact.size - 1) if exact.size > 1 else np.zeros_like(made)
    )
    nearest = np.where(
        np.abs(exact[after] - made) < np.abs(exact[after - 1] - made), exact[after], exact[after - 1]
    )
    return np.where(np.abs(nearest - made) < 1e9 * _NEAR, nearest, made)


def _sensor(source: Path | None, rate: float, marks: Sequence[str]) -> str:
    """Return `sensor.yaml`: that of the source with what changes, or a new one."""
    given = None if source is None else source.with_name("sensor.yaml")
    if given is not None and given.is_file():
        lines = given.read_text("utf-8", errors="replace").splitlines()
    else:
        lines = [*_SENSOR.splitlines(), f"rate_hz: {rate:.6g}"]
    replaced = {_MARK: f"[{', '.join(marks)}]"} if marks else {}
    kept = [line for line in lines if line.partition(":")[0].strip() not in replaced]
    return "\n".join([*kept, *(f"{key}: {value}" for key, value in replaced.items())]) + "\n"


def euroc_corrections(path: Path) -> tuple[str, ...]:
    """Return the identities of the calibrations that an EuRoC folder was corrected by.

    Parameters
    ----------
    path : of the folder, or of its data.csv.
    """
    data = euroc_file(path) if path.is_dir() else path
    if data is None or data.name != "data.csv":
        return ()
    try:
        said = _SAID.search(data.with_name("sensor.yaml").read_text("utf-8", errors="replace"))
    except OSError:
        return ()
    return tuple(said.group(1).replace(",", " ").split()) if said else ()
