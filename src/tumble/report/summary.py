"""What a calibration comes to, for a terminal: the verdict and the parameters on one screen, the rest on request.

What a thermal calibration comes to, for the terminal: how far each bias moves with temperature.

The coefficients themselves, dozens of them, are in the document and in the report.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.parameters import ACCELEROMETER, GYRO, TEMPERATURE, Measure, said_unit
from tumble.report.calibration import parameter_table
from tumble.report.evidence.magnetometer import magnetometer_rows, magnetometer_sentences, magnetometer_table
from tumble.report.evidence.turn_ons import bias_table
from tumble.report.page import Block, Sentences, Table, Verdict, print_blocks
from tumble.report.parameters import ParameterRow, parameter_rows
from tumble.report.words import (
    DECISIONS,
    left_out_sentences,
    limits_verdict,
    quality_sentences,
    terms_sentences,
    verdict_words,
)

if TYPE_CHECKING:
    from rich.console import Console

    from tumble.document import Calibration, ThermalBlock


# Temperatures in a table for a wide terminal, and for another.
WIDE, MOST_POINTS, FEWEST_POINTS = 118, 5, 3
_TRIADS = (("accelerometer", "specific_force"), ("gyroscope", "angular_rate"))


def thermal_changes(calibration: Calibration, *, width: int) -> Table | None:
    """Return each bias's change from the reference at temperatures over the span; None without a thermal block.

    Parameters
    ----------
    calibration : with the block.
    width : characters of the terminal.
    """
    block = calibration.thermal
    if block is None:
        return None
    celsius = _temperatures(block, MOST_POINTS if width >= WIDE else FEWEST_POINTS)
    rows: list[list[str]] = []
    for triad, quantity in _TRIADS:
        unit = getattr(calibration.raw_units, quantity)
        found = {axis: _changes(block, f"{triad}.bias", axis, celsius, unit) for axis in range(3)}
        known = {axis: changes for axis, changes in found.items() if changes}
        if known:
            factor, word = said_unit(unit, (abs(one.value) for own in known.values() for one in own))
            name = "gyro" if triad == "gyroscope" else "acc."
            rows += [
                [f"{name} {'xyz'[axis]} / {word}", *(one.times(factor, "").number for one in own)]
                for axis, own in known.items()
            ]
    reference = f"change from {block.basis.reference_celsius:g} °C"
    heads = (reference, *(f"{at:.0f} °C" for at in celsius.tolist()))
    return Table(heads, rows, right=range(1, len(heads)))


def thermal_lines(calibration: Calibration) -> list[str]:
    """Return sentences on what else changes with temperature, and where its numbers are."""
    if calibration.thermal is None:
        return []
    rows = [row for row in parameter_rows(calibration) if row.group == TEMPERATURE]
    beside = [row for row in rows if not row.parameter.axes]
    lines = [f"{row.label[0].upper()}{row.label[1:]}: {row.shown.text}." for row in beside]
    count = len(rows) - len(beside)
    what = f"{count} coefficient{'' if count == 1 else 's'} of temperature with their uncertainties"
    return [*lines, f"{what} stand in report.html and calibration.json."]


def _temperatures(block: ThermalBlock, points: int) -> Series:
    """Return °C over the span, without those near the reference, where nothing has changed."""
    low, high = block.span_celsius
    at = np.linspace(low, high, points)
    return at[np.abs(at - block.basis.reference_celsius) > 0.05 * (high - low)]


def _changes(block: ThermalBlock, name: str, axis: int, celsius: Series, unit: str) -> list[Measure]:
    """Return the changes of one axis's bias, raw; none if it has none."""
    values = block.basis_values(celsius)
    names = [f"{name}.temperature[{k},{axis}]" for k in range(values.shape[1])]
    place = {parameter: k for k, parameter in enumerate(block.covariance_parameters)}
    if any(parameter not in place for parameter in names):
        return []
    at = [place[parameter] for parameter in names]
    covariance = np.array(block.covariance)[np.ix_(at, at)]
    coefficients = np.array(getattr(block.coefficients, name.replace(".", "_")), dtype=float)[:, axis]
    variance = np.einsum("tp,pq,tq->t", values, covariance, values)
    changes, sigmas = (values @ coefficients).tolist(), np.sqrt(np.maximum(variance, 0.0)).tolist()
    return [Measure(value, sigma, unit) for value, sigma in zip(changes, sigmas, strict=True)]


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
        parameter_table(rows, calibration.quality.coverage_factor) if rows else None,
        thermal_changes(calibration, width=width),
        bias_table(calibration, width=width),
        magnetometer_table(calibration.magnetometer),
    ]
    sentences = [
        *quality_sentences(calibration),
        *terms_sentences(calibration),
        *left_out_sentences(calibration),
        *thermal_lines(calibration),
        *(f"Not determined: {sentence}" for sentence in calibration.not_determined),
        *magnetometer_sentences(calibration.magnetometer, every=True),
    ]
    return [*(table for table in tables if table is not None), Sentences(sentences)]


def brief(calibration: Calibration, *, width: int) -> list[Block]:
    """Return what a terminal shows under the verdict where nobody asks for more: each parameter once.

    Parameters
    ----------
    calibration : the document.
    width : characters of the terminal.
    """
    rows = [row for row in parameter_rows(calibration) if row.group != TEMPERATURE]
    magnetometer = calibration.magnetometer
    tables = [thermal_changes(calibration, width=width), bias_table(calibration, width=width)]
    missing = [f"Not determined: {sentence}" for sentence in calibration.not_determined]
    missing += magnetometer_sentences(magnetometer)
    lines = _in_lines(rows, magnetometer_rows(magnetometer), width)
    return [
        *([Sentences(lines, "paragraphs")] if lines else []),
        *(table for table in tables if table is not None),
        *([Sentences(missing)] if missing else []),
    ]


