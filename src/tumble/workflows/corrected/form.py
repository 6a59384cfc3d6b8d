"""What a corrected recording is written as, and its magnetic field, which is corrected block by block.

The form is that of the name of the output, else that of the input.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from tumble.document import Calibration
from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording
from tumble.recording.formats.folder import euroc_file
from tumble.recording.formats.output import ENDINGS as TABLES
from tumble.recording.rewriting import ENDINGS as BAGS
from tumble.recording.rewriting import ending_of
from tumble.recording.samples import MagneticField
from tumble.records import dataclass
from tumble.units import COUNTS, MICROTESLA, magnetic_field_factor


def corrects_field(document: Calibration, recording: Recording) -> bool:
    """Return whether a calibration corrects the magnetometer of a recording.

    Parameters
    ----------
    document, recording : as read.
    """
    block = document.magnetometer
    return recording.magnetic_field is not None and block is not None and block.triad is not None


@dataclass(frozen=True, slots=True)
class CorrectedField:
    """How the magnetometer's samples are corrected: in µT, or in units of the local field.

    Attributes
    ----------
    document : what corrects; None where nothing is written of a magnetometer.
    raw : factor of the recording's unit to the calibration's.
    unit : of what is written.
    factor : from the calibration's unit to that.
    remarks : what is to be known of it.
    """

    document: Calibration | None
    raw: float = 1.0
    unit: str = COUNTS
    factor: float = 1.0
    remarks: tuple[str, ...] = ()

    @staticmethod
    def of(document: Calibration, recording: Recording, form: str) -> CorrectedField:
        """Return how a recording's magnetometer is corrected.

        Parameters
        ----------
        document, recording : what corrects, and the first block.
        form : of the file that is written; only a table has columns for it.

        Raises
        ------
        UsageError
            If one is in counts and the other is not.
        """
        field = recording.magnetic_field
        if field is None or form == "bag":
            return CorrectedField(None)
        if not corrects_field(document, recording):
            block = document.magnetometer
            why = (
                "The calibration's magnetometer is not fit for use"
                if block is not None
                else "The calibration has no magnetometer"
            )
            return CorrectedField(None, remarks=(f"{why}: the corrected file has no magnetic field.",))
        if form != "table":
            return CorrectedField(
                None, remarks=("The magnetic field is written to tables (.csv, .parquet) only.",)
            )
        block = document.magnetometer
        assert block is not None
        ours, theirs = magnetic_field_factor(field.unit), magnetic_field_factor(block.raw_unit)
        if (ours is None) != (theirs is None):
            raise UsageError(
                f"The recording's magnetic field is in {field.unit}, and the calibration is for {block.raw_unit}: "
                "declare the recording's units with --units, or use the calibration of this unit and format."
            )
        raw = 1.0 if ours is None or theirs is None else ours / theirs
        if block.unit == "T":
            return CorrectedField(document, raw, "uT", 1.0 / MICROTESLA)
        said = (
            "The corrected magnetic field is in units of the local field: its norm was not given (--field)."
        )
        return CorrectedField(document, raw, remarks=(said,))

    def of_block(self, block: Recording) -> MagneticField | None:
        """Return the corrected samples of a block; none at all are an empty array, so that blocks have one form.

        Parameters
        ----------
        block : as read.
        """
        if self.document is None:
            return None
        field = block.magnetic_field
        if field is None:
            return MagneticField(np.zeros(0), np.zeros((0, 3)), self.unit)
        corrected = self.document.correct_field(self.raw * field.values)
        assert corrected is not None
        return MagneticField(field.time, np.ascontiguousarray(self.factor * corrected), self.unit)


Form = Literal["table", "bag", "euroc"]

_LOGS = {
    ".ulg": ("ULog", "PX4", "px4", "CAL_ACC* and CAL_GYRO*"),
    ".ulog": ("ULog", "PX4", "px4", "CAL_ACC* and CAL_GYRO*"),
    ".bin": ("DataFlash", "ArduPilot", "ardupilot", "INS_ACC* and INS_GYR*"),
    ".log": ("DataFlash", "ArduPilot", "ardupilot", "INS_ACC* and INS_GYR*"),
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
    if ending in _LOGS:
        raise UsageError(_no_log(target.name, *_LOGS[ending]))
    if ending in BAGS:
        return Destination("bag", _checked_bag(target, files))
    if len(files) == 1 and ending_of(files[0]) == "":
        return Destination("bag", target)
    if not ending or target.is_dir():
        return Destination("euroc", target)
    raise UsageError(
        f"{target.name}: a corrected recording is written as .csv or .parquet. A bag is written as a bag of "
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
        if first.suffix.lower() in (".parquet", ".pq"):
            return Destination("table", Path(f"{first.stem}-corrected.parquet"))
    return Destination("table", Path(f"{first.stem}-corrected.csv"))


def _no_log(name: str, log: str, autopilot: str, target: str, parameters: str) -> str:
    return (
        f"{name}: a {log} log is not written, for it also holds what the autopilot's filters made of the uncorrected "
        f"samples. Let {autopilot} correct them: `tumble convert CALIBRATION --to {target}` gives the parameters to "
        f"set ({parameters}); for other programs write .csv or .parquet."
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
        f"{target.name}: a corrected bag is a copy of a bag, and {files[0].name} is none. Write .csv or .parquet, "
        "or a folder like EuRoC's (a name without an ending), which kalibr_bagcreater takes."
    )
