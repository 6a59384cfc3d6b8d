"""The steps of a protocol aligned with what was found, in order, with gaps on both sides and with repetitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Table, Vectors
from tumble.protocol.steps import HoldStep, Protocol, SpinStep
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.events import (
    GAP,
    Event,
    Reading,
    RoughScale,
    common_rate_scale,
    costs_of,
    gaps_of,
    pose_of,
    scale_of_poses,
    scale_of_sphere,
    scale_of_units,
)
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.timeline import Timeline
from tumble.units import angular_rate_factor, specific_force_factor

# Start of the search for a centre from the poses alone: how many holds too many or too few come first.
FIRST_SHIFTS = (0, 1, -1, 2, -2)


def align(
    cost: Table, left_out: Series, skipped: Series, again: Table
) -> tuple[list[tuple[int, int]], float]:
    """Return the cheapest pairs of (step, event) that keep the order of both, and the sum of all costs.

    A step that was done again has several pairs.

    Dynamic programming (Needleman and Wunsch, J. Mol. Biol. 48 (1970) 443) with one addition: an event
    may repeat the step of an earlier event, if only left-out events lie between.

    Parameters
    ----------
    cost : (steps, events) of the event being the step; infinite where it cannot be.
    left_out : (events,) cost of an event that is no step.
    skipped : (steps,) cost of a step that has no event.
    again : (steps, events) cost, on top, of the event repeating the step; infinite to forbid it.
    """
    steps, events = cost.shape
    inf = float("inf")
    costs, more = cost.tolist(), again.tolist()
    omit = [*left_out.tolist()]
    # best[i][j]: first i steps with first j events; held[i][j]: the same with step i - 1 begun
    best = [[0.0] * (events + 1) for _ in range(steps + 1)]
    held = [[inf] * (events + 1) for _ in range(steps + 1)]
    # how each was come by: best by 's'kip, 'o'mit, or 'h'eld; held by 'm'atch, 'a'gain, or 'o'mit
    how_best = [["h"] * (events + 1) for _ in range(steps + 1)]
    how_held = [["m"] * (events + 1) for _ in range(steps + 1)]
    for j in range(1, events + 1):
        best[0][j], how_best[0][j] = best[0][j - 1] + omit[j - 1], "o"
    for i in range(1, steps + 1):
        row, row_more, skip = costs[i - 1], more[i - 1], float(skipped[i - 1])
        best[i][0], how_best[i][0] = best[i - 1][0] + skip, "s"
        for j in range(1, events + 1):
            match = row[j - 1]
            cheapest, how = best[i - 1][j - 1] + match, "m"
            repeated = held[i][j - 1] + match + row_more[j - 1]
            if repeated < cheapest:
                cheapest, how = repeated, "a"
            omitted = held[i][j - 1] + omit[j - 1]
            if omitted < cheapest:
                cheapest, how = omitted, "o"
            held[i][j], how_held[i][j] = cheapest, how
            how = "h"
            if best[i - 1][j] + skip < cheapest:
                cheapest, how = best[i - 1][j] + skip, "s"
            if best[i][j - 1] + omit[j - 1] < cheapest:
                cheapest, how = best[i][j - 1] + omit[j - 1], "o"
            best[i][j], how_best[i][j] = cheapest, how
    return _traced(how_best, how_held, steps, events), best[steps][events]


def _traced(how_best: list[list[str]], how_held: list[list[str]], i: int, j: int) -> list[tuple[int, int]]:
    """The pairs on the cheapest way, in order."""
    pairs: list[tuple[int, int]] = []
    inside = False
    while i > 0 or j > 0:
        if not inside:
            way = how_best[i][j]
            if way == "s":
                i -= 1
            elif way == "o":
                j -= 1
            else:
                inside = True
            continue
        way = how_held[i][j]
        j -= 1
        if way != "o":
            pairs.append((i - 1, j))
        if way == "m":
            i, inside = i - 1, False
    return pairs[::-1]


def signed_permutations() -> list[np.ndarray]:
    """Return the 48 matrices that swap and reverse axes, the identity first, the likelier ones before others.

    A single reversed axis is likelier than a swap, and a swap than both.
    """
    from itertools import permutations, product

    matrices = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return sorted(matrices, key=lambda m: (float(np.trace(np.abs(m))) != 3.0, int(np.sum(m < 0))))


@dataclass(frozen=True, slots=True)
class Fit:
    """Which event is which step, in order.

    `pairs` are (step, event); a step that was done again has several. `cost` is the sum of all costs, `reading` how raw
    numbers were taken.
    """

    pairs: list[tuple[int, int]]
    cost: float
    reading: Reading

    def steps(self) -> set[int]:
        """Return the steps that have an event."""
        return {step for step, _ in self.pairs}


@dataclass(frozen=True, slots=True)
class Case:
    """A protocol beside what was found: what every question about their likeness needs.

    `steps` are the indices of the protocol's holds and spins in the order expected.
    """

    protocol: Protocol
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    steps: list[int]
    events: list[Event]

    def fit(self) -> Fit:
        """Return the best alignment, whatever centre and scale the accelerometer has."""
        reading = Reading(self.means.specific_force, None, np.eye(3), self.rate_scale())
        fits = [self._settled(replace(reading, scale=scale)) for scale in self.scales(reading.specific_force)]
        return min(fits, key=lambda fit: fit.cost)

    def only(self, kind: type[HoldStep] | type[SpinStep]) -> Case:
        """Return the same with the holds alone, or the spins alone.

        Parameters
        ----------
        kind : of step.
        """
        steps = [number for number in self.steps if isinstance(self.protocol.steps[number], kind)]
        return replace(
            self, steps=steps, events=[e for e in self.events if (e.hold is not None) == (kind is HoldStep)]
        )

    def rate_scale(self) -> float | None:
        """Return the raw units per rad/s of the gyro that the spins show; None without spins."""
        factor = angular_rate_factor(self.recording.angular_rate_unit)
        return common_rate_scale(self.protocol, self.events, None if factor is None else 1.0 / factor)

    def name(self, i: int) -> str:
        """Return step `i` of `steps` as the user knows it, such as ``4 (x down)``.

        Parameters
        ----------
        i : index into `steps`.
        """
        number = self.steps[i]
        words = self.protocol.steps[number].name
        return f"{number + 1} ({words})" if words else f"{number + 1}"

    def scales(self, force: Vectors | None) -> list[RoughScale | None]:
        """Return centres and scales of the accelerometer to begin with.

        Parameters
        ----------
        force : (holds, 3) raw means; None without an accelerometer.
        """
        if force is None:
            return [None]
        if specific_force_factor(self.recording.specific_force_unit) is not None:
            return [scale_of_units(force)]
        sphere = scale_of_sphere(force)
        if sphere is not None:
            return [sphere]
        posed = [pose.up_b for i in self.steps if (pose := pose_of(self.protocol.steps[i])) is not None]
        scales: list[RoughScale | None] = []
        for shift in FIRST_SHIFTS:
            first_hold, first_pose = max(shift, 0), max(-shift, 0)
            count = min(len(force) - first_hold, len(posed) - first_pose)
            if count >= 2:
                raw, up_b = force[first_hold:][:count], np.array(posed[first_pose:][:count])
                scales.append(scale_of_poses(raw, up_b))
        return [scale for scale in scales if scale is not None] or [scale_of_units(force)]

    def _settled(self, reading: Reading) -> Fit:
        """Align, find the scale from what was aligned, and align again until nothing changes."""
        fit = self.aligned(reading)
        for _ in range(4):
            scale = self._scale_from(fit)
            if scale is None:
                break
            better = self.aligned(replace(reading, scale=scale))
            if better.cost >= fit.cost:
                break
            fit = better
        return fit

    def aligned(self, reading: Reading) -> Fit:
        """Return the best alignment under a reading of the raw numbers.

        Parameters
        ----------
        reading : scales and axes.
        """
        cost, again = costs_of(self.protocol, self.steps, self.events, reading, self.recording)
        gaps = gaps_of(self.events, self.timeline.holds)
        return Fit(*align(cost, gaps, np.full(len(self.steps), GAP), again), reading)

    def _scale_from(self, fit: Fit) -> RoughScale | None:
        rows: list[int] = []
        up_b: list[np.ndarray] = []
        for i, k in fit.pairs:
            step, hold = self.protocol.steps[self.steps[i]], self.events[k].hold
            if isinstance(step, HoldStep) and step.pose is not None and hold is not None:
                rows.append(hold)
                up_b.append(step.pose.up_b)
        if fit.reading.specific_force is None or not rows:
            return None
        return scale_of_poses(fit.reading.specific_force[rows], np.array(up_b))
