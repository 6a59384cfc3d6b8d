"""Body frames by name: what is held fixed in the matrices.

A unit's two matrices are known up to one common rotation of the body frame b. A *frame* fixes it:

- ``accelerometer-x``: the accelerometer's forward matrix is lower triangular. b's x axis is the x
  sensing axis, its y axis lies in the plane of the x and y sensing axes (Shin, Zhang, Kalibr).
- ``accelerometer-z``: it is upper triangular. b's z axis is the z sensing axis, its y axis lies in
  the plane of the y and z sensing axes (imu_tk).
- ``mean-gyro``: the gyro's forward matrix is symmetric (Savage's mean angular rate sensor frame, MARS).

Everything here is analytic in the matrices (Cholesky factors instead of QR), so that covariances
are carried exactly to first order by the complex step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series, Square, Table
from tumble.errors import UsageError
from tumble.sensor.imu import ImuModel

Complex = npt.NDArray[Any]

FRAMES: dict[str, str] = {
    "accelerometer-x": (
        "x along the sensing axis of the x accelerometer, y in the plane of the x and y accelerometers "
        "(forward accelerometer matrix lower triangular)"
    ),
    "accelerometer-z": (
        "z along the sensing axis of the z accelerometer, y in the plane of the y and z accelerometers "
        "(forward accelerometer matrix upper triangular)"
    ),
    "mean-gyro": (
        "the orthogonal axes that fit best around the gyros' sensing axes (forward gyro matrix symmetric; Savage's "
        "MARS)"
    ),
}


def lower_factor(matrix: Complex) -> Complex:
    """Return L, lower triangular with a positive diagonal, with ``matrix = L @ rotation``.

    Row 0's length keeps its sign by convention: L is the Cholesky factor of matrix @ matrix.T, so a
    matrix with a negative determinant leaves a reflection in the second factor.
    """
    product = matrix @ matrix.T
    zero = product[0, 0] * 0.0
    a = np.sqrt(product[0, 0])
    b = product[1, 0] / a
    c = np.sqrt(product[1, 1] - b * b)
    d = product[2, 0] / a
    e = (product[2, 1] - d * b) / c
    f = np.sqrt(product[2, 2] - d * d - e * e)
    return np.array([[a, zero, zero], [b, c, zero], [d, e, f]])


def upper_factor(matrix: Complex) -> Complex:
    """Return U, upper triangular with a positive diagonal, with ``matrix = U @ rotation``."""
    return lower_factor(matrix[::-1, ::-1])[::-1, ::-1]


def frame_rotation(matrix: Complex, frame: str) -> Complex:
    """Return ``C_new_b``, from the frame of the accelerometer `matrix` to the named frame.

    ``matrix @ C_new_b.T`` is the triangular matrix of the new frame.

    Raises
    ------
    UsageError
        If the frame's name is unknown.
    """
    if frame == "accelerometer-x":
        return inverse(lower_factor(matrix)) @ matrix
    if frame == "accelerometer-z":
        return inverse(upper_factor(matrix)) @ matrix
    if frame == "mean-gyro":
        raise UsageError("The frame 'mean-gyro' is fixed by the gyros: change a whole model to it.")
    raise UsageError(f"There is no frame {frame!r}: choose one of {', '.join(FRAMES)}.")


def mean_gyro_rotation(gyro_matrix: Matrix) -> Matrix:
    """Return ``C_new_b`` from the frame of a gyro matrix to the mean-gyro frame: ``matrix @ C_new_b.T`` is symmetric.

    Parameters
    ----------
    gyro_matrix : (3, 3), any raw unit.

    Raises
    ------
    UsageError
        If the determinant is not positive: a gyro axis is reversed.
    """
    if np.linalg.det(gyro_matrix) <= 0.0:
        raise UsageError(
            "The gyro matrix is left-handed or singular (determinant not positive): an axis is reversed; "
            "put its sign right first."
        )
    # left polar decomposition: matrix = P U with P symmetric
    left, _, right = np.linalg.svd(gyro_matrix)
    return np.asarray(left @ right, dtype=np.float64)


def polar_rotation(matrix: Complex) -> Complex:
    """Return U of ``matrix = P U``, P symmetric, by Newton's iteration: analytic, for complex steps.

    Parameters
    ----------
    matrix : (3, 3), real or complex, of any raw unit.

    Notes
    -----
    ``U ← (U + U^-T) / 2`` (Higham 1986), which doubles its digits each time.
    """
    turn = matrix / np.sqrt(np.sum(matrix * matrix) / 3.0)
    for _ in range(12):
        turn = 0.5 * (turn + inverse(turn).T)
    return turn


def change_frame(model: ImuModel, frame: str) -> ImuModel:
    """Return `model` described in the named frame; corrected vectors are turned, nothing is lost.

    Raises
    ------
    UsageError
        If the frame's name is unknown, the model has no accelerometer to fix it by, or its
        accelerometers form a left-handed triad, which no rotation brings into a frame.
    """
    if frame == "mean-gyro":
        if model.gyroscope is None:
            raise UsageError("The frame 'mean-gyro' is fixed by the gyros, and there are none.")
        return model.turned(mean_gyro_rotation(model.gyroscope.matrix))
    if model.accelerometer is None:
        raise UsageError(f"The frame {frame!r} is fixed by the accelerometers, and there are none.")
    if np.linalg.det(model.accelerometer.matrix) <= 0:
        raise UsageError(
            "The accelerometer matrix is left-handed or singular (determinant not positive). Either an axis is "
            "reversed or two are swapped: put that right first (--columns). Or the rests do not belong together, "
            "because biases jumped or two units are in one recording: calibrate each part by itself."
        )
    C_new_b: Matrix = np.real(frame_rotation(model.accelerometer.matrix, frame))
    return model.turned(C_new_b)


def inverse(matrix: Complex) -> Complex:
    """Return the inverse of a 3x3 matrix by cofactors: analytic, for complex steps."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    adjugate = np.array(
        [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ]
    )
    return adjugate / (a * adjugate[0, 0] + b * adjugate[1, 0] + c * adjugate[2, 0])


Function = Callable[[npt.NDArray[Any]], npt.NDArray[Any]]


def jacobian(function: Function, values: Series) -> Table:
    """Return the derivatives of an analytic `function` at `values`, exact to round-off.

    The imaginary part of ``f(x + 1e-30 i)`` over 1e-30 has no cancellation (Squire and Trapp 1998);
    `function` must accept complex arrays and use no conjugate, absolute value or comparison of them.
    """
    return np.column_stack([_derivative(function, values, index) for index in range(values.size)])


def propagate(function: Function, values: Series, covariance: Square) -> tuple[Series, Table]:
    """Return ``function(values)`` and its covariance to first order (GUM 5.1.2, JCGM 102 6.2)."""
    made = np.real(function(values.astype(complex)))
    slope = np.zeros((made.size, values.size))
    # What has no covariance moves nothing.
    for index in np.flatnonzero(np.any(covariance, axis=0)).tolist():
        slope[:, index] = _derivative(function, values, index)
    return made, slope @ covariance @ slope.T


def _derivative(function: Function, values: Series, index: int) -> Series:
    step = 1e-30
    moved = values.astype(complex)
    moved[index] += 1j * step
    return np.asarray(np.imag(function(moved)) / step, dtype=np.float64)
