"""A reproduced table or figure for people and programs: lines of text, CSV, JSON, a page."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from tumble.arrays import Series
from tumble.document import finite
from tumble.records import as_document
from tumble.report.figures import record
from tumble.report.html import render_page
from tumble.report.page import Block, Figures, Page, Sentences, Table, aligned
from tumble.reproduction import Outcome, Plot, Row, Value

_COLOURS = (record.BLUE, record.GREEN, record.ORANGE, record.PURPLE, record.TEAL)
_HOVER = "%{x:.3g}: %{y:.3g}"
# Up to so many places of a logarithmic axis have a tick each; a line through more points than that shows no point.
_FEW, _DOTS = 8, 100


def render_outcome(outcome: Outcome) -> str:
    """Return the outcome as one HTML page that works offline, with figures to point at.

    Parameters
    ----------
    outcome : what to show.
    """
    return render_page(_outcome_page(outcome))


def outcome_files(outcome: Outcome) -> dict[str, str]:
    """Return the texts of an outcome's files by their names: page, data, table, lines, and figures.

    Parameters
    ----------
    outcome : what was made. Who has no matplotlib finds its figures in the page.
    """
    from tumble.report.figures.on_paper import draw

    plots = outcome.plots if find_spec("matplotlib") is not None else ()
    return {
        f"{outcome.item}.html": render_outcome(outcome),
        f"{outcome.item}.json": outcome_json(outcome),
        f"{outcome.item}.csv": outcome_csv(outcome),
        f"{outcome.item}.txt": "\n".join(outcome_lines(outcome)) + "\n",
        **{f"{outcome.item}-{plot.name}.svg": draw(figure_of(plot), "svg").decode() for plot in plots},
    }


def _outcome_page(outcome: Outcome) -> Page:
    """Return what is said of an outcome."""
    blocks: list[Block] = [Sentences([outcome.source, " ".join(summary_lines(outcome))], "paragraphs")]
    blocks += [Figures([figure_of(plot)], _caption(plot)) for plot in outcome.plots]
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


def figure_of(plot: Plot) -> record.Figure:
    """Return a figure of an outcome: its curves in their bands, and the paper's own numbers.

    Parameters
    ----------
    plot : what is shown.
    """
    marks: list[record.Mark] = []
    for curve, colour in zip(plot.curves, _COLOURS, strict=False):
        # A zero has no logarithm: there the band begins at a hundredth of the line.
        low = curve.low if plot.linear else np.where(curve.low > 0, curve.low, 1e-2 * curve.y)
        name, symbol = curve.name, "circle" if len(curve.x) <= _DOTS else ""
        marks += [
            record.Band(curve.x, (low, curve.high), name, colour, legend=False, group=name),
            record.Curve(curve.x, curve.y, name, colour, hover=_HOVER, symbol=symbol, size=6),
        ]
    if plot.marks is not None:
        own = plot.marks
        marks.append(record.Points(own.x, own.y, own.name, record.RED, hover=_HOVER, symbol="x-thin", size=9))
    upright = record.Axis(plot.y_label) if plot.linear else record.Axis(plot.y_label, "log", every=1)
    across = replace(upright, title=plot.x_label, ticks=_few_places(plot))
    return record.Figure(plot.name, plot.title, marks, across, upright, 380)


def _few_places(plot: Plot) -> list[float]:
    """Where the points stand of a logarithmic plot below two decades, which has hardly a power of ten."""
    places = np.unique(np.concatenate([np.zeros(0), *(curve.x for curve in plot.curves)]))
    if plot.linear or not 2 <= len(places) <= _FEW or not places[0] > 0.0 or places[-1] >= 100.0 * places[0]:
        return []
    return [float(place) for place in places]


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
    lines = [outcome.title, f"({outcome.source})", "", *aligned([heads, *cells]), ""]
    lines += [*summary_lines(outcome), *(f"- {note}" for note in outcome.notes), f"Again: {outcome.command}"]
    return lines


def _verdict(row: Row) -> str:
    return f"{row.verdict}{': ' if row.verdict and row.reason else ''}{row.reason}"


def summary_lines(outcome: Outcome) -> list[str]:
    """Return how it was made and what came out, in a sentence each.

    Parameters
    ----------
    outcome : what was made.
    """
    inside, judged = outcome.counts
    runs = "1 run" if outcome.repetitions == 1 else f"{outcome.repetitions} runs"
    made = (
        f"{runs}, seed {outcome.seed}, {outcome.seconds:.2g} s."
        if outcome.simulated
        else "Nothing is simulated."
    )
    words = [made]
    if judged:
        words.append(
            f"{inside} of {judged} rows inside. {outcome.criterion[:1].upper()}{outcome.criterion[1:]}."
        )
    return words


def outcome_csv(outcome: Outcome) -> str:
    """Return the table as CSV with all digits, for a spreadsheet.

    Parameters
    ----------
    outcome : what was made.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["parameter", "unit", *outcome.columns, "verdict", "reason"])
    for row in outcome.rows:
        cells = ["" if isinstance(c, float) and not np.isfinite(c) else c for c in row.cells]
        writer.writerow([row.label, row.unit, *cells, row.verdict, row.reason])
    return text.getvalue()


def outcome_json(outcome: Outcome) -> str:
    """Return the outcome as JSON with all digits."""

    def numbers(array: Series) -> list[float | None]:
        return [finite(value) for value in array]

    document = as_document(outcome) | {"command": outcome.command}
    return json.dumps(document, indent=1, ensure_ascii=False, default=numbers) + "\n"
