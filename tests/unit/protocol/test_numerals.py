"""Numbers as text: no digit is lost in degrees, and what people write is what is meant."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml

from tumble.protocol.keys import numeral_of, value_of

DEGREE, PPM = math.pi / 180.0, 1e-6


@pytest.mark.parametrize(
    ("text", "factor", "value"),
    [
        ("90", DEGREE, math.pi / 2.0),
        ("-0.5", DEGREE, -0.5 * DEGREE),
        ("1.5e-3", 1.0, 0.0015),
        ("+7", 1.0, 7.0),
        (".5", 1.0, 0.5),
        ("1e400", 1.0, math.inf),
    ],
)
def test_a_text_means_the_nearest_number_times_its_unit(text: str, factor: float, value: float) -> None:
    assert value_of(text, factor) == value


def test_numbers_that_no_seventeen_digits_mean_have_more_and_are_rounded_once() -> None:
    """Degrees to radians skips one number in eleven: rounding twice, as the last line shows, loses it."""
    radians = np.random.default_rng(2).uniform(0.5, 1.0, 2_000).tolist()
    skipped = [(r, numeral_of(r, DEGREE)) for r in radians if len(numeral_of(r, DEGREE)) > 18]
    assert 100 < len(skipped) < 300
    assert all(value_of(text, DEGREE) == r for r, text in skipped)
    assert all(float(text) * DEGREE != r for r, text in skipped)


@pytest.mark.parametrize("text", ["", "x", "30 s", "0x10", "1:30", "--1"])
def test_a_text_that_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        value_of(text)


@pytest.mark.parametrize(
    ("value", "factor", "text"),
    [
        (math.pi / 2.0, DEGREE, "90"),
        (0.5 * DEGREE, DEGREE, "0.5"),
        (math.radians(41.78), DEGREE, "41.78"),
        (30 * PPM, PPM, "30"),
        (30.0, 1.0, "30"),
        (0.0, 1.0, "0"),
        (-0.0, 1.0, "-0.0"),
        (1e-5, 1.0, "1.0e-05"),
        (math.inf, 1.0, "inf"),
        (math.nan, DEGREE, "nan"),
    ],
)
def test_a_number_is_written_as_a_person_would(value: float, factor: float, text: str) -> None:
    assert numeral_of(value, factor) == text


def test_ten_thousand_numbers_of_all_sizes_come_back_and_are_numbers_to_yaml() -> None:
    rng = np.random.default_rng(1)
    numbers = rng.uniform(-7.0, 7.0, 10_000) * 10.0 ** rng.integers(-8, 5, 10_000)
    for factor in (1.0, DEGREE, 2.0 * math.pi, PPM):
        texts = [numeral_of(number, factor) for number in numbers.tolist()]
        assert [value_of(text, factor) for text in texts] == numbers.tolist()
        assert max(map(len, texts)) <= 28
    assert all(isinstance(yaml.safe_load(numeral_of(n, DEGREE)), int | float) for n in numbers[:300].tolist())
