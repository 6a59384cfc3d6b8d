"""What a recording or a calibration that is there already tells: of the accelerometers, or of both triads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.errors import ConvergenceError, ObservabilityError, UsageError

if TYPE_CHECKING:
    from tumble.arrays import Square
    from tumble.design.joint_information import JointInformation
    from tumble.design.joint_plan import PlanTask
    from tumble.document import Calibration

# Of a correlation matrix, what is round-off.
_FLAT = 1e-10


def read_given_information(
    given: str | os.PathLike[str], recorded: str | os.PathLike[str] | None, task: PlanTask
) -> tuple[JointInformation, list[str]]:
    """Return the information of a recording or of a calibration, with words about it.

    Parameters
    ----------
    given : a calibration.json, a folder with one, or a recording.
    recorded : the protocol that it was recorded with; None for none.
    task : the plan that it is for: site and spreads.

    Raises
    ------
    UsageError, CalibrationFileError, RecordingError, SegmentationError, ProtocolError
        If it is neither, or cannot be read.
    """
    path = _existing(given)
    found = _calibration_at(path)
    if found is not None:
        return information_of(found[0], task), found[1]
    from tumble.workflows.calibrate import calibrate

    try:
        run = calibrate(path, protocol=recorded, site=task.site)
    except (ObservabilityError, ConvergenceError):
        return _of_few_holds(path, task)
    quality = run.calibration.quality
    words = f"{path} has {quality.holds} holds and {quality.turns} turns, a {run.calibration.procedure} calibration."
    return information_of(run.calibration, task), [words]


def read_known(given: str | os.PathLike[str]) -> tuple[Square, list[str]]:
    """Return the information (9, 9) of a calibration or a recording, with words about it.

    Parameters
    ----------
    given : a calibration.json, a folder with one, or a recording.

    Raises
    ------
    UsageError, CalibrationFileError, RecordingError, SegmentationError, ObservabilityError
        If it is neither, or has no holds, or no accelerometers.
    """
    path = _existing(given)
    found = _calibration_at(path)
    if found is None:
        return _known_from_recording(path)
    from tumble.design.next_pose import known_from_calibration

    return known_from_calibration(found[0]), found[1]


def _existing(given: str | os.PathLike[str]) -> Path:
    path = Path(given)
    if not path.exists():
        raise UsageError(f"--given {path}: there is no such file; give a calibration.json or a recording.")
    return path


def _calibration_at(path: Path) -> tuple[Calibration, list[str]] | None:
    """The calibration of a document or a folder, with words about it; None for a recording."""
    if not path.is_dir() and path.suffix.lower() != ".json":
        return None
    from tumble.document.result import read_calibration

    calibration = read_calibration(path)
    holds = calibration.quality.holds
    return calibration, [f"{path} is a {calibration.procedure} calibration from {holds} holds."]


def _known_from_recording(path: Path) -> tuple[Square, list[str]]:
    from tumble.calibration.poses import describe_direction, distinct_poses
    from tumble.design.next_pose import known_from_holds
    from tumble.recording import read_recording
    from tumble.segmentation import find_timeline, observe_holds
    from tumble.segmentation.events import scale_of_sphere, scale_of_units
    from tumble.units import specific_force_factor

    recording = read_recording(path)
    means = observe_holds(recording, find_timeline(recording))
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError(f"{path} has no accelerometer: poses determine nothing of gyros alone.")
    raw = means.specific_force
    scale = scale_of_units(raw)
    if specific_force_factor(recording.specific_force_unit) is None:
        found = scale_of_sphere(raw)
        if found is None:
            raise ObservabilityError(
                f"{path} is in counts, and its {len(raw)} holds do not determine where zero is: "
                "declare its units, or hold the unit in more poses."
            )
        scale = found
    directions = scale.directions(raw)
    words = [describe_direction(directions[index]) for index in distinct_poses(directions)]
    return known_from_holds(directions, means.specific_force_covariance, scale.scale), [
        f"{path} has {len(raw)} holds in {len(words)} different poses: {'; '.join(words)}."
    ]


def information_of(calibration: Calibration, task: PlanTask) -> JointInformation:
    """Return the information that a calibration states of the thirty parameters.

    Parameters
    ----------
    calibration : with its covariance; what it does not state counts as not told.
    task : the spreads by which nothing is known.

    Raises
    ------
    UsageError
        If it states no accelerometer matrix.
    """
    from tumble.design.joint_information import PARAMETERS, JointInformation

    values = _values(calibration)
    if calibration.frame.name != "accelerometer-x":
        # A plan's axes are the accelerometers': how a fixture holds the unit is no matter of theirs.
        from tumble.document.frame_change import turned_to

        calibration = turned_to(calibration, "accelerometer-x")
        values = _values(calibration)
    names = list(calibration.covariance_parameters)
    where = [index for index, name in enumerate(names) if name in values]
    slopes = np.array([_slope(values, names[index]) for index in where]).T
    covariance = slopes @ calibration.covariance_matrix[np.ix_(where, where)] @ slopes.T
    spread = np.diag(covariance)
    told = np.flatnonzero(spread > 0.0)
    if not told.size:
        raise UsageError("The calibration states no uncertainties: it cannot say what is missing.")
    information = np.zeros((PARAMETERS, PARAMETERS))
    size = np.sqrt(spread[told])
    correlation = covariance[np.ix_(told, told)] / np.outer(size, size) + _FLAT * np.eye(told.size)
    information[np.ix_(told, told)] = np.linalg.inv(correlation) / np.outer(size, size)
    return JointInformation(information)


def _values(calibration: Calibration) -> dict[str, complex]:
    """Canonical entries by name, divided by each triad's own mean scale factor."""
    values: dict[str, complex] = {}
    for kind, triad in (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)):
        if triad is None or triad.matrix is None:
            continue
        matrix = np.array(triad.matrix, dtype=float)
        for i in range(3):
            for j in range(3):
                values[f"{kind}.matrix[{i},{j}]"] = matrix[i, j]
                if triad.g_sensitivity is not None:
                    values[f"{kind}.g_sensitivity[{i},{j}]"] = triad.g_sensitivity[i][j]
            values[f"{kind}.bias[{i}]"] = triad.bias[i]
    if "accelerometer.matrix[0,0]" not in values:
        raise UsageError("The calibration states no accelerometer matrix: calibrate in more poses first.")
    return values


