"""The derivatives of the norm condition, against the thesis' printed ones and the complex step."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy import cos, sin, tan

from tumble.calibration import NormConditions, triad_from_unknowns, unknowns_from_triad

Array = npt.NDArray[Any]

K = 9.801
# Angles of a tenth of a radian, so that each cosine and tangent counts; errors of tenths of m/s².
BIAS = np.array([0.4, -0.2, 0.1])
SCALE_ERROR = np.array([0.02, -0.01, 0.03])
YZ, ZX, ZY = 0.11, -0.07, 0.05
UNKNOWNS = np.concatenate([BIAS, 1.0 + SCALE_ERROR, [YZ, ZX, ZY], np.zeros(3)])
OBSERVED = np.array([[3.3, -4.9, 7.7], [-8.1, 2.2, 5.0], [0.7, 9.4, -2.1], [6.0, -1.0, -7.0]])


def true_vector(unknowns, Y):
    """Hayal 3.14, by scalars, complex if need be."""
    b, scale, (yz, zx, zy) = unknowns[:3], unknowns[3:6], unknowns[6:9]
    u = [Y[i] - b[i] for i in range(3)]
    a_x = u[0] / scale[0]
    a_y = a_x * tan(yz) + u[1] / (scale[1] * cos(yz))
    a_z = -a_x * tan(zy) / cos(zx) + a_y * tan(zx) + u[2] / (scale[2] * cos(zx) * cos(zy))
    return a_x, a_y, a_z


def condition(unknowns, Y):
    """Hayal 3.19 over 2 K."""
    a_x, a_y, a_z = true_vector(unknowns, Y)
    return (a_x * a_x + a_y * a_y + a_z * a_z - K * K) / (2.0 * K)


def printed_derivatives(Y):
    """The thesis' derivatives by b, s, theta (3.63 to 3.71) and by Y (3.72 to 3.74)."""
    (b_x, b_y, b_z), (s_x, s_y, s_z) = BIAS, SCALE_ERROR
    a_x, a_y, a_z = true_vector(UNKNOWNS, Y)
    Y_x, Y_y, Y_z = Y
    x_bracket = a_x + a_y * tan(YZ) + a_z * (tan(ZX) * tan(YZ) - tan(ZY) / cos(ZX))
    y_bracket = (a_y + a_z * tan(ZX)) / cos(YZ)
    z_bracket = a_z / (cos(ZX) * cos(ZY))
    by_parameters = [
        -2 / (1 + s_x) * x_bracket,  # 3.63, the bracket a sum
        -2 / (1 + s_y) * y_bracket,  # 3.64
        -2 / (1 + s_z) * z_bracket,  # 3.65
        -2 * (Y_x - b_x) / (1 + s_x) ** 2 * x_bracket,  # 3.66
        -2 * (Y_y - b_y) / (1 + s_y) ** 2 * y_bracket,  # 3.67
        -2 * (Y_z - b_z) / (1 + s_z) ** 2 * z_bracket,  # 3.68, a_z
        2  # 3.69
        * (a_y + a_z * tan(ZX))
        * (a_x / cos(YZ) ** 2 + (Y_y - b_y) * tan(YZ) / ((1 + s_y) * cos(YZ))),
        2  # 3.70
        * a_z
        * (
            (tan(YZ) / cos(ZX) ** 2 - tan(ZX) * tan(ZY) / cos(ZX)) * a_x
            + (Y_y - b_y) / ((1 + s_y) * cos(ZX) ** 2 * cos(YZ))
            + (Y_z - b_z) * tan(ZX) / ((1 + s_z) * cos(ZY) * cos(ZX))
        ),
        2  # 3.71
        * a_z
        * (-a_x / (cos(ZY) ** 2 * cos(ZX)) + (Y_z - b_z) * tan(ZY) / ((1 + s_z) * cos(ZX) * cos(ZY))),
    ]
    by_observed = [
        2 / (1 + s_x) * x_bracket,  # 3.72
        2 / (1 + s_y) * y_bracket,  # 3.73
        2 / (1 + s_z) * z_bracket,  # 3.74
    ]
    return by_parameters, by_observed


def linearised(unknowns, free):
    covariance = np.tile(1e-6 * np.eye(3), (OBSERVED.shape[0], 1, 1))
    conditions = NormConditions(OBSERVED, covariance, K, unknowns, np.arange(free))
    return conditions, conditions.linearise(unknowns[:free])


def test_nine_parameters_have_the_derivatives_3_63_to_3_74():
    conditions, linear = linearised(UNKNOWNS, 9)
    for k, Y in enumerate(OBSERVED):
        by_parameters, by_observed = printed_derivatives(Y)
        np.testing.assert_allclose(linear.design[k, 0], np.array(by_parameters) / (2 * K), rtol=1e-13)
        np.testing.assert_allclose(conditions._by_observed[k], np.array(by_observed) / (2 * K), rtol=1e-13)
        assert linear.misclosure[k, 0] == pytest.approx(condition(UNKNOWNS, Y), rel=1e-12)


def complex_step(function, values):
    columns = []
    for k in range(values.size):
        moved = values.astype(complex)
        moved[k] += 1e-30j
        columns.append(np.imag(function(moved)) / 1e-30)
    return np.stack(columns, axis=-1)


def test_all_unknowns_agree_with_the_complex_step():
    conditions, linear = linearised(UNKNOWNS, 9)
    for k, Y in enumerate(OBSERVED):
        by_unknowns = complex_step(lambda p, Y=Y: condition(p, Y), UNKNOWNS[:9])
        by_raw = complex_step(lambda y: condition(UNKNOWNS, y), Y)
        np.testing.assert_allclose(linear.design[k, 0], by_unknowns, atol=1e-12)
        np.testing.assert_allclose(conditions._by_observed[k], by_raw, atol=1e-14)


def test_the_unknowns_and_the_triad_are_the_same_numbers():
    unknowns = UNKNOWNS.copy()
    unknowns[9:] = [2e-3, -1e-3, 3e-3]
    triad = triad_from_unknowns(unknowns)
    np.testing.assert_allclose(unknowns_from_triad(triad), unknowns, rtol=1e-14, atol=1e-17)
    # row z, by 3.13
    expected = 1.03 * np.array([sin(ZY), -sin(ZX) * cos(ZY), cos(ZX) * cos(ZY)])
    np.testing.assert_allclose(triad.matrix[2], expected, rtol=1e-15)


def test_after_an_adjustment_of_the_observations_the_misclosure_is_pope_s():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((4, 3, 3))
    covariance = 1e-4 * root @ np.swapaxes(root, 1, 2)
    conditions = NormConditions(OBSERVED, covariance, K, UNKNOWNS, np.arange(9))
    first = conditions.linearise(UNKNOWNS[:9])
    B = conditions._by_observed.copy()
    expected_variance = [B[k] @ covariance[k] @ B[k] for k in range(4)]
    np.testing.assert_allclose(first.covariance[:, 0, 0], expected_variance, rtol=1e-12)
    multipliers = np.array([[3.0], [-2.0], [1.0], [5.0]])
    conditions.adjust_observations(multipliers)
    moved = np.array([OBSERVED[k] - covariance[k] @ B[k] * multipliers[k, 0] for k in range(4)])  # 3.38
    second = conditions.linearise(UNKNOWNS[:9])
    for k in range(4):
        by_raw = complex_step(lambda y: condition(UNKNOWNS, y), moved[k])
        expected = condition(UNKNOWNS, moved[k]) + by_raw @ (OBSERVED[k] - moved[k])  # 3.44
        assert second.misclosure[k, 0] == pytest.approx(expected, rel=1e-10)
