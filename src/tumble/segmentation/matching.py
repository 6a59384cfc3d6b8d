"""Matching: which hold and which spin of a recording is which step of the protocol.

Holds are told by which way is up, spins by axis, direction and rate. Both are aligned with the steps in
order of time by dynamic programming, where a step may be missing, done again, or something else come in
between; each of these is said. Raw units need not be known: a centre and a scale of the accelerometer
are found on the way, from the units, from the sphere of all holds, or from the poses themselves.
"""

from __future__ import annotations

from dataclasses import field, replace
from itertools import pairwise

import numpy as np

from tumble.arrays import Vectors
from tumble.protocol.steps import HoldStep, Protocol, SpinStep, TurnStep
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.alignment import Alignment, align
from tumble.segmentation.events import (
    GAP,
    Event,
    Reading,
    angles_from,
    common_rate_scale,
    costs_of,
    find_events,
    gaps_of,
    pose_of,
)
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.rough_directions import (
    RoughScale,
    scale_of_poses,
    scale_of_sphere,
    scale_of_units,
)
from tumble.segmentation.spin_means import SpinMeans, observe_spins, whole_revolutions
from tumble.segmentation.timeline import Timeline
from tumble.units import angular_rate_factor, specific_force_factor

# Two holds of one step are both used if their directions agree this well (or three of the pose's sigma).
SAME_HOLD = np.radians(0.5)
# Where turns follow one another without a hold, a rest shorter than this share of the shortest hold is a pause.
PAUSE = 0.5
FIXTURE_PROCEDURE = "strapdown-rotation"
# Start of the search for a centre from the poses alone: how many holds too many or too few come first.
FIRST_SHIFTS = (0, 1, -1, 2, -2)


@dataclass(frozen=True, slots=True)
class MatchedHold:
    """Hold number `hold` of the timeline is step number `step` of the protocol, both from 0."""

    step: int
    hold: int


@dataclass(frozen=True, slots=True)
class MatchedSpin:
    """Samples `start` up to `stop` are step number `step` of the protocol: whole revolutions, if one is."""

    step: int
    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class Matching:
    """Which hold and spin is which step.

    Attributes
    ----------
    holds, spins : in order of time; a step that was done twice may be there twice.
    missing : indices of the holds and spins of the protocol that were not found.
    extra : indices of the timeline's holds that are no step.
    remarks : sentences for the user; none where everything was as the protocol says.
    """

    holds: tuple[MatchedHold, ...]
    spins: tuple[MatchedSpin, ...]
    missing: tuple[int, ...]
    extra: tuple[int, ...]
    remarks: list[str] = field(default_factory=list[str])


@dataclass(frozen=True, slots=True)
class Fit:
    """An alignment and the reading of raw numbers under which it was found."""

    alignment: Alignment
    reading: Reading


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
        return min(fits, key=lambda fit: fit.alignment.cost)

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
            if better.alignment.cost >= fit.alignment.cost:
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
        return Fit(align(cost, gaps, np.full(len(self.steps), GAP), again), reading)

    def _scale_from(self, fit: Fit) -> RoughScale | None:
        rows: list[int] = []
        up_b: list[np.ndarray] = []
        for i, k in fit.alignment.pairs:
            step, hold = self.protocol.steps[self.steps[i]], self.events[k].hold
            if isinstance(step, HoldStep) and step.pose is not None and hold is not None:
                rows.append(hold)
                up_b.append(step.pose.up_b)
        if fit.reading.specific_force is None or not rows:
            return None
        return scale_of_poses(fit.reading.specific_force[rows], np.array(up_b))


def match_protocol(
    protocol: Protocol, recording: Recording, timeline: Timeline, means: HoldMeans
) -> Matching:
    """Find which hold and which spin is which step of the protocol.

    Parameters
    ----------
    protocol : what was to be done. A step's interval, on the recording's clock, is where alone it is
        looked for.
    recording, timeline, means : what was recorded, and the holds found in it. Without a gyro spins cannot
        be found, without an accelerometer poses cannot be told: then what is left is matched.

    Raises
    ------
    SegmentationError
        If the recording is not of this protocol: too little of it fits, spins go the other way round or
        at another rate, or axes are swapped. The message says what the recording looks like.
    """
    from tumble.segmentation import mismatch
    from tumble.segmentation.matching_words import remarks_of

    case = _open_case(protocol, recording, timeline, means)
    mismatch.refuse_without_spins(case)
    mismatch.refuse_wrong_units(case)
    fit = case.fit()
    mismatch.refuse_misfit(case, fit)
    chosen = _chosen(case, fit)
    mismatch.refuse_reversed_turns(case, chosen)
    matched = {case.steps[i] for i, _ in chosen}
    used = {k for _, k in chosen}
    holds: list[MatchedHold] = []
    spins: list[MatchedSpin] = []
    for i, k in sorted(chosen, key=lambda pair: pair[1]):
        event, number = case.events[k], case.steps[i]
        if event.hold is not None:
            holds.append(MatchedHold(number, event.hold))
        else:
            step = protocol.steps[number]
            assert isinstance(step, SpinStep)
            period = 2.0 * np.pi / abs(step.rate)
            spins.append(MatchedSpin(number, *whole_revolutions(recording, event.start, event.stop, period)))
    return Matching(
        holds=tuple(holds),
        spins=tuple(spins),
        missing=tuple(
            number
            for number, step in enumerate(protocol.steps)
            if isinstance(step, HoldStep | SpinStep) and number not in matched
        ),
        extra=tuple(e.hold for k, e in enumerate(case.events) if e.hold is not None and k not in used),
        remarks=remarks_of(case, fit, chosen),
    )


