"""What changed between two calibrations, or what one recovers of the truth, as a table in the units of people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tumble.report.figures.plot import AXIS_COLOURS, base_layout, error_bars, plain, scatter, text_axis
from tumble.report.page import Figure, Figures, Page, Plot, Sentences, Table, section
from tumble.report.parameters import BETWEEN, GROUPS, OPTIONAL, Measure, ParameterRow, parameter_rows
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.document.difference import ParameterChange
    from tumble.document.result import Calibration

    _Trace: TypeAlias = tuple[str, Series, Series]

# Families of these groups say themselves what they are of.
_STEMS = {BETWEEN: "", OPTIONAL: ""}


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
    rows: list[list[str]] = []
    looks: dict[int, str] = {}
    shown = {row.name: row for row in _rows(calibration, changes)}
    for group in GROUPS:
        own = [change for change in changes if shown[change.name].group == group]
        if own:
            looks[len(rows)] = "group"
            rows.append([group])
        rows += [_line(shown[change.name], change) for change in own]
    return Table(("parameter", *heads, "in σ", "unit"), rows, looks, right=(1, 2, 3))


def _rows(calibration: Calibration, changes: Sequence[ParameterChange]) -> list[ParameterRow]:
    """The first values as rows for people; their sigma is the change's, so that both are rounded alike."""
    from tumble.document.result import ParameterBlock

    blocks = [
        ParameterBlock(
            name=change.name,
            value=change.first,
            standard_uncertainty=change.standard_uncertainty or abs(change.second - change.first),
            unit=change.unit,
        )
        for change in changes
    ]
    return parameter_rows(calibration.model_copy(update={"parameters": blocks}))


def changes_table(
    calibration: Calibration, later: Sequence[Sequence[ParameterChange]], labels: Sequence[str]
) -> Table:
    """Return the changes of several calibrations since the first, side by side.

    Parameters
    ----------
    calibration : the first, whose raw units the changes are in.
    later : of each later one.
    labels : of all, the first one's first.
    """
    rows: list[list[str]] = []
    looks: dict[int, str] = {}
    several = list(zip(*_common(later), strict=True))
    shown = [_rows(calibration, [changes[0]])[0] for changes in several]
    for group in GROUPS:
        own = [(row, changes) for row, changes in zip(shown, several, strict=True) if row.group == group]
        if own:
            looks[len(rows)] = "group"
            rows.append([group])
        for row, changes in own:
            label, first, _, _, unit = _line(row, changes[0])
            factor = _measure(row, changes[0])[1]
            rows.append([label, first, *(_moved(change, factor) for change in changes), unit])
    heads = ("parameter", labels[0], *(f"{label} − {labels[0]}" for label in labels[1:]), "unit")
    return Table(heads, rows, looks, right=range(1, len(heads) - 1))


def difference_page(
    calibration: Calibration,
    later: Sequence[Sequence[ParameterChange]],
    labels: Sequence[str],
    sentences: Sequence[str],
) -> Page:
    """Return a page with the changes since the first calibration, as a table and as figures.

    Parameters
    ----------
    calibration, later, labels : as of `changes_table`.
    sentences : what is said of the changes.
    """
    families: dict[str, list[_Trace]] = {}
    for changes in zip(*_common(later), strict=True):
        row = _rows(calibration, [changes[0]])[0]
        measure, factor = _measure(row, changes[0])
        moved = np.array([0.0, *(factor * (change.second - change.first) for change in changes)])
        spread = np.array([0.0, *(2.0 * factor * change.standard_uncertainty for change in changes)])
        title = f"{_STEMS.get(row.group, row.group.lower())} {row.family}, {measure.unit}".strip()
        families.setdefault(title, []).append((row.label, moved, spread))
    figures = [
        _figure(f"change-{number}", title, list(labels), traces)
        for number, (title, traces) in enumerate(families.items())
    ]
    words = "Each parameter less its first value, with its expanded uncertainty (k = 2)."
    return Page(
        f"{labels[0]} to {labels[-1]}",
        [
            Sentences(sentences, "paragraphs"),
            *section("What changed", changes_table(calibration, later, labels)),
            *section("One after another", Figures(figures, words)),
        ],
        wide=True,
    )


def _common(later: Sequence[Sequence[ParameterChange]]) -> list[list[ParameterChange]]:
    """The parameters that all have, in the first one's order."""
    by_name = [{change.name: change for change in changes} for changes in later]
    order = [change.name for change in later[0] if all(change.name in own for own in by_name)]
    return [[own[name] for name in order] for own in by_name]


def _figure(name: str, title: str, labels: list[str], traces: Sequence[_Trace]) -> Figure:
    drawn: list[Plot] = []
    colours = list(AXIS_COLOURS.values())
    for number, (label, moved, spread) in enumerate(traces):
        end = label.rpartition(" ")[2]
        colour = colours[number % len(colours)]
        look = {"name": end, "marker": {"color": colour}, "line": {"color": colour}}
        drawn.append(scatter(labels, plain(moved, 8), "lines+markers", error_y=error_bars(spread), **look))
    layout = base_layout(
        240, xaxis=text_axis("", type="category"), yaxis=text_axis(title.replace(" ", "<br>", 1))
    )
    return Figure(name, f"Change of {title}", drawn, layout)


def _measure(row: ParameterRow, change: ParameterChange) -> tuple[Measure, float]:
    """The first value in the unit of data sheets, and how many of that unit a raw unit is."""
    measure = row.shown
    if row.family in ("bias", "g-sensitivity") and row.other is not None and not math.isnan(row.other.value):
        measure = row.other
    spread = change.standard_uncertainty or abs(change.second - change.first)
    return (measure, measure.sigma / spread) if spread else (row.shown, 1.0)


def _moved(change: ParameterChange, factor: float) -> str:
    moved = factor * (change.second - change.first)
    if not change.standard_uncertainty:
        return f"{moved:.3g}"
    return with_uncertainty(moved, factor * change.standard_uncertainty)


def _line(row: ParameterRow, change: ParameterChange) -> list[str]:
    measure, factor = _measure(row, change)
    moved = _moved(change, factor)
    sigmas = "–" if math.isnan(change.sigmas) else f"{change.sigmas:+.1f}"
    first = with_uncertainty(measure.value, measure.sigma).partition(" ")[0].lstrip("(")
    return [row.label, f"{measure.value:.6g}" if "×" in first else first, moved, sigmas, measure.unit]
