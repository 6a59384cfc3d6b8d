"""Planning a test before it is done: from what a user says to a plan, its protocol, its pages.

Of any protocol as it is. Of a test of poses these are searched first; what they are worth is then said as of any
protocol: there is one prediction, that of what `tumble calibrate` will state.
"""

from __future__ import annotations

import difflib
import json
import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.calibration import two_digits
from tumble.design import PARAMETER_GROUPS, PARAMETERS, JointInformation, parameters_of
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.files import results_folder
from tumble.workflows.planning.words import Planned, PoseSearch, describe_plan, document_of
from tumble.workflows.request import PlanRequest

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design import JointPlan, PlannedNoise, PlanTask, PosePlan, PoseTask
    from tumble.document import Calibration
    from tumble.protocol import Protocol, Step
    from tumble.simulation import Grade, TriadNoise


LEVELLED, BY_HAND = math.radians(0.5), math.radians(5.0)
"""One sigma to which faces on a plate are levelled, and a unit is laid down."""
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200


def check_search(request: PlanRequest) -> None:
    """Refuse numbers that contradict one another or that no test has.

    Parameters
    ----------
    request : what is planned.

    Raises
    ------
    UsageError
        If there is one.
    """
    poses, minutes, hold, turn = request.poses, request.minutes, request.hold, request.turn
    if poses is not None and minutes is not None:
        raise UsageError(
            "--poses and --time: give the number of poses or the time of the whole test, not both."
        )
    if minutes is not None and hold is not None:
        raise UsageError(
            "--hold and --time: with the time of the whole test the dwells follow; leave --hold out."
        )
    if poses is not None and not 1 <= poses <= MOST_POSES:
        raise UsageError(f"--poses {poses}: give 1 to {MOST_POSES}.")
    if minutes is not None and not 0.0 < minutes <= 10_000.0:
        raise UsageError(f"--time {minutes:g}: give minutes of the whole test, up to 10000.")
    if hold is not None and not 1.0 <= hold <= 100_000.0:
        raise UsageError(f"--hold {hold:g}: give 1 to 100000 seconds of rest in each pose.")
    if turn is not None and not 0.5 <= turn <= 3600.0:
        raise UsageError(f"--turn-seconds {turn:g}: give 0.5 to 3600 seconds from one pose to the next.")


def search_poses(
    request: PlanRequest, planned: PlanTask, grade: Grade, say: Callable[[str], None]
) -> PoseSearch:
    """Return the best poses for a test, and the papers' in the same time.

    Parameters
    ----------
    request, planned, grade : what is asked for, and the unit.
    say : called with a sentence on what is being done.

    Raises
    ------
    UsageError, ObservabilityError
        If there is no time for the poses that are needed, or so many do not tell what is wanted.
    """
    from tumble.design import PoseTask, known_norms, plan_poses, plan_schemes, plan_time

    hold, turn, count = DEFAULTS[request.asked]
    dwell, faces, site = request.hold or hold, request.asked == "six-position", planned.site
    task = PoseTask(planned.noise.accelerometer, planned.noise.rate, request.turn or turn, site.gravity)
    if planned.known is not None or planned.sheet is not None:
        task = replace(task, known=known_norms(planned, site.gravity))
    say("searching")
    rng = np.random.default_rng(request.seed)
    if faces:
        task, found = _levelled(request, task, grade, dwell)
    elif request.minutes is not None:
        found = plan_time(task, 60.0 * request.minutes, rng, say)
    else:
        found = plan_poses(task, request.poses or count, dwell, rng)
    say("comparing")
    schemes = plan_schemes(replace(task, placement=0.0, shortening=0.0), found.duration)
    if faces:
        del schemes["six faces"]
    return PoseSearch(task, found, schemes, _protocol(request.asked, found, LEVELLED if faces else BY_HAND))


