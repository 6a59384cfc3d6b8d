"""Predicted errors against navigation that is integrated step by step with a wrong model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import left_jacobian
from tumble.calibration.free_inertial import CalibratedUnit, sheet_unit
from tumble.sensor import ImuModel, Triad

GRAVITY = 9.81
ACCELEROMETER = Triad(
    np.array([[1.02, 0.003, -0.004], [0.0031, 0.97, 0.002], [-0.0012, 0.0045, 1.05]]),
    np.array([0.02, -0.03, 0.05]),
)
GYROSCOPE = Triad(
    np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
    np.array([1e-3, -2e-3, 3e-3]),
)
SENSITIVITY = np.array([[1e-4, 2e-4, -1e-4], [3e-4, -2e-4, 1e-4], [2e-4, 1e-4, -3e-4]])
MODEL = ImuModel(ACCELEROMETER, GYROSCOPE, SENSITIVITY)
NAMES = tuple(
    [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    + [f"accelerometer.bias[{i}]" for i in range(3)]
    + [f"gyroscope.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    + [f"gyroscope.bias[{i}]" for i in range(3)]
    + [f"gyroscope.g_sensitivity[{i},{j}]" for i in range(3) for j in range(3)]
)
UNIT = CalibratedUnit(MODEL, NAMES, np.eye(len(NAMES)), GRAVITY)
UP = np.array([0.36, -0.48, 0.8])
SIZE = 1e-6


def wrong(index: int) -> tuple[Triad, Triad, np.ndarray]:
    """The model with one parameter larger by SIZE."""
    parts = [ACCELEROMETER.matrix, ACCELEROMETER.bias, GYROSCOPE.matrix, GYROSCOPE.bias, SENSITIVITY]
    values = np.concatenate([p.ravel() for p in parts])
    values[index] += SIZE
    a, b, c, d, e = np.split(values, [9, 12, 21, 24])
    return Triad(a.reshape(3, 3), b), Triad(c.reshape(3, 3), d), e.reshape(3, 3)


def shown(index: int, force: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a wrong model makes of true numbers."""
    raw_force = ACCELEROMETER.matrix @ force + ACCELEROMETER.bias
    raw_rate = GYROSCOPE.matrix @ rate + SENSITIVITY @ force + GYROSCOPE.bias
    accelerometer, gyroscope, sensitivity = wrong(index)
    f = np.linalg.solve(accelerometer.matrix, raw_force - accelerometer.bias)
    w = np.linalg.solve(gyroscope.matrix, raw_rate - sensitivity @ f - gyroscope.bias)
    return f, w


@pytest.mark.parametrize("index", [5, 10, 14, 22, 31])
def test_the_position_error_is_that_of_navigation_step_by_step(index: int) -> None:
    seconds, steps = 20.0, 1000
    f, w = shown(index, GRAVITY * UP, np.zeros(3))
    dt = seconds / steps
    C, velocity, position = Rotation.identity(), np.zeros(3), np.zeros(3)
    turn = Rotation.from_rotvec(w * dt)
    half = Rotation.from_rotvec(w * dt / 2.0)
    for _ in range(steps):
        acceleration = (C * half).apply(f) - GRAVITY * UP
        position += velocity * dt + 0.5 * acceleration * dt**2
        velocity += acceleration * dt
        C = C * turn
    by_force, by_rate = UNIT.output_errors(GRAVITY * UP, np.zeros(3))
    moved = 0.5 * seconds**2 * by_force + seconds**3 / 6.0 * np.cross(by_rate.T, GRAVITY * UP).T
    # Errors of 1e-6 leave second-order terms of a few 1e-6 of themselves.
    assert moved[:, index] * SIZE == pytest.approx(
        position, rel=1e-4, abs=1e-3 * np.linalg.norm(position) + 1e-12
    )
    alone = np.zeros((33, 33))
    alone[index, index] = SIZE**2
    predicted = CalibratedUnit(MODEL, NAMES, alone, GRAVITY).position_error(seconds, UP)
    horizontal = position - (position @ UP) * UP
    assert predicted.across(UP) == pytest.approx(np.linalg.norm(horizontal), rel=2e-3, abs=1e-12)
    # Upwards a tilt acts with its square: 1e-6 over 20 s leave some 1e-5 of the whole.
    least = 1e-3 * np.linalg.norm(position) + 1e-12
    assert np.sqrt(abs(UP @ predicted.covariance @ UP)) == pytest.approx(
        abs(position @ UP), rel=2e-3, abs=least
    )


@pytest.mark.parametrize("index", [13, 18, 22])
def test_the_attitude_error_is_that_of_a_turn_step_by_step(index: int) -> None:
    axis, angle, seconds, steps = np.array([2.0, -1.0, 2.0]) / 3.0, 2.5, 4.0, 1000
    rate = angle / seconds * axis
    other = wrong(index)[1]
    w = np.linalg.solve(other.matrix, GYROSCOPE.matrix @ rate + GYROSCOPE.bias - other.bias)
    seen, true = Rotation.identity(), Rotation.identity()
    for _ in range(steps):
        seen = seen * Rotation.from_rotvec(w * seconds / steps)
        true = true * Rotation.from_rotvec(rate * seconds / steps)
    missed = (seen * true.inv()).as_rotvec()
    _, by_rate = UNIT.output_errors(np.zeros(3), rate)
    predicted = left_jacobian(angle * axis) @ by_rate[:, index] * seconds * SIZE
    assert predicted == pytest.approx(missed, rel=1e-4, abs=1e-10)


def test_a_gyro_bias_of_a_degree_an_hour_is_so_many_metres_after_a_minute() -> None:
    """g b t³/6 = 9.81 x 4.85e-6 x 36000 = 1.71 m for each of both horizontal axes, and none upwards."""
    unit = sheet_unit((0.0, np.radians(1.0) / 3600.0), (0.0, 0.0), (0.0, 0.0), GRAVITY)
    predicted = unit.position_error(60.0, np.array([0.0, 0.0, 1.0]))
    one = GRAVITY * np.radians(1.0) / 3600.0 * 60.0**3 / 6.0
    assert predicted.across(np.array([0.0, 0.0, 1.0])) == pytest.approx(np.sqrt(2.0) * one)
    assert predicted.covariance[2, 2] == pytest.approx(0.0, abs=1e-18)


def test_times_beyond_the_closed_forms_are_refused() -> None:
    with pytest.raises(ValueError, match="up to 600 s"):
        UNIT.position_error(3600.0, UP)
    with pytest.raises(ValueError, match="takes some time"):
        UNIT.attitude_error(UP, 1.0, 0.0, UP)
