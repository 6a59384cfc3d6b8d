"""Rotation matrices, vectors, quaternions and angles, against scipy and closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import (
    angle_between,
    find_nearest_rotation,
    matrix_from_rotation_vector,
    rotation_between,
    rotation_vector_from_matrix,
    skew,
    tangent_basis,
)
from tumble.attitude.rotations import (
    angles_from_matrices,
    matrices_from_quaternions,
    matrix_from_angles,
    matrix_from_turn,
    quaternion_from_matrix,
    rotation_angle,
    rotation_vectors_from_matrices,
)

# A few units in the last place of numbers near one.
ROUND_OFF = 4e-15


def test_skew_is_the_cross_product() -> None:
    a, b = np.array([1.0, -2.0, 5.0]), np.array([3.0, 7.0, -11.0])
    assert np.array_equal(skew(a) @ b, np.cross(a, b))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.99e-4, 1.01e-4, 1e-3, 1.0, 3.0, np.pi, 5.0])
def test_the_exponential_agrees_with_scipy_on_both_sides_of_the_series(angle: float) -> None:
    vector = angle * np.array([2.0, -3.0, 6.0]) / 7.0
    expected = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(matrix_from_rotation_vector(vector), expected, atol=ROUND_OFF)


def test_the_logarithm_keeps_the_axis_near_a_half_turn_and_all_digits_of_a_tiny_one() -> None:
    for short_of in (1e-3, 1e-6, 1e-9):
        vector = (np.pi - short_of) * np.array([2.0, -3.0, 6.0]) / 7.0
        again = rotation_vector_from_matrix(Rotation.from_rotvec(vector).as_matrix())
        np.testing.assert_allclose(again, vector, atol=2e-14)
    vector = np.array([1e-10, -3e-11, 7e-12])
    again = rotation_vector_from_matrix(matrix_from_rotation_vector(vector))
    # off-diagonal elements are the vector itself: relative round-off survives
    np.testing.assert_allclose(again, vector, rtol=1e-14)
    assert np.array_equal(rotation_vector_from_matrix(np.eye(3)), np.zeros(3))


def test_the_angle_between_directions_is_accurate_where_the_cosine_is_not() -> None:
    x = np.array([3.0, 0.0, 0.0])
    assert angle_between(x, np.array([1.0, 1e-9, 0.0])) == pytest.approx(1e-9, rel=1e-14)
    assert angle_between(x, np.array([-1.0, 1e-9, 0.0])) == pytest.approx(np.pi - 1e-9, abs=1e-15)
    assert angle_between(x, np.array([0.0, 0.0, -7.0])) == pytest.approx(np.pi / 2, abs=ROUND_OFF)


def test_a_tangent_basis_is_a_right_handed_frame_with_its_direction() -> None:
    direction = np.array([1.0, -8.0, 4.0]) / 9.0
    basis = tangent_basis(17.0 * direction)
    frame = np.column_stack([direction, basis])
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=ROUND_OFF)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=ROUND_OFF)


def test_the_nearest_rotation_is_the_polar_factor_and_never_a_reflection() -> None:
    C = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    stretch = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 1.1]])  # symmetric, positive
    # C times a positive symmetric matrix is its polar decomposition, whose rotation is the nearest
    np.testing.assert_allclose(find_nearest_rotation(C @ stretch), C, atol=ROUND_OFF)
    mirrored = find_nearest_rotation(C @ np.diag([1.0, 1.0, -0.5]))
    np.testing.assert_allclose(mirrored, C, atol=ROUND_OFF)


def test_the_rotation_between_two_directions_is_the_shortest_and_takes_one_to_the_other() -> None:
    one, other = np.array([1.0, -2.0, 2.0]) / 3.0, np.array([0.0, 0.6, 0.8])
    C = rotation_between(2.0 * one, other)
    np.testing.assert_allclose(C @ one, other, atol=ROUND_OFF)
    assert rotation_angle(C) == pytest.approx(angle_between(one, other), abs=ROUND_OFF)


@pytest.mark.parametrize("function", [rotation_between, angle_between])
def test_a_zero_vector_has_no_direction(function: Callable[..., object]) -> None:
    with pytest.raises(ValueError, match="a zero vector has no direction"):
        function(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    with pytest.raises(ValueError, match="a zero vector has no direction"):
        tangent_basis(np.zeros(3))


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-9, 1e-3, 1.0, 2.0, 2.2, 3.1, np.pi - 1e-9])
def test_many_rotation_vectors_at_once_are_those_of_scipy(angle: float) -> None:
    directions = np.random.default_rng(3).normal(size=(50, 3))
    vectors = angle * directions / np.linalg.norm(directions, axis=1)[:, None]
    made = rotation_vectors_from_matrices(Rotation.from_rotvec(vectors).as_matrix())
    np.testing.assert_allclose(made, vectors, rtol=1e-12, atol=4e-15)
    assert rotation_vectors_from_matrices(np.zeros((0, 3, 3))).shape == (0, 3)


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.7, 3.0, 7.5])
def test_a_turn_about_an_axis_of_any_length_is_scipy_s(angle: float) -> None:
    axis = np.array([0.3, -2.0, 1.1])
    expected = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    C = matrix_from_turn(axis, angle)
    np.testing.assert_allclose(C, expected.as_matrix(), rtol=0.0, atol=ROUND_OFF)
    assert rotation_angle(C) == pytest.approx(expected.magnitude(), rel=1e-12, abs=ROUND_OFF)


ANYHOW = Rotation.from_quat(np.random.default_rng(1).standard_normal((300, 4)))
HALF_TURNS = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3.0**-0.5)]))


def test_quaternions_are_scipy_s_up_to_their_sign_and_lead_back_whatever_their_length() -> None:
    every = Rotation.concatenate([ANYHOW, HALF_TURNS, Rotation.identity()])
    for matrix, expected in zip(every.as_matrix(), every.as_quat(), strict=True):
        found = quaternion_from_matrix(matrix)
        # round-off of numbers of order one
        assert found * np.sign(found @ expected) == pytest.approx(expected, abs=1e-14)
    np.testing.assert_allclose(
        matrices_from_quaternions(3.0 * every.as_quat()), every.as_matrix(), atol=1e-15
    )


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
