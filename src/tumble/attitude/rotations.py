"""Rotation matrices, rotation vectors and the angles between directions.

Quaternions, matrices and angles of attitudes in plain numpy: scipy's take a quarter of a second to import.

Quaternions have the scalar last. Angles are roll, pitch and yaw of ``C = Rz(yaw) Ry(pitch) Rx(roll)``, which is the
``C_nb`` of a body that is turned by yaw about down, then by pitch, then by roll.

The 26 directions of a cube: its faces, edges and corners, each of which can point up.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrices, Matrix, Quaternions, Series, Table, Vector, Vectors


def skew(vector: Vector) -> Matrix:
    """Return the matrix ``S`` with ``S @ w == cross(vector, w)``."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def matrix_from_rotation_vector(rotation_vector: Vector) -> Matrix:
    """Return ``exp(skew(rotation_vector))``, Rodrigues' formula.

    Parameters
    ----------
    rotation_vector : (3,) axis times angle, rad. Any angle; below 1e-4 rad the series is used,
        whose first neglected term is under 1e-18.

    Examples
    --------
    A quarter turn about z carries x to y:

    >>> import numpy as np
    >>> C = matrix_from_rotation_vector(np.array([0.0, 0.0, np.pi / 2]))
    >>> bool(np.allclose(C @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    True
    """
    angle = float(np.sqrt(rotation_vector @ rotation_vector))
    cross = skew(rotation_vector)
    if angle < 1e-4:
        first, second = 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0
    else:
        first, second = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    return np.eye(3) + first * cross + second * (cross @ cross)


def rotation_vector_from_matrix(C: Matrix) -> Vector:
    """Return the rotation vector of a rotation matrix, its angle in [0, pi] rad."""
    return np.asarray(rotation_vectors_from_matrices(np.asarray(C)[None])[0], dtype=np.float64)


def matrix_from_turn(axis: Vector, angle: float) -> Matrix:
    """Return (3, 3) the rotation by an angle, rad, about an axis of any length above zero."""
    return matrix_from_rotation_vector(axis * (angle / np.sqrt(axis @ axis)))


def rotation_angle(C: Matrix) -> float:
    """Return the angle of a rotation matrix, in [0, pi] rad."""
    vector = rotation_vector_from_matrix(C)
    return float(np.sqrt(vector @ vector))


