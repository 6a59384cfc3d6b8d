"""What `plan` found, and what it is worth, in words, rows, and as a document."""

from __future__ import annotations

import math
from dataclasses import asdict, field
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.records import dataclass
from tumble.units import MICRO_G

if TYPE_CHECKING:
    from tumble.design import Foretold, JointPlan, NextStep, PosePlan, PoseTask, StepCandidate, StepWorth
    from tumble.protocol import Protocol


@dataclass(frozen=True)
class PoseSearch:
    """Poses that were searched.

    Attributes
    ----------
    task, plan : the design room's.
    schemes : the papers', in the same time, or in words why not.
    protocol : the plan to do.
    """

    task: PoseTask
    plan: PosePlan
    schemes: dict[str, PosePlan | str]
    protocol: Protocol


@dataclass
class Planned:
    """What `plan` found.

    Attributes
    ----------
    plan : the prediction.
    imu : name of the grade.
    search : the poses that were searched, beside the papers'; None for a protocol as it is.
    worths : of every step.
    following : steps that may be added.
    helping : what would tell each of the plan's weaknesses, or None.
    given, stop : sentences about what is there already and about targets, and whether to stop.
    remarks : what was assumed.
    files : what was written.
    """

    plan: JointPlan
    imu: str
    search: PoseSearch | None = None
    worths: list[StepWorth] = field(default_factory=list[Any])
    following: list[NextStep] = field(default_factory=list[Any])
    helping: list[tuple[StepCandidate, float] | None] = field(default_factory=list[Any])
    given: list[str] = field(default_factory=list[str])
    stop: bool = False
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])


# Shares of one, rad: what norms of holds leave so uncertain they do not determine.
OPEN = 0.3
# Without the step nothing grows by more than this: it can be spared.
SPARED = 0.05
# So many times as large, and a parameter rests on one step.
RESTS_ON = 2.0
# Performances that differ by more are worth a word.
DIFFERS = 1.2
STEP_HEADS = (
    "step",
    "of the time",
    "of what is determined",
    "without it, at worst",
    "a minute more: all fall by",
)


def prediction_rows(done: Planned) -> list[list[str]]:
    """Return a row for each three parameters: their name, three numbers and the unit.

    Parameters
    ----------
    done : a plan.
    """
    rows: list[list[str]] = []
    for stem, members in groupby(done.plan.foretold, key=lambda one: one.name.rpartition(" ")[0]):
        found = list(members)
        if stem.startswith("g-sensitivity"):
            stem = stem.removesuffix(" to force")
        for k in range(0, len(found), 3):
            rows.append(_prediction_row(stem, found[k : k + 3]))
    return rows


def _prediction_row(stem: str, three: list[Foretold]) -> list[str]:
    from tumble.parameters import with_uncertainty
    from tumble.report import practical_uncertainties

    ends = [one.name.rpartition(" ")[2] for one in three]
    name = stem if ends == ["x", "y", "z"] else f"{stem} ({', '.join(ends)})"
    family = stem if stem.endswith("bias") else "g-sensitivity" if stem.startswith("g-") else "scale"
    family = "angle" if three[0].unit == "rad" else family
    sigmas = [one.sigma if one.told else math.nan for one in three]
    measures = practical_uncertainties(family, sigmas)
    shown = [
        with_uncertainty(math.nan, one.sigma).removeprefix("± ")
        if math.isfinite(one.sigma)
        else "not determined"
        for one in measures
    ]
    return [name, *shown, measures[0].unit]


def step_rows(done: Planned, *, each: bool = False) -> list[list[str]]:
    """Return rows of what steps are worth: kinds of steps, or each by itself.

    Parameters
    ----------
    done : a plan.
    each : do not join steps of a kind.
    """
    rows: list[list[str]] = []
    for title, members in _kinds(done.worths, each=each):
        worst = max(members, key=lambda one: one.most_growth)
        growth = "loses" if worst.most_growth > 100.0 else f"× {worst.most_growth:.2f}"
        rows.append(
            [
                title,
                f"{100.0 * sum(one.share_of_time for one in members):.1f} %",
                f"{100.0 * sum(one.share_of_information for one in members):.1f} %",
                f"{growth} {_briefly(worst.most)}",
                f"{100.0 * max(float(np.mean([one.longer_per_minute for one in members])), 0.0):.2g} %",
            ]
        )
    return rows


