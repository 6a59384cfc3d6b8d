"""What each observation of the joint estimator does to the shared unknowns, told apart by source of error.

At the solution the estimate is linear in the errors of the observations: ``dx = N^-1 J' e`` with whitened
errors e. Attitudes, Earth rates, windows of rotations and lever arms stand in N too, so that the gain of a
term is ``Cov[shared, what the term depends on] J'``, and the covariance is the sum of ``G G'`` over all terms.
A term whose covariance has several causes is split among them: ``G (L^-1 S L^-T) G'`` for each part S of
``L L'``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import AnyArray, Series, Square, inverted
from tumble.calibration.equations.triad_unknowns import BIAS
from tumble.calibration.joint.data import JointData
from tumble.calibration.joint.neighbours import Drift, shared_wander
from tumble.calibration.joint.poses import pose_terms, sees_heading
from tumble.calibration.joint.spins import (
    LEAST_WOBBLE,
    Layout,
    SpinEquations,
    add_spin_terms,
    link_ranges,
    wander_variances,
)
from tumble.calibration.joint.system import (
    HEADING_SIGMA,
    LEFT_OUT,
    JointProblem,
    JointSolution,
    JointState,
    SectionEquations,
    earth_terms,
    linearise_joint,
)
from tumble.calibration.joint.terms import (
    EARTH,
    HEAD,
    NODE,
    TAIL,
    Carried,
    Section,
    Terms,
    carry,
    hold_terms,
    turn_terms,
)
from tumble.calibration.joint.unknowns import GYRO_BIAS, force_matrix, gyro_matrix
from tumble.calibration.joint.wander import faster_variance
from tumble.estimation.bordered import NodeCovariance
from tumble.estimation.gathered import GatheredTerms, GatheringChain
from tumble.estimation.gauss_helmert import invert_normal_matrix

FORCE_REST = "accelerometers at rest"
FORCE_TURNING = "accelerometers while turning"
FORCE_WANDER = "accelerometer biases wander"
RATE_REST = "gyros at rest"
RATE_TURNING = "gyros while turning"
RATE_WANDER = "gyro biases wander"
SWAY = "sway in holds"
TURNS = "turns beyond noise"
ANGLES = "table angles"
AXIS = "wobble of the table's axis"
PLACEMENT = "placement"
LEVER = "lever arms of rotations"
EARTH_RATE_KNOWN = "Earth rate and latitude"
PRIOR = "prior"
OUTLYING = "observations left out"
GRAVITY = "reference gravity"
OTHER = "everything else"
SOURCES = (
    *(FORCE_REST, FORCE_TURNING, FORCE_WANDER, RATE_REST, RATE_TURNING, RATE_WANDER, SWAY, TURNS, ANGLES),
    *(AXIS, PLACEMENT),
    *(LEVER, EARTH_RATE_KNOWN, PRIOR, OUTLYING, GRAVITY, OTHER),
)
"""Sources of error in the order in which a budget shows them."""
SHARED_ROWS = slice(3, None)


@dataclass(frozen=True, slots=True)
class Influence:
    """One kind of observations of one section or rotation.

    Attributes
    ----------
    kind : "force", "rate", "swing", "rest", "turn", "tilt", "pose", "windows", "links", "axis", "angle", "own",
        "heading", "earth" or "prior".
    place : (terms,) the hold, or the hold before; -1 where it is neither.
    active : (terms,) whether it takes part.
    gain : (terms, unknowns, m) by how much whitened errors move the shared unknowns.
    parts : source -> (terms, m, m), the whitened covariance that it causes; they add up to the identity.
    taken : (terms, m, m) whitened covariance of the adjusted observations; zeros for what is not tested.
    root : (terms, m, m) Cholesky factor of the covariance: raw errors are ``root @ whitened``.
    drifts : source -> how its terms show what the biases of a triad wander by.
    """

    kind: str
    place: np.ndarray
    active: np.ndarray
    gain: AnyArray
    parts: dict[str, AnyArray]
    taken: AnyArray
    root: AnyArray
    drifts: dict[str, Drift] = field(default_factory=dict[str, Drift])

    def share(self, source: str) -> Square:
        """Return (unknowns, unknowns) what a source adds to the covariance by these observations."""
        part = self.parts.get(source)
        if part is None:
            return np.zeros((self.gain.shape[1], self.gain.shape[1]))
        return np.einsum("tam,tmn,tbn->ab", self.gain, part, self.gain, optimize=True)


@dataclass(frozen=True, slots=True)
class Influences:
    """All of them, and the covariance (unknowns, unknowns) that their shares add up to.

    Attributes
    ----------
    each : the observations' own.
    covariance : of the shared unknowns.
    neighbours : source -> (unknowns, unknowns), by how much it differs from that of independent observations because
        the biases of neighbouring holds wander together; part of `covariance`.
    """

    each: list[Influence]
    covariance: Square
    neighbours: dict[str, Square] = field(default_factory=dict[str, Square])

    @property
    def independent(self) -> Square:
        """Covariance (unknowns, unknowns) as it would be were each hold's wander its own."""
        return self.covariance - sum(self.neighbours.values(), np.zeros(self.covariance.shape))

    def shares(self) -> dict[str, Square]:
        """Return source -> (unknowns, unknowns) share of the covariance, for the `SOURCES` that there are."""
        made = {s: sum((i.share(s) for i in self.each if s in i.parts), np.zeros(())) for s in SOURCES}
        made = {
            s: share + self.neighbours.get(s, 0.0) if np.ndim(share) else share for s, share in made.items()
        }
        return {source: np.asarray(share) for source, share in made.items() if np.ndim(share) == 2}