def _slope(values: dict[str, complex], name: str) -> Any:
    """(30,) derivative of the parameters by one canonical entry, by a complex step."""
    step = 1e-30
    moved = dict(values)
    moved[name] = moved[name] + 1j * step
    return np.imag(_parameters(moved)) / step


def _parameters(values: dict[str, complex]) -> Any:
    """The thirty parameters; those of a gyro that is not there are zero."""
    from tumble.design.joint_information import parameters_of

    def block(name: str, default: Any) -> Any:
        return np.array(
            [[values.get(f"{name}[{i},{j}]", default[i, j]) for j in range(3)] for i in range(3)],
            dtype=complex,
        )

    force, gyro = block("accelerometer.matrix", np.eye(3)), block("gyroscope.matrix", np.eye(3))
    biases = [
        np.array([values.get(f"{kind}.bias[{i}]", 0.0) for i in range(3)], dtype=complex)
        for kind in ("accelerometer", "gyroscope")
    ]
    sensitivity = block("gyroscope.g_sensitivity", np.zeros((3, 3)))
    scales = [float(np.mean(np.real(np.diag(matrix)))) for matrix in (force, gyro)]
    return parameters_of(
        force / scales[0],
        biases[0] / scales[0],
        gyro / scales[1],
        biases[1] / scales[1],
        sensitivity / scales[1],
    )


def _of_few_holds(path: Path, task: PlanTask) -> tuple[JointInformation, list[str]]:
    """The information of a recording that determines too little for a calibration."""
    from tumble.calibration.equations.gathering import gather
    from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
    from tumble.calibration.equations.observed import observe
    from tumble.design.joint_information import planned_problem
    from tumble.recording import read_recording
    from tumble.segmentation import find_timeline, observe_holds
    from tumble.sensor import ImuModel
    from tumble.units import angular_rate_factor, specific_force_factor

    recording = read_recording(path)
    factors = (
        specific_force_factor(recording.specific_force_unit),
        angular_rate_factor(recording.angular_rate_unit),
    )
    if factors != (1.0, 1.0) or recording.specific_force is None or recording.angular_rate is None:
        raise UsageError(
            f"--given {path} does not determine enough for a calibration. So early the next step is "
            "found only for both triads in m/s² and rad/s: record more poses and turns first."
        )
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    values = unknowns_of(ImuModel.ideal())
    data = observe(gather(recording, timeline, means), imu_unknowns(values), [])
    problem = planned_problem(data, task.site, task.sizes)
    turns = int(data.turns.size)
    words = f"{path} has {data.holds} holds and {turns} turns that can be followed: too few for a calibration yet."
    return problem.information().beside_clock(task.clock), [words]
