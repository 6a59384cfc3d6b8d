"""`tumble predict --trajectory`: free navigation along a trajectory, parameter by parameter."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.cli.terminal import console, results_stand, say_json, say_written, table
from tumble.cli.verify_drive import turn_on_of

if TYPE_CHECKING:
    from tumble.navigation.prediction import StateAdvice
    from tumble.workflows.predict_navigation import NavigationPrediction

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
    from tumble.workflows.predict_navigation import predict_navigation, states_document, write_states

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
    _print(found)
    say_written([] if file is None else [file])


def _errors(found: NavigationPrediction) -> list[dict[str, Any]]:
    """Standard uncertainties by length, in SI."""
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


def _print(found: NavigationPrediction) -> None:
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