def joint_influences(problem: JointProblem, state: JointState) -> Influences:
    """Return what each observation does to the shared unknowns at a settled state.

    Parameters
    ----------
    problem, state : observations with their variances, and the solution.

    Raises
    ------
    ObservabilityError
        If shared unknowns are not determined.
    """
    equations, normal, _ = linearise_joint(problem, state)
    cofactor = invert_normal_matrix(normal)
    solution = JointSolution(state, problem.free, cofactor, 0.0, 0, equations, problem.extra, 0)
    carried = carry(problem.data, state.unknowns)
    made: list[Influence] = []
    for index, section in enumerate(equations):
        nodes, border = solution.covariance(index)
        made += _holds_and_turns(problem, state, carried, section, nodes, border)
        for k, spin in section.spins.items():
            made += _rotation(problem, state, section, k, spin, nodes, border)
        made += _references(problem, section.section, nodes, border)
    covariance = np.zeros((state.unknowns.size, state.unknowns.size))
    covariance[np.ix_(problem.free, problem.free)] = cofactor
    if problem.prior is not None:
        values, vectors = np.linalg.eigh(problem.prior.precision)
        gain = (covariance @ vectors) * np.sqrt(np.maximum(values, 0.0))
        made.append(_of_one("prior", PRIOR, gain))
    neighbours = _neighbours(problem.data, made)
    return Influences(made, covariance + sum(neighbours.values(), np.zeros(())), neighbours)


def wander_factors(problem: JointProblem, state: JointState) -> Series:
    """Return (unknowns,) by how much wandering together changes each unknown's standard uncertainty.

    Parameters
    ----------
    problem, state : observations with their variances, and the solution.
    """
    influences = joint_influences(problem, state)
    told, independent = np.diag(influences.covariance), np.diag(influences.independent)
    known = independent > 0.0
    return np.sqrt(np.where(known, np.maximum(told, 0.0) / np.where(known, independent, 1.0), 1.0))


def _neighbours(data: JointData, told: list[Influence]) -> dict[str, Square]:
    """Return, by triad, what the covariance by its wandering biases is more than that of independent ones."""
    span = float(data.base.time[0]), float(data.base.time[-1])
    made: dict[str, Square] = {}
    for source, density in ((FORCE_WANDER, data.force_density), (RATE_WANDER, data.rate_density)):
        drifts = [(i.drifts[source], i.gain) for i in told if source in i.drifts]
        if drifts and np.any(density > 0.0):
            made[source] = shared_wander(drifts, density, span)
    return made


