"""What a table's rotation adds: the specific force as it turns, and the angle that its display shows.

While a table turns slowly, gravity goes round in the unit: window by window the accelerometers show it, turned on by
the gyros from each window to the next. The axis keeps its direction, in the unit and in the room: what gyros across it
show is bias and Earth rate. Each window has an attitude of its own, so that the gyros' random walk is followed and not
assumed away. What else acts belongs to the rotation: where the accelerometers are off its axis (centripetal), and how
both biases wander: a constant and cosines over the rotation, each with the variance that 1/f noise gives it.

`RotationStretch` puts all of a rotation into one chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Table, Vector, Vectors, inverted
from tumble.attitude import (
    matrices_from_rotation_vectors,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    rotation_vectors_from_matrices,
    skew,
    skews,
    tangent_basis,
)
from tumble.calibration.equations import causes
from tumble.calibration.equations.imu_unknowns import (
    force_matrix,
    g_sensitivity,
    gyro_matrix,
    raw_force,
    raw_rate,
    straightened,
)
from tumble.calibration.equations.observed import Observed, TableRotation, mean_backward_rotation
from tumble.calibration.equations.state import (
    HEAD,
    TAIL,
    RecordingState,
    RotationState,
    Section,
    undetermined,
)
from tumble.calibration.equations.turn_equations import (
    edge_seconds,
    integrate_links,
    link_covariance,
    link_residuals,
)
from tumble.calibration.terms import by_lag, by_lever_arms, centripetal_by_rate, forces_apart
from tumble.estimation import (
    Drift,
    Eliminated,
    Equations,
    Grouped,
    Linear,
    Place,
    Stretch,
    Unknowns,
    View,
    faster_variance,
)

# How far the accelerometers may be off the axis, one sigma.
LEVER_SIGMA = 1.0  # m
# A good table's axis wobbles by an arcsecond or so; more is found from the residuals.
LEAST_WOBBLE = 5e-6  # rad
# Two copies of one attitude agree to this, and an exact rate is one to a microradian over the whole.
SAME, LEAST_RATE_ANGLE = 1e-6, 1e-6  # rad
LEAST_ANGLE_SIGMA = 1e-9  # rad
# An angle that is read ten times better than gyros turn is checked by them all the same.
CHECKED_ANGLE = 1e-4


class Layout(NamedTuple):
    """Where a rotation's own unknowns stand in its border, and after them the section's.

    Attributes
    ----------
    lever, axis : the lever arm (3), and how the axis leans in the unit and in the room (2 and 2).
    force, rate : how each triad's biases wander, constant and modes, 3 each.
    anchor : the first window's attitude once more where a rate is believed (3), else nothing.
    holds, earth : the attitudes at both ends (6), and the section's Earth rate; the shared unknowns follow.
    """

    lever: slice
    axis: slice
    force: slice
    rate: slice
    anchor: slice
    holds: slice
    earth: slice

    @staticmethod
    def of(rotation: TableRotation) -> Layout:
        """Return the layout of a rotation."""
        wander = 3 * (1 + rotation.modes.shape[1])
        stops = np.cumsum([3, 4, wander, wander, 3 * (rotation.turn_rate is not None), 6, 3]).tolist()
        return Layout(*map(slice, [0, *stops], stops))

    @property
    def own(self) -> int:
        """How many unknowns are the rotation's own."""
        return self.anchor.stop