def _levelled(request: PlanRequest, task: PoseTask, grade: Grade, dwell: float) -> tuple[PoseTask, PosePlan]:
    """The six faces, in their best order: scale factors and biases alone, and what levelling adds to each."""
    from tumble.attitude import twenty_six_directions
    from tumble.design import NORM_GROUPS, best_order, plan_of

    if request.poses not in (None, 6):
        raise UsageError(f"--poses {request.poses}: a six-position test has its six faces.")
    if (whole := request.minutes) is not None:
        dwell = (60.0 * whole + task.turn) / 6 - task.turn
        if dwell < 1.0:
            raise UsageError(
                f"--time {whole:g}: that leaves no time for six poses and the turns between them."
            )
    # Of a face's own reading: the square of the tilt, and its product with misalignment.
    own = math.hypot(LEVELLED**2, math.sqrt(2.0) * LEVELLED * grade.accelerometer.misalignment)
    wanted = np.array([*NORM_GROUPS["scale"], *NORM_GROUPS["bias"]])
    task = replace(task, wanted=wanted, placement=own, shortening=LEVELLED**2)
    faces = twenty_six_directions()[[0, 5, 1, 4, 2, 3]]
    return task, plan_of("six faces", task, faces[best_order(task, faces, dwell)], np.full(6, dwell))


def _protocol(procedure: str, plan: PosePlan, hand: float) -> Protocol:
    from tumble.calibration import describe_direction
    from tumble.protocol import HoldStep, Pose, Protocol, TurnStep

    steps: list[Step] = []
    for up, dwell in zip(plan.directions, plan.dwells, strict=True):
        steps += [TurnStep(plan.turn)] if steps else []
        steps.append(
            HoldStep(float(dwell), Pose(np.asarray(up, dtype=float), None, hand), describe_direction(up))
        )
    words = f"{len(plan.dwells)} poses, {plan.name}, as tumble plan found them."
    return Protocol(f"{procedure}-plan", procedure, tuple(steps), description=words)


# Of a correlation matrix, what is round-off.
_FLAT = 1e-10


def read_given(
    given: str | os.PathLike[str], recorded: str | os.PathLike[str] | None, task: PlanTask
) -> tuple[JointInformation, list[str]]:
    """Return the information of a recording or of a calibration, with words about it.

    Of a recording it is that of the equations which a calibration begins with: nothing is adjusted.

    Parameters
    ----------
    given : a calibration.json, a folder with one, or a recording.
    recorded : the protocol that it was recorded with; None for none.
    task : the plan that it is for: site, spreads, and how biases wander.

    Raises
    ------
    UsageError, CalibrationFileError, RecordingError, SegmentationError, ProtocolError, ObservabilityError
        If it is neither, or cannot be read.
    """
    path = Path(given)
    if not path.exists():
        raise UsageError(f"--given {path}: there is no such file; give a calibration.json or a recording.")
    if path.is_dir() or path.suffix.lower() == ".json":
        from tumble.document import read_calibration

        calibration = read_calibration(path)
        holds = calibration.quality.holds
        return information_of(calibration), [
            f"{path} is a {calibration.procedure} calibration from {holds} holds."
        ]
    from tumble.calibration import Session, describe_direction, distinct_poses
    from tumble.design import observed_problem
    from tumble.recording import read_recording
    from tumble.workflows.given.protocols import read_given_protocol

    told = None if recorded is None else read_given_protocol(recorded).protocol
    if told is None:
        recording = read_recording(path)
    else:
        recording = read_recording(path, columns=told.columns, units=told.units, rate=told.rate)
    session = Session(recording, told, task.site)
    problem = observed_problem(session, task.noise, g_sensitivity=task.g_sensitivity)
    up_b = -np.concatenate([section.C_wb[:, 1, 2] for section in problem.task.sections])
    names = [describe_direction(up_b[index]) for index in distinct_poses(up_b)]
    counts = f"{len(up_b)} holds and {problem.task.data.turns.size} turns"
    words = f"{path} has {counts}, in {len(names)} different poses: {'; '.join(names)}."
    return problem.information(), [words]


def information_of(calibration: Calibration) -> JointInformation:
    """Return the information that a calibration states of the thirty parameters.

    Parameters
    ----------
    calibration : with its covariance; what it does not state counts as not told.

    Raises
    ------
    UsageError
        If it states no accelerometer matrix.
    """
    from tumble.document import PLACES, put, stacked, turned_to
    from tumble.sensor import propagate

    if calibration.accelerometer is None or calibration.accelerometer.matrix is None:
        raise UsageError("The calibration states no accelerometer matrix: calibrate in more poses first.")
    if calibration.frame.name != "accelerometer-x":
        # A plan's axes are the accelerometers': how a fixture holds the unit is no matter of theirs.
        calibration = turned_to(calibration, "accelerometer-x")
    values, covariance = stacked(calibration)
    if calibration.model.gyroscope is None:
        gyro = PLACES["gyroscope.matrix"][0].start
        covariance[gyro:] = covariance[:, gyro:] = 0.0
        put(values, "gyroscope.matrix", np.eye(3))
    _, covariance = propagate(_parameters, values, covariance)
    spread = np.diag(covariance)
    told = np.flatnonzero(spread > 0.0)
    if not told.size:
        raise UsageError("The calibration states no uncertainties: it cannot say what is missing.")
    information = np.zeros((PARAMETERS, PARAMETERS))
    size = np.sqrt(spread[told])
    correlation = covariance[np.ix_(told, told)] / np.outer(size, size) + _FLAT * np.eye(told.size)
    information[np.ix_(told, told)] = np.linalg.inv(correlation) / np.outer(size, size)
    return JointInformation(information)


