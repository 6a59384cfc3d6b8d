"""The report's lines of Python do what the thermal model does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tumble.report.formula import thermal_snippet
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel

BASES = {
    "polynomial": TemperatureBasis("polynomial", 25.0, order=2),
    "linear": TemperatureBasis("linear", 20.0, np.array([-10.0, 18.0, 40.0, 60.0])),
    "spline": TemperatureBasis("spline", 20.0, np.array([-10.0, 18.0, 40.0, 60.0])),
}


@pytest.mark.parametrize("kind", BASES)
def test_the_lines_correct_as_the_model_does_at_any_temperature(kind: str) -> None:
    rng = np.random.default_rng(4)
    basis = BASES[kind]
    reference = ImuModel(
        Triad(np.eye(3) + 0.02 * rng.normal(size=(3, 3)), np.array([0.1, -0.2, 0.05])),
        Triad(np.eye(3) + 0.02 * rng.normal(size=(3, 3)), np.array([0.01, 0.0, -0.02])),
        1e-3 * rng.normal(size=(3, 3)),
    )
    model = ThermalModel(
        reference,
        basis,
        {
            "accelerometer.bias": 1e-3 * rng.normal(size=(basis.size, 3)),
            "accelerometer.matrix": 1e-5 * rng.normal(size=(basis.size, 3, 3)),
            "gyroscope.bias": 1e-4 * rng.normal(size=(basis.size, 3)),
        },
        rate_coefficients={"gyroscope.bias": rng.normal(size=3)},
        hysteresis={"accelerometer.bias": 1e-2 * rng.normal(size=3)},
        span_celsius=(-10.0, 60.0),
        lag=30.0,
    )
    space: dict[str, Any] = {}
    exec(thermal_snippet(cast("Any", SimpleNamespace(thermal_model=model))), space)
    time = np.arange(0.0, 900.0, 10.0)
    celsius = np.linspace(-5.0, 55.0, time.size)
    raw_force, raw_rate = rng.normal(0.0, 10.0, (time.size, 3)), rng.normal(0.0, 1.0, (time.size, 3))
    expected = model.correct(time, raw_force, raw_rate, celsius)
    found = space["correct"](raw_force, raw_rate, *model.sensor_temperature(time, celsius))
    for lines, own in zip(found, expected, strict=True):
        np.testing.assert_allclose(lines, own, rtol=0, atol=1e-11)  # rounding of numbers of ten
