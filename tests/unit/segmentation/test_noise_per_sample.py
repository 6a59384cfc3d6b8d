"""The noise of one sample at rest: what was drawn, whatever the rate, knocks, drift and motion beside the holds."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.segmentation.activity import noise_per_sample
from tumble.segmentation.timeline import Hold

SIGMA = np.array([1.0, 2.0, 5.0])


@pytest.mark.parametrize("samples", [150, 740, 4000])
def test_it_is_that_of_white_noise(samples: int) -> None:
    """Twenty-six holds; their 26 to 1040 pieces of a hundred samples tell it to 2.5 % at worst, of which three."""
    rng = np.random.default_rng(5)
    signal = SIGMA * rng.normal(size=(26 * samples, 3))
    holds = [Hold(samples * k, samples * (k + 1)) for k in range(26)]
    np.testing.assert_allclose(noise_per_sample(signal, holds), SIGMA, rtol=0.075)


def test_the_median_of_its_pieces_is_their_mean() -> None:
    """Of 20 000 pieces: to 0.1 %, where the median of a hundred samples' scatter is 0.5 % below its mean."""
    signal = SIGMA * np.random.default_rng(6).normal(size=(2_000_000, 3))
    np.testing.assert_allclose(noise_per_sample(signal, [Hold(0, len(signal))]), SIGMA, rtol=2e-3)


def test_turns_knocks_and_drift_are_no_noise() -> None:
    rng = np.random.default_rng(7)
    signal = SIGMA * rng.normal(size=(6000, 3)) + np.linspace(0.0, 100.0, 6000)[:, None]
    plain = noise_per_sample(signal, [Hold(0, 3000), Hold(3000, 6000)])
    signal[1000:1020] += 500.0 * rng.normal(size=(20, 3))
    signal[2900:3100] += 1e4 * np.sin(np.arange(200.0))[:, None]
    holds = [Hold(0, 2900, excluded=((100, 130),)), Hold(3100, 6000)]
    np.testing.assert_allclose(noise_per_sample(signal, holds), plain, rtol=0.05)


def test_short_holds_count_as_they_are() -> None:
    """Forty holds of 30 samples each: a fifth a piece, 4 % together."""
    signal = SIGMA * np.random.default_rng(8).normal(size=(1200, 3))
    holds = [Hold(30 * k, 30 * (k + 1)) for k in range(40)]
    np.testing.assert_allclose(noise_per_sample(signal, holds), SIGMA, rtol=0.12)
