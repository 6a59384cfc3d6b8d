"""Tables 5.5 to 5.7 and figures 5.5 to 5.8 of Hayal (2010): positions after outages, by scenario of calibration.

The thesis' recordings are not public: simulated campaigns of units of the same data sheets stand for them.

The pictures' numbers are those of the tables. What is judged of them is what only a picture tells: how far the
scenarios lie apart, and how the errors grow with the length of an outage.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Marks, Outcome, Plot, Row, Value
from tumble.simulation import find_grade
from tumble_papers.hayal.field_campaign import (
    EVERY_SCENARIO,
    FIX_SIGMAS,
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
from tumble_papers.hayal.scenarios import IMUS, MINUTES, SCENARIOS
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


_MINUTES = np.array(MINUTES, dtype=float)
_LENGTHS = np.array(OUTAGES)
_GYROS = (3, 9)


def reproduce_scenario_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 5.5 (HG1700) or 5.6 (HG1900) anew: scenarios 1 to 4 after outages of 2 s.

    Parameters
    ----------
    figure : "5.5" or "5.6".
    repetitions, seed : how many campaigns, from what.
    """
    found = scenario_positions(figure, repetitions, seed)
    printed = hayal()["position_tables"][figure]
    said = {
        gyro: np.array(
            [
                [row["minutes"][str(m)]["sigma"] for m in MINUTES]
                for row in printed["rows"]
                if row["gyro_parameters"] == gyro
            ]
        )
        for gyro in _GYROS
    }
    rows = [_spread_row(gyro, said[gyro], _by_scenario(found, gyro)) for gyro in _GYROS]
    rows.append(_nine_row(said, found))
    plots = [_scenario_plot(figure, gyro, said[gyro], found) for gyro in _GYROS]
    return Outcome(
        f"hayal-figure-{figure}",
        f"Figure {figure}: position errors after outages of 2 s by scenario, {TABLES[figure]}",
        SOURCE,
        ("thesis", "ours: median", "lowest", "highest"),
        rows,
        _figure_criterion(repetitions),
        plots,
        repetitions=repetitions,
        seed=seed,
    )


def _figure_criterion(campaigns: int) -> str:
    if campaigns < RANGE:
        return f"judged from {RANGE} campaigns on"
    return f"inside: the thesis' number lies between the lowest and the highest of {campaigns} simulated campaigns"


def _by_scenario(found: Found, gyro: int) -> AnyArray:
    """Return (campaigns, scenarios, minutes) m."""
    return np.stack(
        [
            np.stack(
                [found[Case(s, m, gyro)].sigmas[GAPS][:, 0] for m in MINUTES],
                axis=1,
            )
            for s in SCENARIOS
        ],
        axis=1,
    )


def _spread_row(gyro: int, said: AnyArray, ours: AnyArray) -> Row:
    flat = ours.reshape(len(ours), -1)
    apart: Series = np.nanmax(flat, axis=1) / np.nanmin(flat, axis=1)
    label = f"gyros {gyro} par.: largest σ over the smallest, all scenarios and minutes"
    return _figure_row(
        label,
        float(said.max() / said.min()),
        apart,
        "the thesis' scenarios lie {} apart than ours",
        ("farther", "less far"),
    )


def _nine_row(said: dict[int, AnyArray], found: Found) -> Row:
    """In how many of the twelve cells nine gyro parameters give the better position."""
    three, nine = (_by_scenario(found, gyro) for gyro in _GYROS)
    better = np.sum(np.where(np.isfinite(nine), nine, np.inf) < three, axis=(1, 2)).astype(float)
    count = float(np.sum(said[9] < said[3]))
    return _figure_row(
        "cells of 12 in which nine gyro parameters are better than three",
        count,
        better,
        "{} than in ours",
        ("more", "fewer"),
    )


def _figure_row(
    label: str, said: float, ours: Series, words: str, either: tuple[str, str], campaigns: int | None = None
) -> Row:
    """The thesis' number beside ours, of which a campaign may have several."""
    cells = (said, float(np.median(ours)), float(ours.min()), float(ours.max()))
    if (len(ours) if campaigns is None else campaigns) < RANGE:
        return Row(label, "", cells, UNJUDGED, f"fewer than {RANGE} campaigns have no range")
    if cells[2] <= said <= cells[3]:
        return Row(label, "", cells, INSIDE)
    return Row(label, "", cells, OUTSIDE, words.format(either[0] if said > cells[3] else either[1]))


