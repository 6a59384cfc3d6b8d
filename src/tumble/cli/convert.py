"""`tumble convert`: calibrations to and from other tools' files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Json, Quiet
from tumble.cli.progress import results_stand
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.workflows.convert import Converted


def convert_command(
    calibration: Annotated[
        Path | None,
        typer.Argument(
            help="calibration.json, or the folder that holds it; with --from another tool's file.",
            show_default=False,
        ),
    ] = None,
    to: Annotated[
        str | None, typer.Option("--to", metavar="TARGET", help="Write it in this tool's form.")
    ] = None,
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="TARGET", help="Read this tool's file and write calibration.json."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The file (default: the tool's own name for it).")
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option("--noise", metavar="NOISE.JSON", help="Noise coefficients, from `tumble noise -o`."),
    ] = None,
    inflate: Annotated[
        str | None,
        typer.Option(metavar="WHITE,WALK", help="Multiply white noise and random walk by these, as 2,10."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Rate in Hz that the consumer runs at, for per-sample noise.")
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Frame of corrected vectors, where the form leaves it open."),
    ] = None,
    temperature: Annotated[
        float | None,
        typer.Option(metavar="CELSIUS", help="Take a calibration with temperature at this one."),
    ] = None,
    largest_loss: Annotated[
        float, typer.Option(metavar="PPM", help="Refuse what loses more than this of a vector's length.")
    ] = 20000.0,
    instance: Annotated[int, typer.Option(help="Which IMU of the vehicle, from 0 (PX4, ArduPilot).")] = 0,
    per_count: Annotated[
        str | None,
        typer.Option(
            metavar="ACC,GYRO",
            help="m/s² and rad/s that the driver makes of a count, for calibrations in counts.",
        ),
    ] = None,
    units: Annotated[
        str | None, typer.Option(help="With --from: raw units where the file does not say them, as g,deg/s.")
    ] = None,
    correlation_time: Annotated[
        float, typer.Option(metavar="SECONDS", help="Of consumers with Gauss-Markov biases (KF-GINS, OKVIS).")
    ] = 3600.0,
    topic: Annotated[str, typer.Option(help="ROS topic, for forms that name one.")] = "/imu0",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a calibration as another tool's file, or read one. Without arguments: the list of targets.

    With --frame alone the calibration is written anew in another frame, its covariance too.

    Each file says its formula and a test vector in its comments. What a form cannot hold is said with its
    size; too large a loss is refused.
    """
    from tumble.workflows.convert import Converted, convert_from, convert_to

    if to is None and source is None:
        if calibration is not None and frame is not None:
            from tumble.workflows.algebra import turn

            file, document = turn(calibration, frame, output or Path("turned.json"))
            _say(Converted([file], document.remarks[-1:]), as_json, quiet)
            return
        if calibration is not None:
            raise UsageError(
                "Say where to: --to TARGET or --from TARGET; `tumble convert` alone lists the targets."
            )
        _list(as_json)
        return
    if to is not None and source is not None:
        raise UsageError(
            "--to and --from exclude each other: read into calibration.json first, then write from it."
        )
    if source is not None:
        if calibration is None:
            raise UsageError("Name the file to read: tumble convert FILE --from TARGET.")
        done = convert_from(calibration, source, output=output or Path("calibration.json"), units=units)
    else:
        from tumble.export.subject import Wishes

        assert to is not None
        if units is not None:
            raise UsageError("--units is about reading: leave it out with --to.")
        wishes = Wishes(
            frame=frame,
            temperature=temperature,
            largest_loss=1e-6 * largest_loss,
            instance=instance,
            per_count=None if per_count is None else _pair(per_count, "--per-count"),
            correlation_time=correlation_time,
            topic=topic,
        )
        factors = (1.0, 1.0) if inflate is None else _pair(inflate, "--inflate")
        done = convert_to(
            calibration, to, output=output, noise=noise, inflate=factors, rate=rate, wishes=wishes
        )
    results_stand()
    _say(done, as_json, quiet)


def _pair(text: str, option: str) -> tuple[float, float]:
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(
            f"{option} {text} is no pair of numbers: give two with a comma between, as 2,10."
        ) from None
    if not (0.0 < first < float("inf") and 0.0 < second < float("inf")):
        raise UsageError(f"{option} {text}: both numbers must be above zero.")
    return first, second


def _say(done: Converted, as_json: bool, quiet: bool) -> None:
    if as_json:
        typer.echo(json.dumps({"files": [str(f.resolve()) for f in done.files], "remarks": done.remarks}))
        return
    if not quiet:
        for remark in done.remarks:
            typer.echo(f"• {remark}")
    for file in done.files:
        typer.echo(f"written: {file.resolve()}")


def _list(as_json: bool) -> None:
    from tumble.workflows.convert import list_targets

    rows = list_targets()
    if as_json:
        typer.echo(
            json.dumps(
                [
                    {"name": r.name, "title": r.title, "directions": r.directions, "holds": r.holds}
                    for r in rows
                ]
            )
        )
        return
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    for name in ("target", "tool and file", "direction", "holds"):
        table.add_column(name)
    for r in rows:
        table.add_row(r.name, r.title, r.directions, r.holds)
    Console(highlight=False).print(table)
