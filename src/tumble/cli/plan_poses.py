"""What `tumble plan` prints of a test of poses."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

from tumble.workflows.pose_plan import (
    UNITS,
    PosesPlanned,
    document_of,
    efficiency_words,
    parameter_rows,
    pose_names,
    scheme_rows,
)

if TYPE_CHECKING:
    from rich.table import Table


def print_poses(done: PosesPlanned, *, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Print a plan of poses.

    Parameters
    ----------
    done : what was planned.
    as_json : everything, as JSON.
    quiet : one line.
    verbose : the poses in their order, too.
    """
    if as_json:
        typer.echo(json.dumps(document_of(done), ensure_ascii=False, allow_nan=False))
        return
    from rich.console import Console

    console = Console(highlight=False)
    plan, more = done.plan, "more " if done.following else ""
    console.print(
        f"{len(plan.dwells)} {more}poses ({plan.name}), {plan.duration / 60.0:.1f} min with {plan.turn:g} s for each "
        "turn.",
        style="bold",
        markup=False,
    )
    if not quiet:
        heads = ("predicted", "standard uncertainty", "unit", "of noise alone")
        console.print(_table(heads, parameter_rows(done), (1, 3)))
        heads, rows = scheme_rows(done)
        table_rows = [[*row[:-1], row[-1]] for row in rows]
        console.print(_table(tuple(heads), table_rows, tuple(range(1, len(heads)))))
        if verbose:
            poses = [
                [str(number), name, f"{dwell:.1f} s"]
                for number, (name, dwell) in enumerate(
                    zip(pose_names(plan), plan.dwells.tolist(), strict=True), 1
                )
            ]
            console.print(_table(("", "pose", "rest"), poses, (2,)))
        if done.joint is not None:
            from tumble.cli.plan_joint import print_prediction

            print_prediction(console, done.joint)
    for sentence in (*done.given, *_next_words(done)):
        console.print(sentence, style="bold yellow" if not done.stop else "bold green", markup=False)
    if not quiet:
        for sentence in (*efficiency_words(plan), *done.remarks):
            console.print(f"• {sentence}", markup=False)
    for file in done.files:
        typer.echo(f"written: {file.resolve()}")
    if done.files and not quiet:
        typer.echo(
            f"Next: tumble simulate {done.files[0]} -o SIMULATION, or record it and "
            f"tumble calibrate RECORDING --protocol {done.files[0]}"
        )


def _next_words(done: PosesPlanned) -> list[str]:
    from tumble.calibration.poses import describe_direction
    from tumble.design.candidates import PARAMETERS

    if not done.following or done.stop:
        return []
    words: list[str] = []
    for number, one in enumerate(done.following):
        name = one.name or describe_direction(one.up_b)
        told = [index for index in done.task.criterion.wanted.tolist() if one.sigmas[index] < 0.03]
        if len(told) < done.task.criterion.wanted.size:
            after = f"{done.task.criterion.wanted.size - len(told)} parameters are then still open"
        else:
            worst = max(told, key=lambda index: float(one.sigmas[index]))
            group = "scale" if worst < 3 else "misalignment" if worst < 6 else "bias"
            unit, size = UNITS[group]
            after = f"least known is then {PARAMETERS[worst]}, ± {float(one.sigmas[worst]) / size:.3g} {unit}"
        words.append(f"{'Next' if number == 0 else 'Then'}: {name}; {after}.")
    return words


def _table(heads: tuple[str, ...], rows: list[list[str]], right: tuple[int, ...]) -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False, padding=(0, 1, 0, 0))
    for place, head in enumerate(heads):
        table.add_column(head, justify="right" if place in right else "left")
    for row in rows:
        table.add_row(*row)
    return table
