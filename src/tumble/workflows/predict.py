"""What a calibration is worth: answers to a user's question, errors on a trajectory, the states of a filter."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.arrays import AnyArray, Square
from tumble.document import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.navigation import (
    InertialSamples,
    NavigationState,
    TriadSpread,
    covariance_from_calibration,
    plan_filter,
    read_track,
)
from tumble.navigation.course import track_velocities
from tumble.navigation.prediction import PredictedErrors, StateAdvice, advise_states, predict_errors
from tumble.noise.terms import NoiseModel
from tumble.records import dataclass
from tumble.simulation import find_grade
from tumble.simulation.standard_trajectories import STANDARD, standard_trajectory, trajectory_of_track
from tumble.simulation.trajectories import SplineTrajectory
from tumble.workflows.verification.calibration_parts import in_b
from tumble.workflows.verification.drive_filter import noise_of_document, sheet_noise

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


LONGEST = 3600.0
_RATE = 50.0
_LATITUDE = float(np.radians(45.0))


@dataclass(frozen=True, slots=True)
class NavigationPrediction:
    """Predicted errors of free navigation, and advice for a filter.

    Attributes
    ----------
    errors : covariances by length, and by parameter.
    states : advice on every sensor state, in a filter's order.
    remarks : sentences.
    """

    errors: PredictedErrors
    states: list[StateAdvice]
    remarks: list[str]

    def horizontal(self, covariance: AnyArray) -> list[float]:
        """Return horizontal standard uncertainties (root sum of north and east), m, of nine errors' covariances."""
        return np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1]).tolist()


def predict_navigation(
    calibration: str | os.PathLike[str] | Calibration,
    *,
    seconds: Sequence[float],
    trajectory: str = "rest",
    noise: str | os.PathLike[str] | None = None,
    data_sheet: str = "consumer-mems",
    turn_on: tuple[float, float] = (0.0, 0.0),
) -> NavigationPrediction:
    """Return what a calibration's covariance and the noise become in free navigation.

    Parameters
    ----------
    calibration : ``calibration.json``, its folder, or a `Calibration`.
    seconds : s of free navigation from a known start.
    trajectory : "rest", "straight" or "cart", or a file of positions.
    noise : what `tumble noise` wrote for this unit; None for the data sheet's.
    data_sheet : kind of unit, for the noise.
    turn_on : m/s² and rad/s, by how much biases move since the calibration, one sigma.

    Raises
    ------
    CalibrationFileError, RecordingError, UsageError
        If an input is wrong, or a time is beyond an hour or the trajectory.
    """
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    if not seconds or not all(0.1 <= t <= LONGEST for t in seconds):
        raise UsageError(f"--seconds along a trajectory are 0.1 to {LONGEST:g}.")
    model = in_b(document)
    document.need_uncertainties("the errors of what it corrects cannot be predicted")
    names = tuple(document.covariance_parameters)
    covariance = _with_turn_on(document, turn_on)
    path, remarks = _path(trajectory, max(seconds), document)
    samples, start = _travelled(path, max(seconds))
    grade = find_grade(data_sheet)
    if noise is None:
        forces, rates = ((sheet_noise(t),) * 3 for t in (grade.accelerometer, grade.gyroscope))
        remarks.append(f"The noise is the data sheet's ({grade.name}); --noise takes this unit's own.")
    else:
        forces, rates = noise_of_document(noise)
        remarks.append(f"The noise is this unit's, from {Path(noise).name}.")
    bare = plan_filter(_walking(forces), _walking(rates))
    errors = predict_errors(samples, start, model, names, covariance, bare, seconds)
    g_sensitivity = any(name.startswith("gyroscope.g_sensitivity") for name in names)
    whole = plan_filter(
        _walking(forces),
        _walking(rates),
        accelerometer=TriadSpread(1e-9, 1e-9, misalignment=1e-9),
        gyroscope=TriadSpread(1e-9, 1e-9, misalignment=1e-9),
        g_sensitivity=1e-12 if g_sensitivity else 0.0,
    )
    known = covariance_from_calibration(whole.states, model, names, covariance)
    setup = whole.with_sensor_covariance(known)
    remarks.append(
        "At the start position, velocity and attitude are known exactly; what their uncertainty does comes on top."
    )
    if turn_on == (0.0, 0.0):
        remarks.append(
            "Biases are counted as on the day of the calibration; --turn-on-bias adds how they move from one power "
            "cycle to the next."
        )
    unknown = [word for word in ("gyroscope.matrix",) if not any(name.startswith(word) for name in names)]
    if unknown:
        remarks.append(
            "The gyros' scale and axes are not calibrated, and are counted as exact: their part is missing."
        )
    return NavigationPrediction(errors, advise_states(samples, start, setup, seconds), remarks)


