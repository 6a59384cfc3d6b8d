"""Which hold, turn or rotation to add next: each played by itself, and what it adds to what is known.

A candidate is a short protocol of its own: the unit rests, is turned, rests. Its attitudes are its own, so that its
information simply adds to that of everything else. All candidates are played one after the other in one recording, of
which each is a section. Who has a table is offered its rotations, and nobody else is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tumble.arrays import Series, Vector
from tumble.attitude import twenty_six_directions
from tumble.calibration import SAME_POSE, describe_direction
from tumble.design.joint_information import (
    NAMES,
    PARAMETER_GROUPS,
    TOLD,
    JointInformation,
    exact_sensors,
    planned_problem,
)
from tumble.design.joint_plan import JointPlan, PlanTask, Weakness, mean_log_sigma
from tumble.design.planned_motion import planned_session
from tumble.protocol import BY_HAND, HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol
from tumble.records import dataclass
from tumble.simulation import unit

# Seconds of a hold, and of the turn to it.
HOLD, TURN = 10.0, 3.0
# A hand's turn by an angle of which nobody reads anything.
HAND_ANGLE = 30.0 * np.pi / 180.0
# s of the shortest turn by hand from one pose to another.
SHORTEST_TURN = 1.0
# One more step that takes less than this off every sigma is not worth its time.
WORTH = 0.02
# The power of the ratios to the limits that is summed: high enough for the worst to decide. 4 to 16 do alike.
WORST = 4
# Poses after which a limit counts as out of reach.
MOST_LEFT = 512.0
_AXES = (
    ("x", (1, 0, 0), (0, 0, 1)),
    ("y", (0, 1, 0), (1, 0, 0)),
    ("z", (0, 0, 1), (0, 1, 0)),
    ("the edge between x and y", (1, 1, 0), (0, 0, 1)),
    ("the edge between x and z", (1, 0, 1), (0, 1, 0)),
    ("the edge between y and z", (0, 1, 1), (1, 0, 0)),
)


@dataclass(frozen=True)
class StepCandidate:
    """Something that may be added to a test.

    Attributes
    ----------
    name : as an operator is told.
    seconds : that it takes, getting there included.
    information : what it determines.
    steps : of a protocol.
    """

    name: str
    seconds: float
    information: JointInformation
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Aim:
    """What is to be reached, and what a pose like any other brings towards it.

    Attributes
    ----------
    limits : (30,) wished-for sigmas, SI, infinite where nothing is wished.
    usual : what one of `usual_pose` determines.
    """

    limits: Series
    usual: JointInformation

    def distance(self, task: PlanTask, known: JointInformation) -> float:
        """Return the logarithm of what is known over what is wished, the worst counting by far the most.

        Parameters
        ----------
        task : the unit.
        known : information.
        """
        wished = np.isfinite(self.limits)
        ratios = np.sqrt(np.diag(task.covariance(known)))[wished] / self.limits[wished]
        return float(np.log(np.sum(ratios**WORST)) / WORST)

    def poses_left(self, task: PlanTask, known: JointInformation) -> float:
        """Return how many more usual poses reach the limits; `MOST_LEFT` if so many do not.

        Parameters
        ----------
        task : the unit.
        known : information so far.
        """

        def reached(poses: float) -> bool:
            sigmas = np.sqrt(np.diag(task.covariance(self.after(known, poses))))
            return bool(np.all(sigmas <= self.limits))

        if reached(0.0):
            return 0.0
        low, high = 0.0, MOST_LEFT
        while high - low > max(0.25, 0.02 * high):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if reached(middle) else (middle, high)
        return high

    def after(self, known: JointInformation, poses: float) -> JointInformation:
        """Return what is known after so many usual poses more.

        Parameters
        ----------
        known : information so far.
        poses : how many; a fraction counts as such.
        """
        return JointInformation(known.matrix + poses * self.usual.matrix)


@dataclass(frozen=True)
class NextStep:
    """A step to add, with what is known after it.

    Attributes
    ----------
    candidate : what to do.
    sigmas : (30,) after it.
    gain : by how much the sigmas fall, the geometric mean, as a share.
    most, most_gain : the parameter that gains most, and by what share its sigma falls.
    open_left : how many parameters are then still not told.
    """

    candidate: StepCandidate
    sigmas: Series
    gain: float
    most: str
    most_gain: float
    open_left: int


Plan = tuple[str, tuple[Step, ...]]
"""A candidate's name and steps, before it is played."""


