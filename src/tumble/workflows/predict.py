"""What a calibration file says of a user's question."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.document.predictions import Answer

LARGEST_TURN, LARGEST_RATE = 36_000.0, 10_000.0  # degrees, degrees per second


def predict(
    calibration: str | os.PathLike[str],
    *,
    seconds: tuple[float, ...] = (10.0, 60.0),
    turn_degrees: float = 90.0,
    turn_rate_degrees: float = 30.0,
    data_sheet: str | None = None,
) -> list[Answer]:
    """Return what errors of position and attitude a calibration leaves.

    Parameters
    ----------
    calibration : ``calibration.json``, or the folder that holds it.
    seconds : s of free inertial navigation at rest.
    turn_degrees, turn_rate_degrees : of a turn about each axis.
    data_sheet : name of one of `tumble.simulation.GRADES`, for the same without calibration.

    Raises
    ------
    UsageError
        If a number is out of bounds, or there is no such grade.
    CalibrationFileError
        If the file is no calibration, or is composed of several.
    """
    from tumble.calibration.free_inertial import LONGEST
    from tumble.document.predictions import answers
    from tumble.document.result import read_calibration

    for t in seconds:
        if not 0.0 < t <= LONGEST:
            raise UsageError(
                f"--seconds {t:g} is out of bounds: give more than 0 and at most {LONGEST:g}, as far as the closed "
                "forms hold."
            )
    for name, value, most in (
        ("--turn", turn_degrees, LARGEST_TURN),
        ("--turn-rate", turn_rate_degrees, LARGEST_RATE),
    ):
        if not 0.0 < value <= most:
            raise UsageError(
                f"{name} {value:g} is out of bounds: give degrees, more than 0 and at most {most:g}."
            )
    grade = None
    if data_sheet is not None:
        from tumble.simulation import find_grade

        grade = find_grade(data_sheet)
    return answers(
        read_calibration(calibration),
        seconds=seconds,
        turn=math.radians(turn_degrees),
        turn_rate=math.radians(turn_rate_degrees),
        grade=grade,
    )
