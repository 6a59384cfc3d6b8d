"""A model mended by the errors that its corrected output still has."""

from __future__ import annotations

import numpy as np

from tumble.calibration.strapdown.estimate import apply_errors
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.savage import GROUPS, SavageErrors

MODEL = ImuModel(
    Triad(np.array([[410.0, 3.0, -7.0], [9.0, 420.0, 5.0], [-4.0, 11.0, 430.0]]), np.array([30.0, -20.0, 10.0])),
    Triad(
        np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]]), np.array([3.0, -2.0, 1.0])
    ),
    np.array([[1.0, -0.5, 0.2], [0.3, 0.8, -0.6], [-0.1, 0.4, 0.9]]),
)  # fmt: skip
ERRORS = 1e-3 * np.sin(np.arange(1.0, 25.0))
LINEAR = np.where(np.isin(np.arange(24), [3, 4, 5, 15, 16, 17]), 0.0, ERRORS)
FORCE, RATE = np.random.default_rng(3).normal(0.0, 5.0, (2, 30, 3))


def test_the_mended_model_s_raw_output_is_the_old_one_s_of_what_the_errors_make_of_the_truth() -> None:
    """Exact for all errors but asymmetries, and without a g-sensitivity, which acts on the true force."""
    mended = apply_errors(ImuModel(MODEL.accelerometer, MODEL.gyroscope), LINEAR)
    shown = SavageErrors.from_vector(LINEAR).model().distort(FORCE, RATE)
    expected = ImuModel(MODEL.accelerometer, MODEL.gyroscope).distort(*shown)
    for found, wanted in zip(mended.distort(FORCE, RATE), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-9)


def test_asymmetries_add_up_to_first_order_at_each_sensor_s_own_input() -> None:
    only = np.zeros(24)
    for group in ("kappa_asym", "lambda_asym"):
        only[GROUPS[group]] = ERRORS[GROUPS[group]]
    mended = apply_errors(apply_errors(MODEL, only), 2.0 * only)
    for triad, group in ((mended.gyroscope, "kappa_asym"), (mended.accelerometer, "lambda_asym")):
        np.testing.assert_allclose(triad.asymmetry, 3.0 * ERRORS[GROUPS[group]], rtol=1e-14)


def test_gyro_bias_and_g_sensitivity_are_left_to_the_rests() -> None:
    mended = apply_errors(MODEL, ERRORS)
    np.testing.assert_array_equal(mended.gyroscope.bias, MODEL.gyroscope.bias)
    np.testing.assert_array_equal(mended.g_sensitivity, MODEL.g_sensitivity)
    assert apply_errors(ImuModel(MODEL.accelerometer, MODEL.gyroscope), ERRORS).g_sensitivity is None
