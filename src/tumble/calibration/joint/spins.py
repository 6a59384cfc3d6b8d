"""What a table's rotation adds: the specific force as it turns, and the angle that its display tells.

While a table turns slowly, gravity goes round in the unit: window by window the accelerometers show it, turned
on by the gyros from each window to the next. The axis keeps its direction, in the unit and in the room: what
gyros across it show is bias and Earth rate. Each window has an attitude of its own, so that the gyros' random
walk is followed and not assumed away. What else acts belongs to the rotation: where the accelerometers are
off its axis (centripetal), and how both biases wander: a constant and cosines over the rotation, each with
the variance that 1/f noise gives it. Windows and these are eliminated; what is left joins the holds before
and after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Table, Vector, inverted
from tumble.attitude.rotations import (
    matrices_from_rotation_vectors,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    rotation_vectors_from_matrices,
    skew,
    skews,
    tangent_basis,
)
from tumble.calibration.equations.triad_unknowns import BIAS
from tumble.calibration.joint.data import JointData, JointSpin, mean_backward_rotation
from tumble.calibration.joint.table_terms import by_lever_arms, by_time_lag, size_effect
from tumble.calibration.joint.terms import (
    BORDER,
    Extra,
    Link,
    integrate_magnitudes,
    integrate_ranges,
    link_covariance,
    link_residuals,
)
from tumble.calibration.joint.unknowns import (
    FORCE,
    G_SENSITIVITY,
    GYRO_BIAS,
    force_matrix,
    gyro_matrix,
    raw_force,
    without_asymmetry,
)
from tumble.calibration.joint.wander import faster_variance
from tumble.calibration.joint.wide import LEVER_ARMS, TIME_LAG, is_wide, part_of
from tumble.estimation.bordered import BorderedChain, EliminatedChain, whiten

START, END = slice(0, 3), slice(3, 6)
# How far the accelerometers may be off the axis, one sigma.
LEVER_SIGMA = 1.0  # m
# A good table's axis wobbles by an arcsecond or so; more is found from the residuals.
LEAST_WOBBLE = 5e-6  # rad
# Two copies of one attitude agree to this, and an exact rate is one to a microradian over the whole.
SAME, LEAST_RATE_ANGLE = 1e-6, 1e-6  # rad


@dataclass(frozen=True, slots=True)
class Layout:
    """Where a rotation's own unknowns stand in its border, after start and end.

    First the lever arm (3), then how the axis leans in the unit and in the room (2 and 2), then what the
    accelerometers' biases wander (constant and modes, 3 each), then the gyros', then
    the first window's attitude once more where a rate is believed (3), then the shared border.
    """

    modes: int
    border: int = BORDER
    rated: bool = False

    @property
    def wander(self) -> int:
        """How many unknowns a triad's wander has."""
        return 3 * (1 + self.modes)

    @property
    def own(self) -> int:
        """How many unknowns are the rotation's own."""
        return 7 + 2 * self.wander + (3 if self.rated else 0)

    @property
    def size(self) -> int:
        """Of the whole border."""
        return 6 + self.own + self.border

    @property
    def shared(self) -> int:
        """Where the shared border begins."""
        return 6 + self.own

    def lever(self) -> slice:
        """Of the lever arm, in the border."""
        return slice(6, 9)

    def axis(self) -> slice:
        """Of the axis's leaning in the unit (2) and in the room (2), in the border."""
        return slice(9, 13)

    def force(self) -> slice:
        """Of the accelerometers' wander, in the border."""
        return slice(13, 13 + self.wander)

    def rate(self) -> slice:
        """Of the gyros' wander, in the border."""
        return slice(13 + self.wander, 13 + 2 * self.wander)

    def anchor(self) -> slice:
        """Of the first window's attitude, in the border; of nothing where no rate is believed."""
        return slice(13 + 2 * self.wander, self.shared)

    def inner(self, border: slice) -> slice:
        """The same place among the rotation's own unknowns."""
        return slice(border.start - 6, border.stop - 6)

    @staticmethod
    def of(spin: JointSpin, unknowns: Series | None = None) -> Layout:
        """Return the layout of a rotation whose border has the Earth rate and the unknowns (33 if not given)."""
        border = BORDER if unknowns is None else 3 + unknowns.size
        return Layout(spin.modes.shape[1], border, spin.turn_rate is not None)

    def bases(self, values: AnyArray) -> AnyArray:
        """Return (rows, 3, wander) what the constant and the modes (rows, modes) add to each axis."""
        shapes = np.concatenate([np.ones((len(values), 1)), values], axis=1)
        return np.einsum("tm,ab->tamb", shapes, np.eye(3)).reshape(len(values), 3, self.wander)


