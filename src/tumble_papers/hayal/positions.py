"""Tables 5.5 to 5.7 and figures 5.5 to 5.8 of Hayal (2010): positions after outages, by scenario of calibration.

The thesis' recordings are not public: simulated campaigns of units of the same data sheets stand for them.

The pictures' numbers are those of the tables. What is judged of them is what only a picture tells: how far the
scenarios lie apart, and how the errors grow with the length of an outage.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.reproduction import Curve, Marks, Plot, Row, Value
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
    Campaigns,
    Case,
    Positions,
    improvements,
    pooled,
    run_campaigns,
)
from tumble_papers.hayal.scenarios import IMUS, MINUTES, SCENARIOS
from tumble_papers.study import Found, Study, hayal, judge

TABLES = {"5.5": "HG1700", "5.6": "HG1900"}
# Fewer campaigns than this are no range.
RANGE = 4
NOT_IN_THESIS = "3.9, plain sigmas"


def scenario_positions(table: str, repetitions: int, seed: int) -> Campaigns:
    """Return what table 5.5 or 5.6 is made of.

    Parameters
    ----------
    table : its number.
    repetitions, seed : how many campaigns, from what.
    """
    return run_campaigns(TABLES[table], EVERY_SCENARIO, OUTAGES[:1], (GAPS,), repetitions, seed)


def sub_scenario_positions(imu: str, repetitions: int, seed: int, *, wandering: bool) -> Campaigns:
    """Return what table 5.7 is made of.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    repetitions, seed : how many campaigns, from what.
    wandering : whether biases walk, to the sheet's in-run stability in an hour.
    """
    cases = (*SUB_SCENARIOS.values(), UNSCALED)
    return run_campaigns(imu, cases, OUTAGES, (GAPS, SLIDING), repetitions, seed, wandering=wandering)


def _scenario_table(table: str, repetitions: int, seed: int) -> Found:
    """Make table 5.5 or 5.6 anew: positions after outages of 2 s, scenarios 1 to 4 with 1, 3 and 5 minutes."""
    printed, imu = hayal()["position_tables"][table], TABLES[table]
    found = scenario_positions(table, repetitions, seed)
    first = printed["original"]
    rows = [_original_row("original", imu, first, found, 0)]
    for entry in printed["rows"]:
        for minutes, cell in entry["minutes"].items():
            case = Case(entry["scenario"], int(minutes), entry["gyro_parameters"])
            rows.append(_row(case.words, cell, first, found, case, 0))
    return _found(rows, repetitions, notes=_failures(found))


def _sub_scenario_table(repetitions: int, seed: int, *, wandering: bool) -> Found:
    """Make table 5.7 anew: outages of 2 to 60 s, with no calibration and with three parts of scenario 3's.

    With biases that walk, to the sheet's in-run stability in an hour, the filter knows it.
    """
    rows: list[Row] = []
    notes = [f"{NOT_IN_THESIS}: not in the thesis; as the noise has them, not scaled by sigma0."]
    if wandering:
        notes.append(
            "Biases walk from the first pose on, by the sheet's in-run stability in an hour (its "
            "time is assumed), and the filter knows it. What the poses say of a bias is then old on "
            "the cart, and its sigma too small."
        )
    for imu in IMUS:
        found = sub_scenario_positions(imu, repetitions, seed, wandering=wandering)
        for at, duration in enumerate(OUTAGES):
            first, *cells = printed_outages(imu)[f"{duration:g}"]
            label = f"{imu}, {duration:g} s"
            rows.append(_original_row(f"{label}, original", imu, first, found, at, duration))
            cases = [*list(SUB_SCENARIOS.items())[1:], (NOT_IN_THESIS, UNSCALED)]
            for cell, (name, case) in zip([*cells, None], cases, strict=True):
                rows.append(_row(f"{label}, {name}", cell, first, found, case, at))
        notes += _failures(found, f"{imu}, ")
    return _found(rows, repetitions, notes=notes)


def _found(rows: list[Row], campaigns: int, plots: Sequence[Plot] = (), notes: Sequence[str] = ()) -> Found:
    north, _, down = (100.0 * FIX_SIGMAS).tolist()
    said = {"north": north, "down": down, "enough": RANGE}
    return Found(rows, [*plots], [*notes], said, few=campaigns < RANGE)


def _failures(found: Campaigns, where: str = "") -> list[str]:
    words: list[str] = []
    for case, positions in found.items():
        parts: list[str] = []
        if positions.unsolved:
            parts.append(f"the adjustment did not settle in {positions.unsolved}")
        if positions.lost:
            parts.append(f"the filter was lost for good in {positions.lost}")
        if parts and case.scaled:
            words.append(f"{case.words}: {', '.join(parts)}")
    return [f"{where}campaigns left out: {'; '.join(words)}."] if words else []


def _original_row(
    label: str, imu: str, cell: dict[str, float], found: Campaigns, at: int, duration: float = 2.0
) -> Row:
    """Return the row without calibration, judged by its sigma."""
    ours = found[ORIGINAL]
    cells: list[Value] = [cell["mean"], cell["sigma"], None]
    ratio, fits = np.inf, False
    for protocol, all_sigmas in ours.sigmas.items():
        sigmas = all_sigmas[:, at]
        cells += [float(np.mean(ours.means[protocol][:, at]))] if protocol == GAPS else []
        cells += [float(pooled(sigmas[:, None])[0]), None, f"{sigmas.min():.3g} to {sigmas.max():.3g} m"]
        fits |= bool(sigmas.min() <= cell["sigma"] <= sigmas.max())
        ratio = min(ratio, cell["sigma"] / float(sigmas.max()))
    needed = 2.0 * cell["sigma"] / duration**2
    reason = (
        f"{ratio:.2g} times the worst of ours; from a known start it takes {needed:.2g} m/s² all the time, "
        f"{needed / find_grade(imu.lower()).accelerometer.bias:.2g} times the sheet's bias"
    )
    return Row(label, "m", tuple(cells), *judge(fits, reason, _too_few(len(ours.sigmas[GAPS]))))


def _row(
    label: str,
    cell: dict[str, float] | None,
    original: dict[str, float],
    found: Campaigns,
    case: Case,
    at: int,
) -> Row:
    """Return the row of a calibration, judged by what it makes better or worse of the original."""
    ours, before = found[case], found[ORIGINAL]
    said = None if cell is None else 100.0 * (1.0 - cell["sigma"] / original["sigma"])
    cells: list[Value] = [None, None, None] if cell is None else [cell["mean"], cell["sigma"], said]
    fits, ranges, column = False, list[str](), slice(at, at + 1)
    for protocol, sigmas in ours.sigmas.items():
        whole, each = improvements(before.sigmas[protocol][:, column], sigmas[:, column])
        there: AnyArray = each[np.isfinite(each)]
        ranges.append(f"{there.min():.3g} to {there.max():.3g} %" if there.size else "none")
        if protocol == GAPS:
            mean = ours.means[protocol][:, at]
            cells.append(float(np.nanmean(mean)) if np.isfinite(mean).any() else None)
        cells += [float(pooled(sigmas[:, column])[0]), float(whole[0]) if there.size else None, ranges[-1]]
        fits |= said is not None and bool(there.size) and bool(there.min() <= said <= there.max())
    if said is None:
        return Row(label, "m", tuple(cells))
    reason = f"{'better' if said >= 0.0 else 'worse'} by {abs(said):.3g} %, ours by {' or '.join(ranges)}"
    if case.gyro == 9 and said > 0.0:
        reason += "; nine gyro parameters are off by percents here, and that is no gain"
    return Row(label, "m", tuple(cells), *judge(fits, reason, _too_few(len(before.sigmas[GAPS]))))


def _too_few(campaigns: int) -> str | None:
    return f"fewer than {RANGE} campaigns have no range" if campaigns < RANGE else None


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


def _scenario_figure(figure: str, repetitions: int, seed: int) -> Found:
    """Make figure 5.5 (HG1700) or 5.6 (HG1900) anew: scenarios 1 to 4 after outages of 2 s."""
    found = scenario_positions(figure, repetitions, seed)
    printed = hayal()["position_tables"][figure]["rows"]
    sigmas = [[row["minutes"][str(m)]["sigma"] for m in MINUTES] for row in printed]
    said = {
        gyro: np.array([s for s, row in zip(sigmas, printed, strict=True) if row["gyro_parameters"] == gyro])
        for gyro in _GYROS
    }
    ours = {gyro: _by_scenario(found, gyro) for gyro in _GYROS}
    rows = [_spread_row(gyro, said[gyro], ours[gyro]) for gyro in _GYROS]
    rows.append(_nine_row(said, ours))
    plots = [_scenario_plot(figure, gyro, said[gyro], ours[gyro]) for gyro in _GYROS]
    return _found(rows, repetitions, plots)


def _by_scenario(found: Campaigns, gyro: int) -> AnyArray:
    """Return (campaigns, scenarios, minutes) m."""
    sigmas = [[found[Case(s, m, gyro)].sigmas[GAPS][:, 0] for m in MINUTES] for s in SCENARIOS]
    return np.moveaxis(np.array(sigmas), -1, 0)


def _spread_row(gyro: int, said: AnyArray, ours: AnyArray) -> Row:
    flat = ours.reshape(len(ours), -1)
    apart: Series = np.nanmax(flat, axis=1) / np.nanmin(flat, axis=1)
    label = f"gyros {gyro} par.: largest σ over the smallest, all scenarios and minutes"
    words = "the thesis' scenarios lie {} apart than ours"
    return _figure_row(label, float(said.max() / said.min()), apart, words, ("farther", "less far"))


def _nine_row(said: dict[int, AnyArray], ours: dict[int, AnyArray]) -> Row:
    """In how many of the twelve cells nine gyro parameters give the better position."""
    better = np.sum(np.where(np.isfinite(ours[9]), ours[9], np.inf) < ours[3], axis=(1, 2)).astype(float)
    label = "cells of 12 in which nine gyro parameters are better than three"
    return _figure_row(label, float(np.sum(said[9] < said[3])), better, "{} than in ours", ("more", "fewer"))


def _figure_row(
    label: str, said: float, ours: Series, words: str, either: tuple[str, str], campaigns: int | None = None
) -> Row:
    """The thesis' number beside ours, of which a campaign may have several."""
    cells = (said, float(np.median(ours)), float(ours.min()), float(ours.max()))
    why = words.format(either[0] if said > cells[3] else either[1])
    few = _too_few(len(ours) if campaigns is None else campaigns)
    return Row(label, "", cells, *judge(cells[2] <= said <= cells[3], why, few))


