"""`tumble compose`, `tumble diff` and `tumble invert`: calibrations from calibrations."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tumble.cli.options import Json, Quiet
from tumble.cli.progress import results_stand
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.document import Calibration
    from tumble.document.difference import Difference

Output = Annotated[Path, typer.Option("--output", "-o", help="The file, or a folder for calibration.json.")]


def compose_command(
    first: Annotated[Path, typer.Argument(help="The calibration of raw numbers, such as a factory's.")],
    second: Annotated[Path, typer.Argument(help="The one made on recordings that the first has corrected.")],
    output: Output,
    merge: Annotated[
        bool,
        typer.Option(
            "--merge", help="As one matrix and bias, with the covariance of both, where that is exact."
        ),
    ] = False,
    unmarked: Annotated[
        bool,
        typer.Option(
            "--unmarked", help="The second one's recordings were corrected by the first without saying so."
        ),
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make one calibration of two that follow one another: the first's output is the second's input.

    One function is applied after the other, exactly, with temperature and all. A second calibration that was
    made on raw recordings is refused: both would correct the same error.
    """
    from tumble.workflows.algebra import compose

    file, document = compose(first, second, output, merge=merge, unmarked=unmarked)
    _written(file, document, as_json, quiet)


def invert_command(
    calibration: Annotated[Path, typer.Argument(help="calibration.json, or the folder that holds it.")],
    output: Output,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the calibration that undoes another: from corrected numbers to raw ones in m/s² and rad/s.

    `tumble apply` takes it for recordings that the other has corrected. Covariance is carried.
    """
    from tumble.workflows.algebra import invert

    file, document = invert(calibration, output)
    _written(file, document, as_json, quiet)


def diff_command(
    first: Annotated[Path, typer.Argument(help="A calibration.json, or the folder that holds it.")],
    second: Annotated[Path, typer.Argument(help="Another one of the same unit.")],
    allowed: Annotated[
        str | None,
        typer.Option(
            metavar="UG,DEG/H", help="Changes that do no harm: µg at 1 g and deg/h at rest, as 500,20."
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say what changed between two calibrations, in sigmas, and whether it matters.

    Both are brought into one frame and one unit first. The exit status is 1 if the change matters: it is
    more than its uncertainty, and more than --allowed.
    """
    from tumble.workflows.algebra import difference, verdict

    found = difference(first, second)
    matters, sentences = verdict(found, None if allowed is None else _allowed(allowed))
    if as_json:
        typer.echo(
            json.dumps(_plain({**dataclasses.asdict(found), "matters": matters, "sentences": sentences}))
        )
    else:
        _print(found, sentences, quiet)
    if matters:
        raise typer.Exit(1)


def _allowed(text: str) -> tuple[float, float]:
    try:
        ug, per_hour = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--allowed {text} is no pair of numbers: give µg and deg/h, as 500,20.") from None
    if not (0.0 <= ug < math.inf and 0.0 <= per_hour < math.inf):
        raise UsageError(f"--allowed {text}: both numbers must be zero or more.")
    from tumble.units import STANDARD_GRAVITY

    return ug * 1e-6 * STANDARD_GRAVITY, math.radians(per_hour) / 3600.0


def _plain(value: Any) -> Any:
    """Values that JSON has; what is not a number is null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in cast("dict[str, Any]", value).items()}
    if isinstance(value, list):
        return [_plain(item) for item in cast("list[Any]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _print(found: Difference, sentences: list[str], quiet: bool) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    if not quiet:
        table = Table(box=SIMPLE, pad_edge=False)
        for name in ("parameter", "first", "change", "± one sigma", "sigmas", "unit"):
            table.add_column(name, justify="left" if name in ("parameter", "unit") else "right", no_wrap=True)
        before = ""
        for p in found.parameters:
            triad, _, name = p.name.partition(" ")
            if triad != before:
                table.add_row(f"[bold]{triad}[/]")
                before = triad
            sigmas = "-" if math.isnan(p.sigmas) else f"{p.sigmas:+.1f}"
            change = f"{p.second - p.first:+.2g}"
            table.add_row(name, f"{p.first:+.6g}", change, f"{p.standard_uncertainty:.2g}", sigmas, p.unit)
        console.print(table)
        for group in found.groups:
            told = (
                f"chi-square {group.chi_square:.1f} of {group.degrees_of_freedom}, by chance in "
                f"{_percent(group.probability)} of cases"
                if math.isfinite(group.chi_square)
                else "a number that both state as certain has changed"
            )
            console.print(f"{group.name}: {told}")
        for remark in found.remarks:
            console.print(f"• {remark}", markup=False)
    for sentence in sentences:
        console.print(sentence, markup=False)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def _written(file: Path, document: Calibration, as_json: bool, quiet: bool) -> None:
    results_stand()
    if as_json:
        typer.echo(json.dumps({"file": str(file.resolve()), "identity": document.identity}))
        return
    if not quiet and document.remarks:
        typer.echo(f"• {document.remarks[-1]}")
    typer.echo(f"written: {file.resolve()}")
