"""The recordings that were named, as one: several of one unit are put one after the other, with a pause between.

Or each of them is a turn-on of its own, and all give one calibration.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import structs

from tumble.calibration import (
    Options,
    Session,
    calibrate,
    check_prior,
    find_procedure,
    state_gravity,
    state_unseen_clock,
)
from tumble.counting import counted
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError, TumbleError, UsageError
from tumble.parameters import parameter_of
from tumble.recording import (
    Frame,
    MagneticField,
    Paths,
    Recording,
    Remark,
    joined_fields,
    read_recordings,
    recording_inputs,
)
from tumble.records import dataclass
from tumble.workflows.corrected import corrections_of
from tumble.workflows.given import GivenProtocol, Known, Span, read_given_protocol
from tumble.workflows.magnetometer import left_out_of
from tumble.workflows.procedures import add_remarks, believed, find_holds
from tumble.workflows.request import OF_ONE_UNIT, CalibrateRequest, refuse
from tumble.workflows.results import CalibrationRun, Clock

if TYPE_CHECKING:
    from tumble.calibration import Estimate, JointOutcome, SeveralEstimate, StableKnowledge
    from tumble.document import Calibration
    from tumble.protocol import Protocol
    from tumble.segmentation import Hold, HoldMeans, Rejection, Timeline, Turn


# Between recordings of separate poses: long enough that no hold and no turn goes across.
PAUSE = 10.0

NamedSpan = tuple[str, Span]

# Holds of a file from which on their scatter, or what they tell of the accelerometers by themselves, is compared.
FEWEST_SCATTERED, FEWEST_ALONE = 4, 12
# Files of one unit that was switched on once differ by no more: in the scatter of the holds of a file, and in standard
# uncertainties (repeated calibrations of real units differ by twice as many as they should).
LARGEST_BIAS_STEP, LARGEST_DIFFERENCE = 6.0, 8.0


def read_as_told(
    request: CalibrateRequest, given: GivenProtocol | None
) -> tuple[Recording, Protocol | None, list[NamedSpan]]:
    """Read the recordings named, or the protocol's own; options go before what the protocol says.

    Returns the recordings as one, the protocol on its clock, and where on it each recording is.

    Parameters
    ----------
    request, given : what was asked for, and the protocol that was given, if one was.

    Raises
    ------
    UsageError
        If nothing is named, or the recordings are not of one unit with the same columns.
    """
    how = request.how()
    if isinstance(request.paths, Recording):
        recordings = [request.paths]
    else:
        named = _files_of(request.paths, given)
        if not named:
            raise UsageError(
                f"The protocol {given.protocol.name} names no recordings: give them, or list them in its file."
                if given is not None
                else "Name a recording, or a protocol file that names its recordings (--protocol FILE): "
                "see `tumble calibrate --help`."
            )
        if given is not None:
            how |= {key: how[key] or getattr(given.protocol, key) for key in ("columns", "units", "rate")}
        recordings = read_recordings(named, **how)
    recording, spans = join_recordings(recordings)
    told = None if given is None else given.on_clock_of(recordings, spans)
    return recording, told, named_spans(recordings, spans)


def _files_of(paths: Paths | Recording, given: GivenProtocol | None) -> Sequence[Path | Frame]:
    """What was named, or the protocol's own files; nothing of a recording that was read before."""
    if isinstance(paths, Recording) or (isinstance(paths, list | tuple) and not paths):
        return [] if given is None else given.files()
    return recording_inputs(paths)


def corrected_by_before(request: CalibrateRequest, given: GivenProtocol | None) -> list[str]:
    """Return the identities of the calibrations that all recordings were corrected by before.

    Parameters
    ----------
    request, given : what was asked for, and the protocol that was given, if one was.

    Raises
    ------
    UsageError
        If they were not all corrected by the same.
    """
    marks = {corrections_of([one], request.topics) for one in _files_of(request.paths, given)}
    if len(marks) > 1:
        words = "; ".join(", ".join(mark) or "none" for mark in sorted(marks))
        raise UsageError(
            f"The recordings were corrected by different calibrations ({words}): take all of them raw, or all "
            "corrected by the same."
        )
    return list(marks.pop()) if marks else []