def _holds_and_turns(
    problem: JointProblem,
    state: JointState,
    carried: Carried,
    equations: SectionEquations,
    nodes: NodeCovariance,
    border: Square,
) -> list[Influence]:
    data, section = problem.data, equations.section
    terms = hold_terms(data, section, state.unknowns, problem.site.gravity, problem.extra)
    turns = turn_terms(data, section, carried, state.unknowns, problem.extra)
    terms += [] if turns is None else [turns]
    if data.poses is not None:
        terms += pose_terms(data.poses, section, state.unknowns, problem.extra)
    made: list[Influence] = []
    for kind in terms:
        active = problem.masks.of(kind)
        weighed = np.where(active, 1.0, LEFT_OUT)[:, None, None] * kind.covariance
        root = np.asarray(np.linalg.cholesky(weighed), dtype=np.float64)
        inverse = np.asarray(np.linalg.inv(root), dtype=np.float64)
        by_next = None if kind.by_next is None else inverse @ kind.by_next
        told = GatheredTerms(kind.kind, kind.node, inverse @ kind.by_node, by_next, inverse @ kind.by_border)
        causes = _causes(problem, state.unknowns, carried, kind)
        parts = {
            source: active[:, None, None] * (inverse @ part @ np.swapaxes(inverse, 1, 2))
            for source, part in causes.items()
        }
        if not np.all(active):
            parts[OUTLYING] = ~active[:, None, None] * np.eye(root.shape[1])
        gain, taken = told.gain(nodes, border, SHARED_ROWS), told.taken(nodes, border)
        drifts = _drifts_of_holds_or_turns(data, state.unknowns, carried, kind, inverse)
        made.append(Influence(kind.kind, kind.place, active, gain, parts, taken, root, drifts))
    return made


def _drifts_of_holds_or_turns(
    data: JointData, unknowns: Series, carried: Carried, kind: Terms, inverse: AnyArray
) -> dict[str, Drift]:
    base, k = data.base, kind.place
    if kind.kind == "turn":
        start, stop = base.time[base.turn_start[k]], base.time[base.turn_stop[k] - 1]
        gyro = inverted(gyro_matrix(unknowns))
        floor = float(np.trace((gyro * base.rate_floor) @ gyro.T)) / 3.0
        alone = (floor * carried.duration[k] ** 2)[:, None, None] * np.eye(3)
    else:
        start, stop = base.time[base.head[k, 0]], base.time[base.tail[k, 1] - 1]
        if kind.kind == "rate":
            alone = np.minimum(_rate_floors(data)[k], np.diag(base.rate_floor))
        elif kind.kind == "force":
            alone = np.tile(np.diag(base.force_floor), (k.size, 3, 3))
        else:
            return {}
    source, bias = (FORCE_WANDER, BIAS) if kind.kind == "force" else (RATE_WANDER, GYRO_BIAS)
    by_bias = (inverse @ kind.by_border)[:, :, 3 + bias.start : 3 + bias.stop]
    return {source: Drift(start, stop, by_bias, inverse @ alone @ np.swapaxes(inverse, 1, 2))}


def _causes(problem: JointProblem, unknowns: Series, carried: Carried, kind: Terms) -> dict[str, AnyArray]:
    """Return source -> (terms, m, m) covariances that add up to the terms' own: what wanders, and the rest."""
    data, extra, k = problem.data, problem.extra, kind.place
    if kind.kind == "rest":
        return {SWAY: kind.covariance}
    if kind.kind == "swing":
        return {RATE_REST: kind.covariance}
    if kind.kind in ("tilt", "pose"):
        return {PLACEMENT: kind.covariance}
    if kind.kind == "force":
        matrix = force_matrix(unknowns)
        wander = np.diag(data.base.force_floor) + extra.force * (matrix @ matrix.T)
        return _and_the_rest(kind, FORCE_REST, {FORCE_WANDER: np.tile(wander, (k.size, 3, 3))})
    if kind.kind == "rate":
        matrix = gyro_matrix(unknowns)
        wander = _rate_floors(data)[k] + extra.rate * (matrix @ matrix.T)
        return _and_the_rest(kind, RATE_REST, {RATE_WANDER: wander})
    inverse = inverted(gyro_matrix(unknowns))
    floor = float(np.trace((inverse * data.base.rate_floor) @ inverse.T)) / 3.0
    spread = (floor + extra.rate) * carried.duration[k] ** 2
    wander = spread[:, None, None] * np.eye(3)
    beyond = np.broadcast_to(extra.turn * np.eye(3), wander.shape)
    return _and_the_rest(kind, RATE_TURNING, {RATE_WANDER: wander, TURNS: beyond})


