"""What a test tells of both triads: the information of a calibration's own equations, in the parameters' names.

The equations are those that `tumble.calibration.joint` begins with, linearised where the sensors are exact: every
attitude, the Earth rate and whatever belongs to one rotation is eliminated, as in a calibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, inverted
from tumble.calibration import (
    CLOCK_TOLD,
    LAYOUT,
    PLAIN,
    FleetSheet,
    Heading,
    JointAdjustment,
    Link,
    Observed,
    RecordingStretch,
    SectionStretch,
    Session,
    Turn,
    begin,
    find_procedure,
    gyro_matrix,
    imu_unknowns,
    name_plate,
    named_function,
    observe,
    recording_influences,
    still_sway,
    terms_prior,
    together,
    unknowns_of,
    unknowns_with,
)
from tumble.design.hold_noise import wander_sigma
from tumble.design.planned_motion import PlannedNoise
from tumble.estimation import (
    Chain,
    Eliminated,
    Noise,
    Prior,
    Settled,
    Unknowns,
    WeakDirection,
    find_weak_directions,
    invert_normal_matrix,
    linearise,
    solve,
)
from tumble.records import dataclass
from tumble.sensor import ImuModel, jacobian, shin_from_matrix
from tumble.simulation import Grade
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]

FREE = np.sort(np.concatenate([PLAIN, LAYOUT.indices("gyro.g_sensitivity")]))
"""The unknowns that information is about: both triads and g-sensitivity."""
_TERMS = frozenset({"g_sensitivity"})
LABELS, _EVALUATE = named_function(_TERMS, "full", "accelerometer-x", ("m/s²", "rad/s"))
NAMES = tuple(name for name, _ in LABELS)
"""Of the thirty parameters, in the order of every matrix here."""
PARAMETER_GROUPS: dict[str, slice] = {
    "accelerometer bias": slice(0, 3),
    "accelerometer scale": slice(3, 6),
    "accelerometer misalignment": slice(6, 9),
    "gyro bias": slice(9, 12),
    "gyro scale": slice(12, 15),
    "gyro misalignment": slice(15, 18),
    "rotation between the triads": slice(18, 21),
    "g-sensitivity": slice(21, 30),
}
PARAMETERS = 30
COMMON = ("clock", "table_rate")
"""What all tests on one bench share, beside the parameters: information is about both, and each has its sigma."""
# A parameter is told when the test leaves less than this of what the data sheet leaves open.
TOLD = 0.9
# Of what is not told at all: so many times the data sheet's spread.
IGNORANCE = 1e2
# s over which biases wander while a unit is captured.
SESSION = 300.0
# Of a name plate's precision: what keeps equations regular, and tells nothing.
NO_PLATE = 1e-4
# rad: nothing is known of a heading that nobody carries on, and the equations stay regular.
UNKNOWN_HEADING = 1e3
# No data sheet states that a gyro feels no gravity at all, 0.01 (°/s)/g.
_LEAST_G_SENSITIVITY = 0.01 * np.pi / 180.0 / 9.80665


def sizes_of_sheet(sheet: Grade | FleetSheet, grade: Grade) -> Series:
    """Return (30,) sizes as of `parameter_sizes`, of a data sheet; of a grade what a fleet does not say.

    Parameters
    ----------
    sheet, grade : the data sheet, and the unit's grade.
    """
    if not isinstance(sheet, FleetSheet):
        return parameter_sizes(sheet)
    sizes = parameter_sizes(grade)
    priors = sheet.prior("accelerometer", "m/s^2"), sheet.prior("gyroscope", "rad/s")
    for at, prior in zip((slice(0, 9), slice(9, 18)), priors, strict=True):
        sizes[at] = sizes[at] if prior is None else np.sqrt(np.diag(inverted(prior.precision)))
    return sizes


def parameter_sizes(grade: Grade) -> Series:
    """Return (30,) one sigma by which units of a grade differ, of each parameter, SI.

    Parameters
    ----------
    grade : whose spreads the data sheet states.
    """
    force, gyro = grade.accelerometer, grade.gyroscope
    threes = [force.bias, force.scale_factor, np.sqrt(2.0) * force.misalignment]
    threes += [gyro.bias, gyro.scale_factor, np.sqrt(2.0) * gyro.misalignment]
    threes += [float(np.hypot(force.misalignment, gyro.misalignment))]
    least = max(grade.g_sensitivity, _LEAST_G_SENSITIVITY)
    return np.maximum(np.concatenate([np.repeat(threes, 3), np.full(9, least)]), 1e-12)


@dataclass(frozen=True)
class JointInformation:
    """What is known of the thirty parameters, and of clock and table.

    Attributes
    ----------
    matrix : (32, 32) in the parameters' SI units, and in shares; of thirty rows nothing is known of `COMMON`.
    """

    matrix: Square

    def __post_init__(self) -> None:
        """Make room for clock and table."""
        more = PARAMETERS + len(COMMON) - len(self.matrix)
        object.__setattr__(self, "matrix", np.pad(self.matrix, (0, more)))

    def plus(self, other: JointInformation) -> JointInformation:
        """Return what both tell together."""
        return JointInformation(self.matrix + other.matrix)

    def covariance(
        self, sizes: Series, at: np.ndarray, *, common: Sequence[float] = (0.0, 0.0), sheet: bool = False
    ) -> Square:
        """Return (30, 30), finite throughout: what is not told is open by a hundred times its spread.

        Parameters
        ----------
        sizes : (30,) of `parameter_sizes`.
        at : indices of the parameters that are estimated; the others are taken to be nothing and have no covariance.
        common : sigmas of clock and table, shares.
        sheet : believe the data sheet's spreads beforehand.
        """
        open_by = np.zeros(len(self.matrix))
        open_by[at] = sizes[at] * (1.0 if sheet else IGNORANCE)
        if not sheet:
            # Nothing is known of a scale factor without its clock.
            open_by[PARAMETER_GROUPS["gyro scale"]] += IGNORANCE * common[0]
        open_by[PARAMETERS:] = common
        # By eigenvalues, of which round-off may have made those of nothing a little negative.
        values, vectors = np.linalg.eigh(_symmetric(self.matrix * np.outer(open_by, open_by)))
        inverse = (vectors / (np.maximum(values, 0.0) + 1.0)) @ vectors.T
        return (inverse * np.outer(open_by, open_by))[:PARAMETERS, :PARAMETERS]

    def weak_directions(
        self, sizes: Series, at: np.ndarray, common: Sequence[float] = (0.0, 0.0)
    ) -> list[WeakDirection]:
        """Return the combinations that are told no better than the data sheet does, in those sizes, worst first.

        Parameters
        ----------
        sizes, at, common : as for `covariance`.
        """
        prior = np.diag(np.maximum(common, 1e-9) ** -2.0)
        own, beside = self.matrix[np.ix_(at, at)], self.matrix[at, PARAMETERS:]
        left = own - beside @ np.linalg.solve(self.matrix[PARAMETERS:, PARAMETERS:] + prior, beside.T)
        found = find_weak_directions(_symmetric(left), sizes[at], TOLD)
        made: list[WeakDirection] = []
        for weak in found:
            direction = np.zeros(PARAMETERS)
            direction[at] = weak.direction
            made.append(replace(weak, direction=direction))
        return made


def _symmetric(matrix: Square) -> Square:
    return np.ascontiguousarray(0.5 * (matrix + matrix.T), dtype=np.float64)


@dataclass
class PlannedProblem:
    """A planned test at its true state: linearised again and again with other holds or noise.

    Attributes
    ----------
    task : the adjustment, at the truth, with everything free that a calibration adjusts.
    frame : of the calibration's result.
    terms : optional terms that it estimates.
    slope : (32, wanted) derivatives of the parameters, clock and table by their unknowns, of scale factors relative.
    links : what the gyros carry over all turns of a section, by its first hold, once it has been asked for.
    """

    task: JointAdjustment
    frame: str
    terms: frozenset[str]
    slope: Square
    links: dict[int, Link] = field(default_factory=dict[int, Link])

    @cached_property
    def whole(self) -> Eliminated:
        """The equations of everything."""
        return linearise(self.task)[0]

    def information(self) -> JointInformation:
        """Return what it determines."""
        return self._named(self.whole.matrix)

    def sections(self) -> list[JointInformation]:
        """Return what each section determines by itself."""
        return [self._named(inner.matrix) for _, inner in self.whole.within]

    def changed(
        self,
        taking_part: dict[str, np.ndarray] | None = None,
        data: Observed | None = None,
        without: int | None = None,
    ) -> JointInformation:
        """Return what it determines if something is otherwise.

        Parameters
        ----------
        taking_part : which holds and turns do; everything by default.
        data : the same motion with other noise of its holds; the problem's own by default.
        without : the hold after which a rotation is left out.
        """
        part = taking_part or self.task.taking_part
        task = replace(self.task, taking_part=part, data=data or self.task.data)
        recording = RecordingStretch(task)
        parts = zip(recording.within, self.whole.within, task.sections, strict=True)
        for (_, stretch), (_, whole), section in parts:
            assert isinstance(stretch, SectionStretch)
            # Rotations, which are most of the work, say what they said.
            stretch.within = [(p, inner) for p, inner in whole.within if p.node + section.first != without]
            # What keeps a step finite is no knowledge.
            stretch.equations = [e for e in stretch.equations if e.kind != "loose"]
            for turns in stretch.equations:
                if isinstance(turns, Turn):
                    turns.given = self.links.get(section.first) or turns.integrated(task)
                    self.links[section.first] = turns.given
            if without is not None and section.first <= without < section.last - 1:
                # Across the gap the heading is not carried: the rest of the section has one of its own.
                stretch.equations.append(Heading(without + 1 - section.first, UNKNOWN_HEADING))
        return self._named(Chain.of(recording, task, task.unknowns.free.size).eliminated().matrix)

    def _named(self, normal: Square) -> JointInformation:
        """In names, with everything eliminated that is neither a parameter nor shared by all tests."""
        u, prior = self.task.unknowns, self.task.prior
        wanted, whole = _wanted(), u.expanded(normal)
        rest = np.setdiff1d(u.free, wanted)
        if rest.size and prior is not None:
            beside = whole[np.ix_(rest, wanted)]
            own = whole[np.ix_(rest, rest)] + prior.precision[np.ix_(rest, rest)]
            whole[np.ix_(wanted, wanted)] -= beside.T @ np.linalg.solve(own, beside)
        back = inverted(self.slope)
        return JointInformation(_symmetric(back.T @ whole[np.ix_(wanted, wanted)] @ back))

    def stated(self, known: JointInformation, gravity: Series) -> Square:
        """Return the covariance of all unknowns as a calibration states it, biases that wander among its causes.

        Parameters
        ----------
        known : beside the test's own.
        gravity : (unknowns,) by how much they are off by one sigma of gravity.
        """
        wanted, values = _wanted(), self.task.unknowns.values
        precision = np.zeros((values.size, values.size))
        precision[np.ix_(wanted, wanted)] = self.slope.T @ known.matrix @ self.slope
        prior = together(self.task.prior, Prior(values.copy(), precision))
        assert prior is not None
        task, free = replace(self.task, prior=prior), self.task.unknowns.free
        cofactor = invert_normal_matrix(self.whole.matrix + prior.precision[np.ix_(free, free)])
        settled = Settled(task.state, task.unknowns, self.whole, cofactor, 0.0, 0, 0)
        own = settled.cofactor + recording_influences(task, settled).shared
        return task.unknowns.expanded(own) + np.outer(gravity, gravity)


def _wanted() -> np.ndarray:
    return np.concatenate([FREE, LAYOUT.indices(*COMMON)])


def _raw_units(u: Unknowns) -> Series:
    """(unknowns,) how many raw units each is of, of sensors that count: about one in SI."""
    sizes = u.at(np.ones(LAYOUT.size))
    for names, size in (
        (("force.bias", "force.scale"), np.mean(u["force.scale"])),
        (("gyro.matrix", "gyro.bias", "gyro.g_sensitivity"), np.trace(gyro_matrix(u)) / 3.0),
    ):
        for name in names:
            sizes[name][:] = abs(float(size))
    return sizes.values


def _slope(u: Unknowns) -> Square:
    """(32, wanted) of `PlannedProblem`. By logarithms of scale factors: a clock moves all of them alike."""
    sizes = _raw_units(u)
    made = np.asarray(jacobian(_EVALUATE, u.values / sizes), dtype=np.float64) / sizes
    scale = PARAMETER_GROUPS["gyro scale"]
    made[scale] /= 1.0 + np.real(_EVALUATE(u.values / sizes))[scale, None]
    zero = np.zeros((PARAMETERS, len(COMMON)))
    return np.asarray(np.block([[made[:, FREE], zero], [zero.T, np.eye(len(COMMON))]]), dtype=np.float64)


def spread_of_sizes(u: Unknowns, sizes: Series) -> Square:
    """Return the covariance of all unknowns of which nothing but sizes of parameters is known, and any name plate.

    Parameters
    ----------
    u : which are free.
    sizes : (30,) of `parameter_sizes`.
    """
    plate = np.zeros(LAYOUT.size)
    plate[np.setdiff1d(u.free, FREE)] = name_plate(u)[np.setdiff1d(u.free, FREE)]
    made = np.diag(plate**2)
    back = inverted(_slope(u))[:PARAMETERS, :PARAMETERS]
    made[np.ix_(FREE, FREE)] = (back * sizes**2) @ back.T
    return made


def planned_problem(
    session: Session, *, g_sensitivity: bool, start: Unknowns | None = None, settle: bool = True
) -> PlannedProblem:
    """Return the equations that a calibration of a session begins with.

    Parameters
    ----------
    session : of a planned motion, or of a recording.
    g_sensitivity : whether it is estimated.
    start : sensors to start from; None finds them, and refuses what tells nothing of them.
    settle : take one step, which finds whether the gyros see north.
    """
    record = find_procedure("joint" if session.protocol is None else session.protocol.procedure)
    begun = begin(session, record, clocked=False, start=start)
    task, gyro = begun.task, begun.offered.has_gyro
    terms = [*record.seeks, *(["g_sensitivity"] if g_sensitivity and gyro else [])]
    alike = {name: sigma for name, sigma in session.alike.items() if gyro and sigma > 0.0}
    free = np.union1d(unknowns_with(begun.plain, terms), LAYOUT.indices(*alike))
    task.unknowns = task.unknowns.with_free(free)
    priors = terms_prior(task.unknowns), LAYOUT.sparse_prior(task.unknowns.values, alike)
    task.prior = together(together(task.prior, priors[0]), priors[1])
    # No smaller than what counts as none: a stiffer hold leaves weak directions to round-off.
    task.noise = Noise({"sway": still_sway(task)})
    if settle:
        before = task.copy()
        settled = solve(task, once=True)
        if "clock" in alike and task.prior is not None and session.options.data_sheet is None:
            (clock,) = task.unknowns.places(["clock"])
            if np.sqrt(settled.cofactor[clock, clock]) >= CLOCK_TOLD * alike["clock"]:
                # A calibration adds such a clock afterwards: three name plates do not tell it.
                at = LAYOUT.indices("gyro.matrix")
                task.prior.precision[at, at] *= NO_PLATE
                task = before
                solve(task, once=True)
    return PlannedProblem(task, record.frame, frozenset(terms), _slope(task.unknowns))


def observed_problem(session: Session, noise: PlannedNoise, *, g_sensitivity: bool) -> PlannedProblem:
    """Return the equations of a recording, with biases that wander as those of such units do: holds hardly show it.

    A calibration finds it by what its turns do not explain; and the steps that may come next are judged with it.

    Parameters
    ----------
    session : what was recorded.
    noise : of such units.
    g_sensitivity : whether they have one.
    """
    problem = planned_problem(session, g_sensitivity=g_sensitivity, start=_nominal(session), settle=False)
    base, scales = problem.task.data.base, _raw_units(problem.task.unknowns)
    dwell = float(np.median(base.hold_samples)) * base.step
    changed: dict[str, np.ndarray] = {}
    for name, triad, size in (
        ("force", noise.accelerometer, scales[LAYOUT["force.bias"]]),
        ("rate", noise.gyroscope, scales[LAYOUT["gyro.bias"]]),
    ):
        floor = getattr(base, f"{name}_floor")
        more = np.maximum((size * wander_sigma(triad, dwell, SESSION)) ** 2 - floor, 0.0)
        changed[f"{name}_floor"] = floor + more
        changed[f"{name}_covariance"] = getattr(base, f"{name}_covariance") + np.diag(more)
    problem.task.data = _with_noise(problem.task.data, **changed)
    return problem


def exact_sensors() -> Unknowns:
    """Return sensors without errors, in SI."""
    return imu_unknowns(unknowns_of(ImuModel.ideal()))


def _nominal(session: Session) -> Unknowns | None:
    """Sensors as their units say, with the gyros' biases at rest; None of counts."""
    recording, u = session.recording, exact_sensors()
    factors = (
        specific_force_factor(recording.specific_force_unit),
        angular_rate_factor(recording.angular_rate_unit),
    )
    if recording.specific_force is None or factors[0] is None:
        return None
    u["force.scale"][:] /= factors[0]
    if session.means.angular_rate is not None:
        if factors[1] is None:
            return None
        u["gyro.matrix"][:] /= factors[1]
        u["gyro.bias"][:] = np.median(session.means.angular_rate, axis=0)
    return u


