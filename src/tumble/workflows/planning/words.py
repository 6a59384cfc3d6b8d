"""What a planned protocol is worth, in words and rows."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.units import MICRO_G, STANDARD_GRAVITY

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design.pose_plan import PosePlan, PoseTask
    from tumble.design.step_worth import StepWorth
    from tumble.earth import Site
    from tumble.workflows.planning.poses import PosesPlanned
    from tumble.workflows.planning.protocol import ProtocolPlanned

SECOND = math.pi / 648000.0
# Practical unit and its size in the unit of `tumble.design.candidates.PARAMETERS`, by group.
UNITS = {"scale": ("ppm", 1e-6), "misalignment": ("mrad", 1e-3), "bias": ("mg", 1e-3)}
# Practical unit of each group, and its size in SI.
UNITS_OF_GROUPS: dict[str, tuple[str, float]] = {
    "accelerometer bias": ("µg", 9.80665e-6),
    "accelerometer scale": ("ppm", 1e-6),
    "accelerometer misalignment": ("″", SECOND),
    "gyro bias": ("°/h", SECOND),
    "gyro scale": ("ppm", 1e-6),
    "gyro misalignment": ("″", SECOND),
    "rotation between the triads": ("″", SECOND),
    "g-sensitivity": ("(°/h)/g", SECOND / 9.80665),
}
# Without the step nothing grows by more than this: it can be spared.
SPARED = 0.05
# So many times as large, and a parameter rests on one step.
RESTS_ON = 2.0
# Performances that differ by more are worth a word.
DIFFERS = 1.2


def prediction_rows(done: ProtocolPlanned) -> list[list[str]]:
    """Return a row for each group: its name, three numbers (x, y, z; or yz, zx, zy) and the unit.

    Parameters
    ----------
    done : a plan.
    """
    from tumble.design.joint_information import GROUPS

    rows: list[list[str]] = []
    for group, part in GROUPS.items():
        sigmas, known = done.plan.sigmas[part], np.asarray(done.plan.told[part], dtype=np.bool_)
        if group == "g-sensitivity":
            if not done.plan.task.g_sensitivity:
                continue
            # A gyro's three elements as one.
            sigmas = STANDARD_GRAVITY * np.sqrt(np.mean(sigmas.reshape(3, 3) ** 2, axis=1))
            known = np.all(known.reshape(3, 3), axis=1)
        rows.append(_prediction_row(group, sigmas, known))
    return rows


# Ends of a group's name -> the name that a calibration has for it, and the family of its units.
_NAMES = {
    "bias": ("bias", ""),
    "scale": ("scale factor error", "scale"),
    "misalignment": ("non-orthogonality (yz, zx, zy)", "angle"),
    "triads": ("triads", "angle"),
    "g-sensitivity": ("g-sensitivity", "g-sensitivity"),
}


def _prediction_row(group: str, sigmas: Series, known: Any) -> list[str]:
    from tumble.report.parameters import practical_uncertainties
    from tumble.report.rounding import with_uncertainty

    stem, _, end = group.rpartition(" ")
    name, family = _NAMES[end]
    values: list[float] = np.where(known, sigmas, np.nan).tolist()
    measures = practical_uncertainties(family or group, values)
    shown = [
        with_uncertainty(math.nan, one.sigma).removeprefix("± ")
        if math.isfinite(one.sigma)
        else "not determined"
        for one in measures
    ]
    return [f"{stem} {name}".strip(), *shown, measures[0].unit]


def step_rows(done: ProtocolPlanned, *, each: bool = False) -> list[list[str]]:
    """Return rows of what steps are worth: kinds of steps, or each by itself.

    Parameters
    ----------
    done : a plan.
    each : do not join steps of a kind.
    """
    rows: list[list[str]] = []
    for title, members in _kinds(done, each=each):
        worst = max(members, key=lambda one: one.most_growth)
        rows.append(
            [
                title,
                f"{100.0 * sum(one.share_of_time for one in members):.1f} %",
                f"{100.0 * sum(one.share_of_information for one in members):.1f} %",
                f"{_growth(worst.most_growth)} {_briefly(worst.most)}",
                f"{100.0 * max(float(np.mean([one.longer_per_minute for one in members])), 0.0):.2g} %",
            ]
        )
    return rows


STEP_HEADS = (
    "step",
    "of the time",
    "of what is determined",
    "without it, at worst",
    "a minute more: all fall by",
)


def _briefly(name: str) -> str:
    """Return a parameter's name for a narrow column.

    Parameters
    ----------
    name : of a parameter.

    Examples
    --------
    >>> _briefly("accelerometer non-orthogonality yz")
    'acc. non-orthog. yz'
    """
    for long, short in (("accelerometer", "acc."), ("orthogonality", "orthog."), ("factor error", "error")):
        name = name.replace(long, short)
    return name


def _kinds(done: ProtocolPlanned, *, each: bool) -> list[tuple[str, list[StepWorth]]]:
    if each:
        return [(f"{one.step + 1}. {_named(one)}", [one]) for one in done.worths]
    ordered = sorted(done.worths, key=lambda one: (one.kind, -one.seconds))
    kinds: list[tuple[str, list[StepWorth]]] = []
    for (kind, seconds), members in groupby(ordered, key=lambda one: (one.kind, round(one.seconds, 3))):
        found = list(members)
        many = f"{len(found)} {kind}s" if len(found) > 1 else f"1 {kind}"
        kinds.append((f"{many} of {seconds:.4g} s", found))
    return kinds


def _named(one: StepWorth) -> str:
    return f"{one.kind} {one.name}, {one.seconds:.4g} s"


def _growth(factor: float) -> str:
    if factor > 100.0:
        return "loses"
    return f"× {factor:.2f}"


def describe_plan(done: ProtocolPlanned) -> list[str]:
    """Return what is not told and what would tell it, which steps carry the result, and what to change.

    Parameters
    ----------
    done : a plan with everything found.
    """
    return [*_about_weak(done), *_about_steps(done), *_about_hands(done)]


def _about_weak(done: ProtocolPlanned) -> list[str]:
    words: list[str] = []
    for weak, helping in zip(done.plan.weak, done.helping, strict=True):
        names = weak.parameters[:4]
        what = names[0] if len(names) == 1 else f"a combination of {', '.join(names)}"
        if len(weak.parameters) > 4:
            what += " and others"
        if helping is None:
            words.append(
                f"Not determined better than by the data sheet: {what}. No single hold, turn by hand "
                "or rotation of a table would determine it."
            )
        else:
            words.append(
                f"Not determined better than by the data sheet: {what}. Add this: {helping[0].name} "
                f"({helping[0].seconds:.0f} s)."
            )
    return words


def _about_steps(done: ProtocolPlanned) -> list[str]:
    worths = done.worths
    if not worths:
        return []
    words: list[str] = []
    pillars = [one for one in worths if one.most_growth > RESTS_ON]
    if pillars:
        found = [f"{one.most} on {one.name}" for one in sorted(pillars, key=lambda one: -one.most_growth)[:3]]
        words.append(f"It rests on single steps: {'; '.join(found)}.")
    least = min(worths, key=lambda one: one.most_growth - 1.0)
    if least.most_growth - 1.0 < SPARED:
        spared = sum(one.most_growth - 1.0 < SPARED for one in worths)
        words.append(
            f"Any one of {spared} of {len(worths)} steps could be dropped and no uncertainty would grow by more than "
            f"{100.0 * SPARED:.0f} %; least is lost without the {_named(least)} "
            f"({100.0 * (least.most_growth - 1.0):.1f} %)."
        )
    best = max(worths, key=lambda one: one.longer_per_minute)
    worst = min(worths, key=lambda one: one.longer_per_minute)
    if best.longer_per_minute > 2.0 * max(worst.longer_per_minute, 0.0) and best.longer_per_minute > 1e-4:
        words.append(
            f"Time is best spent on the {_named(best)}: a minute more takes {100.0 * best.longer_per_minute:.2g} % off "
            f"the uncertainties, of the {_named(worst)} {100.0 * max(worst.longer_per_minute, 0.0):.2g} %."
        )
    return words


def _about_hands(done: ProtocolPlanned) -> list[str]:
    from tumble.design.joint_information import NAMES

    spread = np.where(done.plan.told, done.plan.spread, 1.0)
    worst = int(np.argmax(spread))
    if spread[worst] < DIFFERS:
        return []
    words = (
        "Hands do it differently each time: of several performances the best and the worst differ by "
        f"{spread[worst]:.2g} times in {NAMES[worst]}. The prediction is their root mean square."
    )
    return [words]


def next_words(done: ProtocolPlanned) -> list[str]:
    """Return which steps to add next, one sentence each.

    Parameters
    ----------
    done : a plan.
    """
    words: list[str] = []
    for number, one in enumerate(done.following):
        after = (
            f"{one.open_left} parameters are then still open"
            if one.open_left
            else f"the uncertainties fall by {100.0 * one.gain:.2g} %, of {one.most} by {100.0 * one.most_gain:.2g} %"
        )
        words.append(f"{'Next' if number == 0 else 'Then'}: {one.candidate.name}; {after}.")
    return words


def steps_in_words(done: ProtocolPlanned) -> str:
    """Return how many holds, rotations and turns there are.

    Parameters
    ----------
    done : a plan.
    """
    from tumble.protocol import HoldStep, SpinStep, TurnStep

    steps = done.plan.task.protocol.steps
    counted = [
        (sum(isinstance(s, kind) for s in steps), words)
        for kind, words in ((HoldStep, "holds"), (SpinStep, "rotations of the table"), (TurnStep, "turns"))
    ]
    return ", ".join(f"{count} {words}" for count, words in counted if count)


def describe_poses(done: PosesPlanned) -> list[str]:
    """Return what holds of turns, wander and gravity in a plan of poses.

    Parameters
    ----------
    done : a plan.
    """
    return [
        *_about_turns(done.procedure),
        *_about_wander(done.task, done.plan),
        *_about_gravity(done.place),
    ]


def _about_wander(task: PoseTask, plan: PosePlan) -> list[str]:
    from tumble.design.hold_noise import wander_sigma, white_density

    if not task.noise.wanders:
        return []
    dwell = float(np.median(plan.dwells))
    wander = wander_sigma(task.noise, dwell, plan.duration)
    white = white_density(task.noise, task.rate) / math.sqrt(dwell)
    share = 100.0 * wander**2 / (wander**2 + white**2)
    more = " Longer holds would not help: more poses do." if share > 50.0 else ""
    return [
        (
            f"The biases wander by {wander / MICRO_G:.2g} µg from hold to hold, the white noise of a "
            f"hold is {white / MICRO_G:.2g} µg. Wander is {share:.0f} % of the variance. The order of "
            f"the poses lessens it: keep it.{more}"
        )
    ]


def _about_turns(procedure: str) -> list[str]:
    if procedure != "hand-held":
        return []
    return [
        (
            "The first table is what the holds determine of the accelerometers, the last one what "
            "holds and turns determine of both triads. Turn about all axes of the unit, and about no "
            "two the same way one after the other."
        )
    ]


def _about_gravity(place: Site) -> list[str]:
    if place.gravity_sigma == 0.0:
        return []
    ppm = 1e6 * place.gravity_sigma / place.gravity
    return [
        (
            f"Gravity is good to {ppm:.2g} ppm, which all scale factors share and no pose mends: --gravity says it "
            "better. The comparison with other schemes is without it."
        )
    ]


def group_means(plan: PosePlan) -> dict[str, float]:
    """Return the root mean square sigma by group, noise alone, in the practical units of `UNITS`; nan if not told.

    Parameters
    ----------
    plan : of a scheme.
    """
    from tumble.design.candidates import GROUPS

    means: dict[str, float] = {}
    for group, members in GROUPS.items():
        sigma = float(np.sqrt(np.mean(plan.sigmas[list(members)] ** 2)))
        means[group] = sigma / UNITS[group][1] if sigma < 0.3 else math.nan
    return means


def pose_names(plan: PosePlan) -> list[str]:
    """Return a name for each pose: its face, edge or corner.

    Parameters
    ----------
    plan : with directions.
    """
    from tumble.calibration.poses import describe_direction

    return [describe_direction(up) for up in plan.directions]


def scheme_rows(done: PosesPlanned) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the comparison, the plan first; numbers are root mean squares of the noise alone.

    Parameters
    ----------
    done : what was planned.
    """
    heads = [
        "in the same time",
        "poses",
        "rest",
        *(f"{group.replace('misalignment', 'misal.')}, {unit}" for group, (unit, _) in UNITS.items()),
        "criterion",
    ]
    plan = done.plan
    rows = [_scheme_row("this plan", plan, plan.value)]
    for name, one in done.schemes.items():
        rows.append([name, *"––––––"] if isinstance(one, str) else _scheme_row(name, one, plan.value))
    return heads, rows


def _scheme_row(name: str, plan: PosePlan, best: float) -> list[str]:
    dwells = np.asarray(plan.dwells)
    low, high = float(dwells.min()), float(dwells.max())
    rest = f"{low:.0f} s" if high - low < 1.0 else f"{low:.0f} to {high:.0f} s"
    means = [f"{value:.3g}" if math.isfinite(value) else "–" for value in group_means(plan).values()]
    return [name, str(len(dwells)), rest, *means, f"{plan.value / best:.2f}"]


def parameter_rows(done: PosesPlanned) -> list[list[str]]:
    """Return name, predicted standard uncertainty, unit and what is of noise alone, for a table.

    Parameters
    ----------
    done : what was planned.
    """
    from tumble.report.parameters import practical_uncertainties

    families = {"bias": "accelerometer bias", "scale": "scale", "misalignment": "angle"}
    rows: list[list[str]] = []
    for one in done.predicted:
        same = [(other.total, other.noise) for other in done.predicted if other.group == one.group]
        sizes = practical_uncertainties(families[one.group], [total for total, _ in same])
        factor = sizes[0].sigma / same[0][0]
        rows.append([one.name, f"{one.total * factor:.2g}", sizes[0].unit, f"{one.noise * factor:.2g}"])
    return rows