class RotationStretch:
    """The windows of a table's rotation, between the tail of one hold and the head of the next."""

    size = 3

    def __init__(self, task: RecordingState, section: Section, k: int) -> None:
        self.task, self.section, self.k = task, section, k
        self.rotation, self.moving = task.data.rotations[k], task.rotations[k]
        self.layout = Layout.of(self.rotation)
        self.nodes, self.own = len(self.rotation.windows), self.layout.own
        kinds = (Windows, Links, Axis, Angle, TableRate, Own)
        self.equations: list[Equations] = [of_kind(self) for of_kind in kinds]
        self.within: list[tuple[Place, Stretch | Eliminated]] = []

    @property
    def joined(self) -> Place:
        """Where it stands in its section."""
        return Place(self.k - self.section.first, TAIL, HEAD)

    def edges(self) -> tuple[Matrix, Matrix]:
        """Return the attitudes at the tail of the hold before and at the head of the hold after."""
        node = self.k - self.section.first
        return self.section.C_wb[node, 2], self.section.C_wb[node + 1, 0]

    def undetermined(self, node: int) -> str:
        """Say which rotation a window is of."""
        base, k = self.task.data.base, self.k
        where = f"in the rotation after hold {k + 1}"
        return undetermined(where, base.time, int(base.tail[k, 1]), int(base.head[k + 1, 0]))

    def move(self, nodes: Table, own: Series) -> None:
        """Move the windows' attitudes and the rotation's own unknowns."""
        moving, axis = self.moving, self.layout.axis
        moving.C_wb = matrices_from_rotation_vectors(nodes) @ moving.C_wb
        leaning = own[axis]
        moving.axis_b, moving.axis_w = (
            _leaned(moving.axis_b, leaning[:2]),
            _leaned(moving.axis_w, leaning[2:]),
        )
        moving.own = moving.own + own
        moving.own[axis] = 0.0
        if moving.anchor is not None:
            moving.anchor = matrix_from_rotation_vector(own[self.layout.anchor]) @ moving.anchor
            moving.own[self.layout.anchor] = 0.0


class RotationEquations(Equations):
    """Of one rotation."""

    def __init__(self, stretch: RotationStretch) -> None:
        self.stretch = stretch
        self.spin: TableRotation = stretch.rotation
        self.layout: Layout = stretch.layout
        self.moving: RotationState = stretch.moving
        self.place = np.array([stretch.k])

    def edges(self) -> tuple[Matrix, Matrix]:
        """Return the attitudes at the tail of the hold before and at the head of the hold after."""
        return self.stretch.edges()

    def rates(self, u: Unknowns) -> Table:
        """Return (windows, 3) rad/s, what the gyros show in each window without bias and g-sensitivity."""
        return _window_rates(u, self.spin.force, self.spin.rate)

    def mean_rate(self, u: Unknowns) -> float:
        """Return what the corrected gyros show about the axis over all windows, rad/s, the Earth rate taken out."""
        moving = self.moving
        shown = self.rates(u).mean(axis=0) @ moving.axis_b
        return float(shown - self.stretch.section.earth_w @ moving.axis_w)

    def mean_rate_sigma(self, state: RecordingState) -> float:
        """Return what `mean_rate` is uncertain by, rad/s: the samples' noise, and how the gyros' biases wander."""
        spin, data = self.spin, state.data
        weights = self.moving.axis_b @ inverted(gyro_matrix(state.unknowns))
        shares = np.concatenate([[1.0], spin.modes.mean(axis=0)]) ** 2
        wander = shares @ _wander_variances(state, [spin])[1][0]
        return float(np.sqrt(weights**2 @ (data.base.rate_random_walk / spin.seconds + wander)))


class AlikeEquations(RotationEquations):
    """Of one rotation, with the work done for all rotations of one layout at once."""

    def linearise(self, state: RecordingState) -> Sequence[Linear]:
        """Return residuals of this rotation."""
        return [linear for linear, _ in type(self).linearise_all([self], state)]

    @classmethod
    def moving_of(cls, group: Sequence[RotationEquations]) -> AnyArray:
        """Return (rotations, own) where their own unknowns are."""
        return np.array([one.moving.own for one in group])

    @classmethod
    def attitudes_of(cls, group: Sequence[RotationEquations]) -> tuple[Matrices, np.ndarray]:
        """Return (sum of windows + 2, 3, 3) attitudes of each from hold to hold, and (rotations,) where each begins."""
        made: list[AnyArray] = []
        for one in group:
            start, end = one.edges()
            made += [start[None], one.moving.C_wb, end[None]]
        counts = np.array([len(one.spin.windows) + 2 for one in group])
        return np.concatenate(made), np.cumsum(counts) - counts


