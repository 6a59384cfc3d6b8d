"""The joint estimator's equations: holds, turns and rotations of all sections, solved for everything at once.

Gauss-Newton on attitudes and shared unknowns. Each section is a chain of attitudes with a border (its Earth
rate and what all share); chains are eliminated, the Earth rate of each section too, and what is left are the
normal equations of the shared unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import Matrices, Series, Square, Table, Vectors, inverted
from tumble.attitude.rotations import matrices_from_rotation_vectors, matrix_from_rotation_vector
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.calibration.joint.data import JointData
from tumble.calibration.joint.poses import align_with_poses, pose_terms, sees_heading
from tumble.calibration.joint.spins import LEAST_WOBBLE, SpinEquations, SpinState, spin_equations, start_spin
from tumble.calibration.joint.terms import (
    HEAD,
    NODE,
    TAIL,
    Carried,
    Extra,
    Section,
    Terms,
    attitudes_from_force,
    carry,
    hold_terms,
    selected,
    turn_terms,
)
from tumble.calibration.joint.unknowns import FORCE
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError
from tumble.estimation import Prior
from tumble.estimation.bordered import BorderedChain, EliminatedChain, NodeCovariance, whiten
from tumble.estimation.gauss_helmert import invert_normal_matrix

# The heading of a section is nobody's business; this fixes it.
HEADING_SIGMA = 1e-4  # rad
# Of a latitude that is given to a hundredth of a degree; near a pole or the equator one component of the Earth rate
# would be all but exact.
LATITUDE_SIGMA = 1e-4  # rad
LEAST_SHARE = 0.1
ITERATIONS = 100
DIVERGED = "The joint adjustment diverged: its unknowns left all bounds."
# What holds the attitudes of a hold whose force is left out, where nothing else does.
LOOSE_SIGMA = 0.1  # rad
# Factor on the variance of an observation that is left out.
LEFT_OUT = 1e10
# A thousandth of a sigma: the step itself is still taken, and the next would be a millionth.
TOLERANCE = 1e-3
# Below this share of its size the horizontal Earth rate's own sigma lets its known size help: the square of it,
# halved, is what the direction's error takes off the length.
SEES_NORTH = 0.03


@dataclass(slots=True)
class JointState:
    """Where all unknowns are.

    Attributes
    ----------
    unknowns : (33,) shared, or more of them (`joint_wide`).
    sections : attitudes and Earth rate of each run of holds.
    spins : of each rotation, by the hold before it.
    """

    unknowns: Series
    sections: list[Section]
    spins: dict[int, SpinState]


@dataclass(slots=True)
class Masks:
    """Which observations take part.

    Attributes
    ----------
    force, rate, turn, pose : (holds,) of bool.
    spin : by the hold before; absent means that it takes part.
    """

    force: np.ndarray
    rate: np.ndarray
    turn: np.ndarray
    pose: np.ndarray

    @staticmethod
    def everything(holds: int) -> Masks:
        """Return masks that leave nothing out."""
        return Masks(*(np.ones(holds, bool) for _ in range(4)))

    def copy(self) -> Masks:
        """Return masks of their own."""
        return Masks(self.force.copy(), self.rate.copy(), self.turn.copy(), self.pose.copy())

    def of(self, terms: Terms) -> np.ndarray:
        """Return which of the terms take part."""
        if terms.kind == "rest":
            return np.ones(terms.place.size, dtype=bool)
        # The swing is the gyros', as the rate is: without one neither counts.
        of_kind = {"force": self.force, "rate": self.rate, "swing": self.rate, "turn": self.turn}
        mask = of_kind.get(terms.kind, self.pose)
        return mask[terms.place]


@dataclass(slots=True)
class SectionEquations:
    """A section's equations at one state, eliminated."""

    section: Section
    terms: list[Terms]
    spins: dict[int, SpinEquations]
    chain: EliminatedChain
    earth_inverse: Square
    square_sum: float
    observations: int


