"""What many calibrations tell: the page of a batch of units, and the page of one unit over time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.document import Calibration, ParameterBlock, ParameterChange
from tumble.fleet import Batch, UnitOutcome
from tumble.parameters import decimals_of, fixed, in_families, parameter_of, said_unit, with_uncertainty
from tumble.report.figures.record import OF_FAMILY, Axis, Bars, Curve, Figure, Look, in_brackets, plain
from tumble.report.page import Block, Facts, Figures, Page, Sentences, Table, section
from tumble.report.parameters import ParameterRow, headed_table, rows_of

MOST_ROWS = 2000
"""Units that the page lists; the table's other forms have them all."""
_BINS = 30


def batch_page(batch: Batch) -> Page:
    """Return what the page of a batch says.

    Parameters
    ----------
    batch : that is done.
    """
    total = len(batch.units)
    verdicts = Counter(unit.verdict for unit in batch.units)
    limits = Counter(unit.limits for unit in batch.units if unit.limits)
    facts = [
        ("Units", str(total)),
        ("Accepted", f"{batch.accepted} ({100 * batch.accepted / total:.1f} %)"),
        ("Verdicts", ", ".join(f"{count} {name}" for name, count in verdicts.most_common())),
    ]
    if limits:
        facts.append(("Limits", ", ".join(f"{count} {name}" for name, count in limits.most_common())))
    blocks: list[Block] = [Facts(facts)]
    if batch.shared or batch.remarks:
        blocks.append(Sentences([*batch.shared, *batch.remarks]))
    blocks += _not_as_the_others(batch)
    blocks += _histograms(batch)
    blocks += _all_units(batch)
    return Page(f"{total} units", blocks, wide=True)


def _not_as_the_others(batch: Batch) -> list[Block]:
    named = [unit for unit in batch.units if not unit.accepted or unit.unit in batch.stand_out]
    if not named:
        words = "Every unit is accepted, and none stands out from the others."
        return section("Units to look at", Sentences([words], "paragraphs"))
    rows = [
        [unit.unit, unit.verdict, unit.limits or "–", " ".join(batch.reasons(unit))]
        for unit in named[:MOST_ROWS]
    ]
    return section("Units to look at", Table(("unit", "verdict", "limits", "why"), rows))


def _histograms(batch: Batch) -> list[Block]:
    units: dict[str, str] = {}
    found: list[ParameterBlock] = []
    for unit in batch.units:
        for name, value, sigma, word in unit.parameters:
            if units.setdefault(name, word) == word:
                found.append(ParameterBlock(name=name, value=value, standard_uncertainty=sigma, unit=word))
    families = in_families([one.name for one in found])
    rows = rows_of([found[at] for places in families.values() for at in places])
    figures = [
        _histogram(f"group-{number}", group, list(members))
        for number, (group, members) in enumerate(groupby(rows, key=lambda row: row.parameter.family.name))
    ]
    if not figures:
        return []
    words = "How each parameter spreads over the units; a unit outside shows as a bar of its own."
    return section("How the units spread", Figures(figures, words))


def _histogram(name: str, group: str, rows: list[ParameterRow]) -> Figure:
    columns: dict[str, list[float]] = {}
    for row in rows:
        columns.setdefault(row.parameter.axes, []).append(row.drawn.value)
    every, unit = [row.drawn.value for row in rows], rows[0].drawn.unit
    low, high = min(every), max(every)
    edges = np.linspace(low, high if high > low else low + 1.0, _BINS + 1)
    middles = [float(f"{x:.6g}") for x in 0.5 * (edges[1:] + edges[:-1])]
    bars = [
        Bars(
            middles,
            np.histogram(column, edges)[0].tolist(),
            axes.replace(" to force ", "←"),
            OF_FAMILY[at % len(OF_FAMILY)],
            opacity=0.75,
            width=0.95 * float(edges[1] - edges[0]),
        )
        for at, (axes, column) in enumerate(columns.items())
    ]
    across = Axis(f"{group} / {in_brackets(unit)}" if unit else group)
    label = f"Histogram of {group} over the units"
    return Figure(name, label, bars, across, Axis("units"), 220, stacked=True)


def _all_units(batch: Batch) -> list[Block]:
    rows = [_row(unit, batch) for unit in batch.units[:MOST_ROWS]]
    rest = len(batch.units) - MOST_ROWS
    words = f"{rest} further units stand in table.csv and table.parquet." if rest > 0 else ""
    table = Table(("unit", "files", "verdict", "limits", "accepted"), rows, folded="Every unit")
    return section("All units", table, Sentences([words] if words else [], "notes"))


def _row(unit: UnitOutcome, batch: Batch) -> list[str]:
    accepted = "yes" if unit.accepted else "no"
    if unit.accepted and unit.unit in batch.stand_out:
        accepted = "yes, but it stands out"
    return [unit.unit, ", ".join(unit.files), unit.verdict, unit.limits or "–", accepted]


