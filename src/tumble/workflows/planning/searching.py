"""The poses of a test, searched: which, for how long, in which order, beside the papers' own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.errors import UsageError
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.design.joint_plan import PlanTask
    from tumble.design.pose_plan import PosePlan, PoseTask
    from tumble.protocol import Protocol, Step
    from tumble.simulation import Grade
    from tumble.workflows.request import PlanRequest

LEVELLED, BY_HAND = math.radians(0.5), math.radians(5.0)
"""One sigma to which faces on a plate are levelled, and a unit is laid down."""
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200


@dataclass(frozen=True, slots=True)
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
    from tumble.design.pose_plan import PoseTask, known_norms, plan_poses, plan_schemes, plan_time

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
    from tumble.attitude.directions import twenty_six_directions
    from tumble.design.pose_plan import GROUPS, best_order, plan_of

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
    wanted = np.array([*GROUPS["scale"], *GROUPS["bias"]])
    task = replace(task, wanted=wanted, placement=own, shortening=LEVELLED**2)
    faces = twenty_six_directions()[[0, 5, 1, 4, 2, 3]]
    return task, plan_of("six faces", task, faces[best_order(task, faces, dwell)], np.full(6, dwell))


def _protocol(procedure: str, plan: PosePlan, hand: float) -> Protocol:
    from tumble.calibration.poses import describe_direction
    from tumble.protocol import HoldStep, Pose, Protocol, TurnStep

    steps: list[Step] = []
    for up, dwell in zip(plan.directions, plan.dwells, strict=True):
        steps += [TurnStep(plan.turn)] if steps else []
        steps.append(
            HoldStep(float(dwell), Pose(np.asarray(up, dtype=float), None, hand), describe_direction(up))
        )
    words = f"{len(plan.dwells)} poses, {plan.name}, as tumble plan found them."
    return Protocol(f"{procedure}-plan", procedure, tuple(steps), description=words)
