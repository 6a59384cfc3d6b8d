"""Triads, units, frames and conventions: worked by hand, by the papers' scalar equations, and both ways."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad, change_frame, frame_rotation
from tumble.sensor.conventions.savage import NAMES, PAIRS, SavageErrors, savage_from_model
from tumble.sensor.conventions.shin import matrix_from_shin, shin_from_matrix
from tumble.sensor.conventions.zhang import inter_triad_angles, inter_triad_rotation, matrix_from_zhang
from tumble.sensor.gauge import inverse, jacobian

BY_HAND = np.array([[100.0, 3.0, -2.0], [-4.0, 110.0, 5.0], [6.0, -1.0, 90.0]])
ITS_BIAS = np.array([10.0, -20.0, 30.0])


def test_the_rows_of_the_matrix_are_the_sensors():
    # x: 100 * 1 + 3 * 2 - 2 * 3 + 10; y: -4 + 220 + 15 - 20; z: 6 - 2 + 270 + 30
    raw = Triad(BY_HAND, ITS_BIAS).distort(np.array([[1.0, 2.0, 3.0]]))
    assert np.array_equal(raw, [[110.0, 211.0, 304.0]])
    np.testing.assert_allclose(Triad(BY_HAND, ITS_BIAS).correct(raw), [[1.0, 2.0, 3.0]], rtol=1e-14)


def test_asymmetry_and_quadratic_terms_act_on_each_sensor_s_own_input():
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


def test_g_sensitivity_acts_on_the_true_specific_force_and_adds_to_raw_rates():
    imu = ImuModel(ACCELEROMETER, GYROSCOPE, G_SENSITIVITY)
    raw_force, raw_rate = imu.distort(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert np.array_equal(raw_force, [[101.0, -2.0, 9.0]])
    # third column of the matrix + first column of G + bias
    np.testing.assert_allclose(raw_rate, [[2.0 + 0.1 - 1.0, 4.0 + 0.4 + 0.5, 12.0 + 0.7 + 2.0]], rtol=1e-15)
    force, rate = imu.correct(raw_force, raw_rate)
    np.testing.assert_allclose(force, [[1.0, 0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(rate, [[0.0, 0.0, 1.0]], atol=1e-15)


MATRIX = np.array([[410.0, 3.0, -7.0], [9.0, 420.0, 5.0], [-4.0, 11.0, 430.0]])
BIAS = np.array([33000.0, 32500.0, 32900.0])
IMU = ImuModel(
    Triad(MATRIX, BIAS, np.array([1e-4, -2e-4, 3e-4]), np.array([1e-8, 2e-8, -3e-8])),
    Triad(np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]]), BIAS),
    np.array([[1.0, -0.5, 0.2], [0.3, 0.8, -0.6], [-0.1, 0.4, 0.9]]),
)


VALUES = np.array([415.0, 413.0, 418.0, 0.004, -0.021, -0.009])
GYRO_MATRIX = np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]])


def to_imu_tk(p):
    """Six numbers in imu_tk's frame and a row of the gyro's matrix, which the change of frame turns along."""
    matrix = matrix_from_shin(p[:3], p[3:])
    C_zx = frame_rotation(matrix, "accelerometer-z")
    corrected = inverse(matrix @ C_zx.T)
    return np.concatenate([corrected[np.triu_indices(3)], (GYRO_MATRIX @ C_zx.T)[0]])


def test_the_derivatives_of_a_change_of_frame_are_those_of_central_differences():
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
def test_what_is_missing_is_named(refused, kind, said):
    with pytest.raises(kind, match=said):
        refused()


# Angles of a tenth of a radian: the small-angle forms (Hayal 3.15, 3.16) are off by a per cent.
YZ, ZX, ZY = 0.11, -0.07, 0.05


SCALE_ERROR = np.array([0.02, -0.01, 0.03])
SHIN_BIAS = np.array([0.4, -0.2, 0.1])
TRUE = (3.0, -5.0, 7.0)
TRIAD = Triad(matrix_from_shin(1.0 + SCALE_ERROR, np.array([YZ, ZX, ZY])), SHIN_BIAS)


def test_the_raw_output_is_equation_3_13():
    a_x, a_y, a_z = TRUE
    Y = [
        0.4 + 1.02 * a_x,
        -0.2 + 0.99 * (-a_x * sin(YZ) + a_y * cos(YZ)),
        0.1 + 1.03 * (a_x * sin(ZY) - a_y * sin(ZX) * cos(ZY) + a_z * cos(ZX) * cos(ZY)),
    ]
    np.testing.assert_allclose(TRIAD.distort(np.array([TRUE])), [Y], rtol=1e-15)


def test_a_matrix_of_another_frame_is_refused():
    with pytest.raises(ValueError, match="not lower triangular: change the frame to accelerometer-x"):
        shin_from_matrix(np.array([[1.0, 1e-4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    # the round-off that a change of frame leaves is let through
    shin_from_matrix(np.array([[1.0, 1e-13, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))


SECOND = np.pi / 648000.0


# yz, zy, zx of a tenth of a radian: the printed form is off by a per cent.
ANGLES = np.array([0.11, -0.07, 0.05])


# Zhang et al. 2010, table 2: accelerometer misalignments, gyro misalignments, inter-triad angles, arc seconds.
THEIR_FORCE, THEIR_RATE = np.array([-180.0, 60.0, 330.0]) * SECOND, np.array([300.0, -360.0, 48.0]) * SECOND


INTER_TRIAD = np.array([-600.0, 120.0, -420.0]) * SECOND


def test_the_printed_form_is_3_and_the_exact_one_has_rows_of_unit_length():
    yz, zy, zx = ANGLES
    printed = matrix_from_zhang(np.ones(3), ANGLES, "small-angle")
    np.testing.assert_array_equal(printed, [[1.0, 0.0, 0.0], [yz, 1.0, 0.0], [-zy, zx, 1.0]])
    exact = matrix_from_zhang(np.ones(3), ANGLES)
    np.testing.assert_allclose(np.linalg.norm(exact, axis=1), 1.0, rtol=1e-15)
    # the sensing axes' direction cosines with x and y
    np.testing.assert_allclose(
        [exact[1, 0], exact[2, 0], exact[2, 1]], [np.sin(yz), -np.sin(zy), np.sin(zx)], rtol=1e-15
    )


def test_the_diagonal_understates_the_scale_by_half_the_squares_of_the_angles():
    """Exact angles of the paper's table 2, read as printed: the diagonal of K T falls short of a row's length."""
    for angles, most in ((THEIR_FORCE, 1.3), (THEIR_RATE, 1.6)):
        matrix = matrix_from_zhang(np.full(3, 100.0), angles)
        short = 1e6 * (1.0 - np.diag(matrix) / 100.0)
        yz, zy, zx = angles
        # fourth order: 1e-6 ppm
        np.testing.assert_allclose(short, 0.5e6 * np.array([0.0, yz**2, zy**2 + zx**2]), atol=2e-6)
        assert np.max(short) == pytest.approx(most, abs=0.05)


def test_inter_triad_angles_turn_p_into_o_and_come_back():
    x, y, z = INTER_TRIAD
    R = inter_triad_rotation(INTER_TRIAD)
    # I + [θ×] of (6) is off by half of the squares and products
    printed = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    assert np.max(np.abs(R - printed)) < 0.51 * float(INTER_TRIAD @ INTER_TRIAD)
    np.testing.assert_allclose(inter_triad_angles(R), INTER_TRIAD, atol=1e-15)


# No two alike in size: a transpose or a wrong pair fails.
ERRORS = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.5, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip


GYRO_BIAS = np.array([1e-4, -2e-4, 3e-4])
SAVAGE = SavageErrors.from_vector(ERRORS, GYRO_BIAS)


def named(word):
    return float(ERRORS[NAMES.index(word)])


def test_the_model_is_6_to_11_element_by_element():
    model = SAVAGE.model()
    half = [named(f"upsilon {pair}") / 2 for pair in ("yz", "zx", "xy")]
    expected = np.eye(3) + np.array(
        [
            [named("kappa xx"), half[2], half[1]],
            [half[2], named("kappa yy"), half[0]],
            [half[1], half[0], named("kappa zz")],
        ]
    )
    np.testing.assert_allclose(model.gyroscope.matrix, expected, rtol=0, atol=1e-16)
    expected = np.eye(3) + np.array(
        [
            [named("lambda xx"), named("mu xy"), named("mu xz")],
            [named("mu yx"), named("lambda yy"), named("mu yz")],
            [named("mu zx"), named("mu zy"), named("lambda zz")],
        ]
    )
    np.testing.assert_allclose(model.accelerometer.matrix, expected, rtol=0, atol=1e-16)


def test_an_asymmetry_adds_to_the_scale_factor_of_positive_input_and_takes_from_that_of_negative():
    model = SavageErrors.from_vector(ERRORS * np.isin(np.arange(24), [3, 4, 5, 15, 16, 17])).model()
    rates = np.array([[0.0, 2.0, 0.0], [0.0, -2.0, 0.0]])
    _, shown = model.distort(10.0 * rates, rates)
    asymmetry = named("kappa yyy")
    np.testing.assert_allclose(shown[:, 1], [2.0 * (1 + asymmetry), -2.0 * (1 - asymmetry)], rtol=1e-15)


def test_the_rotation_is_that_of_scipy_s_polar_decomposition():
    model = SAVAGE.model().turned(Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix())
    rotation, symmetric = polar(model.gyroscope.matrix, side="left")
    found, U = savage_from_model(model)
    np.testing.assert_allclose(U, rotation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.kappa, np.diag(symmetric) - 1.0, rtol=0, atol=1e-14)
    off = [symmetric[i, j] + symmetric[j, i] for i, j in PAIRS]
    np.testing.assert_allclose(found.upsilon, off, rtol=0, atol=1e-14)


@given(
    values=st.lists(st.floats(-0.05, 0.05), min_size=24, max_size=24),
    frame=st.sampled_from(["accelerometer-x", "accelerometer-z"]),
)
def test_to_another_frame_and_back_nothing_is_lost(values, frame):
    errors = SavageErrors.from_vector(np.array(values), GYRO_BIAS)
    np.testing.assert_array_equal(errors.vector, values)
    away = change_frame(errors.model(), frame)
    found, U = savage_from_model(away)
    np.testing.assert_allclose(found.vector, values, rtol=0, atol=1e-13)
    np.testing.assert_allclose(U @ U.T, np.eye(3), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.gyro_bias, GYRO_BIAS, rtol=0, atol=1e-16)
    gyro = change_frame(away, "mean-gyro").gyroscope.matrix
    # an SVD of three matrix products: some tens of roundings of numbers near 1
    np.testing.assert_allclose(gyro, gyro.T, rtol=0, atol=1e-13)


def test_one_triad_and_left_handed_gyros_have_no_such_errors():
    model = SAVAGE.model()
    mirrored = Triad(model.gyroscope.matrix * [1.0, -1.0, 1.0], np.zeros(3))
    for one in (ImuModel(None, model.gyroscope), ImuModel(model.accelerometer, None)):
        with pytest.raises(ValueError, match="one triad only"):
            savage_from_model(one)
    with pytest.raises(UsageError, match="left-handed"):
        savage_from_model(ImuModel(model.accelerometer, mirrored))