def join_recordings(recordings: list[Recording]) -> tuple[Recording, list[Span]]:
    """Return one recording, and where each of the several lies on its clock, in seconds.

    Parameters
    ----------
    recordings : of one unit, in order; a single one stays as it is.

    Raises
    ------
    UsageError
        If they differ in units or sensors, or one is given twice.
    """
    if len(recordings) == 1:
        only = recordings[0]
        return only, [(float(only.time[0]), float(only.time[-1]))]
    _require_different(recordings)
    _require_same_columns(recordings)
    return _concatenated(recordings)


def require_one_unit(recordings: list[Recording]) -> None:
    """Refuse recordings that cannot be of one unit with the same columns, and one that is given twice.

    Parameters
    ----------
    recordings : to be calibrated together.

    Raises
    ------
    UsageError
        If they differ in units or sensors, or one is given twice, under another name too.
    """
    _require_different(recordings)
    for earlier, recording in itertools.combinations(recordings, 2):
        if _same_samples(recording, earlier):
            raise UsageError(
                f"{recording.sources[0].name} and {earlier.sources[0].name} hold the same "
                "samples: the same recording adds nothing a second time."
            )
    _require_same_columns(recordings)


def _same_samples(one: Recording, other: Recording) -> bool:
    """Whether two files hold the same samples, stamps aside."""
    pairs = ((one.specific_force, other.specific_force), (one.angular_rate, other.angular_rate))
    return all(
        (a is None and b is None) or (a is not None and b is not None and np.array_equal(a, b))
        for a, b in pairs
    )


def named_spans(recordings: Sequence[Recording], spans: Sequence[Span]) -> list[NamedSpan]:
    """Return by what name each recording goes, and where it lies on the joined one's clock.

    Parameters
    ----------
    recordings, spans : as given to `join_recordings`, and from there.
    """
    known = [(one.sources[0].name, span) for one, span in zip(recordings, spans, strict=True) if one.sources]
    return [*zip(labels_of([name for name, _ in known]), (span for _, span in known), strict=True)]


def labels_of(names: Sequence[str]) -> list[str]:
    """Return the shortest names that tell recordings apart: file names, with folders before them, or with numbers.

    A folder's ``protocol.yaml`` goes by the folder's name.

    Parameters
    ----------
    names : of the recordings in order, as paths or as file names alone.
    """
    paths = [Path(name) for name in names]
    parts = [p.parent.parts if p.name == "protocol.yaml" and p.parent.name else p.parts for p in paths]
    for length in range(1, max((len(own) for own in parts), default=0) + 1):
        short = ["/".join(own[-length:]) for own in parts]
        if len(set(short)) == len(short):
            return short
    return [f"{name} ({number})" for number, name in enumerate(names, 1)]


def check_files(session: Session, files: Sequence[NamedSpan]) -> list[str]:
    """Refuse files that are not of one unit switched on once; return what speaks against those without a hold.

    Parameters
    ----------
    session : of recordings that were joined, without a protocol that says what each of them is.
    files : where each of them is.

    Raises
    ------
    UsageError
        If two files with many holds have other gyro biases, or other accelerometers.
    """
    if len(files) < 2:
        return []
    time = session.means.time
    named = [(name, np.flatnonzero((time >= start) & (time <= stop))) for name, (start, stop) in files]
    for (one, its), (other, others) in itertools.combinations(named, 2):
        difference = _rate_difference(session, its, others) or _force_difference(session, its, others)
        if difference:
            raise UsageError(
                f"{one} and {other} are not of one unit that was switched on once: {difference}. Give --turn-ons if it "
                "is the same unit, switched on anew; else calibrate each by itself."
            )
    return [
        f"{name} gives no hold, and the result is of the other files alone: look at it with tumble inspect. Recordings "
        "of different units are calibrated each by itself."
        for name, holds in named
        if not holds.size
    ]