def step_candidates(task: PlanTask, *, table: bool, span: float) -> list[StepCandidate]:
    """Return holds in all 26 directions, and for gyros turns by hand, or a table's rotations, about six axes.

    Parameters
    ----------
    task : unit, place, and the protocol whose times and table are taken.
    table : whether there is a table.
    span : s over which biases wander.
    """
    hold, _ = _usual_times(task)
    plans: list[Plan] = [
        (_hold_words(up, hold), (HoldStep(hold, Pose(up, None, BY_HAND)),)) for up in twenty_six_directions()
    ]
    if np.any(task.parameters() >= PARAMETER_GROUPS["gyro bias"].start):
        plans += _rotations(task.protocol) if table else _hand_turns(task)
    return _played(task, plans, span)


def turn_candidates(task: PlanTask, *, table: bool, span: float) -> list[StepCandidate]:
    """Return turns by hand about six axes, or a table's rotations about them: from where does not matter.

    Parameters
    ----------
    task, table, span : as for `step_candidates`.
    """
    return _played(task, _rotations(task.protocol) if table else _hand_turns(task), span)


def _usual_times(task: PlanTask) -> tuple[float, float]:
    """Seconds of a hold and of a turn by hand, as the protocol has them."""
    holds = [step.duration for step in task.protocol.steps if isinstance(step, HoldStep)]
    turns = [step.duration for step in task.protocol.steps if isinstance(step, TurnStep)]
    return float(np.median(holds)) if holds else HOLD, float(np.median(turns)) if turns else TURN


def _hold_words(up_b: Vector, hold: float) -> str:
    return f"hold {describe_direction(up_b)} for {hold:.0f} s"


def led_holds(task: PlanTask, span: float, start_b: Vector) -> list[StepCandidate]:
    """Return holds in all 26 directions, each with the shortest turn that leads there from a rest that is known.

    Parameters
    ----------
    task, span : as for `step_candidates`.
    start_b : (3,) unit vector that points up in b before. What the gyros see of the turn counts, and its time.
    """
    hold, turn = _usual_times(task)
    rest = HoldStep(hold, Pose(start_b, None, BY_HAND))
    plans: list[Plan] = [("", (rest,))]
    for up in twenty_six_directions():
        led = _led_turn(start_b, up, turn)
        if led.angle is not None and led.angle >= SAME_POSE:
            plans.append((_hold_words(up, hold), (rest, led, HoldStep(hold, Pose(up, None, BY_HAND)))))
    known, *made = _played(task, plans, span)
    # The rest before is known already, and the turn is whatever leads to the hold.
    less = JointInformation(-known.information.matrix)
    return [
        StepCandidate(one.name, _seconds(one.steps[1:]), one.information.plus(less), one.steps[-1:])
        for one in made
    ]


def _led_turn(start_b: Vector, up_b: Vector, turn: float) -> TurnStep:
    """The shortest turn by hand after which another direction points up."""
    across = np.cross(up_b, start_b)
    angle = float(np.arctan2(np.linalg.norm(across), up_b @ start_b))
    if np.linalg.norm(across) < 1e-6:
        across = np.cross(up_b, np.roll(up_b, 1) + np.array([0.0, 0.0, 0.5]))
    axis = np.asarray(across / np.linalg.norm(across), dtype=np.float64)
    # Nobody reads its angle, but the pose that it ends in is seen.
    return TurnStep(max(SHORTEST_TURN, turn * angle / np.pi), axis, angle)


