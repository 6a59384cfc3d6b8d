"""The poses of a test, searched: which, for how long, in which order, beside the papers' own.

And what a recording or a calibration that is there already tells of both triads.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.design.joint_information import PARAMETERS, JointInformation, parameters_of
from tumble.errors import UsageError
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.design.joint_plan import PlanTask
    from tumble.design.pose_plan import PosePlan, PoseTask
    from tumble.document import Calibration
    from tumble.protocol import Protocol, Step
    from tumble.simulation import Grade
    from tumble.workflows.request import PlanRequest


LEVELLED, BY_HAND = math.radians(0.5), math.radians(5.0)
"""One sigma to which faces on a plate are levelled, and a unit is laid down."""
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200


@dataclass(frozen=True, slots=True)
class PoseSearch:
    """Poses that were searched.

    Attributes
    ----------
    task, plan : the design room's.
    schemes : the papers', in the same time, or in words why not.
    protocol : the plan to do.
    """

    task: PoseTask
    plan: PosePlan
    schemes: dict[str, PosePlan | str]
    protocol: Protocol


def check_search(request: PlanRequest) -> None:
    """Refuse numbers that contradict one another or that no test has.

    Parameters
    ----------
    request : what is planned.

    Raises
    ------
    UsageError
        If there is one.
    """
    poses, minutes, hold, turn = request.poses, request.minutes, request.hold, request.turn
    if poses is not None and minutes is not None:
        raise UsageError(
            "--poses and --time: give the number of poses or the time of the whole test, not both."
        )
    if minutes is not None and hold is not None:
        raise UsageError(
            "--hold and --time: with the time of the whole test the dwells follow; leave --hold out."
        )
    if poses is not None and not 1 <= poses <= MOST_POSES:
        raise UsageError(f"--poses {poses}: give 1 to {MOST_POSES}.")
    if minutes is not None and not 0.0 < minutes <= 10_000.0:
        raise UsageError(f"--time {minutes:g}: give minutes of the whole test, up to 10000.")
    if hold is not None and not 1.0 <= hold <= 100_000.0:
        raise UsageError(f"--hold {hold:g}: give 1 to 100000 seconds of rest in each pose.")
    if turn is not None and not 0.5 <= turn <= 3600.0:
        raise UsageError(f"--turn-seconds {turn:g}: give 0.5 to 3600 seconds from one pose to the next.")


def search_poses(
    request: PlanRequest, planned: PlanTask, grade: Grade, say: Callable[[str], None]
) -> PoseSearch:
    """Return the best poses for a test, and the papers' in the same time.

    Parameters
    ----------
    request, planned, grade : what is asked for, and the unit.
    say : called with a sentence on what is being done.

    Raises
    ------
    UsageError, ObservabilityError
        If there is no time for the poses that are needed, or so many do not tell what is wanted.
    """
    from tumble.design.pose_plan import PoseTask, known_norms, plan_poses, plan_schemes, plan_time

    hold, turn, count = DEFAULTS[request.asked]
    dwell, faces, site = request.hold or hold, request.asked == "six-position", planned.site
    task = PoseTask(planned.noise.accelerometer, planned.noise.rate, request.turn or turn, site.gravity)
    if planned.known is not None or planned.sheet is not None:
        task = replace(task, known=known_norms(planned, site.gravity))
    say("searching")
    rng = np.random.default_rng(request.seed)
    if faces:
        task, found = _levelled(request, task, grade, dwell)
    elif request.minutes is not None:
        found = plan_time(task, 60.0 * request.minutes, rng, say)
    else:
        found = plan_poses(task, request.poses or count, dwell, rng)
    say("comparing")
    schemes = plan_schemes(replace(task, placement=0.0, shortening=0.0), found.duration)
    if faces:
        del schemes["six faces"]
    return PoseSearch(task, found, schemes, _protocol(request.asked, found, LEVELLED if faces else BY_HAND))


def _levelled(request: PlanRequest, task: PoseTask, grade: Grade, dwell: float) -> tuple[PoseTask, PosePlan]:
    """The six faces, in their best order: scale factors and biases alone, and what levelling adds to each."""
    from tumble.attitude.directions import twenty_six_directions
    from tumble.design.pose_plan import GROUPS, best_order, plan_of

    if request.poses not in (None, 6):
        raise UsageError(f"--poses {request.poses}: a six-position test has its six faces.")
    if (whole := request.minutes) is not None:
        dwell = (60.0 * whole + task.turn) / 6 - task.turn
        if dwell < 1.0:
            raise UsageError(
                f"--time {whole:g}: that leaves no time for six poses and the turns between them."
            )
    # Of a face's own reading: the square of the tilt, and its product with misalignment.
    own = math.hypot(LEVELLED**2, math.sqrt(2.0) * LEVELLED * grade.accelerometer.misalignment)
    wanted = np.array([*GROUPS["scale"], *GROUPS["bias"]])
    task = replace(task, wanted=wanted, placement=own, shortening=LEVELLED**2)
    faces = twenty_six_directions()[[0, 5, 1, 4, 2, 3]]
    return task, plan_of("six faces", task, faces[best_order(task, faces, dwell)], np.full(6, dwell))


def _protocol(procedure: str, plan: PosePlan, hand: float) -> Protocol:
    from tumble.calibration.poses import describe_direction
    from tumble.protocol import HoldStep, Pose, Protocol, TurnStep

    steps: list[Step] = []
    for up, dwell in zip(plan.directions, plan.dwells, strict=True):
        steps += [TurnStep(plan.turn)] if steps else []
        steps.append(
            HoldStep(float(dwell), Pose(np.asarray(up, dtype=float), None, hand), describe_direction(up))
        )
    words = f"{len(plan.dwells)} poses, {plan.name}, as tumble plan found them."
    return Protocol(f"{procedure}-plan", procedure, tuple(steps), description=words)


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
