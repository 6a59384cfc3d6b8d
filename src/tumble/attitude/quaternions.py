"""Quaternions, matrices and angles of attitudes in plain numpy: scipy's take a quarter of a second to import.

Quaternions have the scalar last. Angles are roll, pitch and yaw of ``C = Rz(yaw) Ry(pitch) Rx(roll)``, which is the
``C_nb`` of a body that is turned by yaw about down, then by pitch, then by roll.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Matrix, Quaternions, Series, Vector, Vectors

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