def _in_lines(rows: Sequence[ParameterRow], field: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return three parameters of a family in a line, in the unit that data sheets have; one where it is narrow."""
    cells: list[tuple[str, ...]] = []
    for _, members in groupby(rows, key=lambda row: row.parameter.family):
        together = list(members)
        if together[0].kind == "g-sensitivity" and len(together) > 3:
            cells.append((_largest_of(together),))
            continue
        cells += [_line(together[first : first + 3]) for first in range(0, len(together), 3)]
    cells += [(f"mag. {label.partition(' (')[0]}", *texts) for label, *texts in field]
    if not cells:
        return []
    cells.insert(0, ("± one sigma", "x", "y", "z", ""))
    widths = [max(len(row[place]) for row in cells if len(row) > 1) for place in range(5)]
    gap = next((gap for gap in (2, 1) if sum(widths) + gap * (len(widths) - 1) <= width), 0)
    if not gap:
        return _joined(cells, rows, width)
    return [
        (" " * gap).join(map(str.ljust, row, widths)).rstrip() if len(row) > 1 else "".join(row)
        for row in cells
    ]


def _joined(cells: Sequence[tuple[str, ...]], rows: Sequence[ParameterRow], width: int) -> list[str]:
    """A family a line without columns, where columns are too wide; a parameter a line where that is, too."""
    lines = ["± one sigma, of x, y and z"]
    for name, *texts in cells[1:]:
        # A value, its ± and its uncertainty stay in one line.
        joined = ", ".join(text.replace(" ", "\N{NO-BREAK SPACE}") for text in texts[:-1] if text)
        said = f"{name}: {joined} {texts[-1]}" if texts else name
        lines += [one.replace("\N{NO-BREAK SPACE}", " ") for one in wrap(said, width, subsequent_indent="  ")]
    return lines if max(map(len, lines)) <= width else _one_each(rows)


def _one_each(rows: Sequence[ParameterRow]) -> list[str]:
    lines: list[str] = []
    for group, members in groupby(rows, key=lambda row: row.group):
        lines += [group, *(f"{row.label}: {row.said.text}" for row in members)]
    return lines


_BRIEFLY = {
    "scale factor error": "scale error",
    "non-orthogonality": "non-orthog.",
    "rotation": "triad rotation",
    "lag": "time lag",
    "g-sensitivity": "g-sensitivity",
}


def _line(rows: Sequence[ParameterRow]) -> tuple[str, ...]:
    measures = [row.said for row in rows]
    texts = [measure.number for measure in measures]
    ends = [row.parameter.axes for row in rows]
    before = {ACCELEROMETER: "acc. ", GYRO: "gyro "}.get(rows[0].group, "")
    name = _BRIEFLY.get(rows[0].kind, rows[0].parameter.family.words).replace("accelerometer", "acc.")
    # Heads name the axes x, y and z; pairs of axes, as of non-orthogonalities, name themselves.
    named = [
        text if end in ("", "xyz"[place]) else f"{end} {text}"
        for place, (end, text) in enumerate(zip(ends, texts, strict=True))
    ]
    return (before + name, *named, *("" for _ in range(3 - len(named))), measures[0].unit)


def _largest_of(rows: Sequence[ParameterRow]) -> str:
    """Many parameters of one family in a line: how many, and the largest with its uncertainty."""
    shown = [(row.said, row) for row in rows]
    largest, row = max(shown, key=lambda one: abs(one[0].value))
    return f"{row.kind}: {len(rows)} terms up to {largest.text} (gyro {row.parameter.axes})"


def print_calibration(calibration: Calibration, console: Console, *, verbose: bool = False) -> None:
    """Print the verdict with its reasons, then each parameter with its standard uncertainty.

    Parameters
    ----------
    calibration : what to print.
    console : where to.
    verbose : print intervals, how well the data fit, terms that were tried and what was left out, too.
    """
    fit = calibration.verdict.fit
    shown = (summary if verbose else brief)(calibration, width=console.width)
    limits = [] if calibration.limits is None else [limits_verdict(calibration.limits)]
    print_blocks([Verdict(fit, verdict_words(fit), calibration.verdict.reasons), *limits], console)
    console.print()
    print_blocks(shown, console)


def verdict_line(calibration: Calibration, files: Sequence[Path]) -> str:
    """Return the verdict and where the results are, in one line; against the use of one, the first reason, too.

    A magnetometer that is not plainly fit is named with its own verdict.

    Parameters
    ----------
    calibration : what was found.
    files : where the results were written.
    """
    verdict = calibration.verdict
    because = "" if verdict.fit or not verdict.reasons else f" {verdict.reasons[0]}"
    more = len(verdict.reasons) - 1
    because += f" ({more} more in the report.)" if because and more > 0 else ""
    places = ", ".join(str(file.resolve()) for file in files)
    where = f" Written: {places}" if places else ""
    limits = "" if calibration.limits is None else f" {DECISIONS[calibration.limits.decision].upper()}."
    return f"{verdict_words(verdict.fit).upper()}.{limits}{because}{_of_magnetometer(calibration)}{where}"


def _of_magnetometer(calibration: Calibration) -> str:
    """The magnetometer's own verdict where it is not plainly fit, after a space."""
    block = calibration.magnetometer
    if block is None or block.verdict is None or block.verdict.use == "fit":
        return ""
    return f" {magnetometer_sentences(block)[0]}"
