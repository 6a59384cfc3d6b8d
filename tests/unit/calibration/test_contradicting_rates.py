"""A rate of a table that is not what the protocol says is found among several."""

import numpy as np
import pytest

from tumble.calibration.equations.spin_readings import contradicting_rates

NOMINAL = np.radians(np.repeat([50.0, 100.0, 200.0], 6))
RATES = NOMINAL * np.tile([1.0, -1.0], 9)
NOISE = np.random.default_rng(3).normal(0.0, 2e-4, RATES.size)


@pytest.mark.parametrize(("size", "words"), [(50.0, "50"), (100.0, "100"), (200.0, "200")])
def test_one_rate_that_is_off_is_named(size: float, words: str) -> None:
    off = np.where(np.isclose(np.degrees(NOMINAL), size), 0.01, 0.0)
    fitted = np.average(off, weights=NOMINAL**2)
    said = contradicting_rates(RATES, (off - fitted) * RATES + NOISE)
    assert len(said) == 1
    assert f"The 6 spins at {words}°/s show +" in said[0]


def test_rates_that_are_right_or_all_off_alike_contradict_nothing() -> None:
    assert contradicting_rates(RATES, NOISE) == []
    assert contradicting_rates(RATES, 0.01 * RATES + NOISE) == []


def test_too_few_spins_at_a_rate_are_not_judged() -> None:
    few = [0, 1, 6, 7, 12, 13]
    assert contradicting_rates(RATES[few], 0.01 * np.abs(RATES[few])) == []
