"""`tumble predict`: what a calibration is worth without aiding, and after a turn."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.groups import FIRST, option, refuse_given
from tumble.cli.options import CalibrationArgument, DataSheet, Json, NoiseFile, TurnOnBias, output_option
from tumble.cli.terminal import console, say_json, table

if TYPE_CHECKING:
    from tumble.document.predictions import Answer


@dataclass(frozen=True)
class TurnOptions:
    """The turn after which the attitude is judged."""

    turn: Annotated[float, option(FIRST, "DEG", "A turn about each axis, degrees.", show_default=True)] = 90.0
    turn_rate: Annotated[float, option(FIRST, "DEG/S", "How fast it turns.", show_default=True)] = 30.0


@dataclass(frozen=True)
class TrajectoryOptions:
    """What only a trajectory has."""

    noise: NoiseFile = None
    turn_on_bias: TurnOnBias = None
    output: Annotated[
        Path | None,
        output_option("With --trajectory: file or folder for filter.json, a filter's states.", "PATH"),
    ] = None


def predict_command(
    context: typer.Context,
    calibration: CalibrationArgument,
    turned: TurnOptions,
    along: TrajectoryOptions,
    seconds: Annotated[
        list[float] | None,
        option(FIRST, "S", "Seconds at rest without aiding, up to 600; may be given several times."),
    ] = None,
    trajectory: Annotated[
        str | None,
        option(
            FIRST,
            "PATH",
            "rest, straight, cart or a file with positions of a drive: navigate along this instead, noise and "
            "all, each parameter by itself.",
        ),
    ] = None,
    data_sheet: DataSheet = None,
    as_json: Json = False,
) -> None:
    """Say what a calibration is worth: position error without satellites, attitude error after a turn.

    From the calibration's covariance in closed form, one sigma, beside the error of the same unit with nominal
    scale factors and no bias. Noise and the wander of biases come on top: `tumble noise` gives those. With
    --trajectory they are in, and it says which states a filter has to carry. With --data-sheet: what a kind of unit
    promises without calibration, beside it.
    """
    if trajectory is not None:
        from tumble.cli.predict_navigation import show_navigation

        lengths = tuple(seconds) if seconds else (10.0, 60.0, 300.0)
        show_navigation(
            calibration,
            seconds=lengths,
            trajectory=trajectory,
            data_sheet=data_sheet,
            as_json=as_json,
            **asdict(along),
        )
        return
    refuse_given(
        context,
        [TrajectoryOptions],
        "{} is for a trajectory: give --trajectory rest, straight, cart or a file.",
    )
    from tumble.workflows.predict import predict

    told = predict(
        calibration,
        seconds=tuple(seconds) if seconds else (10.0, 60.0),
        turn_degrees=turned.turn,
        turn_rate_degrees=turned.turn_rate,
        data_sheet=data_sheet,
    )
    if as_json:
        say_json([_as_dict(answer) for answer in told], indent=1)
        return
    _print(told, data_sheet)


def _as_dict(answer: Answer) -> dict[str, object]:
    """An answer; numbers that are not finite, where the attitude is lost or nothing is known, become null."""
    return {
        "question": answer.question,
        "unit": "m" if answer.kind == "position" else "rad",
        "standard_uncertainty": answer.after,
        "uncalibrated": answer.before,
        "data_sheet": answer.sheet,
        "shares_of_variance": answer.shares,
    }


def _print(told: list[Answer], data_sheet: str | None) -> None:
    from tumble.report.predictions import FOOTNOTE, HEADS, cells

    heads = [*HEADS]
    if data_sheet is not None:
        heads.insert(2, data_sheet)
    rows = [cells(answer, with_sheet=data_sheet is not None) for answer in told]
    screen = console()
    screen.print(table(heads, rows, box=None, fold=True))
    screen.print(FOOTNOTE)
