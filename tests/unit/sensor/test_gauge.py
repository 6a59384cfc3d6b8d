"""Frames: what a change of frame moves and what it keeps."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, Triad, change_frame, frame_rotation
from tumble.sensor.gauge import inverse, lower_factor, mean_gyro_rotation, upper_factor

MATRIX = np.array([[410.0, 3.0, -7.0], [9.0, 420.0, 5.0], [-4.0, 11.0, 430.0]])
BIAS = np.array([33000.0, 32500.0, 32900.0])
IMU = ImuModel(
    Triad(MATRIX, BIAS, np.array([1e-4, -2e-4, 3e-4]), np.array([1e-8, 2e-8, -3e-8])),
    Triad(np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]]), BIAS),
    np.array([[1.0, -0.5, 0.2], [0.3, 0.8, -0.6], [-0.1, 0.4, 0.9]]),
)


def accelerometer(model: ImuModel) -> Triad:
    return model.accelerometer


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


@pytest.mark.parametrize("frame", list(FRAMES))
def test_a_change_of_frame_keeps_norms_angles_and_what_belongs_to_the_sensors(frame: str) -> None:
    rng = np.random.default_rng(8)
    raw_force, raw_rate = rng.normal(33000.0, 3000.0, (20, 3)), rng.normal(33000.0, 3000.0, (20, 3))
    changed = change_frame(IMU, frame)
    before, after = IMU.correct(raw_force, raw_rate), changed.correct(raw_force, raw_rate)
    by_gyro = frame == "mean-gyro"
    C_new_b = mean_gyro_rotation(IMU.gyroscope.matrix) if by_gyro else frame_rotation(MATRIX, frame)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other, one @ C_new_b.T, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(other, axis=1), np.linalg.norm(one, axis=1), rtol=1e-13)
        np.testing.assert_allclose(other @ other.T, one @ one.T, atol=1e-11)
    # force against rate too: one rotation for both triads
    np.testing.assert_allclose(after[0] @ after[1].T, before[0] @ before[1].T, atol=1e-11)
    own, same = accelerometer(IMU), accelerometer(changed)
    assert same.bias is own.bias
    assert same.asymmetry is own.asymmetry
    assert same.quadratic is own.quadratic
    # scale factors are lengths of rows
    np.testing.assert_allclose(np.linalg.norm(same.matrix, axis=1), np.linalg.norm(own.matrix, axis=1))


def test_the_inverse_by_cofactors_is_the_inverse_and_takes_complex_steps() -> None:
    np.testing.assert_allclose(inverse(MATRIX) @ MATRIX, np.eye(3), atol=1e-15)
    moved = MATRIX.astype(complex)
    moved[0, 1] += 1e-30j
    change = np.zeros((3, 3))
    change[0, 1] = 1.0
    expected = -np.linalg.inv(MATRIX) @ change @ np.linalg.inv(MATRIX)
    np.testing.assert_allclose(np.imag(inverse(moved)) / 1e-30, expected, atol=1e-19)


def test_an_unknown_frame_and_a_unit_without_accelerometers_are_refused() -> None:
    with pytest.raises(
        UsageError, match="no frame 'platform': choose one of accelerometer-x, accelerometer-z, mean-gyro"
    ):
        change_frame(IMU, "platform")
    with pytest.raises(UsageError, match="fixed by the gyros, and there are none"):
        change_frame(ImuModel(IMU.accelerometer, None), "mean-gyro")
    with pytest.raises(UsageError, match="fixed by the gyros: change a whole model"):
        frame_rotation(MATRIX, "mean-gyro")
    with pytest.raises(UsageError, match="fixed by the accelerometers, and there are none"):
        change_frame(ImuModel(None, IMU.gyroscope), "accelerometer-x")