@dataclass(slots=True)
class SpinState:
    """Where a rotation's own unknowns are.

    Attributes
    ----------
    C_wb : (windows, 3, 3) attitudes at the windows' centres.
    axis_b, axis_w : (3,) unit vectors, the axis in the unit and in the room, along the turn.
    own : lever arm, axis, wander of the accelerometers and of the gyros, see `Layout`; the axis's place in it
        stays zero, for it is moved itself.
    anchor : (3, 3) the first window's attitude once more, where a rate is believed; else None.
    """

    C_wb: Matrices
    axis_b: Vector
    axis_w: Vector
    own: Series
    anchor: AnyArray | None = None

    def move(self, attitudes: Table, own: Series) -> None:
        """Move by steps of the windows' attitudes and of the own unknowns."""
        self.C_wb = matrices_from_rotation_vectors(attitudes) @ self.C_wb
        leaning_b, leaning_w = own[3:5], own[5:7]
        self.axis_b = _leaned(self.axis_b, leaning_b)
        self.axis_w = _leaned(self.axis_w, leaning_w)
        self.own = self.own + own
        self.own[3:7] = 0.0
        if self.anchor is not None:
            self.anchor = matrix_from_rotation_vector(own[-3:]) @ self.anchor
            self.own[-3:] = 0.0


def _leaned(axis: Vector, by: Series) -> Vector:
    moved = axis + tangent_basis(axis) @ by
    return np.asarray(moved / np.linalg.norm(moved), dtype=np.float64)


@dataclass(slots=True)
class SpinEquations:
    """A rotation's equations with windows and own unknowns eliminated.

    Attributes
    ----------
    corner, gradient : (6 + 36 square), (6 + 36,) of start, end, Earth rate and shared unknowns.
    square_sum : of all its residuals where they are.
    observations : how many residuals, less the rotation's own unknowns.
    chain : the eliminated windows.
    own_root, own_gain, own_step : to find the own unknowns again.
    force_residual : (windows, 3) raw, predicted minus observed.
    angle_residual : rad, of the table's angle; NaN without.
    rate_residual : rad/s, of the table's rate; NaN without.
    axis : (3,) unit vector in w about which it turned.
    wobbled : mean square of the axis's whitened residuals.
    shaken : mean square of the windows' whitened specific force; below 1, for their attitudes take a share of it.
    duration : s from rest to rest.
    left : `square_sum` less what the windows and its own unknowns take, with start, end and border as they are.
    """

    corner: Square
    gradient: Series
    square_sum: float
    observations: int
    chain: EliminatedChain
    own_inverse: AnyArray
    own_gain: Table
    own_gradient: Series
    force_residual: Table
    angle_residual: float
    rate_residual: float
    axis: Vector
    wobbled: float
    shaken: float
    duration: float
    left: float

    def steps(self, outer: Series) -> tuple[Table, Series]:
        """Return the steps of the windows' attitudes and of the nine, from those of start, end and border."""
        own = -self.own_inverse @ (self.own_gradient + self.own_gain @ outer)
        return self.chain.steps(np.concatenate([outer[:6], own, outer[6:]])), own


def start_spin(
    data: JointData, spin: JointSpin, C_tail: AnyArray, unknowns: Series, earth_w: Vector
) -> SpinState:
    """Return attitudes of the windows as the gyros carry them from the hold before."""
    ranges = link_ranges(data, spin)
    C_se, _, duration = integrate_ranges(data, unknowns, ranges[:-1, 0], ranges[:-1, 1])
    made = [C_tail]
    for rotation, t in zip(C_se, duration, strict=True):
        made.append(matrix_from_rotation_vector(-t * earth_w) @ made[-1] @ rotation)
    C_wb = np.array(made[1:])
    axis = _axis(C_wb)
    anchor = None if spin.turn_rate is None else C_wb[0].copy()
    return SpinState(C_wb, np.asarray(C_tail.T @ axis), axis, np.zeros(Layout.of(spin).own), anchor)


