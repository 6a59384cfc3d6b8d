"""`tumble reproduce`: the papers' tables and figures beside ours."""

from __future__ import annotations

import json
from dataclasses import replace

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows import ReproduceRequest, refuse


def reproduce_command(asked: ReproduceRequest, printed: PrintOptions) -> None:
    """Make the tables and figures of the papers anew, beside the printed numbers, with a verdict a row.

    Without ITEM it lists what there is. Only the papers' numbers are stored; ours are simulated when the
    command runs.
    """
    from tumble.workflows import reproduce

    if asked.name is None:
        refuse(asked, ("output", "repetitions", "seed", "workers", "scheduler"), "{} goes with an ITEM.")
        _print_list(printed.as_json)
        return
    with progress(printed.silent) as tell:
        outcomes, files = reproduce(**vars(replace(asked, progress=tell)))
    if files:
        results_stand()
    from tumble.report import outcome_json, outcome_lines

    if printed.as_json:
        say_json([json.loads(outcome_json(outcome)) for outcome in outcomes])
        return
    for outcome in outcomes:
        inside, judged = outcome.counts
        if printed.quiet:
            say(f"{outcome.item}: {f'{inside} of {judged} rows inside' if judged else 'not judged'}")
        else:
            say(*outcome_lines(outcome), "")
    say_written(files)


def _print_list(as_json: bool) -> None:
    from tumble.reproduction import all_items

    items = all_items()
    if as_json:
        say_json([{"name": name, "title": one.title, "effort": one.effort} for name, one in items.items()])
        return
    width = max(len(name) for name in items)
    title = max(len(entry.title) for entry in items.values())
    for name, entry in items.items():
        say(f"{name:<{width}}  {entry.title:<{title}}  {entry.effort}")
    say(
        "\n`tumble reproduce hayal`, `zhang` or `savage` makes all of a paper; of what takes hours then no more than "
        "its own number of runs."
    )