class Windows(AlikeEquations):
    """The windows' specific force: ``a(mean rotation · C' (0, 0, -g) + centripetal) + wander`` less the mean."""

    kind, cause = "windows", causes.FORCE_TURNING

    @classmethod
    def linearise_all(cls, group: Sequence[Windows], state: RecordingState) -> Grouped:
        """Return three residuals a window, raw; all rotations have one layout, and are of one section."""
        u, layout, spins = state.unknowns, group[0].layout, [one.spin for one in group]
        counts = [len(spin.windows) for spin in spins]
        force, rate, modes = (
            np.concatenate([getattr(s, name) for s in spins]) for name in ("force", "rate", "modes")
        )
        rates, lag = _window_rates(u, force, rate), float(u["lag"][0])
        C_wb = np.concatenate([one.moving.C_wb for one in group])
        own = np.repeat(cls.moving_of(group), counts, axis=0)
        turned, by_speed = mean_backward_rotation(spins, rates, lag)
        backward = turned @ np.swapaxes(C_wb, 1, 2)
        up = np.array([0.0, 0.0, -state.site.gravity])
        cross, shapes = skews(rates), _with_constant(modes)
        centripetal = cross @ cross
        shown = raw_force(
            u,
            backward @ up + np.einsum("nij,nj->ni", centripetal, own[:, layout.lever]),
            forces_apart(u, centripetal),
        )
        residual = shown.value + _wandered(shapes, own[:, layout.force]) - force
        blocks = dict(shown.by_blocks)
        if u.is_free("lever_arms"):
            blocks["lever_arms"] = by_lever_arms(shown.by_true, centripetal)
        if u.is_free("lag"):
            blocks["lag"] = by_lag(shown.by_true, rates, backward @ up)[:, :, None]
        by_rate = shown.by_true @ _gravity_by_rate(turned, by_speed, rates, np.swapaxes(C_wb, 1, 2) @ up)
        arms = own[:, None, layout.lever] + u["lever_arms"].reshape(3, 3)
        by_rate = by_rate + centripetal_by_rate(shown.by_true, rates, arms)
        gyros = raw_rate(u, rates, backward @ up)
        by_output = -by_rate @ np.linalg.inv(gyros.by_true)
        blocks |= {name: by_output @ block for name, block in gyros.by_blocks.items()}
        blocks["clock"] = by_rate @ rates[:, :, None] / (1.0 + u["clock"][0])
        wander = np.zeros((len(shapes), 3, 3 * shapes.shape[1]))
        for axis in range(3):
            wander[:, axis, axis::3] = shapes
        own_parts = [(layout.lever, shown.by_true @ centripetal), (layout.force, wander)]
        by_border, columns = u.beside(own_parts, blocks, layout.earth.stop)
        by_node = shown.by_true @ backward @ skew(up)
        node = _counted(counts)
        by_bias = np.broadcast_to(np.eye(3), (len(node), 3, 3))
        covariance = cls._covariances(group, counts, state)
        linear = Linear(residual, covariance, by_border, node, by_node, by_bias=by_bias, columns=columns)
        return [(linear, counts)]

    @staticmethod
    def _covariances(group: Sequence[Windows], counts: list[int], state: RecordingState) -> Matrices:
        """(windows, 3, 3) raw², of the means, the table's shaking, and what wanders faster than the modes."""
        shaking = [state.noise.factor("windows", one.stretch.k) for one in group]
        faster = np.repeat([faster_variance(*one.spin.modes.shape) for one in group], counts)
        means = np.concatenate([one.spin.force_covariance for one in group])
        density = np.diag(state.data.force_density)
        return np.repeat(shaking, counts)[:, None, None] * means + faster[:, None, None] * density

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return what wanders faster than the modes."""
        windows = self.spin.windows
        return {
            causes.FORCE_WANDER: _fast_drift(state.data, self.spin, linear, windows, state.data.force_density)
        }


class Links(AlikeEquations):
    """The gyros from the hold before through all windows to the hold after; the first and the last stand apart."""

    kind, cause = "links", causes.RATE_TURNING

    def __init__(self, stretch: RotationStretch) -> None:
        super().__init__(stretch)
        self.duration = 0.0

    @classmethod
    def linearise_all(cls, group: Sequence[Links], state: RecordingState) -> Grouped:
        """Return three residuals a link, rad in w; all rotations have one layout, and are of one section."""
        # Both links of a single window depend on that node alone.
        single = [len(one.spin.windows) == 1 for one in group]
        made: Grouped = []
        for alone in {*single}:
            taken = [one for one, is_single in zip(group, single, strict=True) if is_single == alone]
            linear, counts = cls._alike(taken, state)
            left = iter(counts)
            made.append((linear, [next(left) if is_single == alone else 0 for is_single in single]))
        return made

    @classmethod
    def _alike(cls, group: Sequence[Links], state: RecordingState) -> tuple[Linear, list[int]]:
        """Those of rotations that all have one window, or all have more."""
        u, data, layout = state.unknowns, state.data, group[0].layout
        counts = [len(one.spin.windows) + 1 for one in group]
        lasts = np.cumsum(counts) - 1
        firsts = lasts - np.array(counts) + 1
        ranges = np.concatenate([_link_ranges(data, one.spin) for one in group])
        link = integrate_links(data, u, ranges[:, 0], ranges[:, 1])
        C, begins = cls.attitudes_of(group)
        C_start, C_end = np.delete(C, begins - 1, axis=0), np.delete(C, begins, axis=0)
        shown = link_residuals(C_start, C_end, group[0].stretch.section.earth_w, link, u)
        # A gyro whose bias has wandered turns on by it: as the bias itself would.
        wander = shown.by_blocks["gyro.bias"]
        shapes = _with_constant(np.concatenate([_modes_of_links(one.spin) for one in group]))
        own = np.repeat(cls.moving_of(group)[:, layout.rate], counts, axis=0)
        residual = shown.value + np.einsum("nij,nj->ni", wander, _wandered(shapes, own))
        by_rate = np.einsum("nij,nm->nimj", wander, shapes).reshape(len(own), 3, -1)
        by_holds = np.zeros((len(own), 3, 6))
        by_holds[firsts, :, :3], by_holds[lasts, :, 3:] = shown.by_start[firsts], shown.by_end[lasts]
        own_parts = [(layout.rate, by_rate), (layout.holds, by_holds), (layout.earth, shown.by_earth)]
        by_border, columns = u.beside(own_parts, shown.by_blocks, layout.earth.stop)
        edges = np.zeros(len(residual))
        edges[firsts], edges[lasts] = edge_seconds(data, np.array([one.stretch.k for one in group]))
        timing = np.zeros((len(residual), 3))
        timing[firsts], timing[lasts] = zip(*(one.spin.ramp_sampling for one in group), strict=True)
        covariance = link_covariance(data, C_start, link, u, edges, timing)
        faster = np.repeat([faster_variance(*one.spin.modes.shape) for one in group], counts)[:, None, None]
        covariance = covariance + faster * (wander * data.rate_density) @ np.swapaxes(wander, 1, 2)
        # The first link ends at the first window and the last begins at the last one: holds stand in the border.
        by_node, by_next = shown.by_start.copy(), shown.by_end.copy()
        by_node[firsts], by_next[firsts] = shown.by_end[firsts], 0.0
        by_node[lasts], by_next[lasts] = 0.0, shown.by_start[lasts]
        for one, duration in zip(group, np.add.reduceat(link.duration, firsts).tolist(), strict=True):
            one.duration = duration
        if counts[0] == 2:
            by_node, by_next = by_node + by_next, None
        most = np.repeat(np.maximum(np.array(counts) - 3, 0), counts)
        node = np.clip(_counted(counts) - 1, 0, most)
        nodes = node, by_node, by_next
        return Linear(residual, covariance, by_border, *nodes, by_bias=wander, columns=columns), counts

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return what wanders faster than the modes."""
        ranges = _link_ranges(state.data, self.spin)[first : first + len(linear.residual)]
        return {
            causes.RATE_WANDER: _fast_drift(state.data, self.spin, linear, ranges, state.data.rate_density)
        }


