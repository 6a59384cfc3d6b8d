"""The page of a batch: how many units are accepted, which are not and why, and how the parameters spread."""

from __future__ import annotations

from collections import Counter
from itertools import groupby

import numpy as np

from tumble.document import ParameterBlock
from tumble.fleet import Batch, UnitOutcome
from tumble.parameters import in_families
from tumble.report.figures.record import OF_FAMILY, Axis, Bars, Figure, in_brackets
from tumble.report.page import Block, Facts, Figures, Page, Sentences, Table, section
from tumble.report.parameters import ParameterRow, rows_of

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