def usual_pose(task: PlanTask, span: float) -> JointInformation:
    """Return what a pose determines, with the turn to it, of a list of all 26 directions in no order.

    Parameters
    ----------
    task : unit, place, and the protocol whose times are taken.
    span : s over which biases wander.
    """
    hold, turn = _usual_times(task)
    order = np.random.default_rng(task.seed).permutation(twenty_six_directions())
    steps: list[Step] = [HoldStep(hold, Pose(order[0], None, BY_HAND))]
    for before, up in pairwise(order):
        steps += [_led_turn(before, up, turn), HoldStep(hold, Pose(up, None, BY_HAND))]
    (whole,) = _played(task, [("", tuple(steps))], span)
    return JointInformation(whole.information.matrix / len(order))


def _hand_turns(task: PlanTask) -> list[Plan]:
    hold, turn = _usual_times(task)
    plans: list[Plan] = []
    for name, axis, up in _AXES:
        for degrees in (180, 360):
            words = (
                f"turn by hand by {degrees}° about {name}, held level, {hold:.0f} s at rest before and after"
            )
            slow = TurnStep(turn * max(1.0, degrees / 180.0), unit(axis), np.radians(degrees), HAND_ANGLE)
            plans.append((words, (HoldStep(hold, Pose(unit(up), None, BY_HAND)), slow, HoldStep(hold))))
    return plans


def _rotations(protocol: Protocol) -> list[Plan]:
    """Rotations of the table like the protocol's first, from rest to rest, both ways."""
    steps = (*protocol.steps, *named_protocol("turntable-9").steps)
    like = next(s for s in steps if isinstance(s, SpinStep))
    plans: list[Plan] = []
    for name, axis, up in _AXES:
        rest = HoldStep(20.0, Pose(unit(up), None, BY_HAND))
        for sign, way in ((1.0, "counter-clockwise"), (-1.0, "clockwise")):
            angle = None if like.angle is None else sign * abs(like.angle)
            spin = replace(like, rate=sign * abs(like.rate), axis_b=unit(axis), angle=angle, name="")
            turned = abs(like.rate) * (like.duration + like.ramp) if angle is None else abs(angle)
            words = f"rotate the table by {turned / (2.0 * np.pi):.3g} turns about {name}, level, {way}"
            plans.append((words, (rest, spin, rest)))
    return plans


def _played(task: PlanTask, plans: Sequence[Plan], span: float) -> list[StepCandidate]:
    """Play candidates one after the other, each from a pose of its own."""
    turn, steps, apart = _usual_times(task)[1], list[Step](), set[int]()
    for _, own in plans:
        steps += [TurnStep(turn)] if steps else []
        apart.add(len(steps))
        steps += own
    protocol = Protocol("candidates", "joint", tuple(steps))
    rng, span = np.random.default_rng([task.seed, 17]), max(span, *(_seconds(own) for _, own in plans))
    session = planned_session(protocol, task.site, task.noise, rng, clock=task.clock, span=span, apart=apart)
    problem = planned_problem(session, g_sensitivity=task.g_sensitivity, start=exact_sensors(), settle=False)
    return [
        StepCandidate(name, _seconds(own) + turn, known, own)
        for (name, own), known in zip(plans, problem.sections(), strict=True)
    ]


def _seconds(steps: Sequence[Step]) -> float:
    return Protocol("", "joint", tuple(steps)).duration


