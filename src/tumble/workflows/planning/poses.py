"""Planning a test of poses: from what a user says to a plan, its protocol, its pages."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.files import results_folder
from tumble.records import dataclass
from tumble.units import MICRO_G
from tumble.workflows.planning.given import read_known
from tumble.workflows.planning.plan import (
    check_seed,
    finite,
    planned_grade,
    planned_place,
    read_targets,
    write_plan,
)
from tumble.workflows.planning.words import (
    SECOND,
    UNITS,
    describe_poses,
    group_means,
    pose_names,
)
from tumble.workflows.progress import silent

if TYPE_CHECKING:
    from tumble.arrays import Square, Vectors
    from tumble.design.next_pose import NextPose
    from tumble.design.pose_plan import PosePlan, PoseTask
    from tumble.protocol import Protocol
    from tumble.simulation import Grade
    from tumble.workflows.planning.protocol import ProtocolPlanned

LEVELLED, BY_HAND = math.radians(0.5), math.radians(5.0)
"""One sigma to which faces on a plate are levelled, and a unit is laid down."""
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200
_TARGET_SIZES = {"bias": MICRO_G, "scale": 1e-6, "misalignment": SECOND}
_TARGET_REFUSAL = (
    "write bias=50,scale=100,misalignment=20 or some of them, in µg, ppm and arc-seconds, each positive."
)
_ASSUMED = "is assumed, and written into the protocol: give --site, or correct it there before anything is calibrated."


@dataclass(frozen=True, slots=True)
class PoseOrder:
    """What a search of poses is asked for.

    Attributes
    ----------
    procedure : one of `tumble.workflows.planning.plan.SEARCHED`.
    imu : grade of the unit.
    data_sheet : a grade whose spreads are believed beforehand, as `calibrate --prior` does.
    poses, minutes : how many poses of `hold` seconds each, or how long the whole test may last with as many poses and
        dwells as is best; by default nine poses.
    hold, turn : s of a pose, and of the turn to the next.
    given : a calibration, or a recording of this unit, that is there already.
    targets : wished-for standard uncertainties, as "bias=50,scale=100,misalignment=20" in µg, ppm and arc-seconds.
    site : gravity; latitude 45° by default.
    seed : of the search's starts.
    rate : of the samples of a hand-held test with its standard uncertainty, as for `plan_any_protocol`.
    """

    procedure: str
    imu: str = "consumer-mems"
    data_sheet: str | None = None
    poses: int | None = None
    minutes: float | None = None
    hold: float | None = None
    turn: float | None = None
    given: str | os.PathLike[str] | None = None
    targets: str | None = None
    site: Site | None = None
    seed: int = 0
    rate: str | None = None

    @property
    def usual(self) -> tuple[float, float, int]:
        """Seconds of a pose and of a turn, and the fewest poses, where nobody says."""
        return DEFAULTS[self.procedure]

    @property
    def is_six_position(self) -> bool:
        """Whether faces are levelled and believed."""
        return self.procedure == "six-position"

    @property
    def dwell(self) -> float:
        """Seconds of a pose, where the time of the test does not say."""
        return self.hold or self.usual[0]

    def check(self) -> None:
        """Refuse numbers that contradict one another or that no test has.

        Raises
        ------
        UsageError
            If there is one.
        """
        if self.poses is not None and self.minutes is not None:
            raise UsageError(
                "--poses and --time: give the number of poses or the time of the whole test, not both."
            )
        if self.minutes is not None and self.hold is not None:
            raise UsageError(
                "--hold and --time: with the time of the whole test the dwells follow; leave --hold out."
            )
        if self.poses is not None and not 1 <= self.poses <= MOST_POSES:
            raise UsageError(f"--poses {self.poses}: give 1 to {MOST_POSES}.")
        if self.minutes is not None and not 0.0 < self.minutes <= 10_000.0:
            raise UsageError(f"--time {self.minutes:g}: give minutes of the whole test, up to 10000.")
        if self.hold is not None and not 1.0 <= self.hold <= 100_000.0:
            raise UsageError(f"--hold {self.hold:g}: give 1 to 100000 seconds of rest in each pose.")
        if self.turn is not None and not 0.5 <= self.turn <= 3600.0:
            raise UsageError(
                f"--turn-seconds {self.turn:g}: give 0.5 to 3600 seconds from one pose to the next."
            )
        check_seed(self.seed)


@dataclass(frozen=True, slots=True)
class Predicted:
    """A parameter with its predicted standard uncertainty, SI: of the noise alone, and with gravity's."""

    name: str
    group: str
    noise: float
    total: float
    unit: str


