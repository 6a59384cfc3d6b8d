"""`tumble reproduce`: the papers' tables and figures beside ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.options import Json, Quiet
from tumble.cli.progress import progress, results_stand


def reproduce_command(
    item: Annotated[
        str | None,
        typer.Argument(
            help="What to make anew: an item of the list, or `hayal`, `zhang` or `savage` for all of a paper."
        ),
    ] = None,
    repetitions: Annotated[
        int | None,
        typer.Option(help="How many simulated runs; hundreds show the range that one run lies in."),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed gives the same numbers.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for a page, the data and pictures of each item."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the tables and figures of the papers anew, beside the printed numbers, with a verdict a row.

    Without ITEM it lists what there is. Only the papers' numbers are stored; ours are simulated when the
    command runs.
    """
    from tumble.workflows.reproduce import reproduce

    if item is None:
        _print_list()
        return
    with progress(quiet or as_json) as say:
        outcomes, files = reproduce(item, repetitions=repetitions, seed=seed, output=output, progress=say)
    if files:
        results_stand()
    from tumble.report.reproduction import outcome_json, outcome_lines

    if as_json:
        typer.echo(
            json.dumps([json.loads(outcome_json(outcome)) for outcome in outcomes], ensure_ascii=False)
        )
        return
    for outcome in outcomes:
        inside, judged = outcome.counts
        if quiet:
            typer.echo(
                f"{outcome.item}: {inside} of {judged} rows inside"
                if judged
                else f"{outcome.item}: not judged"
            )
            continue
        typer.echo("\n".join(outcome_lines(outcome)))
        typer.echo("")
    for file in files:
        typer.echo(f"written: {file.resolve()}")


def _print_list() -> None:
    from tumble.reproduction.items import all_items

    items = all_items()

    width = max(len(name) for name in items)
    title = max(len(entry.title) for entry in items.values())
    for name, entry in items.items():
        typer.echo(f"{name:<{width}}  {entry.title:<{title}}  {entry.effort}")
    typer.echo(
        "\n`tumble reproduce hayal`, `zhang` or `savage` makes all of a paper; of what takes hours then no more than "
        "its own number of runs."
    )