@dataclass(slots=True)
class JointSolution:
    """A settled estimate.

    Attributes
    ----------
    state : all unknowns.
    free : indices of the shared unknowns that were adjusted.
    cofactor : (free, free), their covariance if the noise given is the true one.
    square_sum, redundancy : of all residuals, and of what is left to check them.
    equations : of each section at the solution.
    extra : the variances that it was made with.
    iterations : how many it took.
    """

    state: JointState
    free: np.ndarray
    cofactor: Square
    square_sum: float
    redundancy: int
    equations: list[SectionEquations]
    extra: Extra
    iterations: int

    def covariance(self, index: int) -> tuple[NodeCovariance, Square]:
        """Return the covariances of a section's attitudes, and of its border (Earth rate, shared unknowns)."""
        equations = self.equations[index]
        corner = equations.chain.corner
        size = self.state.unknowns.size
        full = np.zeros((size, size))
        full[np.ix_(self.free, self.free)] = self.cofactor
        border = np.zeros((3 + size, 3 + size))
        gain = -equations.earth_inverse @ corner[:3, 3:]
        border[3:, 3:] = full
        border[:3, 3:] = gain @ full
        border[3:, :3] = border[:3, 3:].T
        border[:3, :3] = equations.earth_inverse + gain @ full @ gain.T
        return equations.chain.covariance(border), border


@dataclass(slots=True)
class JointProblem:
    """What does not change from one iteration to the next.

    Attributes
    ----------
    data, site : observations, gravity and latitude.
    free : indices of the shared unknowns to adjust.
    extra : variances.
    masks : which observations take part.
    prior : of the shared unknowns (all of them), or None.
    spin_noise : factor on the variance of each rotation's windows, by the hold before it.
    wobble : rad, one sigma of each rotation's axis, by the hold before it.
    """

    data: JointData
    site: Site
    free: np.ndarray
    extra: Extra
    masks: Masks
    prior: Prior | None = None
    spin_noise: dict[int, float] = field(default_factory=dict[int, float])
    wobble: dict[int, float] = field(default_factory=dict[int, float])


def start_state(data: JointData, unknowns: Series, site: Site) -> JointState:
    """Return attitudes from gravity in each hold, with headings that the gyros carry.

    Parameters
    ----------
    data : observations.
    unknowns : (33,) start values.
    site : for the Earth rate.
    """
    carried = carry(data, unknowns)
    triad = triad_from_unknowns(unknowns[FORCE])
    level = attitudes_from_force(triad.correct(data.parts.reshape(-1, 3))).reshape(-1, 3, 3, 3)
    earth = np.zeros(3)
    if site.latitude is not None:
        earth[2] = -EARTH_RATE * np.sin(site.latitude)
    state = JointState(unknowns.astype(float).copy(), [], {})
    for first, last in data.sections:
        C = level[first:last].copy()
        section = Section(int(first), int(last), C, earth.copy())
        for k in range(first, last):
            here = C[k - first]
            here[1], here[2] = _same_heading(here[1], here[0]), _same_heading(here[2], here[0])
            if k + 1 == last:
                continue
            if k in data.spins:
                state.spins[k] = start_spin(data, data.spins[k], here[2], unknowns, earth)
                carried_on = _carried_end(data, k, state.spins[k], unknowns)
            else:
                carried_on = here[2] @ carried.C_se[k]
            C[k + 1 - first, 0] = _same_heading(C[k + 1 - first, 0], carried_on)
        state.sections.append(section)
    if data.poses is not None:
        align_with_poses(data.poses, state.sections, state.spins, state.unknowns)
    return state


def _carried_end(data: JointData, k: int, spin: SpinState, unknowns: Series) -> Square:
    from tumble.calibration.joint.terms import integrate_ranges

    last = np.array([data.spins[k].centres[-1]])
    C_se, _, _ = integrate_ranges(data, unknowns, last, np.array([data.base.head[k + 1, 0] + 1]))
    return np.asarray(spin.C_wb[-1] @ C_se[0], dtype=np.float64)


def _same_heading(level: Square, carried: Square) -> Square:
    """Turn `level` about the vertical until it is as near to `carried` as it can be."""
    across = carried @ level.T
    heading = np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1])
    return np.asarray(matrix_from_rotation_vector(np.array([0.0, 0.0, heading])) @ level, dtype=np.float64)


