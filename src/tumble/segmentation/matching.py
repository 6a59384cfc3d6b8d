"""Matching: which hold and which spin of a recording is which step of the protocol.

Holds are told by which way is up, spins by axis, direction and rate. Both are aligned with the steps in
order of time by dynamic programming, where a step may be missing, done again, or something else come in
between; each of these is said. Raw units need not be known: a centre and a scale of the accelerometer
are found on the way, from the units, from the sphere of all holds, or from the poses themselves.
"""

from __future__ import annotations

from dataclasses import field
from itertools import pairwise

import numpy as np

from tumble.arrays import Vectors
from tumble.protocol import HoldStep, Protocol, SpinStep, TurnStep
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import mismatch
from tumble.segmentation.alignment import (
    POSE_FLOOR,
    Case,
    Event,
    Fit,
    angles_from,
    find_events,
    pose_of,
    spin_axis,
)
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.spin_means import SpinMeans, observe_spins, whole_revolutions
from tumble.segmentation.timeline import Timeline
from tumble.units import angular_rate_factor

# Two holds of one step are both used if their directions agree this well (or three of the pose's sigma).
SAME_HOLD = np.radians(0.5)
# Where turns follow one another without a hold, a rest shorter than this share of the shortest hold is a pause.
PAUSE = 0.5
FIXTURE_PROCEDURE = "strapdown-rotation"
# Of one kind, so many sentences; the others are counted.
MOST_SENTENCES = 8


@dataclass(frozen=True)
class MatchedHold:
    """Hold number `hold` of the timeline is step number `step` of the protocol, both from 0."""

    step: int
    hold: int


@dataclass(frozen=True)
class MatchedSpin:
    """Samples `start` up to `stop` are step number `step` of the protocol: whole revolutions, if one is."""

    step: int
    start: int
    stop: int


