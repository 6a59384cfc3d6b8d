"""The worked numbers of Savage (2018), section 9, by the closed forms of the sequences."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.closed_forms.rotation_sequences import sequence_model
from tumble.calibration.closed_forms.sequence_inversion import invert_measurements
from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES
from tumble.units import STANDARD_GRAVITY

DEGREE = np.pi / 180.0
MICRO = 1e-6
TENTH_PER_HOUR = 0.1 * DEGREE / 3600.0


@pytest.mark.parametrize(
    ("sequence", "component", "parameter", "size"),
    [("1", 0, "kappa yy", 2 * np.pi), ("4", 1, "upsilon yz", 4.0), ("7", 0, "mu xy", 2.0)],
)
def test_table_2_is_in_the_coefficients_of_the_sequences(
    sequence: str, component: int, parameter: str, size: float
) -> None:
    row = next(row for row in SEQUENCES if row.name == sequence)
    model = sequence_model(row.rotations, start_down(row), STANDARD_GRAVITY)
    coefficient = model.coefficients[component, NAMES.index(parameter)]
    assert abs(coefficient) / STANDARD_GRAVITY == pytest.approx(size)


def bias_errors(bias: list[float]) -> dict[str, float]:
    """What a gyro bias makes of the 24 parameters by (13), with 10 s averages and 1 rad/s."""
    measured: dict[str, np.ndarray] = {}
    for row in SEQUENCES:
        model = sequence_model(row.rotations, start_down(row), STANDARD_GRAVITY, rate=1.0, seconds=10.0)
        measured[row.name] = model.bias_coefficients @ np.array(bias)
    return dict(zip(NAMES, invert_measurements(measured, STANDARD_GRAVITY).tolist(), strict=True))


def test_the_worked_examples_of_a_gyro_bias_in_9_4() -> None:
    """1.7 µrad of υxy, 0.49 µrad of µxy + υxy/2, and -2.91 µg of λy + g υyz, for 0.1 °/h."""
    half = 0.5 * TENTH_PER_HOUR
    xy = bias_errors([half, half, -TENTH_PER_HOUR])["upsilon xy"]
    assert xy / MICRO == pytest.approx(1.7, abs=0.05)
    found = bias_errors([0.0, TENTH_PER_HOUR, 0.0])
    assert (found["mu xy"] + 0.5 * found["upsilon xy"]) / MICRO == pytest.approx(0.49, abs=0.006)
    found = bias_errors([TENTH_PER_HOUR, -half, -half])
    y = found["lambda y"] + STANDARD_GRAVITY * found["upsilon yz"]
    assert y / STANDARD_GRAVITY / MICRO == pytest.approx(-2.91, abs=0.006)
