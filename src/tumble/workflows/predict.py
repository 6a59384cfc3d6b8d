"""What a calibration is worth: answers to a user's question, errors on a straight course, the states of a filter."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tumble.calibration import LONGEST
from tumble.document import Answer, Calibration, answers, part_of, plain, read_calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.navigation import (
    InertialSamples,
    NavigationState,
    PredictedErrors,
    TriadSpread,
    plan_filter,
    predict_errors,
)
from tumble.noise import NoiseModel
from tumble.records import dataclass
from tumble.simulation import drive_along, find_grade
from tumble.workflows.calibration_parts import (
    WHOLE,
    CorrectedBy,
    in_b,
    noise_of_document,
    sheet_noise,
    start_covariance,
    walking,
)
from tumble.workflows.request import PredictRequest, asked, check_turn_on

_SHORTEST = 0.1  # s
_RATE = 50.0  # Hz
_LATITUDE = float(np.radians(45.0))
_HEADING = float(np.pi / 4.0)
COURSE = "straight"
_TINY = TriadSpread(1e-9, 1e-9, misalignment=1e-9)  # every entry a state; how uncertain, the calibration says


@dataclass(frozen=True)
class Prediction:
    """What a calibration is worth.

    Attributes
    ----------
    answers : errors at rest and after a turn, of the calibration alone.
    course : errors on a straight course, noise and all, with advice for a filter; None without both triads.
    remarks : sentences on the course.
    """

    answers: list[Answer]
    course: PredictedErrors | None
    remarks: list[str]


@asked(PredictRequest)
def predict(request: PredictRequest) -> Prediction:
    """Return what errors of position and attitude a calibration leaves, and which states a filter should carry.

    Raises
    ------
    UsageError
        If a number is out of bounds, or there is no such grade.
    CalibrationFileError
        If the file is no calibration, or states no uncertainties.
    """
    seconds, turn_on = request.seconds, request.turn_on
    for t in seconds:
        if not _SHORTEST <= t <= LONGEST:
            raise UsageError(
                f"--seconds {t:g} is out of bounds: give at least {_SHORTEST:g} and at most {LONGEST:g}, as far as "
                "the closed forms hold."
            )
    check_turn_on(turn_on)
    grade = None if request.data_sheet is None else find_grade(request.data_sheet)
    calibration = request.calibration
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    told = answers(document, seconds=tuple(seconds), grade=grade)
    if document.accelerometer is None or document.gyroscope is None:
        words = "Navigation takes accelerometers and gyros, and the calibration has not both: no course is predicted."
        return Prediction(told, None, [words])
    sheet = find_grade("consumer-mems") if grade is None else grade
    if request.noise is None:
        forces, rates = ((sheet_noise(t),) * 3 for t in (sheet.accelerometer, sheet.gyroscope))
        remarks = [f"The noise is the data sheet's ({sheet.name}); --noise takes this unit's own."]
    else:
        forces, rates = noise_of_document(request.noise)
        remarks = [f"The noise is this unit's, from {Path(request.noise).name}."]
    course = _on_course(document, seconds, forces, rates, turn_on)
    return Prediction(told, course, remarks + _remarks(document, turn_on))


def _on_course(
    document: Calibration,
    seconds: Sequence[float],
    forces: Sequence[NoiseModel],
    rates: Sequence[NoiseModel],
    turn_on: tuple[float, float],
) -> PredictedErrors:
    model, names = in_b(document), tuple(document.covariance_parameters)
    g_sensitivity = any(name.startswith("gyroscope.g_sensitivity") for name in names)
    setup = plan_filter(
        walking(forces),
        walking(rates),
        accelerometer=_TINY,
        gyroscope=_TINY,
        g_sensitivity=1e-12 if g_sensitivity else 0.0,
    )
    samples, start = straight_course(max(seconds), document)
    whole = CorrectedBy(WHOLE, samples, model, names)
    known = start_covariance(whole, setup.states, document, turn_on)
    return predict_errors(samples, start, setup.with_sensor_covariance(known), seconds)


def _remarks(document: Calibration, turn_on: tuple[float, float]) -> list[str]:
    remarks = [
        "At the start position, velocity and attitude are known exactly; what their uncertainty does comes on top."
    ]
    if turn_on == (0.0, 0.0):
        remarks.append(
            "Biases are counted as on the day of the calibration; --turn-on-bias adds how they move from one power "
            "cycle to the next."
        )
    if not any(name.startswith("gyroscope.matrix") for name in document.covariance_parameters):
        remarks.append(
            "The gyros' scale and axes are not calibrated, and are counted as exact: their part is missing."
        )
    return remarks


def states_document(course: PredictedErrors, remarks: list[str]) -> dict[str, Any]:
    """Return the advice on a filter's states as plain data, in SI.

    Parameters
    ----------
    course, remarks : of the prediction.
    """
    from tumble.report import FilterDocument, StateBlock

    units = {"accelerometer": "m/s²", "gyroscope": "rad/s", "g-sensitivity": "(rad/s)/(m/s²)"}
    states = [
        part_of(
            StateBlock,
            state,
            column=None if state.column < 0 else state.column,
            unit=units[state.kind] if state.column < 0 or state.kind == "g-sensitivity" else "1",
            walk_per_root_second=state.walk,
            largest_share_of_variance=state.share,
        )
        for state in course.states
    ]
    document = FilterDocument(
        trajectory=COURSE,
        seconds=course.seconds.tolist(),
        states=states,
        remarks=remarks,
    )
    return plain(document)


def write_states(found: Prediction, path: Path) -> Path:
    """Write the advice on a filter's states, beside the calibration or where it was asked for.

    Parameters
    ----------
    found : the prediction.
    path : of the file, or a folder for ``filter.json``.

    Raises
    ------
    CalibrationFileError
        If there is none, for want of a triad.
    UsageError
        If a file stands where the folder is to be.
    OutputError
        If it cannot be written; what was there is intact.
    """
    from tumble.files import results_folder, write_text

    if found.course is None:
        raise CalibrationFileError(f"There are no states to write. {found.remarks[0]}")
    file = path
    if path.suffix != ".json":
        results_folder(path)
        file = path / "filter.json"
    text = json.dumps(states_document(found.course, found.remarks), indent=1, ensure_ascii=False)
    write_text(file, f"{text}\n")
    return file


def straight_course(duration: float, document: Calibration) -> tuple[InertialSamples, NavigationState]:
    """Return what a unit measures that reaches 15 m/s in 10 s and goes on straight to the north-east, level.

    Parameters
    ----------
    duration : s.
    document : whose site it starts from.
    """
    place = document.site
    latitude = _LATITUDE if place.latitude_deg is None else float(np.radians(place.latitude_deg))
    origin = (latitude, 0.0, place.height_m or 0.0)
    knots = np.arange(0.0, duration + 3.0, 0.5)
    part = np.clip(knots / 10.0, 0.0, 1.0)
    # from 0 to 1 with slope and bend zero at both ends
    speed = 15.0 * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    path = drive_along(origin, knots, speed, np.full(len(knots), _HEADING))
    time = np.arange(int(np.ceil(duration * _RATE)) + 2) / _RATE
    states = path.states(time)
    start = NavigationState.from_angles(0.0, origin, states.velocity_n[0], np.array([0.0, 0.0, _HEADING]))
    return InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), start