def with_longer_hold(data: Observed, hold: int, factor: float) -> Observed:
    """Return the same observations with one hold that lasts so many times as long, as far as its noise goes.

    Parameters
    ----------
    data, hold, factor : which hold of what, and how many times.
    """
    base, count = data.base, data.base.hold_samples.astype(float)
    count[hold] *= factor
    changed: dict[str, np.ndarray] = {"hold_samples": count}
    for name, floor in (("force_covariance", base.force_floor), ("rate_covariance", base.rate_floor)):
        changed[name] = getattr(base, name).copy()
        changed[name][hold] = (changed[name][hold] - np.diag(floor)) / factor + np.diag(floor)
    return _with_noise(data, **changed)


def _with_noise(data: Observed, **changed: np.ndarray) -> Observed:
    """The same motion with other noise of its holds."""
    made = observe(replace(data.base, **changed), exact_sensors(), [*data.rotations.values()], data.parts)
    return replace(made, poses=data.poses)


def parameters_of(
    force: Complex, force_bias: Complex, gyro: Complex, gyro_bias: Complex, g_sensitivity: Complex
) -> Complex:
    """Return the thirty parameters of matrices and biases, analytically, for complex steps.

    Parameters
    ----------
    force, force_bias : (3, 3) lower triangular, (3,) of the accelerometers.
    gyro, gyro_bias, g_sensitivity : (3, 3), (3,) and (3, 3) of the gyros.
    """
    scale, angles = shin_from_matrix(force)
    unknowns = np.zeros(LAYOUT.size, dtype=complex)
    for name, values in (
        ("force.bias", force_bias),
        ("force.scale", scale),
        ("force.angle", angles),
        ("gyro.matrix", gyro.ravel()),
        ("gyro.bias", gyro_bias),
        ("gyro.g_sensitivity", g_sensitivity.ravel()),
    ):
        unknowns[LAYOUT[name]] = values
    return _EVALUATE(unknowns)