def _open_case(protocol: Protocol, recording: Recording, timeline: Timeline, means: HoldMeans) -> Case:
    """Return the protocol's holds and spins in the order expected, beside what was found."""
    steps = [i for i, step in enumerate(protocol.steps) if isinstance(step, HoldStep | SpinStep)]
    if recording.angular_rate is None:
        steps = [i for i in steps if _is_told_without_gyro(protocol, i)]
    key = -np.inf
    keys: list[float] = []
    for number in steps:
        interval = protocol.steps[number].interval
        key = key if interval is None else interval[0]
        keys.append(key)
    ordered = [number for _, number in sorted(zip(keys, steps, strict=True), key=lambda pair: pair[0])]
    events = find_events(protocol, recording, timeline, means)
    least = _shortest_hold(protocol)
    events = [e for e in events if e.hold is None or means.duration[e.hold] >= least]
    return Case(protocol, recording, timeline, means, ordered, events)


def _shortest_hold(protocol: Protocol) -> float:
    """Return the seconds below which a rest is no step: a pause between two turns that follow one another."""
    chained = protocol.procedure == FIXTURE_PROCEDURE or any(
        isinstance(one, TurnStep) and isinstance(other, TurnStep) for one, other in pairwise(protocol.steps)
    )
    if not chained:
        return 0.0
    return PAUSE * min(step.duration for step in protocol.steps if isinstance(step, HoldStep))


def _is_told_without_gyro(protocol: Protocol, number: int) -> bool:
    """Whether a step is a hold that the accelerometer can tell from the one before it."""
    if not isinstance(protocol.steps[number], HoldStep):
        return False
    before = number - 1
    while before >= 0 and isinstance(step := protocol.steps[before], SpinStep) and step.axis_b is None:
        before -= 1
    # a spin about the vertical leaves the specific force as it is
    return before in (number - 1, -1) or not isinstance(protocol.steps[before], HoldStep)


def _chosen(case: Case, fit: Fit) -> list[tuple[int, int]]:
    """The pairs to be used: of a step done again in another pose the longest, no saturated spins."""
    by_step: dict[int, list[int]] = {}
    for i, k in fit.alignment.pairs:
        spin = case.events[k].spin
        if spin is None or spin.usable:
            by_step.setdefault(i, []).append(k)
    up_b = fit.reading.up_b()
    chosen: list[tuple[int, int]] = []
    for i, events in by_step.items():
        if len(events) > 1 and not _agree(case, i, events, up_b):
            events = [max(events, key=lambda k: case.events[k].stop - case.events[k].start)]
        chosen += [(i, k) for k in events]
    return chosen


def _agree(case: Case, i: int, events: list[int], up_b: Vectors | None) -> bool:
    """Whether what repeats a step was done alike."""
    step = case.protocol.steps[case.steps[i]]
    rows = [hold for k in events if (hold := case.events[k].hold) is not None]
    if not isinstance(step, HoldStep) or up_b is None or not rows:
        return True
    sigma = 0.0 if step.pose is None else step.pose.sigma
    return bool(np.all(angles_from(up_b[rows], up_b[rows[0]]) <= max(SAME_HOLD, 3.0 * sigma)))


def observe_matched_spins(
    protocol: Protocol, recording: Recording, timeline: Timeline, matching: Matching
) -> SpinMeans:
    """Average each matched spin over whole revolutions at the protocol's rate; rows follow `matching.spins`.

    Parameters
    ----------
    protocol, recording, timeline, matching : what was to be done, and what was found of it.

    Raises
    ------
    SegmentationError
        If no spin was matched.
    """
    periods: list[float] = []
    for spin in matching.spins:
        step = protocol.steps[spin.step]
        assert isinstance(step, SpinStep)
        periods.append(2.0 * np.pi / abs(step.rate))
    return observe_spins(recording, matching.spins, periods)
