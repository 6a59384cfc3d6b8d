"""`tumble predict`: what a calibration is worth without aiding, and which states a filter should carry."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.cli.options import Json
from tumble.cli.terminal import console, results_stand, say_json, say_written, table
from tumble.workflows import FIRST, PredictRequest, option

if TYPE_CHECKING:
    import numpy as np

    from tumble.document import Answer
    from tumble.navigation import PredictedErrors, StateAdvice


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


def _errors(course: PredictedErrors) -> list[dict[str, Any]]:
    """Standard uncertainties by length, in SI."""
    result: list[dict[str, Any]] = []
    rows = zip(course.seconds.tolist(), course.calibration, course.noise, strict=True)
    for seconds, calibration, noise in rows:
        total = calibration + noise
        result.append(
            {
                "seconds": seconds,
                "horizontal": _size(total, (0, 1)),
                "horizontal_of_calibration": _size(calibration, (0, 1)),
                "horizontal_of_noise": _size(noise, (0, 1)),
                "vertical": _size(total, (2,)),
                "velocity": _size(total, (3, 4, 5)),
                "tilt": _size(total, (6, 7)),
                "heading": _size(total, (8,)),
                "units": {"position": "m", "velocity": "m/s", "tilt": "rad", "heading": "rad"},
            }
        )
    return result


def _size(covariance: np.ndarray, rows: tuple[int, ...]) -> float:
    return math.sqrt(max(sum(float(covariance[row, row]) for row in rows), 0.0))


def _print_course(course: PredictedErrors) -> None:
    from tumble.parameters import two_digits

    screen, errors = console(), _errors(course)
    lengths = [f"{row['seconds']:g} s" for row in errors]
    rows = [
        [words, *(f"{two_digits(factor * row[key])} {unit}" for row in errors)]
        for words, key, factor, unit in _QUANTITIES
    ]
    title = "On a straight course, noise and all, one sigma"
    screen.print(table(["after", *lengths], rows, right=range(1, len(lengths) + 1), title=title, box=None))
    carried = [state for state in course.states if state.carry]
    rows = [
        [_state_in_words(state), _practical(state), f"{two_digits(100.0 * state.share)} %"]
        for state in carried
    ]
    heads = ("state", "one sigma at the start", "largest share of a variance")
    screen.print(table(heads, rows, title="States for a filter", box=None))
    left = len(course.states) - len(carried)
    screen.print(
        f"{left} other sensor states make less than 1 % each of any error's variance: leave them out."
    )


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


def _practical(state: StateAdvice) -> str:
    from tumble.parameters import amount

    bias = "m/s^2" if state.kind == "accelerometer" else "rad/s"
    if state.kind == "g-sensitivity":
        return amount(state.sigma, "rad/s/(m/s²)")
    return amount(state.sigma, bias if state.column < 0 else "1" if state.row == state.column else "rad")


def predict_command(
    asked: PredictRequest,
    output: Path | None = option(FIRST, "PATH", "--output", "-o"),
    as_json: Json = False,
) -> None:
    """Say what a calibration is worth: position error without satellites, attitude error after a turn.

    At rest and after a turn of 90° about each axis it follows from the calibration's covariance in closed form, one
    sigma. Beside it is the error of the same unit with nominal scale factors and no bias. On a straight course noise,
    the wander of biases and --turn-on-bias are in it; there it says which states a filter has to carry, and their first
    sigmas. With --data-sheet: what a kind of unit promises without calibration, beside it.

    Parameters
    ----------
    output : File or folder for filter.json, a filter's states.
    """
    from tumble.workflows import predict, states_document, write_states

    found = predict(**vars(asked))
    files = [] if output is None else [write_states(found, output)]
    if files:
        results_stand()
    course = found.course
    if as_json:
        document = {
            "answers": [_as_dict(answer) for answer in found.answers],
            "straight_course": [] if course is None else _errors(course),
            "filter": None if course is None else states_document(course, found.remarks),
        }
        say_json(document, indent=1)
        return
    _print(found.answers, asked.data_sheet)
    if course is not None:
        _print_course(course)
    for sentence in found.remarks:
        console().print(f"• {sentence}")
    say_written(files)


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
    from tumble.report import FOOTNOTE, PREDICTED, cells

    heads = [*PREDICTED]
    if data_sheet is not None:
        heads.insert(2, data_sheet)
    rows = [cells(answer, with_sheet=data_sheet is not None) for answer in told]
    screen = console()
    screen.print(table(heads, rows, box=None, fold=True))
    screen.print(FOOTNOTE)
