"""Options that several commands share, declared once."""

from __future__ import annotations

from glob import glob
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from tumble.errors import UsageError


def _matched(paths: list[Path] | None) -> list[Path] | None:
    """Put the files that a pattern matches in its place, for shells that leave patterns as they are.

    Raises
    ------
    UsageError
        If a pattern matches no file.
    """
    if not paths:
        return paths
    matched: list[Path] = []
    for path in paths:
        is_pattern = any(c in str(path) for c in "*?[") and not path.exists()
        found = sorted(map(Path, glob(str(path), recursive=True))) if is_pattern else [path]
        if not found:
            raise UsageError(f"No file matches the pattern {path}.")
        matched += found
    return matched


_WHAT = (
    "A recording: a file (CSV, text, Parquet, NPY, MATLAB, HDF5, a ROS bag, MCAP, a flight log, ...), a folder, "
    "or a pair of files with one triad each."
)
Recordings: TypeAlias = Annotated[list[Path], typer.Argument(help=_WHAT, callback=_matched)]
OptionalRecordings: TypeAlias = Annotated[
    list[Path] | None,
    typer.Argument(
        help=f"{_WHAT} None: those that the protocol names.", show_default=False, callback=_matched
    ),
]
ProtocolOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|NAME",
        help="What was done to the unit: a protocol file (YAML), or the name of a protocol, such as six-position.",
    ),
]
Columns: TypeAlias = Annotated[
    str | None,
    typer.Option(help="What the columns are, as t,ax,ay,az,gx,gy,gz; - skips one, -ay reverses one."),
]
Units: TypeAlias = Annotated[
    str | None,
    typer.Option(help="Units as g,deg/s,ms; counts; m/s,rad for increments; degF or K of the temperature."),
]
Rate: TypeAlias = Annotated[
    float | None, typer.Option(help="Sampling rate in Hz, for a file without time stamps.")
]
Topics: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--topic",
        metavar="NAME",
        help="Topic, message or data set of a bag or log; twice for an accelerometer and a gyro apart.",
    ),
]
SiteOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--site",
        help="Where it was recorded, LATITUDE[,HEIGHT] in degrees and metres; gravity is WGS 84's normal gravity.",
    ),
]
Gravity: TypeAlias = Annotated[
    float | None, typer.Option(help="Gravity there in m/s², if a survey knows it better than the latitude.")
]
Intervals: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="A file with start and stop of each hold in seconds, instead of finding the holds."),
]
TemperatureOption: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--temperature",
        metavar="CELSIUS",
        help="Temperature of the whole recording in °C, where it has no column of it.",
    ),
]
OutsideOption: TypeAlias = Annotated[
    str,
    typer.Option(
        "--outside",
        metavar="refuse|hold|extrapolate",
        help="Beyond the calibrated temperatures: refuse, hold the parameters of the span's end, or extrapolate.",
    ),
]
Json: TypeAlias = Annotated[bool, typer.Option("--json", help="Print everything as JSON.")]
Quiet: TypeAlias = Annotated[bool, typer.Option("--quiet", "-q", help="Print the verdict only.")]
Verbose: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Also print what was found and cannot be seen, and seconds by stage."
    ),
]
