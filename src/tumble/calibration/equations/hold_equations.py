"""What a hold shows: specific force in three parts, mean rate, how it swings, and that it rests.

Each hold is a node of three attitudes, at its head, in its middle and at its tail.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Table, Vectors
from tumble.attitude import rotation_vectors_from_matrices, skew
from tumble.calibration.equations.causes import FORCE_REST, FORCE_WANDER, RATE_REST, RATE_WANDER, SWAY
from tumble.calibration.equations.imu_unknowns import (
    force_matrix,
    g_sensitivity,
    gyro_matrix,
    raw_force,
    raw_rate,
)
from tumble.calibration.equations.observed import Observed
from tumble.calibration.equations.state import EARTH, HEAD, MIDDLE, NODE, TAIL, RecordingState, Section
from tumble.estimation import Drift, Equations, Linear, View

LEAST_SWING = 1e-12
"""rad²: a microrad of tilt is a microgee, and better gyros would leave a pose's heading to round-off."""
# How the three parts of a hold differ: head and tail against the middle.
_APART: AnyArray = np.asarray(
    np.kron(np.array([[1.0, -1.0, 0.0], [0.0, -1.0, 1.0]]), np.eye(3)), dtype=np.float64
)


class HoldEquations(Equations):
    """Of all holds of a section."""

    def __init__(self, section: Section) -> None:
        self.section = section
        self.place = section.holds
        self.node = self.place - section.first

    def span(self, data: Observed) -> tuple[AnyArray, AnyArray]:
        """Return (holds,) s when each begins and ends."""
        base, k = data.base, self.place
        return base.time[base.head[k, 0]], base.time[base.tail[k, 1] - 1]


class Force(HoldEquations):
    """The specific force at the head, in the middle and at the tail: ``a(C' (0, 0, -g))`` less the part's mean."""

    kind = "force"
    words = "hold", "its specific force ({norm} off gravity) contradicts the others, {times}"

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return nine residuals a hold, raw."""
        u, k, up = state.unknowns, self.place, np.array([0.0, 0.0, -state.site.gravity])
        backward = np.swapaxes(self.section.C_wb, 2, 3)
        shown = raw_force(u, (backward @ up).reshape(-1, 3))
        residual = (shown.value - state.data.parts[k].reshape(-1, 3)).reshape(k.size, 9)
        by_attitude = (shown.by_true @ backward.reshape(-1, 3, 3) @ skew(up)).reshape(k.size, 3, 3, 3)
        by_node = np.zeros((k.size, 9, NODE))
        for part, at in enumerate((HEAD, MIDDLE, TAIL)):
            by_node[:, at, at] = by_attitude[:, part]
        by_border = u.columns(shown.by_blocks, 3).reshape(k.size, 9, -1)
        matrix = force_matrix(u)
        covariance = state.data.parts_covariance[k] + np.tile(
            state.noise["force"] * (matrix @ matrix.T), (3, 3)
        )
        by_bias = np.broadcast_to(np.tile(np.eye(3), (3, 1)), (k.size, 9, 3))
        active = state.taking_part["force"][k]
        return [Linear(residual, covariance, by_border, self.node, by_node, None, active, by_bias=by_bias)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return the weighted mean of the three parts, what the hold as a whole shows, and how they differ."""
        inverse = np.asarray(np.linalg.inv(linear.covariance), dtype=np.float64)
        weights = inverse.reshape(-1, 3, 3, 9).sum(axis=1)
        mean = np.asarray(np.linalg.inv(weights @ np.tile(np.eye(3), (3, 1))), dtype=np.float64) @ weights
        scale = np.sum(force_matrix(state.unknowns) ** 2, axis=1)
        return [View("force", mean, scale), View("parts", _APART)]

    def causes(self, state: RecordingState, linear: Linear) -> dict[str, AnyArray]:
        """Return what the bias wanders by, and the rest."""
        matrix = force_matrix(state.unknowns)
        wander = np.diag(state.data.base.force_floor) + state.noise["force"] * (matrix @ matrix.T)
        shared = np.broadcast_to(np.tile(wander, (3, 3)), linear.covariance.shape)
        return {FORCE_REST: linear.covariance - shared, FORCE_WANDER: shared}

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return that the bias of the whole hold is in all three parts."""
        assert linear.by_bias is not None
        wander = self.causes(state, linear)[FORCE_WANDER]
        return {FORCE_WANDER: Drift(*self.span(state.data), linear.by_bias, wander)}

    def bent(self, state: RecordingState, nodes: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Return what tilts take off gravity: half their square, by which a scale factor is too small."""
        up, matrix = np.array([0.0, 0.0, -state.site.gravity]), force_matrix(state.unknowns)
        backward = matrix @ np.swapaxes(self.section.C_wb, 2, 3)
        mean = np.zeros((self.place.size, 9))
        for at, first in enumerate((HEAD, MIDDLE, TAIL)):
            own = nodes[:, first, first]
            turned = 0.5 * (own - np.trace(own, axis1=1, axis2=2)[:, None, None] * np.eye(3)) @ up
            mean[:, first] = np.einsum("tij,tj->ti", backward[:, at], turned)
        # The three parts lean together, as far as it matters.
        tilts = nodes[:, MIDDLE, MIDDLE][:, :2, :2]
        share = 0.5 * np.sum(tilts**2, axis=(1, 2))
        along = np.concatenate([backward[:, at] @ up for at in range(3)], axis=1)
        covariance = share[:, None, None] * along[:, :, None] * along[:, None, :]
        return mean, covariance

    def directions(self, state: RecordingState) -> Table:
        """Return an error of the whole hold along each axis."""
        return np.tile(force_matrix(state.unknowns), (3, 1))