def _curve(name: str, x: Series, sigmas: AnyArray) -> Curve:
    """The median with the lowest and the highest of the campaigns: a few that are lost make every mean."""
    there = np.isfinite(sigmas).any(axis=0)
    middle, low, high = (
        np.where(there, function(np.where(there, sigmas, 1.0), axis=0), np.nan)
        for function in (np.nanmedian, np.nanmin, np.nanmax)
    )
    return Curve(name, x, np.asarray(middle), np.asarray(low), np.asarray(high))


def _scenario_plot(figure: str, gyro: int, said: AnyArray, ours: AnyArray) -> Plot:
    curves = tuple(_curve(f"sc. {s}", _MINUTES, ours[:, k]) for k, s in enumerate(SCENARIOS))
    marks = Marks(f"thesis, table {figure}", np.tile(_MINUTES, len(said)), said.ravel())
    title = f"{TABLES[figure]}, 2 s, gyros {gyro} par."
    return _plot(f"gyros-{gyro}", title, "minutes of each pose", curves, marks)


def _plot(name: str, title: str, x_label: str, curves: tuple[Curve, ...], marks: Marks) -> Plot:
    y_label = "σ of the position / m"
    return Plot(name, title, x_label, y_label, curves, marks, line="median", band="all campaigns")


def _outage_figure(imu: str, repetitions: int, seed: int) -> Found:
    """Make figure 5.7 (HG1700) or 5.8 (HG1900) anew: parts of scenario 3 after outages of 2 to 60 s."""
    found = sub_scenario_positions(imu, repetitions, seed, wandering=False)
    printed = printed_outages(imu)
    said = np.array([[cell["sigma"] for cell in printed[f"{length:g}"]] for length in OUTAGES])
    rows = [
        _growth_row(name, at, said[:, k], found[case])
        for k, (name, case) in enumerate(SUB_SCENARIOS.items())
        for at in range(len(OUTAGES) - 1)
    ]
    plots = [_outage_plot(imu, protocol, said, found) for protocol in (GAPS, SLIDING)]
    return _found(rows, repetitions, plots)


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
    ours_told, count = both[np.isfinite(both)], int(whole.sum())
    return _figure_row(label, growth, ours_told, "it grows {} than ours", ("faster", "more slowly"), count)


def _outage_plot(imu: str, protocol: str, said: AnyArray, found: Campaigns) -> Plot:
    curves = tuple(
        _curve(name, _LENGTHS, found[case].sigmas[protocol]) for name, case in SUB_SCENARIOS.items()
    )
    words = "gaps with one position between" if protocol == GAPS else "each outage by itself"
    marks = Marks("thesis, table 5.7", np.repeat(_LENGTHS, said.shape[1]), said.ravel())
    return _plot(protocol, f"{imu}, {words}", "outage / s", curves, marks)


STUDIES = (
    *(Study(f"hayal-{t}", partial(_scenario_table, t)) for t in TABLES),
    Study("hayal-5.7", partial(_sub_scenario_table, wandering=False)),
    Study("hayal-5.7-wandering", partial(_sub_scenario_table, wandering=True)),
    *(Study(f"hayal-figure-{f}", partial(_scenario_figure, f)) for f in TABLES),
    Study("hayal-figure-5.7", partial(_outage_figure, "HG1700")),
    Study("hayal-figure-5.8", partial(_outage_figure, "HG1900")),
)
"""Tables 5.5 to 5.7, as the thesis has them and with biases that wander, and figures 5.5 to 5.8."""
