"""`tumble plan`: how accurate a test will be, before it is done, and which would be better.

Of any protocol as it is, and of a test of poses, which are searched.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tumble.cli.options import LongPrintOptions, SiteOptions
from tumble.cli.terminal import console, progress, results_stand, say, say_json, say_written, table
from tumble.workflows import PlanRequest, refuse

if TYPE_CHECKING:
    from tumble.workflows import Planned


def plan_command(asked: PlanRequest, site: SiteOptions, printed: LongPrintOptions) -> None:
    """Say how accurate a test will be before it is done, and find a better one.

    Of any protocol: both triads predicted, what it does not determine, what each step is worth, what to add:

    tumble plan turntable-9 --imu tactical --site 48.1

    Of poses: which poses, for how long, in which order; a protocol to simulate and to calibrate with, and
    a sheet to print for the operator:

    tumble plan multi-position --imu tactical --time 15 -o plan

    All numbers are one sigma.
    """
    from tumble.workflows import DEFAULTS, plan

    other, what = ("poses", "minutes", "hold", "turn"), "a protocol as it is"
    if asked.asked in DEFAULTS:
        other, what = ("noise", "recorded"), f"a {asked.asked} test"
    refuse(asked, other, f"{{}} says nothing to {what}: leave it out.")
    with progress(printed.silent) as tell:
        done = plan(replace(asked, site=site.place, steps=not printed.quiet, progress=tell))
    results_stand()
    _print(done, printed)


def _print(done: Planned, printed: LongPrintOptions) -> None:
    """Print what a test is worth; with ``-q`` the prediction and what is not told, with ``-v`` each step by itself."""
    from tumble.workflows import (
        STEP_HEADS,
        document_of,
        headline,
        next_words,
        prediction_rows,
        scheme_rows,
        step_rows,
    )

    if printed.as_json:
        say_json(document_of(done))
        return
    screen, quiet = console(), printed.quiet
    screen.print(headline(done), style="bold")
    heads = ("predicted standard uncertainty", "x", "y", "z", "unit")
    screen.print(table(heads, prediction_rows(done), right=(1, 2, 3), tight=True))
    if done.worths and not quiet:
        rows = step_rows(done, each=printed.verbose)
        screen.print(table(STEP_HEADS, rows, right=(1, 2, 4), tight=True, fold=True))
    if (search := done.search) is not None and not quiet:
        names, rows = scheme_rows(search)
        screen.print(table(names, rows, right=range(1, len(names)), tight=True, fold=True))
        for name, refused in search.schemes.items():
            if isinstance(refused, str):
                screen.print(f"• {name}: {refused}.")
        if printed.verbose:
            poses = [[step.name, f"{step.duration:.1f} s"] for step in search.protocol.steps[::2]]
            screen.print(table(("pose", "rest"), poses, right=(1,), tight=True))
    for sentence in done.given:
        screen.print(sentence, style="bold green" if done.stop else "bold yellow")
    for sentence in done.remarks:
        missing = sentence.startswith("Not determined")
        if missing or not quiet:
            screen.print(f"{'' if missing else '• '}{sentence}", style="bold yellow" if missing else "")
    if not done.stop and (done.given or not quiet):
        for sentence in next_words(done):
            screen.print(sentence, style="bold" if done.given else "")
    say_written(done.files)
    if done.files and not quiet:
        say(
            f"Next: tumble simulate {done.files[0]} -o SIMULATION, or record it and "
            f"tumble calibrate RECORDING --protocol {done.files[0]}"
        )
