"""`tumble reproduce`: the papers' tables and figures beside ours."""

from __future__ import annotations

import json
from pathlib import Path

from tumble.cli.options import PrintOptions, Seed
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows.request import ADVANCED, FIRST, argument, option


def reproduce_command(
    printed: PrintOptions,
    item: str | None = argument("ITEM", default=None, complete="study"),
    repetitions: int | None = option(FIRST, "N"),
    seed: Seed = 0,
    output: Path | None = option(FIRST, "DIR", "--output", "-o"),
    workers: int = option(ADVANCED, "N", default=1, show_default=True),
    scheduler: str | None = option(ADVANCED, "tcp://HOST:PORT"),
) -> None:
    """Make the tables and figures of the papers anew, beside the printed numbers, with a verdict a row.

    Without ITEM it lists what there is. Only the papers' numbers are stored; ours are simulated when the
    command runs.

    Parameters
    ----------
    item : What to make anew: an item of the list, or `hayal`, `zhang` or `savage` for all of a paper.
    repetitions : How many simulated runs; hundreds show the range that one run lies in.
    output : Folder for a page, the data and pictures of each item.
    workers : Processes that make a paper's items side by side.
    scheduler : A Dask cluster that makes the items instead.
    """
    from tumble.workflows.reproduce import reproduce

    if item is None:
        _print_list()
        return
    with progress(printed.silent) as tell:
        outcomes, files = reproduce(
            item,
            repetitions=repetitions,
            seed=seed,
            output=output,
            workers=workers,
            scheduler=scheduler,
            progress=tell,
        )
    if files:
        results_stand()
    from tumble.report.reproduction import outcome_json, outcome_lines

    if printed.as_json:
        say_json([json.loads(outcome_json(outcome)) for outcome in outcomes])
        return
    for outcome in outcomes:
        inside, judged = outcome.counts
        if printed.quiet:
            told = f"{inside} of {judged} rows inside" if judged else "not judged"
            say(f"{outcome.item}: {told}")
        else:
            say(*outcome_lines(outcome), "")
    say_written(files)


def _print_list() -> None:
    from tumble.reproduction.items import all_items

    items = all_items()
    width = max(len(name) for name in items)
    title = max(len(entry.title) for entry in items.values())
    for name, entry in items.items():
        say(f"{name:<{width}}  {entry.title:<{title}}  {entry.effort}")
    say(
        "\n`tumble reproduce hayal`, `zhang` or `savage` makes all of a paper; of what takes hours then no more than "
        "its own number of runs."
    )
