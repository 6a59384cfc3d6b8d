"""`tumble verify --gnss`: judge a calibration by a drive with satellite positions."""

from __future__ import annotations

import math
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from tumble.cli.figures import draw_figures
from tumble.cli.groups import numbers
from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, results_stand, say_json, say_written, table

if TYPE_CHECKING:
    from tumble.workflows.drive_verification import DriveVerification

GRAVITY = 9.80665e-3  # m/s² a mg


def turn_on_of(text: str) -> tuple[float, float]:
    """Return m/s² and rad/s of mg and °/h as typed.

    Parameters
    ----------
    text : as typed.

    Raises
    ------
    UsageError
        If it is not two numbers.
    """
    force, rate = numbers(text, "--turn-on-bias", 2)
    return force * GRAVITY, math.radians(rate) / 3600.0


def show_drive(
    found: DriveVerification, output: Path | None, figures: str | None, printed: PrintOptions
) -> NoReturn:
    """Write what was asked for, and print the rest; leaves with the verdict's status.

    Parameters
    ----------
    found : what was found.
    output : folder, or None.
    figures : form of the figures for a paper, or None.
    printed : how to print.

    Raises
    ------
    typer.Exit
        Always: 0 if it serves, 1 if not.
    """
    from tumble.workflows.drive_document import drive_document, write_drive

    document = drive_document(found)
    files: list[Path] = []
    if output is not None:
        files = write_drive(document, output, shlex.join(["tumble", *sys.argv[1:]]))
        files += draw_figures(figures, files)
        results_stand()
    if printed.as_json:
        say_json(document, indent=1)
    else:
        _print(document, printed.quiet)
        say_written(files)
    raise typer.Exit(0 if found.fit else 1)


def _print(document: dict[str, Any], quiet: bool) -> None:
    screen = console()
    if not quiet:
        for sentence in (document["time_offset"]["words"], document["alignment"], *document["remarks"]):
            screen.print(f"• {sentence}")
        for title, key in (
            ("Free drift from known starts, horizontal rms, m", "drift"),
            ("Outages one by one, m", "outages_sliding"),
            ("Outages again and again, m", "outages_repeated"),
        ):
            screen.print(_errors_table(document["variants"], title, key))
        for sentence in document["setting"]:
            screen.print(f"• {sentence}")
    fit = document["fit"]
    screen.print("SERVES" if fit else "DOES NOT SERVE", style="bold green" if fit else "bold red")
    for reason in document["reasons"]:
        screen.print(f"• {reason}")


def _errors_table(variants: list[dict[str, Any]], title: str, key: str) -> object:
    from tumble.report.drive import metres

    chosen = {one["seconds"] for one in variants[0]["outages_sliding"]}
    rows = [[one for one in variant[key] if one["seconds"] in chosen] for variant in variants]
    heads = ["corrected by", *(f"{one['seconds']:g} s" for one in rows[0])]
    cells = [
        [variant["name"], *(metres(one["horizontal_rms"], "") for one in row)]
        for variant, row in zip(variants, rows, strict=True)
    ]
    return table(heads, cells, right=range(1, len(heads)), title=title, box=None)
