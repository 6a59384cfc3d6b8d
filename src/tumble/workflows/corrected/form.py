"""What a corrected recording is written as; its magnetic field and its lag, which are corrected block by block.

The form is that of the name of the output, else that of the input. Where a calibration found a lag between the triads,
specific force is put to the instants of the gyro's samples. A sample of the accelerometer with the stamp t is of the
instant t - lag, so that what belongs to the gyro's sample there is the specific force with the stamp t + lag. It is
interpolated between two samples.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Literal

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.document import Calibration
from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording
from tumble.recording.formats.folder import euroc_file
from tumble.recording.formats.output import ENDINGS as TABLES
from tumble.recording.rewriting import ENDINGS as BAGS
from tumble.recording.rewriting import ending_of
from tumble.recording.samples import MagneticField, joined_fields
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


LAG = "lag of the accelerometer behind the gyro"
"""The name of the parameter in a calibration."""
_GAP = 2.5  # median steps between two samples, above which nothing is interpolated between them
_LONGEST = 1.0  # s
NEEDS_BOTH = (
    "--shift-lag puts the accelerometer on the gyro's clock: it takes a recording and a calibration of both."
)


def lag_of(calibration: Calibration) -> float:
    """Return the lag that a calibration found, in seconds.

    Raises
    ------
    UsageError
        If it found none.
    """
    found = [p.value for p in calibration.parameters if p.name == LAG]
    if not found:
        raise UsageError(
            "The calibration states no lag between the triads (it found none that differs from zero): leave "
            "--shift-lag out."
        )
    if abs(found[0]) > _LONGEST:
        raise UsageError(
            f"The calibration states a lag of {found[0]:.3g} s between the triads, which no unit has."
        )
    return found[0]


class ForceShift:
    """Specific force on its way to other instants, block after block.

    Attributes
    ----------
    lag : s, of the accelerometer behind the gyro.
    kept : number of samples so far at an end or a gap, which keep the specific force of the sample nearest in time.
    """

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self.kept = 0
        self._time: Series = np.empty(0, np.float64)
        self._force: Vectors = np.empty((0, 3), np.float64)
        self._answered = 0
        self._step: float | None = None

    def add(self, time: Series, force: Vectors) -> Vectors:
        """Take in the next samples; return the specific force that belongs to those that can be answered by now.

        Parameters
        ----------
        time, force : (n,) s and (n, 3).

        Raises
        ------
        RecordingError
            If stamps do not grow.
        """
        self._time = np.concatenate([self._time, time])
        self._force = np.concatenate([self._force, force])
        if self._time.size > 1 and bool(np.any(np.diff(self._time) <= 0.0)):
            raise RecordingError(
                "The stamps repeat or step back, and --shift-lag interpolates between them: cut the recording there, "
                "or leave --shift-lag out."
            )
        if self._time.size < 2:
            return np.empty((0, 3))
        wanted = self._time[self._answered :] + self.lag
        return self._answer(int(np.searchsorted(wanted, float(self._time[-1]), side="right")))

    def rest(self) -> Vectors:
        """Return the specific force that belongs to the samples that wait: at the end the last one."""
        return self._answer(self._time.size - self._answered)

    def _answer(self, count: int) -> Vectors:
        time, force = self._time, self._force
        at = time[self._answered : self._answered + count] + self.lag
        if not count or time.size < 2:
            self.kept += count
            answer = force[self._answered : self._answered + count]
        else:
            steps: Series = np.diff(time)
            self._step = self._step or float(np.median(steps))
            left = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
            width = time[left + 1] - time[left]
            share = np.clip((at - time[left]) / width, 0.0, 1.0)
            outside = (at < time[0]) | (at > time[-1])
            apart = outside | ((width > _GAP * self._step) & (share > 0.0) & (share < 1.0))
            self.kept += int(apart.sum())
            share = np.where(apart, np.round(share), share)[:, None]
            answer = force[left] + share * (force[left + 1] - force[left])
        self._answered += count
        # What lies before the next instant is not asked for any more.
        next_one = float(time[min(self._answered, time.size - 1)]) + min(self.lag, 0.0)
        first = int(np.searchsorted(time, next_one, side="right")) - 1
        first = max(min(first, self._answered), 0)
        self._time, self._force, self._answered = time[first:], force[first:], self._answered - first
        return answer

    def remarks(self) -> list[str]:
        """Say what was done."""
        way = "later" if self.lag > 0.0 else "earlier"
        words = "by which the calibration found that it lags behind the angular rate; stamps are the gyro's"
        told = [f"The specific force is taken {abs(1e3 * self.lag):.3g} ms {way}, {words}."]
        if self.kept:
            told.append(
                f"{self.kept} sample(s) at an end or a gap keep the specific force of the sample nearest in time."
            )
        return told


def shifted(blocks: Iterable[Recording], shift: ForceShift) -> Iterator[Recording]:
    """Yield corrected blocks with their specific force shifted.

    Parameters
    ----------
    blocks : with both triads.
    shift : for one recording.

    Raises
    ------
    UsageError
        If a triad is missing.
    """
    held: Recording | None = None
    for block in blocks:
        if block.specific_force is None or block.angular_rate is None:
            raise UsageError(NEEDS_BOTH)
        held = block if held is None else _joined(held, block)
        force = shift.add(block.time, block.specific_force)
        if len(force):
            yield replace(held.between(0, len(force)), specific_force=force)
        held = held.between(len(force), len(held)) if len(force) < len(held) else None
    if held is not None:
        yield replace(held, specific_force=shift.rest())


def _joined(first: Recording, second: Recording) -> Recording:
    """Return two consecutive blocks as one."""
    joined = {
        f.name: np.concatenate([getattr(first, f.name), getattr(second, f.name)])
        for f in fields(Recording)
        if isinstance(getattr(first, f.name), np.ndarray)
    }
    magnetic: list[MagneticField | None] = [
        m for m in (first.magnetic_field, second.magnetic_field) if m is not None
    ]
    return replace(first, gaps=(), magnetic_field=joined_fields(magnetic), **joined)
