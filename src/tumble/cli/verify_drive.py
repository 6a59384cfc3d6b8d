"""`tumble verify --gnss`: judge a calibration by a drive with satellite positions."""

from __future__ import annotations

import json
import math
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.workflows.drive_verification import DriveVerification

GRAVITY = 9.80665e-3  # m/s² a mg


def numbers(text: str, option: str, count: int | None = None) -> tuple[float, ...]:
    """Return numbers apart by commas.

    Parameters
    ----------
    text, option : as typed, and where.
    count : how many there must be; None for any.

    Raises
    ------
    UsageError
        If there are others.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if (
        not values
        or not all(math.isfinite(value) for value in values)
        or (count is not None and len(values) != count)
    ):
        many = "numbers" if count is None else f"{count} numbers"
        raise UsageError(
            f"{option} takes {many} apart by commas, and {text!r} is not: see `tumble verify --help`."
        )
    return values


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
    force, rate = numbers(text, "--turn-on", 2)
    return force * GRAVITY, math.radians(rate) / 3600.0


def show_drive(found: DriveVerification, *, output: Path | None, as_json: bool, quiet: bool) -> None:
    """Write what was asked for, and print the rest; leaves with the verdict's status.

    Parameters
    ----------
    found : what was found.
    output : folder, or None.
    as_json, quiet : how to print.

    Raises
    ------
    typer.Exit
        Always: 0 if it serves, 1 if not.
    """
    from tumble.cli.progress import results_stand
    from tumble.workflows.drive_document import drive_document, write_drive

    document = drive_document(found)
    files: list[Path] = []
    if output is not None:
        files = write_drive(document, output, shlex.join(["tumble", *sys.argv[1:]]))
        results_stand()
    if as_json:
        typer.echo(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        _print(document, quiet)
        for file in files:
            typer.echo(f"written: {file.resolve()}")
    raise typer.Exit(0 if found.fit else 1)


def _print(document: dict[str, Any], quiet: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    from tumble.report.drive_page import metres

    console = Console(highlight=False)
    if not quiet:
        for sentence in (document["time_offset"]["words"], document["alignment"], *document["remarks"]):
            console.print(f"• {sentence}", markup=False)
        variants = document["variants"]
        for title, key in (
            ("Free drift from known starts, horizontal rms, m", "drift"),
            ("Outages one by one, m", "outages_sliding"),
            ("Outages again and again, m", "outages_repeated"),
        ):
            chosen = {one["seconds"] for one in variants[0]["outages_sliding"]}
            table = Table(title=title, title_justify="left", box=None, pad_edge=False)
            table.add_column("corrected by")
            rows = [[one for one in variant[key] if one["seconds"] in chosen] for variant in variants]
            for one in rows[0]:
                table.add_column(f"{one['seconds']:g} s", justify="right")
            for variant, row in zip(variants, rows, strict=True):
                table.add_row(variant["name"], *(metres(one["horizontal_rms"], "") for one in row))
            console.print(table)
        for sentence in document["setting"]:
            console.print(f"• {sentence}", markup=False)
    fit = document["fit"]
    console.print("SERVES" if fit else "DOES NOT SERVE", style="bold green" if fit else "bold red")
    for reason in document["reasons"]:
        console.print(f"• {reason}", markup=False)


__all__ = ["numbers", "show_drive", "turn_on_of"]
