"""`tumble calibrate --array`: several units that were tumbled together."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from tumble.workflows.array import ArrayRun


def print_array(run: ArrayRun, *, as_json: bool, quiet: bool) -> None:
    """Print how the units sit against one another, what the common poses gain, and each unit's verdict.

    Parameters
    ----------
    run : what was made.
    as_json, quiet : how to print.
    """
    if as_json:
        typer.echo(json.dumps(run.document, ensure_ascii=False))
        return
    from rich.console import Console

    console = Console(highlight=False)
    if not quiet:
        _print_mountings(run, console.print)
        _print_gains(run, console.print)
        words = "fixed to one another" if run.array.is_rigid else "NOT fixed to one another"
        console.print(
            f"The units were {words}: common poses add {run.array.chi_square:.0f} to the sum of squares, "
            f"{run.array.degrees} are expected (probability {run.array.probability:.2g}).",
            markup=False,
        )
    for unit, made in zip(run.array.units, run.runs, strict=True):
        verdict = made.calibration.verdict
        console.print(
            f"{unit.name}: {'FIT FOR USE' if verdict.fit else 'NOT FIT FOR USE'}",
            style="bold green" if verdict.fit else "bold red",
            markup=False,
        )
        for reason in () if verdict.fit else verdict.reasons:
            console.print(f"- {reason}", markup=False)
    for file in run.files:
        console.print(f"written: {file.resolve()}", markup=False, soft_wrap=True)


def _print_mountings(run: ArrayRun, show: object) -> None:
    from tumble.report.rounding import with_uncertainty

    rows: list[list[str]] = []
    for number, unit in enumerate(run.array.units):
        if number == 0:
            rows.append([unit.name, "the first: its axes are the array's", "", ""])
            continue
        degrees = [math.degrees(value) for value in unit.rotation.tolist()]
        sigmas = [math.degrees(value) for value in unit.sigma.tolist()]
        rows.append([unit.name, *(with_uncertainty(v, s) for v, s in zip(degrees, sigmas, strict=True))])
    _table(["mounting / deg", "about x", "about y", "about z"], rows, show)


def _print_gains(run: ArrayRun, show: object) -> None:
    groups = list(dict.fromkeys(group for unit in run.array.units for group in unit.gain))
    rows = [
        [group, *(f"{unit.gain[group]:.2f}" if group in unit.gain else "" for unit in run.array.units)]
        for group in groups
    ]
    _table(["uncertainty / that of the unit alone", *(unit.name for unit in run.array.units)], rows, show)


def _table(heads: list[str], rows: list[list[str]], show: object) -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, highlight=False)
    for head in heads:
        table.add_column(head.replace("[", r"\["), overflow="fold")
    for row in rows:
        table.add_row(*(cell.replace("[", r"\[") for cell in row))
    if callable(show):
        show(table)
        show()


def default_folder(recordings: list[Path]) -> Path:
    """Return where the results of an array go when nobody says.

    Parameters
    ----------
    recordings : as typed.
    """
    return Path(f"{recordings[0].stem}-array" if recordings else "array")


__all__ = ["default_folder", "print_array"]
