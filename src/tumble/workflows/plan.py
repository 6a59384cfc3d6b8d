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
from dataclasses import asdict, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.design import PARAMETER_GROUPS, PARAMETERS, JointInformation, parameters_of
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.files import results_folder
from tumble.parameters import two_digits
from tumble.records import dataclass
from tumble.units import MICRO_G
from tumble.workflows.request import PlanRequest

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design import (
        Foretold,
        JointPlan,
        NextStep,
        PlannedNoise,
        PlanTask,
        PosePlan,
        PoseTask,
        StepCandidate,
        StepWorth,
    )
    from tumble.document import Calibration
    from tumble.protocol import Protocol, Step
    from tumble.simulation import Grade, TriadNoise


@dataclass(frozen=True)
class PoseSearch:
    """Poses that were searched.

    Attributes
    ----------
    task, plan : the design room's.
    schemes : the papers', in the same time, or in words why not.
    protocol : the plan to do.
    """

    task: PoseTask
    plan: PosePlan
    schemes: dict[str, PosePlan | str]
    protocol: Protocol


@dataclass
class Planned:
    """What `plan` found.

    Attributes
    ----------
    plan : the prediction.
    imu : name of the grade.
    search : the poses that were searched, beside the papers'; None for a protocol as it is.
    worths : of every step.
    following : steps that may be added.
    helping : what would tell each of the plan's weaknesses, or None.
    given, stop : sentences about what is there already and about targets, and whether to stop.
    remarks : what was assumed.
    files : what was written.
    """

    plan: JointPlan
    imu: str
    search: PoseSearch | None = None
    worths: list[StepWorth] = field(default_factory=list[Any])
    following: list[NextStep] = field(default_factory=list[Any])
    helping: list[tuple[StepCandidate, float] | None] = field(default_factory=list[Any])
    given: list[str] = field(default_factory=list[str])
    stop: bool = False
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])


# Shares of one, rad: what norms of holds leave so uncertain they do not determine.
OPEN = 0.3
# Without the step nothing grows by more than this: it can be spared.
SPARED = 0.05
# So many times as large, and a parameter rests on one step.
RESTS_ON = 2.0
# Performances that differ by more are worth a word.
DIFFERS = 1.2
STEP_HEADS = (
    "step",
    "of the time",
    "of what is determined",
    "without it, at worst",
    "a minute more: all fall by",
)


def prediction_rows(done: Planned) -> list[list[str]]:
    """Return a row for each three parameters: their name, three numbers and the unit.

    Parameters
    ----------
    done : a plan.
    """
    rows: list[list[str]] = []
    for stem, members in groupby(done.plan.foretold, key=lambda one: one.name.rpartition(" ")[0]):
        found = list(members)
        if stem.startswith("g-sensitivity"):
            stem = stem.removesuffix(" to force")
        for k in range(0, len(found), 3):
            rows.append(_prediction_row(stem, found[k : k + 3]))
    return rows


def _prediction_row(stem: str, three: list[Foretold]) -> list[str]:
    from tumble.parameters import with_uncertainty
    from tumble.report import practical_uncertainties

    ends = [one.name.rpartition(" ")[2] for one in three]
    name = stem if ends == ["x", "y", "z"] else f"{stem} ({', '.join(ends)})"
    family = stem if stem.endswith("bias") else "g-sensitivity" if stem.startswith("g-") else "scale"
    family = "angle" if three[0].unit == "rad" else family
    sigmas = [one.sigma if one.told else math.nan for one in three]
    measures = practical_uncertainties(family, sigmas)
    shown = [
        with_uncertainty(math.nan, one.sigma).removeprefix("± ")
        if math.isfinite(one.sigma)
        else "not determined"
        for one in measures
    ]
    return [name, *shown, measures[0].unit]


def step_rows(done: Planned, *, each: bool = False) -> list[list[str]]:
    """Return rows of what steps are worth: kinds of steps, or each by itself.

    Parameters
    ----------
    done : a plan.
    each : do not join steps of a kind.
    """
    rows: list[list[str]] = []
    for title, members in _kinds(done.worths, each=each):
        worst = max(members, key=lambda one: one.most_growth)
        growth = "loses" if worst.most_growth > 100.0 else f"× {worst.most_growth:.2f}"
        rows.append(
            [
                title,
                f"{100.0 * sum(one.share_of_time for one in members):.1f} %",
                f"{100.0 * sum(one.share_of_information for one in members):.1f} %",
                f"{growth} {_briefly(worst.most)}",
                f"{100.0 * max(float(np.mean([one.longer_per_minute for one in members])), 0.0):.2g} %",
            ]
        )
    return rows


def _briefly(name: str) -> str:
    """Return a parameter's name for a narrow column.

    Examples
    --------
    >>> _briefly("accelerometer non-orthogonality yz")
    'acc. non-orthog. yz'
    """
    for long, short in (("accelerometer", "acc."), ("orthogonality", "orthog."), ("factor error", "error")):
        name = name.replace(long, short)
    return name


