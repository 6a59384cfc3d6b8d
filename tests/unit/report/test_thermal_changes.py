"""What a terminal shows of a thermal calibration: changes of biases, and not their dozens of coefficients."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from tumble.document.thermal_block import ThermalBlock, thermal_block
from tumble.parameters.family import TEMPERATURE
from tumble.report.parameters import parameter_rows
from tumble.report.summary import thermal_changes, thermal_lines
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel


def calibration() -> Any:
    model = ThermalModel(
        ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3))),
        TemperatureBasis("polynomial", 20.0, order=2),
        {"accelerometer.bias": np.array([[2e-3, -1e-3, 3e-3], [1e-5, 0.0, 0.0]])},
        span_celsius=(0.0, 60.0),
    )
    covariance = np.zeros((6, 6))
    covariance[0, 0], covariance[3, 3], covariance[0, 3], covariance[3, 0] = 1e-8, 1e-12, -5e-11, -5e-11
    block: ThermalBlock = thermal_block(model, model.names, covariance)

    def parameter(name: str, value: float, unit: str) -> SimpleNamespace:
        return SimpleNamespace(
            name=name, value=value, standard_uncertainty=0.1, unit=unit, coverage_factor=None
        )

    parameters = [
        parameter("thermal accelerometer bias by ΔT x", 2e-3, "m/s^2/K"),
        parameter("thermal lag of the sensors behind the thermometer", 34.0, "s"),
    ]
    raw = SimpleNamespace(specific_force="m/s^2", angular_rate="rad/s")
    return cast("Any", SimpleNamespace(thermal=block, parameters=parameters, raw_units=raw))


def test_changes_carry_the_correlations_of_their_coefficients() -> None:
    table = thermal_changes(calibration(), width=80)
    assert table is not None
    columns = list(zip(*table.rows, strict=True))
    assert list(table.heads) == ["change from 20 °C", "0 °C", "30 °C", "60 °C"]
    # 40 K: 80 + 16 mm/s², variance (1600 e-8 + 2 * 64000 * -5e-11 + 2.56e6 e-12) = 0.0000122. In mg over 9.80665.
    assert columns[3][0] == "9.79 ± 0.36"
    assert columns[0] == ("acc. x / mg", "acc. y / mg", "acc. z / mg")


def test_lag_is_in_seconds_and_the_coefficients_are_counted() -> None:
    lines = thermal_lines(calibration())
    assert lines[0] == "Lag of the sensors behind the thermometer: 34.00 ± 0.10 s."
    assert lines[1].startswith("1 coefficient of temperature with")
    assert {row.group for row in parameter_rows(calibration())} == {TEMPERATURE}
