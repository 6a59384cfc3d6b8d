"""The residuals of holds and of the turns between them, as the joint estimator adds them up.

Attitudes are those of b against a level frame w of each section: down is its third axis, and its heading is
the first hold's own. The Earth rate in w is three unknowns of the section with a prior from the latitude. An
attitude error is a rotation vector in w: ``C_true = (1 + [phi]) C``.

Each hold is a node of three attitudes, at its head, in its middle and at its tail, and gives

- the specific force in three parts, raw, one at each;
- the mean rate, raw: the Earth rate, and what the pose sways from head to tail;
- the swing, raw: where the gyros see the middle between them;
- that it rests: head, middle and tail differ by a sway of stated size.

Each turn gives one rotation: the gyro's integral carries the tail of one hold to the head of the next, while
the level frame turns with the Earth.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors, inverted
from tumble.attitude import integrate_turns
from tumble.attitude.rotations import matrices_from_rotation_vectors, rotation_vectors_from_matrices
from tumble.calibration.equations.triad_unknowns import BIAS
from tumble.calibration.joint.data import JointData
from tumble.calibration.joint.unknowns import (
    FORCE,
    G_SENSITIVITY,
    GYRO_BIAS,
    GYRO_MATRIX,
    RATE_ASYMMETRY,
    RATE_QUADRATIC,
    SHARED,
    force_matrix,
    gyro_matrix,
    raw_force,
    raw_rate,
    without_asymmetry,
)

HEAD, MIDDLE, TAIL = slice(0, 3), slice(3, 6), slice(6, 9)
"""Where a hold's three attitudes stand in its node."""
NODE = 9
EARTH = slice(0, 3)
"""Where the Earth rate stands in the border; the shared unknowns follow."""
BORDER = 3 + SHARED
LEAST_SWING = 1e-12
"""rad²: a microrad of tilt is a microgee, and better gyros would leave a pose's heading to round-off."""


@dataclass(slots=True)
class Extra:
    """Variances beyond what is seen at rest.

    Attributes
    ----------
    force : (m/s²)², by which an accelerometer's bias wanders from hold to hold.
    rate : (rad/s)², the same of the gyros.
    turn : rad² about each axis, what else a turn shows.
    sway : rad² about each axis, by which a pose changes from head to middle and from there to the tail.
    placement : rad² about each axis, by which believed poses scatter beyond their own sigma.
    restless : hold -> how many times the sway's variance it has, of holds that sway more than the others.
    """

    force: float = 0.0
    rate: float = 0.0
    turn: float = 0.0
    sway: float = 1e-16
    placement: float = 0.0
    restless: dict[int, float] = field(default_factory=dict[int, float])

    def sways(self, holds: np.ndarray) -> Series:
        """Return (holds,) rad², the sway's variance of each hold."""
        return self.sway * np.array([self.restless.get(k, 1.0) for k in holds.tolist()])


@dataclass(frozen=True, slots=True)
class Terms:
    """Residuals of one kind, each of one hold or of two neighbouring ones.

    Attributes
    ----------
    kind : "force", "rate", "swing", "rest", "turn", "tilt" or "pose".
    place : (terms,) the hold that it belongs to, or that the turn follows.
    node : (terms,) the same, counted within the section.
    residual : (terms, m) predicted minus observed.
    covariance : (terms, m, m).
    by_node, by_next : (terms, m, 9) by the hold's attitudes in w, and by the next one's; the latter None for what
        a hold shows by itself.
    by_border : (terms, m, 36) by the Earth rate and the shared unknowns.
    """

    kind: str
    place: np.ndarray
    node: np.ndarray
    residual: AnyArray
    covariance: AnyArray
    by_node: AnyArray
    by_next: AnyArray | None
    by_border: AnyArray


@dataclass(slots=True)
class Section:
    """The state of one unbroken run of holds.

    Attributes
    ----------
    first, last : half-open range of holds.
    C_wb : (holds, 3, 3, 3) attitudes at the head, in the middle and at the tail of each hold.
    earth_w : (3,) rad/s.
    sees_north : whether its horizontal part is known well enough for its known length to help.
    """

    first: int
    last: int
    C_wb: AnyArray
    earth_w: Vector
    sees_north: bool = False

    @property
    def holds(self) -> np.ndarray:
        """Indices of its holds."""
        return np.arange(self.first, self.last)