@dataclass(slots=True)
class PosesPlanned:
    """What `plan_pose_test` found.

    Attributes
    ----------
    procedure, grade, place : what was planned, with what, where.
    task, plan : the design room's.
    predicted : parameter by parameter.
    schemes : the papers', in the same time, or in words why not.
    protocol : the plan to do.
    given : sentences about what was recorded already; `following` the poses to record next, `stop` whether to.
    remarks : what was assumed.
    files : what was written.
    joint : of a hand-held test, what holds and turns together tell of both triads.
    """

    procedure: str
    grade: Grade
    place: Site
    task: PoseTask
    plan: PosePlan
    predicted: list[Predicted]
    schemes: dict[str, PosePlan | str]
    protocol: Protocol
    given: list[str] = field(default_factory=list[str])
    following: list[NextPose] = field(default_factory=list[Any])
    stop: bool = False
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])
    joint: ProtocolPlanned | None = None


def plan_poses(
    order: PoseOrder,
    *,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] = silent,
) -> PosesPlanned:
    """Find the best poses for a test, and say what they will be worth.

    Parameters
    ----------
    order : what is asked.
    output : folder for protocol, plan and sheets; None writes nothing.
    progress : called with a sentence on what is being done.

    Raises
    ------
    UsageError, ObservabilityError, ProtocolError, CalibrationFileError, RecordingError
        If an option is wrong, or the poses that can be reached do not tell what is wanted.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    folder = results_folder(output)
    order.check()
    if order.rate is not None and (order.procedure != "hand-held" or order.given is not None):
        raise UsageError("--rate is for a whole hand-held test or a protocol: leave it out.")
    from tumble.design.pose_plan import plan_schemes

    grade, remarks = planned_grade(order.imu)
    place, assumed = planned_place(order.site, _ASSUMED)
    wished = read_targets(order.targets, _TARGET_SIZES, _TARGET_REFUSAL)
    task = _task(order, grade, place)
    known = Known()
    if order.given is not None:
        progress("reading what is there already")
        known = _with_given(task, order, wished)
        task = replace(task, known=known.information)
    progress("searching")
    plan = _search(order, task, np.random.default_rng(order.seed), progress)
    progress("comparing")
    schemes = plan_schemes(replace(task, placement=0.0, shortening=0.0), plan.duration)
    if order.is_six_position:
        del schemes["six faces"]
    made, predicted = _protocol(order, plan, place), predict(plan, place)
    done = PosesPlanned(order.procedure, grade, place, task, plan, predicted, schemes, made)
    done.given, done.following, done.stop = known.said, known.following, known.stop
    done.remarks = [*remarks, *assumed, *describe_poses(done), *_unmet(plan, place, wished)]
    if order.procedure == "hand-held" and order.given is None:
        from tumble.workflows.planning.protocol import judge_protocol, of_clock

        progress("holds and turns together")
        done.joint = judge_protocol(done.protocol, grade, place, order.seed, progress, order.rate)
        done.remarks.append(of_clock(done.joint.plan))
    if folder is not None:
        progress("writing")
        done.files = write_plan(folder, done.protocol, document_of_poses(done), done.plan.name)
    return done


@dataclass(slots=True)
class Known:
    """What is there already: sentences, its information, which poses come next, and whether to stop."""

    said: list[str] = field(default_factory=list[str])
    information: Square | None = None
    following: list[NextPose] = field(default_factory=list[Any])
    stop: bool = False


def predict(plan: PosePlan, place: Site) -> list[Predicted]:
    """Return every parameter's predicted standard uncertainty, without those that the plan does not tell.

    Parameters
    ----------
    plan, place : with gravity's uncertainty, which every scale factor shares.
    """
    from tumble.design.candidates import GROUPS, PARAMETERS

    relative = place.gravity_sigma / place.gravity
    found: list[Predicted] = []
    for group, members in GROUPS.items():
        for index in members:
            noise = float(plan.sigmas[index])
            if noise > 0.3:
                continue
            total = math.hypot(noise, relative) if group == "scale" else noise
            size = place.gravity if group == "bias" else 1.0
            unit = {"scale": "1", "misalignment": "rad", "bias": "m/s²"}[group]
            found.append(Predicted(PARAMETERS[index], group, noise * size, total * size, unit))
    return found


def document_of_poses(done: PosesPlanned) -> dict[str, Any]:
    """Return everything as plain data for a file, SI and one sigma.

    Parameters
    ----------
    done : what was planned.
    """
    from tumble.calibration.poses import describe_direction
    from tumble.workflows.planning.protocol import joint_parameters

    plan = done.plan

    def scheme(one: PosePlan | str) -> dict[str, Any]:
        if isinstance(one, str):
            return {"not_possible": one}
        return {"poses": len(one.dwells), "dwell_s": float(one.dwells[0]), "rms": _finite(group_means(one))}

    return {
        "format": "tumble plan",
        "version": 1,
        "procedure": done.procedure,
        "imu": done.grade.name,
        "duration_s": plan.duration,
        "gravity": {"value": done.place.gravity, "standard_uncertainty": done.place.gravity_sigma},
        "poses": [
            {"up": [float(v) for v in up], "seconds": float(dwell), "name": name}
            for up, dwell, name in zip(plan.directions, plan.dwells, pose_names(plan), strict=True)
        ],
        "parameters": [
            {
                "name": one.name,
                "unit": one.unit,
                "standard_uncertainty": one.total,
                "of_noise_alone": one.noise,
            }
            for one in done.predicted
        ],
        "units_of_rms": {group: unit for group, (unit, _) in UNITS.items()},
        "plan_rms": _finite(group_means(plan)),
        "schemes": {name: scheme(one) for name, one in done.schemes.items()},
        "given": done.given,
        "both_triads": None if done.joint is None else joint_parameters(done.joint),
        "stop": done.stop,
        "next": [
            {
                "up": [float(v) for v in one.up_b],
                "name": describe_direction(one.up_b),
                "criterion_gain": one.gain,
            }
            for one in done.following
        ],
        "remarks": done.remarks,
    }


def _task(order: PoseOrder, grade: Grade, place: Site) -> PoseTask:
    """The design's task: of six faces, scale factors and biases alone, and what levelling adds to each."""
    from tumble.design.candidates import GROUPS
    from tumble.design.pose_plan import PoseTask

    turn = order.usual[1] if order.turn is None else order.turn
    known = _sheet(order.data_sheet, place.gravity)
    task = PoseTask(grade.accelerometer.noise, grade.rate, turn, place.gravity, known)
    if not order.is_six_position:
        return task
    wanted = np.array([*GROUPS["scale"], *GROUPS["bias"]])
    # Of a face's own reading: the square of the tilt, and its product with misalignment.
    own = math.hypot(LEVELLED**2, math.sqrt(2.0) * LEVELLED * grade.accelerometer.misalignment)
    return replace(task, wanted=wanted, placement=own, shortening=LEVELLED**2)