class Axis(AlikeEquations):
    """That the axis is the same in the unit and in the room: ``C axis_b - axis_w``, across."""

    kind, cause = "axis", causes.AXIS

    @classmethod
    def linearise_all(cls, group: Sequence[Axis], state: RecordingState) -> Grouped:
        """Return two residuals a window, and two at each end, rad; of the axis nothing is known beforehand."""
        layout = group[0].layout
        C, begins = cls.attitudes_of(group)
        counts = np.diff(begins, append=len(C))
        axes = np.array([(one.moving.axis_b, one.moving.axis_w) for one in group])
        bases = np.array([(tangent_basis(axis_b), tangent_basis(axis_w)) for axis_b, axis_w in axes])
        (axis_b, axis_w), (basis_b, basis_w) = (
            np.swapaxes(np.repeat(of, counts, axis=0), 0, 1) for of in (axes, bases)
        )
        seen = np.einsum("nij,nj->ni", C, axis_b)
        residual = np.einsum("ni,nij->nj", seen - axis_w, basis_w)
        across = np.swapaxes(basis_w, 1, 2)
        by_attitude = -(across @ skews(seen))
        leaning = np.concatenate([across @ C @ basis_b, np.broadcast_to(-np.eye(2), (len(C), 2, 2))], axis=2)
        ends = np.zeros(len(C), dtype=bool)
        lasts = begins + counts - 1
        ends[begins] = ends[lasts] = True
        by_holds = np.zeros((len(C), 2, 6))
        by_holds[begins, :, :3], by_holds[lasts, :, 3:] = by_attitude[begins], by_attitude[lasts]
        columns = np.r_[layout.axis, layout.holds]
        factor = np.repeat([state.noise.factor("axis", one.stretch.k) for one in group], counts)
        covariance = (LEAST_WOBBLE**2 * factor)[:, None, None] * np.eye(2)
        node = _counted([count - 2 for count in counts.tolist()])
        inner = residual[~ends], covariance[~ends], leaning[~ends], node, by_attitude[~ends]
        outer = residual[ends], covariance[ends], np.concatenate([leaning, by_holds], axis=2)[ends]
        return [
            (Linear(*inner, columns=columns[:4]), (counts - 2).tolist()),
            (Linear(*outer, columns=columns), [2] * len(group)),
        ]


