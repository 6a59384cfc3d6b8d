"""Intervals of deviations and of spectra hold what they say, over hundreds of simulated signals."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.noise.deviation import ONE_SIGMA, allan_deviation
from tumble.noise.spectrum import power_spectrum

RUNS, SAMPLES = 1500, 1024
# Standard deviations of a share or of a variance over the runs; four of them at some twenty averaging times
# give a false alarm in a thousand.
SIGMAS = 4.0


def signals(exponent: int) -> np.ndarray:
    white = np.random.default_rng(20).standard_normal((SAMPLES + 1, RUNS))
    if exponent == 2:
        return np.diff(white, axis=0)
    return white[1:] if exponent == 0 else np.cumsum(white, axis=0)[1:]


def true_deviation(exponent: int, m: np.ndarray) -> np.ndarray:
    """Allan deviation of discrete white noise, its differences and its sums, worked out by hand."""
    m = m.astype(float)
    if exponent == 2:
        return np.sqrt(3.0) / m
    # A mean of m steps of a walk: the difference of neighbours has the variance (2 m² + 1)/(3 m).
    return 1.0 / np.sqrt(m) if exponent == 0 else np.sqrt((2.0 * m**2 + 1.0) / (6.0 * m))


@pytest.mark.parametrize("exponent", [2, 0, -2])
def test_two_thirds_of_the_intervals_hold_the_true_deviation(exponent: int) -> None:
    found = allan_deviation(signals(exponent), 1.0, noise=exponent)
    truth = true_deviation(exponent, found.averaging)[:, None]
    held = np.mean((found.low < truth) & (truth < found.high), axis=1)
    spread = np.sqrt(ONE_SIGMA * (1.0 - ONE_SIGMA) / RUNS)
    # Greenhall and Riley state a few per cent for their degrees of freedom, a per cent of the coverage; and a sum
    # of squares is not chi square to the last: two per cent more.
    assert held == pytest.approx(ONE_SIGMA, abs=SIGMAS * spread + 0.03)


def test_the_scatter_of_white_noise_is_that_of_its_degrees_of_freedom() -> None:
    found = allan_deviation(signals(0), 1.0, noise=0)
    variance = found.deviation**2
    observed = 2.0 * variance.mean(axis=1) ** 2 / variance.var(axis=1)
    # A variance of a chi square of few degrees of freedom is itself uncertain: kurtosis 12/ν.
    spread = np.sqrt((2.0 + 12.0 / found.edf[:, 0]) / RUNS)
    assert np.all(np.abs(observed / found.edf[:, 0] - 1.0) < SIGMAS * spread + 0.01)


def test_the_kind_of_noise_that_is_found_gives_the_same_coverage_as_the_true_kind() -> None:
    found = allan_deviation(signals(0), 1.0)
    truth = true_deviation(0, found.averaging)[:, None]
    held = np.mean((found.low < truth) & (truth < found.high), axis=1)
    assert held == pytest.approx(ONE_SIGMA, abs=0.08)


@pytest.mark.parametrize("bins", [None, 8])
def test_intervals_of_the_spectrum_hold_the_true_density(bins: int | None) -> None:
    found = power_spectrum(signals(0), 1.0, segment=128, bins_per_decade=bins)
    held = np.mean((found.low < 2.0) & (found.high > 2.0), axis=1)
    # The lowest line has lost the mean, and at the Nyquist frequency one of two degrees of freedom is missing.
    inner = held[2:-1]
    spread = np.sqrt(ONE_SIGMA * (1.0 - ONE_SIGMA) / RUNS)
    assert inner == pytest.approx(ONE_SIGMA, abs=SIGMAS * spread + 0.04)
