"""From recordings to a calibration, its report and a verdict."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, OutputError, UsageError
from tumble.recording import (
    Recording,
    Remark,
    find_dead_channels,
    find_saturated_channels,
    read_recordings,
)

if TYPE_CHECKING:
    from tumble.calibration import Calibration, Estimate
    from tumble.calibration.prior import StableKnowledge
    from tumble.segmentation import HoldMeans, Timeline

PROCEDURES = ("hand-held", "multi-position")
LATER_PROCEDURES = (
    "six-position",
    "improved-six-position",
    "rate-table",
    "modified-multi-position",
    "turntable",
    "laboratory",
    "strapdown-rotation",
    "thermal",
    "joint",
)
# Between recordings of separate poses: long enough that no hold and no turn goes across.
PAUSE = 10.0

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


@dataclass(slots=True)
class CalibrationRun:
    """What `calibrate` made: the calibration, everything behind it, and where the files are.

    `reason` says why the procedure was chosen; `seconds` what each stage took.
    """

    calibration: Calibration
    estimate: Estimate
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    reason: str
    files: list[Path] = field(default_factory=list[Path])
    seconds: dict[str, float] = field(default_factory=dict[str, float])


def calibrate(
    paths: Paths,
    *,
    output: str | os.PathLike[str] | None = None,
    procedure: str | None = None,
    site: Site | None = None,
    columns: str | None = None,
    units: str | None = None,
    rate: float | None = None,
    prior: str | os.PathLike[str] | None = None,
    intervals: str | os.PathLike[str] | None = None,
    optional_terms: bool = True,
    unknowns: int | None = None,
    imu: tuple[str | None, str | None] = (None, None),
    progress: Callable[[str], None] | None = None,
) -> CalibrationRun:
    """Calibrate the IMU of one or several recordings.

    Parameters
    ----------
    paths : one recording (a file, or a pair of files with one triad each), or several of one unit.
    output : folder for ``calibration.json`` and ``report.html``; None writes nothing.
    procedure : one of `PROCEDURES`; None lets the recording decide.
    site : gravity and latitude; None assumes standard gravity with an uncertainty of 0.015 m/s².
    columns, units, rate : what the files do not say, as for `tumble.read_recording`.
    prior : an earlier calibration of the unit, whose non-orthogonalities are kept.
    intervals : file of the holds' start and stop in seconds, instead of finding them.
    optional_terms : try g-sensitivity and quadratic terms.
    unknowns : 9, 6 or 3 a triad, for the multi-position procedure only.
    imu : (model, serial number) to note in the document.
    progress : is told in words what is being done.

    Raises
    ------
    RecordingError, SegmentationError, ObservabilityError, ConvergenceError
        If the recording cannot serve; the message says what was found and what to do.
    UsageError, CalibrationFileError
        If an option is wrong.
    OutputError
        If the results cannot be written; earlier ones are intact.
    """
    say = progress or _silent
    _check_procedure(procedure, unknowns)
    folder = None if output is None else Path(output)
    if folder is not None:
        _require_writable(folder)
    clock = _Clock()
    say("reading")
    recording = _one_recording(read_recordings(paths, columns=columns, units=units, rate=rate))
    knowledge = _knowledge(prior, imu[1])
    clock.lap("reading")

    say("finding holds and turns")
    from tumble.segmentation import find_timeline, observe_holds, read_intervals

    clock.lap("importing")
    given = None if intervals is None else read_intervals(Path(intervals))
    timeline = find_timeline(recording, intervals=given)
    means = observe_holds(recording, timeline)
    clock.lap("segmenting")

    from tumble.calibration import calibration_from_estimate

    place = site or Site.unknown()
    estimate, reason = _estimate(
        recording, timeline, means, place, procedure, knowledge, optional_terms, unknowns, say
    )
    _add_objections(estimate, recording, timeline, procedure, reason)
    if knowledge is not None:
        _test_prior(estimate, knowledge, recording, means, place)
    if site is None:
        estimate.remarks.append(
            f"Gravity was not given and is taken as {place.gravity:.5f} ± {place.gravity_sigma:.3f} m/s², which makes "
            f"every accelerometer scale factor uncertain by {100 * place.gravity_sigma / place.gravity:.2f} %: "
            "give --site LATITUDE[,HEIGHT] or --gravity."
        )
    clock.lap("solving")

    calibration = calibration_from_estimate(
        estimate, recording, place, remarks=(reason, *(r.text for r in recording.remarks)), imu=imu
    )
    run = CalibrationRun(calibration, estimate, recording, timeline, means, reason, [], clock.seconds)
    if folder is not None:
        say("writing the report")
        _write(run, folder)
        clock.lap("reporting")
    return run


def _check_procedure(procedure: str | None, unknowns: int | None) -> None:
    if unknowns is not None and procedure != "multi-position":
        raise UsageError(
            "--unknowns is for the multi-position procedure: add --procedure multi-position, or leave it out."
        )
    if procedure is None or procedure in PROCEDURES:
        return
    if procedure in LATER_PROCEDURES:
        raise UsageError(
            f"The procedure {procedure} is not part of this version: it has {', '.join(PROCEDURES)}."
        )
    raise UsageError(f"There is no procedure {procedure!r}: choose one of {', '.join(PROCEDURES)}.")


def _require_writable(folder: Path) -> None:
    """Refuse early what would fail after minutes of work."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder for calibration.json and report.html.")
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise OutputError(
            f"The folder {folder} cannot be made: {existing} is a file. Give another folder with -o."
        )
    if not os.access(existing, os.W_OK):
        raise OutputError(f"{existing} cannot be written to: give another folder with -o.")