class Angle(RotationEquations):
    """The rotation from rest to rest about the axis, less the table's angle."""

    kind, cause = "angle", causes.ANGLES
    words = (
        "spin",
        "the table's angle after hold {number} contradicts everything else, {times}: misread?",
    )

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return one residual, rad; none if nobody read it."""
        if self.spin.angle is None or not state.reads_angle(self.stretch.k) or len(self.spin.windows) < 2:
            return []
        axis, (start, end) = self.moving.axis_w, self.edges()
        turned = matrix_from_rotation_vector(axis * abs(self.spin.angle)) @ start
        missed = float(axis @ rotation_vector_from_matrix(end @ turned.T))
        sigma = max(self.spin.angle_sigma, LEAST_ANGLE_SIGMA)
        by_holds, columns = np.concatenate([-axis, axis])[None, None], np.r_[self.layout.holds]
        return [Linear(np.array([[missed]]), np.full((1, 1, 1), sigma**2), by_holds, columns=columns)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return it, however little checks it."""
        return [View("angle", least=CHECKED_ANGLE)]

    def directions(self, state: RecordingState) -> AnyArray:
        """Return an error of the angle."""
        return np.eye(1)


class TableRate(AlikeEquations):
    """That the table turns at its rate from the first window to the last.

    The two are no neighbours in the chain: the first one's attitude stands in the border once more.
    """

    kind, cause = "table rate", causes.OTHER
    words = (
        "spin",
        (
            "after hold {number} the unit did not turn by what the table's rate makes, {times}: did the unit slip, "
            "or was it another rate?"
        ),
    )

    @property
    def seconds(self) -> float:
        """From the first window's centre to the last one's, s."""
        time, centres = self.stretch.task.data.base.time, self.spin.centres
        return float(time[centres[-1]] - time[centres[0]])

    @classmethod
    def linearise_all(cls, group: Sequence[TableRate], state: RecordingState) -> Grouped:
        """Return three residuals that tie both attitudes, and one, rad, of the rate; nothing where none is believed."""
        layout, u, there = group[0].layout, state.unknowns, [int(len(one.spin.windows) > 1) for one in group]
        if group[0].moving.anchor is None or not any(there):
            return []
        spun = [one for one in group if len(one.spin.windows) > 1]
        first, last, axis = (
            np.array([getattr(one.moving, name)[at] for one in spun])
            for name, at in (("C_wb", 0), ("C_wb", -1), ("axis_w", slice(None)))
        )
        anchor = np.array([one.moving.anchor for one in spun])
        unit = np.broadcast_to(np.eye(3), (len(spun), 3, 3))
        tie = rotation_vectors_from_matrices(first @ np.swapaxes(anchor, 1, 2))
        begin, columns = np.zeros(len(spun), dtype=int), np.r_[layout.anchor]
        tied = Linear(tie, SAME**2 * unit, -unit, begin, unit, columns=columns)
        # Both the stamps and the display may be wrong by a share that all rotations have in common.
        faster, more = 1.0 + float(u["clock"][0]), 1.0 + float(u["table_rate"][0])
        seconds = np.array([one.seconds for one in spun])
        angle = np.array([abs(one.spin.turn_rate or 0.0) for one in spun]) * seconds * faster * more
        turned = matrices_from_rotation_vectors(axis * angle[:, None]) @ anchor
        missed = rotation_vectors_from_matrices(last @ np.swapaxes(turned, 1, 2))
        shared = {
            name: (-angle / by)[:, None, None] for name, by in (("clock", faster), ("table_rate", more))
        }
        by_border, columns = u.beside([(layout.anchor, -axis[:, None])], shared, layout.earth.stop)
        node = np.array([len(one.spin.windows) - 1 for one in spun])
        variance = np.array([one._variance(state) for one in spun])[:, None, None]
        residual = np.sum(axis * missed, axis=1)[:, None]
        kept = np.array([bool(state.taking_part["table rate"][one.stretch.k]) for one in spun])
        shown = residual[kept], variance[kept], by_border[kept], node[kept], axis[kept, None]
        rate = Linear(*shown, columns=columns)
        left = iter(kept.tolist())
        return [(tied, there), (rate, [int(bool(one) and next(left)) for one in there])]

    def _variance(self, state: RecordingState) -> float:
        """Of the angle from the first window to the last, rad².

        What makes the axis wobble, such as a unit that slips on its plate halfway, turns it about the axis, too: a step
        leaves half of itself across on either side of its mean.
        """
        wobble = LEAST_WOBBLE**2 * (state.noise.factor("axis", self.stretch.k) - 1.0)
        believed = (self.spin.rate_sigma * self.seconds) ** 2
        return max(believed + 4.0 * wobble + state.noise["table rate"], LEAST_RATE_ANGLE**2)

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return the rate's; the tie is none of the table's."""
        return [View("table rate", least=CHECKED_ANGLE)] if linear.residual.shape[1] == 1 else []


class Own(AlikeEquations):
    """What is believed of the rotation's own unknowns: how long a lever arm is, and how biases wander."""

    kind = "own"

    @classmethod
    def linearise_all(cls, group: Sequence[Own], state: RecordingState) -> Grouped:
        """Return a residual of each that something is known of: of all but the axis."""
        at = group[0].known
        force, rate = _wander_variances(state, [one.spin for one in group])
        lever = np.full((len(group), 3), LEVER_SIGMA**2)
        variances = np.concatenate(
            [lever, force.reshape(len(group), -1), rate.reshape(len(group), -1)], axis=1
        )
        by_own = np.tile(np.eye(at.size), (len(group), 1))[:, None]
        residual = cls.moving_of(group)[:, at].reshape(-1, 1)
        linear = Linear(residual, variances.reshape(-1, 1, 1), by_own, columns=at)
        return [(linear, [at.size] * len(group))]

    @property
    def known(self) -> np.ndarray:
        """Which of the own unknowns something is known of."""
        return np.r_[self.layout.lever, self.layout.force, self.layout.rate]

    def causes(self, state: RecordingState, linear: Linear) -> dict[str, AnyArray]:
        """Return the lever arm's length, and the wanders."""
        at, made = self.known, dict[str, AnyArray]()
        for cause, place in (
            (causes.LEVER, self.layout.lever),
            (causes.FORCE_WANDER, self.layout.force),
            (causes.RATE_WANDER, self.layout.rate),
        ):
            there = (at >= place.start) & (at < place.stop)
            made[cause] = there[:, None, None] * linear.covariance
        return made

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return the wanders over a rotation as they are believed, which windows and links count anew."""
        at = self.known
        force, rate = (of[0] for of in _wander_variances(state, [self.spin]))
        rate[0] -= self.spin.rate_rounding
        nothing, never, made = np.zeros((at.size, 1, 3)), np.zeros(at.size), dict[str, Drift]()
        for source, place, alone in (
            (causes.FORCE_WANDER, self.layout.force, force),
            (causes.RATE_WANDER, self.layout.rate, rate),
        ):
            whole = np.zeros(self.layout.own)
            whole[place] = alone.ravel()
            made[source] = Drift(never, never, nothing, whole[at][:, None, None])
        return made


def _leaned(axis: Series, by: Series) -> Series:
    moved = axis + tangent_basis(axis) @ by
    return np.asarray(moved / np.linalg.norm(moved), dtype=np.float64)


def _counted(counts: Sequence[int]) -> np.ndarray:
    """(sum,) each rotation's terms, counted from 0."""
    return np.arange(sum(counts)) - np.repeat(np.cumsum(counts) - counts, counts)


