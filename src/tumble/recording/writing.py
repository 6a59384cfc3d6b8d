"""Writing a recording as CSV or Parquet: raw numbers, their units in the names of the columns."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tumble.errors import OutputError
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
    from tumble.recording.formats.output import write_blocks

    write_blocks([recording], target)
    return target