def _one_recording(recordings: list[Recording]) -> Recording:
    """Return one recording; several are put one after the other with a pause between.

    Raises
    ------
    UsageError
        If they differ in units or sensors, or one is given twice.
    """
    if len(recordings) == 1:
        return recordings[0]
    first = recordings[0]
    seen: dict[str, str] = {}
    for source in (source for recording in recordings for source in recording.sources):
        if source.sha256 in seen:
            raise UsageError(
                f"{source.name} and {seen[source.sha256]} are the same recording: it tells nothing more a second time."
            )
        seen[source.sha256] = source.name
    for other in recordings[1:]:
        same = (
            other.specific_force_unit == first.specific_force_unit
            and other.angular_rate_unit == first.angular_rate_unit
            and (other.specific_force is None) == (first.specific_force is None)
            and (other.angular_rate is None) == (first.angular_rate is None)
        )
        if not same:
            raise UsageError(
                f"{other.sources[0].name} has other units or sensors than {first.sources[0].name}: "
                "only recordings of one unit with the same columns can be calibrated together."
            )
    return _concatenated(recordings)


def _concatenated(recordings: list[Recording]) -> Recording:
    times: list[np.ndarray] = []
    gaps: list[int] = []
    end, samples = 0.0, 0
    for number, recording in enumerate(recordings):
        moved = recording.time - recording.time[0] + (end + PAUSE if number else 0.0)
        gaps += [samples + gap for gap in recording.gaps] + ([samples] if number else [])
        times.append(moved)
        end, samples = float(moved[-1]), samples + len(recording)

    def joined(name: str) -> np.ndarray | None:
        parts = [getattr(recording, name) for recording in recordings]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    first = recordings[0]
    remarks = [remark for recording in recordings for remark in recording.remarks]
    remarks.append(Remark("found", f"{len(recordings)} recordings are taken together as one unit's."))
    return Recording(
        time=np.concatenate(times),
        specific_force=joined("specific_force"),
        angular_rate=joined("angular_rate"),
        specific_force_unit=first.specific_force_unit,
        angular_rate_unit=first.angular_rate_unit,
        rate=first.rate,
        temperature=joined("temperature"),
        sources=tuple(source for recording in recordings for source in recording.sources),
        remarks=tuple(dict.fromkeys(remarks)),
        gaps=tuple(sorted(gaps)),
    )


def _knowledge(prior: str | os.PathLike[str] | None, serial: str | None) -> StableKnowledge | None:
    """Read what an earlier calibration knows of the accelerometers' angles."""
    if prior is None:
        return None
    from tumble.calibration.prior import stable_knowledge
    from tumble.calibration.result import read_calibration

    earlier = read_calibration(prior)
    if serial is not None and earlier.imu.serial_number not in (None, serial):
        raise UsageError(
            f"{prior} is the calibration of unit {earlier.imu.serial_number}, and this is unit {serial}: "
            "a prior must be of the same unit."
        )
    size = len(earlier.covariance_parameters)
    names = {name: index for index, name in enumerate(earlier.covariance_parameters)}
    at = [names.get(f"accelerometer.matrix[{i},{j}]", size) for i in range(3) for j in range(3)]
    if size in at or earlier.accelerometer.matrix is None:
        raise UsageError(
            f"{prior} states no accelerometer matrix with its covariance: it cannot serve as --prior."
        )
    covariance = earlier.covariance_matrix[np.ix_(at, at)]
    return stable_knowledge(np.array(earlier.accelerometer.matrix, dtype=float), covariance)