def _link_ranges(data: Observed, spin: TableRotation) -> np.ndarray:
    """Half-open sample ranges of the links: tail of the hold before, each centre, head of the hold after."""
    base, k = data.base, spin.before
    points = np.concatenate([[base.tail[k, 1] - 1], spin.centres, [base.head[k + 1, 0]]])
    return np.column_stack([points[:-1], points[1:] + 1])


def start_rotation(
    data: Observed, spin: TableRotation, C_tail: AnyArray, u: Unknowns, earth_w: Vector
) -> RotationState:
    """Return attitudes of the windows as the gyros carry them from the hold before.

    Parameters
    ----------
    data, spin, u : observations and start values.
    C_tail : (3, 3) attitude at the tail of the hold before.
    earth_w : (3,) rad/s.
    """
    ranges = _link_ranges(data, spin)
    link = integrate_links(data, u, ranges[:-1, 0], ranges[:-1, 1])
    made = [C_tail]
    for rotation, t in zip(link.C_se, link.duration, strict=True):
        made.append(matrix_from_rotation_vector(-t * earth_w) @ made[-1] @ rotation)
    C_wb = np.array(made[1:])
    axis = _axis(C_wb)
    anchor = None if spin.turn_rate is None else C_wb[0].copy()
    return RotationState(C_wb, np.asarray(C_tail.T @ axis), axis, np.zeros(Layout.of(spin).own), anchor)


