"""A reproduced table or figure for people: on the terminal, as a page, as a picture, as data."""

from __future__ import annotations

import html
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.report.figure import BLUE, GREEN, Figure, base_layout, plain, text_axis
from tumble.report.svg_plot import above_zero, draw_plot

if TYPE_CHECKING:
    from tumble.studies.outcome import Outcome, Plot, Row, Value

_COLOURS = (BLUE, GREEN)


def cell_text(value: Value) -> str:
    """Return a cell for people: three significant digits, no needless zeros.

    Examples
    --------
    >>> cell_text(0.000123456), cell_text(20600.0), cell_text(None), cell_text("2: noise"), cell_text(0.0)
    ('0.000123', '20600', '', '2: noise', '0')
    """
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if value == 0.0:
        return "0"
    if not np.isfinite(value):
        return "none"
    if 1e-4 <= abs(value) < 1e7:
        return f"{float(f'{value:.3g}'):.10g}" if abs(value) < 1000.0 else f"{value:.0f}"
    return f"{value:.2e}"


def outcome_lines(outcome: Outcome) -> list[str]:
    """Return the outcome as lines of plain text with aligned columns."""
    heads = ["", *outcome.columns, "unit", "verdict"]
    cells = [[row.label, *(cell_text(c) for c in row.cells), row.unit, _verdict(row)] for row in outcome.rows]
    width = [max(len(line[i]) for line in [heads, *cells]) for i in range(len(heads))]

    def line(parts: list[str]) -> str:
        return "  ".join(part.ljust(w) for part, w in zip(parts, width, strict=True)).rstrip()

    lines = [outcome.title, f"({outcome.source})", "", line(heads), *(line(c) for c in cells), ""]
    lines += [*_summary(outcome), *(f"- {note}" for note in outcome.notes)]
    return lines


def _verdict(row: Row) -> str:
    return f"{row.verdict}{': ' if row.verdict and row.reason else ''}{row.reason}"


def _summary(outcome: Outcome) -> list[str]:
    inside, judged = outcome.counts
    runs = "1 run" if outcome.repetitions == 1 else f"{outcome.repetitions} runs"
    words = [f"{runs}, seed {outcome.seed}, {outcome.seconds:.2g} s."]
    if judged:
        words.append(
            f"{inside} of {judged} rows inside. {outcome.criterion[:1].upper()}{outcome.criterion[1:]}."
        )
    return words


def outcome_json(outcome: Outcome) -> str:
    """Return the outcome as JSON with all digits."""

    def plain_data(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return [None if not np.isfinite(v) else float(v) for v in value]
        if isinstance(value, dict):
            return {key: plain_data(v) for key, v in cast("dict[str, Any]", value).items()}
        if isinstance(value, list | tuple):
            return [plain_data(v) for v in cast("list[Any]", value)]
        return None if isinstance(value, float) and not np.isfinite(value) else value

    return json.dumps(plain_data(asdict(outcome)), indent=1, ensure_ascii=False) + "\n"


def outcome_pictures(outcome: Outcome) -> dict[str, str]:
    """Return the figures as SVG by file name, without the need of any program to draw them."""
    return {f"{outcome.item}-{plot.name}.svg": draw_plot(plot) for plot in outcome.plots}


def render_outcome(outcome: Outcome) -> str:
    """Return the outcome as one HTML page that works offline, with figures to point at."""
    from tumble.report.html import standalone_page

    figures = [_figure(plot) for plot in outcome.plots]
    # The verdict stands where a narrow window shows it; the heads break into lines.
    heads = "".join(
        f'<th style="white-space:normal">{html.escape(head)}</th>'
        for head in ("", "unit", "verdict", *outcome.columns, "why")
    )
    rows = "".join(
        "<tr>"
        + "".join(
            f"<td>{html.escape(text)}</td>"
            for text in (row.label, row.unit, row.verdict, *(cell_text(c) for c in row.cells))
        )
        + f'<td style="white-space:normal{";min-width:20em" if row.reason else ""}">{html.escape(row.reason)}</td></tr>'
        for row in outcome.rows
    )
    places = "".join(
        f"<figure><figcaption>{html.escape(plot.title)}: line: mean, band: 5 % to 95 % of the runs</figcaption>"
        f'<div id="{figure.name}" role="img" aria-label="{html.escape(figure.label)}" '
        f'style="height:{figure.height}px"></div></figure>'
        for plot, figure in zip(outcome.plots, figures, strict=True)
    )
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in outcome.notes)
    body = (
        f"<h1>{html.escape(outcome.title)}</h1><p>{html.escape(outcome.source)}</p>"
        f"<p>{html.escape(' '.join(_summary(outcome)))}</p>{places}"
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'
        f"<ul>{notes}</ul>"
    )
    return standalone_page(outcome.title, body, [figure.as_dict() for figure in figures])


def _figure(plot: Plot) -> Figure:
    data: list[dict[str, Any]] = []
    for curve, colour in zip(plot.curves, _COLOURS, strict=False):
        x = plain(curve.x)
        data.append(_line(x, above_zero(curve), colour, None, curve.name))
        data.append(_line(x, curve.high, colour, "tonexty", curve.name))
        data.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": curve.name,
                "x": x,
                "y": plain(curve.y),
                "line": {"color": colour},
                "hovertemplate": "%{x:.3g}: %{y:.3g}",
            }
        )
    layout = base_layout(
        380,
        xaxis=text_axis(plot.x_label, type="log", exponentformat="power", dtick=1),
        yaxis=text_axis(plot.y_label, type="log", exponentformat="power", dtick=1),
    )
    layout["legend"]["traceorder"] = "normal"
    return Figure(plot.name, plot.title, data, layout)


def _line(x: Any, y: np.ndarray, colour: str, fill: str | None, name: str) -> dict[str, Any]:
    line: dict[str, Any] = {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": plain(y),
        "line": {"width": 0, "color": colour},
        "showlegend": False,
        "hoverinfo": "skip",
        "legendgroup": name,
    }
    if fill is not None:
        red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
        line |= {"fill": fill, "fillcolor": f"rgba({red},{green},{blue},0.15)"}
    return line
