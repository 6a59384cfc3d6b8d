"""Zhang's convention in both readings, and the inter-triad angles."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.sensor.conventions.zhang import inter_triad_angles, inter_triad_rotation, matrix_from_zhang

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