def _curve(name: str, x: Series, sigmas: AnyArray) -> Curve:
    """The median with the lowest and the highest of the campaigns: a few that are lost make every mean."""
    there = np.isfinite(sigmas).any(axis=0)
    middle, low, high = (
        np.where(there, function(np.where(there, sigmas, 1.0), axis=0), np.nan)
        for function in (np.nanmedian, np.nanmin, np.nanmax)
    )
    return Curve(name, x, np.asarray(middle), np.asarray(low), np.asarray(high))


def _scenario_plot(figure: str, gyro: int, said: AnyArray, found: Found) -> Plot:
    ours = _by_scenario(found, gyro)
    curves = tuple(_curve(f"sc. {s}", _MINUTES, ours[:, k]) for k, s in enumerate(SCENARIOS))
    marks = Marks(f"thesis, table {figure}", np.tile(_MINUTES, len(said)), said.ravel())
    return Plot(
        f"gyros-{gyro}",
        f"{TABLES[figure]}, 2 s, gyros {gyro} par.",
        "minutes of each pose",
        "σ of the position / m",
        curves,
        marks,
        line="median",
        band="all campaigns",
    )


def reproduce_outage_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 5.7 (HG1700) or 5.8 (HG1900) anew: parts of scenario 3 after outages of 2 to 60 s.

    Parameters
    ----------
    figure : "5.7" or "5.8".
    repetitions, seed : how many campaigns, from what.
    """
    imu = {"5.7": "HG1700", "5.8": "HG1900"}[figure]
    found = sub_scenario_positions(imu, repetitions, seed, wandering=False)
    printed = printed_outages(imu)
    said = np.array([[cell["sigma"] for cell in printed[f"{length:g}"]] for length in OUTAGES])
    rows = [
        _growth_row(name, at, said[:, k], found[case])
        for k, (name, case) in enumerate(SUB_SCENARIOS.items())
        for at in range(len(OUTAGES) - 1)
    ]
    plots = [_outage_plot(imu, protocol, said, found) for protocol in (GAPS, SLIDING)]
    return Outcome(
        f"hayal-figure-{figure}",
        f"Figure {figure}: position errors by the length of the outage, {imu}",
        SOURCE,
        ("thesis", "ours: median", "lowest", "highest"),
        rows,
        f"{_figure_criterion(repetitions)}, with gaps or each outage by itself",
        plots,
        [_EXPONENTS],
        repetitions,
        seed,
    )


_EXPONENTS = (
    "The exponent p of σ ~ tᵖ between two lengths. It is 1 of an error of velocity, 2 of a constant "
    "error of the accelerometers or of the tilt. It is 3 of a constant error of the gyros from a "
    "start that is known, 1.5 and 2.5 of their white noise. More is a filter that is worse after "
    "every longer gap."
)


def _growth_row(name: str, at: int, said: Series, ours: Positions) -> Row:
    ratio = np.log(_LENGTHS[at + 1] / _LENGTHS[at])
    exponents = [
        np.log(ours.sigmas[protocol][:, at + 1] / ours.sigmas[protocol][:, at]) / ratio
        for protocol in (GAPS, SLIDING)
    ]
    both = np.concatenate(exponents)
    growth = float(np.log(said[at + 1] / said[at]) / ratio)
    label = f"{name}: exponent from {_LENGTHS[at]:g} to {_LENGTHS[at + 1]:g} s"
    whole = np.isfinite(np.stack(exponents)).any(axis=0)
    return _figure_row(
        label,
        growth,
        both[np.isfinite(both)],
        "it grows {} than ours",
        ("faster", "more slowly"),
        int(whole.sum()),
    )


def _outage_plot(imu: str, protocol: str, said: AnyArray, found: Found) -> Plot:
    curves = tuple(
        _curve(name, _LENGTHS, found[case].sigmas[protocol]) for name, case in SUB_SCENARIOS.items()
    )
    words = "gaps with one position between" if protocol == GAPS else "each outage by itself"
    marks = Marks("thesis, table 5.7", np.repeat(_LENGTHS, said.shape[1]), said.ravel())
    return Plot(
        protocol,
        f"{imu}, {words}",
        "outage / s",
        "σ of the position / m",
        curves,
        marks,
        line="median",
        band="all campaigns",
    )