def _rate_difference(session: Session, *holds: np.ndarray) -> str:
    """By how much the gyros at rest differ between two files, if far beyond what holds of a file do."""
    rates = session.means.angular_rate
    if rates is None or min(own.size for own in holds) < FEWEST_SCATTERED:
        return ""
    one, other = (rates[own] for own in holds)
    scatter = np.sqrt(0.5 * (one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)))
    step = np.abs(np.median(one, axis=0) - np.median(other, axis=0))
    if not np.any(step > LARGEST_BIAS_STEP * scatter):
        return ""
    axis = int(np.argmax(step - LARGEST_BIAS_STEP * scatter))
    return (
        f"at rest gyro {'xyz'[axis]} differs by {step[axis]:.2g} {session.recording.angular_rate_unit} between them, "
        f"and within a file by {scatter[axis]:.2g}"
    )


def _force_difference(session: Session, *holds: np.ndarray) -> str:
    """By how much the accelerometers differ that the holds of each of two files tell by themselves."""
    if session.means.specific_force is None or min(own.size for own in holds) < FEWEST_ALONE:
        return ""
    from tumble.calibration import calibrate_accelerometers

    try:
        one, other = (
            calibrate_accelerometers(session, _means_of(session.means, own), own.tolist()) for own in holds
        )
    except (ObservabilityError, ConvergenceError):
        return ""
    others = {parameter.name: parameter for parameter in other.parameters}
    for own in one.parameters:
        its = others.get(own.name)
        if its is None or parameter_of(own.name).family.triad != "accelerometer":
            continue
        sigma = np.hypot(own.standard_uncertainty, its.standard_uncertainty)
        if abs(own.value - its.value) > LARGEST_DIFFERENCE * sigma:
            return (
                f"by themselves they have {own.name} {own.value:.4g} and {its.value:.4g} {own.unit}, "
                f"{abs(own.value - its.value) / sigma:.0f} standard uncertainties apart"
            )
    return ""


def _means_of(means: HoldMeans, holds: np.ndarray) -> HoldMeans:
    """Some of the holds."""
    parts = {f.name: getattr(means, f.name) for f in fields(means)}
    own = {
        name: None if value is None else value[holds]
        for name, value in parts.items()
        if name not in ("modelled", "parts")
    }
    return replace(means, **own, parts=None)


def join_timelines(
    recording: Recording, timelines: Sequence[Timeline], means: Sequence[HoldMeans], starts: Sequence[int]
) -> tuple[Timeline, HoldMeans]:
    """Return holds, turns and means of several recordings as those of the joined one.

    Parameters
    ----------
    recording : the joined one.
    timelines, means : of each recording by itself.
    starts : index of each one's first sample in the joined recording.
    """
    from tumble.segmentation import Timeline

    holds: list[Hold] = []
    turns: list[Turn] = []
    rejections: list[Rejection] = []
    for timeline, start in zip(timelines, starts, strict=True):
        turns += [
            replace(
                t,
                before=t.before + len(holds),
                after=t.after + len(holds),
                start=t.start + start,
                stop=t.stop + start,
            )
            for t in timeline.turns
        ]
        rejections += [replace(r, start=r.start + start, stop=r.stop + start) for r in timeline.rejections]
        holds += [
            replace(
                h,
                start=h.start + start,
                stop=h.stop + start,
                excluded=tuple((a + start, b + start) for a, b in h.excluded),
            )
            for h in timeline.holds
        ]
    whole = Timeline(tuple(holds), tuple(turns), tuple(rejections), timelines[0].noise_floor)
    return whole, _joined_means(recording, whole, means)


