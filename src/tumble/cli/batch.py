"""`tumble batch`: calibrate many units, and say which of them are not as the others."""

from __future__ import annotations

from dataclasses import MISSING, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.groups import OF_MANY
from tumble.cli.options import PrintOptions, SiteOptions
from tumble.cli.terminal import console, progress, results_stand, say_json, say_written, state
from tumble.workflows import FIRST, CalibrateRequest, argument, option

if TYPE_CHECKING:
    from tumble.fleet import Batch

_WORK, _MOST_SAID = "Who does the work", 20


def batch_command(
    *,
    sources: list[str] = argument("SOURCE..."),
    output: Path = option(FIRST, "DIR", "--output", "-o", default=MISSING),
    asked: Annotated[CalibrateRequest, OF_MANY],
    site: SiteOptions,
    printed: PrintOptions,
    reports: str = option(FIRST, "WHICH", default="failed"),
    workers: int | None = option(_WORK, "N"),
    scheduler: str | None = option(_WORK, "tcp://HOST:PORT"),
) -> None:
    """Calibrate many units, and say which of them are not fit, out of limits, or unlike the others.

    tumble batch units/ --site 48.1,520 --limits limits.yaml -o lot-17

    Each unit's calibration.json is written when it is there; run again, only what is new or changed is done, whatever
    ended the last run. A unit that fails stops nothing. Exit status 0: every unit is accepted; 1: not.

    Parameters
    ----------
    sources : A folder with a recording or a folder for each unit, a pattern such as 'units/*.csv', or a manifest (CSV
        with the columns unit and files).
    output : Folder for table.csv, table.html, table.parquet, units/NAME/.
    reports : Of which units a report.html is written: none, failed (all that are not accepted; the default), all.
    workers : Processes that work at a time (default: one a processor).
    scheduler : A Dask cluster that does the work instead (extra `fleet`).
    """
    from tumble.workflows import run_batch

    asked = replace(asked, site=site.place)
    state["stopped"] = "Stopped; the units that were done are kept, and the same call does the rest."
    with progress(printed.silent) as tell:
        batch = run_batch(
            sources,
            output,
            asked,
            reports=reports,
            workers=workers,
            scheduler=scheduler,
            progress=tell,
        )
    results_stand()
    _print(batch, printed)
    raise typer.Exit(0 if batch.accepted == len(batch.units) else 1)


def _print(batch: Batch, printed: PrintOptions) -> None:
    if printed.as_json:
        say_json(_as_dict(batch), indent=1)
        return
    screen = console()
    total = len(batch.units)
    screen.print(
        f"{batch.accepted} of {total} units are accepted ({100 * batch.accepted / total:.1f} %).",
        style="bold green" if batch.accepted == total else "bold red",
    )
    if not printed.quiet:
        named = [unit for unit in batch.units if not unit.accepted or unit.unit in batch.stand_out]
        for unit in named[:_MOST_SAID]:
            limits = f", limits {unit.limits}" if unit.limits else ""
            screen.print(f"{unit.unit}: {unit.verdict}{limits}", style="bold")
            for reason in batch.reasons(unit):
                screen.print(f"- {reason}")
        if len(named) > _MOST_SAID:
            screen.print(f"{len(named) - _MOST_SAID} more units to look at stand in the table.")
        for sentence in (*batch.shared, *batch.remarks):
            screen.print(f"- {sentence}")
        if batch.kept:
            screen.print(
                f"{batch.kept} units are as an earlier run left them, {batch.worked} were done now.",
                style="dim",
            )
    say_written(batch.files)


def _as_dict(batch: Batch) -> dict[str, object]:
    return {
        "units": [
            {
                "unit": unit.unit,
                "files": unit.files,
                "verdict": unit.verdict,
                "limits": unit.limits or None,
                "accepted": unit.accepted,
                "stands_out": unit.unit in batch.stand_out,
                "reasons": batch.reasons(unit),
            }
            for unit in batch.units
        ],
        "accepted": batch.accepted,
        "worked": batch.worked,
        "kept": batch.kept,
        "shared": batch.shared,
        "remarks": batch.remarks,
        "files": [str(path) for path in batch.files],
    }