def spin_equations(
    data: JointData,
    spin: JointSpin,
    state: SpinState,
    edges: tuple[AnyArray, AnyArray],
    earth_w: Vector,
    unknowns: Series,
    gravity: float,
    extra: Extra,
    noise: float = 1.0,
    wobble: float = LEAST_WOBBLE,
) -> SpinEquations:
    """Linearise a rotation and eliminate what is its own.

    Parameters
    ----------
    data, spin, state : observations and where its own unknowns are.
    edges : attitudes at the tail of the hold before and at the head of the hold after.
    earth_w, unknowns, gravity, extra : the state of the rest.
    noise : factor on the variance of the windows' specific force: a turning table may shake.
    wobble : rad about each direction across the axis, one sigma, by which it leans at any window.

    Raises
    ------
    ObservabilityError
        If a window's attitude is not determined.
    """
    windows, layout = len(spin.windows), Layout.of(spin, unknowns)
    chain = BorderedChain.zero(windows, 3, layout.size)
    added = add_spin_terms(chain, data, spin, state, edges, earth_w, unknowns, gravity, extra, noise, wobble)
    angle, square_sum = added.angle_residual, added.square_sum
    made = chain.eliminated()
    own = np.arange(6, layout.shared)
    outer = np.concatenate([np.arange(6), np.arange(layout.shared, layout.size)])
    inverse = inverted(made.corner[np.ix_(own, own)])
    gain, right = made.corner[np.ix_(own, outer)], made.corner_gradient[own]
    return SpinEquations(
        corner=made.corner[np.ix_(outer, outer)] - gain.T @ inverse @ gain,
        gradient=made.corner_gradient[outer] - gain.T @ inverse @ right,
        square_sum=square_sum,
        observations=3 * (windows + 1) + added.leaning - 4 + int(not np.isnan(angle)) + int(layout.rated),
        chain=made,
        own_inverse=inverse,
        own_gain=gain,
        own_gradient=right,
        force_residual=added.force_residual,
        angle_residual=angle,
        rate_residual=added.rate_residual,
        axis=state.axis_w,
        wobbled=added.wobbled,
        shaken=added.shaken,
        duration=added.duration,
        left=square_sum - made.decrease(np.zeros(layout.size)) - float(right @ inverse @ right),
    )


@dataclass(frozen=True, slots=True)
class SpinResiduals:
    """What a rotation's terms left: see `SpinEquations`."""

    force_residual: Table
    angle_residual: float
    rate_residual: float
    wobbled: float
    shaken: float
    leaning: int
    duration: float
    square_sum: float


def add_spin_terms(
    chain: BorderedChain,
    data: JointData,
    spin: JointSpin,
    state: SpinState,
    edges: tuple[AnyArray, AnyArray],
    earth_w: Vector,
    unknowns: Series,
    gravity: float,
    extra: Extra,
    noise: float = 1.0,
    wobble: float = LEAST_WOBBLE,
) -> SpinResiduals:
    """Add all terms of a rotation to a chain of its windows, each said by `chain.source`.

    Parameters
    ----------
    chain : of the windows, with the border that `Layout` has.
    data, spin, state, edges, earth_w, unknowns, gravity, extra, noise, wobble : as for `spin_equations`.
    """
    chain.source("windows")
    force = _add_force(chain, data, spin, state, unknowns, gravity, noise)
    chain.source("links")
    link_sum, duration = _add_links(chain, data, spin, state, edges, earth_w, unknowns)
    chain.source("axis")
    layout = Layout.of(spin, unknowns)
    axis_sum, leaning = _add_axis(chain, state, edges, wobble, layout)
    axis = state.axis_w
    chain.source("angle")
    angle_sum, angle = _add_angle(chain, spin, axis, edges, layout)
    chain.source("table rate")
    rate_sum, rate = _add_rate(chain, data, spin, state, layout)
    chain.source("own")
    own_sum = _add_own_prior(chain, data, spin, state, unknowns, extra)
    square_sum = force[1] + link_sum + axis_sum + angle_sum + rate_sum + own_sum
    wobbled = axis_sum / max(leaning - 4, 1)
    shaken = force[1] / force[0].size
    return SpinResiduals(force[0], angle, rate, wobbled, shaken, leaning, duration, square_sum)