def _estimate(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    site: Site,
    procedure: str | None,
    knowledge: StableKnowledge | None,
    optional_terms: bool,
    unknowns: int | None,
    say: Callable[[str], None],
) -> tuple[Estimate, str]:
    """Run the procedure asked for, or the one that the recording suits; say why."""
    from tumble.calibration import calibrate_hand_held, calibrate_multi_position

    turns = sum(turn.usable for turn in timeline.turns)
    both = recording.specific_force is not None and recording.angular_rate is not None

    def hand_held() -> Estimate:
        return calibrate_hand_held(
            recording, timeline, means, site, prior=knowledge, optional_terms=optional_terms, progress=say
        )

    def multi_position() -> Estimate:
        return calibrate_multi_position(
            recording, means, site, prior=knowledge, unknowns=unknowns or 9, progress=say
        )

    if procedure == "hand-held":
        return hand_held(), "Procedure hand-held, as asked for."
    if procedure == "multi-position":
        return multi_position(), "Procedure multi-position, as asked for."
    from tumble.calibration.hand_held import SMALLEST_TURNS

    if not both:
        return multi_position(), "Procedure multi-position: the recording has one triad only."
    if turns < SMALLEST_TURNS:
        return multi_position(), (
            f"Procedure multi-position: {turns} turns between holds can be used, and the hand-held "
            f"procedure needs {SMALLEST_TURNS}."
        )
    try:
        return hand_held(), (
            f"Procedure hand-held: {len(timeline.holds)} holds and {turns} turns between them were found, "
            "which tell both triads."
        )
    except ObservabilityError as error:
        # Too few poses are too few for either; only what the gyro lacks leaves the other way open.
        estimate = multi_position()
        return estimate, f"Procedure multi-position: the turns do not tell the gyro. {error}"


def _add_objections(
    estimate: Estimate, recording: Recording, timeline: Timeline, procedure: str | None, reason: str
) -> None:
    """Say what a user who meant a whole calibration does not get, and what was wrong with the sensors."""
    from tumble.calibration.hand_held import SMALLEST_TURNS

    estimate.objections += find_dead_channels(recording)
    estimate.remarks += find_saturated_channels(recording)
    lost = [turn for turn in timeline.turns if not turn.usable]
    estimate.remarks += [
        f"The turn from hold {turn.before + 1} to hold {turn.after + 1} was not used: {turn.reason}."
        for turn in lost[:5]
    ]
    if len(lost) > 5:
        estimate.remarks.append(f"{len(lost) - 5} more turns were not used for such reasons.")
    meant_for_turns = procedure is None and recording.angular_rate is not None
    if meant_for_turns and estimate.procedure == "multi-position" and len(timeline.turns) >= SMALLEST_TURNS:
        because = f" {len(lost)} of them cannot be used ({lost[0].reason})." if lost else ""
        estimate.objections.append(
            f"The recording has {len(timeline.turns)} turns, but they do not calibrate the gyro.{because} {reason} "
            "With --procedure multi-position the accelerometers' part is judged alone."
        )


def _test_prior(
    estimate: Estimate,
    knowledge: StableKnowledge,
    recording: Recording,
    means: HoldMeans,
    place: Site,
) -> None:
    """Object to a prior that the poses contradict, where they can tell the angles without it."""
    from tumble.calibration import calibrate_multi_position
    from tumble.calibration.prior import find_contradiction, stable_knowledge

    try:
        alone = calibrate_multi_position(recording, means, place)
    except (ObservabilityError, ConvergenceError):
        estimate.remarks.append(
            "The poses are too few to check the prior against them: it is taken on trust."
        )
        return
    assert alone.model.accelerometer is not None
    own = stable_knowledge(alone.model.accelerometer.matrix, alone.covariance[:9, :9])
    contradiction = find_contradiction(knowledge, own)
    if contradiction is not None:
        estimate.objections.append(contradiction)


def _write(run: CalibrationRun, folder: Path) -> None:
    """Write both files beside their places, then rename both."""
    from tumble.recording.writing import uninterrupted, written_beside
    from tumble.report.html import render_report

    report = render_report(
        calibration=run.calibration,
        estimate=run.estimate,
        recording=run.recording,
        timeline=run.timeline,
        means=run.means,
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"The folder {folder} cannot be made: {error.strerror or error}.") from error
    document, page = folder / "calibration.json", folder / "report.html"
    # Both are complete on the disk before either takes its place.
    with ExitStack() as stack:
        for place, text in ((document, run.calibration.to_json()), (page, report)):
            beside = stack.enter_context(written_beside(place))
            with beside.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        with uninterrupted():
            stack.pop_all().close()
    run.files = [document, page]


class _Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now


def _silent(_: str) -> None:
    """Tell nobody."""
