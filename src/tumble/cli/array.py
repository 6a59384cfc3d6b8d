"""`tumble calibrate --array`: several units that were tumbled together."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, say_json, table

if TYPE_CHECKING:
    from rich.console import Console

    from tumble.workflows.array import ArrayRun


def print_array(run: ArrayRun, printed: PrintOptions) -> None:
    """Print how the units sit against one another, what the common poses gain, and each unit's verdict.

    Parameters
    ----------
    run : what was made.
    printed : how to print.
    """
    if printed.as_json:
        say_json(run.document)
        return
    screen = console()
    if not printed.quiet:
        _print_mountings(run, screen)
        _print_gains(run, screen)
        words = "fixed to one another" if run.array.is_rigid else "NOT fixed to one another"
        screen.print(
            f"The units were {words}: common poses add {run.array.chi_square:.0f} to the sum of squares, "
            f"{run.array.degrees} are expected (probability {run.array.probability:.2g})."
        )
    for unit, made in zip(run.array.units, run.runs, strict=True):
        verdict = made.calibration.verdict
        screen.print(
            f"{unit.name}: {'FIT FOR USE' if verdict.fit else 'NOT FIT FOR USE'}",
            style="bold green" if verdict.fit else "bold red",
        )
        for reason in () if verdict.fit else verdict.reasons:
            screen.print(f"- {reason}")
    for file in run.files:
        screen.print(f"written: {file.resolve()}", soft_wrap=True)


def _print_mountings(run: ArrayRun, screen: Console) -> None:
    from tumble.report.rounding import with_uncertainty

    rows: list[list[str]] = []
    for number, unit in enumerate(run.array.units):
        if number == 0:
            rows.append([unit.name, "the first: its axes are the array's", "", ""])
            continue
        degrees = [math.degrees(value) for value in unit.rotation.tolist()]
        sigmas = [math.degrees(value) for value in unit.sigma.tolist()]
        rows.append([unit.name, *(with_uncertainty(v, s) for v, s in zip(degrees, sigmas, strict=True))])
    _print_table(["mounting / deg", "about x", "about y", "about z"], rows, screen)


def _print_gains(run: ArrayRun, screen: Console) -> None:
    groups = list(dict.fromkeys(group for unit in run.array.units for group in unit.gain))
    rows = [
        [group, *(f"{unit.gain[group]:.2f}" if group in unit.gain else "" for unit in run.array.units)]
        for group in groups
    ]
    _print_table(
        ["uncertainty / that of the unit alone", *(unit.name for unit in run.array.units)], rows, screen
    )


def _print_table(heads: list[str], rows: list[list[str]], screen: Console) -> None:
    shown = table(heads, rows, box="SIMPLE_HEAD", fold=True)
    shown.show_edge = False
    screen.print(shown)
    screen.print()


def default_folder(recordings: list[Path]) -> Path:
    """Return where the results of an array go when nobody says.

    Parameters
    ----------
    recordings : as typed.
    """
    return Path(f"{recordings[0].stem}-array" if recordings else "array")


__all__ = ["default_folder", "print_array"]