def link_ranges(data: JointData, spin: JointSpin) -> np.ndarray:
    """Half-open sample ranges of the links: tail of the hold before, each centre, head of the hold after."""
    base, k = data.base, spin.before
    points = np.concatenate([[base.tail[k, 1] - 1], spin.centres, [base.head[k + 1, 0]]])
    return np.column_stack([points[:-1], points[1:] + 1])


def _add_force(
    chain: BorderedChain,
    data: JointData,
    spin: JointSpin,
    state: SpinState,
    unknowns: Series,
    gravity: float,
    noise: float,
) -> tuple[Table, float]:
    """Add the windows' specific force; return residuals (raw) and their weighted square sum."""
    layout = Layout.of(spin, unknowns)
    rates = _window_rates(spin, unknowns)
    lag = float(part_of(unknowns, TIME_LAG)[0])
    backward = mean_backward_rotation(spin, rates, lag) @ np.swapaxes(state.C_wb, 1, 2)
    up = np.array([0.0, 0.0, -gravity])
    centripetal = skews(rates) @ skews(rates)
    bases = layout.bases(spin.modes)
    shown = raw_force(
        unknowns,
        backward @ up + centripetal @ state.own[layout.inner(layout.lever())],
        size_effect(unknowns, centripetal),
    )
    residual = shown.value + bases @ state.own[layout.inner(layout.force())] - spin.force
    by_border = np.zeros((len(residual), 3, layout.size))
    by_border[:, :, layout.lever()] = shown.by_true @ centripetal
    by_border[:, :, layout.force()] = bases
    by_border[:, :, layout.shared + 3 :] = shown.by_unknowns
    if is_wide(unknowns):
        wide = layout.shared + 3
        by_border[:, :, wide + LEVER_ARMS.start : wide + LEVER_ARMS.stop] = by_lever_arms(shown, centripetal)
        by_border[:, :, wide + TIME_LAG.start] = by_time_lag(shown, rates, backward @ up)
    by_node = shown.by_true @ backward @ skew(up)
    covariance = noise * spin.force_covariance + _faster(spin, data.force_density)
    white, by_node, by_border = whiten(covariance, residual[..., None], by_node, by_border)
    chain.add_unary(np.arange(len(residual)), white[..., 0], by_node, by_border)
    return residual, float(np.sum(white**2))


def _faster(spin: JointSpin, density: Vector) -> Matrix:
    """Raw²: what wanders faster than the modes, down to a window."""
    return np.diag(density) * faster_variance(*spin.modes.shape)


def _window_rates(spin: JointSpin, unknowns: Series) -> Table:
    """(windows, 3) rad/s, without bias and g-sensitivity."""
    force = (spin.force - unknowns[FORCE][BIAS]) @ inverted(force_matrix(unknowns)).T
    seen = (
        without_asymmetry(unknowns, spin.rate)
        - unknowns[GYRO_BIAS]
        - force @ unknowns[G_SENSITIVITY].reshape(3, 3).T
    )
    return np.asarray(seen @ inverted(gyro_matrix(unknowns)).T, dtype=np.float64)