@dataclass(frozen=True, slots=True)
class Carried:
    """The gyro's integrals over the turns of a recording, once an iteration.

    Attributes
    ----------
    C_se : (holds, 3, 3) from the head of the next hold to the tail of this one; zeros where no turn follows.
    sums : (holds, 3, 3, 7) see `integrate_turns`.
    duration : (holds,) s.
    magnitudes : (holds, 3, 3, 3) the same sums of each gyro's own |input|; None where nobody asks for asymmetry.
    """

    C_se: Matrices
    sums: AnyArray
    duration: Series
    magnitudes: AnyArray | None = None

    def link(self, k: np.ndarray) -> Link:
        """Return the links after holds `k`."""
        of_k = None if self.magnitudes is None else self.magnitudes[k]
        return Link(self.C_se[k], self.sums[k], self.duration[k], of_k)


def carry(data: JointData, unknowns: Series) -> Carried:
    """Integrate the gyros over every usable turn with the unknowns as they are.

    Parameters
    ----------
    data : holds and turns.
    unknowns : (33,).
    """
    turns = data.turns
    carried = Carried(np.zeros((data.holds, 3, 3)), np.zeros((data.holds, 3, 3, 7)), np.zeros(data.holds))
    if not turns.size:
        return carried
    start, stop = data.base.turn_start[turns], data.base.turn_stop[turns]
    made = integrate_ranges(data, unknowns, start, stop)
    carried.C_se[turns], carried.sums[turns], carried.duration[turns] = made
    seen = integrate_magnitudes(data, unknowns, start, stop)
    if seen is None:
        return carried
    magnitudes = np.zeros((data.holds, *seen.shape[1:]))
    magnitudes[turns] = seen
    return replace(carried, magnitudes=magnitudes)


def integrate_ranges(
    data: JointData, unknowns: Series, starts: np.ndarray, stops: np.ndarray
) -> tuple[Matrices, AnyArray, Series]:
    """Return rotation, sums and duration of sample ranges, see `integrate_turns`."""
    base, span = data.base, _span(starts, stops)
    made = integrate_turns(
        base.time[span],
        without_asymmetry(unknowns, base.raw_rate[span]),
        base.raw_force[span],
        starts - span.start,
        stops - span.start,
        gyro_inverse=inverted(gyro_matrix(unknowns)),
        gyro_bias=unknowns[GYRO_BIAS],
        force_inverse=inverted(force_matrix(unknowns)),
        force_bias=unknowns[FORCE][BIAS],
        g_sensitivity=unknowns[G_SENSITIVITY].reshape(3, 3),
    )
    return made.C_start_end, made.sums, made.duration


def integrate_magnitudes(
    data: JointData, unknowns: Series, starts: np.ndarray, stops: np.ndarray
) -> AnyArray | None:
    """Return (ranges, 3, 3, 3) the integral of the rotation to the start times each gyro's own |input|.

    None where the unknowns have no asymmetry. With a table's rotations (ranges, 3, 3, 6): times its square, too.

    Parameters
    ----------
    data, unknowns, starts, stops : as for `integrate_ranges`.
    """
    if unknowns.size < RATE_ASYMMETRY.stop:
        return None
    span = _span(starts, stops)
    rate = without_asymmetry(unknowns, data.base.raw_rate[span])

    def summed(inputs: Vectors) -> AnyArray:
        made = integrate_turns(
            data.base.time[span],
            rate,
            inputs,
            starts - span.start,
            stops - span.start,
            gyro_inverse=inverted(gyro_matrix(unknowns)),
            gyro_bias=unknowns[GYRO_BIAS],
            force_inverse=np.eye(3),
            force_bias=np.zeros(3),
            g_sensitivity=np.zeros((3, 3)),
        )
        return made.sums[..., 4:7]

    own = rate - unknowns[GYRO_BIAS]
    if not data.spins or unknowns.size < RATE_QUADRATIC.stop:
        return summed(np.abs(own))
    return np.concatenate([summed(np.abs(own)), summed(own**2)], axis=-1)