def _joined_means(recording: Recording, timeline: Timeline, means: Sequence[HoldMeans]) -> HoldMeans:
    from tumble.segmentation import observe_parts

    def every(name: str) -> Any:
        parts = [getattr(own, name) for own in means]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    middle = [0.5 * (recording.time[h.start] + recording.time[h.stop - 1]) for h in timeline.holds]
    names = [f.name for f in fields(means[0]) if f.name not in ("time", "parts", "modelled")]
    return replace(
        means[0],
        **{name: every(name) for name in names},
        time=np.array(middle),
        parts=observe_parts(recording, timeline),
    )


def _require_different(recordings: list[Recording]) -> None:
    seen: dict[str, str] = {}
    sources = [source for recording in recordings for source in recording.sources]
    for source, name in zip(sources, labels_of([source.name for source in sources]), strict=True):
        if source.sha256 in seen:
            raise UsageError(
                f"{name} and {seen[source.sha256]} are the same recording: it adds nothing a second time."
            )
        seen[source.sha256] = name


def _require_same_columns(recordings: list[Recording]) -> None:
    first = recordings[0]
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


def _concatenated(recordings: list[Recording]) -> tuple[Recording, list[Span]]:
    times: list[np.ndarray] = []
    magnetic: list[MagneticField | None] = []
    gaps: list[int] = []
    spans: list[Span] = []
    end, samples = 0.0, 0
    for number, recording in enumerate(recordings):
        moved = recording.time - recording.time[0] + (end + PAUSE if number else 0.0)
        gaps += [samples + gap for gap in recording.gaps] + ([samples] if number else [])
        times.append(moved)
        field = recording.magnetic_field
        magnetic.append(
            None if field is None else replace(field, time=field.time + float(moved[0] - recording.time[0]))
        )
        end, samples = float(moved[-1]), samples + len(recording)
        spans.append((float(moved[0]), end))

    def joined(name: str) -> np.ndarray | None:
        parts = [getattr(recording, name) for recording in recordings]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    first = recordings[0]
    remarks = [remark for recording in recordings for remark in recording.remarks]
    remarks.append(Remark("found", f"{len(recordings)} recordings are taken together as one unit's."))
    whole = Recording(
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
        temperature_unit=first.temperature_unit,
        said_clock=max((recording.clock for recording in recordings), key=lambda clock: clock.sigma),
        magnetic_field=joined_fields(magnetic),
    )
    return whole, spans


SUFFIXES = (".yaml", ".yml")
# A recording that shows this is left out by name, and not the others with it.
LEFT_OUT = (SegmentationError, ObservabilityError, ConvergenceError)
REASON = "Procedure joint: {count} recordings of one unit, each a turn-on of its own, in one adjustment."


@dataclass(frozen=True)
class _Named:
    """A recording as it was named: its files, what was done, and a name for words."""

    files: tuple[Path, ...]
    given: GivenProtocol | None
    name: str


@dataclass(frozen=True)
class _Settled:
    """A recording that was adjusted by itself."""

    name: str
    session: Session
    estimate: Estimate
    outcome: JointOutcome


