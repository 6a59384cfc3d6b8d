"""Quaternions, matrices and angles against scipy's, and where angles are not told apart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude.rotations import (
    angles_from_matrices,
    matrices_from_quaternions,
    matrix_from_angles,
    quaternion_from_matrix,
)

ANYHOW = Rotation.from_quat(np.random.default_rng(1).standard_normal((300, 4)))
HALF_TURNS = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3.0**-0.5)]))
ALL = Rotation.concatenate([ANYHOW, HALF_TURNS, Rotation.identity()])


def test_quaternions_are_scipy_s_up_to_their_sign() -> None:
    for matrix, expected in zip(ALL.as_matrix(), ALL.as_quat(), strict=True):
        found = quaternion_from_matrix(matrix)
        # round-off of numbers of order one
        assert found * np.sign(found @ expected) == pytest.approx(expected, abs=1e-14)


def test_matrices_are_scipy_s_whatever_the_length() -> None:
    found = matrices_from_quaternions(3.0 * ALL.as_quat())
    np.testing.assert_allclose(found, ALL.as_matrix(), atol=1e-15)


def test_angles_are_scipy_s_and_lead_back() -> None:
    angles = angles_from_matrices(ANYHOW.as_matrix())
    np.testing.assert_allclose(angles, ANYHOW.as_euler("ZYX")[:, ::-1], atol=1e-12)
    for matrix, three in zip(ANYHOW.as_matrix(), angles, strict=True):
        np.testing.assert_allclose(matrix_from_angles(three), matrix, atol=1e-15)


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi])
def test_upright_roll_is_zero_and_yaw_has_all_of_the_turn(pitch: float) -> None:
    matrix = matrix_from_angles(np.array([0.4, pitch, 1.1]))
    (three,) = angles_from_matrices(matrix[None])
    assert three[0] == 0.0
    assert three[1] == pytest.approx(pitch, abs=1e-12)
    np.testing.assert_allclose(matrix_from_angles(three), matrix, atol=1e-12)