def solve_joint(problem: JointProblem, state: JointState, *, once: bool = False) -> JointSolution:
    """Adjust everything from `state` (which is moved) until nothing moves.

    Parameters
    ----------
    problem : observations and what is believed.
    state : start values; holds the solution afterwards.
    once : take one step and no more.

    Raises
    ------
    ObservabilityError
        If shared unknowns are not determined.
    ConvergenceError
        If it diverges or does not settle.
    """
    free, before = problem.free, np.inf
    for iteration in range(1, ITERATIONS + 1):
        try:
            with np.errstate(divide="ignore", invalid="ignore"):
                equations, normal, gradient = linearise_joint(problem, state)
            cofactor = invert_normal_matrix(normal)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(DIVERGED) from error
        step = -cofactor @ gradient
        if not np.all(np.isfinite(step)):
            raise ConvergenceError(DIVERGED)
        _move(problem, state, equations, step)
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(cofactor))))
        _look_north(problem, state, equations, cofactor)
        settled = bool(np.all(np.abs(step) <= 1e-13 * np.maximum(np.abs(state.unknowns[free]), 1.0)))
        if once or size <= TOLERANCE or settled or (size < 1e-2 and size >= before):
            return _solution(problem, state, equations, cofactor, step, iteration)
        before = size
    raise ConvergenceError(f"The joint adjustment did not settle within {ITERATIONS} iterations.")


def linearise_joint(
    problem: JointProblem, state: JointState
) -> tuple[list[SectionEquations], Square, Series]:
    """Return the sections' equations, and the normal matrix and gradient of the free shared unknowns.

    Parameters
    ----------
    problem, state : observations, and where all unknowns are.
    """
    carried = carry(problem.data, state.unknowns)
    size = state.unknowns.size
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    equations: list[SectionEquations] = []
    for section in state.sections:
        made = _section_equations(problem, state, section, carried)
        corner, right = made.chain.corner, made.chain.corner_gradient
        gain = made.earth_inverse @ corner[:3, 3:]
        normal += corner[3:, 3:] - corner[3:, :3] @ gain
        gradient += right[3:] - gain.T @ right[:3]
        equations.append(made)
    if problem.prior is not None:
        normal += problem.prior.precision
        gradient += problem.prior.precision @ (state.unknowns - problem.prior.mean)
    free = problem.free
    return equations, normal[np.ix_(free, free)], gradient[free]


@dataclass(slots=True)
class SectionChain:
    """A section's equations at one state, before anything is eliminated."""

    chain: BorderedChain
    terms: list[Terms]
    spins: dict[int, SpinEquations]
    square_sum: float
    observations: int


def section_chain(
    problem: JointProblem, state: JointState, section: Section, carried: Carried, *, of_motion: bool = True
) -> SectionChain:
    """Return a section's equations at a state.

    Parameters
    ----------
    problem, state, section : observations, and where the unknowns are.
    carried : the gyros' integrals at the state.
    of_motion : with what is known of the motion itself: that holds rest, the site's Earth rate, a heading. Of several
        units that move together it counts once.
    """
    data, gravity = problem.data, problem.site.gravity
    terms = hold_terms(data, section, state.unknowns, gravity, problem.extra)
    turns = turn_terms(data, section, carried, state.unknowns, problem.extra)
    if turns is not None:
        terms.append(turns)
    if data.poses is not None:
        terms += pose_terms(data.poses, section, state.unknowns, problem.extra)
    made = SectionChain(
        BorderedChain.zero(section.last - section.first, NODE, 3 + state.unknowns.size), [], {}, 0.0, 0
    )
    for kind in terms:
        if of_motion or kind.kind != "rest":
            _add_terms(made, kind, problem.masks.of(kind))
    for k in section.holds[:-1]:
        if int(k) in data.spins:
            spin = _add_spin(problem, state, section, made.chain, int(k))
            made.spins[int(k)] = spin
            made.square_sum += spin.square_sum
            made.observations += spin.observations
    if not of_motion:
        return made
    if not sees_heading(data.poses, section):
        _add_heading(made.chain)
    _hold_loosely(made.chain, ~problem.masks.force[section.holds])
    made.square_sum += _add_earth(problem, section, made.chain)
    return made