class Rate(HoldEquations):
    """The mean rate: ``w(C' Ω + sway / length, C' (0, 0, -g))`` less the mean."""

    kind = "rate"
    words = "hold", "the gyro's output at rest is off by {times}: did it really rest?"

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three residuals a hold, raw."""
        u, k, up = state.unknowns, self.place, np.array([0.0, 0.0, -state.site.gravity])
        C, earth = self.section.C_wb, self.section.earth_w
        backward = np.swapaxes(C[:, 0], 1, 2)
        length = np.maximum(state.data.length[k], 1e-9)[:, None]
        swayed = _swayed_from(C[:, 0], C[:, 2])
        shown = raw_rate(u, backward @ earth + swayed / length, backward @ up)
        matrix, by_rate = gyro_matrix(u), shown.by_true @ backward
        by_sway = by_rate / length[:, :, None]
        by_node = np.zeros((k.size, 3, NODE))
        by_node[:, :, HEAD] = by_rate @ skew(earth) - by_sway
        by_node[:, :, HEAD] += g_sensitivity(u) @ backward @ skew(up)
        by_node[:, :, TAIL] = by_sway
        by_border = u.columns(shown.by_blocks, 3)
        by_border[:, :, EARTH] = by_rate
        covariance = state.data.base.rate_covariance[k] + state.noise["rate"] * (matrix @ matrix.T)
        residual = shown.value - state.data.base.rate_mean[k]
        by_bias, active = np.broadcast_to(np.eye(3), (k.size, 3, 3)), state.taking_part["rate"][k]
        return [Linear(residual, covariance, by_border, self.node, by_node, None, active, by_bias=by_bias)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all three."""
        return [View("rate", None, np.sum(gyro_matrix(state.unknowns) ** 2, axis=1))]

    def causes(self, state: RecordingState, linear: Linear) -> dict[str, AnyArray]:
        """Return what the bias wanders by, and the rest."""
        matrix = gyro_matrix(state.unknowns)
        wander = state.data.rate_wander[self.place] + state.noise["rate"] * (matrix @ matrix.T)
        return {RATE_REST: linear.covariance - wander, RATE_WANDER: wander}

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return that the bias of a hold is in its mean rate."""
        assert linear.by_bias is not None
        matrix, floor = gyro_matrix(state.unknowns), np.diag(state.data.base.rate_floor)
        wander = np.minimum(state.data.rate_wander[self.place], floor)
        wander = wander + state.noise["rate"] * (matrix @ matrix.T)
        return {RATE_WANDER: Drift(*self.span(state.data), linear.by_bias, wander)}

    def directions(self, state: RecordingState) -> Table:
        """Return an error along each axis."""
        return gyro_matrix(state.unknowns)


class Swing(HoldEquations):
    """Where the gyros see the middle between head and tail: ``M_g (log(C_h' C_m) - s log(C_h' C_t))`` less that."""

    kind, cause = "swing", RATE_REST

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three residuals a hold, raw s."""
        u, k, swings, C = state.unknowns, self.place, state.data.swings, self.section.C_wb
        share, backward = swings.share[k, None], np.swapaxes(C[:, 0], 1, 2)
        middle, tail = np.split(
            _swayed_from(np.tile(C[:, 0], (2, 1, 1)), np.concatenate([C[:, 1], C[:, 2]])), 2
        )
        swung = middle - share * tail
        matrix = gyro_matrix(u)
        turns = matrix @ backward
        by_node = np.zeros((k.size, 3, NODE))
        by_node[:, :, MIDDLE] = turns
        by_node[:, :, TAIL] = -share[:, :, None] * turns
        by_node[:, :, HEAD] = (share[:, :, None] - 1.0) * turns
        covariance = swings.covariance[k] + LEAST_SWING * (matrix @ matrix.T)
        # Of milliradians, a gyro's scale factor takes nothing that counts.
        by_border = np.zeros((k.size, 3, 3 + u.free.size))
        residual = swung @ matrix.T - swings.value[k]
        # The swing is the gyros', as the rate is: without one neither counts.
        return [
            Linear(residual, covariance, by_border, self.node, by_node, None, state.taking_part["rate"][k])
        ]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all three."""
        return [View("swing")]


class Rest(HoldEquations):
    """That a hold rests: head, middle and tail differ by a sway of stated size."""

    kind, cause = "rest", SWAY

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return six residuals a hold, rad: from head to middle, and from middle to tail."""
        C, count = self.section.C_wb, self.place.size
        backward = np.swapaxes(C, 2, 3)
        by_node = np.zeros((count, 6, NODE))
        residual = _swayed_from(C[:, :2].reshape(-1, 3, 3), C[:, 1:].reshape(-1, 3, 3)).reshape(count, 6)
        for step in range(2):
            here, there = slice(3 * step, 3 * step + 3), slice(3 * step + 3, 3 * step + 6)
            by_node[:, here, here], by_node[:, here, there] = -backward[:, step], backward[:, step]
        covariance = state.noise.of_each("sway", self.place)[:, None, None] * np.eye(6)
        by_border = np.zeros((count, 6, 3 + state.unknowns.free.size))
        return [Linear(residual, covariance, by_border, self.node, by_node)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all six, however little checks them."""
        return [View("rest", least=0.0, pulled=True)]


def _swayed_from(before: Matrices, after: Matrices) -> Vectors:
    """Return (holds, 3) rad, the rotation from one attitude to another, in the first one's axes."""
    return rotation_vectors_from_matrices(np.swapaxes(before, 1, 2) @ after)
