"""What `tumble plan` prints: predictions, the worth of steps, poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.cli.options import LongPrintOptions
from tumble.cli.terminal import console, say, say_json, say_written, table
from tumble.workflows.planning.poses import PosesPlanned, document_of_poses
from tumble.workflows.planning.protocol import ProtocolPlanned, document_of_protocol
from tumble.workflows.planning.words import (
    STEP_HEADS,
    UNITS,
    next_words,
    parameter_rows,
    pose_names,
    prediction_rows,
    scheme_rows,
    step_rows,
    steps_in_words,
)

if TYPE_CHECKING:
    from rich.console import Console


def print_protocol(done: ProtocolPlanned, printed: LongPrintOptions) -> None:
    """Print what a protocol is worth; with ``-q`` the prediction and what is not told, no more.

    Parameters
    ----------
    done : what was planned.
    printed : how to print; with ``-v`` each step by itself, too.
    """
    if printed.as_json:
        say_json(document_of_protocol(done))
        return
    screen, quiet = console(), printed.quiet
    duration = done.plan.duration / 60.0
    screen.print(f"{done.plan.task.protocol.name}: {steps_in_words(done)}; {duration:.1f} min.", style="bold")
    _print_prediction(screen, done)
    if done.worths and not quiet:
        rows = step_rows(done, each=printed.verbose)
        screen.print(table(STEP_HEADS, rows, right=(1, 2, 4), tight=True, fold=True))
    for sentence in done.given:
        screen.print(sentence, style="bold green" if done.stop else "bold yellow")
    for sentence in done.words:
        style = "bold yellow" if sentence.startswith("Not determined") else ""
        if style or not quiet:
            screen.print(f"{'' if style else '• '}{sentence}", style=style)
    if not done.stop and (done.given or not quiet):
        for sentence in next_words(done):
            screen.print(sentence, style="bold" if done.given else "")
    for sentence in () if quiet else done.remarks:
        screen.print(f"• {sentence}")
    say_written(done.files)


def _print_prediction(screen: Console, done: ProtocolPlanned) -> None:
    heads = ("predicted standard uncertainty", "x", "y", "z", "unit")
    screen.print(table(heads, prediction_rows(done), right=(1, 2, 3), tight=True))


def print_poses(done: PosesPlanned, printed: LongPrintOptions) -> None:
    """Print a plan of poses; with ``-q`` one line.

    Parameters
    ----------
    done : what was planned.
    printed : how to print; with ``-v`` the poses in their order, too.
    """
    if printed.as_json:
        say_json(document_of_poses(done))
        return
    screen, plan, more = console(), done.plan, "more " if done.following else ""
    screen.print(
        f"{len(plan.dwells)} {more}poses ({plan.name}), {plan.duration / 60.0:.1f} min with {plan.turn:g} s for each "
        "turn.",
        style="bold",
    )
    if not printed.quiet:
        _print_pose_tables(screen, done, printed.verbose)
    for sentence in (*done.given, *_next_words(done)):
        screen.print(sentence, style="bold yellow" if not done.stop else "bold green")
    for sentence in () if printed.quiet else done.remarks:
        screen.print(f"• {sentence}")
    say_written(done.files)
    if done.files and not printed.quiet:
        say(
            f"Next: tumble simulate {done.files[0]} -o SIMULATION, or record it and "
            f"tumble calibrate RECORDING --protocol {done.files[0]}"
        )


def _print_pose_tables(screen: Console, done: PosesPlanned, verbose: bool) -> None:
    plan = done.plan
    heads = ("predicted", "standard uncertainty", "unit", "of noise alone")
    screen.print(table(heads, parameter_rows(done), right=(1, 3), tight=True))
    heads, rows = scheme_rows(done)
    screen.print(table(heads, rows, right=range(1, len(heads)), tight=True, fold=True))
    for name, refused in done.schemes.items():
        if isinstance(refused, str):
            screen.print(f"• {name}: {refused}.")
    if verbose:
        named = enumerate(zip(pose_names(plan), plan.dwells.tolist(), strict=True), 1)
        poses = [[str(number), name, f"{dwell:.1f} s"] for number, (name, dwell) in named]
        screen.print(table(("", "pose", "rest"), poses, right=(2,), tight=True))
    if done.joint is not None:
        _print_prediction(screen, done.joint)


def _next_words(done: PosesPlanned) -> list[str]:
    from tumble.calibration.poses import describe_direction
    from tumble.design.candidates import PARAMETERS

    if not done.following or done.stop:
        return []
    words: list[str] = []
    for number, one in enumerate(done.following):
        name = describe_direction(one.up_b)
        told = [index for index in done.task.wanted.tolist() if one.sigmas[index] < 0.03]
        if len(told) < done.task.wanted.size:
            after = f"{done.task.wanted.size - len(told)} parameters are then still open"
        else:
            worst = max(told, key=lambda index: float(one.sigmas[index]))
            group = "scale" if worst < 3 else "misalignment" if worst < 6 else "bias"
            unit, size = UNITS[group]
            after = f"least known is then {PARAMETERS[worst]}, ± {float(one.sigmas[worst]) / size:.3g} {unit}"
        words.append(f"{'Next' if number == 0 else 'Then'}: {name}; {after}.")
    return words