def _add_terms(made: SectionChain, kind: Terms, active: np.ndarray) -> None:
    # Left out is made all but worthless, not taken away: a chain without a link would have no heading.
    covariance = np.where(active, 1.0, LEFT_OUT)[:, None, None] * kind.covariance
    by_next = np.zeros_like(kind.by_node) if kind.by_next is None else kind.by_next
    residual, by_node, by_next, by_border = whiten(
        covariance, kind.residual[..., None], kind.by_node, by_next, kind.by_border
    )
    if kind.by_next is None:
        made.chain.add_unary(kind.node, residual[..., 0], by_node, by_border)
    else:
        made.chain.add_links(kind.node, residual[..., 0], by_node, by_next, by_border)
    taken = selected(kind, active)
    headings = np.count_nonzero(~active) if kind.kind == "turn" else 0
    made.square_sum += float(np.sum(residual[active] ** 2))
    made.observations += taken.residual.size + int(headings)
    made.terms.append(taken)


def _section_equations(
    problem: JointProblem, state: JointState, section: Section, carried: Carried
) -> SectionEquations:
    made = section_chain(problem, state, section, carried)
    eliminated = made.chain.eliminated()
    return SectionEquations(
        section,
        made.terms,
        made.spins,
        eliminated,
        inverted(eliminated.corner[:3, :3]),
        made.square_sum,
        made.observations,
    )


def _add_spin(
    problem: JointProblem, state: JointState, section: Section, chain: BorderedChain, k: int
) -> SpinEquations:
    node = k - section.first
    made = spin_equations(
        problem.data,
        problem.data.spins[k],
        state.spins[k],
        (section.C_wb[node, 2], section.C_wb[node + 1, 0]),
        section.earth_w,
        state.unknowns,
        problem.site.gravity,
        problem.extra,
        problem.spin_noise.get(k, 1.0),
        problem.wobble.get(k, LEAST_WOBBLE),
    )
    start, end, rest = slice(0, 3), slice(3, 6), slice(6, None)
    chain.diagonal[node, TAIL, TAIL] += made.corner[start, start]
    chain.diagonal[node + 1, HEAD, HEAD] += made.corner[end, end]
    chain.lower[node, HEAD, TAIL] += made.corner[end, start]
    chain.border[node, TAIL] += made.corner[start, rest]
    chain.border[node + 1, HEAD] += made.corner[end, rest]
    chain.gradient[node, TAIL] += made.gradient[start]
    chain.gradient[node + 1, HEAD] += made.gradient[end]
    chain.corner += made.corner[rest, rest]
    chain.corner_gradient += made.gradient[rest]
    return made


def _hold_loosely(chain: BorderedChain, gone: np.ndarray) -> None:
    """Keep the steps of holds whose force is left out finite, where nothing else tells their attitude."""
    chain.diagonal[gone] += np.eye(NODE) / LOOSE_SIGMA**2


def _add_heading(chain: BorderedChain) -> None:
    chain.diagonal[0, 2, 2] += 1.0 / HEADING_SIGMA**2


def _add_earth(problem: JointProblem, section: Section, chain: BorderedChain) -> float:
    """Add what the site tells of the Earth rate in the level frame; return its square sum."""
    residual, by_earth = earth_terms(problem.site, section)
    chain.corner[:3, :3] += by_earth.T @ by_earth
    chain.corner_gradient[:3] += by_earth.T @ residual
    return float(residual @ residual)


def earth_terms(site: Site, section: Section) -> tuple[Series, Table]:
    """Return what the site tells of a section's Earth rate: (m,) whitened residuals, (m, 3) their derivatives.

    Parameters
    ----------
    site : with or without a latitude.
    section : its Earth rate, and whether its gyros see north.
    """
    mean, sigma = earth_prior(site)
    residual, by_earth = (section.earth_w - mean) / sigma, np.diag(1.0 / sigma)
    if site.latitude is None or not section.sees_north:
        return residual, by_earth
    # Its direction is the gyros' to tell; its length the latitude does.
    across = section.earth_w[:2]
    length, known = float(np.linalg.norm(across)), _known_to(np.sin(site.latitude))
    short = (length - EARTH_RATE * float(np.cos(site.latitude))) / known
    along = np.array([[across[0], across[1], 0.0]]) / (length * known)
    return np.append(residual, short), np.concatenate([by_earth, along])


