"""Conventions: Shin and El-Sheimy by the thesis' scalar equations, Zhang in both readings, Savage both ways."""

from __future__ import annotations

from math import cos, sin, tan

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.sensor.conventions.savage import NAMES, PAIRS, SavageErrors, savage_from_model
from tumble.sensor.conventions.shin import matrix_from_shin, shin_from_matrix
from tumble.sensor.conventions.zhang import inter_triad_angles, inter_triad_rotation, matrix_from_zhang

# Angles of a tenth of a radian: the small-angle forms (Hayal 3.15, 3.16) are off by a per cent.
YZ, ZX, ZY = 0.11, -0.07, 0.05


SCALE_ERROR = np.array([0.02, -0.01, 0.03])
SHIN_BIAS = np.array([0.4, -0.2, 0.1])
TRUE = (3.0, -5.0, 7.0)
TRIAD = Triad(matrix_from_shin(1.0 + SCALE_ERROR, np.array([YZ, ZX, ZY])), SHIN_BIAS)


def test_the_raw_output_is_equation_3_13() -> None:
    a_x, a_y, a_z = TRUE
    Y = [
        0.4 + 1.02 * a_x,
        -0.2 + 0.99 * (-a_x * sin(YZ) + a_y * cos(YZ)),
        0.1 + 1.03 * (a_x * sin(ZY) - a_y * sin(ZX) * cos(ZY) + a_z * cos(ZX) * cos(ZY)),
    ]
    np.testing.assert_allclose(TRIAD.distort(np.array([TRUE])), [Y], rtol=1e-15)


def test_the_corrected_output_is_equation_3_14() -> None:
    Y_x, Y_y, Y_z = 3.3, -4.9, 7.7
    a_x = (Y_x - 0.4) / 1.02
    a_y = a_x * tan(YZ) + (Y_y + 0.2) / (0.99 * cos(YZ))
    a_z = -a_x * tan(ZY) / cos(ZX) + a_y * tan(ZX) + (Y_z - 0.1) / (1.03 * cos(ZX) * cos(ZY))
    np.testing.assert_allclose(TRIAD.correct(np.array([[Y_x, Y_y, Y_z]])), [[a_x, a_y, a_z]], rtol=1e-14)


def test_a_matrix_of_another_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="not lower triangular: change the frame to accelerometer-x"):
        shin_from_matrix(np.array([[1.0, 1e-4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    # the round-off that a change of frame leaves is let through
    shin_from_matrix(np.array([[1.0, 1e-13, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))


SECOND = np.pi / 648000.0


# yz, zy, zx of a tenth of a radian: the printed form is off by a per cent.
ANGLES = np.array([0.11, -0.07, 0.05])


SCALE = np.array([415.0, 413.0, -2.5])


# Zhang et al. 2010, table 2: accelerometer misalignments, gyro misalignments, inter-triad angles, arc seconds.
ACCELEROMETER, GYRO = np.array([-180.0, 60.0, 330.0]) * SECOND, np.array([300.0, -360.0, 48.0]) * SECOND


INTER_TRIAD = np.array([-600.0, 120.0, -420.0]) * SECOND


def test_the_printed_form_is_3_and_the_exact_one_has_rows_of_unit_length() -> None:
    yz, zy, zx = ANGLES
    printed = matrix_from_zhang(np.ones(3), ANGLES, "small-angle")
    np.testing.assert_array_equal(printed, [[1.0, 0.0, 0.0], [yz, 1.0, 0.0], [-zy, zx, 1.0]])
    exact = matrix_from_zhang(np.ones(3), ANGLES)
    np.testing.assert_allclose(np.linalg.norm(exact, axis=1), 1.0, rtol=1e-15)
    # the sensing axes' direction cosines with x and y
    np.testing.assert_allclose(
        [exact[1, 0], exact[2, 0], exact[2, 1]], [np.sin(yz), -np.sin(zy), np.sin(zx)], rtol=1e-15
    )


def test_the_diagonal_understates_the_scale_by_half_the_squares_of_the_angles() -> None:
    """Exact angles of the paper's table 2, read as printed: the diagonal of K T falls short of a row's length."""
    for angles, most in ((ACCELEROMETER, 1.3), (GYRO, 1.6)):
        matrix = matrix_from_zhang(np.full(3, 100.0), angles)
        short = 1e6 * (1.0 - np.diag(matrix) / 100.0)
        yz, zy, zx = angles
        # fourth order: 1e-6 ppm
        np.testing.assert_allclose(short, 0.5e6 * np.array([0.0, yz**2, zy**2 + zx**2]), atol=2e-6)
        assert np.max(short) == pytest.approx(most, abs=0.05)


def test_inter_triad_angles_turn_p_into_o_and_come_back() -> None:
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


def named(word: str) -> float:
    return float(ERRORS[NAMES.index(word)])


def test_the_model_is_6_to_11_element_by_element() -> None:
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


def test_an_asymmetry_adds_to_the_scale_factor_of_positive_input_and_takes_from_that_of_negative() -> None:
    model = SavageErrors.from_vector(ERRORS * np.isin(np.arange(24), [3, 4, 5, 15, 16, 17])).model()
    rates = np.array([[0.0, 2.0, 0.0], [0.0, -2.0, 0.0]])
    _, shown = model.distort(10.0 * rates, rates)
    asymmetry = named("kappa yyy")
    np.testing.assert_allclose(shown[:, 1], [2.0 * (1 + asymmetry), -2.0 * (1 - asymmetry)], rtol=1e-15)


def test_the_rotation_is_that_of_scipy_s_polar_decomposition() -> None:
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
def test_to_another_frame_and_back_nothing_is_lost(values: list[float], frame: str) -> None:
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


def test_one_triad_and_left_handed_gyros_have_no_such_errors() -> None:
    model = SAVAGE.model()
    mirrored = Triad(model.gyroscope.matrix * [1.0, -1.0, 1.0], np.zeros(3))
    for one in (ImuModel(None, model.gyroscope), ImuModel(model.accelerometer, None)):
        with pytest.raises(ValueError, match="one triad only"):
            savage_from_model(one)
    with pytest.raises(UsageError, match="left-handed"):
        savage_from_model(ImuModel(model.accelerometer, mirrored))
