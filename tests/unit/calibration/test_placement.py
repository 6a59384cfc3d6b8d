"""Known vectors, a placement that is not exact, and sigmas that are found from residuals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration.equations.placement import (
    PlacedReadings,
    find_added_sigma,
    fit_placed,
    is_excessive,
    placement_covariance,
    plain_least_squares,
    up_down_pair,
)
from tumble.calibration.equations.placement_bias import fit_placement_biases
from tumble.calibration.equations.spin import SpinConditions, SpinReadings
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError

FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
MATRIX = np.array([[1.01, 0.004, -0.003], [-0.005, 0.99, 0.002], [0.001, -0.006, 1.004]])
BIAS = np.array([0.1, -0.2, 0.05])


def test_an_up_and_a_down_reading_give_bias_and_scale_factor() -> None:
    # 2.5 and 2.6 by hand: (10.3 - 9.7) / 2 = 0.3, (10.3 + 9.7) / (2 * 8) = 1.25.
    assert up_down_pair(10.3, -9.7, 8.0) == pytest.approx((0.3, 1.25))


def test_plain_least_squares_is_2_11() -> None:
    shown = 9.81 * FACES @ MATRIX.T + BIAS
    found = plain_least_squares(9.81 * FACES, shown)
    np.testing.assert_allclose(found, [*MATRIX.ravel(), *BIAS], rtol=0, atol=1e-14)


def test_the_placement_s_covariance_is_that_of_small_turns_of_the_vector() -> None:
    sigma, n = 0.03, 40000
    readings = PlacedReadings(np.zeros((1, 3)), np.zeros((1, 3, 3)), 9.81 * FACES[:1], np.array([sigma]))
    stated = placement_covariance(readings, MATRIX)[0]
    turned = Rotation.from_rotvec(sigma * np.random.default_rng(1).standard_normal((n, 3)))
    sample = np.cov((9.81 * turned.apply(FACES[0]) @ MATRIX.T).T)
    # Across: a variance from n has a relative sigma of √(2 / n), 0.7 %; four of them.
    across = stated[1:, 1:] - sample[1:, 1:]
    assert np.max(np.abs(across)) < 0.03 * stated[1, 1]
    # Along: the half that is the tilt's own, the rest is the allowance for the matrix' errors.
    along = stated[0, 0] - sample[0, 0]
    assert 0.3 * (9.81 * sigma**2) ** 2 < along < 1.5 * (9.81 * sigma**2) ** 2


def test_four_poses_in_a_plane_are_refused() -> None:
    force = 9.81 * FACES[:4]
    readings = PlacedReadings(force.copy(), np.tile(1e-6 * np.eye(3), (4, 1, 1)), force, np.zeros(4))
    with pytest.raises(ObservabilityError, match="up along three different axes"):
        fit_placed(readings)


def test_an_added_sigma_brings_the_square_sum_to_its_expectation() -> None:
    # Residuals of 3 with a stated sigma of 1: sum of 9 n / (1 + s²) is n where s² = 8.
    found = find_added_sigma(lambda s: 9.0 * 12 / (1.0 + s**2), 12, 1e-6, 100.0)
    assert found == pytest.approx(math.sqrt(8.0), rel=2e-3)
    assert find_added_sigma(lambda s: 9.0 * 12 / (1.0 + s**2), 12, 1e-6, 2.0) == 2.0
    assert find_added_sigma(lambda _: 5.0, 12, 1e-6, 2.0) == 1e-6


def test_a_square_sum_is_excessive_beyond_its_99_per_cent_point() -> None:
    assert not is_excessive(16.8, 6)  # chi-square of 6 degrees: 16.81
    assert is_excessive(16.9, 6)
    assert not is_excessive(1e9, 0)


def spin_readings(sigma: float) -> SpinReadings:
    rate = np.zeros((2, 3, 3))
    rate[0, :2] = [[0.5, 0, 0], [-0.5, 0, 0]]
    rate[1] = [[0, 0.5, 0], [0, -0.5, 0], [0, 0.8, 0]]
    spin = np.array([[0, 1, -2], [2, 3, 4]])
    noise = np.tile(1e-12 * np.eye(3), (2, 3, 1, 1))
    time = np.array([[10.0, 30.0, 0.0], [90.0, 110.0, 130.0]])
    return SpinReadings(
        rate @ MATRIX.T, noise, rate, np.zeros((2, 3)), np.zeros((2, 3, 3)), time, spin, np.full(2, sigma)
    )


def test_the_spins_design_is_the_derivative_of_their_misclosure() -> None:
    readings, rng = spin_readings(0.0), np.random.default_rng(6)
    values = np.concatenate([MATRIX.ravel(), 1e-3 * rng.standard_normal(12)])
    free = np.arange(values.size)
    conditions = SpinConditions(readings, values, free, 0.0, 0.0)
    linear = conditions.linearise(values)
    for index in range(values.size):
        # Linear: a whole unit's step shows the derivative to round-off.
        moved = values.copy()
        moved[index] += 1.0
        slope = conditions.linearise(moved).misclosure - linear.misclosure
        np.testing.assert_allclose(linear.design[:, :, index], slope, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(linear.design[0, 6:], 0.0)


def test_a_placement_turns_all_its_spins_alike() -> None:
    sigma = 1e-3
    readings = spin_readings(sigma)
    values = np.concatenate([np.eye(3).ravel(), np.zeros(12)])
    covariance = SpinConditions(readings, values, np.arange(21), 0.0, 0.0).linearise(values).covariance
    # Placement 0 turns about x: y and z move, oppositely in the two spins; x to second order alone.
    np.testing.assert_allclose(np.diag(covariance[0])[1:3], (0.5 * sigma) ** 2 + 1e-12, rtol=1e-9)
    assert covariance[0, 1, 4] == pytest.approx(-((0.5 * sigma) ** 2))
    assert covariance[0, 0, 0] == pytest.approx(1e-12 + 2.0 * sigma**4 * 0.25)
    assert covariance[1, 0, 6] == pytest.approx(0.5 * 0.8 * sigma**2)


def test_a_bias_that_wanders_is_half_a_walk_from_the_placement_s_first_row() -> None:
    readings = spin_readings(0.0)
    values = np.concatenate([np.eye(3).ravel(), np.zeros(12)])
    covariance = SpinConditions(readings, values, np.arange(21), 0.0, 1e-3).linearise(values).covariance
    # Rows at 0, 20 and 40 s, 20 s apart: min(t, t') / 20 is 0, 1 and 2; with the half that does not walk.
    gyro_y = covariance[1][1::3, 1::3]
    expected = 0.5e-6 * np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0], [0.0, 1.0, 3.0]])
    np.testing.assert_allclose(gyro_y, expected + 1e-12 * np.eye(3), rtol=1e-9)


def test_the_earth_s_rotation_about_a_plumb_axis_is_known_and_about_a_level_one_an_uncertainty() -> None:
    site = Site(9.81, 0.0, math.radians(30.0), 0.0, "given")
    shown = np.array([[0.1 + 0.5 * EARTH_RATE, -0.2, 0.3]])
    options = {"axes": FACES[:1], "matrix": np.eye(3), "sigma": np.zeros(1), "site": site}
    plumb = fit_placement_biases(shown, 1e-16 * np.eye(3), upward=np.array([1.0]), **options)
    np.testing.assert_allclose(plumb.bias, [0.1, -0.2, 0.3], rtol=0, atol=1e-12)
    level = fit_placement_biases(shown, 1e-16 * np.eye(3), upward=np.array([0.0]), **options)
    # Half of the horizontal Earth rate's square: cos(30°)² / 2.
    assert level.covariance[0, 0] == pytest.approx(EARTH_RATE**2 * 0.375, rel=1e-6)
    np.testing.assert_allclose(level.bias, shown[0], rtol=0, atol=1e-15)