def _briefly(name: str) -> str:
    """Return a parameter's name for a narrow column.

    Examples
    --------
    >>> _briefly("accelerometer non-orthogonality yz")
    'acc. non-orthog. yz'
    """
    for long, short in (("accelerometer", "acc."), ("orthogonality", "orthog."), ("factor error", "error")):
        name = name.replace(long, short)
    return name


def _kinds(worths: list[StepWorth], *, each: bool) -> list[tuple[str, list[StepWorth]]]:
    if each:
        return [(f"{one.step + 1}. {_named(one)}", [one]) for one in worths]
    ordered = sorted(worths, key=lambda one: (one.kind, -one.seconds))
    kinds: list[tuple[str, list[StepWorth]]] = []
    for (kind, seconds), members in groupby(ordered, key=lambda one: (one.kind, round(one.seconds, 3))):
        found = list(members)
        many = f"{len(found)} {kind}s" if len(found) > 1 else f"1 {kind}"
        kinds.append((f"{many} of {seconds:.4g} s", found))
    return kinds


def _named(one: StepWorth) -> str:
    return f"{one.kind} {one.name}, {one.seconds:.4g} s"


def describe_plan(done: Planned) -> list[str]:
    """Return what is not told and what would tell it, which steps carry the result, and what to change.

    Parameters
    ----------
    done : a plan with everything found.
    """
    single = (_about_hands(done.plan.foretold), "" if done.search is None else _about_wander(done.search))
    return [*_about_weak(done), *_about_steps(done.worths), *filter(None, single)]


def _about_weak(done: Planned) -> list[str]:
    words: list[str] = []
    turn = "rotation of the table" if done.plan.task.has_table else "turn by hand or rotation of a table"
    for weak, helping in zip(done.plan.weak, done.helping, strict=True):
        names = weak.parameters[:4]
        what = names[0] if len(names) == 1 else f"a combination of {', '.join(names)}"
        if len(weak.parameters) > 4:
            what += " and others"
        mend = f"No single hold, {turn} would determine it."
        if helping is not None:
            mend = f"Add this: {helping[0].name} ({helping[0].seconds:.0f} s)."
        words.append(f"Not determined better than by the data sheet: {what}. {mend}")
    return words


def _about_steps(worths: list[StepWorth]) -> list[str]:
    if not worths:
        return []
    words: list[str] = []
    pillars = [one for one in worths if one.most_growth > RESTS_ON]
    if pillars:
        found = [f"{one.most} on {one.name}" for one in sorted(pillars, key=lambda one: -one.most_growth)[:3]]
        words.append(f"It rests on single steps: {'; '.join(found)}.")
    least = min(worths, key=lambda one: one.most_growth)
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


def _about_hands(foretold: list[Foretold]) -> str:
    worst = max((one for one in foretold if one.told), key=lambda one: one.spread, default=None)
    if worst is None or worst.spread < DIFFERS:
        return ""
    return (
        "Hands do it differently each time: of several performances the best and the worst differ by "
        f"{worst.spread:.2g} times in {worst.name}. The prediction is their root mean square."
    )


def _about_wander(search: PoseSearch) -> str:
    from tumble.calibration import two_digits
    from tumble.design import wander_sigma, white_density

    task, plan = search.task, search.plan
    if not task.noise.wanders:
        return ""
    dwell = float(np.median(plan.dwells))
    wander = wander_sigma(task.noise, dwell, plan.duration)
    white = white_density(task.noise, task.rate) / math.sqrt(dwell)
    share = 100.0 * wander**2 / (wander**2 + white**2)
    more = " Longer holds would not help: more poses do." if share > 50.0 else ""
    return (
        f"The biases wander by {two_digits(wander / MICRO_G)} µg from hold to hold, the white noise of a hold is "
        f"{two_digits(white / MICRO_G)} µg. Wander is {share:.0f} % of the variance. The order of the poses lessens "
        f"it: keep it.{more}"
    )


def next_words(done: Planned) -> list[str]:
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


