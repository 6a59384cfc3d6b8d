"""Why a recording is not of a protocol, in words that say what to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix
from tumble.errors import SegmentationError
from tumble.protocol import HoldStep, SpinStep, TurnStep
from tumble.recording import Recording, find_axis_contradiction, renamed
from tumble.segmentation.alignment import GAP, Case, Fit, pose_of, signed_permutations, spin_axis
from tumble.units import angular_rate_factor, known_units

# A share of the steps below which the protocol is not the recording's.
SMALLEST_SHARE = 0.5
# Below this share of the steps that tell axes, other axes are tried, and believed above it.
SUSPICIOUS_SHARE = 0.9
# No gyro's scale is off by more: beyond it is another unit or another rate.
LARGEST_RATE_RATIO = 1.3
# Turns within 20 degrees of none or half of one end alike either way round.
TELLING_TURN = np.radians(20.0)


def refuse_without_spins(case: Case) -> None:
    """Refuse a recording without spins for a protocol that has some.

    Raises
    ------
    SegmentationError
        If the recording has a gyro and it sees no constant rate.
    """
    wanted = sum(isinstance(case.protocol.steps[number], SpinStep) for number in case.steps)
    if wanted and not any(event.spin is not None for event in case.events):
        raise SegmentationError(
            f"The protocol {case.protocol.name} has {wanted} spins, but the recording has "
            f"{describe(case)}: nowhere is the unit turned at a constant rate for a second or more. "
            "Give the protocol of this recording, or the recording of this protocol."
        )


def refuse_wrong_units(case: Case) -> None:
    """Refuse rates that no scale error explains, where units are declared.

    Raises
    ------
    SegmentationError
        If the spins are faster or slower than the protocol's by more than 30 %.
    """
    declared = angular_rate_factor(case.recording.angular_rate_unit)
    scale = case.rate_scale()
    if declared is None or scale is None:
        return
    ratio = scale * declared
    if 1.0 / LARGEST_RATE_RATIO < ratio < LARGEST_RATE_RATIO:
        return
    fastest = max(abs(s.rate) for s in case.protocol.steps if isinstance(s, SpinStep))
    advice = "mend the rates in the protocol, or declare the file's units with --units"
    for unit in known_units("angular rate"):
        factor = angular_rate_factor(unit)
        if factor is not None and abs(np.log(scale * factor)) < np.log(LARGEST_RATE_RATIO):
            advice = f"the file's rates look like {unit}: declare them with --units"
    raise SegmentationError(
        f"The spins are {ratio:.3g} times as fast as the protocol's: where it says "
        f"{np.degrees(fastest):.4g}°/s the gyro has {np.degrees(fastest) * ratio:.4g}°/s, taken as "
        f"{case.recording.angular_rate_unit}. No scale error is that large; {advice}."
    )


def refuse_misfit(case: Case, fit: Fit) -> None:
    """Refuse what does not fit, with the likeliest reason.

    Raises
    ------
    SegmentationError
        If spins go the other way round, if axes are swapped, or if too few steps fit.
    """
    _refuse_reversed_spins(case, fit)
    if _share(case, fit, spins=False) < SUSPICIOUS_SHARE:
        _refuse_swapped_accelerometer(case, fit)
    found = len(fit.steps())
    # Spins both ways in turn fit all but one the wrong way round, and the holds between them then do not.
    if min(_share(case, fit, spins=True), found / len(case.steps)) < SUSPICIOUS_SHARE:
        _refuse_swapped_gyro(case, fit)
    if found < SMALLEST_SHARE * len(case.steps):
        raise SegmentationError(
            f"The recording is not of the protocol {case.protocol.name}: {found} of its {len(case.steps)} holds "
            f"and spins fit in order. The recording has {describe(case)}{_another_order(case, fit)}."
        )


def describe(case: Case) -> str:
    """Return how many holds and spins were found, in words."""
    holds = sum(event.hold is not None for event in case.events)
    spins = len(case.events) - holds
    return f"{_counted(holds, 'hold')} and {_counted(spins, 'spin')}"


def _counted(count: int, noun: str) -> str:
    return f"{count or 'no'} {noun}{'' if count == 1 else 's'}"


def _share(case: Case, fit: Fit, *, spins: bool) -> float:
    """Share of the posed holds, or of the spins, that have an event."""
    steps = [case.protocol.steps[number] for number in case.steps]
    telling = {
        i
        for i, step in enumerate(steps)
        if (isinstance(step, SpinStep) if spins else pose_of(step) is not None)
    }
    return len(telling & fit.steps()) / len(telling) if telling else 1.0


def _refuse_reversed_spins(case: Case, fit: Fit) -> None:
    up_b = fit.reading.up_b()
    wrong: list[str] = []
    said = True
    for i, k in fit.pairs:
        step, event = case.protocol.steps[case.steps[i]], case.events[k]
        if not isinstance(step, SpinStep) or event.rate is None:
            continue
        axis_b = spin_axis(case.protocol, case.steps[i], event, up_b)
        if axis_b is not None and float(event.rate @ axis_b) * step.rate < 0.0:
            wrong.append(str(case.steps[i] + 1))
            said = step.rate > 0.0
    if wrong:
        _raise_reversed(case, wrong, bool(said))


def _raise_reversed(case: Case, wrong: list[str], counter_clockwise: bool) -> None:
    spins = sum(isinstance(step, SpinStep) for step in case.protocol.steps)
    ways = ("counter-clockwise", "clockwise")
    said, seen = ways if counter_clockwise else ways[::-1]
    if len(wrong) == 1:
        told = f"step {wrong[0]}: the protocol turns {said} about its axis and the gyro saw {seen}"
    else:
        told = f"steps {_listed(wrong)}: the gyro saw them go the other way round than the protocol says"
    if len(wrong) == spins:
        advice = "The gyro's signs are reversed (--columns with -gx,-gy,-gz), or the protocol counts angles clockwise."
    else:
        signs = "Mend the signs of these rates in the protocol: positive is counter-clockwise seen against the axis."
        advice = _by_gravity(case) or signs
    raise SegmentationError(f"Wrong way round, {told}. {advice}")


def _by_gravity(case: Case) -> str:
    """Which of the gyro's columns gravity in the accelerometers contradicts, and the option that mends it."""
    both = case.recording.specific_force is not None and case.recording.angular_rate is not None
    return (find_axis_contradiction(case.recording) or "") if both else ""


