"""What a recording's temperature and the corrections before it mean, and what a corrected recording is written as.

A corrected file has one more column for each calibration that it went through, named
``corrected_by_`` and the twelve digits of the calibration's identity, with the number 1 in every row.
A name in the header outlives copying, cutting, and being read and written by other programs. Bags say it topic by
topic, EuRoC's folders in `sensor.yaml`: columns of their own are not theirs to have.

The form is that of the name of the output, else that of the input. The magnetic field is corrected block by block.

Where a calibration found a lag between the triads, specific force is put to the instants of the gyro's samples. A
sample of the accelerometer with the stamp t is of the instant t - lag, so that what belongs to the gyro's sample there
is the specific force with the stamp t + lag. It is interpolated between two samples.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Literal

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.document import NO_TEMPERATURE, Calibration, Corrector
from tumble.errors import RecordingError, UsageError
from tumble.files import results_folder
from tumble.recording import (
    BAG_ENDINGS,
    LONG_GAP,
    POSSIBLE_CELSIUS,
    TABLE_ENDINGS,
    Frame,
    MagneticField,
    Recording,
    TemperatureColumn,
    corrections,
    ending_of,
    euroc_corrections,
    euroc_file,
    frame_names,
    header_names,
    joined_fields,
    role_of,
)
from tumble.records import dataclass
from tumble.sensor import SPAN_MARGIN, Outside
from tumble.units import COUNTS, MICROTESLA, magnetic_field_factor


@dataclass(frozen=True)
class Correction:
    """How a recording is corrected.

    Attributes
    ----------
    calibration, outside, temperature : as `apply` takes them.
    factors : from the recording's numbers to the calibration's raw units.
    lag : s, of the accelerometer behind the gyro, which is taken out, or None.
    progress : is given the number of samples done.
    """

    calibration: Calibration
    outside: Outside
    temperature: float | None
    factors: tuple[float, float]
    lag: float | None
    progress: Callable[[int], None]


PREFIX = "corrected_by_"
_MARK = re.compile(PREFIX + r"([0-9a-f]{12})$")
# Names of temperature's units in headers that nobody can convert.
_COUNTS = ("counts", "raw", "lsb")


def corrections_of(
    inputs: Iterable[Path | Frame], topics: str | Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return the identities of the calibrations that files or data frames were corrected by, first one first.

    Parameters
    ----------
    inputs : files, folders or data frames.
    topics : of bags, those that are read; None for whichever were corrected.
    """
    found: list[str] = []
    topics = (topics,) if isinstance(topics, str) else topics
    for one in inputs:
        marks = [_MARK.match(name) for name in _names(one)]
        found += [mark.group(1) for mark in marks if mark is not None]
        if isinstance(one, Path):
            found += _marks_beside(one, topics)
    return tuple(dict.fromkeys(found))


def _marks_beside(path: Path, topics: Sequence[str] | None) -> list[str]:
    """Return what formats without columns of their own say."""
    if path.is_dir() or path.name == "data.csv":
        found = euroc_corrections(path)
        if found or not path.is_dir():
            return list(found)
    if not path.is_dir() and path.suffix.lower() not in BAG_ENDINGS:
        return []
    wanted = None if not topics else {t.strip("/") for t in topics}
    said = corrections(path).items()
    return [m for topic, marks in said if wanted is None or topic.strip("/") in wanted for m in marks]


def _names(one: Path | Frame) -> list[str]:
    return header_names(one) if isinstance(one, Path) else frame_names(one)


def temperature_in_counts(inputs: Iterable[Path | Frame]) -> bool:
    """Return whether a header says that the temperature is in raw counts (other units are converted on reading)."""
    for one in inputs:
        for name in _names(one):
            role = role_of(name)
            if role is not None and role[0] == "temperature":
                words = re.split(r"[^a-z°]+", name.lower())
                said = (role[1] or words[-1]).lower().strip()
                return said in _COUNTS
    return False


# Consumer units drift by up to 1 mg and 0.03 °/s in this much (data sheets of 2015 to 2020).
FAR_FROM_CALIBRATION = 5.0  # K
ABSOLUTE_ZERO = -273.15  # °C
# Beyond this without a thermometer a straight line is no temperature: the unit may have been anywhere.
LONGEST_GAP = 600.0  # s


def check_outside(outside: str) -> Outside:
    """Return what to do beyond the calibrated span, from the word for it.

    Raises
    ------
    UsageError
        If it is none of ``refuse``, ``hold`` and ``extrapolate``.
    """
    if outside not in ("refuse", "hold", "extrapolate"):
        raise UsageError(f"--outside {outside}: give refuse, hold or extrapolate.")
    return outside


