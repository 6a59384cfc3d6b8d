"""Numbers are rounded by their uncertainty; every expected text is worked by hand (GUM 7.2.6)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tumble.parameters.measures import Measure, decimals_of, fixed, with_uncertainty


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        # GUM H.1.6: l = 50.000 838 mm, u = 32 nm.
        (50.000838, 0.000032, "50.000838 ± 0.000032"),
        (0.1025212, 0.00097, "0.10252 ± 0.00097"),
        # 0.0996 rounds to 0.10, not to 0.100.
        (1.23456, 0.0996, "1.23 ± 0.10"),
        (-3.5, 0.25, "-3.50 ± 0.25"),
        (12345.6, 678.0, "12350 ± 680"),
        # The value vanishes in its uncertainty without a sign.
        (-0.0001, 0.5, "0.00 ± 0.50"),
        (-1.2345e-7, 3.2e-9, "(-12.35 ± 0.32) × 10⁻⁸"),
        (2.5e8, 1.3e7, "(2.50 ± 0.13) × 10⁸"),
        (math.nan, 0.0312, "± 0.031"),
        (2.0, 0.0, "2 (no uncertainty)"),
        (2.0, math.nan, "2 (no uncertainty)"),
        (math.nan, math.nan, "not known"),
    ],
)
def test_two_digits_of_the_uncertainty_round_the_value(value: float, sigma: float, text: str) -> None:
    assert with_uncertainty(value, sigma) == text


@pytest.mark.parametrize(
    ("value", "sigma", "factor", "text"),
    [
        (1.0, 0.1, 2.0, "[0.80, 1.20]"),
        (-0.5, 0.26, 1.96, "[-1.01, 0.01]"),
        # The power of ten is that in which sigma reads 0.10 to 0.99.
        (-1.0e-7, 1.0e-8, 2.0, "[-1.20, -0.80] × 10⁻⁷"),
        (1.0, 0.0, 2.0, ""),
    ],
)
def test_interval_has_the_decimals_of_the_uncertainty(
    value: float, sigma: float, factor: float, text: str
) -> None:
    assert Measure(value, sigma, "").interval(factor) == text


@given(st.floats(1e-12, 1e12), st.floats(-1e3, 1e3))
def test_rounding_moves_a_value_by_less_than_a_tenth_of_its_uncertainty(sigma: float, ratio: float) -> None:
    """Two digits are at least 10, so that half a unit of the last is at most a twentieth of sigma."""
    value = ratio * sigma
    shown = float(fixed(value, decimals_of(sigma)))
    # The last digit of sigma is worth at most sigma / 9.95, and arithmetic adds nothing near it.
    assert abs(shown - value) <= 0.5 * sigma / 9.9


def test_a_sigma_of_zero_has_no_digits() -> None:
    with pytest.raises(ValueError, match="has no digits"):
        decimals_of(0.0)