def _parameters(values: Any) -> Any:
    """The thirty parameters of a document's numbers, each triad's divided by its own mean scale factor."""
    from tumble.document import term_of

    force, gyro = (term_of(values, f"{kind}.matrix") for kind in ("accelerometer", "gyroscope"))
    sizes = [float(np.mean(np.real(np.diag(matrix)))) for matrix in (force, gyro)]
    return parameters_of(
        force / sizes[0],
        term_of(values, "accelerometer.bias") / sizes[0],
        gyro / sizes[1],
        term_of(values, "gyroscope.bias") / sizes[1],
        term_of(values, "gyroscope.g_sensitivity") / sizes[1],
    )


# What a target may be of, the group of parameters that it means, its unit, and how many SI units that is.
_SECOND = math.pi / 648000.0
_TARGETS: dict[str, tuple[str, str, float]] = {
    "bias": ("accelerometer bias", "µg", 9.80665e-6),
    "scale": ("accelerometer scale", "ppm", 1e-6),
    "misalignment": ("accelerometer misalignment", "″", _SECOND),
    "gyro-bias": ("gyro bias", "°/h", _SECOND),
    "gyro-scale": ("gyro scale", "ppm", 1e-6),
    "gyro-misalignment": ("gyro misalignment", "″", _SECOND),
    "rotation": ("rotation between the triads", "″", _SECOND),
    "g-sensitivity": ("g-sensitivity", "(°/h)/g", _SECOND / 9.80665),
}


def plan(request: PlanRequest) -> Planned:
    """Foretell what a test determines of both triads, and say what would be better.

    Parameters
    ----------
    request : what is planned.

    Raises
    ------
    UsageError, ObservabilityError, ProtocolError, RecordingError, SegmentationError, CalibrationFileError
        If an option is wrong, a file cannot be read, or the poses that can be searched do not tell what is wanted.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.design import plan_protocol

    _check(request)
    progress = request.progress
    folder, limits = results_folder(request.output), _limits(request.targets)
    protocol = _asked_protocol(request)
    task, grade, remarks = _task(protocol, request)
    said, search = list[str](), None
    if request.given is not None:
        progress("reading what is there already")
        known, said = read_given(request.given, request.recorded, task)
        task = replace(task, known=known)
    if request.asked in DEFAULTS:
        search = search_poses(request, task, grade, progress)
        task = replace(task, protocol=search.protocol)
    task = replace(task, protocol=as_assumed(task, request.rate))
    done = Planned(plan_protocol(task, progress), grade.name, search, given=said, remarks=remarks)
    _advise(done, limits, progress, steps=request.steps)
    done.remarks = [*describe_plan(done), *remarks, *_remarks(done)]
    if folder is not None:
        progress("writing")
        done.files = _write(folder, task.protocol, document_of(done))
    return done


def _check(request: PlanRequest) -> None:
    if request.seed < 0:
        raise UsageError(f"--seed {request.seed}: a seed is a whole number from 0 on.")
    if request.recorded is not None and request.given is None:
        raise UsageError(
            "--protocol says how --given was recorded: give --given RECORDING too, or leave it out."
        )
    if request.asked in DEFAULTS:
        check_search(request)


def _asked_protocol(request: PlanRequest) -> Protocol:
    """A named protocol or a file's; of one whose poses are yet to be searched the procedure alone."""
    from tumble.protocol import PROTOCOLS, HoldStep, Protocol as Steps, TurnStep
    from tumble.workflows.given.protocols import read_given_protocol

    asked = request.asked
    if request.asked in DEFAULTS:
        hold, turn, _ = DEFAULTS[asked]
        return Steps(f"{asked}-plan", asked, (HoldStep(request.hold or hold), TurnStep(request.turn or turn)))
    if asked in PROTOCOLS or Path(asked).exists():
        return read_given_protocol(asked).protocol
    names = [*DEFAULTS, *(name for name in PROTOCOLS if name not in DEFAULTS)]
    near = difflib.get_close_matches(asked.lower(), names, 1)
    meant = f" Did you mean {near[0]}?" if near else ""
    raise UsageError(
        f"There is no plan of {asked!r}: give a protocol file, or one of {', '.join(dict.fromkeys(names))}.{meant}"
    )