def _and_the_rest(kind: Terms, name: str, causes: dict[str, AnyArray]) -> dict[str, AnyArray]:
    rest = kind.covariance - sum(causes.values(), np.zeros(()))
    return {name: rest, **causes}


def _rate_floors(data: JointData) -> AnyArray:
    """Return (holds, 3, 3) of each hold's mean rate what white noise does not explain."""
    base = data.base
    step = (base.time[-1] - base.time[0]) / max(base.time.shape[0] - 1, 1)
    white = base.rate_random_walk / (base.hold_samples[:, None] * step)
    beyond = np.maximum(np.diagonal(base.rate_covariance, axis1=1, axis2=2) - white, 0.0)
    return beyond[:, :, None] * np.eye(3)


def _rotation(
    problem: JointProblem,
    state: JointState,
    equations: SectionEquations,
    k: int,
    made: SpinEquations,
    nodes: NodeCovariance,
    border: Square,
) -> list[Influence]:
    data, section = problem.data, equations.section
    spin, node = data.spins[k], k - section.first
    layout = Layout.of(spin, state.unknowns)
    outer = _ends_and_border(nodes, border, node)
    whole = np.zeros((layout.size, layout.size))
    own = np.arange(6, layout.shared)
    rest = np.concatenate([np.arange(6), np.arange(layout.shared, layout.size)])
    gain = -made.own_inverse @ made.own_gain
    whole[np.ix_(rest, rest)] = outer
    whole[np.ix_(own, rest)] = gain @ outer
    whole[np.ix_(rest, own)] = whole[np.ix_(own, rest)].T
    whole[np.ix_(own, own)] = made.own_inverse + gain @ outer @ gain.T
    chain = GatheringChain.of(3, layout.size)
    add_spin_terms(
        chain,
        data,
        spin,
        state.spins[k],
        (section.C_wb[node, 2], section.C_wb[node + 1, 0]),
        section.earth_w,
        state.unknowns,
        problem.site.gravity,
        problem.extra,
        problem.spin_noise.get(k, 1.0),
        problem.wobble.get(k, LEAST_WOBBLE),
    )
    windows = made.chain.covariance(whole)
    told: list[Influence] = []
    links = 0
    for terms in chain.terms:
        size, count = terms.by_border.shape[1], len(terms.by_border)
        moved = terms.gain(windows, whole, slice(layout.shared + 3, layout.size))
        taken = np.zeros((count, size, size))
        if terms.source == "angle":
            taken = terms.taken(windows, whole)
        root = np.broadcast_to(np.eye(size), taken.shape)
        if terms.source == "angle":
            root = np.full((1, 1, 1), max(spin.angle_sigma, 1e-9))
        parts = {
            source: np.broadcast_to(np.diag(rows), taken.shape)
            for source, rows in _rotation_causes(terms.source, size, layout).items()
        }
        drifts = _drifts_of_rotation(problem, state, k, terms, layout, links)
        links += count if terms.source == "links" else 0
        told.append(
            Influence(
                terms.source, np.full(count, k), np.ones(count, bool), moved, parts, taken, root, drifts
            )
        )
    return told


def _drifts_of_rotation(
    problem: JointProblem, state: JointState, k: int, terms: GatheredTerms, layout: Layout, links: int
) -> dict[str, Drift]:
    """`links` : how many links of the rotation came before."""
    data, spin, count = problem.data, problem.data.spins[k], len(terms.by_border)
    if terms.source == "own":
        return _drifts_of_own(problem, state, k, layout)
    if terms.source == "links":
        source, bias, density = RATE_WANDER, GYRO_BIAS, data.rate_density
        ranges = link_ranges(data, spin)[links : links + count]
    elif terms.source == "windows":
        source, bias, density, ranges = FORCE_WANDER, BIAS, data.force_density, spin.windows
    else:
        return {}
    first = layout.shared + 3 + bias.start
    by_bias = terms.by_border[:, :, first : first + 3]
    independent = (by_bias * (faster_variance(*spin.modes.shape) * density)) @ np.swapaxes(by_bias, 1, 2)
    start, stop = data.base.time[ranges[:, 0]], data.base.time[ranges[:, 1] - 1]
    return {source: Drift(start, stop, by_bias, independent)}


