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
from tumble.sensor.conventions.savage import (
    GROUPS,
    NAMES,
    OFF_DIAGONAL,
    PAIRS,
    SavageErrors,
    savage_from_model,
)

# No two alike in size: a transpose or a wrong pair fails.
ERRORS = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.5, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip
GYRO_BIAS = np.array([1e-4, -2e-4, 3e-4])
SAVAGE = SavageErrors.from_vector(ERRORS, GYRO_BIAS)


def matrices(model: ImuModel) -> tuple[np.ndarray, np.ndarray]:
    assert model.accelerometer is not None
    assert model.gyroscope is not None
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


@pytest.mark.parametrize("angles", [[0.01, -0.02, 0.005], [0.5, 1.0, -0.7]])
def test_from_any_frame_the_errors_come_back_and_the_rotation_with_them(angles: list[float]) -> None:
    C = Rotation.from_rotvec(angles).as_matrix()
    found, U = savage_from_model(SAVAGE.model().turned(C))
    np.testing.assert_allclose(found.vector, ERRORS, rtol=0, atol=1e-14)
    np.testing.assert_allclose(U, C.T, rtol=0, atol=1e-14)


def test_the_rotation_is_that_of_scipy_s_polar_decomposition() -> None:
    _, gyro = matrices(SAVAGE.model().turned(Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()))
    rotation, symmetric = polar(gyro, side="left")
    found, U = savage_from_model(SAVAGE.model().turned(Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()))
    np.testing.assert_allclose(U, rotation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.kappa, np.diag(symmetric) - 1.0, rtol=0, atol=1e-14)
    off = [symmetric[i, j] + symmetric[j, i] for i, j in PAIRS]
    np.testing.assert_allclose(found.upsilon, off, rtol=0, atol=1e-14)


def test_units_that_are_not_si_are_divided_out_but_the_bias_is_multiplied_to_si() -> None:
    model = SAVAGE.model()
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    g, degree = 9.80665, np.pi / 180.0
    scaled = ImuModel(
        Triad(model.accelerometer.matrix / g, model.accelerometer.bias / g, model.accelerometer.asymmetry),
        Triad(model.gyroscope.matrix / degree, model.gyroscope.bias / degree, model.gyroscope.asymmetry),
    )
    found, _ = savage_from_model(scaled, force_factor=g, rate_factor=degree)
    np.testing.assert_allclose(found.vector, ERRORS, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.gyro_bias, GYRO_BIAS, rtol=1e-14)


# The way to Shin's and Zhang's frame ------------------------------------------------------------------


def test_to_the_accelerometers_frame_it_is_an_lq_decomposition() -> None:
    """M_a = L_a Q_a; M_g Q_aᵀ = L_g Q_g, with Q_g the rotation between the triads. Biases do not change."""
    force, gyro = matrices(SAVAGE.model())
    changed = change_frame(SAVAGE.model(), "accelerometer-x")
    q, r = np.linalg.qr(force.T)
    sign = np.sign(np.diag(r))
    L_a, Q_a = (r.T * sign), (q * sign).T
    np.testing.assert_allclose(L_a @ Q_a, force, rtol=0, atol=1e-14)
    found_force, found_gyro = matrices(changed)
    np.testing.assert_allclose(found_force, L_a, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found_gyro, gyro @ Q_a.T, rtol=0, atol=1e-14)
    assert changed.accelerometer is not None
    assert changed.gyroscope is not None
    np.testing.assert_array_equal(changed.accelerometer.bias, SAVAGE.bias)
    np.testing.assert_array_equal(changed.gyroscope.bias, GYRO_BIAS)
    np.testing.assert_array_equal(changed.accelerometer.asymmetry, SAVAGE.scale_asymmetry)
    np.testing.assert_array_equal(changed.gyroscope.asymmetry, SAVAGE.kappa_asymmetry)


def test_to_first_order_the_angles_are_sums_and_differences_of_savage_s() -> None:
    """L_a,ij = μij + μji and L_g,ij = υij (i > j); Q_g = I + Θ, antisymmetric, Θij = υij / 2 - μij (i < j)."""
    mu = np.zeros((3, 3))
    for value, (i, j) in zip(SAVAGE.mu, OFF_DIAGONAL, strict=True):
        mu[i, j] = value
    upsilon = np.zeros((3, 3))
    for value, (i, j) in zip(SAVAGE.upsilon, PAIRS, strict=True):
        upsilon[i, j] = upsilon[j, i] = value
    force, gyro = matrices(change_frame(SAVAGE.model(), "accelerometer-x"))
    q, r = np.linalg.qr(gyro.T)
    sign = np.sign(np.diag(r))
    L_g, Q_g = (r.T * sign), (q * sign).T
    # second order of 2.4e-3: 6e-6, some of them together
    second = 2e-5
    for i, j in ((1, 0), (2, 0), (2, 1)):
        assert force[i, j] == pytest.approx(mu[i, j] + mu[j, i], abs=second)
        assert L_g[i, j] == pytest.approx(upsilon[i, j], abs=second)
        assert Q_g[j, i] == pytest.approx(upsilon[j, i] / 2.0 - mu[j, i], abs=second)
        assert Q_g[i, j] == pytest.approx(-Q_g[j, i], abs=second)
        assert abs(Q_g[j, i]) > 10 * second
    assert abs(force[1, 0] - (mu[1, 0] - mu[0, 1])) > 10 * second


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
    assert model.gyroscope is not None
    mirrored = ImuModel(model.accelerometer, Triad(model.gyroscope.matrix * [1.0, -1.0, 1.0], np.zeros(3)))
    with pytest.raises(UsageError, match="left-handed"):
        savage_from_model(mirrored)
    with pytest.raises(UsageError, match="fixed by the gyros, and there are none"):
        change_frame(ImuModel(model.accelerometer, None), "mean-gyro")
