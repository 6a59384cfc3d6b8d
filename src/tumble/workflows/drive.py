"""Judging a calibration by a drive with satellite positions: free drift, outages, what the filter says, the verdict."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Series
from tumble.counting import counted
from tumble.document import Calibration, read_calibration
from tumble.errors import RecordingError, UsageError
from tumble.files import write_texts
from tumble.navigation import (
    LONGEST_BRIDGED,
    Drive,
    FilterRun,
    FilterSetup,
    FreeDrift,
    GnssTrack,
    OutageErrors,
    Statistic,
    find_rest,
    fit_velocities,
    free_drift,
    outages,
    prepare_drive,
    ratio_of,
    read_track,
    rms_of,
    sharpen_clock,
    smooth,
    spans_in_words,
    wide_setup,
)
from tumble.parameters import Measure, amount, two_digits
from tumble.recording import Recording, read_recordings, recording_inputs
from tumble.records import as_document, dataclass
from tumble.simulation import Grade, find_grade
from tumble.workflows.apply import in_calibration_units, raw_factors
from tumble.workflows.calibration_parts import (
    AT_REST,
    UNCALIBRATED,
    WHOLE,
    CorrectedBy,
    about_innovations,
    corrected_by_parts,
    drive_filter,
    start_covariance,
    without_rest_rate,
)
from tumble.workflows.corrected import corrections_of, refuse_twice
from tumble.workflows.request import OF_NO_DRIVE, DriveRequest, asked, check_turn_on, refuse, silent
from tumble.workflows.verify import made_from

FORMAT = "tumble verify drive"
VERSION = 1
# Normalised errors beyond this contradict the calibration: one in 15,000 by chance.
LARGEST_NORMALISED = 4.0
# Beyond this the IMU and the positions do not describe one drive, whoever is to blame.
LARGEST_SHARE_REFUSED = 0.1
# And the positions that are taken fit worse than this, in squared normalised innovations.
LARGEST_LEFT = 2.0
_FEWEST = 4
# A drive of less, s, speaks against a calibration by its drift only where that is beyond doubt.
_SHORT = 120.0
_TRIADS = ("accelerometer", "gyroscope")
_GRAVITY, _EARTH_RADIUS = 9.81, 6.371e6


@dataclass(frozen=True)
class DriftAfter:
    """Free inertial drift after one length: rms over so many known starts, m, and over that without calibration."""

    seconds: float
    starts: int
    horizontal_rms: Statistic
    ratio_to_uncalibrated: Statistic


@dataclass(frozen=True)
class ErrorAfter:
    """The error at the ends of outages of one length: rms, m, and over that without calibration."""

    seconds: float
    outages: int
    horizontal_rms: Statistic
    ratio_to_uncalibrated: Statistic


@dataclass(frozen=True)
class Variant:
    """What navigation is with a part of the calibration.

    Attributes
    ----------
    name : of the part.
    drift : free inertial drift from known starts.
    outages_sliding, outages_repeated : outages of each length, one by one and again and again.
    drift_over_an_hour_at_least, drift_over_an_hour_at_most : km, that the free runs let expect: least if the
        accelerometers cause all of it (with Schuler's period), most if the gyros do.
    accuracy_class : of the least.
    innovations : mean squared normalised innovation of the positions taken, over its degrees of freedom; 1 when the
        filter is consistent.
    positions_refused, positions : that the filter took for outliers, and all.
    """

    name: str
    drift: list[DriftAfter]
    outages_sliding: list[ErrorAfter]
    outages_repeated: list[ErrorAfter]
    drift_over_an_hour_at_least: Statistic
    drift_over_an_hour_at_most: Statistic
    accuracy_class: str
    innovations: float
    positions_refused: int
    positions: int


@dataclass(frozen=True)
class TimeOffset:
    """s to add to the track's times, with its standard uncertainty, and what was done in words."""

    value: float
    standard_uncertainty: float
    unit: str
    words: str


@dataclass(frozen=True)
class Departure:
    """What the drive finds of a sensor state (SI), and of how many of its standard uncertainties that is."""

    estimate: float
    normalised: float


@dataclass(frozen=True)
class FreeToFind:
    """What a filter of the calibrated samples says that may find the biases itself.

    Attributes
    ----------
    turn_on : m/s² and rad/s, by how much biases may have moved since the calibration.
    moved : bias -> what it departs by, if biases could not have moved since.
    refused : positions that it refuses.
    no_proof : whether even it finds no motion that both describe, nor one of the uncalibrated samples.
    why_innovations : why they are not of the size that the filter expects, with all of the calibration.
    """

    turn_on: tuple[float, float]
    moved: dict[str, Departure]
    refused: int
    no_proof: bool
    why_innovations: str


UNITS = {"drift": "m", "outage": "m", "drift_over_an_hour": "km", "sensor_states": "SI"}


@dataclass
class DriveVerification:
    """A calibration's worth on a drive, as ``verify.json`` has it.

    Attributes
    ----------
    recording, gnss : names of the files.
    fit, reasons, remarks : the verdict, and sentences.
    setting, alignment : how it was compared, in words.
    duration : s.
    positions_left_out : that do not fit the receiver's own velocities.
    variants : by part of the calibration, uncalibrated first, all of it last.
    sensor_states : those that the drive determines, by their names.
    """

    recording: str
    gnss: str
    fit: bool
    reasons: list[str]
    remarks: list[str]
    setting: list[str]
    time_offset: TimeOffset
    alignment: str
    duration: float
    positions_left_out: int
    variants: list[Variant]
    sensor_states: dict[str, Departure]

    def variant(self, name: str) -> Variant:
        """Return what is said of a part by its name."""
        return next(one for one in self.variants if one.name == name)

    @property
    def document(self) -> dict[str, Any]:
        """All of it as plain data: SI, with standard uncertainties; what is unknown is null."""
        return {"format": FORMAT, "version": VERSION, **as_document(self), "units": UNITS}

    def write(self, folder: Path, command: str) -> list[Path]:
        """Write ``verify.json`` and ``verify.html`` into a folder, and return them.

        Parameters
        ----------
        folder : where.
        command : how to make it again.

        Raises
        ------
        OutputError
            If they cannot be written; earlier ones are intact.
        """
        from tumble.report import render_drive

        document = self.document
        text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
        page = render_drive(document, command)
        return write_texts({folder / "verify.json": text, folder / "verify.html": page})


Errors = tuple[FreeDrift, list[OutageErrors], list[OutageErrors]]
"""Free drift, and outages one by one and again and again."""


def variant_of(part: str, own: Errors, plain: Errors, run: FilterRun) -> Variant:
    """Return the numbers of a part, beside those of the uncalibrated samples.

    Parameters
    ----------
    part, own, run : its name, what it navigates by itself, and the filter's run with it.
    plain : as `own`, of the uncalibrated samples.
    """
    drift = [_drift(own[0], plain[0], i) for i in range(len(own[0].seconds))]
    after = _longest(drift)
    rms, (least, most) = after.horizontal_rms, _hourly_drift(after.seconds)
    distances: Series = run.distances[:, 0]
    seen = np.isfinite(distances)
    best, worst = accuracy_class(rms.value * least), accuracy_class(rms.value * most)
    return Variant(
        part,
        drift,
        [_outage(*both) for both in zip(own[1], plain[1], strict=True)],
        [_outage(*both) for both in zip(own[2], plain[2], strict=True)],
        rms.times(least),
        rms.times(most),
        best if best == worst else f"{best} at best",
        float(np.mean(distances[seen & run.taken[:, 0]])) / 3.0,
        len(run.refused),
        int(seen.sum()),
    )


def _drift(own: FreeDrift, plain: FreeDrift, length: int) -> DriftAfter:
    squares, others = (drift.horizontal_squares(length) for drift in (own, plain))
    known = np.isfinite(squares)
    both, block = known & np.isfinite(others), own.block(length)
    return DriftAfter(
        float(own.seconds[length]),
        int(known.sum()),
        rms_of(squares[known], block, _dice(length)),
        ratio_of(squares[both], others[both], block, _dice(length)),
    )


def _outage(own: OutageErrors, plain: OutageErrors) -> ErrorAfter:
    apart = float(np.median(np.diff(own.starts))) if len(own.starts) > 1 else own.duration
    block = max(1, round(2.0 * own.duration / apart))
    _, at, other = np.intersect1d(np.round(own.starts, 3), np.round(plain.starts, 3), return_indices=True)
    squares, others = own.horizontal**2, plain.horizontal**2
    ratio = ratio_of(squares[at], others[other], block, _dice(1))
    return ErrorAfter(own.duration, len(own.starts), rms_of(squares, block, _dice(2)), ratio)


def _longest(drift: Sequence[DriftAfter]) -> DriftAfter:
    """The longest length that enough starts reach."""
    return next((after for after in reversed(drift) if after.starts >= _FEWEST), drift[0])


def _dice(seed: int) -> np.random.Generator:
    return np.random.default_rng(1000 + seed)


def _hourly_drift(seconds: float) -> tuple[float, float]:
    """Return km/h over an hour for each metre of drift after some time, if accelerometers or gyros cause it.

    A constant error b of specific force moves b t²/2, and over an hour 2 b/s² at most, with Schuler's frequency s; a
    constant error w of angular rate g w t³/6, and over an hour w R t.
    """
    force, rate = 2.0 / seconds**2, 6.0 / (_GRAVITY * seconds**3)
    return force * 2.0 * _EARTH_RADIUS / _GRAVITY * 1e-3, rate * _EARTH_RADIUS * 3.6


def accuracy_class(kilometres_per_hour: float) -> str:
    """Return the class of an inertial system by its drift (Hayal 2010, 2.2, after Jekeli 2000).

    Parameters
    ----------
    kilometres_per_hour : of position.
    """
    if not np.isfinite(kilometres_per_hour):
        return "unknown"
    if kilometres_per_hour > 4.0:
        return "low (tactical grade)"
    return "medium (navigation grade)" if kilometres_per_hour > 1.0 else "high"


def judge_drive(found: DriveVerification, free: FreeToFind, own_recording: bool) -> None:
    """Fill `fit` and `reasons`.

    Parameters
    ----------
    found : without them.
    free : what a filter finds that may find the biases.
    own_recording : whether the calibration was made from this drive.
    """
    against: list[str] = []
    whole = found.variant(WHOLE)
    after = _longest(whole.drift)
    ratio = after.ratio_to_uncalibrated
    # few blocks of starts understate how their ratio scatters
    surely = 2.0 if found.duration >= _SHORT else 4.0
    if np.isfinite(ratio.standard_uncertainty) and ratio.value - surely * ratio.standard_uncertainty > 1.0:
        against.append(
            f"After {after.seconds:g} s of free navigation the drift with the calibration is {ratio.value:.2f} ± "
            f"{ratio.standard_uncertainty:.2f} times that without: it is of another unit, or the unit has changed; "
            "calibrate again."
        )
    name, worst = _largest(found.sensor_states)
    if abs(worst.normalised) > LARGEST_NORMALISED:
        against.append(
            f"The drive finds the {_plain(name)} off by {_practical(name, worst.estimate)}, "
            f"{abs(worst.normalised):.1f} times what the calibration's uncertainty allows{_beside(free, name)}."
        )
    if free.no_proof:
        # what a filter finds that has lost its way says nothing about the sensors
        proof = (
            f"The drive is no proof: {free.refused} of {whole.positions} positions were refused by a filter "
            "that may find the biases itself, and the others do not fit. Positions and IMU do not describe one "
            "motion: an axis reversed, a wrong offset between the clocks, too many outliers, or another unit."
        )
        against = [proof]
    elif whole.positions_refused > LARGEST_SHARE_REFUSED * whole.positions:
        raw = found.variant(AT_REST).positions_refused
        if raw < 0.5 * whole.positions_refused:
            against.insert(
                0,
                f"With the calibration the filter refuses {whole.positions_refused} of {whole.positions} positions, "
                f"and uncalibrated, less the gyros' mean at rest, {raw}: it is of another unit, or the unit has "
                "changed.",
            )
    found.fit = not against
    own = [
        "This is a recording that the calibration was made from: it shows nothing new."
        if own_recording
        else "",
        _on_turn_on(free) if found.fit else "",
    ]
    found.reasons = [*against, *filter(None, own), *_words(found, free)]


def _largest(departures: dict[str, Departure]) -> tuple[str, Departure]:
    """The departure of the most standard uncertainties."""
    return max(departures.items(), key=lambda one: abs(one[1].normalised), default=("", Departure(0.0, 0.0)))


def no_proof(run: FilterRun) -> bool:
    """Return whether a filter that may find the biases finds no motion that IMU and positions both describe.

    Outliers are refused and the other positions fit: a share of them alone proves nothing.

    Parameters
    ----------
    run : of the calibrated samples.
    """
    distances: Series = run.distances[:, 0]
    seen = np.isfinite(distances)
    taken = seen & run.taken[:, 0]
    refused = 1.0 - float(taken.sum()) / max(int(seen.sum()), 1)
    left = float(np.mean(distances[taken])) / 3.0 if taken.any() else float("inf")
    return refused > LARGEST_SHARE_REFUSED and (refused > 0.5 or left > LARGEST_LEFT)


def _beside(free: FreeToFind, name: str) -> str:
    """What a bias was allowed beside the calibration's uncertainty."""
    if "bias" not in name:
        return ": it has changed since, or the filter's noise is stated too small"
    return (
        f" with {_allowed(free)} from one turn-on to the next: it has changed since, or this unit's biases move by "
        "more than was said with --turn-on-bias"
    )


def _allowed(free: FreeToFind) -> str:
    force, rate = (_practical(f"{triad} bias", x) for triad, x in zip(_TRIADS, free.turn_on, strict=True))
    return f"{force} and {rate}"


def _on_turn_on(free: FreeToFind) -> str:
    """A sentence where it serves only because biases may have moved since the calibration."""
    name, worst = _largest(free.moved)
    if abs(worst.normalised) <= LARGEST_NORMALISED:
        return ""
    return (
        f"It serves if this unit's biases may move by {_allowed(free)} from one turn-on to the "
        f"next (--turn-on-bias). The drive finds the {_plain(name)} moved by "
        f"{_practical(name, worst.estimate)}, {abs(worst.normalised):.1f} times what the calibration's own "
        "uncertainty allows."
    )


def _words(found: DriveVerification, free: FreeToFind) -> list[str]:
    whole, plain = found.variant(WHOLE), found.variant(UNCALIBRATED)
    after, without = _longest(whole.drift), _longest(plain.drift)
    words = [
        (
            f"Free drift after {after.seconds:g} s, horizontal rms: {said(after.horizontal_rms, 'm')} with the "
            f"calibration, {said(without.horizontal_rms, 'm')} without; ratio {said(after.ratio_to_uncalibrated)}."
        )
    ]
    for one, verb in ((plain, "without"), (whole, "with")):
        least, most = one.drift_over_an_hour_at_least, one.drift_over_an_hour_at_most
        words.append(
            f"Class of accuracy {verb} the calibration: {one.accuracy_class}. Over an hour it becomes "
            f"{said(least, 'km')} if the accelerometers cause it, {far(most)} if the gyros do."
        )
    left_out = f", and {found.positions_left_out} left out before" if found.positions_left_out else ""
    words.append(
        f"Innovations: {whole.innovations:.2f} times what the filter expects (1 when consistent); "
        f"{whole.positions_refused} of {whole.positions} positions refused as outliers{left_out}."
        f"{' ' if free.why_innovations else ''}{free.why_innovations}"
    )
    return words


def said(number: Statistic, unit: str = "") -> str:
    """Return a number with its standard uncertainty to two digits.

    Parameters
    ----------
    number, unit : what is said.
    """
    if not np.isfinite(number.value):
        return "unknown"
    if not (number.standard_uncertainty > 0.0):
        return f"{two_digits(number.value)} {unit}".rstrip() + " (too few for an uncertainty)"
    return Measure(number.value, number.standard_uncertainty, unit).text


def far(number: Statistic) -> str:
    """Return kilometres in words, of which there are no more than half around the Earth.

    Parameters
    ----------
    number : km.
    """
    return "thousands of km" if not number.value < 5000.0 else said(number, "km")


def _practical(name: str, value: float) -> str:
    raw = "m/s^2" if name.startswith("accelerometer") else "rad/s"
    unit = raw if "bias" in name else "1" if "scale" in name else "rad"
    return f"{'−' if value < 0.0 else ''}{amount(abs(value), unit)}"


def _plain(name: str) -> str:
    """A state's name in the glossary's words."""
    return name.replace("gyroscope", "gyro")


_FEWEST_FIXES = 30
OUTAGES = (2.0, 10.0, 30.0, 60.0)
# How far biases move from one power cycle to the next, where nothing is told: no more than consumer units.
TURN_ON = (0.05, 0.005)  # m/s², rad/s
# How far biases are looked for, whatever they may have moved: more is no calibration of this unit.
_FREE = (0.2, 0.02)  # m/s², rad/s
# A clock that counts from its own start does not reach this (three years), s.
_DATED = 1e8


@asked(DriveRequest)
def verify_drive(request: DriveRequest) -> DriveVerification:
    """Judge a calibration by a drive: what navigation is with it, with parts of it, and without.

    Every variant has the same clock, lever arm, filter, process noise, fixes and instants. Its samples are
    corrected by its part of the calibration, and its filter starts from the calibration's covariance for the
    sensor states that this part knows, and from the data sheet's spread for the others.

    Raises
    ------
    CalibrationFileError, RecordingError, UsageError
        If an input is wrong, files do not belong together, units, axes or clocks do not fit.
    ThermalSpanError
        If the temperature leaves the calibrated span.
    """
    say, calibration = request.progress or silent, request.calibration
    refuse(request, ("site", "intervals"), OF_NO_DRIVE)
    if request.gnss is None:
        raise UsageError("A drive is judged by satellite positions: give their file as gnss.")
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    grade = find_grade(request.data_sheet or "consumer-mems")
    known = request.lever_arm_b is not None
    arm = np.array(request.lever_arm_b if known else (0.0, 0.0, 0.0), dtype=float)
    _refuse_bad_numbers(arm.tolist(), request.turn_on or (0.0, 0.0))
    files = recording_inputs(request.paths)
    for file in files:
        refuse_twice(document, corrections_of([file], request.topics))
    say("reading")
    read = _one(read_recordings(request.paths, **request.how()))
    recording = in_calibration_units(read, raw_factors(document, read))
    track, left_out, about_fixes = _plausible_fixes(Path(request.gnss))
    parts, remarks = corrected_by_parts(document, recording, files, temperature=request.temperature)
    given = [remark.text for remark in (*read.remarks, *track.remarks) if remark.kind != "unchecked"]
    say("comparing the clocks")
    drive = prepare_drive(parts[-1].samples, track, setup=wide_setup(arm))
    remarks = [*given, *remarks, *_about_clocks(drive, track), *about_fixes]
    setup, setting = drive_filter(parts[-1], grade, arm)
    moved, words = _moved(request.turn_on, grade)
    setting.append(words)
    task = _Task(document, parts, drive, setup, grade, moved)
    if known:
        task.drive = sharpen_clock(drive, _free_biases(task.knowing(parts[-1]), grade))
    variants, states, free = _navigated(task, say)
    gaps = parts[-1].samples.missing()
    clock = task.drive.clock
    found = DriveVerification(
        recording=", ".join(source.name for source in recording.sources),
        gnss=track.name,
        fit=True,
        reasons=[],
        remarks=[*remarks, *([_gap_words(gaps)] if gaps else [])],
        setting=setting,
        time_offset=TimeOffset(clock.offset, clock.sigma, "s", str(clock)),
        alignment=str(task.drive.alignment),
        duration=float(task.drive.track.time[-1] - task.drive.start.time),
        positions_left_out=left_out,
        variants=variants,
        sensor_states=states,
    )
    judge_drive(found, free, made_from(document, recording))
    return found


@dataclass
class _Task:
    """What every part of a calibration has in common: the drive, the filter, and how far biases may have moved."""

    document: Calibration
    parts: list[CorrectedBy]
    drive: Drive
    setup: FilterSetup
    grade: Grade
    moved: tuple[float, float]

    def knowing(self, part: CorrectedBy, moved: tuple[float, float] | None = None) -> FilterSetup:
        """The filter that starts from what a part of the calibration knows of the sensors."""
        given = start_covariance(part, self.setup.states, self.document, moved or self.moved)
        return self.setup.with_sensor_covariance(given)


def _navigated(
    task: _Task, say: Callable[[str], None]
) -> tuple[list[Variant], dict[str, Departure], FreeToFind]:
    """What navigation is with each part, and what a filter that may find the biases says of them."""
    parts, drive = task.parts, task.drive
    whole, own = parts[-1], task.knowing(parts[-1])
    gaps = whole.samples.missing()
    lengths = _lengths(drive)
    parts.insert(1, without_rest_rate(parts[0], *find_rest(parts[0].samples, drive.track)))
    say("smoothing")
    reference = smooth(drive.run(own, keep_covariances=True)).trajectory
    seconds = _seconds(lengths, float(reference.time[-1] - reference.time[0]))
    whole_drive = float(drive.track.time[-1]) - drive.start.time
    found, runs, why = list[Variant](), dict[str, FilterRun](), ""
    plain: Errors | None = None
    for part in counted(parts, len(parts)):
        say(part.part)
        told = task.knowing(part)
        mine = drive if part.part == WHOLE else drive.with_samples(part.samples)
        run = mine.run(told, interval=1.0)
        drift = free_drift(part.samples, reference, seconds, every=max(3.0, whole_drive / 150.0), gaps=gaps)
        every = max(2.0, round((float(mine.track.time[-1]) - mine.start.time) / 150.0))
        sliding, repeated = (
            outages(mine, told, lengths, every=every, settle=_settle(mine), repeated=again, before=run)
            for again in (False, True)
        )
        own_errors = drift, sliding, repeated
        plain = plain or own_errors
        found.append(variant_of(part.part, own_errors, plain, run))
        runs[part.part] = run
        why = about_innovations(mine, run)
    say("with free biases")
    free = drive.run(_free_biases(own, task.grade), interval=1.0)
    lost = no_proof(free) and no_proof(runs[AT_REST])
    strict = _departures(free, task.knowing(whole, (0.0, 0.0)))
    moved = {name: far for name, far in strict.items() if "bias" in name}
    return found, _departures(free, own), FreeToFind(task.moved, moved, len(free.refused), lost, why)


def _one(recordings: Sequence[Recording]) -> Recording:
    if len(recordings) != 1:
        raise UsageError(
            f"A drive is one recording, and {len(recordings)} were given: verify them one by one."
        )
    return recordings[0]


def _plausible_fixes(path: Path) -> tuple[GnssTrack, int, list[str]]:
    """Fixes that fit the receiver's own velocities, how many do not, and what is to be said of those."""
    track = read_track(path)
    if len(track) < _FEWEST_FIXES:
        raise RecordingError(
            f"{track.name} has {len(track)} position{'s' if len(track) != 1 else ''}: a drive takes some minutes of "
            "them, one a second or more."
        )
    fitting = fit_velocities(track)
    left_out = int(np.count_nonzero(~fitting))
    words = (
        f"{left_out} of {len(fitting)} positions do not fit the receiver's own velocities between them and were "
        "left out as outliers."
    )
    return track.rows(fitting), left_out, [words] if left_out else []


def _moved(turn_on: tuple[float, float] | None, grade: Grade) -> tuple[tuple[float, float], str]:
    """By how much biases may have moved since the calibration, m/s² and rad/s, and this in words."""
    moved = turn_on or (
        min(TURN_ON[0], grade.accelerometer.bias / 4.0),
        min(TURN_ON[1], grade.gyroscope.bias / 4.0),
    )
    return moved, (
        f"Biases may have moved since the calibration by {two_digits(moved[0] / 9.80665e-3)} mg and "
        f"{two_digits(float(np.degrees(moved[1])) * 3600.0)} °/h (one sigma; --turn-on-bias says otherwise)."
    )


def _about_clocks(drive: Drive, track: GnssTrack) -> list[str]:
    """What is to be said of clocks that are apart, or whose offset is not the only one that fits."""
    clock, words = drive.clock, list[str]()
    # a clock that counts from its own start may be apart by anything
    dated = {float(time[0]) > _DATED for time in (drive.samples.time, track.time)}
    if abs(clock.offset) >= 1.0 and len(dated) == 1:
        spans = spans_in_words(drive.samples, track)
        words.append(f"{spans}; the clocks are {abs(clock.offset):.2f} s apart. The offset was taken out.")
    if clock.second_best > 0.9 * clock.correlation:
        words.append(
            "The offset of the clocks is not the only one that fits (correlations of "
            f"{clock.correlation:.2f} and {clock.second_best:.2f}): give a longer part of the drive, with turns."
        )
    return words


def _lengths(drive: Drive) -> list[float]:
    """Lengths of the outages that the drive has room for."""
    room = float(drive.track.time[-1]) - drive.start.time - _settle(drive)
    fitting = [duration for duration in OUTAGES if duration < 0.5 * room]
    if not fitting:
        raise RecordingError(
            f"The drive lasts {room + _settle(drive):.0f} s, too short to cut outages out: record some minutes with "
            "turns."
        )
    return fitting


def _settle(drive: Drive) -> float:
    return min(120.0, 0.3 * (float(drive.track.time[-1]) - drive.start.time))


def _seconds(lengths: Sequence[float], drive: float) -> list[float]:
    """Lengths of the free drift: to a minute where the drive has some, whatever the outages."""
    longest = max(*lengths, 61.0 if drive > 90.0 else 0.0)
    usual = [1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0]
    return sorted({*(t for t in usual if t < longest), *lengths})


def _free_biases(setup: FilterSetup, grade: Grade) -> FilterSetup:
    """The filter with biases that the drive may find by itself; the calibration's covariance would hold them back."""
    covariance = setup.sensor_covariance.copy()
    for at, state in enumerate(setup.states):
        triad = 0 if state.kind == "accelerometer" else 1
        if state.column < 0:
            sheet = (grade.accelerometer.bias, grade.gyroscope.bias)[triad]
            covariance[at, at] += min(sheet, _FREE[triad]) ** 2
    return setup.with_sensor_covariance(covariance)


def _departures(run: FilterRun, allowed: FilterSetup) -> dict[str, Departure]:
    """Sensor states that the drive determines, and how far they are from the calibration's in what both allow."""
    found: dict[str, Departure] = {}
    span = float(run.time[-1] - run.time[0])
    for at, state in enumerate(allowed.states):
        after = float(run.sigmas[-1, 9 + at]) ** 2
        before = float(run.setup.sensor_covariance[at, at]) + state.drive * span
        known = float(allowed.sensor_covariance[at, at]) + state.drive * span
        if known <= 0.0 or after > 0.5 * before:
            continue
        estimate = float(run.sensors[-1, at])
        # a bias is determined by the drive alone, a matrix by both: what its prior leaves is before less after
        spread = known + after if state.column < 0 else before - after
        found[state.name] = Departure(estimate, estimate / float(np.sqrt(spread)))
    return found


def _gap_words(gaps: Sequence[tuple[float, float]]) -> str:
    longest = max(gaps, key=lambda gap: gap[1] - gap[0])
    missing = sum(last - first for first, last in gaps)
    anew = sum(last - first > LONGEST_BRIDGED for first, last in gaps)
    how = "the filter bridges them by a straight line"
    if anew:
        which = "it" if len(gaps) == 1 else f"{anew} of them"
        how = f"the filter starts anew after {which}, keeping what it knows of the sensors"
    return (
        f"IMU samples are missing in {len(gaps)} stretch{'es' if len(gaps) > 1 else ''} of "
        f"{missing:.2f} s in all (longest {longest[1] - longest[0]:.2f} s at {longest[0]:.1f} s): "
        f"{how}. No free drift or outage that touches one is counted, so that they do not change what "
        "is said of the calibration."
    )


def _refuse_bad_numbers(lever_arm_b: Sequence[float], turn_on: Sequence[float]) -> None:
    if len(lever_arm_b) != 3 or not np.all(np.abs(lever_arm_b) < 100.0):
        raise UsageError(
            "--lever-arm takes three numbers X,Y,Z in metres, below 100 each, from the IMU to the antenna."
        )
    check_turn_on(turn_on)