def _span(starts: np.ndarray, stops: np.ndarray) -> slice:
    """The samples from the first range to the last: one rotation of a table is a small part of its recording."""
    return slice(int(starts.min()), int(stops.max()))


def hold_terms(
    data: JointData, section: Section, unknowns: Series, gravity: float, extra: Extra
) -> list[Terms]:
    """Return the residuals of a section's holds: force, rate, swing and rest.

    Parameters
    ----------
    data, section, unknowns : observations and state.
    gravity : m/s².
    extra : variances.
    """
    k = section.holds
    node = k - section.first
    force = _force_terms(data, section, unknowns, gravity, extra, node)
    rate = _rate_terms(data, section, unknowns, gravity, extra, node)
    swing = _swing_terms(data, section, unknowns, node)
    return [force, rate, swing, _rest_terms(section, extra, node, 3 + unknowns.size)]


def _rest_terms(section: Section, extra: Extra, node: np.ndarray, border: int) -> Terms:
    """From head to middle, and from middle to tail."""
    backward = np.swapaxes(section.C_wb, 2, 3)
    residual, by_node = np.zeros((node.size, 6)), np.zeros((node.size, 6, NODE))
    for step in range(2):
        at, here, there = (
            slice(3 * step, 3 * step + 3),
            slice(3 * step, 3 * step + 3),
            slice(3 * step + 3, 3 * step + 6),
        )
        residual[:, at] = _swayed(section.C_wb[:, step], section.C_wb[:, step + 1])
        by_node[:, at, here], by_node[:, at, there] = -backward[:, step], backward[:, step]
    covariance = extra.sways(section.holds)[:, None, None] * np.eye(6)
    return Terms(
        "rest", section.holds, node, residual, covariance, by_node, None, np.zeros((node.size, 6, border))
    )


def _swing_terms(data: JointData, section: Section, unknowns: Series, node: np.ndarray) -> Terms:
    """Where the gyros see the middle between head and tail."""
    k, swings = section.holds, data.swings
    share, backward = swings.share[k, None], np.swapaxes(section.C_wb[:, 0], 1, 2)
    whole = _swayed(section.C_wb[:, 0], section.C_wb[:, 2])
    swung = _swayed(section.C_wb[:, 0], section.C_wb[:, 1]) - share * whole
    matrix = gyro_matrix(unknowns)
    turns = matrix @ backward
    by_node = np.zeros((k.size, 3, NODE))
    by_node[:, :, MIDDLE] = turns
    by_node[:, :, TAIL] = -share[:, :, None] * turns
    by_node[:, :, HEAD] = (share[:, :, None] - 1.0) * turns
    # Of milliradians, a gyro's scale factor takes nothing that counts.
    by_border = np.zeros((k.size, 3, 3 + unknowns.size))
    residual = swung @ matrix.T - swings.value[k]
    covariance = swings.covariance[k] + LEAST_SWING * (matrix @ matrix.T)
    return Terms("swing", k, node, residual, covariance, by_node, None, by_border)


def _swayed(before: Matrices, after: Matrices) -> Vectors:
    return rotation_vectors_from_matrices(np.swapaxes(before, 1, 2) @ after)


def _force_terms(
    data: JointData, section: Section, unknowns: Series, gravity: float, extra: Extra, node: np.ndarray
) -> Terms:
    k, up = section.holds, np.array([0.0, 0.0, -gravity])
    backward = np.swapaxes(section.C_wb, 2, 3)
    residual, by_node = np.zeros((k.size, 9)), np.zeros((k.size, 9, NODE))
    by_border = np.zeros((k.size, 9, 3 + unknowns.size))
    for part, at in enumerate((HEAD, MIDDLE, TAIL)):
        shown = raw_force(unknowns, backward[:, part] @ up)
        residual[:, at] = shown.value - data.parts[k, part]
        by_node[:, at, at] = shown.by_true @ backward[:, part] @ _cross_matrix(up)
        by_border[:, at, 3:] = shown.by_unknowns
    matrix = force_matrix(unknowns)
    wander = np.tile(extra.force * (matrix @ matrix.T), (3, 3))
    return Terms("force", k, node, residual, data.parts_covariance[k] + wander, by_node, None, by_border)


