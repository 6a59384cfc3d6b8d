"""What any protocol is worth: every parameter of both triads foretold, and what stays open.

Hands do a protocol differently each time: poses are off by degrees, headings fall anyhow. So it is played several
times, and what is foretold is the root mean square over these; how much they differ is told, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.calibration.equations.causes import FORCE_WANDER
from tumble.counting import counted
from tumble.design.hold_noise import hold_covariance
from tumble.design.joint_information import (
    GROUPS,
    NAMES,
    PARAMETERS,
    TOLD,
    JointInformation,
    PlannedProblem,
    open_spreads,
    parameter_sizes,
    planned_problem,
)
from tumble.design.planned_motion import PlannedNoise, PlayedPlan, planned_data, play_plan, require_plannable
from tumble.earth import Site
from tumble.protocol.steps import Protocol, SpinStep
from tumble.records import dataclass
from tumble.simulation import Grade

# How often a protocol is played: by hand each time differs, on a table hardly.
DRAWS_BY_HAND, DRAWS_ON_TABLE = 8, 2
# Of the stated variance, what is left at least when a wander that all holds share is taken out.
LEAST_SHARE = 0.02


@dataclass(frozen=True, slots=True)
class PlanTask:
    """What is planned, with what, and where.

    Attributes
    ----------
    protocol, site : what is to be done.
    noise : of the unit.
    sizes : (30,) one sigma of each parameter before the test, see `parameter_sizes`.
    g_sensitivity : whether units of this kind have one, which is then estimated.
    sheet : believe the sizes beforehand.
    known : what is there already.
    draws : how often it is played; None for a number that suits the protocol.
    seed : of placement, headings and hands.
    clock : standard uncertainty of the sample rate as a share, which all gyro scale factors have in common.
    """

    protocol: Protocol
    site: Site
    noise: PlannedNoise
    sizes: Series
    g_sensitivity: bool
    sheet: bool = False
    known: JointInformation | None = None
    draws: int | None = None
    seed: int = 0
    clock: float = 0.0

    @staticmethod
    def of_grade(
        protocol: Protocol, grade: Grade, site: Site, *, draws: int | None = None, seed: int = 0
    ) -> PlanTask:
        """Return the task of a unit of a grade.

        Parameters
        ----------
        protocol, site : what is to be done, and where.
        grade : noise, and spreads.
        draws, seed : as of the class.
        """
        noise = PlannedNoise(grade.accelerometer.noise, grade.gyroscope.noise, grade.rate)
        sizes = parameter_sizes(grade)
        return PlanTask(protocol, site, noise, sizes, grade.g_sensitivity > 0.0, draws=draws, seed=seed)

    @property
    def has_table(self) -> bool:
        """Whether a table's angles are read."""
        return any(isinstance(s, SpinStep) and s.angle is not None for s in self.protocol.steps)

    @property
    def is_beyond_clock(self) -> bool:
        """Whether what is there already knows gyro scale factors better than the clock."""
        return self.known is not None and self.known.is_beyond_clock(self.clock)

    def covariance(self, information: JointInformation) -> Square:
        """Return (30, 30) of what is there already and this information together."""
        total = information if self.known is None else information.plus(self.known)
        return total.covariance(self.sizes, g_sensitivity=self.g_sensitivity, sheet=self.sheet)

    def known_before(self) -> Square:
        """Return (30, 30) information of what is there already, and of the sizes as far as they are believed."""
        own = np.diag(1.0 / open_spreads(self.sizes, sheet=self.sheet) ** 2)
        return own if self.known is None else own + self.known.matrix

    def parameters(self) -> np.ndarray:
        """Return the indices of the parameters that are estimated."""
        return np.arange(PARAMETERS if self.g_sensitivity else GROUPS["g-sensitivity"].start)


@dataclass(frozen=True, slots=True)
class Weakness:
    """A combination of parameters that the test does not tell.

    Attributes
    ----------
    parameters : names of those that carry it, the heaviest first.
    sigma : its standard uncertainty in data-sheet spreads; infinite if nothing is told.
    direction : (30,) in those spreads.
    """

    parameters: tuple[str, ...]
    sigma: float
    direction: Series


@dataclass(slots=True)
class JointPlan:
    """What a protocol is worth.

    Attributes
    ----------
    task : what was asked.
    played : the first performance; `problem` and `information` are its.
    sigmas : (30,) predicted standard uncertainties, SI, with gravity's and the clock's; NaN for what is not estimated.
    noise_sigmas : (30,) without these two.
    spread : (30,) the largest sigma of a performance over the smallest.
    told : (30,) of bool: whether it is known better than from the data sheet.
    g_sigmas : (9,) of the g-sensitivity, were it estimated.
    weak : what stays open.
    """

    task: PlanTask
    played: PlayedPlan
    problem: PlannedProblem
    information: JointInformation
    sigmas: Series
    noise_sigmas: Series
    spread: Series
    told: np.ndarray
    g_sigmas: Series
    weak: list[Weakness] = field(default_factory=list[Weakness])

    @property
    def duration(self) -> float:
        """Seconds of all steps together."""
        return self.task.protocol.duration

    def group_rms(self, name: str) -> float:
        """Return the root mean square sigma of one of `GROUPS`, SI; NaN where it is not estimated or not told."""
        part = GROUPS[name]
        return float(np.sqrt(np.mean(self.sigmas[part] ** 2))) if np.all(self.told[part]) else float("nan")


