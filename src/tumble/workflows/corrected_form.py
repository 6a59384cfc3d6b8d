"""What a corrected recording is written as: by the name of the output, else as the input is."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tumble.errors import RecordingError, UsageError
from tumble.recording.formats.folder import euroc_file
from tumble.recording.formats.hdf5_writing import ENDINGS as HDF5
from tumble.recording.formats.output import ENDINGS as TABLES
from tumble.recording.rewriting.rewritable import ENDINGS as BAGS
from tumble.recording.rewriting.rewritable import ending_of

Form = Literal["table", "bag", "euroc", "hdf5"]

_LOGS = {
    ".ulg": ("ULog", "PX4", "px4", "CAL_ACC* and CAL_GYRO*"),
    ".ulog": ("ULog", "PX4", "px4", "CAL_ACC* and CAL_GYRO*"),
    ".bin": ("DataFlash", "ArduPilot", "ardupilot", "INS_ACC* and INS_GYR*"),
    ".log": ("DataFlash", "ArduPilot", "ardupilot", "INS_ACC* and INS_GYR*"),
    ".tlog": ("MAVLink", "ArduPilot", "ardupilot", "INS_ACC* and INS_GYR*"),
}


@dataclass(frozen=True, slots=True)
class Destination:
    """Where a corrected recording goes, and in which form."""

    form: Form
    path: Path


def destination(output: str | os.PathLike[str] | None, files: Sequence[Path]) -> Destination:
    """Return where a corrected recording goes.

    Parameters
    ----------
    output : as the user names it, or None for a name and a form after the first file.
    files : of the recording.

    Raises
    ------
    UsageError
        If the form cannot be written, or not from this input.
    """
    if output is None:
        return _after(files)
    target = Path(output)
    ending = target.suffix.lower()
    if ending in TABLES:
        return Destination("table", target)
    if ending in HDF5:
        return Destination("hdf5", target)
    if ending in _LOGS:
        raise UsageError(_no_log(target.name, *_LOGS[ending]))
    if ending in BAGS:
        return Destination("bag", _checked_bag(target, files))
    if len(files) == 1 and ending_of(files[0]) == "":
        return Destination("bag", target)
    if not ending or target.is_dir():
        return Destination("euroc", target)
    raise UsageError(
        f"{target.name}: a corrected recording is written as .csv or .parquet, or as .h5. A bag is written as a bag of "
        "its kind (.bag, .mcap, .db3, a folder). A name without an ending gets a folder like EuRoC's."
    )


def _after(files: Sequence[Path]) -> Destination:
    """Return name and form after the input."""
    first = files[0]
    if len(files) == 1:
        ending = ending_of(first)
        if ending is not None:
            name = first.resolve().name if not ending else first.stem
            return Destination("bag", Path(f"{name}-corrected{ending}"))
        if first.is_dir() and euroc_file(first) is not None:
            return Destination("euroc", Path(f"{first.resolve().name}-corrected"))
        if first.suffix.lower() in HDF5:
            return Destination("hdf5", Path(f"{first.stem}-corrected.h5"))
        if first.suffix.lower() in (".parquet", ".pq"):
            return Destination("table", Path(f"{first.stem}-corrected.parquet"))
    return Destination("table", Path(f"{first.stem}-corrected.csv"))


def _no_log(name: str, log: str, autopilot: str, target: str, parameters: str) -> str:
    return (
        f"{name}: a {log} log is not written, for it also holds what the autopilot's filters made of the uncorrected "
        f"samples. Let {autopilot} correct them: `tumble convert CALIBRATION --to {target}` gives the parameters to "
        f"set ({parameters}); for other programs write .csv, .parquet or .h5."
    )


def _checked_bag(target: Path, files: Sequence[Path]) -> Path:
    """Return the place of a bag that is a copy of a bag of the same kind."""
    for file in files:
        if not file.exists():
            raise RecordingError(f"{file} does not exist.")
    found = ending_of(files[0]) if len(files) == 1 else None
    if found == target.suffix.lower():
        return target
    if found == "":
        raise UsageError(
            f"{target.name}: {files[0].name} is the folder of a ROS 2 bag, and its copy is a folder too: give a name "
            "without .mcap or .db3."
        )
    if found is not None:
        raise UsageError(
            f"{target.name}: a corrected bag is a copy of the bag, here of a {found}: give -o NAME{found}, and convert "
            "that (rosbags-convert, mcap convert)."
        )
    raise UsageError(
        f"{target.name}: a corrected bag is a copy of a bag, and {files[0].name} is none. Write .csv, .parquet or .h5, "
        "or a folder like EuRoC's (a name without an ending), which kalibr_bagcreater takes."
    )
