"""`tumble diff`: what changed from one calibration to others."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from tumble.cli.groups import FIRST, option
from tumble.cli.options import PrintOptions, output_option
from tumble.cli.terminal import console, results_stand, say_json, say_written
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.document.difference import Difference


def diff_command(
    calibrations: Annotated[
        list[Path],
        typer.Argument(
            metavar="FIRST LATER...",
            help="calibration.json of one unit, or folders that hold one, the oldest first; or a simulation's "
            "truth.json and a calibration.",
        ),
    ],
    printed: PrintOptions,
    allowed: Annotated[
        str | None,
        option(FIRST, "UG,DEG/H", "Changes that do no harm: µg at 1 g and deg/h at rest, as 500,20."),
    ] = None,
    output: Annotated[Path | None, output_option("Also draw it: an HTML page.", "FILE")] = None,
) -> None:
    """Say what changed between two calibrations or more, in sigmas, and whether it matters.

    tumble diff spring.json autumn.json -o diff.html

    All are brought into one frame and one unit first, and compared with the first one. The exit status is 1 if a
    change matters: it is more than its uncertainty, and more than --allowed.

    tumble diff truth.json calibration.json says whether a calibration recovers a simulated unit.
    """
    from tumble.workflows.difference import difference, verdict
    from tumble.workflows.simulated.recovery import is_truth

    first, *later = calibrations
    if not later:
        raise UsageError(f"Name a calibration to compare {first} with.")
    if is_truth(first):
        if allowed is not None or output is not None or len(later) > 1:
            raise UsageError(
                "--allowed, -o and more than two files are for calibrations: leave them out where the first is a "
                "truth.json."
            )
        _say_recovery(first, later[0], printed)
    found = [difference(first, one) for one in later]
    judged = [verdict(one, None if allowed is None else _allowed(allowed)) for one in found]
    if output is not None:
        said = [
            f"{label}: {' '.join(words)}" for label, (_, words) in zip(_labels(later), judged, strict=True)
        ]
        _draw(output, calibrations, found, said)
    if printed.as_json:
        told = [
            {**dataclasses.asdict(one), "matters": matters, "sentences": sentences}
            for one, (matters, sentences) in zip(found, judged, strict=True)
        ]
        say_json(told[0] if len(told) == 1 else told)
    elif len(found) == 1:
        _print(first, found[0], judged[0][1], printed.quiet)
    else:
        _print_several(calibrations, found, [said for _, said in judged], printed.quiet)
    if output is not None and not printed.as_json:
        say_written([output])
    if any(matters for matters, _ in judged):
        raise typer.Exit(1)


def _labels(calibrations: list[Path]) -> list[str]:
    """What each is called: its file's or its folder's name, its path where two are alike."""
    names = [one.stem if one.suffix == ".json" else one.name for one in calibrations]
    return names if len(set(names)) == len(names) else [str(one) for one in calibrations]


def _draw(output: Path, calibrations: list[Path], found: list[Difference], sentences: list[str]) -> None:
    from tumble.document import read_calibration
    from tumble.files import write_text
    from tumble.report.difference import difference_page
    from tumble.report.html import render_page

    changes = [one.parameters for one in found]
    page = difference_page(read_calibration(calibrations[0]), changes, _labels(calibrations), sentences)
    write_text(output, render_page(page))
    results_stand()


def _print_several(
    calibrations: list[Path], found: list[Difference], said: list[list[str]], quiet: bool
) -> None:
    from tumble.document import read_calibration
    from tumble.report.difference import changes_table
    from tumble.report.terminal import print_blocks

    screen, labels = console(), _labels(calibrations)
    for label, sentences in zip(labels[1:], said, strict=True):
        screen.print(f"{label}: {' '.join(sentences)}", markup=False)
    if not quiet:
        screen.print()
        changes = [one.parameters for one in found]
        print_blocks([changes_table(read_calibration(calibrations[0]), changes, labels)], screen)


def _say_recovery(truth: Path, calibration: Path, printed: PrintOptions) -> NoReturn:
    """Print how far a calibration is from the truth, and leave with the status of the answer."""
    from tumble.report.difference import change_table
    from tumble.report.terminal import print_blocks
    from tumble.workflows.simulated.recovery import recovery

    found = recovery(truth, calibration)
    if printed.as_json:
        parameters = [dataclasses.asdict(change) for change in found.parameters]
        say_json(
            {
                "recovered": found.recovered,
                "limit": found.limit,
                "parameters": parameters,
                "remarks": found.remarks,
            }
        )
    else:
        screen = console()
        for sentence in (found.sentence, *found.remarks):
            screen.print(sentence)
        if not printed.quiet:
            heads = ("truth", "error ± uncertainty")
            print_blocks([change_table(found.calibration, found.parameters, heads)], screen)
    raise typer.Exit(0 if found.recovered else 1)


def _allowed(text: str) -> tuple[float, float]:
    try:
        ug, per_hour = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--allowed {text} is no pair of numbers: give µg and deg/h, as 500,20.") from None
    if not (0.0 <= ug < math.inf and 0.0 <= per_hour < math.inf):
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
    from tumble.report.difference import change_table
    from tumble.report.terminal import print_blocks

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
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"
