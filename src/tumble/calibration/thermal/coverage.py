"""What a recording covers of temperature, in degrees Celsius or not, and whether a calibration can build on it.

Whether a thermometer's numbers are degrees Celsius: its unit, the protocol's temperatures, and what is usual.
"""

from __future__ import annotations

from dataclasses import field
from itertools import pairwise

import numpy as np

from tumble.arrays import Series
from tumble.calibration.thermal.points import ThermalPoints
from tumble.errors import ObservabilityError
from tumble.protocol import Protocol, RampStep, SoakStep, Step
from tumble.recording import POSSIBLE_CELSIUS, Recording, TemperatureColumn
from tumble.records import dataclass

USUAL_HOTTEST = 85.0  # °C
# Tests begin or end in a room, or pass it.
ROOM = 10.0, 32.0  # °C
# From a freezer to a warm room is a usual test in °F, too.
COLDEST_FREEZER, WARM_ROOM = -25.0, 15.0  # °C
# Numbers of a soak or ramp are this near the protocol's, in the right unit: a tenth of its span, at least so much.
NEAR, NEAR_SHARE = 5.0, 0.1  # K
_SAY = "Say the unit: add degF (or degC, K) to the --units, or give --units degF alone"


def check_unit(values: Series, unit: str | None, protocol: Protocol | None = None) -> list[str]:
    """Refuse a temperature that is not in °C, as it looks, and ask where nothing shows it.

    Parameters
    ----------
    values : finite numbers of the column, in °C if the unit was said.
    unit : as the file or the user says; None if nobody does.
    protocol : what temperatures were to be, if somebody said.

    Returns
    -------
    cautions : a sentence where the numbers would do as well in °F.

    Raises
    ------
    ObservabilityError
        If they are kelvins, counts, or as it looks °F.
    """
    low, high = (float(value) for value in np.quantile(values, [0.002, 0.998]))
    said = f"The temperature goes from {low:.4g} to {high:.4g}"
    if low < POSSIBLE_CELSIUS[0] or high > POSSIBLE_CELSIUS[1]:
        why = (
            ", which is no temperature in °C (raw counts?): convert the column to °C by the sensor's data sheet (of an "
            "MPU-6000: number / 340 + 36.53)."
        )
        if unit is not None:
            why = f" °C, read as {unit}: that is no temperature of a sensor. {_SAY}."
        elif low > 200.0 and high < 400.0:
            why = ", which are no °C, but kelvins, as it looks: add K to the --units."
        raise ObservabilityError(f"{said}{why}")
    planned = [celsius for step in (protocol.steps if protocol else ()) for celsius in _planned(step)]
    if not planned:
        return [] if unit is not None else _ask(low, high, said)
    first, last = min(planned), max(planned)

    def off(low: float, high: float) -> float:
        return max(abs(low - first), abs(high - last))

    fahrenheit = off((low - 32.0) / 1.8, (high - 32.0) / 1.8)
    if unit is None and fahrenheit <= max(NEAR, NEAR_SHARE * (last - first)) < off(low, high):
        raise ObservabilityError(
            f"{said}, and the protocol from {first:g} to {last:g} °C: that fits if the column is in °F. {_SAY}."
        )
    return []


def _planned(step: Step) -> list[float]:
    """Return the temperatures, °C, that a step of a protocol goes to."""
    if isinstance(step, RampStep):
        return [step.start_celsius, step.stop_celsius]
    return [step.temperature_celsius] if isinstance(step, SoakStep) else []


def _ask(low: float, high: float, said: str) -> list[str]:
    """Refuse what is unusual in °C and usual in °F; caution where both are usual."""
    cold, hot = (low - 32.0) / 1.8, (high - 32.0) / 1.8
    why = ""
    if high > USUAL_HOTTEST:
        why = f"hotter than most sensors may get ({USUAL_HOTTEST:g} °C)"
    elif (low > ROOM[1] or high < ROOM[0]) and cold <= ROOM[1] and hot >= ROOM[0]:
        why = "which never comes near that of a room"
    if why:
        raise ObservabilityError(
            f"{said}, {why}, and nobody says in which unit: as °F it would be {cold:.1f} to {hot:.1f} °C. {_SAY}."
        )
    if cold > COLDEST_FREEZER and hot > WARM_ROOM:
        as_well = f"in °F it would be {cold:.1f} to {hot:.1f} °C, a usual test, too"
        return [f"{said} and is taken as °C, because nothing says otherwise; {as_well}. {_SAY}."]
    return []


