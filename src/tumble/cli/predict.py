"""`tumble predict`: what a calibration is worth without aiding, and after a turn."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Json
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.document.predictions import Answer


def predict_command(
    calibration: Annotated[Path, typer.Argument(help="calibration.json, or the folder that holds it.")],
    seconds: Annotated[
        list[float] | None,
        typer.Option(help="Seconds at rest without aiding, up to 600; may be given several times."),
    ] = None,
    turn: Annotated[float, typer.Option(help="A turn about each axis, degrees.")] = 90.0,
    turn_rate: Annotated[float, typer.Option(help="How fast it turns, degrees per second.")] = 30.0,
    data_sheet: Annotated[
        str | None,
        typer.Option(
            metavar="GRADE",
            help="Beside it, what a kind of unit (consumer-mems, tactical, ...) promises without calibration.",
        ),
    ] = None,
    trajectory: Annotated[
        str | None,
        typer.Option(
            metavar="rest|straight|cart|FILE",
            help="Navigate along this instead, noise and all, each parameter by itself; FILE: positions of a drive.",
        ),
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option(help="With --trajectory: noise.json of this unit, instead of the data sheet's."),
    ] = None,
    turn_on: Annotated[
        str | None,
        typer.Option(
            "--turn-on",
            metavar="MG,DEG_PER_H",
            help="With --trajectory: by how much the biases may have moved since the calibration, one sigma.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="With --trajectory: file or folder for filter.json, a filter's states."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Say what a calibration is worth: position error without satellites, attitude error after a turn.

    From the calibration's covariance in closed form, one sigma, beside the error of the same unit with nominal
    scale factors and no bias. Noise and the wander of biases come on top: `tumble noise` tells those. With
    --trajectory they are in, and a filter is told which states to carry.
    """
    if trajectory is not None:
        from tumble.cli.predict_navigation import show_navigation

        show_navigation(
            calibration,
            seconds=tuple(seconds) if seconds else (10.0, 60.0, 300.0),
            trajectory=trajectory,
            noise=noise,
            data_sheet=data_sheet,
            turn_on=turn_on,
            output=output,
            as_json=as_json,
        )
        return
    for name, value in (("--noise", noise), ("--turn-on", turn_on), ("--output", output)):
        if value is not None:
            raise UsageError(f"{name} is for a trajectory: give --trajectory rest, straight, cart or a file.")
    from tumble.workflows.predict import predict

    told = predict(
        calibration,
        seconds=tuple(seconds) if seconds else (10.0, 60.0),
        turn_degrees=turn,
        turn_rate_degrees=turn_rate,
        data_sheet=data_sheet,
    )
    if as_json:
        typer.echo(json.dumps([_as_dict(answer) for answer in told], indent=1, ensure_ascii=False))
        return
    _print(told, data_sheet)


def _as_dict(answer: Answer) -> dict[str, object]:
    return {
        "question": answer.question,
        "unit": "m" if answer.kind == "position" else "rad",
        "standard_uncertainty": answer.after,
        "uncalibrated": _finite(answer.before),
        "data_sheet": _finite(answer.sheet),
        "shares_of_variance": answer.shares,
    }


def _finite(value: float | None) -> float | None:
    """Return None where the attitude is lost, or nothing is known."""
    return value if value is not None and math.isfinite(value) else None


def _print(told: list[Answer], data_sheet: str | None) -> None:
    from rich.console import Console
    from rich.table import Table

    from tumble.report.prediction_section import FOOTNOTE, cells

    table = Table(box=None, pad_edge=False, highlight=False)
    heads = ["after", "uncalibrated", "calibrated, one sigma", "most of it from"]
    if data_sheet is not None:
        heads.insert(2, data_sheet)
    for head in heads:
        table.add_column(head, overflow="fold")
    for answer in told:
        table.add_row(*cells(answer, with_sheet=data_sheet is not None))
    console = Console(highlight=False)
    console.print(table)
    console.print(FOOTNOTE, markup=False)
