"""One triad, worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.sensor import Triad

MATRIX = np.array([[100.0, 3.0, -2.0], [-4.0, 110.0, 5.0], [6.0, -1.0, 90.0]])
BIAS = np.array([10.0, -20.0, 30.0])


def test_the_rows_of_the_matrix_are_the_sensors() -> None:
    # x: 100 * 1 + 3 * 2 - 2 * 3 + 10; y: -4 + 220 + 15 - 20; z: 6 - 2 + 270 + 30
    raw = Triad(MATRIX, BIAS).distort(np.array([[1.0, 2.0, 3.0]]))
    assert np.array_equal(raw, [[110.0, 211.0, 304.0]])
    np.testing.assert_allclose(Triad(MATRIX, BIAS).correct(raw), [[1.0, 2.0, 3.0]], rtol=1e-14)


def test_asymmetry_and_quadratic_terms_act_on_each_sensor_s_own_input() -> None:
    triad = Triad(MATRIX, BIAS, np.array([0.01, -0.02, 0.03]), np.array([1e-4, 2e-4, -3e-4]))
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
    assert np.array_equal(triad.correct(BIAS[None, :]), np.zeros((1, 3)))


def test_a_matrix_without_inverse_is_refused() -> None:
    singular = Triad(np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 1.0]]), BIAS)
    with pytest.raises(ValueError, match="the triad's matrix is singular"):
        singular.correct(np.ones((2, 3)))