# Less than this is no sweep: a unit's own warming up goes as far.
LEAST_SPAN = 5.0  # K
# A soak's rest counts as settled below this rate, and no sweep is faster than that.
SETTLED_RATE, FASTEST_RATE = 0.1 / 60.0, 5.0 / 60.0  # K/s
# Between neighbouring temperatures of the points at most this share of the span, or it is a gap.
LARGEST_GAP = 0.35
# No unit with a mass changes its temperature faster than this: a jump of the column or of the clock.
FASTEST_UNIT = 1.0  # K/s
# A thermometer may be silent for so long without a word, and for so long at all.
USUAL_SILENCE, LONGEST_SILENCE = 5.0, 600.0  # s
# Heating and cooling have to share this part of the span for their difference to be told.
SHARED_BRANCHES = 0.25
# A unit that changed by this much within fewer seconds than its own time constants did not.
LEAST_SECONDS_PER_KELVIN = 2.0
LONG_GAP = 5.0  # s


@dataclass
class Coverage:
    """What the points cover.

    Attributes
    ----------
    kind : "soak" or "ramp".
    span : °C, lowest and highest.
    largest_rate : K/s among the points used.
    both_branches : heating and cooling are seen at the same temperatures.
    rejected : (start, stop) s of rests that take no part, with the reason as a sentence.
    remarks, cautions : sentences.
    keep : of the points, which take part.
    """

    kind: str
    span: tuple[float, float]
    largest_rate: float
    both_branches: bool
    keep: np.ndarray
    rejected: list[tuple[float, float, str]] = field(default_factory=list[tuple[float, float, str]])
    remarks: list[str] = field(default_factory=list[str])
    cautions: list[str] = field(default_factory=list[str])


def require_time_base(recording: Recording, protocol: Protocol | None = None) -> list[str]:
    """Refuse a recording whose stamps or thermometer cannot be those of a temperature sweep.

    Lag, rate and hysteresis are functions of time: with a clock that stood still or began anew, or samples
    numbered at a nominal rate while most of them are missing, they would come out as numbers all the same.

    Parameters
    ----------
    recording : with its thermometer.
    protocol : whose soaks and ramps say at what temperatures it was to be, where somebody said.

    Returns
    -------
    cautions : sentences on what the column lacks, or on a unit that nobody said and the numbers do not show.

    Raises
    ------
    ObservabilityError
        Saying what was found, where, and what to do.
    """
    celsius = recording.temperature
    if celsius is None:
        raise ObservabilityError(
            "The recording has no temperature: the thermal procedure needs the sensor's thermometer in a column "
            "(name it with --columns, such as t,ax,ay,az,gx,gy,gz,temperature)."
        )
    known = np.isfinite(celsius)
    if np.count_nonzero(known) < 10:
        raise ObservabilityError("The temperature column holds no numbers: record the sensor's thermometer.")
    time, values = recording.time[known], celsius[known]
    if float(np.ptp(values)) == 0.0:
        raise ObservabilityError(
            f"The temperature column is constant ({values[0]:g} °C in all {values.size} samples): the thermometer was "
            "not read. Record it with every sample, or leave the thermal procedure out."
        )
    cautions = check_unit(values, recording.temperature_unit, protocol)
    cautions += _check_missing(recording, celsius)
    _refuse_jumps(recording, time, values)
    smooth = _smoothed(time, values)
    _refuse_clock(recording, time, smooth)
    span = float(np.ptp(smooth))
    if span < LEAST_SPAN:
        raise ObservabilityError(
            f"The temperature changes by {span:.1f} K only: at least {LEAST_SPAN:g} K are needed to "
            "determine what it does (from the fridge to the room are 15 to 20)."
        )
    return cautions


def _check_missing(recording: Recording, celsius: Series) -> list[str]:
    """Refuse a thermometer that was silent for so long that nobody knows the temperature; say shorter gaps."""
    column = TemperatureColumn()
    column.add(recording.time, celsius)
    seconds = column.longest_gap[0]
    if seconds > LONGEST_SILENCE:
        raise ObservabilityError(
            f"{column.missing_words()}: for more than {LONGEST_SILENCE / 60:.0f} minutes nobody knows the sensor's "
            "temperature. Cut that part away, or record again."
        )
    # A thermometer that is read at a lower rate than the sensors has gaps of a second or so, and no doubt.
    if not column.missing or seconds <= USUAL_SILENCE:
        return []
    return [f"{column.missing_words()}; there it is taken along a straight line between its neighbours."]


