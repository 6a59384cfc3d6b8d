"""What any protocol is worth: every parameter foretold as `calibrate` will state it, and what stays open.

Hands do a protocol differently each time: poses are off by degrees, headings fall anyhow. So it is played several
times, and what is foretold is the root mean square over these; how much they differ is told, too.

What each step is worth is what is lost without it, and what is gained if it lasts longer. By the equivalence theorem of
D-optimal designs a step's share of the information should be its share of the time: a step above that should last
longer, one below it may be shorter. That is so for white noise; where a bias wanders longer holds do not help, which
the gain of a quarter more time shows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration import (
    LAYOUT,
    FleetSheet,
    Options,
    Session,
    find_procedure,
    gravity_slope,
    named_function,
    unseen_table,
)
from tumble.counting import counted
from tumble.design.joint_information import (
    NAMES,
    PARAMETER_GROUPS,
    PARAMETERS,
    TOLD,
    JointInformation,
    PlannedProblem,
    exact_sensors,
    parameter_sizes,
    planned_problem,
    spread_of_sizes,
    with_longer_hold,
)
from tumble.design.planned_motion import PlannedNoise, planned_session, require_plannable
from tumble.earth import Site
from tumble.protocol import HoldStep, Protocol, SpinStep
from tumble.records import dataclass
from tumble.sensor import jacobian
from tumble.simulation import Grade

UNITS_SI = "m/s²", "rad/s"
# How often a protocol is played: by hand each time differs, on a table hardly.
DRAWS_BY_HAND, DRAWS_ON_TABLE = 8, 2
# What a table's rows may be called beside a group: in the fixture's frame, and in the gyros' own.
OTHERWISE = {"rotation between the triads": ("gyro misalignment", "accelerometer misalignment")}
# A step that lasts longer: by this share of itself.
LONGER = 0.25


@dataclass(frozen=True)
class PlanTask:
    """What is planned, with what, and where.

    Attributes
    ----------
    protocol, site : what is to be done.
    noise : of the unit.
    sizes : (30,) one sigma of each parameter before the test, see `parameter_sizes`.
    g_sensitivity : whether units of this kind have one, which is then estimated.
    sheet : whose spreads are believed beforehand; None for nobody's.
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
    sheet: Grade | FleetSheet | None = None
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
        """Whether there is a table."""
        return any(isinstance(s, SpinStep) for s in self.protocol.steps)

    @property
    def common(self) -> tuple[float, float]:
        """Standard uncertainties of clock and table, shares."""
        table = unseen_table(self.protocol)
        return self.clock, 0.0 if table is None else table.sigma

    def covariance(self, information: JointInformation) -> Square:
        """Return (30, 30) of what is there already and this information together."""
        total = information if self.known is None else information.plus(self.known)
        return total.covariance(self.sizes, self.estimated, common=self.common, sheet=self.sheet is not None)

    @property
    def with_perfect_clock(self) -> PlanTask:
        """The same with a perfect clock: no step mends it."""
        return replace(self, clock=0.0)

    @property
    def estimated(self) -> np.ndarray:
        """Indices of the parameters that are estimated."""
        return np.arange(PARAMETERS if self.g_sensitivity else PARAMETER_GROUPS["g-sensitivity"].start)

    def parameters(self) -> np.ndarray:
        """Return the indices of the parameters that are estimated and that the procedure is made for."""
        promises = find_procedure(self.protocol.procedure).promises
        triads = (
            "gyros" if i >= PARAMETER_GROUPS["gyro bias"].start else "accelerometers" for i in self.estimated
        )
        return self.estimated[[not promises or triad in promises for triad in triads]]

    def problem(self, draw: int = 0, protocol: Protocol | None = None) -> tuple[Session, PlannedProblem]:
        """Return what a performance of the protocol, or of another one, offers, and its equations.

        Parameters
        ----------
        draw, protocol : which performance of what.
        """
        rng, options = np.random.default_rng([self.seed, draw]), Options(data_sheet=self.sheet)
        session = planned_session(
            *(protocol or self.protocol, self.site, self.noise, rng), clock=self.clock, options=options
        )
        return session, planned_problem(session, g_sensitivity=self.g_sensitivity, start=exact_sensors())


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Foretold:
    """A parameter as `calibrate` will state it.

    Attributes
    ----------
    name, unit : as `calibrate` has them, in the frame of its procedure.
    sigma : predicted standard uncertainty, SI, with gravity's, the clock's and the table's.
    without_clock : the same with a perfect clock.
    spread : the largest sigma of a performance over the smallest.
    told : whether it is known better than from the data sheet, but for the clock, which no step mends.
    """

    name: str
    unit: str
    sigma: float
    without_clock: float
    spread: float
    told: bool


