"""Rotations by unit quaternions with exact exponential and logarithm, written for this simulator alone.

A quaternion is an array ``(..., 4)``, scalar first. ``q`` stands for the matrix that takes vectors of the body
to the room (``C_nb``), and ``q1 * q2`` for the product of the matrices.
"""

import numpy as np


def multiply(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the product of quaternions, row by row."""
    a, b = np.moveaxis(np.asarray(left, float), -1, 0), np.moveaxis(np.asarray(right, float), -1, 0)
    return np.stack(
        (
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ),
        axis=-1,
    )


def inverse(quaternion: np.ndarray) -> np.ndarray:
    """Return the conjugate."""
    return np.asarray(quaternion, float) * np.array([1.0, -1.0, -1.0, -1.0])


def exponential(vector: np.ndarray) -> np.ndarray:
    """Return the rotation by a rotation vector, exactly."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    # np.sinc(x) is sin(pi x) / (pi x), and it is right at zero.
    return np.concatenate((np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * vector), axis=-1)


def logarithm(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation vector of at most half a turn."""
    q = np.asarray(quaternion, float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(size, q[..., :1])
    small = size < 1e-12
    return q[..., 1:] * np.where(small, 2.0, 2.0 * half / np.where(small, 1.0, size))


def to_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the matrices ``(..., 3, 3)``."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, float), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the quaternion of one rotation matrix: the eigenvector of the largest eigenvalue (Bar-Itzhack)."""
    m = np.asarray(matrix, float)
    k = np.empty((4, 4))
    k[0, 0] = np.trace(m)
    k[0, 1:] = k[1:, 0] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
    q = np.linalg.eigh(k)[1][:, -1]
    return q if q[0] >= 0 else -q


def rotate(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return body vectors in the room."""
    q, v = np.broadcast_arrays(np.asarray(quaternion, float)[..., 1:], np.asarray(vector, float), subok=False)
    scalar = np.asarray(quaternion, float)[..., :1]
    twice = 2.0 * np.cross(q, v)
    return v + scalar * twice + np.cross(q, twice)


def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation that takes one direction to another, as a quaternion.

    Where they are opposite the turn is about an axis across them: x, or y where they lie along x.
    """
    a, b = np.asarray(start, float), np.asarray(end, float)
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    if a @ b < -1.0 + 1e-12:
        axis = np.array([1.0, 0.0, 0.0]) if abs(a[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        return exponential(np.pi * axis)
    q = np.concatenate(([1.0 + a @ b], np.cross(a, b)))
    return q / np.linalg.norm(q)