def _kinds(worths: list[StepWorth], *, each: bool) -> list[tuple[str, list[StepWorth]]]:
    if each:
        return [(f"{one.step + 1}. {_named(one)}", [one]) for one in worths]
    ordered = sorted(worths, key=lambda one: (one.kind, -one.seconds))
    kinds: list[tuple[str, list[StepWorth]]] = []
    for (kind, seconds), members in groupby(ordered, key=lambda one: (one.kind, round(one.seconds, 3))):
        found = list(members)
        many = f"{len(found)} {kind}s" if len(found) > 1 else f"1 {kind}"
        kinds.append((f"{many} of {seconds:.4g} s", found))
    return kinds


def _named(one: StepWorth) -> str:
    return f"{one.kind} {one.name}, {one.seconds:.4g} s"


def describe_plan(done: Planned) -> list[str]:
    """Return what is not told and what would tell it, which steps carry the result, and what to change.

    Parameters
    ----------
    done : a plan with everything found.
    """
    single = (_about_hands(done.plan.foretold), "" if done.search is None else _about_wander(done.search))
    return [*_about_weak(done), *_about_steps(done.worths), *filter(None, single)]


def _about_weak(done: Planned) -> list[str]:
    words: list[str] = []
    turn = "rotation of the table" if done.plan.task.has_table else "turn by hand or rotation of a table"
    for weak, helping in zip(done.plan.weak, done.helping, strict=True):
        names = weak.parameters[:4]
        what = names[0] if len(names) == 1 else f"a combination of {', '.join(names)}"
        if len(weak.parameters) > 4:
            what += " and others"
        mend = f"No single hold, {turn} would determine it."
        if helping is not None:
            mend = f"Add this: {helping[0].name} ({helping[0].seconds:.0f} s)."
        words.append(f"Not determined better than by the data sheet: {what}. {mend}")
    return words


def _about_steps(worths: list[StepWorth]) -> list[str]:
    if not worths:
        return []
    words: list[str] = []
    pillars = [one for one in worths if one.most_growth > RESTS_ON]
    if pillars:
        found = [f"{one.most} on {one.name}" for one in sorted(pillars, key=lambda one: -one.most_growth)[:3]]
        words.append(f"It rests on single steps: {'; '.join(found)}.")
    least = min(worths, key=lambda one: one.most_growth)
    if least.most_growth - 1.0 < SPARED:
        spared = sum(one.most_growth - 1.0 < SPARED for one in worths)
        words.append(
            f"Any one of {spared} of {len(worths)} steps could be dropped and no uncertainty would grow by more than "
            f"{100.0 * SPARED:.0f} %; least is lost without the {_named(least)} "
            f"({100.0 * (least.most_growth - 1.0):.1f} %)."
        )
    best = max(worths, key=lambda one: one.longer_per_minute)
    worst = min(worths, key=lambda one: one.longer_per_minute)
    if best.longer_per_minute > 2.0 * max(worst.longer_per_minute, 0.0) and best.longer_per_minute > 1e-4:
        words.append(
            f"Time is best spent on the {_named(best)}: a minute more takes {100.0 * best.longer_per_minute:.2g} % off "
            f"the uncertainties, of the {_named(worst)} {100.0 * max(worst.longer_per_minute, 0.0):.2g} %."
        )
    return words


def _about_hands(foretold: list[Foretold]) -> str:
    worst = max((one for one in foretold if one.told), key=lambda one: one.spread, default=None)
    if worst is None or worst.spread < DIFFERS:
        return ""
    return (
        "Hands do it differently each time: of several performances the best and the worst differ by "
        f"{worst.spread:.2g} times in {worst.name}. The prediction is their root mean square."
    )


def _about_wander(search: PoseSearch) -> str:
    from tumble.design import wander_sigma, white_density

    task, plan = search.task, search.plan
    if not task.noise.wanders:
        return ""
    dwell = float(np.median(plan.dwells))
    wander = wander_sigma(task.noise, dwell, plan.duration)
    white = white_density(task.noise, task.rate) / math.sqrt(dwell)
    share = 100.0 * wander**2 / (wander**2 + white**2)
    more = " Longer holds would not help: more poses do." if share > 50.0 else ""
    return (
        f"The biases wander by {two_digits(wander / MICRO_G)} µg from hold to hold, the white noise of a hold is "
        f"{two_digits(white / MICRO_G)} µg. Wander is {share:.0f} % of the variance. The order of the poses lessens "
        f"it: keep it.{more}"
    )


def next_words(done: Planned) -> list[str]:
    """Return which steps to add next, one sentence each.

    Parameters
    ----------
    done : a plan.
    """
    words: list[str] = []
    for number, one in enumerate(done.following):
        after = (
            f"{one.open_left} parameters are then still open"
            if one.open_left
            else f"the uncertainties fall by {100.0 * one.gain:.2g} %, of {one.most} by {100.0 * one.most_gain:.2g} %"
        )
        words.append(f"{'Next' if number == 0 else 'Then'}: {one.candidate.name}; {after}.")
    return words