@dataclass
class JointPlan:
    """What a protocol is worth.

    Attributes
    ----------
    task : what was asked.
    session, problem, information : of the first performance.
    foretold : every parameter in the frame of the procedure.
    sigmas, without_clock : (30,) predicted standard uncertainties of `NAMES`, SI, as of `Foretold`; NaN for what is not
        estimated.
    weak : what stays open.
    """

    task: PlanTask
    session: Session
    problem: PlannedProblem
    information: JointInformation
    foretold: list[Foretold]
    sigmas: Series
    without_clock: Series
    weak: list[Weakness] = field(default_factory=list[Weakness])

    @property
    def duration(self) -> float:
        """Seconds, turns included."""
        return self.task.protocol.duration

    @property
    def names(self) -> list[str]:
        """What the table's frame calls `NAMES`, as rows begin: angles without a row are among those of their group."""
        rows, made = [one.name for one in self.foretold], list[str]()
        for group, part in PARAMETER_GROUPS.items():
            for name in NAMES[part]:
                ways = name, name.rpartition(" ")[0], group, *OTHERWISE.get(group, ())
                made.append(next((one for one in ways if any(row.startswith(one) for row in rows)), group))
        return made

    def beyond(self, limits: Series) -> list[str]:
        """Return the table's rows whose standard uncertainty is beyond its target, and what has a target and no row.

        Parameters
        ----------
        limits : (30,) wished-for sigmas, SI, infinite where nothing is wished.
        """
        off: dict[str, None] = {}
        for limit, name in zip(limits.tolist(), self.names, strict=True):
            rows = {one.name: one.sigma for one in self.foretold if one.name.startswith(name)}
            rows = rows or {f"{name}, which this plan does not determine": np.inf}
            off |= dict.fromkeys(row for row, sigma in rows.items() if sigma > limit)
        return list(off)


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
    made: list[tuple[Session, PlannedProblem, JointInformation]] = []
    if say is not None:
        say("playing it")
    for draw in counted(range(draws), draws):
        session, problem = task.problem(draw)
        made.append((session, problem, problem.information()))
    found = [_foretold(task, problem) for _, problem, _ in made]
    sigmas, low, high = (
        [np.sqrt(of([one[k] for one in found], axis=0)) for k in range(4)] for of in (np.mean, np.min, np.max)
    )
    labels, sizes = named_function(made[0][1].terms, "full", made[0][1].frame, UNITS_SI)[0], found[0][4]
    spread = high[1] / np.maximum(low[1], 1e-300)
    foretold = [
        Foretold(name, unit, float(sigma), float(perfect), float(ratio), told=bool(perfect < TOLD * size))
        for (name, unit), sigma, perfect, ratio, size in zip(labels, *sigmas[:2], spread, sizes, strict=True)
    ]
    plan = JointPlan(task, *made[0], foretold, sigmas[2], sigmas[3])
    # Of several performances the one that determines least says what may stay open.
    worst = [float(np.nanmax(one[3] / task.sizes**2)) for one in found]
    plan.weak = find_weaknesses(task, made[int(np.argmax(worst))][2], plan.names)
    return plan


def _foretold(task: PlanTask, problem: PlannedProblem) -> list[Series]:
    """Variances with and without the clock's part in the procedure's frame, the same of `NAMES`, and sizes."""
    u = problem.task.unknowns
    known = task.known or JointInformation(np.zeros((PARAMETERS, PARAMETERS)))
    gravity = task.site.gravity_sigma * gravity_slope(u.values, task.site)
    covariance = problem.stated(known, gravity)
    (at,) = LAYOUT.indices("clock")
    clock = covariance[:, at] / np.sqrt(max(float(covariance[at, at]), 1e-300))
    perfect = covariance - np.outer(clock, clock)

    def variances(frame: str, *covariances: Square) -> list[Series]:
        slope = jacobian(named_function(problem.terms, "full", frame, UNITS_SI)[1], u.values)
        return [np.sum((slope @ one) * slope, axis=1) for one in covariances]

    *own, sizes = variances(problem.frame, covariance, perfect, spread_of_sizes(u, task.sizes))
    # Of `NAMES`: what follows is of other terms, and g-sensitivity may not be estimated.
    named = np.full((2, PARAMETERS), np.nan)
    for row, one in zip(named, variances("accelerometer-x", covariance, perfect), strict=True):
        row[task.estimated] = one[task.estimated]
    return [*own, *named, np.sqrt(sizes)]