def _drifts_of_own(problem: JointProblem, state: JointState, k: int, layout: Layout) -> dict[str, Drift]:
    """The wanders over a rotation, as they are believed before anything is observed."""
    spin, extra = problem.data.spins[k], problem.extra
    variances = wander_variances(problem.data, spin, state.unknowns, extra)
    added = (
        extra.force * np.sum(force_matrix(state.unknowns) ** 2, axis=1),
        extra.rate * np.sum(gyro_matrix(state.unknowns) ** 2, axis=1),
    )
    made: dict[str, Drift] = {}
    for source, place, of_triad, more in zip(
        (FORCE_WANDER, RATE_WANDER), (layout.force(), layout.rate()), variances, added, strict=True
    ):
        share = np.ones_like(of_triad)
        share[0] = 1.0 - more / of_triad[0]
        rows = np.zeros(layout.own)
        rows[layout.inner(place)] = share.ravel()
        made[source] = Drift(np.zeros(1), np.zeros(1), np.zeros((1, layout.own, 3)), np.diag(rows)[None])
    return made


def _rotation_causes(source: str, size: int, layout: Layout) -> dict[str, Series]:
    """Return source -> (m,) 1 for the rows that it causes."""
    names = {"windows": FORCE_TURNING, "links": RATE_TURNING, "angle": ANGLES, "axis": AXIS}
    if source in names:
        return {names[source]: np.ones(size)}
    if source != "own":
        return {OTHER: np.ones(size)}
    rows = {name: np.zeros(size) for name in (LEVER, FORCE_WANDER, RATE_WANDER)}
    rows[LEVER][layout.inner(layout.lever())] = 1.0
    rows[FORCE_WANDER][layout.inner(layout.force())] = 1.0
    rows[RATE_WANDER][layout.inner(layout.rate())] = 1.0
    return rows


def _ends_and_border(nodes: NodeCovariance, border: Square, node: int) -> AnyArray:
    """Return the covariance of the tail of a hold, the head of the next one, and the section's border."""
    size = 6 + border.shape[0]
    made = np.zeros((size, size))
    start, end, rest = slice(0, 3), slice(3, 6), slice(6, size)
    made[start, start] = nodes.own[node][TAIL, TAIL]
    made[end, end] = nodes.own[node + 1][HEAD, HEAD]
    made[start, end] = nodes.following[node][TAIL, HEAD]
    made[end, start] = made[start, end].T
    made[start, rest] = nodes.with_border[node][TAIL]
    made[end, rest] = nodes.with_border[node + 1][HEAD]
    made[rest, :6] = made[:6, rest].T
    made[rest, rest] = border
    return made


def _references(
    problem: JointProblem, section: Section, nodes: NodeCovariance, border: Square
) -> list[Influence]:
    """What fixes a section's heading, and what the site tells of the Earth rate."""
    by_node = np.zeros((1, 1, NODE))
    by_node[0, 0, 2] = 1.0 / HEADING_SIGMA
    size = border.shape[0]
    heading = GatheredTerms("heading", np.array([0]), by_node, None, np.zeros((1, 1, size)))
    by_earth = earth_terms(problem.site, section)[1]
    by_border = np.zeros((1, len(by_earth), size))
    by_border[0, :, EARTH] = by_earth
    earth = GatheredTerms("earth", np.zeros(0, dtype=int), None, None, by_border)
    return [
        _of_one(terms.source, EARTH_RATE_KNOWN, terms.gain(nodes, border, SHARED_ROWS)[0])
        for terms in ((earth,) if sees_heading(problem.data.poses, section) else (heading, earth))
    ]


def _of_one(kind: str, source: str, gain: AnyArray) -> Influence:
    size = gain.shape[1]
    return Influence(
        kind,
        np.array([-1]),
        np.ones(1, dtype=bool),
        gain[None],
        {source: np.eye(size)[None]},
        np.zeros((1, size, size)),
        np.eye(size)[None],
    )
