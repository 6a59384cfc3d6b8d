"""What is said of a matching: steps that are missing or were done again, and what was left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.protocol.steps import HoldStep, SpinStep
from tumble.segmentation.events import POSE_FLOOR, Event, angles_from, pose_of, spin_axis
from tumble.segmentation.mismatch import find_reversed_turns
from tumble.units import angular_rate_factor

if TYPE_CHECKING:
    from tumble.segmentation.matching import Case, Fit

# Of one kind, so many sentences; the others are counted.
MOST_SENTENCES = 8


def remarks_of(case: Case, fit: Fit, chosen: list[tuple[int, int]]) -> list[str]:
    """Return sentences on all that is not as the protocol says; none where everything is.

    Parameters
    ----------
    case, fit : the protocol beside what was found, and how they were aligned.
    chosen : the pairs of step and event that are used.
    """
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
    matched, used = fit.alignment.steps(), {k for _, k in fit.alignment.pairs}
    gaps: dict[tuple[int, int], list[int]] = {}
    for i, number in enumerate(case.steps):
        if i not in matched and isinstance(case.protocol.steps[number], SpinStep):
            before = max((k for other, k in fit.alignment.pairs if other < i), default=-1)
            after = min((k for other, k in fit.alignment.pairs if other > i), default=len(case.events))
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
    found = fit.alignment.steps()
    events = dict(fit.alignment.pairs)
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
    for i in sorted(fit.alignment.steps()):
        times = sum(step == i for step, _ in fit.alignment.pairs)
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
    used = {k: i for i, k in fit.alignment.pairs}
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
    wrong, _, _ = find_reversed_turns(case, chosen)
    if not wrong:
        return []
    steps = ", ".join(str(number + 1) for number in wrong)
    plural = "s" if len(wrong) > 1 else ""
    return [f"Step{plural} {steps}: turned the other way round than the protocol says, to the same pose."]
