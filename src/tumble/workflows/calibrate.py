"""From recordings to a calibration, its report and a verdict."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from tumble.calibration.checks.unseen import state_gravity
from tumble.calibration.estimate import Beside
from tumble.calibration.objections import say_of_prior
from tumble.calibration.procedure import Estimator, find_procedure
from tumble.calibration.session import Options, Session
from tumble.document.display import calibration_html
from tumble.earth import Site
from tumble.errors import (
    CalibrationFileError,
    ConvergenceError,
    ObservabilityError,
    OutputError,
    SegmentationError,
    TumbleError,
    UsageError,
)
from tumble.files import results_folder
from tumble.limits import read_limits, with_limits
from tumble.recording import Recording, read_recordings
from tumble.recording.formats.frames import Frame
from tumble.recording.reading import Paths, recording_inputs
from tumble.records import dataclass
from tumble.workflows.given.noise_models import NoiseOfHolds
from tumble.workflows.given.notes import Notes, notes_of
from tumble.workflows.given.prior import known_beforehand
from tumble.workflows.given.protocols import GivenProtocol, read_given_protocol
from tumble.workflows.given.site import given_site
from tumble.workflows.magnetometer import (
    add_magnetometer,
    field_alone,
    given_field,
    no_holds,
    refuse_field_of_none,
)
from tumble.workflows.procedures import add_remarks, check_procedure, find_estimator, run_procedure
from tumble.workflows.progress import public, silent
from tumble.workflows.several.joining import NamedSpan, check_files, join_recordings, named_spans

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.calibration.magnetometer.estimate import GivenField
    from tumble.calibration.prior import StableKnowledge
    from tumble.document import Calibration
    from tumble.limits.reading import Limits
    from tumble.protocol import Protocol
    from tumble.report.page import Page
    from tumble.report.subject import Subject
    from tumble.segmentation import HoldMeans, Timeline
    from tumble.segmentation.matching import Matching

# An interval's ends need a thousand draws; a million take a minute or two.
FEWEST_DRAWS, MOST_DRAWS = 1_000, 1_000_000

OF_A_PAPER = "The estimator {} as its paper has it, not tumble's own."

Given: TypeAlias = Paths | Recording


@dataclass(slots=True)
class CalibrationRun:
    """What `calibrate` made: the calibration, everything behind it, and where the files are.

    `reason` says why the procedure was chosen; `matching` which hold is which step of the `protocol`, where
    one was given; `seconds` what each stage took; `predicted` the standard uncertainties (SI) of a plan.json beside the
    protocol; `papers` by file name what a paper's own estimator makes of the recording.
    """

    calibration: Calibration
    estimate: Estimate
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    reason: str
    protocol: Protocol | None = None
    matching: Matching | None = None
    files: list[Path] = field(default_factory=list[Path])
    seconds: dict[str, float] = field(default_factory=dict[str, float])
    predicted: dict[str, float] = field(default_factory=dict[str, float])
    papers: dict[str, Calibration] = field(default_factory=dict[str, "Calibration"])

    @property
    def accepted(self) -> bool:
        """Whether the calibration is fit for use, and within its limits if it was held against any."""
        limits = self.calibration.limits
        return self.calibration.verdict.fit and (limits is None or limits.decision == "passed")

    def __repr__(self) -> str:
        holds, turns = len(self.timeline.holds), len(self.timeline.turns)
        where = f"; files: {', '.join(map(str, self.files))}" if self.files else ""
        return f"<CalibrationRun of {holds} holds and {turns} turns: {self.calibration!r}{where}>"

    def to_frame(self) -> Any:
        """Return the parameters as a data frame of polars, see `Calibration.to_frame`."""
        return self.calibration.to_frame()

    def figures(self) -> dict[str, Any]:
        """Return the report's figures by name, as a notebook shows them: each a `plotly.graph_objects.Figure`."""
        from plotly import graph_objects

        from tumble.report.figures.on_page import plot

        plots = map(plot, self.page().figures)
        return {
            plot["name"]: graph_objects.Figure(data=plot["data"], layout=plot["layout"]) for plot in plots
        }

    def page(self) -> Page:
        """Return the report, before it is a file."""
        from tumble.report.calibration import calibration_page

        return calibration_page(self.subject)

    @property
    def subject(self) -> Subject:
        """What the report is made from."""
        from tumble.report.subject import Subject

        made = (self.calibration, self.estimate, self.recording, self.timeline, self.means)
        return Subject(*made, self.protocol, self.matching, self.predicted)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the calibration, and where its files are."""
        return calibration_html(self.calibration, self.reason, self.files)


@public
def calibrate(
    paths: Given = (),
    *,
    output: str | os.PathLike[str] | None = None,
    procedure: str | None = None,
    protocol: str | os.PathLike[str] | None = None,
    site: Site | None = None,
    columns: str | None = None,
    units: str | None = None,
    rate: float | str | None = None,
    topics: str | Sequence[str] | None = None,
    prior: str | os.PathLike[str] | None = None,
    intervals: str | os.PathLike[str] | None = None,
    optional_terms: bool = True,
    confirm_scale: bool = False,
    estimator: str | None = None,
    noise: str | os.PathLike[str] | None = None,
    monte_carlo: int | None = None,
    imu: tuple[str | None, str | None] = (None, None),
    notes: Notes = None,
    limits: str | os.PathLike[str] | None = None,
    field: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> CalibrationRun:
    """Calibrate the IMU of one or several recordings.

    Parameters
    ----------
    paths : one recording (a file, or a pair of files with one triad each), or several of one unit; a data frame
        of pandas or polars stands for a file, and a `Recording` for what was read; empty for those
        that the protocol names.
    output : folder for ``calibration.json`` and ``report.html``; None writes nothing.
    procedure : its name, of `tumble.procedure_names`; None lets the protocol decide, or else the recording.
    protocol : a protocol file, or the name of one of `tumble.protocol.PROTOCOLS`: what was done.
    site : gravity and latitude; None takes the protocol's, or else assumes standard gravity with an
        uncertainty of 0.015 m/s².
    columns, units, rate, topics : what the files do not say, as for `tumble.read_recording`.
    prior : an earlier calibration of the unit, whose non-orthogonalities are kept; or the name of one of
        `tumble.simulation.GRADES`, or a file of `tumble registry fleet`: what is known of such units beforehand.
    intervals : file of the holds' start and stop in seconds, instead of finding them.
    optional_terms : try g-sensitivity and quadratic terms.
    confirm_scale : scale factors beyond what units have are really the unit's, and no reason against its calibration.
    estimator : name of a paper's own estimator, whose result stands beside the joint one.
    noise : noise.json of the unit: its models instead of the holds' scatter say how well their means are known.
    monte_carlo : draws for the propagation of distributions (JCGM 101), for the joint estimator only.
    imu : (model, serial number) to note in the document.
    notes : what else to note by name: operator, place, instrument, remarks.
    limits : file of acceptance limits, which the calibration is held against.
    field : the magnetic field at the site, see `given_field`; None where it is not known.
    progress : called with a sentence on what is being done.

    Raises
    ------
    RecordingError, SegmentationError, ObservabilityError, ConvergenceError
        If the recording cannot serve; the message says what was found and what to do.
    UsageError, CalibrationFileError, ProtocolError
        If an option is wrong.
    OutputError
        If the results cannot be written; earlier ones are intact.
    """
    say, clock = progress or silent, Clock()
    site, noted = given_site(site), notes_of(notes)
    known, sheet = (None, None) if prior is None else known_beforehand(prior, imu[1])
    options = Options(optional_terms, sheet, confirm_scale)
    paper = None if estimator is None else find_estimator(estimator, has_protocol=protocol is not None)
    check_procedure(procedure, has_protocol=protocol is not None)
    _refuse_odd(monte_carlo)
    folder, acceptance = results_folder(output), None if limits is None else read_limits(Path(limits))
    say("reading")
    given = None if protocol is None else _read_consistent(protocol)
    magnetic = given_field(field, site or (given and given.protocol.site))
    recording, told, files = read_as_told(paths, given, columns, units, rate, topics)
    refuse_field_of_none(recording, magnetic)
    session = _session(recording, told, site, procedure, options, known, say)
    modelled = None if noise is None else NoiseOfHolds.read(noise, recording)
    before = corrected_by_before(paths, given, topics)
    clock.lap("reading")
    try:
        estimate, reason = _estimated(session, procedure, intervals, files, modelled, clock)
    except (SegmentationError, ObservabilityError) as error:
        if recording.magnetic_field is None or procedure is not None or told is not None or intervals:
            raise
        unheeded = {"prior": prior, "noise": noise, "monte-carlo": monte_carlo, "estimator": estimator}
        run = _field_run(session, magnetic, error, imu, clock, unheeded)
    else:
        add_magnetometer(session, estimate, magnetic)
        _draw(estimate, monte_carlo, say)
        clock.lap("solving")
        made = _document(session, estimate, reason, imu)
        run = CalibrationRun(made, estimate, recording, session.timeline, session.means, reason)
        run.papers = {} if paper is None else _papers(session, estimate, paper, imu)
        run.protocol, run.matching = told, session.matching
        run.predicted = {} if given is None else given.predicted()
    run.calibration = completed(run.calibration, noted, before, acceptance)
    run.papers = {name: completed(own, noted, before) for name, own in run.papers.items()}
    return finish_run(run, folder, clock, say)


def _papers(
    session: Session, estimate: Estimate, paper: Estimator, imu: tuple[str | None, str | None]
) -> dict[str, Calibration]:
    """Put a paper's own estimate beside; return its document by its file's name."""
    try:
        own = paper.estimate(session)
    except (SegmentationError, ObservabilityError, ConvergenceError, UsageError) as error:
        raise type(error)(f"The estimator {paper.name} does not serve here: {error} Leave it out.") from error
    estimate.show(Beside(own, paper.source))
    own_document = _document(session, own, OF_A_PAPER.format(paper.name), imu)
    return {f"calibration-{paper.name}.json": own_document}


def _read_consistent(protocol: str | os.PathLike[str]) -> GivenProtocol:
    """The protocol; what it says against itself would else look like a fault of the recording."""
    from tumble.protocol.consistency import refuse_contradicting_turns

    given = read_given_protocol(protocol)
    refuse_contradicting_turns(given.protocol)
    return given


def _session(
    recording: Recording,
    told: Protocol | None,
    site: Site | None,
    procedure: str | None,
    options: Options,
    known: StableKnowledge | None,
    say: Callable[[str], None],
) -> Session:
    chosen = procedure if procedure is not None or told is None else told.procedure
    by_temperature = chosen is not None and find_procedure(chosen).by_temperature
    return Session(
        recording, told, site, by_temperature=by_temperature, prior=known, options=options, say=say
    )


def _estimated(
    session: Session,
    procedure: str | None,
    intervals: str | os.PathLike[str] | None,
    files: Sequence[NamedSpan],
    modelled: NoiseOfHolds | None,
    clock: Clock,
) -> tuple[Estimate, str]:
    """What the procedure finds, with what is to be said of its holds, noise, prior and site; and why it was chosen."""
    find_holds(session, intervals, clock)
    if modelled is not None:
        session.means = modelled.means_of(session)
    without_holds = check_files(session, files) if session.protocol is None else []
    estimate, reason = run_procedure(session, procedure)
    add_remarks(session, estimate, procedure, reason, without_holds)
    if modelled is not None:
        estimate.say("remark", *modelled.said())
    if session.prior is not None:
        say_of_prior(estimate, [session], session.prior)
    state_gravity(session.site, estimate)
    return estimate, reason


def _document(
    session: Session, estimate: Estimate, reason: str, imu: tuple[str | None, str | None]
) -> Calibration:
    from tumble.document import calibration_from_estimate

    recording, confirm_scale = session.recording, session.options.confirm_scale
    remarks = (reason, *(r.text for r in recording.remarks))
    return calibration_from_estimate(
        estimate, recording, session.site, remarks=remarks, imu=imu, confirm_scale=confirm_scale
    )


def completed(
    calibration: Calibration, notes: dict[str, str], before: list[str], acceptance: Limits | None = None
) -> Calibration:
    """Return the document with notes and what its recordings were corrected by, held against limits if there are any.

    Parameters
    ----------
    calibration : as it was made.
    notes, before : of `notes_of` and `corrected_by_before`.
    acceptance : the limits.
    """
    calibration = calibration.model_copy(update={"notes": notes, "input_corrected_by": before})
    return calibration if acceptance is None else with_limits(calibration, acceptance)


def finish_run(
    run: CalibrationRun, folder: Path | None, clock: Clock, say: Callable[[str], None]
) -> CalibrationRun:
    """Write the files of a run, if a folder is named, and return it with what each stage took.

    Parameters
    ----------
    run, folder : what was made, and where it goes; None writes nothing.
    clock : of the stages.
    say : is told what is done.
    """
    run.seconds = clock.seconds
    if folder is not None:
        say("writing the report")
        write_run(run, folder)
        clock.lap("reporting")
    return run


def _field_run(
    session: Session,
    given: GivenField | None,
    why: TumbleError,
    imu: tuple[str | None, str | None],
    clock: Clock,
    unheeded: Mapping[str, object],
) -> CalibrationRun:
    """The magnetometer by itself, where the recording determines no other triad."""
    try:
        document, estimate = field_alone(session, given, str(why), imu)
    except ObservabilityError as further:
        lasts = session.recording.duration
        short = f"The recording is too short: it lasts {lasts:.1f} s, and nine poses take half a minute. "
        said = f"{short if lasts < 30.0 else ''}{why} The magnetometer does not serve by itself either. {further}"
        raise type(why)(said) from why
    for option in (option for option, value in unheeded.items() if value is not None):
        raise UsageError(
            f"--{option} is for accelerometers and gyros, and only the magnetometer can be calibrated here: leave it "
            f"out. {why}"
        )
    clock.lap("solving")
    reason = "The magnetometer alone, by the norm of its field: the recording determines no other triad."
    return CalibrationRun(document, estimate, session.recording, *no_holds(), reason)


def _refuse_odd(runs: int | None) -> None:
    if runs is not None and not FEWEST_DRAWS <= runs <= MOST_DRAWS:
        raise UsageError(f"--monte-carlo {runs}: give a number of draws from {FEWEST_DRAWS} to {MOST_DRAWS}.")


def _draw(estimate: Estimate, runs: int | None, say: Callable[[str], None]) -> None:
    """Draw the distributions of the parameters; the seed is fixed, so that the same call says the same."""
    if runs is None:
        return
    from tumble.calibration.outcome.draws import draw_distributions

    draw_distributions(estimate, runs, np.random.default_rng(101), say)


def read_as_told(
    paths: Given,
    given: GivenProtocol | None,
    columns: str | None,
    units: str | None,
    rate: float | str | None,
    topics: str | Sequence[str] | None,
) -> tuple[Recording, Protocol | None, list[NamedSpan]]:
    """Read the recordings named, or the protocol's own; options go before what the protocol says.

    Returns the recordings as one, the protocol on its clock, and where on it each recording is.

    Parameters
    ----------
    paths, given : as named, and the protocol that was given, if one was.
    columns, units, rate, topics : as for `calibrate`.

    Raises
    ------
    UsageError
        If nothing is named, or the recordings are not of one unit with the same columns.
    """
    if isinstance(paths, Recording):
        if columns or units or rate or topics:
            raise UsageError(
                "A Recording was read already: say columns, units, rate and topics when it is read, not afterwards."
            )
        recordings = [paths]
    else:
        named = _files_of(paths, given)
        if not named:
            raise UsageError(
                f"The protocol {given.protocol.name} names no recordings: give them, or list them in its file."
                if given is not None
                else "Name a recording, or a protocol file that names its recordings (--protocol FILE): "
                "see `tumble calibrate --help`."
            )
        if given is not None:
            protocol = given.protocol
            columns, units, rate = columns or protocol.columns, units or protocol.units, rate or protocol.rate
        recordings = read_recordings(named, columns=columns, units=units, rate=rate, topics=topics)
    recording, spans = join_recordings(recordings)
    told = None if given is None else given.on_clock_of(recordings, spans)
    return recording, told, named_spans(recordings, spans)


def _files_of(paths: Given, given: GivenProtocol | None) -> Sequence[Path | Frame]:
    """What was named, or the protocol's own files; nothing of a recording that was read before."""
    if isinstance(paths, Recording) or (isinstance(paths, list | tuple) and not paths):
        return [] if given is None else given.files()
    return recording_inputs(paths)


