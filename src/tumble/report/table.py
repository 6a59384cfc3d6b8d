"""The terminal's table: parameters with units and uncertainties, quality, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.report.parameters import TEMPERATURE, ParameterRow, parameter_rows
from tumble.report.thermal_table import thermal_lines, thermal_table
from tumble.report.turn_ons_section import bias_table
from tumble.report.words import (
    left_out_sentences,
    quality_sentences,
    terms_sentences,
    verdict_words,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from tumble.document.result import Calibration

_HEADINGS = ("parameter", "value ± standard uncertainty", "95 % interval", "in other units")


# Narrower than this, a terminal shows the table without its last column rather than folded.
WIDE_TERMINAL = 104


def parameter_table(calibration: Calibration, *, width: int = WIDE_TERMINAL) -> Table:
    """Return the parameters as a table for a terminal of `width` characters, in groups."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, highlight=False)
    columns = len(_HEADINGS) if width >= WIDE_TERMINAL else len(_HEADINGS) - 1
    for heading in _HEADINGS[:columns]:
        table.add_column(heading, overflow="fold")
    factor = calibration.quality.coverage_factor
    # Dozens of coefficients tell a reader nothing: what they come to has a table of its own.
    listed = [(group, rows) for group, rows in _grouped(calibration) if group != TEMPERATURE]
    for number, (group, rows) in enumerate(listed):
        if number:
            table.add_section()
        table.add_row(f"[bold]{group}[/bold]")
        for row in rows:
            table.add_row(*(_escaped(cell) for cell in _cells(row, row.factor(factor))[:columns]))
    return table


def parameter_text(calibration: Calibration) -> str:
    """Return the same table as plain text with aligned columns, for files and pipes."""
    factor = calibration.quality.coverage_factor
    groups = [
        (group, [_cells(row, row.factor(factor)) for row in rows]) for group, rows in _grouped(calibration)
    ]
    every = [_HEADINGS, *(cells for _, rows in groups for cells in rows)]
    width = [max(len(cells[i]) for cells in every) for i in range(4)]

    def line(cells: Sequence[str]) -> str:
        return "  ".join(cell.ljust(w) for cell, w in zip(cells, width, strict=True)).rstrip()

    lines = [line(_HEADINGS)]
    for group, rows in groups:
        lines += ["", group, *(line(cells) for cells in rows)]
    return "\n".join(lines) + "\n"


def print_calibration(
    calibration: Calibration, console: Console, *, quiet: bool = False, files: Sequence[Path] = ()
) -> None:
    """Print the table, how well the data fit, what was left out, and the verdict with its reasons.

    Parameters
    ----------
    calibration : what to print.
    console : where to.
    quiet : the verdict only.
    files : where the results were written.
    """
    if not quiet:
        console.print(parameter_table(calibration, width=console.width))
        console.print()
        changes = thermal_table(calibration, width=console.width)
        if changes is not None:
            console.print(changes)
            console.print()
        biases = bias_table(calibration, width=console.width)
        if biases is not None:
            console.print(biases)
            console.print()
        for sentence in [
            *quality_sentences(calibration),
            *terms_sentences(calibration),
            *left_out_sentences(calibration),
            *thermal_lines(calibration),
            *(f"Not determined: {sentence}" for sentence in calibration.not_determined),
        ]:
            console.print(f"- {sentence}", markup=False)
        console.print()
    fit = calibration.verdict.fit
    console.print(verdict_words(fit).upper(), style="bold green" if fit else "bold red", markup=False)
    for reason in () if quiet and fit else calibration.verdict.reasons:
        console.print(f"- {reason}", markup=False)
    for file in files:
        console.print(f"written: {file.resolve()}", markup=False, soft_wrap=True)


def _grouped(calibration: Calibration) -> list[tuple[str, list[ParameterRow]]]:
    """Return the rows by group; groups in the order of `GROUPS`."""
    from tumble.report.parameters import GROUPS

    rows = sorted(parameter_rows(calibration), key=lambda row: GROUPS.index(row.group))
    return [(group, list(members)) for group, members in groupby(rows, key=lambda row: row.group)]


def _cells(row: ParameterRow, factor: float) -> tuple[str, str, str, str]:
    other = "" if row.other is None else row.other.text
    return row.label, row.shown.text, row.shown.interval(factor), other


def _escaped(text: str) -> str:
    """Return text in which rich sees no markup."""
    return text.replace("[", r"\[")