def _refuse_clock(recording: Recording, time: Series, smooth: Series) -> None:
    """Refuse resets and duplicated stamps that reading has mended by guesses, and a clock that ran too fast."""
    for remark in recording.remarks:
        word = remark.text.lower()
        guessed = remark.kind in ("mended", "assumed") and "clock" in word
        if guessed and ("anew" in word or "steps back" in word):
            raise ObservabilityError(
                "The stamps cannot be the time base of a temperature sweep, in which time determines lag and rate. "
                f"{remark.text} Give the parts before and after alone, or record again with one clock."
            )
    time = time[: smooth.size]
    # Over ten seconds, or from end to end of what is shorter.
    step = min(max(1, int(10.0 * recording.rate)), smooth.size - 1)
    begins, ends, moved = time[:-step], time[step:], np.abs(smooth[step:] - smooth[:-step])
    fast = (moved * LEAST_SECONDS_PER_KELVIN > ends - begins) & ~_over_gaps(recording, begins, ends)
    if np.any(fast & (moved > 3.0)):
        k = int(np.argmax(np.where(fast, moved, 0.0)))
        raise ObservabilityError(
            f"From {begins[k]:.1f} to {ends[k]:.1f} s the temperature changes by {moved[k]:.1f} K, faster than any "
            "unit can. The stamps are too short for it (wrong unit or rate of the clock, or samples missing). Put the "
            "stamps right (--units, --rate), or record again."
        )


def _over_gaps(recording: Recording, begins: Series, ends: Series) -> np.ndarray:
    """Return which stretches have samples missing: between files of one soak each a jump of temperature is none."""
    gaps, over = np.array(recording.gaps, dtype=int), np.zeros(begins.size, dtype=bool)
    for at in recording.time[gaps[recording.time[gaps] - recording.time[gaps - 1] > LONG_GAP]].tolist():
        over |= (begins <= at) & (at <= ends)
    return over