def corrected_by_before(
    paths: Given, given: GivenProtocol | None, topics: str | Sequence[str] | None = None
) -> list[str]:
    """Return the identities of the calibrations that all recordings were corrected by before.

    Parameters
    ----------
    paths, given : as named, and the protocol that was given, if one was.
    topics : of bags, those that are read.

    Raises
    ------
    UsageError
        If they were not all corrected by the same.
    """
    from tumble.workflows.corrected.corrections import corrections_of

    marks = {corrections_of([one], topics) for one in _files_of(paths, given)}
    if len(marks) > 1:
        words = "; ".join(", ".join(mark) or "none" for mark in sorted(marks))
        raise UsageError(
            f"The recordings were corrected by different calibrations ({words}): take all of them raw, or all "
            "corrected by the same."
        )
    return list(marks.pop()) if marks else []


def find_holds(session: Session, intervals: str | os.PathLike[str] | None, clock: Clock) -> None:
    """Find holds and turns, and which step of the protocol each of them is.

    Parameters
    ----------
    session : of one recording.
    intervals : as for `calibrate`.
    clock : is told how long it takes.
    """
    session.say("finding holds and turns")
    from tumble.segmentation import read_intervals

    clock.lap("importing")
    session.intervals = None if intervals is None else read_intervals(Path(intervals))
    if session.by_temperature:
        from tumble.calibration.thermal.coverage import require_time_base

        require_time_base(session.recording, session.protocol)
    # Asked for now, so that what is wrong with holds is said before anything else.
    _ = session.means, session.matching
    clock.lap("segmenting")


