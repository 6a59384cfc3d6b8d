"""What a recording or a calibration that is there already tells of both triads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.design.joint_information import PARAMETERS, JointInformation, parameters_of
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.design.joint_plan import PlanTask
    from tumble.document import Calibration

# Of a correlation matrix, what is round-off.
_FLAT = 1e-10


def read_given(
    given: str | os.PathLike[str], recorded: str | os.PathLike[str] | None, task: PlanTask
) -> tuple[JointInformation, list[str]]:
    """Return the information of a recording or of a calibration, with words about it.

    Of a recording it is that of the equations which a calibration begins with: nothing is adjusted.

    Parameters
    ----------
    given : a calibration.json, a folder with one, or a recording.
    recorded : the protocol that it was recorded with; None for none.
    task : the plan that it is for: site, spreads, and how biases wander.

    Raises
    ------
    UsageError, CalibrationFileError, RecordingError, SegmentationError, ProtocolError, ObservabilityError
        If it is neither, or cannot be read.
    """
    path = Path(given)
    if not path.exists():
        raise UsageError(f"--given {path}: there is no such file; give a calibration.json or a recording.")
    if path.is_dir() or path.suffix.lower() == ".json":
        from tumble.document.result import read_calibration

        calibration = read_calibration(path)
        holds = calibration.quality.holds
        return information_of(calibration), [
            f"{path} is a {calibration.procedure} calibration from {holds} holds."
        ]
    from tumble.calibration.poses import describe_direction, distinct_poses
    from tumble.calibration.session import Session
    from tumble.design.joint_information import observed_problem
    from tumble.recording import read_recording
    from tumble.workflows.given.protocols import read_given_protocol

    told = None if recorded is None else read_given_protocol(recorded).protocol
    if told is None:
        recording = read_recording(path)
    else:
        recording = read_recording(path, columns=told.columns, units=told.units, rate=told.rate)
    session = Session(recording, told, task.site)
    problem = observed_problem(session, task.noise, g_sensitivity=task.g_sensitivity)
    up_b = -np.concatenate([section.C_wb[:, 1, 2] for section in problem.task.sections])
    names = [describe_direction(up_b[index]) for index in distinct_poses(up_b)]
    counts = f"{len(up_b)} holds and {problem.task.data.turns.size} turns"
    words = f"{path} has {counts}, in {len(names)} different poses: {'; '.join(names)}."
    return problem.information(), [words]


def information_of(calibration: Calibration) -> JointInformation:
    """Return the information that a calibration states of the thirty parameters.

    Parameters
    ----------
    calibration : with its covariance; what it does not state counts as not told.

    Raises
    ------
    UsageError
        If it states no accelerometer matrix.
    """
    from tumble.document.entries import PLACES, put, stacked, turned_to
    from tumble.sensor import propagate

    if calibration.accelerometer is None or calibration.accelerometer.matrix is None:
        raise UsageError("The calibration states no accelerometer matrix: calibrate in more poses first.")
    if calibration.frame.name != "accelerometer-x":
        # A plan's axes are the accelerometers': how a fixture holds the unit is no matter of theirs.
        calibration = turned_to(calibration, "accelerometer-x")
    values, covariance = stacked(calibration)
    if calibration.model.gyroscope is None:
        gyro = PLACES["gyroscope.matrix"][0].start
        covariance[gyro:] = covariance[:, gyro:] = 0.0
        put(values, "gyroscope.matrix", np.eye(3))
    _, covariance = propagate(_parameters, values, covariance)
    spread = np.diag(covariance)
    told = np.flatnonzero(spread > 0.0)
    if not told.size:
        raise UsageError("The calibration states no uncertainties: it cannot say what is missing.")
    information = np.zeros((PARAMETERS, PARAMETERS))
    size = np.sqrt(spread[told])
    correlation = covariance[np.ix_(told, told)] / np.outer(size, size) + _FLAT * np.eye(told.size)
    information[np.ix_(told, told)] = np.linalg.inv(correlation) / np.outer(size, size)
    return JointInformation(information)


def _parameters(values: Any) -> Any:
    """The thirty parameters of a document's numbers, each triad's divided by its own mean scale factor."""
    from tumble.document.entries import part

    force, gyro = (part(values, f"{kind}.matrix") for kind in ("accelerometer", "gyroscope"))
    sizes = [float(np.mean(np.real(np.diag(matrix)))) for matrix in (force, gyro)]
    return parameters_of(
        force / sizes[0],
        part(values, "accelerometer.bias") / sizes[0],
        gyro / sizes[1],
        part(values, "gyroscope.bias") / sizes[1],
        part(values, "gyroscope.g_sensitivity") / sizes[1],
    )
