"""Both triads together: g-sensitivity, and what is missing."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.sensor import ImuModel, Triad

ACCELEROMETER = Triad(
    np.array([[100.0, 3.0, -2.0], [-4.0, 110.0, 5.0], [6.0, -1.0, 90.0]]), np.array([1.0, 2.0, 3.0])
)
GYROSCOPE = Triad(
    np.array([[10.0, 1.0, 2.0], [3.0, 11.0, 4.0], [5.0, 6.0, 12.0]]), np.array([-1.0, 0.5, 2.0])
)
G_SENSITIVITY = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])


def test_g_sensitivity_acts_on_the_true_specific_force_and_adds_to_raw_rates() -> None:
    imu = ImuModel(ACCELEROMETER, GYROSCOPE, G_SENSITIVITY)
    raw_force, raw_rate = imu.distort(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert np.array_equal(raw_force, [[101.0, -2.0, 9.0]])
    # third column of the matrix + first column of G + bias
    np.testing.assert_allclose(raw_rate, [[2.0 + 0.1 - 1.0, 4.0 + 0.4 + 0.5, 12.0 + 0.7 + 2.0]], rtol=1e-15)
    force, rate = imu.correct(raw_force, raw_rate)
    np.testing.assert_allclose(force, [[1.0, 0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(rate, [[0.0, 0.0, 1.0]], atol=1e-15)


def test_turning_the_frame_turns_what_is_corrected_and_leaves_what_is_raw() -> None:
    imu = ImuModel(ACCELEROMETER, GYROSCOPE, G_SENSITIVITY)
    C_new_b = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # x_new = y_b, ...
    force, rate = np.array([[1.0, 2.0, 3.0]]), np.array([[4.0, 5.0, 6.0]])
    raw = imu.distort(force, rate)
    raw_again = imu.turned(C_new_b).distort(np.array([[2.0, 3.0, 1.0]]), np.array([[5.0, 6.0, 4.0]]))
    np.testing.assert_allclose(raw_again[0], raw[0], rtol=1e-15)
    np.testing.assert_allclose(raw_again[1], raw[1], rtol=1e-15)


def test_a_missing_triad_is_named() -> None:
    nothing = np.zeros((1, 3))
    with pytest.raises(ValueError, match="the model has no accelerometer"):
        ImuModel(None, GYROSCOPE).distort(nothing, nothing)
    with pytest.raises(ValueError, match="the model has no gyroscope"):
        ImuModel(ACCELEROMETER, None).correct(nothing, nothing)
