"""`tumble verify`: judge a calibration on recordings that it has not seen."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import (
    Columns,
    Gravity,
    Intervals,
    Json,
    OutsideOption,
    Quiet,
    Rate,
    Recordings,
    SiteOption,
    TemperatureOption,
    Units,
)
from tumble.cli.progress import progress

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.workflows.verify import Verification


def verify_command(
    calibration: Annotated[Path, typer.Argument(help="calibration.json, or the folder that holds it.")],
    recordings: Recordings,
    site: SiteOption = None,
    gravity: Gravity = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    intervals: Intervals = None,
    temperature: TemperatureOption = None,
    outside: OutsideOption = "refuse",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge a calibration on another recording: the norm of each hold, the angle left after each turn.

    The residuals are compared with what the calibration's uncertainty and the noise explain. Gravity
    is the calibration's own unless --site or --gravity is given. A calibration with a thermal model follows the
    recording's temperature. Exit status 0: it serves; 1: not.
    """
    from tumble.workflows.site import choose_site
    from tumble.workflows.verify import verify

    place = choose_site(site, gravity)
    with progress(quiet or as_json) as say:
        results = verify(
            calibration,
            recordings,
            site=place,
            columns=columns,
            units=units,
            rate=rate,
            intervals=intervals,
            temperature=temperature,
            outside=outside,
            progress=say,
        )
    if as_json:
        typer.echo(json.dumps([_as_dict(result) for result in results], indent=1))
    else:
        for result in results:
            _print(result, quiet)
    raise typer.Exit(0 if all(result.fit for result in results) else 1)


def _as_dict(result: Verification) -> dict[str, object]:
    def numbers(values: Series) -> list[float | None]:
        return [value if math.isfinite(value) else None for value in values.tolist()]

    return {
        "recording": result.recording,
        "fit": result.fit,
        "reasons": result.reasons,
        "hold_norm_error": numbers(result.norms),
        "hold_norm_standard_uncertainty": numbers(result.norm_sigmas),
        "turn_angle": numbers(result.angles),
        "turn_size": numbers(result.sizes),
        "gyro_bias_change_raw": numbers(result.rate_bias_change),
        "units": {"hold_norm_error": "m/s²", "turn_angle": "rad", "turn_size": "rad"},
    }


def _print(result: Verification, quiet: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    if not quiet:
        table = Table(title=result.recording, title_justify="left")
        for name in ("hold", "|f| − g, mm/s²", "± expected", "turn after it, °", "gravity off by, °"):
            table.add_column(name, justify="right")
        for k, (norm, sigma) in enumerate(zip(result.norms, result.norm_sigmas, strict=True)):
            turn = math.isfinite(result.sizes[k])
            scored = math.isfinite(result.angles[k])
            table.add_row(
                str(k + 1),
                f"{1e3 * norm:+.2f}",
                f"{1e3 * sigma:.2f}",
                f"{math.degrees(result.sizes[k]):.0f}" if turn else "–",
                f"{math.degrees(result.angles[k]):.3f}" if scored else "–",
            )
        console.print(table)
    console.print(
        "SERVES" if result.fit else "DOES NOT SERVE", style="bold green" if result.fit else "bold red"
    )
    for reason in result.reasons:
        console.print(f"• {reason}", markup=False)
