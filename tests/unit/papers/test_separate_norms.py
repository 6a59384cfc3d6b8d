"""Each triad by itself in closed form gives back what made the norms; what it cannot tell it refuses."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tumble.earth import EARTH_RATE
from tumble.errors import ObservabilityError
from tumble_papers.zhang.closed_forms import (
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
)

G = 9.81
FACES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0)
NINE = np.concatenate([FACES, EDGES])
# Lower triangular with three angles that differ in size and sign: a transpose or a mixed-up pair fails.
MATRIX = np.array([[1.02, 0.0, 0.0], [0.031, 0.97, 0.0], [-0.012, 0.045, 1.05]])
BIAS = np.array([0.3, -0.2, 0.11])
# Raw units per SI unit: SI itself, counts of an accelerometer, counts of a fine gyro.
SCALES = [1.0, 415.0, 1e6]


def units(count: int, seed: int = 1) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def forces(directions: np.ndarray, scale: float = 1.0, offset: float = 0.0) -> np.ndarray:
    return scale * (G * directions @ MATRIX.T + BIAS) + offset


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("directions", [NINE, units(24)], ids=["nine", "24 at random"])
def test_an_ellipsoid_gives_back_matrix_and_bias_in_si_and_in_counts(
    directions: np.ndarray, scale: float
) -> None:
    """Counts with a converter's zero at 2^15; round-off of a QR of condition about ten."""
    offset = 32768.0 if scale > 1.0 else 0.0
    matrix, bias = ellipsoid_from_norms(forces(directions, scale, offset), G)
    np.testing.assert_allclose(matrix, scale * MATRIX, rtol=0, atol=1e-12 * scale)
    # a bias is good to the same share of the largest reading
    np.testing.assert_allclose(bias, scale * BIAS + offset, rtol=0, atol=1e-12 * (12.0 * scale + offset))


