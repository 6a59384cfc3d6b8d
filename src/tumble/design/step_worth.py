"""What each step of a test is worth: what is lost without it, and what is gained if it lasts longer.

By the equivalence theorem of D-optimal designs a step's share of the information should be its share of the time:
a step above that should last longer, one below it may be shorter. That is so for white noise; where a bias wanders
longer holds do not help, which the gain of a quarter more time shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square
from tumble.counting import counted
from tumble.design.joint_information import NAMES, JointInformation, planned_problem
from tumble.design.joint_plan import JointPlan, PlanTask, mean_log_sigma
from tumble.design.planned_motion import planned_data, play_plan
from tumble.protocol.steps import HoldStep, Protocol, SpinStep
from tumble.records import dataclass

# A step that lasts longer: by this share of itself.
LONGER = 0.25


@dataclass(frozen=True, slots=True)
class StepWorth:
    """What a step contributes.

    Attributes
    ----------
    step : index in the protocol.
    kind : "hold" or "rotation".
    name, seconds : as the protocol has them; a rotation with its ramps.
    share_of_time : of all holds and rotations.
    share_of_information : of all holds and rotations.
    loss : by how much the sigmas grow without it, the geometric mean, as a share.
    most, most_growth : the parameter that suffers most, and how many times its sigma becomes.
    longer : by how much the sigmas fall if it lasts a quarter longer, as a share; of rotations at one rate and of
        one duration that of the first.
    """

    step: int
    kind: str
    name: str
    seconds: float
    share_of_time: float
    share_of_information: float
    loss: float
    most: str
    most_growth: float
    longer: float

    @property
    def longer_per_minute(self) -> float:
        """By how much the sigmas fall for each minute that it lasts longer, as a share."""
        return self.longer / (LONGER * self.seconds / 60.0)


def find_step_worths(plan: JointPlan, say: Callable[[str], None] | None = None) -> list[StepWorth]:
    """Return the worth of every hold and every rotation whose angle is read, in their order.

    Parameters
    ----------
    plan : of the whole protocol; its first performance is looked at.
    say : called with a sentence on what is being done.
    """
    task, data = plan.task, plan.problem.task.data
    base = plan.information
    covariance = task.covariance(base)
    found: list[tuple[int, str, JointInformation, float]] = []
    if say is not None:
        say("leaving out one step after the other")
    for hold, step in counted(enumerate(plan.played.truth.hold_steps), data.holds):
        if step is None:
            continue
        left = plan.problem.task.copy().taking_part
        left["force"][hold] = left["rate"][hold] = False
        stretch = np.ones(data.holds)
        stretch[hold] = 1.0 + LONGER
        longer = plan.problem.information(
            data=planned_data(plan.played, task.noise, stretch=stretch, like=data)
        )
        gain = _gain(task, base, longer)
        found.append((step, "hold", plan.problem.information(left), gain))
    longer_gain: dict[tuple[float, float], float] = {}
    for before, spin in counted(data.rotations.items(), len(data.rotations)):
        step = plan.played.truth.spins[spin.row].step
        spun = task.protocol.steps[step]
        assert isinstance(spun, SpinStep)
        # Rotations that are alike gain alike: the first of each kind is played longer.
        alike = (abs(spun.rate), spun.duration)
        if alike not in longer_gain:
            longer_gain[alike] = _played_longer(plan, step)
        found.append((step, "rotation", plan.problem.information(without=before), longer_gain[alike]))
    return _worths(plan, sorted(found, key=lambda one: one[0]), covariance)


def _worths(
    plan: JointPlan, found: list[tuple[int, str, JointInformation, float]], covariance: Square
) -> list[StepWorth]:
    task, at = plan.task, plan.task.parameters()
    seconds = np.array([_step_seconds(task.protocol, step) for step, *_ in found])
    own: Series = np.array(
        [
            max(float(np.sum(covariance * (plan.information.matrix - less.matrix))), 0.0)
            for _, _, less, _ in found
        ]
    )
    shares = own / max(float(own.sum()), 1e-30)
    sigma = np.sqrt(np.diag(covariance)[at])
    made: list[StepWorth] = []
    for (step, kind, less, longer), share, time in zip(found, shares.tolist(), seconds.tolist(), strict=True):
        left = task.covariance(less)
        growth = np.sqrt(np.diag(left)[at]) / sigma
        worst = int(np.argmax(growth))
        loss = float(np.expm1(mean_log_sigma(task, left) - mean_log_sigma(task, covariance)))
        name = task.protocol.steps[step].name or f"step {step + 1}"
        made.append(
            StepWorth(
                step,
                kind,
                name,
                time,
                time / float(seconds.sum()),
                share,
                loss,
                NAMES[int(at[worst])],
                float(growth[worst]),
                longer,
            )
        )
    return made


def _gain(task: PlanTask, base: JointInformation, longer: JointInformation) -> float:
    """By how much the sigmas fall, as a share."""
    before, after = (mean_log_sigma(task, task.covariance(one)) for one in (base, longer))
    return -float(np.expm1(after - before))


def _played_longer(plan: JointPlan, step: int) -> float:
    """Play the protocol again with a rotation that lasts longer, and so turns further."""
    task = plan.task
    longer = with_longer_step(task.protocol, step, 1.0 + LONGER)
    played = play_plan(longer, task.site, np.random.default_rng([task.seed, 0]))
    problem = planned_problem(planned_data(played, task.noise), task.site, task.sizes)
    return _gain(task, plan.information, problem.information())


def with_longer_step(protocol: Protocol, step: int, factor: float) -> Protocol:
    """Return the protocol with a hold or spin that takes so many times as long; a spin turns further.

    Parameters
    ----------
    protocol, step, factor : which step of what, and how many times.
    """
    one = protocol.steps[step]
    if isinstance(one, SpinStep):
        ramps = one.ramp
        duration = factor * (one.duration + ramps) - ramps
        angle = None if one.angle is None else factor * one.angle
        longer = replace(one, duration=duration, angle=angle)
    else:
        longer = replace(one, duration=factor * one.duration)
    return replace(protocol, steps=(*protocol.steps[:step], longer, *protocol.steps[step + 1 :]))


def _step_seconds(protocol: Protocol, step: int) -> float:
    """Return how long a step takes, a spin with its ramps."""
    one = protocol.steps[step]
    if isinstance(one, SpinStep):
        return one.duration + 2.0 * one.ramp
    assert isinstance(one, HoldStep)
    return one.duration
