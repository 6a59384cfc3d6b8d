"""Degrees of freedom against exact sums and against the published algorithm's own special cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tumble.noise.freedom import chi_square_interval, degrees_of_freedom


def exact_for_white(m: int, samples: int) -> float:
    """2 E[V]²/var V for white noise, from the covariance of the overlapping differences itself."""
    # Differences of sums of m samples: a filter on white samples.
    filter_ = np.convolve([1.0] + [0.0] * (m - 1) + [-1.0], np.ones(m))
    count = samples - filter_.size + 1
    covariance = np.correlate(filter_, filter_, mode="full")[filter_.size - 1 :]
    lags = np.arange(min(count, filter_.size))
    share = (covariance[lags] / covariance[0]) ** 2
    return count / (1.0 + 2.0 * float(np.sum((1.0 - lags / count)[1:] * share[1:])))


@pytest.mark.parametrize(
    ("m", "samples"), [(1, 1000), (10, 1000), (100, 1000), (300, 1000), (64, 20_000), (700, 9000)]
)
def test_white_noise_has_the_degrees_of_freedom_of_its_exact_covariance(m: int, samples: int) -> None:
    """Within 1 %: beyond some hundred terms the sum is an integral, taken at 256 places."""
    assert degrees_of_freedom(0, m, samples) == pytest.approx(exact_for_white(m, samples), rel=0.01)


@pytest.mark.parametrize("exponent", [2, 0, -1, -2])
def test_one_difference_has_one_degree_of_freedom(exponent: int) -> None:
    assert degrees_of_freedom(exponent, 40, 80) == 1.0
    assert degrees_of_freedom(exponent, 40, 79) == 0.0


@pytest.mark.parametrize("exponent", [2, 0, -1, -2])
def test_degrees_of_freedom_never_jump_where_the_sum_becomes_an_integral(exponent: int) -> None:
    """Fourteen times as many averaging times as samples in one: what changes between them is smooth."""
    found = [degrees_of_freedom(exponent, m, 200 * m) / (1 + 198 * m) * m for m in range(60, 110)]
    scaled = np.array(found) if exponent != 2 else np.array(found) / np.arange(60, 110)
    assert np.max(np.abs(np.diff(scaled) / scaled[1:])) < 0.02


def test_differences_begun_less_often_lose_next_to_nothing() -> None:
    every = degrees_of_freedom(0, 4096, 400_000)
    assert degrees_of_freedom(0, 4096, 400_000, 128) == pytest.approx(every, rel=1e-3)


def test_noise_that_second_differences_cannot_tame_is_refused() -> None:
    with pytest.raises(ValueError, match="exponent -3"):
        degrees_of_freedom(-3, 10, 1000)


def test_the_interval_is_that_of_chi_square() -> None:
    edf = np.array([1.0, 8.5, 3000.0])
    low, high = chi_square_interval(np.full(3, 2.0), edf, 0.9)
    assert low == pytest.approx(2.0 * edf / chi2.ppf(0.95, edf), rel=1e-10)
    assert high == pytest.approx(2.0 * edf / chi2.ppf(0.05, edf), rel=1e-10)


def test_without_degrees_of_freedom_nothing_is_known() -> None:
    low, high = chi_square_interval(np.array([2.0]), np.array([0.0]), 0.9)
    assert (low[0], high[0]) == (0.0, np.inf)