def _add_links(
    chain: BorderedChain,
    data: JointData,
    spin: JointSpin,
    state: SpinState,
    edges: tuple[AnyArray, AnyArray],
    earth_w: Vector,
    unknowns: Series,
) -> tuple[float, float]:
    """Add the gyros from the hold before through all windows to the hold after."""
    ranges = link_ranges(data, spin)
    made = integrate_ranges(data, unknowns, ranges[:, 0], ranges[:, 1])
    link = Link(*made, integrate_magnitudes(data, unknowns, ranges[:, 0], ranges[:, 1]))
    # A gyro whose bias has wandered turns on by it: as the bias itself would.
    C = np.concatenate([edges[0][None], state.C_wb, edges[1][None]])
    residual, by_node, by_next, of_border = link_residuals(C[:-1], C[1:], earth_w, link, unknowns)
    wander = of_border[:, :, 3 + GYRO_BIAS.start : 3 + GYRO_BIAS.stop]
    layout = Layout.of(spin, unknowns)
    bases = wander @ layout.bases(_modes_of_links(spin))
    residual = residual + bases @ state.own[layout.inner(layout.rate())]
    by_border = np.zeros((len(residual), 3, layout.size))
    by_border[:, :, layout.rate()] = bases
    by_border[:, :, layout.shared :] = of_border
    by_border[0, :, START] = by_node[0]
    by_border[-1, :, END] = by_next[-1]
    nothing = np.zeros(len(residual))
    nothing[[0, -1]] = _edge_seconds(data, spin)
    covariance = link_covariance(data, C[:-1], link, unknowns, nothing, own_bias=False)
    covariance = covariance + wander @ _faster(spin, data.rate_density) @ np.swapaxes(wander, 1, 2)
    white, by_node, by_next, by_border = whiten(
        covariance, residual[..., None], by_node, np.ascontiguousarray(by_next), by_border
    )
    white = white[..., 0]
    first, last = slice(0, 1), slice(len(white) - 1, len(white))
    chain.add_unary(np.array([0]), white[first], by_next[first], by_border[first])
    middle = slice(1, len(white) - 1)
    chain.add_links(
        np.arange(len(white) - 2), white[middle], by_node[middle], by_next[middle], by_border[middle]
    )
    chain.add_unary(np.array([len(spin.windows) - 1]), white[last], by_node[last], by_border[last])
    return float(np.sum(white**2)), float(np.sum(link.duration))


def _modes_of_links(spin: JointSpin) -> AnyArray:
    """(links, modes) the modes halfway between the windows' centres; at the edges those of the first and the last."""
    halfway = 0.5 * (spin.modes[:-1] + spin.modes[1:])
    return np.concatenate([spin.modes[:1], halfway, spin.modes[-1:]])


def _edge_seconds(data: JointData, spin: JointSpin) -> tuple[float, float]:
    base, k = data.base, spin.before
    step = (base.time[-1] - base.time[0]) / max(base.time.shape[0] - 1, 1)
    tail, head = base.tail[k, 1] - base.tail[k, 0], base.head[k + 1, 1] - base.head[k + 1, 0]
    return tail * step / 3.0, head * step / 3.0


def _axis(C_wb: Matrices) -> Vector:
    """The axis in w: over the windows the attitude goes round it, the same way all the time."""
    steps = rotation_vectors_from_matrices(C_wb[1:] @ np.swapaxes(C_wb[:-1], 1, 2))
    axis = steps.sum(axis=0) if len(steps) else np.array([0.0, 0.0, 1.0])
    return np.asarray(axis / max(float(np.linalg.norm(axis)), 1e-30), dtype=np.float64)


def _add_axis(
    chain: BorderedChain, state: SpinState, edges: tuple[AnyArray, AnyArray], wobble: float, layout: Layout
) -> tuple[float, int]:
    """Add that the axis is the same in the unit and in the room; return the square sum and how many residuals."""
    C = np.concatenate([edges[0][None], state.C_wb, edges[1][None]])
    basis_b, basis_w = tangent_basis(state.axis_b), tangent_basis(state.axis_w)
    seen = C @ state.axis_b
    residual = (seen - state.axis_w) @ basis_w / wobble
    by_attitude = -(basis_w.T @ skews(seen)) / wobble
    by_border = np.zeros((len(C), 2, layout.size))
    by_border[:, :, layout.axis()] = np.concatenate(
        [basis_w.T @ C @ basis_b, np.broadcast_to(-np.eye(2), (len(C), 2, 2))], axis=2
    )
    by_border[:, :, layout.axis()] /= wobble
    by_border[0, :, START], by_border[-1, :, END] = by_attitude[0], by_attitude[-1]
    windows = slice(1, len(C) - 1)
    chain.add_unary(np.arange(len(C) - 2), residual[windows], by_attitude[windows], by_border[windows])
    chain.add_border(residual[[0, -1]], by_border[[0, -1]])
    return float(np.sum(residual**2)), residual.size


