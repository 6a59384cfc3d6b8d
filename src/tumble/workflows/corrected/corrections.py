"""What a recording's temperature means for a calibration, and which calibrations it was corrected by before.

A corrected file has one more column for each calibration that it went through, named
``corrected_by_`` and the twelve digits of the calibration's identity, with the number 1 in every row.
A name in the header outlives copying, cutting, and being read and written by other programs. Bags say it topic by
topic, EuRoC's folders in `sensor.yaml`: columns of their own are not theirs to have.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from tumble.document import Calibration
from tumble.document.corrector import NO_TEMPERATURE, Corrector
from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording, rewriting
from tumble.recording.columns import role_of
from tumble.recording.formats import header_names, output
from tumble.recording.formats.frames import Frame, frame_names
from tumble.recording.temperature import LONG_GAP, TemperatureColumn
from tumble.records import dataclass
from tumble.sensor.thermal import SPAN_MARGIN, Outside


@dataclass(frozen=True, slots=True)
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
        found = output.euroc_corrections(path)
        if found or not path.is_dir():
            return list(found)
    if not path.is_dir() and path.suffix.lower() not in rewriting.ENDINGS:
        return []
    wanted = None if not topics else {t.strip("/") for t in topics}
    said = rewriting.corrections(path).items()
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
# No inertial sensor works beyond this: higher numbers are another scale.
HOTTEST = 200.0  # °C
# Beyond this without a thermometer a straight line is no temperature: the unit may have been anywhere.
LONGEST_GAP = 600.0  # s


def needs_temperature(calibration: Calibration) -> bool:
    """Return whether a calibration changes with temperature."""
    return calibration.thermal is not None


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
    """Refuse a recording without temperature, or with one that cannot be in degrees Celsius.

    Parameters
    ----------
    recording : its first block, or the whole.
    stated : °C that the user gives for all of it, instead of a column.
    outside : with anything but ``refuse`` the user knows that the temperature is unlike the calibration's, and
        numbers that could be hot or in degrees Fahrenheit are believed.

    Raises
    ------
    UsageError
        If there is no temperature.
    RecordingError
        If it is in kelvin, degrees Fahrenheit or counts.
    """
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
    calibration: Calibration, corrector: Corrector | None, recorded: tuple[float, float]
) -> list[str]:
    """Return sentences for the user on what temperature does to the corrected recording.

    Parameters
    ----------
    corrector : that has corrected the recording, None where there was no thermal model to follow.
    recorded : °C, lowest and highest of the recording; NaN for not known.
    """
    words: list[str] = []
    low, high = recorded
    made_at = calibration.temperature_celsius
    if not needs_temperature(calibration):
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
    if corrector is None or thermal is None:
        return []
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
    if middle > HOTTEST:
        return "kelvin" if -100.0 < middle + ABSOLUTE_ZERO < HOTTEST else "counts, or a fraction of a degree"
    if not trusted and inside((middle - 32.0) / 1.8) and middle > span[1] + 10.0:
        return "degrees Fahrenheit"
    return None
