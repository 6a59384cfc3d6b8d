"""`tumble verify`: judge a calibration on recordings that it has not seen."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
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
    Topics,
    Units,
)
from tumble.cli.progress import progress
from tumble.errors import UsageError

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
    topic: Topics = None,
    intervals: Intervals = None,
    temperature: TemperatureOption = None,
    outside: OutsideOption = "refuse",
    gnss: Annotated[
        Path | None,
        typer.Option(
            help="Satellite positions of a drive (.pos, NMEA, UBX, CSV): judge by navigation instead."
        ),
    ] = None,
    lever_arm: Annotated[
        str | None,
        typer.Option(
            "--lever-arm",
            metavar="X,Y,Z",
            help="Metres from the IMU to the antenna, in b. Without it, 0,0,0.",
        ),
    ] = None,
    gnss_time: Annotated[
        float | None,
        typer.Option(
            "--gnss-time", metavar="S", help="Seconds to add to the positions' times; without it, found."
        ),
    ] = None,
    outages: Annotated[
        str | None,
        typer.Option(
            metavar="LIST", help="Seconds without positions, as 2,10,30,60 (the default, as far as they fit)."
        ),
    ] = None,
    data_sheet: Annotated[
        str | None,
        typer.Option(
            "--data-sheet",
            metavar="GRADE",
            help="What kind of unit drives, uncalibrated. Default consumer-mems.",
        ),
    ] = None,
    turn_on: Annotated[
        str | None,
        typer.Option(
            "--turn-on",
            metavar="MG,DEG_PER_H",
            help="By how much the biases may have moved since the calibration, one sigma.",
        ),
    ] = None,
    noise: Annotated[
        Path | None, typer.Option(help="noise.json of this unit, instead of the data sheet's noise.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="With --gnss: folder for verify.json and verify.html."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge a calibration on another recording: the norm of each hold, the angle left after each turn.

    With --gnss the recording is a drive, and the calibration is judged by navigation: free drift and outages with
    it, with parts of it, and without, in metres.

    The residuals are compared with what the calibration's uncertainty and the noise explain. Gravity
    is the calibration's own unless --site or --gravity is given. A calibration with a thermal model follows the
    recording's temperature. Exit status 0: it serves; 1: not.
    """
    if gnss is not None:
        from tumble.cli.verify_drive import numbers, show_drive, turn_on_of

        _refuse(
            {"--site": site, "--gravity": gravity, "--intervals": intervals},
            "says nothing to a drive, whose place the positions tell: leave it out.",
        )
        arm = None if lever_arm is None else numbers(lever_arm, "--lever-arm", 3)
        lengths = None if outages is None else numbers(outages, "--outages")
        moved = None if turn_on is None else turn_on_of(turn_on)
        from tumble.workflows.drive import verify_drive

        if gnss_time is not None and not math.isfinite(gnss_time):
            raise UsageError(f"--gnss-time {gnss_time}: give seconds.")
        with progress(quiet or as_json) as say:
            found = verify_drive(
                calibration,
                recordings,
                gnss,
                lever_arm_b=arm,
                offset=gnss_time,
                durations=lengths,
                data_sheet=data_sheet or "consumer-mems",
                turn_on=moved,
                noise=noise,
                columns=columns,
                units=units,
                rate=rate,
                topics=topic,
                temperature=temperature,
                outside=outside,
                progress=say,
            )
        show_drive(found, output=output, as_json=as_json, quiet=quiet)
    given = {
        "--lever-arm": lever_arm,
        "--gnss-time": gnss_time,
        "--outages": outages,
        "--data-sheet": data_sheet,
    }
    given |= {"--turn-on": turn_on, "--noise": noise, "--output": output}
    _refuse(given, "is for a drive: give its satellite positions with --gnss.")
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
            topics=topic,
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


def _refuse(options: Mapping[str, object], why: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise UsageError(f"{name} {why}")


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
