"""What `tumble plan` prints of any protocol: both triads foretold, what steps are worth, what comes next."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

from tumble.workflows.joint_plan import JointPlanned, document_of_joint
from tumble.workflows.planned_words import (
    STEP_HEADS,
    next_words,
    prediction_rows,
    step_rows,
    steps_in_words,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def print_joint(done: JointPlanned, *, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Print what a protocol is worth.

    Parameters
    ----------
    done : what was planned.
    as_json : everything, as JSON.
    quiet : the prediction and what is not told, no more.
    verbose : each step by itself, too.
    """
    if as_json:
        typer.echo(json.dumps(document_of_joint(done), ensure_ascii=False, allow_nan=False))
        return
    from rich.console import Console

    console = Console(highlight=False)
    task = done.plan.task
    console.print(
        f"{task.protocol.name}: {steps_in_words(done)}; {done.plan.duration / 60.0:.1f} min.",
        style="bold",
        markup=False,
    )
    print_prediction(console, done)
    if done.worths and not quiet:
        console.print(_table(STEP_HEADS, step_rows(done, each=verbose), (1, 2, 4)))
    for sentence in done.given:
        console.print(sentence, style="bold green" if done.stop else "bold yellow", markup=False)
    for sentence in done.words:
        style = "bold yellow" if sentence.startswith("Not told") else ""
        if style or not quiet:
            console.print(f"{'' if style else '• '}{sentence}", style=style, markup=False)
    if not done.stop and (done.given or not quiet):
        for sentence in next_words(done):
            console.print(sentence, style="bold" if done.given else "", markup=False)
    if not quiet:
        for sentence in done.remarks:
            console.print(f"• {sentence}", markup=False)
    for file in done.files:
        typer.echo(f"written: {file.resolve()}")


def print_prediction(console: Console, done: JointPlanned) -> None:
    """Print the table of predicted standard uncertainties.

    Parameters
    ----------
    console : to print to.
    done : what was planned.
    """
    heads = ("predicted standard uncertainty", "x", "y", "z", "unit")
    console.print(_table(heads, prediction_rows(done), (1, 2, 3)))


def _table(heads: tuple[str, ...], rows: list[list[str]], right: tuple[int, ...]) -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False, padding=(0, 1, 0, 0))
    for place, head in enumerate(heads):
        table.add_column(head, justify="right" if place in right else "left")
    for row in rows:
        table.add_row(*row)
    return table