def analytic_rotation_vector(C: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the rotation vector of a rotation below 90 degrees, analytic in its entries.

    Parameters
    ----------
    C : (3, 3) rotation matrix, real, or with imaginary parts for derivatives by complex steps.

    Returns
    -------
    rotation_vector : (3,) rad.
    """
    axial = 0.5 * np.array([C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]])
    square = axial @ axial
    # asin(s) / s by its series near zero, where the square root has no derivative.
    if abs(square) < 1e-8:
        return axial * (1.0 + square / 6.0 + 3.0 * square * square / 40.0)
    sine = np.sqrt(square)
    return axial * (np.arcsin(sine) / sine)


def matrices_from_rotation_vectors(rotation_vectors: Vectors) -> Matrices:
    """Return (rows, 3, 3) `matrix_from_rotation_vector` of each row.

    Parameters
    ----------
    rotation_vectors : (rows, 3) rad.
    """
    square = np.einsum("ka,ka->k", rotation_vectors, rotation_vectors)
    angle = np.sqrt(square)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0 - square / 6.0, np.sin(safe) / safe)
    second = np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(safe)) / safe**2)
    cross = skews(rotation_vectors)
    return np.eye(3) + first[:, None, None] * cross + second[:, None, None] * (cross @ cross)


def rotation_vectors_from_matrices(C: Matrices) -> Vectors:
    """Return (rows, 3) `rotation_vector_from_matrix` of each matrix, rad."""
    from tumble.attitude.kernels import fill_rotation_vectors

    vectors = np.empty((len(C), 3))
    fill_rotation_vectors(np.ascontiguousarray(C, dtype=np.float64), vectors)
    return vectors


def skews(vectors: Vectors) -> Matrices:
    """Return (rows, 3, 3) the matrices ``S`` with ``S @ w == cross(vector, w)``."""
    made = np.zeros((vectors.shape[0], 3, 3))
    made[:, 0, 1], made[:, 0, 2], made[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return made - np.swapaxes(made, 1, 2)


def left_jacobian(rotation_vector: Vector) -> Matrix:
    """Return J with ``exp(v + dv) = exp(J dv) exp(v)`` to first order.

    Parameters
    ----------
    rotation_vector : (3,) rad.
    """
    angle = float(np.linalg.norm(rotation_vector))
    cross = skew(rotation_vector)
    if angle < 1e-4:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    one = (1.0 - np.cos(angle)) / angle**2
    two = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + one * cross + two * (cross @ cross), dtype=np.float64)


def rotation_between(start: Vector, end: Vector) -> Matrix:
    """Return the smallest rotation that carries the direction `start` to the direction `end`.

    For opposite directions it is a half turn about an axis perpendicular to both.

    Raises
    ------
    ValueError
        If a vector is zero.
    """
    a, b = _unit(start), _unit(end)
    cosine = float(a @ b)
    if cosine > -0.5:
        cross = skew(np.cross(a, b))
        return np.eye(3) + cross + cross @ cross / (1.0 + cosine)
    # Near a half turn 1 + cosine is round-off: half turns about a and then about the middle of a and
    # b are the same rotation.
    middle = _middle_of_opposites(a, b)
    return (2.0 * np.outer(middle, middle) - np.eye(3)) @ (2.0 * np.outer(a, a) - np.eye(3))


def angle_between(start: Vector, end: Vector) -> float:
    """Return the angle between two directions in rad, accurate for small and for large angles.

    Raises
    ------
    ValueError
        If a vector is zero.
    """
    a, b = _unit(start), _unit(end)
    return float(2.0 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


def tangent_basis(direction: Vector) -> Table:
    """Return (3, 2): two unit vectors perpendicular to `direction` and to each other.

    Raises
    ------
    ValueError
        If the vector is zero.
    """
    # In plain numbers: numpy's cross product takes ten times as long for a single vector.
    x, y, z = _unit(direction).tolist()
    least = min(abs(x), abs(y), abs(z))
    if abs(x) == least:
        a, b, c = 0.0, z, -y
    elif abs(y) == least:
        a, b, c = -z, 0.0, x
    else:
        a, b, c = y, -x, 0.0
    length = math.sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    return np.array([[a, y * c - z * b], [b, z * a - x * c], [c, x * b - y * a]])


def find_nearest_rotation(matrix: Matrix) -> Matrix:
    """Return the rotation nearest to `matrix` in the Frobenius norm (by singular values)."""
    left, _, right = np.linalg.svd(matrix)
    sign = float(np.sign(np.linalg.det(left) * np.linalg.det(right)))
    return np.asarray((left * np.array([1.0, 1.0, sign])) @ right, dtype=np.float64)


def _middle_of_opposites(a: Vector, b: Vector) -> Vector:
    """Return the unit vector halfway between two all but opposite unit vectors."""
    apart = _unit(a - b)
    middle = a + b
    # Twice is enough (Kahan): a sum of opposites is mostly round-off, which must not lie along them.
    for _ in range(2):
        middle = middle - apart * float(apart @ middle)
    length = float(np.sqrt(middle @ middle))
    return middle / length if length > 1e-15 else tangent_basis(apart)[:, 0]


def _unit(vector: Vector) -> Vector:
    norm = float(np.sqrt(vector @ vector))
    if norm == 0.0:
        raise ValueError("a zero vector has no direction")
    return vector / norm


# Nearer to the vertical than this, rad, roll and yaw are one angle.
_UPRIGHT = 1e-7


def quaternion_from_matrix(C: Matrix) -> Series:
    """Return the unit quaternion (4,) of a rotation matrix, scalar last; of its two signs either.

    By the largest of its elements (Shepperd 1978), so that none is a small difference.
    """
    diagonal = np.diag(C)
    trace = float(diagonal.sum())
    largest = int(np.argmax([*diagonal, trace]))
    quaternion = np.empty(4)
    if largest == 3:
        quaternion[:] = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1], 1.0 + trace
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        quaternion[i] = 1.0 - trace + 2.0 * C[i, i]
        quaternion[j], quaternion[k] = C[j, i] + C[i, j], C[k, i] + C[i, k]
        quaternion[3] = C[k, j] - C[j, k]
    return quaternion / np.sqrt(quaternion @ quaternion)


def matrices_from_quaternions(quaternions: Quaternions) -> Matrices:
    """Return (rows, 3, 3) the rotation matrices of quaternions, which need not have unit length."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_from_angles(roll_pitch_yaw: Vector) -> Matrix:
    """Return (3, 3) the rotation of roll, pitch and yaw, rad."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(roll_pitch_yaw), np.cos(roll_pitch_yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_from_matrices(C: Matrices) -> Vectors:
    """Return (rows, 3) roll, pitch and yaw, rad; with x along the vertical roll is zero."""
    level = np.hypot(C[:, 2, 1], C[:, 2, 2])
    pitch = np.arctan2(-C[:, 2, 0], level)
    roll = np.arctan2(C[:, 2, 1], C[:, 2, 2])
    yaw = np.arctan2(C[:, 1, 0], C[:, 0, 0])
    upright = level < _UPRIGHT
    roll = np.where(upright, 0.0, roll)
    yaw = np.where(upright, np.arctan2(-C[:, 0, 1], C[:, 1, 1]), yaw)
    return np.column_stack([roll, pitch, yaw])


def twenty_six_directions() -> Vectors:
    """Return (26, 3) unit vectors: six faces, then twelve edges, then eight corners (Shin and El-Sheimy)."""
    signs = [np.array(s, dtype=float) for s in itertools.product((1, 0, -1), repeat=3) if any(s)]
    signs.sort(key=lambda s: (np.count_nonzero(s), tuple(-s)))
    return np.array([s / np.linalg.norm(s) for s in signs])