def plan_protocol(task: PlanTask, say: Callable[[str], None] | None = None) -> JointPlan:
    """Foretell what a protocol determines.

    Parameters
    ----------
    task : what is planned.
    say : called with a sentence on what is being done.

    Raises
    ------
    UsageError, ProtocolError
        If the protocol is none that can be planned or played.
    """
    require_plannable(task.protocol)
    draws = task.draws or (DRAWS_ON_TABLE if task.has_table else DRAWS_BY_HAND)
    made: list[tuple[PlayedPlan, PlannedProblem, JointInformation]] = []
    if say is not None:
        say("playing it")
    for draw in counted(range(draws), draws):
        played = play_plan(task.protocol, task.site, np.random.default_rng([task.seed, draw]))
        problem = planned_problem(planned_data(played, task.noise), task.site, task.sizes)
        made.append((played, problem, problem.information()))
    variances = np.array([np.diag(true_covariance(task, played, problem)) for played, problem, _ in made])
    return _plan(task, made, variances)


def _plan(
    task: PlanTask, made: list[tuple[PlayedPlan, PlannedProblem, JointInformation]], variances: Table
) -> JointPlan:
    played, problem, information = made[0]
    noise = np.sqrt(variances.mean(axis=0))
    asked = np.zeros(PARAMETERS, dtype=bool)
    asked[task.parameters()] = True
    noise[~asked] = np.nan
    told = asked & (noise < TOLD * task.sizes)
    total = noise.copy()
    scale = GROUPS["accelerometer scale"]
    total[scale] = np.hypot(noise[scale], task.site.gravity_sigma / task.site.gravity)
    total = np.sqrt(total**2 + clock_variances(task, information))
    full = np.sqrt(np.diag(replace(task, g_sensitivity=True).covariance(information)))
    low, high = np.sqrt(variances.min(axis=0)), np.sqrt(variances.max(axis=0))
    spread = np.where(low > 0.0, high / np.where(low > 0.0, low, 1.0), 1.0)
    plan = JointPlan(
        task,
        played,
        problem,
        information,
        total,
        noise,
        spread,
        told,
        np.asarray(full[GROUPS["g-sensitivity"]], dtype=np.float64),
    )
    # Of several performances the one that determines least says what may stay open.
    least = int(np.argmax(np.max(np.sqrt(variances) / task.sizes, axis=1)))
    plan.weak = find_weaknesses(task, made[least][2])
    return plan


def true_covariance(task: PlanTask, played: PlayedPlan, problem: PlannedProblem) -> Square:
    """Return (30, 30) covariance of the estimate where biases wander from hold to turn to hold, neighbours alike.

    A bias is asked for as its mean over the session. Of the gyros this is what the joint estimator states; of the
    accelerometers it knows 1/f noise as it is found, and here their random walk counts, too.

    Parameters
    ----------
    task, played, problem : noise, motion and equations.
    """
    influences = problem.influences(task.known_before(), g_sensitivity=task.g_sensitivity)
    covariance = influences.covariance - influences.neighbours.get(FORCE_WANDER, 0.0)
    triad = task.noise.accelerometer
    if triad.wanders:
        times = played.truth.hold_edges
        floor = float(problem.task.data.base.force_floor[0])
        wander = hold_covariance(times, replace(triad, random_walk=0.0, resolution=0.0))
        # By how much the unknowns move if all of a hold shows more by one along an axis.
        gain = np.zeros((len(times), len(covariance), 3))
        for one in influences.each:
            if one.kind == "force":
                gain[one.place] = one.gain @ np.linalg.solve(one.root, np.tile(np.eye(3), (3, 1)))
        across = np.tensordot(wander - floor * np.eye(len(times)), gain, 1)
        covariance += np.tensordot(gain, across, ((0, 2), (0, 2)))
    made = problem.in_names(covariance)
    # What is left out of the model of the noise may take too much: rotations' accelerometers wander by themselves.
    alone = np.diag(problem.in_names(influences.independent))
    np.fill_diagonal(made, np.maximum(np.diag(made), LEAST_SHARE * alone))
    return made


def clock_variances(task: PlanTask, information: JointInformation) -> Series:
    """Return (30,) by how much the clock adds to the variances of the parameters.

    Where what is there already has the gyro scale factors from another clock, or from a table, it tells this clock.

    Parameters
    ----------
    task : the clock, and what is there already.
    information : of the planned test, its clock taken as perfect.
    """
    added = np.zeros(PARAMETERS)
    if not task.is_beyond_clock:
        added[GROUPS["gyro scale"]] = task.clock**2
        return added
    perfect, open_ = (
        np.diag(task.covariance(one)) for one in (information, information.beside_clock(task.clock))
    )
    return np.maximum(open_ - perfect, 0.0)


def find_weaknesses(task: PlanTask, information: JointInformation) -> list[Weakness]:
    """Return what this information, with what is there already, does not tell better than the data sheet.

    Parameters
    ----------
    task : with what is known already.
    information : of the planned test.
    """
    total = information if task.known is None else information.plus(task.known)
    return [
        Weakness(tuple(NAMES[i] for i in weak.leading()), weak.sigma, weak.direction)
        for weak in total.weak_directions(task.sizes, g_sensitivity=task.g_sensitivity)
    ]


def mean_log_sigma(task: PlanTask, covariance: Square, at: np.ndarray | None = None) -> float:
    """Return the mean of the logarithms of all parameters' joint uncertainty: what steps are judged by.

    It is ``ln det C / 2p``, which does not depend on units, and goes down by ln 2 where the time (of white
    noise) is four times as long.

    Parameters
    ----------
    task : which parameters there are.
    covariance : (30, 30).
    at : indices of the parameters that count; None for all.
    """
    at = task.parameters() if at is None else at
    scaled = covariance[np.ix_(at, at)] / np.outer(task.sizes[at], task.sizes[at])
    return float(np.linalg.slogdet(scaled)[1]) / (2.0 * at.size)
