"""What a calibration comes to, for a terminal: parameters, quality, what was left out, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.report.calibration import parameter_table
from tumble.report.evidence.thermal_changes import thermal_changes, thermal_lines
from tumble.report.evidence.turn_ons import bias_table
from tumble.report.page import Block, Sentences, Verdict
from tumble.report.parameters import TEMPERATURE, parameter_rows
from tumble.report.terminal import aligned, print_blocks
from tumble.report.words import (
    left_out_sentences,
    quality_sentences,
    terms_sentences,
    verdict_words,
)

if TYPE_CHECKING:
    from rich.console import Console

    from tumble.document.result import Calibration


def summary(calibration: Calibration, *, width: int) -> list[Block]:
    """Return what a terminal shows before the verdict.

    Parameters
    ----------
    calibration : the document.
    width : characters of the terminal.
    """
    # Dozens of coefficients tell a reader nothing: what they come to has a table of its own.
    rows = [row for row in parameter_rows(calibration) if row.group != TEMPERATURE]
    tables = [
        parameter_table(rows, calibration.quality.coverage_factor),
        thermal_changes(calibration, width=width),
        bias_table(calibration, width=width),
    ]
    sentences = [
        *quality_sentences(calibration),
        *terms_sentences(calibration),
        *left_out_sentences(calibration),
        *thermal_lines(calibration),
        *(f"Not determined: {sentence}" for sentence in calibration.not_determined),
    ]
    return [*(table for table in tables if table is not None), Sentences(sentences)]


def print_calibration(
    calibration: Calibration, console: Console, *, quiet: bool = False, files: Sequence[Path] = ()
) -> None:
    """Print the tables, how well the data fit, what was left out, and the verdict with its reasons.

    Parameters
    ----------
    calibration : what to print.
    console : where to.
    quiet : the verdict only.
    files : where the results were written.
    """
    fit = calibration.verdict.fit
    reasons = () if quiet and fit else calibration.verdict.reasons
    shown = [] if quiet else summary(calibration, width=console.width)
    print_blocks([*shown, Verdict(fit, verdict_words(fit), reasons)], console)
    for file in files:
        console.print(f"written: {file.resolve()}", markup=False, soft_wrap=True)


def parameter_text(calibration: Calibration) -> str:
    """Return the parameters as plain text with aligned columns, for files and pipes.

    Parameters
    ----------
    calibration : the document.
    """
    table = parameter_table(parameter_rows(calibration), calibration.quality.coverage_factor)
    return "\n".join(aligned([table.heads, *table.rows])) + "\n"
