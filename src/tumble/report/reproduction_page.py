"""A reproduced table or figure as one HTML page that works offline."""

from __future__ import annotations

import html
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.figure import RED, Figure, base_layout, plain, text_axis
from tumble.report.reproduction import cell_text, summary_lines
from tumble.report.svg_plot import COLOURS, above_zero, few_places

if TYPE_CHECKING:
    from tumble.reproduction.outcome import Outcome, Plot, Row, Value

# Wider than a report: tables of papers have many columns. The reason stands below its row, in all its width.
_STYLE = """
main { max-width: 1240px; }
table.rows { font-size: .86rem; }
table.rows th { white-space: normal; vertical-align: bottom; }
table.rows th, table.rows td { padding-right: .9rem; }
table.rows td.label { white-space: normal; min-width: 11rem; max-width: 30rem; }
table.rows td { white-space: nowrap; }
table.rows .number { text-align: right; }
table.rows tr.why td { color: var(--soft); white-space: normal; padding-left: 1.2rem; }
table.rows tr.has-why td { border-bottom: 0; padding-bottom: 0; }
.inside { color: var(--good); } .outside { color: var(--bad); font-weight: 600; }
"""


def render_outcome(outcome: Outcome) -> str:
    """Return the outcome as one HTML page that works offline, with figures to point at.

    Parameters
    ----------
    outcome : what to show.
    """
    figures = [_figure(plot) for plot in outcome.plots]
    body = (
        f"<style>{_STYLE}</style><h1>{html.escape(outcome.title)}</h1><p>{html.escape(outcome.source)}</p>"
        f"<p>{html.escape(' '.join(summary_lines(outcome)))}</p>"
        f"{''.join(_place(plot, figure) for plot, figure in zip(outcome.plots, figures, strict=True))}"
        f"{_common_words(outcome)}"
        f'<div class="scroll">{_table(outcome)}</div>'
        f"<ul>{''.join(f'<li>{html.escape(note)}</li>' for note in outcome.notes)}</ul>"
        f"<p>Again: <code>{html.escape(outcome.command)}</code></p>"
    )
    if not figures:
        return _page_of_words(outcome.title, body)
    from tumble.report.html import standalone_page

    return standalone_page(outcome.title, body, [figure.as_dict() for figure in figures])


def _page_of_words(title: str, body: str) -> str:
    """Return a page without the plotting library, which would be five megabytes of nothing."""
    style = (files("tumble.report") / "page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{html.escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}\n"
        "</main>\n</body>\n</html>\n"
    )


def _common_reason(outcome: Outcome) -> str:
    """The reason that several rows have and no other is given: said once, and not below each."""
    reasons = [row.reason for row in outcome.rows if row.reason]
    return reasons[0] if len(reasons) > 1 and len(set(reasons)) == 1 else ""


def _common_words(outcome: Outcome) -> str:
    common = _common_reason(outcome)
    return f"<p>No row is judged: {html.escape(common)}.</p>" if common and not _verdicts(outcome) else ""


def _verdicts(outcome: Outcome) -> list[str]:
    return [row.verdict for row in outcome.rows if row.verdict]


def _table(outcome: Outcome) -> str:
    heads = ("", "unit", "verdict", *outcome.columns)
    said = _common_reason(outcome) if not _verdicts(outcome) else ""
    rows = "".join(_row(row, len(heads), row.reason != said) for row in outcome.rows)
    first = outcome.rows[0].cells if outcome.rows else outcome.columns
    numbers = [False] * 3 + [isinstance(value, int | float) for value in first]
    cells = "".join(
        f'<th class="number">{html.escape(head)}</th>' if number else f"<th>{html.escape(head)}</th>"
        for head, number in zip(heads, numbers, strict=True)
    )
    return f'<table class="rows"><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table>'


def _row(row: Row, columns: int, with_reason: bool = True) -> str:
    verdict = f'<span class="{row.verdict}">{row.verdict}</span>' if row.verdict else ""
    cells = (
        f'<td class="label">{html.escape(row.label)}</td><td>{html.escape(row.unit)}</td><td>{verdict}</td>'
        + "".join(_cell(value) for value in row.cells)
    )
    if not row.reason or not with_reason:
        return f"<tr>{cells}</tr>"
    why = f'<tr class="why"><td colspan="{columns}">{html.escape(row.reason)}</td></tr>'
    return f'<tr class="has-why">{cells}</tr>{why}'


def _cell(value: Value) -> str:
    kind = "" if value is None or isinstance(value, str) else ' class="number"'
    return f"<td{kind}>{html.escape(re.sub(r'-(?=[0-9.])', '−', cell_text(value)))}</td>"


def _place(plot: Plot, figure: Figure) -> str:
    marks = f"; crosses: {plot.marks.name}" if plot.marks is not None else ""
    return (
        f"<figure><figcaption>{html.escape(plot.title)}: line: {plot.line}, band: {plot.band}"
        f"{html.escape(marks)}</figcaption>"
        f'<div id="{figure.name}" role="img" aria-label="{html.escape(figure.label)}" '
        f'style="height:{figure.height}px"></div></figure>'
    )


def _figure(plot: Plot) -> Figure:
    data: list[dict[str, Any]] = []
    for curve, colour in zip(plot.curves, COLOURS, strict=False):
        x = plain(curve.x)
        data.append(_edge(x, curve.low if plot.linear else above_zero(curve), colour, None, curve.name))
        data.append(_edge(x, curve.high, colour, "tonexty", curve.name))
        data.append(_points(curve.name, x, curve.y, "lines+markers", line={"color": colour}))
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
    return {
        "type": "scatter",
        "mode": mode,
        "name": name,
        "x": x,
        "y": plain(y),
        "hovertemplate": "%{x:.3g}: %{y:.3g}",
        **look,
    }


def _edge(x: Any, y: np.ndarray, colour: str, fill: str | None, name: str) -> dict[str, Any]:
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
