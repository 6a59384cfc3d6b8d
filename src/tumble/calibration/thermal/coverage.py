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
from tumble.protocol.steps import Protocol, RampStep, SoakStep
from tumble.recording.recording import Recording
from tumble.recording.temperature import COLDEST, HOTTEST, TemperatureColumn
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
    if low < COLDEST or high > HOTTEST:
        in_kelvin = low > 200.0 and high < 400.0
        if unit is not None:
            raise ObservabilityError(
                f"{said} °C, read as {unit}: that is no temperature of a sensor. {_SAY}."
            )
        if in_kelvin:
            raise ObservabilityError(
                f"{said}, which are no °C, but kelvins, as it looks: add K to the --units."
            )
        raise ObservabilityError(
            f"{said}, which is no temperature in °C (raw counts?): convert the column to °C by the sensor's data "
            "sheet (of an MPU-6000: number / 340 + 36.53)."
        )
    planned = _planned(protocol)
    if unit is not None and planned is None:
        return []
    if planned is not None:
        _refuse_other_plan(low, high, planned, unit)
        return []
    return _ask(low, high, said)


def _planned(protocol: Protocol | None) -> tuple[float, float] | None:
    """Return the lowest and highest temperature of a protocol; None where it has none."""
    at: list[float] = []
    for step in () if protocol is None else protocol.steps:
        if isinstance(step, SoakStep):
            at.append(step.temperature_celsius)
        elif isinstance(step, RampStep):
            at += [step.start_celsius, step.stop_celsius]
    return (min(at), max(at)) if at else None


def _refuse_other_plan(low: float, high: float, planned: tuple[float, float], unit: str | None) -> None:
    """Refuse numbers that fit the protocol's temperatures in °F and not in °C."""
    allowed = max(NEAR, NEAR_SHARE * (planned[1] - planned[0]))

    def off(first: float, last: float) -> float:
        return max(abs(first - planned[0]), abs(last - planned[1]))

    fahrenheit = off((low - 32.0) / 1.8, (high - 32.0) / 1.8)
    if unit is None and fahrenheit <= allowed < off(low, high):
        raise ObservabilityError(
            f"The temperature goes from {low:.4g} to {high:.4g}, and the protocol from {planned[0]:g} to "
            f"{planned[1]:g} °C: that fits if the column is in °F. {_SAY}."
        )


def _ask(low: float, high: float, said: str) -> list[str]:
    """Refuse what is unusual in °C and usual in °F; caution where both are usual."""
    cold, hot = (low - 32.0) / 1.8, (high - 32.0) / 1.8
    meets_room = low <= ROOM[1] and high >= ROOM[0]
    would_meet_room = cold <= ROOM[1] and hot >= ROOM[0]
    if high > USUAL_HOTTEST or (not meets_room and would_meet_room):
        why = (
            f"hotter than most sensors may get ({USUAL_HOTTEST:g} °C)"
            if high > USUAL_HOTTEST
            else "which never comes near that of a room"
        )
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


@dataclass(slots=True)
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
    _refuse_clock(recording, time, values)
    span = float(np.ptp(_smoothed(time, values)))
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
    seconds, _ = column.longest_gap
    if seconds > LONGEST_SILENCE:
        raise ObservabilityError(
            f"{column.missing_words()}: for more than {LONGEST_SILENCE / 60:.0f} minutes nobody knows the sensor's "
            "temperature. Cut that part away, or record again."
        )
    if not column.missing:
        return []
    # A thermometer that is read at a lower rate than the sensors has gaps of a second or so, and no doubt.
    if seconds <= USUAL_SILENCE:
        return []
    return [f"{column.missing_words()}; there it is taken along a straight line between its neighbours."]


def _refuse_clock(recording: Recording, time: Series, values: Series) -> None:
    """Refuse resets and duplicated stamps that reading has mended by guesses, and a clock that ran too fast."""
    for remark in recording.remarks:
        word = remark.text.lower()
        if (
            remark.kind in ("mended", "assumed")
            and "clock" in word
            and any(w in word for w in ("anew", "steps back"))
        ):
            raise ObservabilityError(
                "The stamps cannot be the time base of a temperature sweep, in which time determines "
                f"lag and rate. {remark.text} Give the parts before and after alone, or record again "
                "with one clock."
            )
    smooth = _smoothed(time, values)
    time = time[: smooth.size]
    span, took = float(np.ptp(smooth)), float(time[-1] - time[0])
    if span > 3.0 and span * LEAST_SECONDS_PER_KELVIN > took:
        raise ObservabilityError(
            f"The temperature changes by {span:.1f} K in a recording of {took:.3g} s, faster than any "
            "unit can. The stamps are too short for it (wrong unit or rate of the clock?). Say the "
            "unit of time (--units s), or the rate with --rate."
        )
    step = max(1, int(10.0 * recording.rate))
    if smooth.size > 2 * step:
        moved, took = np.abs(smooth[step:] - smooth[:-step]), time[step:] - time[:-step]
        fast = moved * LEAST_SECONDS_PER_KELVIN > took
        for at in _gap_times(recording):
            fast &= ~((time[: fast.size] <= at) & (time[step : step + fast.size] >= at))
        if np.any(fast & (moved > 3.0)):
            k = int(np.argmax(np.where(fast, moved, 0.0)))
            raise ObservabilityError(
                f"From {time[k]:.1f} to {time[k + step]:.1f} s the temperature changes by "
                f"{moved[k]:.1f} K, faster than any unit can. The stamps are too short for it (wrong "
                "unit or rate of the clock, or samples missing). Put the stamps right (--units, "
                "--rate), or record again."
            )