def _wander_variances(state: RecordingState, spins: Sequence[TableRotation]) -> tuple[AnyArray, AnyArray]:
    """Return (rotations, 1 + modes, 3) raw², of the constant and of each mode: accelerometers and gyros."""
    data, u, noise = state.data, state.unknowns, state.noise
    seconds = np.array([spin.seconds for spin in spins])
    share = np.array([spin.mode_share for spin in spins])[:, :, None]
    rounding = np.array([spin.rate_rounding for spin in spins])
    constant = np.maximum(np.log(data.span / seconds), 0.0)[:, None]
    added = (
        noise["force"] * np.sum(force_matrix(u) ** 2, axis=1),
        noise["rate"] * np.sum(gyro_matrix(u) ** 2, axis=1) + rounding,
    )
    force, rate = (
        np.concatenate(
            [(constant * density * (kind != data.steady) + more)[:, None], share * density], axis=1
        )
        for kind, density, more in zip(
            ("force", "rate"), (data.force_density, data.rate_density), added, strict=True
        )
    )
    step = seconds / np.array([max(spin.offsets.size, 1) for spin in spins])
    # Never quite nothing, so that the wander is always determined.
    white = 1e-10 * data.base.rate_random_walk / step[:, None, None]
    return force + 1e-6 * data.base.force_sample_variance, rate + white