def as_assumed(task: PlanTask, rate: float | str | None) -> Protocol:
    """Return the protocol with what the plan takes for granted written into it: table, place, a rate that was stated.

    A rate that nobody stated is not written: a recording with another one would contradict it.

    Parameters
    ----------
    task : what is planned.
    rate : as it was given.
    """
    from tumble.protocol import SpinStep
    from tumble.sample_rates import sample_rate, stated_clock

    protocol, told = task.protocol, rate if stated_clock(rate) is None else None
    steps = tuple(
        replace(step, sigma=step.rate_sigma) if isinstance(step, SpinStep) else step
        for step in protocol.steps
    )
    return replace(
        protocol, steps=steps, site=task.site, rate=protocol.rate if told is None else sample_rate(told)
    )


def _limits(text: str | None) -> Series | None:
    """Return (30,) wished-for sigmas, SI, infinite where nothing is wished; None for no text."""
    if text is None:
        return None
    limits = np.full(PARAMETERS, np.inf)
    for part in filter(str.strip, text.split(",")):
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if name not in _TARGETS or not (math.isfinite(value) and value > 0.0):
            units = ", ".join(f"{key} in {unit}" for key, (_, unit, _) in _TARGETS.items())
            raise UsageError(
                f"--targets {text}: write NAME=NUMBER with commas between, each positive: {units}."
            )
        group, _, size = _TARGETS[name]
        limits[PARAMETER_GROUPS[group]] = value * size
    return limits


def _task(protocol: Protocol, request: PlanRequest) -> tuple[PlanTask, Grade, list[str]]:
    from tumble.design import PlanTask, sizes_of_sheet
    from tumble.recording import clock_without_stamps
    from tumble.sample_rates import sample_rate, stated_clock
    from tumble.simulation import find_grade
    from tumble.workflows.given.prior import find_sheet

    grade, place = find_grade(request.grade), request.site or protocol.site
    remarks = [f"Of {grade.name} no source states: {'; '.join(grade.assumed)}."] if grade.assumed else []
    if place is None:
        place = Site.from_latitude(math.radians(45.0), 0.0)
        remarks.append(
            "No site was given: latitude 45° at height 0 is assumed, and written into the "
            "protocol: give --site, or correct it there before anything is calibrated."
        )
    task = PlanTask.of_grade(protocol, grade, place, seed=request.seed)
    if request.data_sheet is not None:
        sheet = find_sheet(request.data_sheet)
        task = replace(task, sizes=sizes_of_sheet(sheet, grade), sheet=sheet)
        words = "are believed beforehand, as `tumble calibrate --prior` does."
        remarks.append(f"The spreads of {request.data_sheet} {words}")
    if request.noise is not None:
        noise, words = _noise_of(request.noise)
        task, remarks = replace(task, noise=noise), [*words, *(r for r in remarks if not r.startswith("Of "))]
    clock = stated_clock(request.rate)
    if clock is None:
        stated = protocol.rate if request.rate is None else sample_rate(request.rate)
        clock = clock_without_stamps(1.0 if stated is None else stated).sigma
    return replace(task, clock=clock), grade, remarks


def _noise_of(path: str | os.PathLike[str]) -> tuple[PlannedNoise, list[str]]:
    """The noise of a unit's own noise.json, the root mean square over its axes."""
    from tumble.design import PlannedNoise
    from tumble.workflows.noise import read_noise_models, triad_models

    models = read_noise_models(path)
    words = [f"The noise is that of {models.source}, the root mean square over each triad's axes."]
    triads: list[TriadNoise] = []
    for letter, unit in (("a", "m/s²"), ("g", "rad/s")):
        found = triad_models(models, letter, unit, 1.0, unit)
        triads.append(_triad(found))
        if any(model.gauss_markov or model.lines for model in found):
            words.append(
                "Its Gauss-Markov processes count as flicker of the same spread; lines are left out."
            )
    return PlannedNoise(triads[0], triads[1], models.rate), list(dict.fromkeys(words))


