"""The spectrum against scipy's, and against what it must add up to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import welch

from tumble.errors import UsageError
from tumble.noise.spectrum import power_spectrum


def white(samples: int, seed: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((samples, 2)) * [1.0, 7.0] + [3.0, -100.0]


@pytest.mark.parametrize("segment", [64, 1000, 1001])
def test_the_spectrum_is_scipys_but_for_zero(segment: int) -> None:
    signal = white(10_000)
    frequency, density = welch(signal, 40.0, "hann", segment, axis=0)
    found = power_spectrum(signal, 40.0, segment=segment)
    assert found.frequency == pytest.approx(frequency[1:], rel=1e-12)
    assert found.density == pytest.approx(density[1:], rel=1e-9)


def test_bins_keep_the_mean_density() -> None:
    found = power_spectrum(white(100_000), 40.0, bins_per_decade=10)
    assert np.all(np.diff(np.log10(found.frequency)) > 0.04)
    assert found.density[-5:-1, 1] == pytest.approx(49.0 / 20.0, rel=0.05)  # 800 degrees of freedom and more


def test_no_segment_lies_across_a_gap() -> None:
    signal = white(8000)
    signal[4000:] += 1e5
    found = power_spectrum(signal, 40.0, segment=500, gaps=[4000])
    assert found.segments == 2 * 15
    assert found.density[:, 0].mean() == pytest.approx(1.0 / 20.0, rel=0.1)


def test_a_segment_that_fits_nowhere_is_refused() -> None:
    with pytest.raises(UsageError, match="without a gap"):
        power_spectrum(white(100), 40.0, segment=80, gaps=[50])


def test_a_rate_of_zero_is_refused() -> None:
    with pytest.raises(UsageError, match="rate"):
        power_spectrum(white(100), 0.0)
