"""Numbers of a thermometer that are no degrees Celsius are noticed, and where nothing shows it, asked about."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.thermal.coverage import check_unit
from tumble.errors import ObservabilityError
from tumble.protocol import named_protocol

FRIDGE, SWEEP = np.linspace(4.0, 22.0, 500), np.linspace(-20.0, 60.0, 500)


def fahrenheit(celsius: np.ndarray) -> np.ndarray:
    return 1.8 * celsius + 32.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (FRIDGE + 273.15, "kelvins, as it looks: add K to the --units"),
        (SWEEP + 273.15, "kelvins, as it looks"),
        ((SWEEP - 36.53) * 340.0, "raw counts"),
        (SWEEP * 10.0, "raw counts"),
        (fahrenheit(SWEEP), r"as °F it would be -19\.\d to 59\.\d °C"),
        (fahrenheit(FRIDGE), "never comes near that of a room"),
    ],
)
def test_another_scale_is_refused_with_the_option_that_says_it(values: np.ndarray, said: str) -> None:
    with pytest.raises(ObservabilityError, match=said):
        check_unit(values, None)


@pytest.mark.parametrize(("name", "values"), [("thermal-fridge", FRIDGE), ("thermal-ramp", SWEEP)])
def test_a_protocol_shows_degrees_fahrenheit(name: str, values: np.ndarray) -> None:
    protocol = named_protocol(name)
    assert check_unit(values, None, protocol) == []
    with pytest.raises(ObservabilityError, match="that fits if the column is in °F"):
        check_unit(fahrenheit(values), None, protocol)


def test_usual_tests_in_celsius_pass_without_a_word() -> None:
    for values in (FRIDGE, SWEEP, np.linspace(20.0, 45.0, 100), np.linspace(-40.0, 85.0, 100)):
        assert check_unit(values, None) == []


def test_what_is_usual_on_both_scales_is_told_and_a_said_unit_is_believed() -> None:
    values = np.linspace(0.0, 75.0, 100)
    assert "in °F it would be -17.7 to 23.8 °C" in check_unit(values, None)[0]
    for hot in (values, np.linspace(40.0, 110.0, 100)):
        assert check_unit(hot, "degC") == []