def _rate_terms(
    data: JointData, section: Section, unknowns: Series, gravity: float, extra: Extra, node: np.ndarray
) -> Terms:
    k, up = section.holds, np.array([0.0, 0.0, -gravity])
    backward = np.swapaxes(section.C_wb[:, 0], 1, 2)
    length = np.maximum(data.length[k], 1e-9)[:, None]
    swayed = _swayed(section.C_wb[:, 0], section.C_wb[:, 2])
    shown = raw_rate(unknowns, backward @ section.earth_w + swayed / length, backward @ up)
    matrix, sensitivity = gyro_matrix(unknowns), unknowns[G_SENSITIVITY].reshape(3, 3)
    by_sway = (matrix @ backward) / length[:, :, None]
    by_node = np.zeros((k.size, 3, NODE))
    by_node[:, :, HEAD] = matrix @ backward @ _cross_matrix(section.earth_w) - by_sway
    by_node[:, :, HEAD] += sensitivity @ backward @ _cross_matrix(up)
    by_node[:, :, TAIL] = by_sway
    by_border = np.zeros((k.size, 3, 3 + unknowns.size))
    by_border[:, :, EARTH] = matrix @ backward
    by_border[:, :, 3:] = shown.by_unknowns
    covariance = data.base.rate_covariance[k] + extra.rate * (matrix @ matrix.T)
    return Terms("rate", k, node, shown.value - data.base.rate_mean[k], covariance, by_node, None, by_border)


def turn_terms(
    data: JointData, section: Section, carried: Carried, unknowns: Series, extra: Extra
) -> Terms | None:
    """Return the residuals of a section's hand turns: what the gyros carry, against the attitudes; None without.

    A table's rotations are left to `joint_spins`.

    Parameters
    ----------
    data, section, carried, unknowns, extra : observations, state and variances.
    """
    k = np.array([h for h in section.holds[:-1] if h not in data.spins], dtype=int)
    if not k.size:
        return None
    node = k - section.first
    tail, head = section.C_wb[node, 2], section.C_wb[node + 1, 0]
    link = carried.link(k)
    residual, by_tail, by_head, by_border = link_residuals(tail, head, section.earth_w, link, unknowns)
    by_node, by_next = np.zeros((k.size, 3, NODE)), np.zeros((k.size, 3, NODE))
    by_node[:, :, TAIL], by_next[:, :, HEAD] = by_tail, by_head
    edge = _edge_seconds(data, k)
    covariance = link_covariance(data, tail, link, unknowns, edge, own_bias=True)
    wander = extra.turn + extra.rate * carried.duration[k] ** 2
    covariance = covariance + wander[:, None, None] * np.eye(3)
    return Terms("turn", k, node, residual, covariance, by_node, by_next, by_border)


@dataclass(frozen=True, slots=True)
class Link:
    """Integrals of the gyros from one node to the next, see `Carried`."""

    C_se: Matrices
    sums: AnyArray
    duration: Series
    magnitudes: AnyArray | None = None