def _sheet(name: str | None, gravity: float) -> Square | None:
    """The information of a data sheet's spreads."""
    if name is None:
        return None
    from tumble.calibration.prior import prior_of_sheet
    from tumble.workflows.given.prior import find_sheet

    prior = prior_of_sheet(find_sheet(name), "accelerometer", "m/s^2")
    if prior is None:
        return None
    # Biases come last here, and in units of gravity.
    order, scale = np.array([3, 4, 5, 6, 7, 8, 0, 1, 2]), np.repeat([1.0, gravity], [6, 3])
    return np.asarray(prior.precision[np.ix_(order, order)] * np.outer(scale, scale), dtype=np.float64)


def _search(
    order: PoseOrder,
    task: PoseTask,
    rng: np.random.Generator,
    say: Callable[[str], None],
) -> PosePlan:
    from tumble.design import pose_plan

    if order.is_six_position:
        return _levelled(order, task)
    if order.minutes is not None:
        return pose_plan.plan_time(task, 60.0 * order.minutes, rng, say)
    count = order.poses if order.poses is not None else order.usual[2]
    return pose_plan.plan_poses(task, count, order.dwell, rng)


def _levelled(order: PoseOrder, task: PoseTask) -> PosePlan:
    """The six faces, in their best order."""
    from tumble.design.pose_order import best_order
    from tumble.design.pose_plan import plan_of

    if order.poses not in (None, 6):
        raise UsageError(f"--poses {order.poses}: a six-position test has its six faces.")
    whole = order.minutes
    dwell = order.dwell if whole is None else (60.0 * whole + task.turn) / 6 - task.turn
    if dwell < 1.0:
        raise UsageError(f"--time {whole:g}: that leaves no time for six poses and the turns between them.")
    faces = _directions(order)
    ordered = faces[best_order(task, faces, dwell)]
    return plan_of("six faces", task, ordered, np.full(6, dwell))


