"""A reproduced table or figure as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.figures.plot import RED, base_layout, faint, plain, scatter, text_axis
from tumble.report.figures.svg_plot import COLOURS, above_zero, few_places
from tumble.report.html import render_page
from tumble.report.page import Block, Figure, Figures, Page, Sentences, Table
from tumble.report.reproduction import cell_text, summary_lines

if TYPE_CHECKING:
    from tumble.reproduction.outcome import Outcome, Plot


def render_outcome(outcome: Outcome) -> str:
    """Return the outcome as one HTML page that works offline, with figures to point at.

    Parameters
    ----------
    outcome : what to show.
    """
    return render_page(_outcome_page(outcome))


def _outcome_page(outcome: Outcome) -> Page:
    """Return what is said of an outcome."""
    blocks: list[Block] = [Sentences([outcome.source, " ".join(summary_lines(outcome))], "paragraphs")]
    blocks += [Figures([_figure(plot)], _caption(plot)) for plot in outcome.plots]
    common = _common_reason(outcome)
    if common:
        blocks.append(Sentences([f"No row is judged: {common}."], "paragraphs"))
    blocks.append(_table(outcome, common))
    if outcome.notes:
        blocks.append(Sentences(outcome.notes))
    return Page(outcome.title, [*blocks, Sentences([f"Again: `{outcome.command}`"], "paragraphs")], wide=True)


def _common_reason(outcome: Outcome) -> str:
    """The reason that several rows have and no other is given, where none is judged: said once, not below each."""
    reasons = [row.reason for row in outcome.rows if row.reason]
    judged = any(row.verdict for row in outcome.rows)
    return reasons[0] if len(reasons) > 1 and len(set(reasons)) == 1 and not judged else ""


def _table(outcome: Outcome, common: str) -> Table:
    """Return the rows; the reason of a verdict stands below its row, in all its width."""
    heads = ("", "unit", "verdict", *outcome.columns)
    cells: list[list[str]] = []
    looks: dict[int, str] = {}
    for row in outcome.rows:
        why = row.reason if row.reason != common else ""
        looks[len(cells)] = " ".join(look for look in (row.verdict, "has-why" if why else "") if look)
        cells.append([row.label, row.unit, row.verdict, *map(cell_text, row.cells)])
        if why:
            looks[len(cells)] = "why"
            cells.append([why])
    first = outcome.rows[0].cells if outcome.rows else ()
    right = [3 + place for place, value in enumerate(first) if isinstance(value, int | float)]
    return Table(heads, cells, looks, right)


def _caption(plot: Plot) -> str:
    marks = f"; crosses: {plot.marks.name}" if plot.marks is not None else ""
    return f"{plot.title}: line: {plot.line}, band: {plot.band}{marks}"


def _figure(plot: Plot) -> Figure:
    data: list[dict[str, Any]] = []
    for curve, colour in zip(plot.curves, COLOURS, strict=False):
        x = plain(curve.x)
        low = curve.low if plot.linear else above_zero(curve)
        data += [
            _edge(x, low, colour, curve.name),
            _edge(x, curve.high, colour, curve.name, fill="tonexty", fillcolor=faint(colour)),
            _points(curve.name, x, curve.y, "lines+markers", line={"color": colour}),
        ]
    if plot.marks is not None:
        marker = {"symbol": "x-thin", "size": 9, "color": RED, "line": {"width": 2, "color": RED}}
        data.append(_points(plot.marks.name, plain(plot.marks.x), plot.marks.y, "markers", marker=marker))
    kind: dict[str, Any] = {} if plot.linear else {"type": "log", "exponentformat": "power", "dtick": 1}
    few = few_places(plot)
    across = {"type": "log", "tickvals": few, "ticktext": [f"{x:g}" for x in few]} if few else kind
    layout = base_layout(380, xaxis=text_axis(plot.x_label, **across), yaxis=text_axis(plot.y_label, **kind))
    layout["legend"]["traceorder"] = "normal"
    return Figure(plot.name, plot.title, data, layout)


def _points(name: str, x: Any, y: np.ndarray, mode: str, **look: Any) -> dict[str, Any]:
    return scatter(x, y, mode, name=name, hovertemplate="%{x:.3g}: %{y:.3g}", **look)


def _edge(x: Any, y: np.ndarray, colour: str, name: str, **look: Any) -> dict[str, Any]:
    hidden = {"showlegend": False, "hoverinfo": "skip", "legendgroup": name}
    return scatter(x, y, "lines", line={"width": 0, "color": colour}, **hidden, **look)