def refuse_twice(calibration: Calibration, corrected_by: Sequence[str]) -> None:
    """Refuse a recording that was corrected by this calibration, or not by what it takes for granted.

    Parameters
    ----------
    corrected_by : identities of the calibrations that the recording went through.

    Raises
    ------
    UsageError
        If the correction would be applied twice, or one is missing before it.
    """
    own = calibration.identity
    if own in corrected_by:
        raise UsageError(
            f"The recording is corrected by this calibration already (its mark corrected_by_{own} says so): "
            "correcting it again would add the same errors with the other sign. Give the raw recording."
        )
    wanted = list(calibration.input_corrected_by)
    if list(corrected_by) == wanted:
        return
    if wanted and not corrected_by:
        raise UsageError(
            f"The calibration was made on recordings that were corrected by {', '.join(wanted)} before, and this "
            "recording is not: correct it by that calibration first."
        )
    raise UsageError(
        f"The recording was corrected by another calibration ({', '.join(corrected_by)}), and this one takes "
        f"{'recordings corrected by ' + ', '.join(wanted) if wanted else 'raw recordings'}: the same errors would "
        "be taken out twice. Give the raw recording, or calibrate on corrected ones."
    )


def check_temperature(
    calibration: Calibration,
    recording: Recording,
    files: Iterable[Path | Frame],
    stated: float | None,
    outside: Outside,
) -> None:
    """Refuse a recording without temperature, or with one that cannot be in °C, if the calibration knows its own.

    Parameters
    ----------
    recording : its first block, or the whole.
    stated : °C that the user gives for all of it, instead of a column.
    outside : with anything but ``refuse`` the user knows that the temperature is unlike the calibration's, and
        numbers that could be hot or in degrees Fahrenheit are believed.

    Raises
    ------
    UsageError
        If there is no temperature, or one is stated beside a calibration that knows none.
    RecordingError
        If it is in kelvin, degrees Fahrenheit or counts.
    """
    if calibration.thermal is None:
        if stated is not None and calibration.temperature_celsius is None:
            raise UsageError("The calibration does not know its temperature: leave --temperature out.")
        return
    own = recording.temperature
    if stated is not None and own is not None and np.isfinite(own).any():
        raise UsageError(
            f"--temperature {stated:g} is for a recording without a column of temperature; this one has one "
            f"({float(np.nanmin(own)):.4g} to {float(np.nanmax(own)):.4g} °C): leave --temperature out, or skip "
            "the column with - in --columns."
        )
    celsius = np.array([stated]) if stated is not None else own
    if celsius is None:
        raise UsageError(NO_TEMPERATURE)
    known = celsius[np.isfinite(celsius)]
    if not known.size:
        raise UsageError("The temperature holds no number: name another column with --columns.")
    low, high = float(known.min()), float(known.max())
    trusted = stated is not None or outside != "refuse" or recording.temperature_unit is not None
    counts = stated is None and recording.temperature_unit is None and temperature_in_counts(files)
    middle = float(np.median(known))
    scale = "counts" if counts else _scale_of(calibration, middle, low, high, trusted=trusted)
    if scale is not None:
        raise RecordingError(
            f"The temperature ({low:.6g} to {high:.6g}) is in {scale}, as it looks, and the calibration takes degrees "
            f"Celsius: {_advice(scale)}"
        )


def _advice(scale: str) -> str:
    unit = {"kelvin": "K", "degrees Fahrenheit": "degF"}.get(scale)
    if unit is None:
        return "convert the column, or skip it with --columns and give --temperature CELSIUS."
    return (
        f"say so with {unit} among the --units (such as --units m/s^2,rad/s,{unit}), or degC if it is in °C."
    )


def check_column(column: TemperatureColumn) -> list[str]:
    """Return sentences on what a column of temperature lacks, for a calibration that follows it.

    Parameters
    ----------
    column : of the whole recording.

    Raises
    ------
    RecordingError
        If it is missing for so long that nobody knows the temperature, or was never read.
    """
    if not column.samples:
        return []
    seconds = column.longest_gap[0]
    missing = column.missing_words()
    if missing and seconds > LONGEST_GAP:
        raise RecordingError(
            f"{missing}: for more than {LONGEST_GAP / 60:.0f} minutes nobody knows the sensor's temperature. Cut that "
            "part away, or skip the column with --columns and give --temperature CELSIUS for the whole recording."
        )
    if column.is_constant and column.lowest in (0.0, ABSOLUTE_ZERO):
        raise RecordingError(
            f"The temperature is {column.lowest:g} °C in all {column.samples - column.missing} samples: the "
            "thermometer was not read. Skip the column with --columns and give --temperature CELSIUS instead."
        )
    words: list[str] = []
    if missing:
        doubt = ": what it did in between is not known" if seconds > LONG_GAP else ""
        words.append(f"{missing}; there it is taken along a straight line between its neighbours{doubt}.")
    if column.is_constant:
        words.append(
            f"The temperature is {column.lowest:g} °C in all {column.samples - column.missing} "
            f"samples ({column.duration / 60:.3g} min), as if the thermometer had been read once. "
            "Everything was corrected at that temperature, and nothing of warming or cooling. If it "
            "is not so, give the column that was read."
        )
    return words


