"""Covariances through changes of parameters, against closed forms, differences and Monte Carlo."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.sensor import propagate
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble.sensor.gauge import frame_rotation, inverse
from tumble.sensor.propagation import jacobian

Complex = npt.NDArray[Any]
VALUES = np.array([415.0, 413.0, 418.0, 0.004, -0.021, -0.009])
GYRO = np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]])


def to_imu_tk(p: Complex) -> Complex:
    """Six numbers in imu_tk's frame and a row of the gyro's matrix, which the change of frame turns along."""
    matrix = matrix_from_shin(p[:3], p[3:])
    C_zx = frame_rotation(matrix, "accelerometer-z")
    corrected = inverse(matrix @ C_zx.T)
    return np.concatenate([corrected[np.triu_indices(3)], (GYRO @ C_zx.T)[0]])


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
