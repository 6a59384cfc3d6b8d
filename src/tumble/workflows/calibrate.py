"""From recordings to a calibration, its report and a verdict."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import fields, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from tumble.calibration import (
    Beside,
    Estimator,
    Options,
    Session,
    check_prior,
    find_procedure,
    state_gravity,
)
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError, TumbleError, UsageError
from tumble.files import results_folder
from tumble.limits import read_limits, with_limits
from tumble.workflows.given import GivenProtocol, Known, given_site, known_beforehand, read_given_protocol
from tumble.workflows.magnetometer import (
    add_magnetometer,
    field_alone,
    given_field,
    no_holds,
    refuse_field_of_none,
)
from tumble.workflows.noise import NoiseOfHolds
from tumble.workflows.procedures import (
    add_remarks,
    check_procedure,
    find_estimator,
    find_holds,
    run_procedure,
)
from tumble.workflows.request import CalibrateRequest, asked, notes_of
from tumble.workflows.results import OF_A_PAPER, CalibrationRun, Clock, write_run
from tumble.workflows.several import NamedSpan, check_files, corrected_by_before, read_as_told

if TYPE_CHECKING:
    from tumble.calibration import Estimate, GivenField
    from tumble.document import Calibration

# An interval's ends need a thousand draws; a million take a minute or two.
FEWEST_DRAWS, MOST_DRAWS = 1_000, 1_000_000


@asked(CalibrateRequest)
def calibrate(request: CalibrateRequest) -> CalibrationRun:
    """Calibrate the IMU of one or several recordings.

    Raises
    ------
    RecordingError, SegmentationError, ObservabilityError, ConvergenceError
        If the recording cannot serve; the message says what was found and what to do.
    UsageError, CalibrationFileError, ProtocolError
        If an option is wrong.
    OutputError
        If the results cannot be written; earlier ones are intact.
    """
    noted, clock = notes_of(request.notes), Clock()
    if request.registry is not None:
        from tumble.workflows.registry import require_registry

        require_registry(request.registry, request.imu[1])
    request = replace(request, site=given_site(request.site))
    known = Known() if request.prior is None else known_beforehand(request.prior, request.imu[1])
    # What a user says of the estimate has one name there and in the request.
    told = {one.name: getattr(request, one.name) for one in fields(Options) if one.name != "data_sheet"}
    options = Options(**told, data_sheet=known.sheet)
    folder = results_folder(request.output)
    acceptance = None if request.limits is None else read_limits(Path(request.limits))
    if request.turn_ons:
        from tumble.workflows.several import calibrate_turn_ons

        run, before = calibrate_turn_ons(request, known, options, clock)
    else:
        run, before = _calibrate_one(request, known, options, clock)

    def completed(made: Calibration) -> Calibration:
        return structs.replace(made, notes=noted, input_corrected_by=before)

    run.calibration = completed(run.calibration)
    if acceptance is not None:
        run.calibration = with_limits(run.calibration, acceptance)
    run.papers = {name: completed(own) for name, own in run.papers.items()}
    run.seconds = clock.seconds
    if folder is not None:
        request.say("writing the report")
        write_run(run, folder)
        clock.lap("reporting")
    if request.registry is not None:
        from tumble.workflows.registry import add_calibration

        add_calibration(request.registry, run.calibration)
    return run


def _calibrate_one(
    request: CalibrateRequest, known: Known, options: Options, clock: Clock
) -> tuple[CalibrationRun, list[str]]:
    """What one recording gives, or several as one; and what it was corrected by before."""
    has_protocol = request.protocol is not None
    paper = (
        None if request.estimator is None else find_estimator(request.estimator, has_protocol=has_protocol)
    )
    check_procedure(request.procedure, has_protocol=has_protocol)
    draws = request.monte_carlo
    if draws is not None and not FEWEST_DRAWS <= draws <= MOST_DRAWS:
        raise UsageError(
            f"--monte-carlo {draws}: give a number of draws from {FEWEST_DRAWS} to {MOST_DRAWS}."
        )
    request.say("reading")
    given = None if request.protocol is None else _read_consistent(request.protocol)
    magnetic = given_field(request.field, request.site or (given and given.protocol.site))
    recording, told, spans = read_as_told(request, given)
    refuse_field_of_none(recording, magnetic)
    chosen = request.procedure if request.procedure is not None or told is None else told.procedure
    session = Session(
        recording,
        told,
        request.site,
        by_temperature=chosen is not None and find_procedure(chosen).by_temperature,
        prior=known.angles,
        options=options,
        say=request.say,
    )
    modelled = None if request.noise is None else NoiseOfHolds.read(request.noise, recording)
    before = corrected_by_before(request, given)
    clock.lap("reading")
    try:
        estimate, reason = _estimated(session, request, spans, modelled, clock)
    except (SegmentationError, ObservabilityError) as error:
        asked_for = has_protocol or request.procedure is not None or request.intervals
        if recording.magnetic_field is None or asked_for:
            raise
        return _field_run(session, request, magnetic, error, clock), before
    add_magnetometer(session, estimate, magnetic)
    _draw(estimate, draws, request.say)
    clock.lap("solving")
    made = _document(session, estimate, reason, request)
    run = CalibrationRun(made, estimate, recording, session.timeline, session.means, reason)
    run.papers = {} if paper is None else _papers(session, estimate, paper, request)
    run.protocol, run.matching = session.protocol, session.matching
    run.predicted = {} if given is None else given.predicted()
    return run, before


def _papers(
    session: Session, estimate: Estimate, paper: Estimator, request: CalibrateRequest
) -> dict[str, Calibration]:
    """Put a paper's own estimate beside; return its document by its file's name."""
    try:
        own = paper.estimate(session)
    except (SegmentationError, ObservabilityError, ConvergenceError, UsageError) as error:
        raise type(error)(f"The estimator {paper.name} does not serve here: {error} Leave it out.") from error
    estimate.show(Beside(own, paper.source))
    own_document = _document(session, own, OF_A_PAPER.format(paper.name), request)
    return {f"calibration-{paper.name}.json": own_document}


def _read_consistent(protocol: str | os.PathLike[str]) -> GivenProtocol:
    """The protocol; what it says against itself would else look like a fault of the recording."""
    from tumble.protocol import refuse_contradicting_turns

    given = read_given_protocol(protocol)
    refuse_contradicting_turns(given.protocol)
    return given


def _estimated(
    session: Session,
    request: CalibrateRequest,
    spans: list[NamedSpan],
    modelled: NoiseOfHolds | None,
    clock: Clock,
) -> tuple[Estimate, str]:
    """What the procedure finds, with what is to be said of its holds, noise, prior and site; and why it was chosen."""
    find_holds(session, request.intervals, clock)
    if modelled is not None:
        session.means = modelled.means_of(session)
    without_holds = check_files(session, spans) if session.protocol is None else []
    estimate, reason = run_procedure(session, request.procedure)
    add_remarks(session, estimate, request.procedure, reason, without_holds)
    if modelled is not None:
        estimate.say("remark", *modelled.said())
    if session.prior is not None:
        check_prior(estimate, [session], session.prior)
    state_gravity(session.site, estimate)
    return estimate, reason


def _document(session: Session, estimate: Estimate, reason: str, request: CalibrateRequest) -> Calibration:
    from tumble.document import calibration_from_estimate

    remarks = (reason, *(r.text for r in session.recording.remarks))
    return calibration_from_estimate(
        estimate,
        session.recording,
        session.site,
        remarks=remarks,
        imu=request.imu,
        confirm_scale=request.confirm_scale,
    )


def _field_run(
    session: Session, request: CalibrateRequest, given: GivenField | None, why: TumbleError, clock: Clock
) -> CalibrationRun:
    """The magnetometer by itself, where the recording determines no other triad."""
    try:
        document, estimate = field_alone(session, given, str(why), request.imu)
    except ObservabilityError as further:
        lasts = session.recording.duration
        short = f"The recording is too short: it lasts {lasts:.1f} s, and nine poses take half a minute. "
        said = f"{short if lasts < 30.0 else ''}{why} The magnetometer does not serve by itself either. {further}"
        raise type(why)(said) from why
    for option in ("prior", "noise", "monte_carlo", "estimator"):
        if getattr(request, option) is None:
            continue
        raise UsageError(
            f"--{option.replace('_', '-')} is for accelerometers and gyros, and only the magnetometer can be "
            f"calibrated here: leave it out. {why}"
        )
    clock.lap("solving")
    reason = "The magnetometer alone, by the norm of its field: the recording determines no other triad."
    return CalibrationRun(document, estimate, session.recording, *no_holds(), reason)


def _draw(estimate: Estimate, runs: int | None, say: Callable[[str], None]) -> None:
    """Draw the distributions of the parameters; the seed is fixed, so that the same call says the same."""
    if runs is None:
        return
    from tumble.calibration import draw_distributions

    draw_distributions(estimate, runs, np.random.default_rng(101), say)


RECORDING = "mpu9150-imu0.csv.gz"
"""The recording that ships with the package: its authors state 100 Hz and use 9.81 m/s² (tumble/data/NOTICE)."""
RATE, GRAVITY = 100.0, 9.81


def demo(output: str | os.PathLike[str], *, progress: Callable[[str], None] | None = None) -> CalibrationRun:
    """Calibrate the MPU-9150 recording of the package into the folder `output`.

    Raises
    ------
    OutputError
        If the results cannot be written.
    """
    with as_file(files("tumble") / "data" / RECORDING) as path:
        return calibrate(
            path,
            output=output,
            site=Site.from_gravity(GRAVITY),
            columns="ax,ay,az,gx,gy,gz",
            units="m/s^2,rad/s",
            rate=RATE,
            imu=("MPU-9150", None),
            progress=progress,
        )
