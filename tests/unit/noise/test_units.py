"""Units of noise: factors are those by hand."""

from __future__ import annotations

from math import pi

import pytest

from tumble.noise.units import ACCELEROMETER, GYRO, practical_noise_unit, si_noise_unit


@pytest.mark.parametrize(
    ("quantity", "letter", "sign", "factor"),
    [
        (GYRO, "Q", "″", pi / 648_000),
        (GYRO, "N", "°/√h", pi / 180 / 60),
        (GYRO, "B", "°/h", pi / 180 / 3600),
        (GYRO, "K", "°/h/√h", pi / 180 / 3600 / 60),
        (GYRO, "R", "°/h/h", pi / 180 / 3600**2),
        (ACCELEROMETER, "Q", "mm/s", 1e-3),
        (ACCELEROMETER, "N", "µg/√Hz", 9.80665e-6),
        (ACCELEROMETER, "B", "µg", 9.80665e-6),
        (ACCELEROMETER, "K", "µg/√h", 9.80665e-6 / 60),
        (ACCELEROMETER, "R", "µg/h", 9.80665e-6 / 3600),
    ],
)
def test_units_of_data_sheets_by_hand(quantity: str, letter: str, sign: str, factor: float) -> None:
    unit = practical_noise_unit(quantity, letter)
    assert unit.sign == sign
    assert unit.factor == pytest.approx(factor, rel=1e-14)
    assert si_noise_unit(quantity, letter).factor == 1.0
