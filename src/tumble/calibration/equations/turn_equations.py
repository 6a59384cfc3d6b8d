"""A hand turn from one hold to the next: what the gyros carry, against the attitudes at both ends.

The gyros' integral carries the tail of one hold to the head of the next, while the level frame turns with the Earth:
``r = log(exp(-[Ω T]) C_start C_se C_end')``.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vector, Vectors, inverted
from tumble.attitude import (
    Inverse,
    integrate_turns,
    matrices_from_rotation_vectors,
    rotation_vectors_from_matrices,
)
from tumble.calibration.equations.causes import RATE_TURNING, RATE_WANDER, TURNS
from tumble.calibration.equations.imu_unknowns import (
    force_matrix,
    g_sensitivity,
    gyro_matrix,
    straightened,
)
from tumble.calibration.equations.observed import Observed
from tumble.calibration.equations.state import EARTH, HEAD, NODE, TAIL, RecordingState, Section
from tumble.calibration.terms import TERMS
from tumble.calibration.terms.term import curves_of
from tumble.estimation import Drift, Equations, Linear, Unknowns, View
from tumble.records import dataclass


@dataclass(frozen=True)
class Link:
    """Integrals of the gyros over stretches of samples, from start s to end e.

    Attributes
    ----------
    C_se : (links, 3, 3).
    sums : (links, 3, 3, 7) see `integrate_turns`.
    duration : (links,) s.
    magnitudes : block -> (links, 3, 3, 3), the integral of the rotation to the start times what each gyro's curve
        makes of its own input; of the curves that are adjusted.
    """

    C_se: Matrices
    sums: AnyArray
    duration: Series
    magnitudes: dict[str, AnyArray]


def integrate_links(data: Observed, u: Unknowns, starts: np.ndarray, stops: np.ndarray) -> Link:
    """Return the gyros' integrals over sample ranges.

    Parameters
    ----------
    data, u : samples, and where the unknowns are.
    starts, stops : (links,) half-open ranges.
    """
    time, rate, force = data.base.time, data.base.raw_rate, data.base.raw_force
    curves = curves_of(TERMS, "gyroscope")
    if any(u.is_free(name) or np.any(u[name]) for name, _ in curves):
        # Of the samples of the ranges alone: what they would be without is computed of each.
        pieces = [slice(*ends) for ends in zip(starts.tolist(), stops.tolist(), strict=True)]
        time, rate, force = (np.concatenate([of[piece] for piece in pieces]) for of in (time, rate, force))
        stops = np.cumsum(stops - starts)
        starts = np.concatenate([[0], stops[:-1]])
        rate = straightened(u, rate)
    # Over true time, which the clock's stamps are of up to its own rate.
    faster = 1.0 + float(u["clock"][0])
    gyro, bias = faster * inverted(gyro_matrix(u)), u["gyro.bias"]
    inverse = Inverse(gyro, bias, inverted(force_matrix(u)), u["force.bias"], g_sensitivity(u))
    made = integrate_turns(time, rate, force, starts, stops, inverse)

    def summed(inputs: Vectors) -> AnyArray:
        return integrate_turns(time, rate, inputs, starts, stops, Inverse(gyro, bias)).sums[..., 4:7]

    magnitudes = {name: summed(curve.of(rate - bias)) for name, curve in curves if u.is_free(name)}
    return Link(made.C_start_end, made.sums, faster * made.duration, magnitudes)


@dataclass(frozen=True)
class LinkResiduals:
    """Residuals of links (links, 3), rad in w, with their derivatives.

    Attributes
    ----------
    value : (links, 3).
    by_start, by_end : (links, 3, 3) by the attitudes of both ends.
    by_earth : (links, 3, 3).
    by_blocks : block -> (links, 3, unknowns).
    """

    value: Vectors
    by_start: AnyArray
    by_end: AnyArray
    by_earth: AnyArray
    by_blocks: dict[str, AnyArray]


def link_residuals(
    C_start: Matrices, C_end: Matrices, earth_w: Vector, link: Link, u: Unknowns
) -> LinkResiduals:
    """Return what the gyros carry, against the attitudes of both ends.

    Parameters
    ----------
    C_start, C_end : (links, 3, 3) attitudes of the nodes.
    earth_w : (3,) rad/s.
    link : what the gyros carry.
    u : where the unknowns are.

    Notes
    -----
    A rate error ``E x(t)`` turns C_se by ``sums[..., j] E[:, j]`` in the start frame.
    """
    count, faster = len(C_start), 1.0 + float(u["clock"][0])
    earth = matrices_from_rotation_vectors(-link.duration[:, None] * earth_w)
    residual = rotation_vectors_from_matrices(earth @ C_start @ link.C_se @ np.swapaxes(C_end, 1, 2))
    inverse, outer = inverted(gyro_matrix(u)), earth @ C_start
    moves = (outer @ (inverse.T @ link.sums).reshape(count, 3, -1)).reshape(count, 3, 3, -1)
    blocks: dict[str, AnyArray] = {
        "gyro.matrix": -moves[..., 0:3].reshape(count, 3, 9),
        "gyro.bias": -faster * moves[..., 3],
        "gyro.g_sensitivity": -faster * moves[..., 4:7].reshape(count, 3, 9),
    }
    for name, sums in link.magnitudes.items():
        blocks[name] = -faster * np.einsum("tab,tbcj,cj->taj", outer, sums, inverse)
    if u.is_free("clock"):
        turned = np.einsum("tab,tbcc->ta", outer, link.sums[..., :3]) - link.duration[:, None] * earth_w
        blocks["clock"] = (turned / faster)[:, :, None]
    by_earth = -link.duration[:, None, None] * np.eye(3)
    by_end = np.broadcast_to(-np.eye(3), (count, 3, 3))
    return LinkResiduals(residual, earth, by_end, by_earth, blocks)


def link_covariance(
    data: Observed,
    C_start: Matrices,
    link: Link,
    u: Unknowns,
    more: Series,
    timing: Vectors | None = None,
) -> Matrices:
    """Return (links, 3, 3) rad² in w: angle random walk.

    Parameters
    ----------
    data : noise of the gyros.
    C_start, link, u : as for `link_residuals`.
    more : (links,) s for which the random walk acts beyond the link itself.
    timing : (links, 3) raw² s², what the sampling does to the integral; None for nothing.
    """
    inverse = inverted(gyro_matrix(u))
    variance = (link.duration + more)[:, None] * data.base.rate_random_walk
    if timing is not None:
        variance = variance + timing
    white = (inverse * variance[:, None, :]) @ inverse.T
    C_middle = 0.5 * (C_start + C_start @ link.C_se)
    # the mean of both ends' axes, and what of the variance their difference leaves over
    own = C_middle @ white @ np.swapaxes(C_middle, 1, 2)
    lost = np.trace(white, axis1=1, axis2=2) - np.trace(own, axis1=1, axis2=2)
    return own + (lost / 3.0)[:, None, None] * np.eye(3)


def bias_variance(state: RecordingState) -> float:
    """Return by how much the gyros' biases wander from hold to hold and turn to turn, (rad/s)².

    Parameters
    ----------
    state : noise, and the floor seen in holds, of which this is the mean over the axes.
    """
    inverse = inverted(gyro_matrix(state.unknowns))
    floor = float(np.trace((inverse * state.data.base.rate_floor) @ inverse.T)) / 3.0
    return floor + state.noise["rate"]


def edge_seconds(data: Observed, k: np.ndarray) -> tuple[Series, Series]:
    """Return for how long the random walk acts between the parts' means and the edges, s: a third of each.

    Parameters
    ----------
    data, k : samples, and the holds before.
    """
    base = data.base
    step = (base.time[-1] - base.time[0]) / max(base.time.shape[0] - 1, 1)
    tail, head = base.tail[k], base.head[k + 1]
    return (tail[:, 1] - tail[:, 0]) * step / 3.0, (head[:, 1] - head[:, 0]) * step / 3.0


class Turn(Equations):
    """Of all turns of a section that no table made.

    Attributes
    ----------
    given : what the gyros carry, where it is known already; None to integrate it.
    """

    kind = "turn"
    words = "turn", "gravity carried by the gyro ends {angle}, {times}"
    given: Link | None = None

    def __init__(self, section: Section, place: np.ndarray) -> None:
        self.section = section
        self.place = place
        self.node = place - section.first
        self.duration = np.zeros(place.size)

    def integrated(self, state: RecordingState) -> Link:
        """Return what the gyros carry over each turn."""
        base, k = state.data.base, self.place
        return integrate_links(state.data, state.unknowns, base.turn_start[k], base.turn_stop[k])

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three residuals a turn, rad in w."""
        k, u, data = self.place, state.unknowns, state.data
        tail, head = self.section.C_wb[self.node, 2], self.section.C_wb[self.node + 1, 0]
        link = self.given or self.integrated(state)
        self.duration = link.duration
        shown = link_residuals(tail, head, self.section.earth_w, link, u)
        by_node, by_next = np.zeros((k.size, 3, NODE)), np.zeros((k.size, 3, NODE))
        by_node[:, :, TAIL], by_next[:, :, HEAD] = shown.by_start, shown.by_end
        by_border = u.columns(shown.by_blocks, 3)
        by_border[:, :, EARTH] = shown.by_earth
        edge = np.add(*edge_seconds(data, k))
        timing = None if data.base.turn_sampling is None else data.base.turn_sampling[k]
        covariance = link_covariance(data, tail, link, u, edge, timing)
        wander = state.noise["turn"] + bias_variance(state) * link.duration**2
        covariance = covariance + wander[:, None, None] * np.eye(3)
        active = state.taking_part["turn"][k]
        # A turn that is left out leaves a heading that is known as many times as it is unknown.
        counted = 3 * int(np.count_nonzero(active)) + int(np.count_nonzero(~active))
        return [
            Linear(
                shown.value,
                covariance,
                by_border,
                self.node,
                by_node,
                by_next,
                active,
                counted,
                shown.by_blocks["gyro.bias"],
            )
        ]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all three."""
        return [View("turn")]

    def causes(self, state: RecordingState, linear: Linear) -> dict[str, AnyArray]:
        """Return what the bias wanders by, what is beyond noise, and the rest."""
        wander = (bias_variance(state) * self.duration**2)[:, None, None] * np.eye(3)
        beyond = np.broadcast_to(state.noise["turn"] * np.eye(3), wander.shape)
        return {RATE_TURNING: linear.covariance - (wander + beyond), RATE_WANDER: wander, TURNS: beyond}

    def drifts(self, state: RecordingState, linear: Linear, first: int) -> dict[str, Drift]:
        """Return that the bias turns the attitude on."""
        assert linear.by_bias is not None
        base, k = state.data.base, self.place
        start, stop = base.time[base.turn_start[k]], base.time[base.turn_stop[k] - 1]
        return {RATE_WANDER: Drift(start, stop, linear.by_bias, self.causes(state, linear)[RATE_WANDER])}

    def directions(self, state: RecordingState) -> AnyArray:
        """Return an error about each axis."""
        return np.eye(3)
