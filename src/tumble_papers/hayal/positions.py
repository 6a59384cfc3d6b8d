"""Tables 5.5 to 5.7 of Hayal (2010): positions after outages, with no calibration and with every scenario's.

The thesis' recordings are not public: simulated campaigns of units of the same data sheets stand for them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import AnyArray
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row, Value
from tumble.simulation import find_grade
from tumble_papers.hayal.field_campaign import (
    EVERY_SCENARIO,
    GAPS,
    ORIGINAL,
    OUTAGES,
    SLIDING,
    SUB_SCENARIOS,
    UNSCALED,
    Case,
    Found,
    Positions,
    improvements,
    pooled,
    run_campaigns,
)
from tumble_papers.hayal.field_navigation import FIX_SIGMAS
from tumble_papers.hayal.scenarios import IMUS
from tumble_papers.published import hayal

SOURCE = "Hayal 2010, chapter 5; the thesis' recordings are not public, ours are simulated"
TABLES = {"5.5": "HG1700", "5.6": "HG1900"}
# Fewer campaigns than this are no range.
RANGE = 4
_THESIS = ("thesis: mean", "thesis: σ", "thesis: better, %")
_OURS = ("gaps: mean", "gaps: σ", "gaps: better, %", "lowest to highest")
COLUMNS = (*_THESIS, *_OURS)
BOTH_COLUMNS = (*COLUMNS, "each by itself: σ", "better, %", "lowest to highest")
NOT_IN_THESIS = "3.9, plain sigmas"


def scenario_positions(table: str, repetitions: int, seed: int) -> Found:
    """Return what table 5.5 or 5.6 is made of.

    Parameters
    ----------
    table : its number.
    repetitions, seed : how many campaigns, from what.
    """
    return run_campaigns(TABLES[table], EVERY_SCENARIO, OUTAGES[:1], (GAPS,), repetitions, seed)


def sub_scenario_positions(imu: str, repetitions: int, seed: int, *, wandering: bool) -> Found:
    """Return what table 5.7 is made of.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    repetitions, seed : how many campaigns, from what.
    wandering : whether biases walk, to the sheet's in-run stability in an hour.
    """
    cases = (*SUB_SCENARIOS.values(), UNSCALED)
    return run_campaigns(imu, cases, OUTAGES, (GAPS, SLIDING), repetitions, seed, wandering=wandering)


def reproduce_scenario_positions(table: str, repetitions: int, seed: int) -> Outcome:
    """Make table 5.5 or 5.6 anew: positions after outages of 2 s, scenarios 1 to 4 with 1, 3 and 5 minutes.

    Parameters
    ----------
    table : "5.5" or "5.6".
    repetitions : how many campaigns.
    seed : of all random numbers.
    """
    printed, imu = hayal()["position_tables"][table], TABLES[table]
    found = scenario_positions(table, repetitions, seed)
    first = printed["original"]
    rows = [_original_row("original", imu, first, found, 0, (GAPS,))]
    for entry in printed["rows"]:
        for minutes, cell in entry["minutes"].items():
            case = Case(entry["scenario"], int(minutes), entry["gyro_parameters"])
            label = f"scenario {case.scenario}, gyros {case.gyro} par., {minutes} min"
            rows.append(_row(label, cell, first, found, case, 0, (GAPS,)))
    return Outcome(
        f"hayal-{table}",
        f"Table {table}: {printed['title']}",
        SOURCE,
        COLUMNS,
        rows,
        _criterion(repetitions),
        notes=[*_assumed(), *_failures(found)],
        repetitions=repetitions,
        seed=seed,
    )


def reproduce_sub_scenarios(repetitions: int, seed: int, *, wandering: bool = False) -> Outcome:
    """Make table 5.7 anew: outages of 2 to 60 s, with no calibration and with three parts of scenario 3's.

    Parameters
    ----------
    repetitions : how many campaigns of each unit.
    seed : of all random numbers.
    wandering : with biases that walk, to the sheet's in-run stability in an hour, and a filter that knows it.
    """
    printed = hayal()["position_tables"]["5.7"]
    rows: list[Row] = []
    notes = [*_assumed(), f"{NOT_IN_THESIS}: not in the thesis; as the noise has them, not scaled by sigma0."]
    if wandering:
        notes.append(
            "Biases walk from the first pose on, by the sheet's in-run stability in an hour (its "
            "time is assumed), and the filter knows it. What the poses say of a bias is then old on "
            "the cart, and its sigma too small."
        )
    for imu in IMUS:
        found = sub_scenario_positions(imu, repetitions, seed, wandering=wandering)
        for at, duration in enumerate(OUTAGES):
            cells = printed["outages"][imu][f"{duration:g}"]
            label = f"{imu}, {duration:g} s"
            rows.append(
                _original_row(f"{label}, original", imu, cells[0], found, at, (GAPS, SLIDING), duration)
            )
            for cell, (name, case) in zip(cells[1:], list(SUB_SCENARIOS.items())[1:], strict=True):
                rows.append(_row(f"{label}, {name}", cell, cells[0], found, case, at, (GAPS, SLIDING)))
            rows.append(
                _row(f"{label}, {NOT_IN_THESIS}", None, cells[0], found, UNSCALED, at, (GAPS, SLIDING))
            )
        notes += _failures(found, f"{imu}, ")
    return Outcome(
        "hayal-5.7-wandering" if wandering else "hayal-5.7",
        f"Table 5.7: {printed['title']}{', with biases that wander' if wandering else ''}",
        SOURCE,
        BOTH_COLUMNS,
        rows,
        _criterion(repetitions),
        notes=notes,
        repetitions=repetitions,
        seed=seed,
    )


def _criterion(campaigns: int) -> str:
    if campaigns < RANGE:
        return f"judged from {RANGE} campaigns on"
    return (
        f"inside: the original's σ lies between the lowest and the highest of {campaigns} simulated "
        "campaigns. So does what a calibration makes better or worse of it"
    )


def _assumed() -> list[str]:
    north, _, down = FIX_SIGMAS
    assumed = (
        f"Assumed: positions known to {100 * north:g} cm, {100 * down:g} cm in height; a minute of rest on the cart "
        "before it is pulled; outages begin when it is. Which outages the thesis made is not printed: gaps follow one "
        "another with one position between, or each is by itself, with all positions before it."
    )
    better = "Better, %: of the pooled σ against the original's, where both are there; then the range of the campaigns."
    return [assumed, better]


def _failures(found: Found, where: str = "") -> list[str]:
    words: list[str] = []
    for case, positions in found.items():
        parts: list[str] = []
        if positions.unsolved:
            parts.append(f"the adjustment did not settle in {positions.unsolved}")
        if positions.lost:
            parts.append(f"the filter was lost for good in {positions.lost}")
        if parts and case.scaled:
            name = f"scenario {case.scenario}, gyros {case.gyro} par., {case.minutes} min"
            words.append(f"{name}: {', '.join(parts)}")
    return [f"{where}campaigns left out: {'; '.join(words)}."] if words else []


def _original_row(
    label: str,
    imu: str,
    cell: dict[str, float],
    found: Found,
    at: int,
    protocols: tuple[str, ...],
    duration: float = 2.0,
) -> Row:
    """Return the row without calibration, judged by its sigma."""
    ours = found[ORIGINAL]
    cells: list[Value] = [cell["mean"], cell["sigma"], None]
    ratio, fits = np.inf, False
    for protocol in protocols:
        sigmas = ours.sigmas[protocol][:, at]
        means = [float(np.mean(ours.means[protocol][:, at]))] if protocol == GAPS else []
        cells += [
            *means,
            float(pooled(sigmas[:, None])[0]),
            None,
            f"{sigmas.min():.3g} to {sigmas.max():.3g} m",
        ]
        fits |= bool(sigmas.min() <= cell["sigma"] <= sigmas.max())
        ratio = min(ratio, cell["sigma"] / float(sigmas.max()))
    bias = find_grade(imu.lower()).accelerometer.bias
    needed = 2.0 * cell["sigma"] / duration**2
    reason = (
        f"{ratio:.2g} times the worst of ours; from a known start it takes {needed:.2g} m/s² all the time, "
        f"{needed / bias:.2g} times the sheet's bias"
    )
    return _judged(label, cells, fits, reason, len(ours.sigmas[GAPS]))


def _row(
    label: str,
    cell: dict[str, float] | None,
    original: dict[str, float],
    found: Found,
    case: Case,
    at: int,
    protocols: tuple[str, ...],
) -> Row:
    """Return the row of a calibration, judged by what it makes better or worse of the original."""
    ours, before = found[case], found[ORIGINAL]
    said = None if cell is None else 100.0 * (1.0 - cell["sigma"] / original["sigma"])
    cells: list[Value] = [None, None, None] if cell is None else [cell["mean"], cell["sigma"], said]
    fits, ranges = False, list[str]()
    for protocol in protocols:
        better, low, high = _better(before, ours, protocol, at)
        words = "none" if low is None or high is None else f"{low:.3g} to {high:.3g} %"
        mean = ours.means[protocol][:, at]
        means: list[Value] = [float(np.nanmean(mean)) if np.isfinite(mean).any() else None]
        sigma = float(pooled(ours.sigmas[protocol][:, at : at + 1])[0])
        cells += [*(means if protocol == GAPS else []), sigma, better, words]
        ranges.append(words)
        fits |= said is not None and low is not None and high is not None and low <= said <= high
    if said is None:
        return Row(label, "m", tuple(cells))
    reason = f"{_change(said)}, ours by {' or '.join(ranges)}{_because(case, said)}"
    return _judged(label, cells, fits, reason, len(before.sigmas[GAPS]))


def _better(
    before: Positions, after: Positions, protocol: str, at: int
) -> tuple[float | None, float | None, float | None]:
    """Return pooled, least and most improvement, %."""
    column = slice(at, at + 1)
    whole, each = improvements(before.sigmas[protocol][:, column], after.sigmas[protocol][:, column])
    there: AnyArray = each[np.isfinite(each)]
    if not there.size:
        return None, None, None
    return float(whole[0]), float(there.min()), float(there.max())


def _change(said: float) -> str:
    return f"better by {said:.3g} %" if said >= 0.0 else f"worse by {-said:.3g} %"


def _because(case: Case, said: float) -> str:
    if case.gyro == 9:
        return "; nine gyro parameters are off by percents here, and that is no gain" if said > 0.0 else ""
    return ""


def _judged(label: str, cells: list[Value], fits: bool, reason: str, campaigns: int) -> Row:
    if campaigns < RANGE:
        return Row(label, "m", tuple(cells), UNJUDGED, f"fewer than {RANGE} campaigns have no range")
    return Row(label, "m", tuple(cells), INSIDE if fits else OUTSIDE, "" if fits else reason)


def printed_outages(imu: str) -> dict[str, list[dict[str, Any]]]:
    """Return table 5.7's cells of a unit: length of the outage -> original, 3.0, 3.3, 3.9.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    """
    return hayal()["position_tables"]["5.7"]["outages"][imu]