def _with_constant(modes: AnyArray) -> AnyArray:
    """(rows, 1 + modes) the shapes that a bias wanders in."""
    return np.concatenate([np.ones((len(modes), 1)), modes], axis=1)


def _wandered(shapes: AnyArray, own: AnyArray) -> Vectors:
    """(rows, 3) what biases have wandered by, of the unknowns (rows, 3 of each shape)."""
    return np.einsum("nm,nmj->nj", shapes, own.reshape(*shapes.shape, 3))


def _fast_drift(
    data: Observed, spin: TableRotation, linear: Linear, ranges: np.ndarray, density: Vector
) -> Drift:
    assert linear.by_bias is not None
    independent = (linear.by_bias * (faster_variance(*spin.modes.shape) * density)) @ np.swapaxes(
        linear.by_bias, 1, 2
    )
    time = data.base.time
    return Drift(time[ranges[:, 0]], time[ranges[:, 1] - 1], linear.by_bias, independent)


def _window_rates(u: Unknowns, raw_force: Table, raw_rate: Table) -> Table:
    """(windows, 3) rad/s, without bias and g-sensitivity."""
    force = (raw_force - u["force.bias"]) @ inverted(force_matrix(u)).T
    seen = straightened(u, raw_rate) - u["gyro.bias"] - force @ g_sensitivity(u).T
    return np.asarray((1.0 + u["clock"][0]) * (seen @ inverted(gyro_matrix(u)).T), dtype=np.float64)


def _gravity_by_rate(turned: Matrices, by_speed: Matrices, rates: Vectors, centre: Vectors) -> Matrices:
    """(windows, 3, 3) of gravity's mean force by the rate: about what it goes round, and how fast.

    `centre` is its force in the middle of each window.
    """
    speed = np.maximum(np.linalg.norm(rates, axis=1), 1e-30)[:, None, None]
    axis = rates[:, :, None] / speed
    lost = 0.5 * (3.0 - np.trace(turned, axis1=1, axis2=2))[:, None, None]
    odd = 0.5 * (turned - np.swapaxes(turned, 1, 2))
    sine = -np.sum(odd * skews(axis[:, :, 0]), axis=(1, 2))[:, None, None] / 2.0
    along = np.sum(axis[:, :, 0] * centre, axis=1)[:, None, None]
    turning = lost * (axis * centre[:, None, :] + along * np.eye(3)) + sine * skews(centre)
    across = (np.eye(3) - axis * np.swapaxes(axis, 1, 2)) / speed
    return turning @ across + (by_speed @ centre[:, :, None]) * np.swapaxes(axis, 1, 2)


def _modes_of_links(spin: TableRotation) -> AnyArray:
    """(links, modes) the modes halfway between the windows' centres; at the edges those of the first and the last."""
    halfway = 0.5 * (spin.modes[:-1] + spin.modes[1:])
    return np.concatenate([spin.modes[:1], halfway, spin.modes[-1:]])


def _axis(C_wb: Matrices) -> Vector:
    """The axis in w: over the windows the attitude goes round it, the same way all the time."""
    steps = rotation_vectors_from_matrices(C_wb[1:] @ np.swapaxes(C_wb[:-1], 1, 2))
    axis = steps.sum(axis=0) if len(steps) else np.array([0.0, 0.0, 1.0])
    return np.asarray(axis / max(float(np.linalg.norm(axis)), 1e-30), dtype=np.float64)