def find_next_steps(
    task: PlanTask,
    known: JointInformation,
    candidates: Sequence[StepCandidate],
    count: int = 3,
    aim: Aim | None = None,
    names: Sequence[str] = NAMES,
) -> list[NextStep]:
    """Return the steps that tell most for their time, one after the other.

    With an aim a step is judged by what it adds to what will be known when the limits are reached, if the other steps
    are like any other: what is told now for the first time will by then have been told anyhow.

    Parameters
    ----------
    task : which parameters matter; its own `known` is added.
    known : information so far.
    candidates : to choose from.
    count : how many.
    aim : limits to reach; None makes all parameters better known alike.
    names : (30,) what the reader calls `NAMES`.
    """
    found, task = list[NextStep](), task.with_perfect_clock
    seconds = np.array([one.seconds for one in candidates])
    for _ in range(count):
        covariance = task.covariance(known)
        sigma, at = np.sqrt(np.diag(covariance)), task.parameters()
        after = [task.covariance(known.plus(one.information)) for one in candidates]
        if aim is None:
            ahead = mean_log_sigma(task, covariance) - np.array([mean_log_sigma(task, one) for one in after])
        else:
            at = _wanted(task, aim, sigma)
            end = aim.after(known, max(aim.poses_left(task, known) - 1.0, 0.0))
            ends = [aim.distance(task, end.plus(one.information)) for one in candidates]
            ahead = aim.distance(task, end) - np.array(ends)
        best = int(np.argmax(ahead / seconds))
        gain = mean_log_sigma(task, covariance, at) - mean_log_sigma(task, after[best], at)
        known = known.plus(candidates[best].information)
        sigmas = np.sqrt(np.diag(after[best]))
        falls = 1.0 - sigmas[at] / sigma[at]
        most = int(np.argmax(falls))
        found.append(
            NextStep(
                candidates[best],
                sigmas,
                -float(np.expm1(-gain)),
                names[int(at[most])],
                float(falls[most]),
                int(np.count_nonzero(sigmas[at] >= TOLD * task.sizes[at])),
            )
        )
    return found


def _wanted(task: PlanTask, aim: Aim, sigma: Series) -> np.ndarray:
    """The parameters that are above their limits or not told; all if none is."""
    at = task.parameters()
    wanted = at[(sigma > np.minimum(aim.limits, TOLD * task.sizes))[at]]
    return wanted if len(wanted) else at


def what_would_tell(
    task: PlanTask, known: JointInformation, weak: Weakness, candidates: Sequence[StepCandidate]
) -> tuple[StepCandidate, float] | None:
    """Return the step that tells a weak combination best, and its sigma then in data-sheet spreads; None if none does.

    Parameters
    ----------
    task, known : what is there.
    weak : a combination that is not told.
    candidates : to choose from.
    """
    best: tuple[StepCandidate, float] | None = None
    for one in candidates:
        covariance = task.covariance(known.plus(one.information))
        direction = weak.direction / task.sizes
        # The combination's own variance, of parameters in spreads.
        sigma = float(np.sqrt(max(direction @ covariance @ direction, 0.0)))
        if sigma < min(TOLD, weak.sigma) and (best is None or sigma < best[1]):
            best = (one, sigma)
    return best


def judge_stop(
    task: PlanTask,
    known: JointInformation,
    following: Sequence[NextStep],
    limits: Series | None,
    sigmas: tuple[Series, Series] | None = None,
    plan: JointPlan | None = None,
    names: Sequence[str] = NAMES,
) -> tuple[bool, list[str]]:
    """Return whether to stop, and why, in sentences.

    Parameters
    ----------
    task, known : what is there.
    following : of `find_next_steps`.
    limits : (30,) wished-for sigmas, SI, infinite where nothing is wished; None for none at all.
    sigmas : (30,) what is known, and that without the clock's part, as far as it is better known than by the
        information: of a plan, whose biases wander from hold to hold alike.
    plan : what is judged by the table that the reader has, its sigmas and rows; None for `sigmas` alone.
    names : (30,) what the reader calls `NAMES`.
    """
    own = None if plan is None else (plan.sigmas, plan.without_clock)
    sigma, perfect = (
        own or sigmas or [np.sqrt(np.diag(one.covariance(known))) for one in (task, task.with_perfect_clock)]
    )
    untold = dict.fromkeys(names[int(i)] for i in task.parameters() if perfect[i] >= TOLD * task.sizes[i])
    if untold:
        return False, [f"Not determined yet: {', '.join(untold)}."]
    words: list[str] = []
    if limits is not None:
        beyond = dict.fromkeys(names[i] for i in np.flatnonzero(sigma > limits).tolist())
        off = beyond if plan is None else plan.beyond(limits)
        if not off:
            return True, ["All targets are reached: stop here."]
        words.append(f"The target is not reached by {', '.join(off)}.")
    if following and following[0].most_gain < WORTH:
        words.append(
            f"One more step would take at most {100.0 * following[0].most_gain:.1f} % off any standard uncertainty: it "
            "is hardly worth its time."
        )
        return limits is None, words
    return False, words