HEADS = ("parameter", "newest", "change", "a year", "unit")
_SHOWN = (
    ("last", "standard_uncertainty"),
    ("change", "change_standard_uncertainty"),
    ("rate_a_year", "rate_standard_uncertainty"),
)


def history_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Return newest value, change and rate of each parameter with their uncertainties, a family in one unit.

    Parameters
    ----------
    rows : what is said of each parameter, as the calibrations have it.
    """
    lines: list[tuple[str, list[str]]] = []
    for places in in_families([row["name"] for row in rows]).values():
        own = [rows[k] for k in places]
        factor, unit = said_unit(own[0]["unit"], (abs(row["last"]) for row in own))
        lines += [(row["name"], [*(_cell(row, *keys, factor) for keys in _SHOWN), unit]) for row in own]
    return headed_table(HEADS, lines)


def _cell(row: dict[str, Any], value: str, sigma: str, factor: float) -> str:
    return "–" if row[value] is None else with_uncertainty(factor * row[value], factor * (row[sigma] or 0.0))


def history_page(
    unit: str,
    days: Sequence[str],
    names: Sequence[str],
    units: Sequence[str],
    numbers: tuple[AnyArray, AnyArray],
    rows: Sequence[dict[str, Any]],
) -> Page:
    """Return the page.

    Parameters
    ----------
    unit : its name.
    days : of the calibrations.
    names, units : of the parameters.
    numbers : values and standard uncertainties, (calibrations, parameters) each.
    rows : what is said of each parameter.
    """
    figures = [
        _figure(f"group-{number}", group, places, list(days), names, units, numbers)
        for number, (group, places) in enumerate(in_families(names).items())
    ]
    words = "Each parameter at each calibration, with its expanded uncertainty (k = 2)."
    table = history_table(rows)
    return Page(
        f"{unit}: {len(days)} calibrations",
        [*section("Drift", table), *section("Over time", Figures(figures, words))],
        wide=True,
    )


def _figure(
    name: str,
    group: str,
    places: list[int],
    days: list[str],
    names: Sequence[str],
    units: Sequence[str],
    numbers: tuple[AnyArray, AnyArray],
) -> Figure:
    curves: list[Curve] = []
    factor, unit = said_unit(units[places[0]], np.abs(numbers[0][:, places]).ravel().tolist())
    for at, k in enumerate(places):
        values: Series = factor * numbers[0][:, k]
        expanded: Series = 2.0 * factor * numbers[1][:, k]
        axis = parameter_of(names[k]).axes.replace(" to force ", "←")
        look: Look = {"colour": OF_FAMILY[at % len(OF_FAMILY)], "sigma": expanded, "symbol": "circle"}
        curves.append(Curve(days, plain(values, 8), axis, **look))
    title = f"{group} / {in_brackets(unit)}" if unit else group
    return Figure(name, f"{group} over time", curves, Axis(kind="date"), Axis(title), 380)


def change_table(
    calibration: Calibration, changes: Sequence[ParameterChange], heads: tuple[str, str]
) -> Table:
    """Return each change with its standard uncertainty, in the unit of data sheets and in sigmas.

    Parameters
    ----------
    calibration : whose raw units the changes are in.
    changes : by name, in raw units.
    heads : of the columns of the first value and of the change.
    """
    shown = {row.name: row for row in _rows(calibration, changes)}
    lines = [(change.name, _cells(shown[change.name], change)) for change in changes]
    return headed_table(("parameter", *heads, "in σ", "unit"), lines)


def _rows(calibration: Calibration, changes: Sequence[ParameterChange]) -> list[ParameterRow]:
    """The first values as rows for people; their sigma is the change's, so that both are rounded alike."""
    blocks = [
        ParameterBlock(
            name=change.name,
            value=change.first,
            standard_uncertainty=change.standard_uncertainty or abs(change.second - change.first),
            unit=change.unit,
        )
        for change in changes
    ]
    return rows_of(blocks, calibration)


def _cells(row: ParameterRow, change: ParameterChange) -> list[str]:
    spread = change.standard_uncertainty or abs(change.second - change.first)
    # What has not changed and has no uncertainty has no digits either, and stays as it is in the file.
    first = row.said if spread else row.shown
    factor = first.sigma / spread if spread else 1.0
    moved = factor * (change.second - change.first)
    certain = not change.standard_uncertainty
    return [
        fixed(first.value, decimals_of(first.sigma)) if spread else f"{first.value:.6g}",
        f"{moved:.3g}" if certain else with_uncertainty(moved, factor * change.standard_uncertainty),
        "–" if math.isnan(change.sigmas) else f"{change.sigmas:+.1f}",
        first.unit,
    ]