def _refuse_jumps(recording: Recording, time: Series, values: Series) -> None:
    window = max(1, int(2.0 * (1.0 / max(float(np.median(np.diff(time))), 1e-9))))
    if values.size < 4 * window:
        return
    # Medians of two seconds before and after: noise and single spikes are no jump.
    level = np.median(values[: values.size // window * window].reshape(-1, window), axis=1)
    begins, change = time[: level.size * window : window], np.abs(np.diff(level))
    suspect = (change > 2.0) & (change > FASTEST_UNIT * np.diff(begins))
    jumped = np.flatnonzero(suspect & ~_over_gaps(recording, begins[:-1], begins[1:] + np.diff(begins)))
    if jumped.size:
        k = int(jumped[0])
        raise ObservabilityError(
            f"The temperature jumps from {level[k]:.1f} to {level[k + 1]:.1f} °C at {begins[k + 1]:.1f} s, which no "
            "unit does. Either two recordings stand one after the other, or a clock began anew, or a thermometer "
            "failed. Give the parts one by one, each with its own stamps."
        )


def _smoothed(time: Series, values: Series) -> Series:
    """Return a running mean over about a second, or five samples."""
    width = max(5, int(1.0 / max(float(np.median(np.diff(time))), 1e-9)))
    if values.size <= 2 * width:
        return values
    sums = np.concatenate([np.zeros(1), np.cumsum(values - values[0])])
    return (sums[width:] - sums[:-width]) / width + values[0]


def find_coverage(points: ThermalPoints, protocol: Protocol | None, poses: np.ndarray) -> Coverage:
    """Tell soak from ramp, leave out what was not settled or too fast, and say what is not covered.

    Parameters
    ----------
    points : all of them.
    protocol : what was to be done; None if nobody said.
    poses : (points,) number of the pose of each.

    Raises
    ------
    ObservabilityError
        If what remains spans too little temperature.
    """
    speed = np.abs(points.celsius_rate)
    settled = speed <= SETTLED_RATE
    kind = _kind(points, protocol, settled, poses)
    keep = settled if kind == "soak" else speed <= FASTEST_RATE
    if np.count_nonzero(keep) < 2:
        raise ObservabilityError(
            f"No rest is at a temperature that has settled (below {60 * SETTLED_RATE:g} K/min): soak longer."
            if kind == "soak"
            else f"No two rests change their temperature slower than {60 * FASTEST_RATE:g} K/min: sweep slower."
        )
    span = float(points.celsius[keep].min()), float(points.celsius[keep].max())
    if span[1] - span[0] < LEAST_SPAN:
        raise ObservabilityError(
            f"The rests that can be used span {span[1] - span[0]:.1f} K only ({span[0]:.1f} to {span[1]:.1f} °C): at "
            f"least {LEAST_SPAN:g} K are needed."
        )
    coverage = Coverage(kind, span, float(speed[keep].max()), _both_branches(points, keep, span), keep)
    coverage.rejected = _rejected(points, keep, kind)
    if coverage.rejected:
        seconds = sum(stop - start for start, stop, _ in coverage.rejected)
        why = "had not settled" if kind == "soak" else f"went faster than {60 * FASTEST_RATE:g} K/min"
        coverage.remarks.append(
            f"{len(coverage.rejected)} rests ({seconds / 60.0:.0f} min) take no part, because the temperature {why}: "
            f"{coverage.rejected[0][2]}" + (" and the like." if len(coverage.rejected) > 1 else "")
        )
    if not coverage.both_branches:
        coverage.remarks.append(
            "The temperatures were come to from one side only: what the way back would show (hysteresis) is not "
            "known. Come to some of them from the other side, too."
        )
    ordered = np.sort(points.celsius[keep])
    coverage.cautions += [
        f"Between {low:.1f} and {high:.1f} °C nothing was measured: what the calibration says "
        "there is interpolated over a gap. Soak there too, or sweep through."
        for low, high in pairwise(ordered.tolist())
        if high - low > LARGEST_GAP * (span[1] - span[0])
    ]
    soaks = [step for step in (protocol.steps if protocol else ()) if isinstance(step, SoakStep)]
    for celsius, tolerance in sorted({(soak.temperature_celsius, soak.tolerance) for soak in soaks}):
        nearest = float(ordered[np.argmin(np.abs(ordered - celsius))])
        if abs(nearest - celsius) > tolerance:
            coverage.cautions.append(
                f"The soak at {celsius:g} °C is not in the recording: the nearest settled rest is at {nearest:.1f} °C, "
                f"outside the tolerance of {tolerance:g} K. Soak longer, or correct the protocol."
            )
    return coverage


def _kind(points: ThermalPoints, protocol: Protocol | None, settled: np.ndarray, poses: np.ndarray) -> str:
    planned = [len(_planned(step)) for step in (protocol.steps if protocol else ())]
    if any(planned):
        # Two temperatures with nothing between them are a way from one to the other, such as out of a fridge.
        steps = protocol.steps if protocol else ()
        soaks = {step.temperature_celsius for step in steps if isinstance(step, SoakStep)}
        return "soak" if max(planned) < 2 and len(soaks) >= 3 else "ramp"
    # Many poses at three temperatures or more that have settled are soaks.
    ordered = np.sort(points.celsius[settled])
    cuts = np.flatnonzero(np.diff(ordered) > 3.0)
    soak = np.searchsorted(0.5 * (ordered[cuts] + ordered[cuts + 1]), points.celsius[settled])
    rich = [len(np.unique(poses[settled][soak == k])) >= 6 for k in range(cuts.size + 1)]
    return "soak" if sum(rich) >= 3 else "ramp"


def _both_branches(points: ThermalPoints, keep: np.ndarray, span: tuple[float, float]) -> bool:
    """Return whether enough of the span was passed (or come to) both from below and from above."""
    up = points.celsius[keep & (points.hysteresis > 0.5)]
    down = points.celsius[keep & (points.hysteresis < -0.5)]
    if up.size < 2 or down.size < 2:
        return False
    shared = min(float(up.max()), float(down.max())) - max(float(up.min()), float(down.min()))
    return shared >= SHARED_BRANCHES * (span[1] - span[0])


def _rejected(points: ThermalPoints, keep: np.ndarray, kind: str) -> list[tuple[float, float, str]]:
    """Return the stretches left out, neighbours of one hold as one."""
    found: list[tuple[float, float, str]] = []
    index, verb = np.flatnonzero(~keep), "not settled" if kind == "soak" else "too fast"
    for group in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if index.size else ():
        worst = int(group[np.argmax(np.abs(points.celsius_rate[group]))])
        start, stop = float(points.start[group[0]]), float(points.stop[group[-1]])
        speed = f"{60.0 * abs(float(points.celsius_rate[worst])):.2g} K/min at {points.celsius[worst]:.1f} °C"
        found.append((start, stop, f"{start:.0f} to {stop:.0f} s, {verb}: up to {speed}"))
    return found