def _gap_times(recording: Recording) -> list[float]:
    """Return s where samples are missing: between files of one soak each a jump of temperature is none."""
    gaps = np.array(recording.gaps, dtype=int)
    if not gaps.size:
        return []
    long = recording.time[gaps] - recording.time[gaps - 1] > LONG_GAP
    return recording.time[gaps[long]].tolist()


def _refuse_jumps(recording: Recording, time: Series, values: Series) -> None:
    rate = 1.0 / max(float(np.median(np.diff(time))), 1e-9)
    window = max(1, int(2.0 * rate))
    if values.size < 4 * window:
        return
    # Medians of two seconds before and after: noise and single spikes are no jump.
    blocks = values[: values.size // window * window].reshape(-1, window)
    level = np.median(blocks, axis=1)
    change = np.abs(np.diff(level))
    took = np.diff(time[: level.size * window : window])
    suspect = (change > 2.0) & (change > FASTEST_UNIT * took)
    begins = time[: level.size * window : window]
    for at in _gap_times(recording):
        suspect &= ~((begins[:-1] <= at) & (at <= begins[1:] + took))
    jumped = np.flatnonzero(suspect)
    if jumped.size:
        k = int(jumped[0])
        raise ObservabilityError(
            f"The temperature jumps from {level[k]:.1f} to {level[k + 1]:.1f} °C at "
            f"{time[(k + 1) * window]:.1f} s, which no unit does. Either two recordings stand one "
            "after the other, or a clock began anew, or a thermometer failed. Give the parts one by "
            "one, each with its own stamps."
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
    _say_gaps(points, coverage)
    if protocol is not None:
        _say_missed_soaks(points, protocol, coverage)
    return coverage


def _kind(points: ThermalPoints, protocol: Protocol | None, settled: np.ndarray, poses: np.ndarray) -> str:
    if protocol is not None and any(isinstance(step, SoakStep | RampStep) for step in protocol.steps):
        if any(isinstance(step, RampStep) for step in protocol.steps):
            return "ramp"
        # Two temperatures with nothing between them are a way from one to the other, such as out of a fridge.
        soaks = [step.temperature_celsius for step in protocol.steps if isinstance(step, SoakStep)]
        return "soak" if len(set(soaks)) >= 3 else "ramp"
    # Many poses at three temperatures or more that have settled are soaks.
    if not np.any(settled):
        return "ramp"
    ordered = np.sort(points.celsius[settled])
    cuts = np.flatnonzero(np.diff(ordered) > 3.0)
    edges = [-np.inf, *(0.5 * (ordered[cuts] + ordered[cuts + 1])).tolist(), np.inf]
    rich = 0
    for low, high in pairwise(edges):
        here = settled & (points.celsius > low) & (points.celsius <= high)
        rich += len(np.unique(poses[here])) >= 6
    return "soak" if rich >= 3 else "ramp"


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
    index = np.flatnonzero(~keep)
    for group in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1):
        if group.size == 0:
            continue
        worst = int(group[np.argmax(np.abs(points.celsius_rate[group]))])
        start, stop = float(points.start[group[0]]), float(points.stop[group[-1]])
        verb = "not settled" if kind == "soak" else "too fast"
        speed = 60.0 * abs(float(points.celsius_rate[worst]))
        words = (
            f"{start:.0f} to {stop:.0f} s, {verb}: up to {speed:.2g} K/min at {points.celsius[worst]:.1f} °C"
        )
        found.append((start, stop, words))
    return found


def _say_gaps(points: ThermalPoints, coverage: Coverage) -> None:
    low, high = coverage.span
    ordered = np.sort(points.celsius[coverage.keep])
    gaps = np.diff(ordered)
    for k in np.flatnonzero(gaps > LARGEST_GAP * (high - low)).tolist():
        coverage.cautions.append(
            f"Between {ordered[k]:.1f} and {ordered[k + 1]:.1f} °C nothing was measured: what the calibration says "
            "there is interpolated over a gap. Soak there too, or sweep through."
        )
    if not coverage.both_branches:
        coverage.remarks.append(
            "The temperatures were come to from one side only: what the way back would show (hysteresis) is not "
            "known. Come to some of them from the other side, too."
        )


def _say_missed_soaks(points: ThermalPoints, protocol: Protocol, coverage: Coverage) -> None:
    kept = points.celsius[coverage.keep]
    wanted = {
        (step.temperature_celsius, step.tolerance) for step in protocol.steps if isinstance(step, SoakStep)
    }
    for celsius, tolerance in sorted(wanted):
        nearest = float(kept[np.argmin(np.abs(kept - celsius))])
        if abs(nearest - celsius) > tolerance:
            coverage.cautions.append(
                f"The soak at {celsius:g} °C is not in the recording: the nearest settled rest is at {nearest:.1f} °C, "
                f"outside the tolerance of {tolerance:g} K. Soak longer, or correct the protocol."
            )
