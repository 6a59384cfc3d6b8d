"""Correct undoes distort, and conventions lead back to where they began."""

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from tumble.sensor import ImuModel, Triad, change_frame, matrix_from_shin, shin_from_matrix


def within(shape: int | tuple[int, ...], limit: float) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, shape, elements=st.floats(-limit, limit, allow_subnormal=False))


# Scale of an SI output, of counts or of fine counts, each axis its own.
scales = st.tuples(st.sampled_from([1e-3, 1.0, 415.0, 1e6]), within(3, 0.3)).map(
    lambda p: p[0] * (1.0 + p[1])
)
# Rows of length about one, 0.2 rad off: well away from singular.
axes = within((3, 3), 0.2).map(lambda m: np.eye(3) + m)


@st.composite
def triads(draw: st.DrawFn) -> Triad:
    scale = draw(scales)
    matrix = scale[:, None] * draw(axes)
    bias = scale * draw(within(3, 100.0))
    asymmetry = draw(st.none() | within(3, 0.05))
    # at 20 m/s² or rad/s the quadratic term stays below a tenth of the output
    quadratic = draw(st.none() | within(3, 0.1 / 40.0).map(lambda q: q / scale))
    return Triad(matrix, bias, asymmetry, quadratic)


truths = within((5, 3), 20.0)


@given(triads(), triads(), within((3, 3), 0.01), truths, truths)
def test_correct_undoes_distort_for_both_triads_and_g_sensitivity(
    accelerometer: Triad, gyroscope: Triad, sensitivity: np.ndarray, force: np.ndarray, rate: np.ndarray
) -> None:
    G = sensitivity * np.linalg.norm(gyroscope.matrix, axis=1)[:, None]
    imu = ImuModel(accelerometer, gyroscope, G)
    again = imu.correct(*imu.distort(force, rate))
    np.testing.assert_allclose(again[0], force, atol=1e-12)
    np.testing.assert_allclose(again[1], rate, atol=2e-12)


angles = within(3, 0.3)


@given(scales, st.sampled_from([1.0, -1.0]), angles)
def test_shin_to_matrix_and_back(scale: np.ndarray, sign: float, angle: np.ndarray) -> None:
    signed = scale * np.array([1.0, sign, 1.0])
    again = shin_from_matrix(matrix_from_shin(signed, angle))
    np.testing.assert_allclose(again[0], signed, rtol=1e-14)
    np.testing.assert_allclose(again[1], angle, atol=1e-15)


@given(scales, axes, scales, axes)
def test_a_triad_that_imu_tk_describes_to_shin_and_back_with_the_gyro_turned_along(
    scale: np.ndarray, force_axes: np.ndarray, gyro_scale: np.ndarray, gyro_axes: np.ndarray
) -> None:
    theirs = ImuModel(
        Triad(scale[:, None] * np.triu(force_axes), np.zeros(3)),
        Triad(gyro_scale[:, None] * gyro_axes, np.zeros(3)),
    )
    ours = change_frame(theirs, "accelerometer-x")
    shin = matrix_from_shin(*shin_from_matrix(ours.accelerometer.matrix))
    again = change_frame(ImuModel(Triad(shin, np.zeros(3)), ours.gyroscope), "accelerometer-z")
    for found, own in ((again.accelerometer, theirs.accelerometer), (again.gyroscope, theirs.gyroscope)):
        size = float(np.abs(own.matrix).max())
        np.testing.assert_allclose(found.matrix, own.matrix, atol=1e-12 * size)
