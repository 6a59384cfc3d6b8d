"""Rotations form a group, and rotation vectors are its logarithms."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tumble.attitude import (
    angle_between,
    find_nearest_rotation,
    matrix_from_rotation_vector,
    rotation_between,
    rotation_vector_from_matrix,
)

# Round-off of a few products of numbers up to one.
ROUND_OFF = 2e-14

components = st.floats(-1.0, 1.0)
directions = (
    st.tuples(components, components, components)
    .map(np.array)
    .filter(lambda v: float(np.linalg.norm(v)) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)
# Small, ordinary, near and at half turns, and beyond.
angles = st.one_of(
    st.floats(0.0, 1e-3),
    st.floats(0.0, np.pi),
    st.floats(0.0, 1e-5).map(lambda a: np.pi - a),
    st.just(np.pi),
)
vectors = st.tuples(angles, directions).map(lambda pair: pair[0] * pair[1])


@given(vectors)
def test_the_exponential_is_a_rotation_and_scipy_s(vector: np.ndarray) -> None:
    C = matrix_from_rotation_vector(vector)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=ROUND_OFF)
    assert np.linalg.det(C) > 0.99
    np.testing.assert_allclose(C, Rotation.from_rotvec(vector).as_matrix(), atol=ROUND_OFF)


@given(vectors)
def test_the_logarithm_is_the_exponential_s_inverse(vector: np.ndarray) -> None:
    C = matrix_from_rotation_vector(vector)
    again = rotation_vector_from_matrix(C)
    assert np.linalg.norm(again) <= np.pi + ROUND_OFF
    np.testing.assert_allclose(matrix_from_rotation_vector(again), C, atol=ROUND_OFF)
    # at half turns either sign of the axis is the same rotation
    if np.linalg.norm(vector) < np.pi - 1e-7:
        np.testing.assert_allclose(again, vector, atol=ROUND_OFF * 10)


@given(vectors)
def test_the_inverse_turns_the_other_way(vector: np.ndarray) -> None:
    np.testing.assert_allclose(
        matrix_from_rotation_vector(-vector), matrix_from_rotation_vector(vector).T, atol=ROUND_OFF
    )


@given(vectors, vectors, vectors)
def test_turns_compose_associatively_and_stay_rotations(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    A, B, C = (matrix_from_rotation_vector(v) for v in (a, b, c))
    together = matrix_from_rotation_vector(rotation_vector_from_matrix(A @ B)) @ C
    expected = (Rotation.from_rotvec(a) * Rotation.from_rotvec(b) * Rotation.from_rotvec(c)).as_matrix()
    np.testing.assert_allclose(together, expected, atol=3 * ROUND_OFF)


@given(directions, angles)
def test_the_same_axis_adds_angles(axis: np.ndarray, angle: float) -> None:
    half = matrix_from_rotation_vector(0.5 * angle * axis)
    np.testing.assert_allclose(half @ half, matrix_from_rotation_vector(angle * axis), atol=ROUND_OFF)


@given(directions, directions)
def test_the_rotation_between_directions_carries_one_to_the_other(a: np.ndarray, b: np.ndarray) -> None:
    C = rotation_between(a, b)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=ROUND_OFF)
    np.testing.assert_allclose(C @ a, b, atol=ROUND_OFF)
    np.testing.assert_allclose(
        np.linalg.norm(rotation_vector_from_matrix(C)), angle_between(a, b), atol=ROUND_OFF
    )


@given(directions, st.floats(0.0, 1e-4), directions)
def test_nearly_opposite_directions_are_no_exception(a: np.ndarray, off: float, aside: np.ndarray) -> None:
    b = -a + off * aside
    C = rotation_between(a, b)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=ROUND_OFF)
    np.testing.assert_allclose(C @ a, b / np.linalg.norm(b), atol=ROUND_OFF)


@given(vectors)
def test_a_rotation_is_its_own_nearest_rotation(vector: np.ndarray) -> None:
    C = matrix_from_rotation_vector(vector)
    np.testing.assert_allclose(find_nearest_rotation(1.7 * C), C, atol=ROUND_OFF)