def test_an_ellipsoid_is_lower_triangular_whatever_frame_made_the_readings() -> None:
    """The frame of the true vectors is free: what comes back is the triad's own, x along its x sensor."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    full = MATRIX @ turn
    matrix, _ = ellipsoid_from_norms(G * units(30) @ full.T + BIAS, G)
    np.testing.assert_allclose(matrix, MATRIX, atol=1e-12)
    np.testing.assert_array_equal(np.triu(matrix, 1), 0.0)


def test_batches_of_ellipsoids_equal_each_by_itself() -> None:
    rng = np.random.default_rng(5)
    raw = forces(NINE) + 1e-3 * rng.standard_normal((2, 3, 9, 3))
    weights = rng.uniform(0.5, 2.0, (2, 3, 9))
    matrix, bias = ellipsoid_from_norms(raw, G, weights)
    assert matrix.shape == (2, 3, 3, 3)
    for at in np.ndindex(2, 3):
        one = ellipsoid_from_norms(raw[at], G, weights[at])
        np.testing.assert_allclose(matrix[at], one[0], rtol=0, atol=1e-13)
        np.testing.assert_allclose(bias[at], one[1], rtol=0, atol=1e-13)


def test_a_weight_of_ten_is_ten_readings_and_one_of_nothing_none() -> None:
    raw = forces(units(12)) + 1e-2 * np.random.default_rng(2).standard_normal((12, 3))
    weights = np.ones(12)
    weights[3] = 10.0
    often = np.concatenate([raw, np.repeat(raw[3:4], 9, axis=0)])
    for weighted, repeated in zip(
        ellipsoid_from_norms(raw, G, weights), ellipsoid_from_norms(often, G), strict=True
    ):
        np.testing.assert_allclose(weighted, repeated, rtol=0, atol=1e-12)
    # whatever is wrong with a reading, without weight it moves nothing
    wrong, weights[3] = forces(units(12)), 0.0
    wrong[3] *= 1.1
    matrix, bias = ellipsoid_from_norms(wrong, G, weights)
    np.testing.assert_allclose(matrix, MATRIX, rtol=0, atol=1e-12)
    np.testing.assert_allclose(bias, BIAS, rtol=0, atol=1e-11)


def test_too_few_and_singular_attitudes_are_refused() -> None:
    with pytest.raises(
        ObservabilityError, match=r"^8 attitudes do not determine 9 unknowns: 9 different ones"
    ):
        ellipsoid_from_norms(forces(NINE[:8]), G)
    ten = np.concatenate([FACES, EDGES[:1], -EDGES[:1], FACES[:2]])
    with pytest.raises(ObservabilityError, match="do not determine all 9 unknowns"):
        ellipsoid_from_norms(forces(ten), G)


def test_means_on_a_hyperboloid_are_no_triad() -> None:
    x = np.array(
        [[s * np.sqrt(1 + a * a + b * b), a, b] for s in (1, -1) for a in (-1, 0.3, 1) for b in (-1, 0.2, 1)]
    )
    with pytest.raises(ObservabilityError, match="No ellipsoid goes through the means"):
        ellipsoid_from_norms(x, G)


# Rotations ----------------------------------------------------------------------------------------

AXES = np.concatenate([np.eye(3), EDGES])
ANGLES = np.array([62.8, 60.0, 25.1, 62.8, 31.4, 12.6])


@pytest.mark.parametrize("scale", SCALES)
def test_six_rotations_give_back_the_gyros_matrix_whatever_their_angles(scale: float) -> None:
    rotation = scale * ANGLES[:, None] * AXES @ MATRIX.T
    np.testing.assert_allclose(
        matrix_from_rotations(rotation, ANGLES), scale * MATRIX, rtol=0, atol=1e-12 * scale
    )
    # a negative angle about the same axis, and an axis named by its other end, are the same norm
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(
        matrix_from_rotations(signs[:, None] * rotation, -ANGLES),
        scale * MATRIX,
        rtol=0,
        atol=1e-12 * scale,
    )


def test_batches_of_rotations_equal_each_by_itself_and_are_weighed() -> None:
    rng = np.random.default_rng(9)
    axes = units(8, 3)
    angle = np.full((4, 8), 60.0)
    rotation = 60.0 * axes @ MATRIX.T + 1e-3 * rng.standard_normal((4, 8, 3))
    weights = rng.uniform(0.5, 2.0, (4, 8))
    many = matrix_from_rotations(rotation, angle, weights)
    for k in range(4):
        one = matrix_from_rotations(rotation[k], angle[k], weights[k])
        np.testing.assert_allclose(many[k], one, rtol=0, atol=1e-13)
    weights[0] = np.array([1, 1, 1, 1, 1, 1, 0, 0.0])
    np.testing.assert_allclose(
        matrix_from_rotations(rotation, angle, weights)[0],
        matrix_from_rotations(rotation[0, :6], angle[0, :6]),
        rtol=0,
        atol=1e-12,
    )


def test_too_few_and_singular_axes_are_refused() -> None:
    rotation = ANGLES[:, None] * AXES @ MATRIX.T
    with pytest.raises(ObservabilityError, match="5 rotation axes do not determine 6 unknowns"):
        matrix_from_rotations(rotation[:5], ANGLES[:5])
    axes = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], *EDGES[:2], [-1, 1, 0] / np.sqrt(2.0)])
    with pytest.raises(ObservabilityError, match="rotation axes do not determine all 6 unknowns"):
        matrix_from_rotations(ANGLES[:, None] * axes @ MATRIX.T, ANGLES)


# Biases from static pairs ---------------------------------------------------------------------------

FULL = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
GYRO_BIAS = np.array([0.01, -0.02, 0.03])


@pytest.mark.parametrize("scale", SCALES)
def test_rests_give_back_the_biases_without_a_latitude(scale: float) -> None:
    """The norms are all the Earth rate; 1e-12 of a bias of 0.03 rad/s is 4e-10 of the Earth rate."""
    rate = scale * (EARTH_RATE * units(9) @ FULL.T + GYRO_BIAS)
    found = bias_from_static_pairs(scale * FULL, rate)
    np.testing.assert_allclose(found, scale * GYRO_BIAS, rtol=0, atol=1e-12 * scale)


def test_all_pairs_of_25_are_least_squares_on_differences_from_the_mean() -> None:
    rng = np.random.default_rng(4)
    rate = EARTH_RATE * units(9) @ FULL.T + GYRO_BIAS + 1e-7 * rng.standard_normal((9, 3))
    turned = np.linalg.solve(FULL, rate.T).T
    # the paper's way: a row each pair of attitudes j1, j2
    rows = np.array([2.0 * (turned[i] - turned[j]) for i, j in combinations(range(9), 2)])
    told = np.array([turned[i] @ turned[i] - turned[j] @ turned[j] for i, j in combinations(range(9), 2)])
    by_pairs = FULL @ np.linalg.lstsq(rows, told, rcond=None)[0]
    # the paper's normal matrix is of condition 1; the differences of squares of 0.03 lose 1e-18 of 1e-7
    np.testing.assert_allclose(bias_from_static_pairs(FULL, rate), by_pairs, rtol=0, atol=1e-11)


def test_rests_that_do_not_tell_three_biases_are_refused() -> None:
    flat = units(9)
    flat[:, 2] = 0.0
    with pytest.raises(ObservabilityError, match="attitudes do not determine all 3 unknowns"):
        bias_from_static_pairs(np.eye(3), EARTH_RATE * flat)
    with pytest.raises(ObservabilityError, match="2 attitudes do not determine 3 unknowns"):
        bias_from_static_pairs(np.eye(3), EARTH_RATE * units(2))
    with pytest.raises(ObservabilityError, match="they do not see the Earth rate"):
        bias_from_static_pairs(np.eye(3), np.tile(GYRO_BIAS, (9, 1)))