def about_temperature(
    calibration: Calibration, corrector: Corrector, recorded: tuple[float, float]
) -> list[str]:
    """Return sentences for the user on what temperature does to the corrected recording.

    Parameters
    ----------
    corrector : that has corrected the recording.
    recorded : °C, lowest and highest of the recording; NaN for not known.
    """
    words: list[str] = []
    low, high = recorded
    made_at = calibration.temperature_celsius
    if calibration.thermal is None:
        if made_at is None or not np.isfinite(low):
            return []
        away = max(high - made_at, made_at - low)
        if away > FAR_FROM_CALIBRATION:
            words.append(
                f"The calibration was made at {made_at:.1f} °C and has no thermal model. The "
                f"recording is at {low:.1f} to {high:.1f} °C, up to {away:.1f} K away: its biases and "
                "scale factors will have moved. Calibrate at that temperature, or with `tumble "
                "calibrate --procedure thermal`."
            )
        return words
    thermal = calibration.thermal
    first, last = thermal.span_celsius
    if corrector.coldest < first - SPAN_MARGIN or corrector.warmest > last + SPAN_MARGIN:
        done = "held at the span's ends" if corrector.outside == "hold" else "extrapolated"
        words.append(
            f"The sensor was at {corrector.coldest:.1f} to {corrector.warmest:.1f} °C and was calibrated at "
            f"{first:.1f} to {last:.1f} °C: beyond it the parameters are {done}, with unknown uncertainty."
        )
    largest = thermal.largest_rate
    if largest is not None and corrector.fastest > 2.0 * largest:
        of_rate = thermal.rate_coefficients
        pair = (of_rate.accelerometer_bias, of_rate.gyroscope_bias)
        knows = thermal.lag > 0.0 or any(row is not None and np.any(row) for row in pair)
        told = (
            "what depends on the rate is extrapolated there."
            if knows
            else "it knows neither a lag of the sensor nor what a rate does to the biases, and "
            "corrects as if settled, off by an unknown amount."
        )
        words.append(
            f"The temperature changed by up to {60 * corrector.fastest:.2g} K/min, in the calibration by at most "
            f"{60 * largest:.2g} K/min: {told}"
        )
    return words


def recorded_span(recording: Recording, stated: float | None) -> tuple[float, float]:
    """Return (lowest, highest) recorded temperature, °C, or the stated one twice; NaN for not known."""
    if stated is not None:
        return stated, stated
    celsius = recording.temperature
    if celsius is None or not np.isfinite(celsius).any():
        return float("nan"), float("nan")
    return float(np.nanmin(celsius)), float(np.nanmax(celsius))


def _scale_of(
    calibration: Calibration, middle: float, low: float, high: float, *, trusted: bool
) -> str | None:
    """Return the name of another scale that the numbers must be in, or None."""
    if low < ABSOLUTE_ZERO or high > 1000.0:
        return "counts, or a fraction of a degree"
    assert calibration.thermal is not None
    span = calibration.thermal.span_celsius

    def inside(celsius: float) -> bool:
        return span[0] - 10.0 <= celsius <= span[1] + 10.0

    if inside(middle):
        return None
    if middle > (hottest := POSSIBLE_CELSIUS[1]):
        return "kelvin" if middle + ABSOLUTE_ZERO < hottest else "counts, or a fraction of a degree"
    if not trusted and inside((middle - 32.0) / 1.8) and middle > span[1] + 10.0:
        return "degrees Fahrenheit"
    return None


def corrects_field(document: Calibration, recording: Recording) -> bool:
    """Return whether a calibration corrects the magnetometer of a recording.

    Parameters
    ----------
    document, recording : as read.
    """
    block = document.magnetometer
    return recording.magnetic_field is not None and block is not None and block.triad is not None


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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
    if ending in TABLE_ENDINGS:
        return Destination("table", target)
    if ending in _LOGS:
        raise UsageError(_no_log(target.name, *_LOGS[ending]))
    if ending in BAG_ENDINGS:
        return Destination("bag", _checked_bag(target, files))
    if len(files) == 1 and ending_of(files[0]) == "":
        return Destination("bag", target)
    if not ending or target.is_dir():
        results_folder(target)
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
