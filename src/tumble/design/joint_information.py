"""What a planned test tells of both triads: the joint estimator's information, in the parameters' own names.

The information matrix is that of the estimator itself, linearised where the sensors are exact: every attitude, the
Earth rate and whatever belongs to one rotation is eliminated, as in a calibration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.canonical import named_parameters
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, SCALE
from tumble.calibration.joint.data import JointData
from tumble.calibration.joint.influence import Influences, joint_influences
from tumble.calibration.joint.noise import still_sway
from tumble.calibration.joint.procedure import PLAIN, unknowns_of
from tumble.calibration.joint.spins import SpinEquations, spin_equations
from tumble.calibration.joint.system import (
    HEADING_SIGMA,
    LEFT_OUT,
    JointProblem,
    JointState,
    Masks,
    earth_terms,
    solve_joint,
    start_state,
)
from tumble.calibration.joint.terms import (
    HEAD,
    NODE,
    TAIL,
    Carried,
    Extra,
    Section,
    carry,
    hold_terms,
    turn_terms,
)
from tumble.calibration.joint.unknowns import G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX, SHARED
from tumble.earth import Site
from tumble.estimation import Prior
from tumble.estimation.bordered import BorderedChain, whiten
from tumble.estimation.weak_directions import WeakDirection, find_weak_directions
from tumble.sensor import ImuModel
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.propagation import jacobian
from tumble.simulation import Grade

Complex = npt.NDArray[Any]

FREE = np.sort(np.concatenate([PLAIN, np.arange(G_SENSITIVITY.start, G_SENSITIVITY.stop)]))
"""The shared unknowns that a plan looks at: both triads and g-sensitivity."""
_TERMS = frozenset({"g_sensitivity"})
LABELS, _EVALUATE = named_parameters(terms=_TERMS, gyro="full", units=("m/s²", "rad/s"), factors=(1.0, 1.0))
NAMES = tuple(name for name, _ in LABELS)
"""Of the thirty parameters, in the order of every matrix here."""
UNITS = tuple(unit for _, unit in LABELS)
GROUPS: dict[str, slice] = {
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
WITHOUT_G = np.arange(21)
# A parameter is told when the test leaves less than this of what the data sheet leaves open.
TOLD = 0.9
# Of what is not told at all: so many times the data sheet's spread.
IGNORANCE = 1e2
# No data sheet states that a gyro feels no gravity at all, 0.01 (°/s)/g.
# rad: nothing is known of a heading that nobody carries on, and the equations stay regular.
UNKNOWN_HEADING = 1e3
_LEAST_G_SENSITIVITY = 0.01 * np.pi / 180.0 / 9.80665


def parameter_sizes(grade: Grade) -> Series:
    """Return (30,) one sigma by which units of a grade differ, of each parameter, SI.

    Parameters
    ----------
    grade : whose spreads the data sheet states.
    """
    force, gyro = grade.accelerometer, grade.gyroscope
    apart = float(np.hypot(force.misalignment, gyro.misalignment))
    threes = (
        force.bias,
        force.scale_factor,
        np.sqrt(2.0) * force.misalignment,
        gyro.bias,
        gyro.scale_factor,
        np.sqrt(2.0) * gyro.misalignment,
        apart,
    )
    least = max(grade.g_sensitivity, _LEAST_G_SENSITIVITY)
    sizes = np.concatenate([np.repeat(threes, 3), np.full(9, least)])
    return np.maximum(sizes, 1e-12)


def open_spreads(sizes: Series, *, sheet: bool) -> Series:
    """Return (30,) by how much each parameter is open before anything is observed.

    Parameters
    ----------
    sizes : (30,) of `parameter_sizes`.
    sheet : believe them.
    """
    return sizes * (1.0 if sheet else IGNORANCE)


@dataclass(frozen=True, slots=True)
class JointInformation:
    """What is known of the thirty parameters.

    Attributes
    ----------
    matrix : (30, 30) in the parameters' SI units.
    """

    matrix: Square

    def plus(self, other: JointInformation) -> JointInformation:
        """Return what both tell together."""
        return JointInformation(self.matrix + other.matrix)

    def covariance(self, sizes: Series, *, g_sensitivity: bool, sheet: bool = False) -> Square:
        """Return (30, 30), finite throughout: what is not told is open by a hundred times its spread.

        Parameters
        ----------
        sizes : (30,) of `parameter_sizes`.
        g_sensitivity : whether it is estimated; if not, it is taken to be nothing and has no covariance.
        sheet : believe the data sheet's spreads beforehand.
        """
        at = np.arange(PARAMETERS) if g_sensitivity else WITHOUT_G
        open_by = open_spreads(sizes, sheet=sheet)[at]
        scaled = _symmetric(self.matrix[np.ix_(at, at)] * np.outer(open_by, open_by))
        # By eigenvalues, of which round-off may have made those of nothing a little negative.
        values, vectors = np.linalg.eigh(scaled)
        inverse = (vectors / (np.maximum(values, 0.0) + 1.0)) @ vectors.T
        made = np.zeros((PARAMETERS, PARAMETERS))
        made[np.ix_(at, at)] = inverse * np.outer(open_by, open_by)
        return made

    def weak_directions(self, sizes: Series, *, g_sensitivity: bool) -> list[WeakDirection]:
        """Return the combinations that are told no better than the data sheet does, in those sizes, worst first.

        Parameters
        ----------
        sizes, g_sensitivity : as for `covariance`.
        """
        at = np.arange(PARAMETERS) if g_sensitivity else WITHOUT_G
        found = find_weak_directions(_symmetric(self.matrix[np.ix_(at, at)]), sizes[at], TOLD)
        return [replace(weak, direction=np.resize(_padded(weak.direction), PARAMETERS)) for weak in found]


def _padded(direction: Series) -> Series:
    made = np.zeros(PARAMETERS)
    made[: direction.size] = direction
    return made


def _symmetric(matrix: Square) -> Square:
    return np.ascontiguousarray(0.5 * (matrix + matrix.T), dtype=np.float64)


@dataclass(slots=True)
class PlannedProblem:
    """A planned test at its true state: linearised again and again with other masks or noise.

    Attributes
    ----------
    problem, state : of the joint estimator, at the truth.
    spins : what each rotation tells, by the hold before it, once it has been asked for.
    """

    problem: JointProblem
    state: JointState
    spins: dict[int, SpinEquations] = field(default_factory=dict[int, SpinEquations])

    def information(
        self, masks: Masks | None = None, data: JointData | None = None, without: int | None = None
    ) -> JointInformation:
        """Return what it tells.

        Parameters
        ----------
        masks : which holds and turns take part; everything by default.
        data : the same motion with other noise of its holds; the problem's own by default.
        without : the hold after which a rotation is left out.

        Notes
        -----
        The normal matrix of `linearise_joint`; a rotation, which is most of the work, is eliminated once.
        """
        problem = replace(self.problem, masks=masks or self.problem.masks, data=data or self.problem.data)
        carried = carry(problem.data, self.state.unknowns)
        size = self.state.unknowns.size
        normal = np.zeros((size, size))
        for section in self.state.sections:
            corner = self._chain(problem, section, carried, without).eliminated().corner
            gain = inverted(np.ascontiguousarray(corner[:3, :3])) @ corner[:3, 3:]
            normal += corner[3:, 3:] - corner[3:, :3] @ gain
        return JointInformation(information_in_names(normal[np.ix_(FREE, FREE)], self.state.unknowns))

    def influences(self, known: Square, *, g_sensitivity: bool) -> Influences:
        """Return what each observation does to the unknowns, the wander that neighbours share in their covariance.

        Parameters
        ----------
        known : (30, 30) information of the parameters beside the test's own, that leaves none of them open.
        g_sensitivity : whether it is estimated.
        """
        slope = inverted(_back(self.state.unknowns))
        precision = np.zeros((self.state.unknowns.size, self.state.unknowns.size))
        precision[np.ix_(FREE, FREE)] = slope.T @ known @ slope
        prior = Prior(self.state.unknowns.copy(), precision)
        free = FREE if g_sensitivity else PLAIN
        return joint_influences(replace(self.problem, free=free, prior=prior), self.state)

    def in_names(self, covariance: Table) -> Square:
        """Return the covariance (30, 30) of the parameters of that of the shared unknowns.

        Parameters
        ----------
        covariance : (33, 33).
        """
        slope = inverted(_back(self.state.unknowns))
        return _symmetric(slope @ covariance[np.ix_(FREE, FREE)] @ slope.T)

    def _chain(
        self, problem: JointProblem, section: Section, carried: Carried, without: int | None
    ) -> BorderedChain:
        data, unknowns = problem.data, self.state.unknowns
        chain = BorderedChain.zero(section.last - section.first, NODE, 3 + unknowns.size)
        terms = hold_terms(data, section, unknowns, problem.site.gravity, problem.extra)
        turns = turn_terms(data, section, carried, unknowns, problem.extra)
        for kind in terms if turns is None else [*terms, turns]:
            by_next = np.zeros_like(kind.by_node) if kind.by_next is None else kind.by_next
            covariance = np.where(problem.masks.of(kind), 1.0, LEFT_OUT)[:, None, None] * kind.covariance
            residual, by_node, by_next, by_border = whiten(
                covariance, kind.residual[..., None], kind.by_node, by_next, kind.by_border
            )
            if kind.by_next is None:
                chain.add_unary(kind.node, residual[..., 0], by_node, by_border)
            else:
                chain.add_links(kind.node, residual[..., 0], by_node, by_next, by_border)
        for k in section.holds[:-1].tolist():
            if k in data.spins and k != without:
                _add_rotation(chain, k - section.first, self._rotation(problem, section, k))
        chain.diagonal[0, 2, 2] += 1.0 / HEADING_SIGMA**2
        if without is not None and section.first <= without < section.last - 1:
            # Across the gap the heading is not carried: the rest of the section has one of its own.
            chain.diagonal[without + 1 - section.first, 2, 2] += 1.0 / UNKNOWN_HEADING**2
        _, by_earth = earth_terms(problem.site, section)
        chain.corner[:3, :3] += by_earth.T @ by_earth
        return chain

    def _rotation(self, problem: JointProblem, section: Section, k: int) -> SpinEquations:
        if k not in self.spins:
            node = k - section.first
            self.spins[k] = spin_equations(
                self.problem.data,
                self.problem.data.spins[k],
                self.state.spins[k],
                (section.C_wb[node, 2], section.C_wb[node + 1, 0]),
                section.earth_w,
                self.state.unknowns,
                problem.site.gravity,
                problem.extra,
            )
        return self.spins[k]


def _add_rotation(chain: BorderedChain, node: int, made: SpinEquations) -> None:
    """Join what a rotation tells to the holds before and after it."""
    start, end, rest = slice(0, 3), slice(3, 6), slice(6, None)
    chain.diagonal[node, TAIL, TAIL] += made.corner[start, start]
    chain.diagonal[node + 1, HEAD, HEAD] += made.corner[end, end]
    chain.lower[node, HEAD, TAIL] += made.corner[end, start]
    chain.border[node, TAIL] += made.corner[start, rest]
    chain.border[node + 1, HEAD] += made.corner[end, rest]
    chain.corner += made.corner[rest, rest]


def information_in_names(normal: Square, unknowns: Series) -> Square:
    """Return information (free, free) of the free unknowns as that of the thirty parameters.

    Parameters
    ----------
    normal, unknowns : of the joint estimator, with all of `FREE` free.
    """
    back = _back(unknowns)
    return _symmetric(np.asarray(back.T @ normal @ back, dtype=np.float64))


def _back(unknowns: Series) -> Square:
    """(free, 30) derivatives of the free unknowns by the named parameters."""
    full = np.zeros(36)
    full[:SHARED] = unknowns
    slope = np.asarray(jacobian(_EVALUATE, full), dtype=np.float64)[:, FREE]
    return inverted(np.ascontiguousarray(slope))


def planned_problem(
    data: JointData, site: Site, sizes: Series, unknowns: Series | None = None
) -> PlannedProblem:
    """Return a planned test's equations where all unknowns are true.

    Parameters
    ----------
    data : of `planned_data`, or of a recording.
    site : gravity and latitude.
    sizes : (30,) of `parameter_sizes`, that keep the adjustment in bounds where the test does not tell.
    unknowns : (33,) where to linearise; exact sensors by default.
    """
    at = unknowns_of(ImuModel.ideal()) if unknowns is None else unknowns
    prior = Prior(at.copy(), np.diag(_precision(sizes)))
    problem = JointProblem(data, site, FREE, Extra(), Masks.everything(data.holds), prior)
    state = start_state(data, at, site)
    # No smaller than what counts as none: a stiffer hold leaves weak directions to round-off.
    problem.extra.sway = still_sway(problem, state)
    # One step finds whether the gyros see north; attitudes are where they belong already.
    solve_joint(problem, state, once=True)
    state.unknowns = at.copy()
    return PlannedProblem(replace(problem, prior=None), state)


def _precision(sizes: Series) -> Series:
    made = np.zeros(SHARED)
    made[BIAS], made[SCALE], made[ANGLE] = sizes[0:3], sizes[3:6], sizes[6:9]
    gyro = np.full((3, 3), float(np.hypot(sizes[15], sizes[18])))
    gyro[np.diag_indices(3)] = sizes[12:15]
    made[GYRO_MATRIX], made[GYRO_BIAS], made[G_SENSITIVITY] = gyro.ravel(), sizes[9:12], sizes[21:30]
    return np.where(made > 0.0, 1.0 / np.where(made > 0.0, made, 1.0) ** 2, 1.0)


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
    unknowns = np.zeros(36, dtype=complex)
    unknowns[BIAS], unknowns[SCALE], unknowns[ANGLE] = force_bias, scale, angles
    unknowns[GYRO_MATRIX], unknowns[GYRO_BIAS] = gyro.ravel(), gyro_bias
    unknowns[G_SENSITIVITY] = g_sensitivity.ravel()
    return _EVALUATE(unknowns)
