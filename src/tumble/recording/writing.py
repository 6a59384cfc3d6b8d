"""Writing a recording as CSV or Parquet: raw numbers, their units in the names of the columns."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tumble.errors import OutputError, UsageError
from tumble.recording.recording import Recording
from tumble.units import COUNTS

ENDINGS = (".csv", ".parquet", ".pq")


def column_names(recording: Recording) -> list[str]:
    """Return the names of the columns that a recording is written with.

    Plain names (``t, ax, …, gz, temperature``) stand for seconds, m/s², rad/s and degrees Celsius;
    any other unit follows in brackets, as in ``ax [g]`` or ``gx [counts]``, and is read back so.
    """
    names = ["t"]
    units = (("a", recording.specific_force, recording.specific_force_unit, "m/s^2"),
             ("g", recording.angular_rate, recording.angular_rate_unit, "rad/s"))  # fmt: skip
    for letter, triad, unit, plain in units:
        if triad is not None:
            # A lone or a mixed unit is always written out, so that nothing needs to be guessed on reading.
            tail = "" if unit == plain else f" [{unit or COUNTS}]"
            names += [f"{letter}{axis}{tail}" for axis in "xyz"]
    if recording.temperature is not None:
        names.append("temperature")
    return names


@contextmanager
def written_beside(path: Path) -> Generator[Path, None, None]:
    """Give a path beside `path` to write to; afterwards it takes the place of `path`.

    Raises
    ------
    OutputError
        If the file cannot be written; what stood at `path` is then intact.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield beside
        beside.replace(path)
    except OSError as error:
        raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
    finally:
        beside.unlink(missing_ok=True)


def write_recording(recording: Recording, path: str | os.PathLike[str]) -> Path:
    """Write a recording as CSV or Parquet, by the ending of `path`, and return the path.

    The numbers are the recording's raw ones with all their digits; rows that reading left out are
    gone, and time is in seconds.

    Raises
    ------
    UsageError
        If the ending is neither ``.csv`` nor ``.parquet``.
    OutputError
        If the file cannot be written; an earlier one is then intact.
    """
    target = Path(path)
    if target.suffix.lower() not in ENDINGS:
        raise UsageError(
            f"{target.name}: recordings are saved as .csv or .parquet; choose one of these endings."
        )
    if not target.parent.is_dir():
        raise OutputError(f"{target} could not be written: the folder {target.parent} does not exist.")
    import polars as pl

    columns = [recording.time]
    for triad in (recording.specific_force, recording.angular_rate):
        if triad is not None:
            columns += [triad[:, i] for i in range(3)]
    if recording.temperature is not None:
        columns.append(recording.temperature)
    frame = pl.DataFrame(dict(zip(column_names(recording), columns, strict=True)))
    # A file opened here: errors of the disk then arrive as OSError, not as polars' own.
    with written_beside(target) as beside, beside.open("wb") as file:
        if target.suffix.lower() == ".csv":
            frame.write_csv(file)
        else:
            frame.write_parquet(file)
        file.flush()
        os.fsync(file.fileno())
    return target