def calibrate_turn_ons(
    request: CalibrateRequest, known: Known, options: Options, clock: Clock
) -> tuple[CalibrationRun, list[str]]:
    """Calibrate one unit from several recordings of it, by the joint estimator.

    What is stable is common to all recordings; biases are each recording's own, and how they scatter is told. Returns
    the run, and what all recordings were corrected by before.

    Parameters
    ----------
    request : two or more recordings; each a file, two files with one triad each (``acc.csv,gyro.csv``), or a protocol
        file that names its recording. Its protocol is that of the recordings that are no protocol files themselves.
    known : of the angles, which count once, as if the first recording told them, too.
    options : of the estimate.
    clock : of the stages.

    Raises
    ------
    RecordingError, SegmentationError, ObservabilityError, ConvergenceError
        If a recording cannot serve; the message names it.
    UsageError, ProtocolError, CalibrationFileError
        If the recordings are not of one unit, or an option is wrong.
    """
    if request.procedure not in (None, "joint"):
        raise UsageError(
            f"--turn-ons is the joint estimator's, and --procedure {request.procedure} was asked for: leave one of "
            "them out."
        )
    refuse(request, OF_ONE_UNIT, "{} does not go with --turn-ons: leave one of them out.")
    named = _named(request)
    if known.sheet is not None:
        raise UsageError(
            f"--turn-ons takes an earlier calibration of the unit as --prior, and {request.prior} is none."
        )
    read = [(one, *read_as_told(replace(request, paths=one.files), one.given)[:2]) for one in named]
    require_one_unit([recording for _, recording, _ in read])
    clock.lap("reading")
    sessions = [
        (
            one.name,
            Session(
                recording,
                told,
                request.site,
                options=options,
                say=lambda words, name=one.name: request.say(f"{name}: {words}"),
            ),
        )
        for one, recording, told in read
    ]
    settled, absent = _settle_all(sessions, known.angles, clock)
    request.say("all recordings together")
    several, settled, strange = _together(settled, known.angles, options)
    sessions, taken = [own.session for own in settled], {own.name for own in settled}
    several.estimate.say("caution", *absent, *strange)
    # One unit samples all its recordings.
    clocks = (session.recording.clock for session in sessions)
    state_unseen_clock(max(clocks, key=lambda one: one.sigma), several.estimate)
    if known.angles is not None:
        check_prior(several.estimate, sessions, known.angles)
    state_gravity(_one_site(sessions), several.estimate)
    several.estimate.say("remark", *left_out_of([s.recording for s in sessions]))
    clock.lap("solving")
    files = [file for one in named if one.name in taken for file in one.files]
    return _run(sessions, several, request), corrected_by_before(replace(request, paths=files), None)


def _named(request: CalibrateRequest) -> list[_Named]:
    """Resolve what was named: files, pairs of files, and protocol files with their own recordings."""
    given = request.paths if isinstance(request.paths, list | tuple) else [request.paths]
    recordings = [one for one in given if isinstance(one, str | os.PathLike)]
    if len(recordings) < len(given):
        raise UsageError("--turn-ons takes files: name each recording by its file.")
    if len(recordings) < 2:
        count = "one recording was" if recordings else "none was"
        raise UsageError(
            f"--turn-ons takes two recordings of the unit or more, each made after it was switched on anew; {count} "
            "given. Without --turn-ons a single one is calibrated."
        )
    default = None if request.protocol is None else read_given_protocol(request.protocol)
    made: list[_Named] = []
    for text, label in zip(recordings, labels_of([str(r) for r in recordings]), strict=True):
        path, given = Path(text), default
        pair = str(text).split(",")
        files = [path] if path.exists() or len(pair) != 2 else [Path(part.strip()) for part in pair]
        if path.suffix.lower() in SUFFIXES or (path / "protocol.yaml").is_file():
            given = read_given_protocol(path)
            if not (files := given.files()):
                raise UsageError(f"The protocol {path} names no recording: list it in the file.")
        made.append(_Named(tuple(files), given, label))
    return made


def _settle_all(
    sessions: Sequence[tuple[str, Session]], knowledge: StableKnowledge | None, clock: Clock
) -> tuple[list[_Settled], list[str]]:
    """Adjust each recording by itself; what cannot take part is named, and the others are not refused with it."""
    settled: list[_Settled] = []
    absent: list[str] = []
    for name, session in counted(sessions, len(sessions)):
        session.prior = None if settled else knowledge
        session.say("reading")
        try:
            find_holds(session, None, clock)
            settled.append(_settle(name, session))
        except TumbleError as error:
            why = f"{name} cannot take part: {error}"
            if not isinstance(error, LEFT_OUT) or len(sessions) - len(absent) < 3:
                raise type(error)(why) from error
            absent.append(why)
        clock.lap("solving")
    return settled, absent


