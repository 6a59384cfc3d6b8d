"""Shin and El-Sheimy's convention, against the thesis' scalar equations worked out in the test."""

from __future__ import annotations

from math import cos, sin, tan

import numpy as np
import pytest

from tumble.sensor import Triad
from tumble.sensor.conventions.shin import matrix_from_shin, shin_from_matrix

# Angles of a tenth of a radian: the small-angle forms (Hayal 3.15, 3.16) are off by a per cent.
YZ, ZX, ZY = 0.11, -0.07, 0.05
SCALE_ERROR = np.array([0.02, -0.01, 0.03])
BIAS = np.array([0.4, -0.2, 0.1])
TRUE = (3.0, -5.0, 7.0)

TRIAD = Triad(matrix_from_shin(1.0 + SCALE_ERROR, np.array([YZ, ZX, ZY])), BIAS)


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


def test_the_axes_are_the_rotated_ones_of_3_5_and_3_8_with_a_plus_on_z_s_first_component() -> None:
    R_z = np.array([[cos(YZ), -sin(YZ), 0], [sin(YZ), cos(YZ), 0], [0, 0, 1]])  # 3.6
    R_x = np.array([[1, 0, 0], [0, cos(ZX), -sin(ZX)], [0, sin(ZX), cos(ZX)]])  # 3.8
    R_y = np.array([[cos(ZY), 0, sin(ZY)], [0, 1, 0], [-sin(ZY), 0, cos(ZY)]])  # 3.8
    axes = matrix_from_shin(np.ones(3), np.array([YZ, ZX, ZY]))
    np.testing.assert_allclose(axes[1], R_z @ [0.0, 1.0, 0.0], atol=1e-16)
    np.testing.assert_allclose(axes[2], R_x @ R_y @ [0.0, 0.0, 1.0], atol=1e-16)
    assert axes[2, 0] == +sin(ZY)  # 3.7 prints a minus
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, rtol=1e-15)


def test_a_matrix_of_another_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="not lower triangular: change the frame to accelerometer-x"):
        shin_from_matrix(np.array([[1.0, 1e-4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    # the round-off that a change of frame leaves is let through
    shin_from_matrix(np.array([[1.0, 1e-13, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