def headline(done: Planned) -> str:
    """Return what is planned, how many steps it has, and how long it lasts.

    Parameters
    ----------
    done : a plan.
    """
    from tumble.protocol import HoldStep, SpinStep, TurnStep

    steps, minutes = done.plan.task.protocol.steps, done.plan.duration / 60.0
    if done.search is not None:
        plan, more = done.search.plan, "more " if done.following and done.plan.task.known is not None else ""
        return f"{len(plan.dwells)} {more}poses ({plan.name}), {minutes:.1f} min with {plan.turn:g} s for each turn."
    counted = [
        (sum(isinstance(s, kind) for s in steps), words)
        for kind, words in ((HoldStep, "holds"), (SpinStep, "rotations of the table"), (TurnStep, "turns"))
    ]
    many = ", ".join(f"{count} {words}" for count, words in counted if count)
    return f"{done.plan.task.protocol.name}: {many}; {minutes:.1f} min."


def over_the_plan(plan: PosePlan, best: PosePlan) -> dict[str, float | None]:
    """Return by group the root mean square sigma over the plan's, of the norms of holds; None if not determined.

    Parameters
    ----------
    plan, best : a scheme, and the plan.
    """
    from tumble.design import NORM_GROUPS

    ratios: dict[str, float | None] = {}
    for group, members in NORM_GROUPS.items():
        own, its = (float(np.sqrt(np.mean(one.sigmas[list(members)] ** 2))) for one in (plan, best))
        ratios[group] = own / its if max(own, its) < OPEN else None
    return ratios


def scheme_rows(search: PoseSearch) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the comparison, the plan first; numbers are over the plan's.

    Parameters
    ----------
    search : what was searched.
    """
    rows: list[list[str]] = []
    for name, one in {"this plan": search.plan, **search.schemes}.items():
        rows.append([name, *(["–"] * 6 if isinstance(one, str) else _scheme_cells(one, search.plan))])
    return ["holds alone, over this plan", "poses", "rest", "scale", "misal.", "bias", "criterion"], rows


def _scheme_cells(plan: PosePlan, best: PosePlan) -> list[str]:
    dwells = np.asarray(plan.dwells)
    low, high = float(dwells.min()), float(dwells.max())
    rest = f"{low:.0f} s" if high - low < 1.0 else f"{low:.0f} to {high:.0f} s"
    ratios = [*over_the_plan(plan, best).values(), plan.value / best.value]
    return [str(len(dwells)), rest, *("–" if one is None else f"{one:.2f}" for one in ratios)]


def document_of(done: Planned) -> dict[str, Any]:
    """Return everything as plain data for a file, SI and one sigma.

    Parameters
    ----------
    done : what was planned.
    """
    plan, task = done.plan, done.plan.task
    return {
        "format": "tumble plan of a protocol",
        "version": 2,
        "protocol": task.protocol.name,
        "procedure": task.protocol.procedure,
        "imu": done.imu,
        "duration_s": plan.duration,
        "site": {"gravity": task.site.gravity, "gravity_standard_uncertainty": task.site.gravity_sigma},
        "parameters": [
            {
                "name": one.name,
                "unit": one.unit,
                "told": one.told,
                "standard_uncertainty": one.sigma if one.told else None,
                "with_a_perfect_clock": one.without_clock if one.told else None,
                "largest_over_smallest_performance": one.spread,
            }
            for one in plan.foretold
        ],
        "schemes": None if done.search is None else _schemes(done.search),
        "not_told": [
            {
                "parameters": list(weak.parameters),
                "data_sheet_spreads": weak.sigma if math.isfinite(weak.sigma) else None,
                "told_by": None if helping is None else helping[0].name,
            }
            for weak, helping in zip(plan.weak, done.helping, strict=True)
        ],
        "steps": [{**asdict(worth), "step": worth.step + 1} for worth in done.worths],
        "next": [
            {
                "do": one.candidate.name,
                "seconds": one.candidate.seconds,
                "gain": one.gain,
                "gains_most": one.most,
                "its_gain": one.most_gain,
                "not_told_after": one.open_left,
            }
            for one in done.following
        ],
        "given": done.given,
        "stop": done.stop,
        "remarks": done.remarks,
    }


def _schemes(search: PoseSearch) -> dict[str, Any]:
    """The plan and the papers' schemes, their uncertainties over the plan's."""
    return {
        name: {"not_possible": one}
        if isinstance(one, str)
        else {
            "poses": len(one.dwells),
            "dwell_s": float(one.dwells[0]),
            "over_this_plan": over_the_plan(one, search.plan),
        }
        for name, one in {"this plan": search.plan, **search.schemes}.items()
    }
