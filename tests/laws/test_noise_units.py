"""Units of noise: what is converted to another unit and back is what it was, and factors are those by hand."""

from __future__ import annotations

from math import pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tumble.errors import UsageError
from tumble.noise.units import (
    ACCELEROMETER,
    GYRO,
    coefficient_in,
    find_noise_unit,
    known_noise_units,
    random_walk_of,
    sample_sigma,
)

QUANTITY = st.sampled_from([GYRO, ACCELEROMETER])
VALUE = st.floats(1e-12, 1e12)


@given(QUANTITY, st.sampled_from("QNBKR"), VALUE, st.data())
def test_there_and_back_is_where_it_began(
    quantity: str, letter: str, value: float, data: st.DataObject
) -> None:
    units = st.sampled_from([unit.name for unit in known_noise_units(quantity, letter)])
    first, second = data.draw(units), data.draw(units)
    back = coefficient_in(coefficient_in(value, first, second), second, first)
    assert back == pytest.approx(value, rel=1e-14)  # four roundings


@given(VALUE, st.floats(1e-3, 1e6))
def test_a_sample_s_sigma_and_back(value: float, rate: float) -> None:
    assert random_walk_of(sample_sigma(value, rate), rate) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("value", "unit", "other", "expected"),
    [
        (0.15, "deg/√h", "deg/s/√Hz", 0.15 / 60),
        (9.0, "deg/h/√Hz", "deg/√h", 0.15),
        (1.0, "deg/s/√Hz", "rad/s/√Hz", pi / 180),
        (1.0, "m/s/√h", "m/s^2/√Hz", 1 / 60),
        (100.0, "µg/√Hz", "m/s^2/sqrt(Hz)", 100e-6 * 9.80665),
        (60.0, "µg/√Hz", "m/s/√h", 60e-6 * 9.80665 * 60),
        (1.0, "mg", "m/s^2", 9.80665e-3),
        (2.5, "°/hr", "rad/s", 2.5 * pi / 180 / 3600),
        (3.0, "rad/s^2/√Hz", "rad/s/√s", 3.0),
        (3.0, "deg/h/√h", "deg/h/√s", 3.0 / 60),
        (sqrt(12.0), "arcsec", "rad", sqrt(12.0) * pi / 648_000),
    ],
)
def test_conversions_by_hand(value: float, unit: str, other: str, expected: float) -> None:
    assert coefficient_in(value, unit, other) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("name", ["deg/√h", "deg/sqrt(h)", "°/√hr", "DEG/rtHr", "deg / root hour"])
def test_spellings_of_one_unit(name: str) -> None:
    found = find_noise_unit(name)
    assert found is not None
    assert (found.name, found.letters, found.quantity) == ("deg/rth", "N", GYRO)


def test_a_bias_instability_is_no_random_walk() -> None:
    with pytest.raises(UsageError, match="one does not follow from the other"):
        coefficient_in(1.0, "deg/h", "deg/√h")
    with pytest.raises(UsageError, match="not a unit"):
        coefficient_in(1.0, "deg/h", "bananas")