def link_residuals(
    C_start: Matrices, C_end: Matrices, earth_w: Vector, link: Link, unknowns: Series
) -> tuple[Vectors, AnyArray, AnyArray, AnyArray]:
    """Return residuals (rad, in w) and their derivatives by start, end and border.

    Parameters
    ----------
    C_start, C_end : (links, 3, 3) attitudes of the nodes.
    earth_w : (3,) rad/s.
    link : what the gyros carry.
    unknowns : (33,).

    Notes
    -----
    ``r = log(exp(-[earth T]) C_start C_se C_end')``; a rate error ``E x(t)`` turns C_se by
    ``sums[..., j] E[:, j]`` in the start frame.
    """
    count = len(C_start)
    earth = matrices_from_rotation_vectors(-link.duration[:, None] * earth_w)
    residual = rotation_vectors_from_matrices(earth @ C_start @ link.C_se @ np.swapaxes(C_end, 1, 2))
    inverse = inverted(gyro_matrix(unknowns))
    outer = earth @ C_start
    moves = np.einsum("tab,tbcj,ci->taij", outer, link.sums, inverse)
    by_border = np.zeros((count, 3, 3 + unknowns.size))
    by_border[:, :, EARTH] = -link.duration[:, None, None] * np.eye(3)
    at = 3 + np.arange(unknowns.size)
    by_border[:, :, at[GYRO_MATRIX]] = -moves[..., 0:3].reshape(count, 3, 9)
    by_border[:, :, at[GYRO_BIAS]] = -moves[..., 3]
    by_border[:, :, at[G_SENSITIVITY]] = -moves[..., 4:7].reshape(count, 3, 9)
    if link.magnitudes is not None:
        for place, sums in zip((RATE_ASYMMETRY, RATE_QUADRATIC), _triples(link.magnitudes), strict=False):
            by_border[:, :, at[place]] = -np.einsum("tab,tbcj,cj->taj", outer, sums, inverse)
    return residual, earth, np.broadcast_to(-np.eye(3), (count, 3, 3)), by_border


def _triples(magnitudes: AnyArray) -> list[AnyArray]:
    """Of |input|, and of its square where that is there."""
    return np.split(magnitudes, magnitudes.shape[-1] // 3, axis=-1)


def link_covariance(
    data: JointData, C_start: Matrices, link: Link, unknowns: Series, more: Series, *, own_bias: bool
) -> Matrices:
    """Return (links, 3, 3) rad² in w: angle random walk, and the bias's own wandering over the link.

    Parameters
    ----------
    data : noise of the gyros.
    C_start, link, unknowns : as for `link_residuals`.
    more : (links,) s for which the random walk acts beyond the link itself.
    own_bias : let the bias wander by the floor seen between holds, each link for itself.
    """
    inverse = inverted(gyro_matrix(unknowns))
    white = (inverse * data.base.rate_random_walk) @ inverse.T
    floor = (inverse * data.base.rate_floor) @ inverse.T
    C_middle = 0.5 * (C_start + C_start @ link.C_se)
    # the mean of both ends' axes, and what of the variance their difference leaves over
    own = C_middle @ white @ np.swapaxes(C_middle, 1, 2)
    lost = np.trace(white) - np.trace(own, axis1=1, axis2=2)
    own = own + (lost / 3.0)[:, None, None] * np.eye(3)
    covariance = (link.duration + more)[:, None, None] * own
    if own_bias:
        covariance = covariance + (link.duration**2)[:, None, None] * (np.trace(floor) / 3.0 * np.eye(3))
    return covariance


def _edge_seconds(data: JointData, k: np.ndarray) -> Series:
    """Return for how long the random walk acts between the parts' means and the edges, s: a third of each."""
    base = data.base
    step = (base.time[-1] - base.time[0]) / max(base.time.shape[0] - 1, 1)
    tail = (base.tail[k, 1] - base.tail[k, 0]) * step
    head = (base.head[k + 1, 1] - base.head[k + 1, 0]) * step
    return (tail + head) / 3.0


def _cross_matrix(v: Vector) -> Matrix:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def selected(terms: Terms, where: np.ndarray) -> Terms:
    """Return the terms at `where` (bool or indices) only."""
    return Terms(
        terms.kind,
        terms.place[where],
        terms.node[where],
        terms.residual[where],
        terms.covariance[where],
        terms.by_node[where],
        None if terms.by_next is None else terms.by_next[where],
        terms.by_border[where],
    )


def attitudes_from_force(force_b: Vectors) -> Matrices:
    """Return (rows, 3, 3) level attitudes C_wb of any heading from specific forces in b."""
    down = -force_b / np.linalg.norm(force_b, axis=1, keepdims=True)
    first = np.eye(3)[np.argmin(np.abs(down), axis=1)]
    north = first - np.sum(first * down, axis=1, keepdims=True) * down
    north /= np.linalg.norm(north, axis=1, keepdims=True)
    east = np.asarray(np.cross(down, north), dtype=np.float64)
    return np.stack([north, east, down], axis=1)
