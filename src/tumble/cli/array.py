"""`tumble calibrate --array`: several units that were tumbled together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, say_json, say_written

if TYPE_CHECKING:
    from tumble.workflows.array import ArrayRun


def print_array(run: ArrayRun, printed: PrintOptions) -> None:
    """Print how the units sit against one another, what the common poses gain, and each unit's verdict.

    Parameters
    ----------
    run : what was made.
    printed : how to print.
    """
    if printed.as_json:
        say_json(run.document)
        return
    from tumble.report.evidence.mountings import mountings
    from tumble.report.limits import limits_lines
    from tumble.report.terminal import print_blocks

    screen = console()
    if not printed.quiet:
        print_blocks(mountings(run.array), screen)
    for unit, made in zip(run.array.units, run.runs, strict=True):
        verdict = made.calibration.verdict
        screen.print(
            f"{unit.name}: {'FIT FOR USE' if verdict.fit else 'NOT FIT FOR USE'}",
            style="bold green" if verdict.fit else "bold red",
        )
        for reason in () if verdict.fit else verdict.reasons:
            screen.print(f"- {reason}")
        print_blocks(limits_lines(made.calibration), screen)
    say_written(run.files)


def default_folder(recordings: list[Path]) -> Path:
    """Return where the results of an array go when nobody says.

    Parameters
    ----------
    recordings : as typed.
    """
    return Path(f"{recordings[0].stem}-array" if recordings else "array")