def headline(done: Planned) -> str:
    """Return what is planned, how many steps it has, and how long it lasts.

    Parameters
    ----------
    done : a plan.
    """
    from tumble.protocol import HoldStep, SpinStep, TurnStep

    steps, minutes = done.plan.task.protocol.steps, done.plan.duration / 60.0
    if done.search is not None:
        plan, more = done.search.plan, "more " if done.following and done.plan.task.known is not None else ""
        return f"{len(plan.dwells)} {more}poses ({plan.name}), {minutes:.1f} min with {plan.turn:g} s for each turn."
    counted = [
        (sum(isinstance(s, kind) for s in steps), words)
        for kind, words in ((HoldStep, "holds"), (SpinStep, "rotations of the table"), (TurnStep, "turns"))
    ]
    many = ", ".join(f"{count} {words}" for count, words in counted if count)
    return f"{done.plan.task.protocol.name}: {many}; {minutes:.1f} min."


def over_the_plan(plan: PosePlan, best: PosePlan) -> dict[str, float | None]:
    """Return by group the root mean square sigma over the plan's, of the norms of holds; None if not determined.

    Parameters
    ----------
    plan, best : a scheme, and the plan.
    """
    from tumble.design import NORM_GROUPS

    ratios: dict[str, float | None] = {}
    for group, members in NORM_GROUPS.items():
        own, its = (float(np.sqrt(np.mean(one.sigmas[list(members)] ** 2))) for one in (plan, best))
        ratios[group] = own / its if max(own, its) < OPEN else None
    return ratios


def scheme_rows(search: PoseSearch) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the comparison, the plan first; numbers are over the plan's.

    Parameters
    ----------
    search : what was searched.
    """
    rows: list[list[str]] = []
    for name, one in {"this plan": search.plan, **search.schemes}.items():
        rows.append([name, *(["–"] * 6 if isinstance(one, str) else _scheme_cells(one, search.plan))])
    return ["holds alone, over this plan", "poses", "rest", "scale", "misal.", "bias", "criterion"], rows


def _scheme_cells(plan: PosePlan, best: PosePlan) -> list[str]:
    dwells = np.asarray(plan.dwells)
    low, high = float(dwells.min()), float(dwells.max())
    rest = f"{low:.0f} s" if high - low < 1.0 else f"{low:.0f} to {high:.0f} s"
    ratios = [*over_the_plan(plan, best).values(), plan.value / best.value]
    return [str(len(dwells)), rest, *("–" if one is None else f"{one:.2f}" for one in ratios)]


def document_of(done: Planned) -> dict[str, Any]:
    """Return everything as plain data for a file, SI and one sigma.

    Parameters
    ----------
    done : what was planned.
    """
    plan, task = done.plan, done.plan.task
    return {
        "format": "tumble plan of a protocol",
        "version": 2,
        "protocol": task.protocol.name,
        "procedure": task.protocol.procedure,
        "imu": done.imu,
        "duration_s": plan.duration,
        "site": {"gravity": task.site.gravity, "gravity_standard_uncertainty": task.site.gravity_sigma},
        "parameters": [
            {
                "name": one.name,
                "unit": one.unit,
                "told": one.told,
                "standard_uncertainty": one.sigma if one.told else None,
                "with_a_perfect_clock": one.without_clock if one.told else None,
                "largest_over_smallest_performance": one.spread,
            }
            for one in plan.foretold
        ],
        "schemes": None if done.search is None else _schemes(done.search),
        "not_told": [
            {
                "parameters": list(weak.parameters),
                "data_sheet_spreads": weak.sigma if math.isfinite(weak.sigma) else None,
                "told_by": None if helping is None else helping[0].name,
            }
            for weak, helping in zip(plan.weak, done.helping, strict=True)
        ],
        "steps": [{**asdict(worth), "step": worth.step + 1} for worth in done.worths],
        "next": [
            {
                "do": one.candidate.name,
                "seconds": one.candidate.seconds,
                "gain": one.gain,
                "gains_most": one.most,
                "its_gain": one.most_gain,
                "not_told_after": one.open_left,
            }
            for one in done.following
        ],
        "given": done.given,
        "stop": done.stop,
        "remarks": done.remarks,
    }


def _schemes(search: PoseSearch) -> dict[str, Any]:
    """The plan and the papers' schemes, their uncertainties over the plan's."""
    return {
        name: {"not_possible": one}
        if isinstance(one, str)
        else {
            "poses": len(one.dwells),
            "dwell_s": float(one.dwells[0]),
            "over_this_plan": over_the_plan(one, search.plan),
        }
        for name, one in {"this plan": search.plan, **search.schemes}.items()
    }


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
    from tumble.workflows.given import read_given_protocol

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
    from tumble.workflows.given import read_given_protocol

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
    from tumble.workflows.given import find_sheet

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