def _refuse_swapped_accelerometer(case: Case, fit: Fit) -> None:
    """Refuse if other axes of the accelerometer bring nearly all holds to their poses."""
    if case.means.specific_force is None:
        return
    holds = case.only(HoldStep)
    fits: list[Fit] = []
    for axes in signed_permutations():
        force = case.means.specific_force @ axes.T
        readings = [replace(fit.reading, specific_force=force, scale=scale) for scale in holds.scales(force)]
        fits.append(min((holds.aligned(r) for r in readings), key=lambda other: other.cost))
    best, axes = _best_axes(fits)
    if best is None or _share(holds, best, spins=False) < SUSPICIOUS_SHARE:
        return
    posed = sum(pose_of(case.protocol.steps[number]) is not None for number in holds.steps)
    fitting = sum(pose_of(case.protocol.steps[holds.steps[i]]) is not None for i in best.steps())
    # a unit mounted otherwise turns both triads; only mirrored axes are the accelerometer's own
    both = np.linalg.det(axes) > 0.0 and case.recording.angular_rate is not None
    gyro = axes if both else np.eye(3)
    raise SegmentationError(
        f"{fitting} of the {posed} poses fit once {_changed_axes('the', axes)}: {_in_words(axes)}. If "
        "the columns are mistaken or the unit is mounted otherwise, give --columns "
        f"{_columns(case.recording, axes, gyro)} (the file's columns in their order). If the steps were done in "
        "another order, put the protocol's steps into that order."
    )


def _refuse_swapped_gyro(case: Case, fit: Fit) -> None:
    """Refuse if other axes of the gyro bring nearly all spins to theirs."""
    only = case.only(SpinStep)
    best, axes = _best_axes([only.aligned(replace(fit.reading, gyro=m)) for m in signed_permutations()])
    if best is None or _share(only, best, spins=True) < SUSPICIOUS_SHARE:
        return
    if np.array_equal(axes, -np.eye(3)):
        spins = [number for number in case.steps if isinstance(case.protocol.steps[number], SpinStep)]
        _raise_reversed(case, [str(number + 1) for number in spins], counter_clockwise=True)
    changed = _changed_axes("the gyro's", axes)
    raise SegmentationError(
        f"The spins fit once {changed}: {_in_words(axes)}. Give --columns "
        f"{_columns(case.recording, np.eye(3), axes)} (the file's columns in their order), or mend the axes in the "
        "protocol."
    )


def _best_axes(fits: list[Fit]) -> tuple[Fit | None, Matrix]:
    """The best of the fits with swapped axes, and its axes; None if the axes as they are do as well."""
    costs = [fit.cost for fit in fits]
    best = int(np.argmin(costs))
    return (fits[best] if costs[best] < costs[0] - 1.5 * GAP else None), signed_permutations()[best]


def _changed_axes(whose: str, axes: Matrix) -> str:
    """What was done to axes: reversed where each is still its own, else swapped."""
    signs = np.diag(axes)
    if not np.array_equal(np.abs(axes), np.eye(3)):
        return f"{whose} axes are swapped"
    reversed_ = [axis for axis, sign in zip("xyz", signs, strict=True) if sign < 0.0]
    if len(reversed_) == 1:
        return f"{whose} {reversed_[0]} axis is reversed"
    return f"{whose} axes {', '.join(reversed_[:-1])} and {reversed_[-1]} are reversed"


