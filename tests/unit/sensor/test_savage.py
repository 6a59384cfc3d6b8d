"""Savage's parameters and the mean-gyro frame: exact both ways, and to first order as the formulas say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.sensor.conventions.savage import GROUPS, NAMES, PAIRS, SavageErrors, savage_from_model

# No two alike in size: a transpose or a wrong pair fails.
ERRORS = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.5, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip
GYRO_BIAS = np.array([1e-4, -2e-4, 3e-4])
SAVAGE = SavageErrors.from_vector(ERRORS, GYRO_BIAS)


def matrices(model: ImuModel) -> tuple[np.ndarray, np.ndarray]:
    return model.accelerometer.matrix, model.gyroscope.matrix


def named(word: str) -> float:
    return float(ERRORS[NAMES.index(word)])


def test_names_groups_and_the_vector_are_in_one_order() -> None:
    assert len(NAMES) == len(set(NAMES)) == 24
    np.testing.assert_array_equal(SAVAGE.vector, ERRORS)
    assert [NAMES[at.start] for at in GROUPS.values()] == [
        "kappa xx", "kappa xxx", "upsilon yz", "lambda x", "lambda xx", "lambda xxx", "mu xy",
    ]  # fmt: skip
    assert [at.stop for at in GROUPS.values()][:-1] == [at.start for at in GROUPS.values()][1:]
    np.testing.assert_array_equal(SavageErrors.from_vector(ERRORS).gyro_bias, 0.0)


def test_the_model_is_6_to_11_element_by_element() -> None:
    force, gyro = matrices(SAVAGE.model())
    half = [named(f"upsilon {pair}") / 2 for pair in ("yz", "zx", "xy")]
    expected = np.eye(3) + np.array(
        [
            [named("kappa xx"), half[2], half[1]],
            [half[2], named("kappa yy"), half[0]],
            [half[1], half[0], named("kappa zz")],
        ]
    )
    np.testing.assert_allclose(gyro, expected, rtol=0, atol=1e-16)
    expected = np.eye(3) + np.array(
        [
            [named("lambda xx"), named("mu xy"), named("mu xz")],
            [named("mu yx"), named("lambda yy"), named("mu yz")],
            [named("mu zx"), named("mu zy"), named("lambda zz")],
        ]
    )
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-16)


def test_an_asymmetry_adds_to_the_scale_factor_of_positive_input_and_takes_from_that_of_negative() -> None:
    model = SavageErrors.from_vector(ERRORS * np.isin(np.arange(24), [3, 4, 5, 15, 16, 17])).model()
    rates = np.array([[0.0, 2.0, 0.0], [0.0, -2.0, 0.0]])
    _, shown = model.distort(10.0 * rates, rates)
    asymmetry = named("kappa yyy")
    np.testing.assert_allclose(shown[:, 1], [2.0 * (1 + asymmetry), -2.0 * (1 - asymmetry)], rtol=1e-15)


def test_from_the_mean_gyro_frame_nothing_turns_and_the_errors_come_back() -> None:
    found, U = savage_from_model(SAVAGE.model())
    np.testing.assert_allclose(U, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.vector, ERRORS, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found.gyro_bias, GYRO_BIAS)


def test_the_rotation_is_that_of_scipy_s_polar_decomposition() -> None:
    _, gyro = matrices(SAVAGE.model().turned(Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()))
    rotation, symmetric = polar(gyro, side="left")
    found, U = savage_from_model(SAVAGE.model().turned(Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()))
    np.testing.assert_allclose(U, rotation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.kappa, np.diag(symmetric) - 1.0, rtol=0, atol=1e-14)
    off = [symmetric[i, j] + symmetric[j, i] for i, j in PAIRS]
    np.testing.assert_allclose(found.upsilon, off, rtol=0, atol=1e-14)


# The way to Shin's and Zhang's frame ------------------------------------------------------------------


@given(
    values=st.lists(st.floats(-0.05, 0.05), min_size=24, max_size=24),
    frame=st.sampled_from(["accelerometer-x", "accelerometer-z"]),
)
def test_to_another_frame_and_back_nothing_is_lost(values: list[float], frame: str) -> None:
    errors = SavageErrors.from_vector(np.array(values), GYRO_BIAS)
    away = change_frame(errors.model(), frame)
    found, U = savage_from_model(away)
    np.testing.assert_allclose(found.vector, values, rtol=0, atol=1e-13)
    np.testing.assert_allclose(U @ U.T, np.eye(3), rtol=0, atol=1e-13)
    _, gyro = matrices(change_frame(away, "mean-gyro"))
    # an SVD of three matrix products: some tens of roundings of numbers near 1
    np.testing.assert_allclose(gyro, gyro.T, rtol=0, atol=1e-13)


# What is refused -------------------------------------------------------------------------------------


def test_one_triad_alone_has_no_such_errors() -> None:
    with pytest.raises(ValueError, match="one triad only"):
        savage_from_model(ImuModel(None, SAVAGE.model().gyroscope))
    with pytest.raises(ValueError, match="one triad only"):
        savage_from_model(ImuModel(SAVAGE.model().accelerometer, None))


def test_left_handed_gyros_are_refused() -> None:
    model = SAVAGE.model()
    mirrored = ImuModel(model.accelerometer, Triad(model.gyroscope.matrix * [1.0, -1.0, 1.0], np.zeros(3)))
    with pytest.raises(UsageError, match="left-handed"):
        savage_from_model(mirrored)