def find_weaknesses(
    task: PlanTask, information: JointInformation, names: Sequence[str] = NAMES
) -> list[Weakness]:
    """Return what this information, with what is there already, does not tell better than the data sheet.

    Parameters
    ----------
    task : with what is known already.
    information : of the planned test.
    names : (30,) what the reader calls `NAMES`.
    """
    total = information if task.known is None else information.plus(task.known)
    return [
        Weakness(tuple(dict.fromkeys(names[i] for i in weak.leading())), weak.sigma, weak.direction)
        for weak in total.weak_directions(task.sizes, task.parameters(), (0.0, task.common[1]))
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


@dataclass(frozen=True)
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
    """Return the worth of every hold and every rotation, in their order.

    Parameters
    ----------
    plan : of the whole protocol; its first performance is looked at.
    say : called with a sentence on what is being done.
    """
    task, problem, base = plan.task, plan.problem, plan.information
    data, (_, matching) = problem.task.data, plan.session.matched
    found: list[tuple[int, JointInformation, float]] = []
    if say is not None:
        say("leaving out one step after the other")
    for hold in counted(matching.holds, len(matching.holds)):
        left = problem.task.copy().taking_part
        for kind in ("force", "rate", "pose"):
            left[kind][hold.hold] = False
        longer = problem.changed(data=with_longer_hold(data, hold.hold, 1.0 + LONGER))
        found.append((hold.step, problem.changed(left), _gain(task, base, longer)))
    longer_gain: dict[tuple[float, float], float] = {}
    for before, spin in counted(data.rotations.items(), len(data.rotations)):
        step = matching.spins[spin.row].step
        spun = task.protocol.steps[step]
        assert isinstance(spun, SpinStep)
        # Rotations that are alike gain alike: the first of each kind is played longer.
        alike = (abs(spun.rate), spun.duration)
        if alike not in longer_gain:
            _, played = task.problem(0, with_longer_step(task.protocol, step, 1.0 + LONGER))
            longer_gain[alike] = _gain(task, base, played.information())
        found.append((step, problem.changed(without=before), longer_gain[alike]))
    return _worths(plan, sorted(found, key=lambda one: one[0]))


def _worths(plan: JointPlan, found: list[tuple[int, JointInformation, float]]) -> list[StepWorth]:
    task, at, names = plan.task, plan.task.parameters(), plan.names
    covariance = task.covariance(plan.information)
    part = slice(PARAMETERS)
    seconds = np.array([_step_seconds(task.protocol, step) for step, *_ in found])
    lost = [plan.information.matrix[part, part] - less.matrix[part, part] for _, less, _ in found]
    own: Series = np.array([max(float(np.sum(covariance * one)), 0.0) for one in lost])
    shares = own / max(float(own.sum()), 1e-30)
    sigma = np.sqrt(np.diag(covariance)[at])
    made: list[StepWorth] = []
    for (step, less, longer), share, time in zip(found, shares.tolist(), seconds.tolist(), strict=True):
        left, one = task.covariance(less), task.protocol.steps[step]
        growth = np.sqrt(np.diag(left)[at]) / sigma
        worst = int(np.argmax(growth))
        made.append(
            StepWorth(
                *(step, "rotation" if isinstance(one, SpinStep) else "hold", one.name or f"step {step + 1}"),
                *(time, time / float(seconds.sum()), share),
                float(np.expm1(mean_log_sigma(task, left) - mean_log_sigma(task, covariance))),
                *(names[int(at[worst])], float(growth[worst]), longer),
            )
        )
    return made


def _gain(task: PlanTask, base: JointInformation, longer: JointInformation) -> float:
    """By how much the sigmas fall, as a share."""
    before, after = (mean_log_sigma(task, task.covariance(one)) for one in (base, longer))
    return -float(np.expm1(after - before))


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
    assert isinstance(one, SpinStep | HoldStep)
    return one.duration + (2.0 * one.ramp if isinstance(one, SpinStep) else 0.0)