def _sensed(axes: Matrix) -> list[tuple[str, str, str]]:
    """Each column as it is called, and the sign and the axis that it is."""
    found: list[tuple[str, str, str]] = []
    for column in range(3):
        axis = int(np.argmax(np.abs(axes[:, column])))
        found.append(("xyz"[column], "-" if axes[axis, column] < 0.0 else "", "xyz"[axis]))
    return found


def _in_words(axes: Matrix) -> str:
    """Which column is which axis, such as ``x is -y, y is x``."""
    words = [f"{column} is {sign}{axis}" for column, sign, axis in _sensed(axes) if sign or axis != column]
    return ", ".join(words)


def _columns(recording: Recording, accelerometer: Matrix, gyro: Matrix) -> str:
    names = {
        f"{letter}{column}": f"{sign}{letter}{axis}"
        for letter, axes in (("a", accelerometer), ("g", gyro))
        for column, sign, axis in _sensed(axes)
    }
    return renamed(recording.columns or "t,ax,ay,az,gx,gy,gz", names).strip()


def _another_order(case: Case, fit: Fit) -> str:
    """Say so if the holds would fit in another order."""
    up_b = fit.reading.up_b()
    poses = [pose for number in case.steps if (pose := pose_of(case.protocol.steps[number])) is not None]
    if up_b is None or not poses:
        return ""
    cosines = np.array([pose.up_b for pose in poses]) @ up_b.T
    near = np.arccos(np.clip(cosines, -1.0, 1.0)) < np.array(
        [[np.radians(10.0) + 2.0 * pose.sigma] for pose in poses]
    )
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(~near)
    fitting = int(np.sum(near[rows, columns]))
    if fitting < SUSPICIOUS_SHARE * len(poses):
        return ""
    return f"; {fitting} of the {len(poses)} poses are among its holds, but in another order: put the steps into it"


_MOST_LISTED = 8


def _listed(words: list[str]) -> str:
    shown = ", ".join(words[:_MOST_LISTED])
    return shown if len(words) <= _MOST_LISTED else f"{shown} and {len(words) - _MOST_LISTED} more"


def find_reversed_turns(case: Case, chosen: list[tuple[int, int]]) -> tuple[list[int], int, bool]:
    """Return the turns made the other way round (step indices), how many turns tell, and if poses say so too.

    The last is True where a reversed turn is far from half a turn: the holds on both sides then fit the
    protocol's way, and it is the gyro that is reversed.

    Parameters
    ----------
    case, chosen : the protocol beside what was found, and the pairs used.
    """
    hold_of = {case.steps[i]: hold for i, k in chosen if (hold := case.events[k].hold) is not None}
    wrong: list[int] = []
    told, contradicted = 0, False
    for number, step in enumerate(case.protocol.steps):
        if not isinstance(step, TurnStep) or step.axis_b is None or step.angle is None:
            continue
        before, after = hold_of.get(number - 1), hold_of.get(number + 1)
        if before is None or after is None or after != before + 1:
            continue
        along = _turned_along(case, before, step.axis_b)
        if along is None:
            continue
        told += 1
        if along * step.angle < 0.0:
            wrong.append(number)
            past_half = abs(step.angle) % np.pi
            contradicted |= bool(TELLING_TURN < past_half < np.pi - TELLING_TURN)
    return wrong, told, contradicted


def _turned_along(case: Case, before: int, axis_b: AnyArray) -> float | None:
    """Cosine of the integrated rate against an axis; None where the gyro does not tell."""
    turn = next((t for t in case.timeline.turns if t.before == before), None)
    rate, bias = case.recording.angular_rate, case.means.angular_rate
    if turn is None or not turn.usable or rate is None or bias is None or turn.stop <= turn.start:
        return None
    total = np.sum(rate[turn.start : turn.stop] - 0.5 * (bias[before] + bias[before + 1]), axis=0)
    cosine = float(total @ axis_b / max(np.linalg.norm(total) * np.linalg.norm(axis_b), 1e-300))
    return cosine if abs(cosine) > 0.7 else None


def refuse_reversed_turns(case: Case, chosen: list[tuple[int, int]]) -> None:
    """Refuse a gyro that sees turns the other way round than the poses say.

    Raises
    ------
    SegmentationError
        If at least half of the turns that tell are reversed, against what the poses say.
    """
    wrong, told, contradicted = find_reversed_turns(case, chosen)
    if contradicted and 2 * len(wrong) >= told:
        steps, turns = ("step", "this turn") if len(wrong) == 1 else ("steps", "these turns")
        raise SegmentationError(
            f"Wrong way round, {steps} {_listed([str(n + 1) for n in wrong])}: the holds before and after fit the "
            f"protocol, but the gyro saw {turns} go the other way round. "
            + (_by_gravity(case) or "The gyro's signs are reversed: give --columns with -gx,-gy,-gz.")
        )
