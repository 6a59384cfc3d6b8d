"""What sensor errors do to the acceleration over a sequence of rotations (Savage 2018, (3) to (5), (20), (21)).

A unit that rests, is turned about its own axes and rests again has computed its attitude with its own gyros.
What their errors have made of it tilts the computed frame, so that gravity seems to have a horizontal
part at the end; the accelerometers' errors add theirs at the start and at the end. To first order all of
it is linear in the errors: one matrix for any sequence, of which table 1's are seventeen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Matrix, Table, Vector
from tumble.attitude import matrix_from_rotation_vector, skew
from tumble.records import dataclass
from tumble.sensor.conventions.savage import GROUPS, OFF_DIAGONAL, PAIRS

COMPONENTS = ("Δa x", "Δa y", "Δa z", "down at the start", "down at the end")
"""The five measurements of a sequence, in m/s², in the frame of its start."""


@dataclass(frozen=True, slots=True)
class SequenceModel:
    """The first-order error model of a sequence.

    Attributes
    ----------
    coefficients : (5, 24) of the measurements (`COMPONENTS`) by Savage's errors, as `savage.NAMES`.
    bias_coefficients : (5, 3) by a gyro bias, m/s² per rad/s.
    down_start, down_end : (3,) unit vectors down in the body frame at the start and at the end.
    C_start_end : (3, 3) nominal, from the body frame at the end to that at the start.
    angle : rad, all rotations together, without sign.
    """

    coefficients: Table
    bias_coefficients: Table
    down_start: Vector
    down_end: Vector
    C_start_end: Matrix
    angle: float


def sequence_model(
    rotations: Sequence[tuple[int, float]],
    down_start: Vector,
    gravity: float,
    *,
    rate: float = 1.0,
    seconds: float = 10.0,
    share: float = 0.5,
) -> SequenceModel:
    """Return the error model of a sequence of rotations about the unit's own axes.

    Parameters
    ----------
    rotations : (axis 0 to 2, angle in rad) one after another.
    down_start : (3,) unit vector down in the body frame at the start.
    gravity : m/s².
    rate : rad/s of the rotations: how long a gyro bias adds up.
    seconds : s of each of the two measurements (T_Meas).
    share : of a measurement's time that its average lags behind its end (F_Meas): a half for plain means.

    Notes
    -----
    Savage 2018, (3) to (5). In (5) the signs of the asymmetry are those of the specific force, which is up: a
    sensor that points down at the start reads -g, and its error is +g λiii. (20) and (21) for the bias.
    """
    C_start = np.eye(3)
    tilt = np.zeros((3, 24))
    bias = np.zeros((3, 3))
    for axis, angle in rotations:
        unit = np.eye(3)[axis]
        tilt += C_start @ _rotation_errors(axis, angle)
        bias += C_start @ _bias_integral(unit, angle) * (abs(angle) / rate)
        C_start = C_start @ matrix_from_rotation_vector(angle * unit)
    down_end = C_start.T @ down_start
    horizontal = np.eye(3) - np.outer(down_start, down_start)
    start, end = _force_errors(down_start, gravity), _force_errors(down_end, gravity)
    towards = gravity * skew(down_start)
    coefficients = np.zeros((5, 24))
    coefficients[:3] = towards @ tilt + horizontal @ (C_start @ end - start)
    coefficients[3], coefficients[4] = down_start @ start, down_end @ end
    measured = seconds * (np.eye(3) + share * (C_start - np.eye(3)))
    bias_coefficients = np.zeros((5, 3))
    bias_coefficients[:3] = towards @ (bias + measured)
    return SequenceModel(
        coefficients,
        bias_coefficients,
        np.asarray(down_start, dtype=np.float64),
        np.asarray(down_end, dtype=np.float64),
        C_start,
        float(sum(abs(angle) for _, angle in rotations)),
    )


def _rotation_errors(axis: int, angle: float) -> Table:
    """(3, 24): the attitude error that one rotation adds, in the frame of its beginning (3)."""
    unit = np.eye(3)[axis]
    found = np.zeros((3, 24))
    found[:, GROUPS["kappa_lin"].start + axis] = unit * angle
    found[:, GROUPS["kappa_asym"].start + axis] = unit * abs(angle)
    across = np.sin(angle) * np.eye(3) + (1.0 - np.cos(angle)) * skew(unit)
    for number, (i, j) in enumerate(PAIRS):
        # κ_mis u is the column of the axis: κij = κji = υij / 2
        column = 0.5 * (np.eye(3)[i] * unit[j] + np.eye(3)[j] * unit[i])
        found[:, GROUPS["upsilon"].start + number] = across @ column
    return found


def _bias_integral(unit: Vector, angle: float) -> Matrix:
    """The mean of the attitude over one rotation: (20) divided by its time."""
    if angle == 0.0:
        return np.eye(3)
    cross = skew(unit)
    return np.eye(3) + (1.0 - np.cos(angle)) / angle * cross + (1.0 - np.sin(angle) / angle) * (cross @ cross)


def _force_errors(down: Vector, gravity: float) -> Table:
    """(3, 24): the accelerometers' errors at rest, in the body frame (4)."""
    found = np.zeros((3, 24))
    force = -gravity * down
    found[:, GROUPS["lambda_bias"]] = np.eye(3)
    found[:, GROUPS["lambda_lin"]] = np.diag(force)
    found[:, GROUPS["lambda_asym"]] = np.diag(np.abs(force))
    for number, (i, j) in enumerate(OFF_DIAGONAL):
        found[i, GROUPS["mu"].start + number] = force[j]
    return found


def across_down(down: Vector) -> AnyArray:
    """Return (2, 3) unit vectors across a direction, along body axes where it is along one itself.

    Parameters
    ----------
    down : (3,) unit vector.
    """
    main = int(np.argmax(np.abs(down)))
    first = np.eye(3)[(main + 1) % 3]
    first = first - down * float(first @ down)
    first /= np.linalg.norm(first)
    return np.asarray(np.array([first, np.cross(down, first)]), dtype=np.float64)