@dataclass(frozen=True)
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
            whole = whole_revolutions(recording, event.start, event.stop, step.period)
            spins.append(MatchedSpin(number, *whole))
    return Matching(
        holds=tuple(holds),
        spins=tuple(spins),
        missing=tuple(
            number
            for number, step in enumerate(protocol.steps)
            if isinstance(step, HoldStep | SpinStep) and number not in matched
        ),
        extra=tuple(e.hold for k, e in enumerate(case.events) if e.hold is not None and k not in used),
        remarks=_remarks_of(case, fit, chosen),
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
    for i, k in fit.pairs:
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


def observe_matched_spins(protocol: Protocol, recording: Recording, matching: Matching) -> SpinMeans:
    """Average each matched spin over whole revolutions at the protocol's rate; rows follow `matching.spins`.

    Parameters
    ----------
    protocol, recording, matching : what was to be done, and what was found of it.

    Raises
    ------
    SegmentationError
        If no spin was matched.
    """
    steps = [protocol.steps[spin.step] for spin in matching.spins]
    periods = [step.period for step in steps if isinstance(step, SpinStep)]
    return observe_spins(recording, [(spin.start, spin.stop) for spin in matching.spins], periods)


def _remarks_of(case: Case, fit: Fit, chosen: list[tuple[int, int]]) -> list[str]:
    """Return sentences on all that is not as the protocol says; none where everything is."""
    instead = _spins_instead(case, fit)
    return [
        *_about_triads(case),
        *_shortened(_missing(case, fit, instead), "more steps were not found."),
        *_shortened(_again(case, fit, chosen), "more steps were done more than once."),
        *_shortened(
            _extra(case, fit, instead), "more holds and spins are not in the protocol and were left out."
        ),
        *_reversed_turns(case, chosen),
    ]


def _shortened(sentences: list[str], rest: str) -> list[str]:
    if len(sentences) <= MOST_SENTENCES:
        return sentences
    return [*sentences[: MOST_SENTENCES - 1], f"{len(sentences) - MOST_SENTENCES + 1} {rest}"]


def _about_triads(case: Case) -> list[str]:
    spins = sum(isinstance(step, SpinStep) for step in case.protocol.steps)
    remarks: list[str] = []
    if case.recording.angular_rate is None and spins:
        remarks.append(
            f"The recording has no gyro: the protocol's {spins} spins cannot be seen in it, nor the "
            "holds before and after a spin be separated."
        )
    if case.means.specific_force is None:
        remarks.append(
            "The recording has no accelerometer: its holds were taken for the protocol's in order, whatever their pose."
        )
    return remarks


def _spins_instead(case: Case, fit: Fit) -> dict[int, int]:
    """The event that stands where a spin is missing, by its place in `case.steps`: at another rate, most likely."""
    matched, used = fit.steps(), {k for _, k in fit.pairs}
    gaps: dict[tuple[int, int], list[int]] = {}
    for i, number in enumerate(case.steps):
        if i not in matched and isinstance(case.protocol.steps[number], SpinStep):
            before = max((k for other, k in fit.pairs if other < i), default=-1)
            after = min((k for other, k in fit.pairs if other > i), default=len(case.events))
            gaps.setdefault((before, after), []).append(i)
    instead: dict[int, int] = {}
    for (before, after), missing in gaps.items():
        there = [
            k
            for k in range(before + 1, after)
            if k not in used and (spin := case.events[k].spin) is not None and spin.usable
        ]
        if len(there) == len(missing):
            instead |= dict(zip(missing, there, strict=True))
    return instead


def _spin_not_found(case: Case, fit: Fit, i: int, event: Event | None, where: str) -> str:
    step = case.protocol.steps[case.steps[i]]
    assert isinstance(step, SpinStep)
    stated = f"{np.degrees(step.rate):.4g}°/s"
    declared = angular_rate_factor(case.recording.angular_rate_unit)
    scale = fit.reading.rate_scale if declared is None else 1.0 / declared
    if event is None or event.rate is None or scale is None:
        return f"Step {case.name(i)}, a spin at {stated}, was not found{where}."
    axis_b = spin_axis(case.protocol, case.steps[i], event, fit.reading.up_b())
    shown = float(np.linalg.norm(event.rate)) / scale
    if axis_b is not None:
        shown = float(np.copysign(shown, event.rate @ axis_b))
    return (
        f"Step {case.name(i)} was left out: it states {stated}, and the gyro showed {np.degrees(shown):.4g}°/s "
        f"at {_span(case, event)}."
    )


def _missing(case: Case, fit: Fit, instead: dict[int, int]) -> list[str]:
    found = fit.steps()
    events = dict(fit.pairs)
    remarks: list[str] = []
    for i, number in enumerate(case.steps):
        interval = case.protocol.steps[number].interval
        spin = case.events[events[i]].spin if i in found else None
        if spin is not None and not spin.usable:
            remarks.append(f"Step {case.name(i)} was left out: {spin.reason}.")
        elif i not in found:
            where = "" if interval is None else f" between {interval[0]:.4g} and {interval[1]:.4g} s"
            if isinstance(case.protocol.steps[number], SpinStep):
                event = case.events[instead[i]] if i in instead else None
                remarks.append(_spin_not_found(case, fit, i, event, where))
            else:
                remarks.append(f"Step {case.name(i)} was not found{where}.")
    return remarks


def _again(case: Case, fit: Fit, chosen: list[tuple[int, int]]) -> list[str]:
    remarks: list[str] = []
    for i in sorted(fit.steps()):
        times = sum(step == i for step, _ in fit.pairs)
        used = sum(step == i for step, _ in chosen)
        if times > 1 and used:
            how = (
                "both are used"
                if times == used == 2
                else "all are used"
                if times == used
                else "the longest is used"
            )
            often = "twice" if times == 2 else f"{times} times"
            remarks.append(f"Step {case.name(i)} was done {often}: {how}.")
    return remarks


def _extra(case: Case, fit: Fit, instead: dict[int, int]) -> list[str]:
    used = {k: i for i, k in fit.pairs}
    remarks: list[str] = []
    for k, event in enumerate(case.events):
        if (
            k in used
            or k in instead.values()
            or _is_rest_beside_spin(case, k, used)
            or _is_turn(case, k, used)
        ):
            continue
        kind = "hold" if event.hold is not None else "spin"
        if event.spin is not None and not event.spin.usable:
            # Its rate is cut off, so that it looks like no step: the reason comes first.
            remarks.append(f"The spin at {_span(case, event)} was left out: {event.spin.reason}.")
            continue
        remarks.append(
            f"The {kind} at {_span(case, event)} is not in the protocol{_likeness(case, fit, event)} and was left out."
        )
    return remarks


def _span(case: Case, event: Event) -> str:
    time = case.recording.time
    return f"{time[event.start] - time[0]:.0f}–{time[event.stop - 1] - time[0]:.0f} s"


def _is_rest_beside_spin(case: Case, k: int, used: dict[int, int]) -> bool:
    """Whether a hold is the rest before or after a spin, which no protocol has to name."""
    if case.events[k].hold is None:
        return False
    for neighbour, side in ((k - 1, 1), (k + 1, -1)):
        if neighbour not in used or case.events[neighbour].spin is None:
            continue
        number = case.steps[used[neighbour]] + side
        if not 0 <= number < len(case.protocol.steps):
            return True
        if not isinstance(case.protocol.steps[number], HoldStep):
            return True
    return False


def _is_turn(case: Case, k: int, used: dict[int, int]) -> bool:
    """Whether a spin is a turn from one hold to the next, which a table makes at a constant rate too."""
    before = [used[other] for other in used if other < k]
    after = [used[other] for other in used if other > k]
    if case.events[k].spin is None or not before or not after or min(after) == max(before):
        return False
    first, last = case.steps[max(before)], case.steps[min(after)]
    between = case.protocol.steps[first + 1 : last]
    holds = all(isinstance(case.protocol.steps[n], HoldStep) for n in (first, last))
    return holds and not any(isinstance(step, SpinStep) for step in between)


def _likeness(case: Case, fit: Fit, event: Event) -> str:
    """The step that a left-out hold looks like, if there is one and only one pose that does."""
    up_b = fit.reading.up_b()
    if event.hold is None or up_b is None:
        return ""
    like: list[int] = []
    for i, number in enumerate(case.steps):
        pose = pose_of(case.protocol.steps[number])
        if pose is not None:
            angle = float(angles_from(up_b[[event.hold]], pose.up_b)[0])
            if angle < 2.0 * np.hypot(pose.sigma, POSE_FLOOR):
                like.append(i)
    return f" at this place (it looks like step {case.name(like[0])})" if len(like) == 1 else ""


def _reversed_turns(case: Case, chosen: list[tuple[int, int]]) -> list[str]:
    wrong, _, _ = mismatch.find_reversed_turns(case, chosen)
    if not wrong:
        return []
    steps = ", ".join(str(number + 1) for number in wrong)
    plural = "s" if len(wrong) > 1 else ""
    return [f"Step{plural} {steps}: turned the other way round than the protocol says, to the same pose."]
