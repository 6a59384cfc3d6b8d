"""`tumble predict`: what a calibration is worth without aiding, and after a turn.

`tumble predict --trajectory`: free navigation along a trajectory, parameter by parameter.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.cli.groups import FIRST, option, refuse_given
from tumble.cli.options import CalibrationArgument, DataSheet, Json, NoiseFile, TurnOnBias, output_option
from tumble.cli.terminal import console, progress, results_stand, say_json, say_written, table
from tumble.cli.verify import turn_on_of
from tumble.records import dataclass

if TYPE_CHECKING:
    import numpy as np

    from tumble.document.predictions import Answer
    from tumble.navigation.prediction import StateAdvice
    from tumble.workflows.predict import NavigationPrediction


# Parameters that are listed: those that make more than this share of the largest one's error.
_LISTED = 0.02
# What is printed of the errors: words, key, factor and unit.
_QUANTITIES = (
    ("horizontal position", "horizontal", 1.0, "m"),
    ("  of the calibration", "horizontal_of_calibration", 1.0, "m"),
    ("  of the noise", "horizontal_of_noise", 1.0, "m"),
    ("vertical position", "vertical", 1.0, "m"),
    ("velocity", "velocity", 1.0, "m/s"),
    ("tilt", "tilt", math.degrees(1.0), "°"),
    ("heading", "heading", math.degrees(1.0), "°"),
)


def show_navigation(
    calibration: Path,
    *,
    seconds: tuple[float, ...],
    trajectory: str,
    noise: Path | None,
    data_sheet: str | None,
    turn_on_bias: str | None,
    output: Path | None,
    as_json: bool,
) -> None:
    """Predict, write the filter's states where asked for, and print.

    Parameters
    ----------
    calibration, seconds, trajectory, noise, data_sheet, turn_on_bias, output, as_json : as typed.

    Raises
    ------
    TumbleError
        If an input is wrong, or the file cannot be written.
    """
    from tumble.workflows.predict import predict_navigation, states_document, write_states

    with progress(as_json) as tell:
        tell("navigating")
        found = predict_navigation(
            calibration,
            seconds=seconds,
            trajectory=trajectory,
            noise=noise,
            data_sheet=data_sheet or "consumer-mems",
            turn_on=(0.0, 0.0) if turn_on_bias is None else turn_on_of(turn_on_bias),
        )
    file = None
    if output is not None:
        file = write_states(found, trajectory, output)
        results_stand()
    if as_json:
        document = {"errors": _errors(found), "filter": states_document(found, trajectory)}
        say_json(document, indent=1)
        return
    _print_navigation(found)
    say_written([] if file is None else [file])


def _errors(found: NavigationPrediction) -> list[dict[str, Any]]:
    """Standard uncertainties by length, in SI."""
    import numpy as np

    errors = found.errors
    each = errors.of_each()
    result: list[dict[str, Any]] = []
    for row, seconds in enumerate(errors.seconds.tolist()):
        total = errors.total[row]
        result.append(
            {
                "seconds": seconds,
                "horizontal": _size(total, (0, 1)),
                "horizontal_of_calibration": _size(errors.calibration[row], (0, 1)),
                "horizontal_of_noise": _size(errors.noise[row], (0, 1)),
                "vertical": _size(total, (2,)),
                "velocity": _size(total, (3, 4, 5)),
                "tilt": _size(total, (6, 7)),
                "heading": _size(total, (8,)),
                "horizontal_by_parameter": dict(
                    zip(errors.names, np.hypot(each[row, 0], each[row, 1]).tolist(), strict=True)
                ),
                "units": {"position": "m", "velocity": "m/s", "tilt": "rad", "heading": "rad"},
            }
        )
    return result


def _size(covariance: np.ndarray, rows: tuple[int, ...]) -> float:
    return math.sqrt(max(sum(float(covariance[row, row]) for row in rows), 0.0))


def _print_navigation(found: NavigationPrediction) -> None:
    from tumble.calibration.verdict import two_digits

    screen, errors = console(), _errors(found)
    lengths = [f"{row['seconds']:g} s" for row in errors]
    right = range(1, len(lengths) + 1)
    rows = [
        [words, *(f"{two_digits(factor * row[key])} {unit}" for row in errors)]
        for words, key, factor, unit in _QUANTITIES
    ]
    title = "Errors of free navigation, one sigma"
    screen.print(table(["after", *lengths], rows, right=right, title=title, box=None))
    largest = max(errors[-1]["horizontal_by_parameter"].values(), default=0.0)
    listed = sorted(errors[-1]["horizontal_by_parameter"].items(), key=lambda item: -item[1])
    rows = [
        [_in_words(name), *(f"{two_digits(row['horizontal_by_parameter'][name])} m" for row in errors)]
        for name, value in listed
        if value > _LISTED * largest
    ]
    title = "What one sigma of each parameter makes of the horizontal position"
    screen.print(table(["parameter", *lengths], rows, right=right, title=title, box=None))
    carried = [state for state in found.states if state.carry]
    rows = [
        [_state_in_words(state), _practical(state, two_digits), f"{two_digits(100.0 * state.share)} %"]
        for state in carried
    ]
    heads = ("state", "one sigma at the start", "largest share of a variance")
    screen.print(table(heads, rows, title="States for a filter", box=None))
    left = len(found.states) - len(carried)
    screen.print(
        f"{left} other sensor states make less than 1 % each of any error's variance: leave them out."
    )
    for sentence in found.remarks:
        screen.print(f"• {sentence}")


def _in_words(name: str) -> str:
    """A parameter of the covariance in the report's words: gyroscope.bias[1] is gyro bias y."""
    found = re.fullmatch(r"(accelerometer|gyroscope)\.(bias|matrix|g_sensitivity)\[(\d)(?:,(\d))?\]", name)
    if found is None:
        return name
    triad, what, row, column = found.groups()
    triad = "gyro" if triad == "gyroscope" else triad
    sensor = "xyz"[int(row)]
    if what == "bias" or column is None:
        return f"{triad} bias {sensor}"
    return _of_matrix(triad, what == "g_sensitivity", int(row), int(column))


def _state_in_words(state: StateAdvice) -> str:
    if state.kind == "g-sensitivity":
        return _of_matrix("gyro", True, state.row, state.column)
    triad = "gyro" if state.kind == "gyroscope" else state.kind
    if state.column < 0:
        return state.name.replace("gyroscope", "gyro")
    return _of_matrix(triad, False, state.row, state.column)


def _of_matrix(triad: str, g_sensitivity: bool, row: int, column: int) -> str:
    if g_sensitivity:
        return f"g-sensitivity of gyro {'xyz'[row]} to force {'xyz'[column]}"
    if row == column:
        return f"{triad} scale factor {'xyz'[row]}"
    return f"{triad} misalignment {'xyz'[row]} to {'xyz'[column]}"


def _practical(state: StateAdvice, digits: Callable[[float], str]) -> str:
    sigma = state.sigma
    if state.kind == "g-sensitivity":
        return f"{digits(math.degrees(sigma) * 3600.0 * 9.80665)} (°/h)/g"
    if state.column >= 0:
        return f"{digits(1e6 * sigma)} {'ppm' if state.row == state.column else 'µrad'}"
    if state.kind == "accelerometer":
        return f"{digits(sigma / 9.80665e-3)} mg"
    return f"{digits(math.degrees(sigma) * 3600.0)} °/h"


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