def _with_turn_on(document: Calibration, turn_on: tuple[float, float]) -> Square:
    """Return a calibration's covariance with what biases may have moved since."""
    covariance = document.covariance_matrix.copy()
    model = in_b(document)
    for kind, triad, sigma in (
        ("accelerometer", model.accelerometer, turn_on[0]),
        ("gyroscope", model.gyroscope, turn_on[1]),
    ):
        at = [i for i, name in enumerate(document.covariance_parameters) if name.startswith(f"{kind}.bias[")]
        if triad is not None and sigma > 0.0 and len(at) == 3:
            covariance[np.ix_(at, at)] += sigma**2 * (triad.matrix @ triad.matrix.T)
    return covariance


def states_document(found: NavigationPrediction, trajectory: str) -> dict[str, Any]:
    """Return the advice on a filter's states as plain data, in SI.

    Parameters
    ----------
    found : the prediction.
    trajectory : it is for.
    """
    from tumble.report.predictions import FORMAT, MODEL, VERSION, FilterDocument, StateBlock

    units = {"accelerometer": "m/s²", "gyroscope": "rad/s", "g-sensitivity": "(rad/s)/(m/s²)"}
    states = [
        StateBlock.model_validate(
            {
                "name": state.name,
                "kind": state.kind,
                "row": state.row,
                "column": None if state.column < 0 else state.column,
                "sigma": state.sigma,
                "unit": units[state.kind] if state.column < 0 or state.kind == "g-sensitivity" else "1",
                "walk_per_root_second": state.walk,
                "largest_share_of_variance": state.share,
                "carry": state.carry,
            }
        )
        for state in found.states
    ]
    return FilterDocument(
        format=FORMAT,
        version=VERSION,
        model=MODEL,
        trajectory=trajectory,
        seconds=found.errors.seconds.tolist(),
        states=states,
        remarks=found.remarks,
    ).model_dump()


def write_states(found: NavigationPrediction, trajectory: str, path: Path) -> Path:
    """Write the advice on a filter's states, beside the calibration or where it was asked for.

    Parameters
    ----------
    found, trajectory : as for `states_document`.
    path : of the file, or a folder for ``filter.json``.

    Raises
    ------
    OutputError
        If it cannot be written; what was there is intact.
    """
    from tumble.files import write_text

    file = path if path.suffix == ".json" else path / "filter.json"
    write_text(file, json.dumps(states_document(found, trajectory), indent=1, ensure_ascii=False) + "\n")
    return file


def _walking(models: Sequence[NoiseModel]) -> tuple[NoiseModel, NoiseModel, NoiseModel]:
    """White noise and bias walks; an instability walks as far in 100 s as it is."""
    walked = [
        replace(
            NoiseModel(random_walk=model.random_walk),
            rate_random_walk=max(model.rate_random_walk, model.bias_instability / 10.0),
        )
        for model in models
    ]
    return walked[0], walked[1], walked[2]


def _path(name: str, duration: float, document: Calibration) -> tuple[SplineTrajectory, list[str]]:
    latitude = (
        _LATITUDE if document.site.latitude_deg is None else float(np.radians(document.site.latitude_deg))
    )
    if name in STANDARD:
        origin = (latitude, 0.0, document.site.height_m or 0.0)
        return standard_trajectory(name, duration, origin=origin), [f"Trajectory: {STANDARD[name]}."]
    if not Path(name).exists():
        raise UsageError(
            f"--trajectory {name} is neither {', '.join(STANDARD)} nor a file of satellite positions that is there."
        )
    track = read_track(Path(name))
    path = trajectory_of_track(track.time, track.position, track_velocities(track), duration)
    return path, [f"Trajectory: {track.name}, driven level, x of b forward."]


def _travelled(path: SplineTrajectory, duration: float) -> tuple[InertialSamples, NavigationState]:
    time = np.arange(int(np.ceil(duration * _RATE)) + 2) / _RATE
    states = path.states(time)
    first = path.states(time[:1])
    from scipy.spatial.transform import Rotation

    C_nb = np.asarray(Rotation.from_quat(first.quaternion_nb[0]).as_matrix(), dtype=np.float64)
    start = NavigationState(
        0.0,
        float(first.latitude[0]),
        float(first.longitude[0]),
        float(first.height[0]),
        first.velocity_n[0],
        C_nb,
    )
    return InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), start