def _look_north(
    problem: JointProblem, state: JointState, equations: list[SectionEquations], cofactor: Square
) -> None:
    """Note the sections whose gyros know the horizontal Earth rate well enough for its length to help."""
    if problem.site.latitude is None:
        return
    known = EARTH_RATE * float(np.cos(problem.site.latitude))
    full = np.zeros((state.unknowns.size, state.unknowns.size))
    full[np.ix_(problem.free, problem.free)] = cofactor
    for made in equations:
        gain = -made.earth_inverse @ made.chain.corner[:3, 3:]
        covariance = (made.earth_inverse + gain @ full @ gain.T)[:2, :2]
        seen = float(np.linalg.norm(made.section.earth_w[:2]))
        spread = float(np.sqrt(np.trace(covariance)))
        made.section.sees_north = spread < SEES_NORTH * known and abs(seen - known) < known / 2.0


def earth_prior(site: Site) -> tuple[Series, Series]:
    """Return mean and standard deviation (3,) rad/s of the Earth rate in a level frame of any heading."""
    latitude = site.latitude
    if latitude is None:
        mean, sigma = np.zeros(3), np.full(3, EARTH_RATE / np.sqrt(3.0))
    else:
        across = EARTH_RATE * max(float(np.cos(latitude)), 1e-3) / np.sqrt(2.0)
        mean = np.array([0.0, 0.0, -EARTH_RATE * np.sin(latitude)])
        sigma = np.array([across, across, _known_to(np.cos(latitude))])
    return mean, sigma


def _known_to(share: float) -> float:
    """Return the sigma, rad/s, of a component of the Earth rate that a latitude moves by a share of its error."""
    return LATITUDE_SIGMA * EARTH_RATE * max(abs(float(share)), LEAST_SHARE)


def _move(problem: JointProblem, state: JointState, equations: list[SectionEquations], step: Series) -> None:
    """Move all unknowns by a step of the shared ones, and the residuals with them."""
    full = np.zeros(state.unknowns.size)
    full[problem.free] = step
    for made in equations:
        corner, right = made.chain.corner, made.chain.corner_gradient
        earth = -made.earth_inverse @ (right[:3] + corner[:3, 3:] @ full)
        border = np.concatenate([earth, full])
        nodes = made.chain.steps(border)
        section = made.section
        for k, spin in made.spins.items():
            node = k - section.first
            ends = np.concatenate([nodes[node, TAIL], nodes[node + 1, HEAD]])
            windows, own = spin.steps(np.concatenate([ends, border]))
            state.spins[k].move(windows, own)
        for terms in made.terms:
            terms.residual[...] += np.einsum("tmd,td->tm", terms.by_node, nodes[terms.node])
            if terms.by_next is not None:
                terms.residual[...] += np.einsum("tmd,td->tm", terms.by_next, nodes[terms.node + 1])
            terms.residual[...] += terms.by_border @ border
        shape = section.C_wb.shape
        turned = _turned(section.C_wb.reshape(-1, 3, 3), nodes.reshape(-1, 3))
        section.C_wb = turned.reshape(shape)
        section.earth_w = section.earth_w + earth
    state.unknowns = state.unknowns + full


def _turned(C: Matrices, steps: Vectors) -> Matrices:
    return matrices_from_rotation_vectors(steps) @ C


def _solution(
    problem: JointProblem,
    state: JointState,
    equations: list[SectionEquations],
    cofactor: Square,
    step: Series,
    iterations: int,
) -> JointSolution:
    full = np.zeros(state.unknowns.size)
    full[problem.free] = step
    decrease = 0.0
    for made in equations:
        corner, right = made.chain.corner, made.chain.corner_gradient
        earth = -made.earth_inverse @ (right[:3] + corner[:3, 3:] @ full)
        decrease += made.chain.decrease(np.concatenate([earth, full]))
    nodes = sum(NODE * (s.last - s.first) for s in state.sections)
    # A section's heading and Earth rate are each known as many times as they are unknown.
    headings = sum(not sees_heading(problem.data.poses, s) for s in state.sections)
    observations = sum(e.observations for e in equations) + headings
    redundancy = observations - nodes - problem.free.size
    if problem.prior is not None:
        redundancy += problem.prior.rank
    return JointSolution(
        state,
        problem.free,
        cofactor,
        sum(e.square_sum for e in equations) - decrease,
        redundancy,
        equations,
        problem.extra,
        iterations,
    )