def write_run(run: CalibrationRun, folder: Path) -> None:
    """Write both files beside their places, then rename both.

    Earlier calibrations there, of other recordings or such as cannot be read, papers' too, are kept as
    ``calibration-before-IDENTITY.json``.

    Parameters
    ----------
    run, folder : what was made, and where it goes; the run is told its files.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to.
    """
    from tumble.files import check_target, write_texts

    made = {"calibration.json": run.calibration, **run.papers}
    texts = {folder / name: one.to_json() for name, one in made.items()}
    kept = {
        place: copy
        for place in sorted({*texts, *folder.glob("calibration-*.json")})
        if place.is_file() and (copy := _of_other_recordings(place, run.calibration, place in texts))
    }
    for place in kept:
        check_target(place)
    run.files = write_texts(texts | {folder / "report.html": report_of(run)} | dict(kept.values()))
    for place in kept.keys() - texts.keys():
        place.unlink()


def _of_other_recordings(place: Path, made: Calibration, written: bool) -> tuple[Path, bytes] | None:
    """What is to be kept of a file, and where; None if it is of the same recordings, or not tumble's and left there."""
    from tumble.document import read_calibration

    try:
        text = place.read_bytes()
    except OSError as error:
        raise OutputError(
            f"{place} cannot be read, and so not be kept: give another folder with -o."
        ) from error
    try:
        earlier = read_calibration(place)
    except CalibrationFileError:
        identity, other = sha256(text).hexdigest()[:12], written
    else:
        before, now = ({one.sha256 for one in of.recordings} for of in (earlier, made))
        paper = OF_A_PAPER.format(place.stem.removeprefix("calibration-")) in earlier.remarks
        identity, other = earlier.identity, before != now and (written or paper)
    return (place.with_name(f"calibration-before-{identity}.json"), text) if other else None


def report_of(run: CalibrationRun, library: str | None = None) -> str:
    """Return the report of a run as HTML.

    Parameters
    ----------
    run : what was made.
    library : where the plotting library lies, seen from the page; None puts it into the page.
    """
    from tumble.report.calibration import render_report

    return render_report(run.subject, library)


class Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