def _settle(name: str, session: Session) -> _Settled:
    """Adjust a recording by itself, as far as it goes."""
    estimate = calibrate(session, believed(session, find_procedure("joint")), clocked=False)
    add_remarks(session, estimate, "joint", "")
    if session.matching is not None:
        estimate.say("remark", *(r for r in session.matching.remarks if r not in estimate.remarks))
    assert session.joint is not None
    return _Settled(name, session, estimate, session.joint)


def _together(
    settled: list[_Settled], knowledge: StableKnowledge | None, options: Options
) -> tuple[SeveralEstimate, list[_Settled], list[str]]:
    """Adjust those that can be adjusted together; the others are named."""
    from tumble.calibration import adjust_several, find_strangers, several_estimate

    names, outcomes = [own.name for own in settled], [own.outcome for own in settled]
    strangers = find_strangers(names, outcomes, optional_terms=options.optional_terms)
    said = [f"{names[k]} takes no part: {why}" for k, why in strangers.items()]
    kept = [k for k in range(len(names)) if k not in strangers]
    # An earlier calibration counts once, with the first that takes part.
    outcomes[kept[0]] = replace(outcomes[kept[0]], knowledge=knowledge)
    outcome = adjust_several(
        [names[k] for k in kept], [outcomes[k] for k in kept], optional_terms=options.optional_terms
    )
    settled = [settled[k] for k in kept]
    site = _one_site([own.session for own in settled])
    return several_estimate(outcome, [own.estimate for own in settled], site), settled, said


def _one_site(sessions: Sequence[Session]) -> Site:
    """The site whose gravity is least certain: its error is taken to be the same in all recordings."""
    return max((session.site for session in sessions), key=lambda site: site.gravity_sigma / site.gravity)


def _run(sessions: Sequence[Session], several: SeveralEstimate, request: CalibrateRequest) -> CalibrationRun:
    recording = join_recordings([session.recording for session in sessions])[0]
    starts = np.cumsum([0, *(len(session.recording) for session in sessions)])[:-1].tolist()
    timelines, means = [session.timeline for session in sessions], [session.means for session in sessions]
    timeline, together = join_timelines(recording, timelines, means, starts)
    reason = REASON.format(count=len(sessions))
    calibration = _document(recording, several, _one_site(sessions), reason, request)
    return CalibrationRun(calibration, several.estimate, recording, timeline, together, reason)


def _document(
    recording: Recording,
    several: SeveralEstimate,
    site: Site,
    reason: str,
    request: CalibrateRequest,
) -> Calibration:
    """The document: judged by what was measured, with the biases' uncertainty that of the next turn-on."""
    from tumble.document import calibration_from_estimate, turn_ons_block

    estimate, measured = several.estimate, {b.parameter: b.mean_sigma for b in several.turn_ons.biases}
    sigmas = [measured.get(p.name, p.standard_uncertainty) for p in estimate.parameters]
    pairs = zip(estimate.parameters, sigmas, strict=True)
    judged = replace(estimate, parameters=[replace(p, standard_uncertainty=sigma) for p, sigma in pairs])
    remarks = (reason, *dict.fromkeys(remark.text for remark in recording.remarks))
    made = calibration_from_estimate(
        judged, recording, site, remarks=remarks, imu=request.imu, confirm_scale=request.confirm_scale
    )
    factors = zip(made.parameters, estimate.parameters, several.coverage_factors, strict=True)
    parameters = [
        structs.replace(block, standard_uncertainty=p.standard_uncertainty, coverage_factor=factor)
        for block, p, factor in factors
    ]
    return structs.replace(made, parameters=parameters, turn_ons=turn_ons_block(several.turn_ons))
