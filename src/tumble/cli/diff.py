"""`tumble diff`: what changed from one calibration to another."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, say_json
from tumble.errors import UsageError
from tumble.workflows import FIRST, argument, numbers, option

if TYPE_CHECKING:
    from tumble.document import Difference


def diff_command(
    *,
    first: Path = argument("FIRST"),
    second: Path = argument("SECOND"),
    printed: PrintOptions,
    allowed: str | None = option(FIRST, "UG,DEG/H"),
) -> None:
    """Say what changed between two calibrations, in sigmas, and whether it matters.

    tumble diff spring.json autumn.json

    The second is brought into the frame and the units of the first. The exit status is 1 if a change matters: it is
    more than its uncertainty, and more than --allowed.

    tumble diff truth.json calibration.json says whether a calibration recovers a simulated unit.

    Parameters
    ----------
    first : calibration.json or the folder that holds it; or a simulation's truth.json.
    second : A calibration of the same unit.
    allowed : Changes that do no harm: µg at 1 g and deg/h at rest, as 500,20.
    """
    from tumble.workflows import difference, is_truth, verdict

    if is_truth(first):
        if allowed is not None:
            raise UsageError("--allowed is for calibrations: leave it out where the first is a truth.json.")
        _say_recovery(first, second, printed)
    found = difference(first, second)
    matters, sentences = verdict(found, None if allowed is None else _allowed(allowed))
    if printed.as_json:
        say_json({**dataclasses.asdict(found), "matters": matters, "sentences": sentences})
    else:
        _print(first, found, sentences, printed.quiet)
    if matters:
        raise typer.Exit(1)


def _say_recovery(truth: Path, calibration: Path, printed: PrintOptions) -> NoReturn:
    """Print how far a calibration is from the truth, and leave with the status of the answer."""
    from tumble.report import change_table, print_blocks
    from tumble.workflows import recovery

    found = recovery(truth, calibration)
    if printed.as_json:
        told = ("recovered", "limit", "parameters", "remarks")
        say_json({name: getattr(found, name) for name in told})
    else:
        screen = console()
        for sentence in (found.sentence, *found.remarks):
            screen.print(sentence)
        if not printed.quiet:
            heads = ("truth", "error ± uncertainty")
            print_blocks([change_table(found.calibration, found.parameters, heads)], screen)
    raise typer.Exit(0 if found.recovered else 1)


def _allowed(text: str) -> tuple[float, float]:
    ug, per_hour = numbers(text, "--allowed", 2)
    if min(ug, per_hour) < 0.0:
        raise UsageError(f"--allowed {text}: both numbers must be zero or more.")
    from tumble.units import STANDARD_GRAVITY

    return ug * 1e-6 * STANDARD_GRAVITY, math.radians(per_hour) / 3600.0


def _print(first: Path, found: Difference, sentences: list[str], quiet: bool) -> None:
    screen = console()
    for sentence in sentences:
        screen.print(sentence)
    if quiet:
        return
    from tumble.document import read_calibration
    from tumble.report import change_table, print_blocks

    screen.print()
    table = change_table(read_calibration(first), found.parameters, ("first", "change ± uncertainty"))
    print_blocks([table], screen)
    for group in found.groups:
        told = (
            f"chi-square {group.chi_square:.1f} of {group.degrees_of_freedom}, by chance in "
            f"{_percent(group.probability)} of cases"
            if math.isfinite(group.chi_square)
            else "a number that both state as certain has changed"
        )
        screen.print(f"{group.name}: {told}")
    for remark in found.remarks:
        screen.print(f"- {remark}")


def _percent(share: float) -> str:
    if share < 1e-5:
        return "less than 0.001 %"
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"