def _triad(models: list[Any]) -> TriadNoise:
    from tumble.noise import flicker_variance
    from tumble.simulation import TriadNoise

    def rms(values: list[float]) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    markov = [math.sqrt(sum(one.sigma**2 for one in model.gauss_markov)) for model in models]
    # One process of the ladder that flicker is simulated with has this variance over B².
    flicker = [
        math.hypot(m.bias_instability, g / math.sqrt(flicker_variance()))
        for m, g in zip(models, markov, strict=True)
    ]
    return TriadNoise(
        random_walk=rms([model.random_walk for model in models]),
        bias_instability=rms(flicker),
        rate_random_walk=rms([model.rate_random_walk for model in models]),
    )


def _advise(done: Planned, limits: Series | None, say: Callable[[str], None], *, steps: bool) -> None:
    """Find what each step is worth, what comes next, and what would tell what stays open."""
    from tumble.design import find_next_steps, find_step_worths, judge_stop, step_candidates, what_would_tell

    plan, task = done.plan, done.plan.task
    known, base = task.known, replace(task, known=None)
    if steps and not plan.weak and done.search is None and known is None:
        done.worths = find_step_worths(plan, say)
    if done.search is not None and known is None and limits is None and not plan.weak:
        return
    say("trying what may be added")
    candidates = step_candidates(task, table=task.has_table, span=plan.duration)
    start: JointInformation = plan.information if known is None else known
    done.following = find_next_steps(base, start, candidates, names=plan.names)
    own = plan if known is None else None
    done.stop, words = judge_stop(base, start, done.following, limits, plan=own, names=plan.names)
    if known is not None or limits is not None:
        done.given = [*done.given, *words]
    # What a plan of nothing recorded should do next is its own business, unless it misses its targets.
    done.stop = done.stop and known is not None
    everything = start if known is None else plan.information.plus(known)
    if plan.weak and not task.has_table:
        candidates = [*candidates, *step_candidates(task, table=True, span=plan.duration)[26:]]
    done.helping = [what_would_tell(base, everything, weak, candidates) for weak in plan.weak]


def of_clock(plan: JointPlan) -> str:
    """Return what the gyro scale factors owe to the sample rate, in sentences.

    Parameters
    ----------
    plan : a protocol's.
    """
    from tumble.recording import NOMINAL

    size, alone = f"{100.0 * plan.task.clock:.2g} %", ""
    scales = [one for one in plan.foretold if one.name.startswith("gyro scale")]
    if all(one.told for one in scales):
        ppm = 1e6 * float(np.sqrt(np.mean([one.without_clock**2 for one in scales])))
        alone = f" Without that they would be known to {two_digits(ppm)} ppm."
    if plan.task.clock != NOMINAL:
        return f"The sample rate is known to {size}, as stated, and all gyro scale factors share that.{alone}"
    return (
        f"The gyro scale factors share a nominal sample rate, uncertain by {size}.{alone} A simulation's clock is "
        "perfect: --rate 100±0 predicts what it will find. State your own as --rate 100±0.01, or record the times of a "
        "clock."
    )


def _remarks(done: Planned) -> list[str]:
    """What is taken for granted of clock, table and gravity."""
    task, words = done.plan.task, [of_clock(done.plan)]
    if task.has_table and (table := task.common[1]):
        good = f"The table's rates are taken to be right to {two_digits(1e6 * table)} ppm"
        words.append(f"{good} (`uncertainty_ppm` in the protocol).")
    if task.site.gravity_sigma > 0.0:
        good = f"Gravity is good to {two_digits(1e6 * task.site.gravity_sigma / task.site.gravity)} ppm"
        words.append(f"{good}, which all accelerometer scale factors share: --gravity says it better.")
    return words


def _write(folder: Path, protocol: Protocol, document: dict[str, Any]) -> list[Path]:
    """Write a plan's protocol, document and sheet beside their places, then rename them all; return the places."""
    from tumble.files import write_texts
    from tumble.protocol import protocol_to_yaml
    from tumble.report import render_sheet

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "plan.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "sheet.html": render_sheet(protocol, protocol.description or protocol.name),
    }
    return write_texts({folder / name: text for name, text in texts.items()})