def _with_given(task: PoseTask, order: PoseOrder, targets: dict[str, float]) -> Known:
    """What is there already, which poses come next, and whether to stop."""
    from tumble.design.next_pose import find_next_poses, judge_stop, sigmas_so_far

    assert order.given is not None
    known, words = read_known(order.given)
    if task.known is not None:
        known = known + task.known
    sigma = task.dwell_sigma(order.dwell, 10.0 * order.dwell)
    following = find_next_poses(known, _directions(order), sigma, task.wanted)
    so_far = sigmas_so_far(known)
    stop, said = judge_stop(so_far, following, targets, task.noise, task.gravity, task.wanted)
    return Known([*words, *said], known, following, stop)


def _directions(order: PoseOrder) -> Vectors:
    from tumble.attitude.directions import twenty_six_directions

    directions = twenty_six_directions()
    return directions[[0, 5, 1, 4, 2, 3]] if order.is_six_position else directions


def _protocol(order: PoseOrder, plan: PosePlan, place: Site) -> Protocol:
    from tumble.protocol import HoldStep, Pose, Protocol, TurnStep

    hand = LEVELLED if order.is_six_position else BY_HAND
    steps: list[Any] = []
    for up, dwell, name in zip(plan.directions, plan.dwells, pose_names(plan), strict=True):
        if steps:
            steps.append(TurnStep(plan.turn))
        steps.append(HoldStep(float(dwell), Pose(np.asarray(up, dtype=float), None, hand), name))
    words = f"{len(plan.dwells)} poses, {plan.name}, as tumble plan found them."
    return Protocol(f"{order.procedure}-plan", order.procedure, tuple(steps), site=place, description=words)


def _unmet(plan: PosePlan, place: Site, targets: dict[str, float]) -> list[str]:
    """Say which targets the plan misses, and how much longer it would have to last for white noise."""
    off: list[str] = []
    worst = 0.0
    for one in predict(plan, place):
        target = targets.get(one.group)
        if target is not None and one.total > target:
            off.append(one.name)
            worst = max(worst, one.total / target)
    if not off:
        return ["The plan reaches all targets."] if targets else []
    return [
        (
            f"The plan misses the target of {', '.join(off)} by up to {worst:.2g} times: white noise alone asks for "
            f"{worst**2:.2g} times the time, and gravity and wander do not fall with it."
        )
    ]


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    return {name: finite(value) for name, value in values.items()}
