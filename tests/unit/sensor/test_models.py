"""Triads, units and frames: worked by hand, and what a change of frame moves, keeps and refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad, change_frame, frame_rotation, propagate
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble.sensor.gauge import inverse, lower_factor, upper_factor
from tumble.sensor.propagation import jacobian

BY_HAND = np.array([[100.0, 3.0, -2.0], [-4.0, 110.0, 5.0], [6.0, -1.0, 90.0]])
ITS_BIAS = np.array([10.0, -20.0, 30.0])


def test_the_rows_of_the_matrix_are_the_sensors() -> None:
    # x: 100 * 1 + 3 * 2 - 2 * 3 + 10; y: -4 + 220 + 15 - 20; z: 6 - 2 + 270 + 30
    raw = Triad(BY_HAND, ITS_BIAS).distort(np.array([[1.0, 2.0, 3.0]]))
    assert np.array_equal(raw, [[110.0, 211.0, 304.0]])
    np.testing.assert_allclose(Triad(BY_HAND, ITS_BIAS).correct(raw), [[1.0, 2.0, 3.0]], rtol=1e-14)


def test_asymmetry_and_quadratic_terms_act_on_each_sensor_s_own_input() -> None:
    triad = Triad(BY_HAND, ITS_BIAS, np.array([0.01, -0.02, 0.03]), np.array([1e-4, 2e-4, -3e-4]))
    # own input of (1, -2, 3):
    # x 100 - 6 - 6 = 88; y -4 - 220 + 15 = -209; z 6 + 2 + 270 = 278
    raw = triad.distort(np.array([[1.0, -2.0, 3.0]]))
    expected = [
        88.0 + 0.01 * 88.0 + 1e-4 * 88.0**2 + 10.0,
        -209.0 - 0.02 * 209.0 + 2e-4 * 209.0**2 - 20.0,
        278.0 + 0.03 * 278.0 - 3e-4 * 278.0**2 + 30.0,
    ]
    np.testing.assert_allclose(raw, [expected], rtol=1e-15)
    np.testing.assert_allclose(triad.own_input(raw), [[88.0, -209.0, 278.0]], rtol=1e-14)
    np.testing.assert_allclose(triad.correct(raw), [[1.0, -2.0, 3.0]], rtol=1e-14)
    assert np.array_equal(triad.correct(ITS_BIAS[None, :]), np.zeros((1, 3)))


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


MATRIX = np.array([[410.0, 3.0, -7.0], [9.0, 420.0, 5.0], [-4.0, 11.0, 430.0]])
BIAS = np.array([33000.0, 32500.0, 32900.0])
IMU = ImuModel(
    Triad(MATRIX, BIAS, np.array([1e-4, -2e-4, 3e-4]), np.array([1e-8, 2e-8, -3e-8])),
    Triad(np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]]), BIAS),
    np.array([[1.0, -0.5, 0.2], [0.3, 0.8, -0.6], [-0.1, 0.4, 0.9]]),
)


def test_the_factors_are_triangular_times_a_rotation() -> None:
    for factor, empty in (
        (lower_factor(MATRIX), np.triu_indices(3, 1)),
        (upper_factor(MATRIX), np.tril_indices(3, -1)),
    ):
        rotation = np.linalg.solve(factor, MATRIX)
        assert np.array_equal(factor[empty], np.zeros(3))
        assert np.all(np.diag(factor) > 0)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    # LAPACK's QR says the same, up to the signs of columns
    by_qr = np.abs(np.linalg.qr(MATRIX.T)[1].T)
    np.testing.assert_allclose(np.abs(lower_factor(MATRIX)), by_qr, rtol=1e-12)


Complex = npt.NDArray[Any]
VALUES = np.array([415.0, 413.0, 418.0, 0.004, -0.021, -0.009])
GYRO_MATRIX = np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]])


def to_imu_tk(p: Complex) -> Complex:
    """Six numbers in imu_tk's frame and a row of the gyro's matrix, which the change of frame turns along."""
    matrix = matrix_from_shin(p[:3], p[3:])
    C_zx = frame_rotation(matrix, "accelerometer-z")
    corrected = inverse(matrix @ C_zx.T)
    return np.concatenate([corrected[np.triu_indices(3)], (GYRO_MATRIX @ C_zx.T)[0]])


def test_a_linear_map_gives_the_sandwich_exactly() -> None:
    A = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]])
    C = np.array([[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 2.0]])
    value, spread = propagate(lambda x: A @ x, np.array([1.0, 1.0, 1.0]), C)
    assert np.array_equal(value, [3.0, 2.0])
    # by hand: var(x + 2y) = 4 + 4 + 12; cov(x + 2y, -y + 3z) = -1 - 1.5 - 6 + 1.2; var = 3 + 18 - 1.2
    np.testing.assert_allclose(spread, [[20.0, -7.3], [-7.3, 19.8]], rtol=1e-15)


def test_the_derivatives_of_a_change_of_frame_are_those_of_central_differences() -> None:
    exact = jacobian(to_imu_tk, VALUES)
    assert exact.shape == (9, 6)
    for k in range(6):
        step = 1e-6 * max(abs(VALUES[k]), 1e-2)
        up, down = VALUES.copy(), VALUES.copy()
        up[k] += step
        down[k] -= step
        differences = (to_imu_tk(up) - to_imu_tk(down)) / (2 * step)
        # round-off of the results over the step, and the curvature below it
        round_off = 1e-15 * np.maximum(np.abs(to_imu_tk(VALUES)), 1e-2) / step
        off = np.abs(differences - exact[:, k])
        assert np.all(off <= 1e-7 * np.abs(exact[:, k]) + 4 * round_off)


NOTHING = np.zeros((1, 3))


@pytest.mark.parametrize(
    ("refused", "kind", "said"),
    [
        (
            lambda: Triad(MATRIX[[0, 1, 1]], BIAS).correct(NOTHING),
            ValueError,
            "the triad's matrix is singular",
        ),
        (
            lambda: ImuModel(None, GYROSCOPE).distort(NOTHING, NOTHING),
            ValueError,
            "the model has no accelerometer",
        ),
        (
            lambda: ImuModel(ACCELEROMETER, None).correct(NOTHING, NOTHING),
            ValueError,
            "the model has no gyroscope",
        ),
        (
            lambda: change_frame(IMU, "platform"),
            UsageError,
            "no frame 'platform': choose one of accelerometer-x, accelerometer-z, mean-gyro",
        ),
        (
            lambda: change_frame(ImuModel(ACCELEROMETER, None), "mean-gyro"),
            UsageError,
            "by the gyros, and there are none",
        ),
        (lambda: frame_rotation(MATRIX, "mean-gyro"), UsageError, "fixed by the gyros: change a whole model"),
        (
            lambda: change_frame(ImuModel(None, GYROSCOPE), "accelerometer-x"),
            UsageError,
            "fixed by the accelerometers, and there are none",
        ),
    ],
)
def test_what_is_missing_is_named(refused: Callable[[], object], kind: type[Exception], said: str) -> None:
    with pytest.raises(kind, match=said):
        refused()
