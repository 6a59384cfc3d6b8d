"""Judging a calibration by a drive with satellite positions: free drift, outages, and what the filter says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.counting import counted
from tumble.document import Calibration, read_calibration
from tumble.errors import RecordingError, UsageError
from tumble.navigation import (
    Drive,
    FilterRun,
    FilterSetup,
    GnssTrack,
    find_rest,
    outages,
    prepare_drive,
    read_track,
    smooth,
)
from tumble.navigation.drive import sharpen_clock, wide_setup
from tumble.navigation.filter.run import LONGEST_BRIDGED
from tumble.navigation.gnss.track import fit_velocities
from tumble.navigation.outages import free_drift
from tumble.navigation.time_alignment import spans_in_words
from tumble.recording import Recording, read_recordings
from tumble.recording.reading import recording_inputs
from tumble.records import dataclass
from tumble.simulation.grades import Grade, find_grade
from tumble.workflows.apply import in_calibration_units, raw_factors
from tumble.workflows.corrected.corrections import corrections_of, refuse_twice
from tumble.workflows.progress import silent
from tumble.workflows.request import OF_NO_DRIVE, DriveRequest, asked, refuse
from tumble.workflows.verification.calibration_parts import (
    AT_REST,
    WHOLE,
    CorrectedBy,
    corrected_by_parts,
    start_covariance,
    without_rest_rate,
)
from tumble.workflows.verification.drive_filter import about_innovations, drive_filter
from tumble.workflows.verification.drive_verification import (
    Departure,
    DriveVerification,
    Errors,
    FreeToFind,
    TimeOffset,
    Variant,
    judge_drive,
    no_proof,
    variant_of,
)
from tumble.workflows.verify import made_from

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
    _refuse_bad_numbers(arm.tolist(), request.turn_on)
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


@dataclass(slots=True)
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


def _refuse_bad_numbers(lever_arm_b: Sequence[float], turn_on: tuple[float, float] | None) -> None:
    if len(lever_arm_b) != 3 or not np.all(np.abs(lever_arm_b) < 100.0):
        raise UsageError(
            "--lever-arm takes three numbers X,Y,Z in metres, below 100 each, from the IMU to the antenna."
        )
    if turn_on is not None and not (turn_on[0] >= 0.0 and turn_on[1] >= 0.0):
        raise UsageError("--turn-on-bias takes two numbers that are not negative: mg and °/h.")
