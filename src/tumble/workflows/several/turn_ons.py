"""From several recordings of one unit, each a turn-on of its own, to one calibration."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from tumble.calibration.checks.unseen import state_gravity, state_unseen_clock
from tumble.calibration.joint import calibrate
from tumble.calibration.objections import say_of_prior
from tumble.calibration.procedure import find_procedure
from tumble.calibration.session import Options, Session
from tumble.counting import counted
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError, TumbleError, UsageError
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.workflows.given.prior import Known
from tumble.workflows.given.protocols import GivenProtocol, read_given_protocol
from tumble.workflows.magnetometer import left_out_of
from tumble.workflows.procedures import add_remarks, believed, find_holds
from tumble.workflows.request import OF_ONE_UNIT, CalibrateRequest, refuse
from tumble.workflows.results import CalibrationRun, Clock
from tumble.workflows.several.joining import (
    corrected_by_before,
    join_recordings,
    join_timelines,
    labels_of,
    read_as_told,
    require_one_unit,
)

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.calibration.outcome.estimate import JointOutcome
    from tumble.calibration.prior import StableKnowledge
    from tumble.calibration.turn_ons.estimate import SeveralEstimate
    from tumble.document import Calibration

SUFFIXES = (".yaml", ".yml")
# A recording that shows this is left out by name, and not the others with it.
LEFT_OUT = (SegmentationError, ObservabilityError, ConvergenceError)
REASON = "Procedure joint: {count} recordings of one unit, each a turn-on of its own, in one adjustment."


@dataclass(frozen=True, slots=True)
class _Named:
    """A recording as it was named: its files, what was done, and a name for words."""

    files: tuple[Path, ...]
    given: GivenProtocol | None
    name: str


@dataclass(frozen=True, slots=True)
class _Settled:
    """A recording that was adjusted by itself."""

    name: str
    session: Session
    estimate: Estimate
    outcome: JointOutcome


def calibrate_turn_ons(
    request: CalibrateRequest, known: Known, clock: Clock
) -> tuple[CalibrationRun, list[str]]:
    """Calibrate one unit from several recordings of it, by the joint estimator.

    What is stable is common to all recordings; biases are each recording's own, and how they scatter is told. Returns
    the run, and what all recordings were corrected by before.

    Parameters
    ----------
    request : two or more recordings; each a file, two files with one triad each (``acc.csv,gyro.csv``), or a protocol
        file that names its recording. Its protocol is that of the recordings that are no protocol files themselves.
    known : of the angles, which count once, as if the first recording told them, too.
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
    options = Options(optional_terms=request.optional_terms, confirm_scale=request.confirm_scale)
    sessions = [
        (
            one.name,
            Session(recording, told, request.site, options=options, say=_saying(request.say, one.name)),
        )
        for one, recording, told in read
    ]
    settled, absent = _settle_all(sessions, known.angles, clock)
    request.say("all recordings together")
    several, settled, strange = _together(settled, known.angles, optional_terms=request.optional_terms)
    sessions, taken = [own.session for own in settled], {own.name for own in settled}
    several.estimate.say("caution", *absent, *strange)
    # One unit samples all its recordings.
    clocks = (session.recording.clock for session in sessions)
    state_unseen_clock(max(clocks, key=lambda one: one.sigma), several.estimate)
    if known.angles is not None:
        say_of_prior(several.estimate, sessions, known.angles)
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
    settled: list[_Settled], knowledge: StableKnowledge | None, *, optional_terms: bool
) -> tuple[SeveralEstimate, list[_Settled], list[str]]:
    """Adjust those that can be adjusted together; the others are named."""
    from tumble.calibration.turn_ons.adjustment import adjust_several, find_strangers
    from tumble.calibration.turn_ons.estimate import several_estimate

    names, outcomes = [own.name for own in settled], [own.outcome for own in settled]
    strangers = find_strangers(names, outcomes, optional_terms=optional_terms)
    said = [f"{names[k]} takes no part: {why}" for k, why in strangers.items()]
    kept = [k for k in range(len(names)) if k not in strangers]
    # An earlier calibration counts once, with the first that takes part.
    outcomes[kept[0]] = replace(outcomes[kept[0]], knowledge=knowledge)
    outcome = adjust_several(
        [names[k] for k in kept], [outcomes[k] for k in kept], optional_terms=optional_terms
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
    from tumble.document import calibration_from_estimate
    from tumble.document.turn_ons_block import turn_ons_block

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


def _saying(say: Callable[[str], None], name: str) -> Callable[[str], None]:
    return lambda words: say(f"{name}: {words}")
