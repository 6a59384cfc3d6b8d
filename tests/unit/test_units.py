"""Factors of units against numbers worked out by hand from their definitions."""

from __future__ import annotations

from math import pi

import pytest

from tumble.errors import UsageError
from tumble.units import (
    angle_increment_factor,
    angular_rate_factor,
    find_unit,
    known_units,
    specific_force_factor,
    time_factor,
    velocity_increment_factor,
)

ROUNDING = 1e-15  # relative: one or two roundings of a double


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("m/s^2", 1.0),
        ("m/s²", 1.0),
        ("M/S2", 1.0),
        ("m s^-2", 1.0),
        ("g", 9.80665),
        ("mg", 0.00980665),
        ("milli-g", 0.00980665),
        ("Gal", 0.01),
        ("cm/s^2", 0.01),
    ],
)
def test_a_unit_of_specific_force_has_its_defined_factor(name: str, factor: float) -> None:
    assert specific_force_factor(name) == pytest.approx(factor, rel=ROUNDING)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("rad/s", 1.0),
        ("rad s^-1", 1.0),
        ("deg/s", pi / 180),
        ("°/s", pi / 180),
        ("DPS", pi / 180),
        ("mdeg/s", pi / 180_000),
        ("deg/h", pi / 648_000),
        ("rpm", pi / 30),
    ],
)
def test_a_unit_of_angular_rate_has_its_defined_factor(name: str, factor: float) -> None:
    assert angular_rate_factor(name) == pytest.approx(factor, rel=ROUNDING)


@pytest.mark.parametrize(
    ("name", "factor"), [("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("us", 1e-6), ("NS", 1e-9)]
)
def test_a_unit_of_time_has_its_defined_factor(name: str, factor: float) -> None:
    assert time_factor(name) == factor


def test_increments_have_units_of_velocity_and_angle() -> None:
    assert velocity_increment_factor("m/s") == 1.0
    assert angle_increment_factor("arcsec") == pytest.approx(pi / 648_000, rel=ROUNDING)


def test_counts_have_no_factor() -> None:
    assert specific_force_factor("counts") is None
    assert angular_rate_factor("LSB") is None


@pytest.mark.parametrize(
    "factor",
    [
        specific_force_factor,
        angular_rate_factor,
        time_factor,
        velocity_increment_factor,
        angle_increment_factor,
    ],
)
def test_an_unknown_unit_is_refused_with_the_known_ones(factor: object) -> None:
    with pytest.raises(UsageError, match=r"'furlong' is not a known unit of .*; known are"):
        factor("furlong")  # type: ignore[operator]


def test_every_known_name_is_found_as_itself() -> None:
    for kind in ("specific force", "angular rate", "time", "velocity increment", "angle increment"):
        assert [find_unit(kind, name) for name in known_units(kind)] == list(known_units(kind))