def _add_angle(
    chain: BorderedChain, spin: JointSpin, axis: Vector, edges: tuple[AnyArray, AnyArray], layout: Layout
) -> tuple[float, float]:
    """Add the table's angle from rest to rest; return its weighted square and its residual."""
    if spin.angle is None or len(spin.windows) < 2:
        return 0.0, float("nan")
    turned = matrix_from_rotation_vector(axis * abs(spin.angle)) @ edges[0]
    missed = float(axis @ rotation_vector_from_matrix(edges[1] @ turned.T))
    sigma = max(spin.angle_sigma, 1e-9)
    by_border = np.zeros((1, 1, layout.size))
    by_border[0, 0, START], by_border[0, 0, END] = -axis / sigma, axis / sigma
    chain.add_border(np.array([[missed / sigma]]), by_border)
    return (missed / sigma) ** 2, missed


def _add_rate(
    chain: BorderedChain, data: JointData, spin: JointSpin, state: SpinState, layout: Layout
) -> tuple[float, float]:
    """Add that the table turns at its rate from the first window to the last; return square and residual (rad/s).

    The two are no neighbours in the chain: the first one's attitude stands in the border once more.
    """
    if spin.turn_rate is None or state.anchor is None or len(spin.windows) < 2:
        return 0.0, float("nan")
    tie = rotation_vector_from_matrix(state.C_wb[0] @ state.anchor.T) / SAME
    by_node, by_border = np.eye(3)[None] / SAME, np.zeros((1, 3, layout.size))
    by_border[0, :, layout.anchor()] = -np.eye(3) / SAME
    chain.add_unary(np.array([0]), tie[None], by_node, by_border)
    seconds = float(data.base.time[spin.centres[-1]] - data.base.time[spin.centres[0]])
    axis, sigma = state.axis_w, max(spin.rate_sigma * seconds, LEAST_RATE_ANGLE)
    turned = matrix_from_rotation_vector(axis * abs(spin.turn_rate) * seconds) @ state.anchor
    missed = float(axis @ rotation_vector_from_matrix(state.C_wb[-1] @ turned.T))
    by_last, by_border = axis[None, None] / sigma, np.zeros((1, 1, layout.size))
    by_border[0, 0, layout.anchor()] = -axis / sigma
    last = np.array([len(spin.windows) - 1])
    chain.add_unary(last, np.array([[missed / sigma]]), by_last, by_border)
    return float(tie @ tie) + (missed / sigma) ** 2, missed / seconds


def _add_own_prior(
    chain: BorderedChain, data: JointData, spin: JointSpin, state: SpinState, unknowns: Series, extra: Extra
) -> float:
    layout = Layout.of(spin, unknowns)
    force, rate = wander_variances(data, spin, unknowns, extra)
    # Of the axis nothing is known beforehand.
    anchor = np.full(3 if layout.rated else 0, np.inf)
    known = (
        np.full(3, LEVER_SIGMA),
        np.full(4, np.inf),
        np.sqrt(force).ravel(),
        np.sqrt(rate).ravel(),
        anchor,
    )
    sigma = np.concatenate(known)
    by_border = np.zeros((1, layout.own, layout.size))
    by_border[0, :, 6 : layout.shared] = np.diag(1.0 / sigma)
    residual = state.own / sigma
    chain.add_border(residual[None], by_border)
    return float(residual @ residual)


def wander_variances(
    data: JointData, spin: JointSpin, unknowns: Series, extra: Extra
) -> tuple[AnyArray, AnyArray]:
    """Return (1 + modes, 3) raw², of the constant and of each mode, of the accelerometers and of the gyros.

    Parameters
    ----------
    data, spin, unknowns, extra : the noise, the rotation, and what is added to both.
    """
    force = _wander_variance(
        data, spin, data.force_density, extra.force * np.sum(force_matrix(unknowns) ** 2, axis=1)
    )
    rate = _wander_variance(
        data, spin, data.rate_density, extra.rate * np.sum(gyro_matrix(unknowns) ** 2, axis=1)
    )
    step = spin.seconds / max(spin.offsets.size, 1)
    # Never quite nothing, so that the wander is always determined.
    return force + 1e-6 * data.base.force_sample_variance, rate + 1e-10 * data.base.rate_random_walk / step


def _wander_variance(data: JointData, spin: JointSpin, density: Vector, extra: Vector) -> AnyArray:
    """Return (1 + modes, 3) raw², of the constant and of each mode."""
    constant = density * max(float(np.log(data.span / spin.seconds)), 0.0) + extra
    return np.concatenate([constant[None], spin.mode_share[:, None] * density])
