"""A reproduced table or figure for people and programs: lines of text, CSV, JSON, pictures."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.report.figures.svg_plot import draw_plot
from tumble.report.terminal import aligned

if TYPE_CHECKING:
    from tumble.reproduction.outcome import Outcome, Row, Value


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

    def plain_data(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return [None if not np.isfinite(v) else float(v) for v in value]
        if isinstance(value, dict):
            return {key: plain_data(v) for key, v in cast("dict[str, Any]", value).items()}
        if isinstance(value, list | tuple):
            return [plain_data(v) for v in cast("list[Any]", value)]
        return None if isinstance(value, float) and not np.isfinite(value) else value

    document = {**asdict(outcome), "command": outcome.command}
    return json.dumps(plain_data(document), indent=1, ensure_ascii=False) + "\n"


def outcome_pictures(outcome: Outcome) -> dict[str, str]:
    """Return the figures as SVG by file name, without the need of any program to draw them."""
    return {f"{outcome.item}-{plot.name}.svg": draw_plot(plot) for plot in outcome.plots}
