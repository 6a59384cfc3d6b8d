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


def test_white_noise_has_twice_its_two_sided_density() -> None:
    """Variance 49 at 40 Hz: one-sided 2.45 per Hz; 20,000 lines' mean is known to a per cent."""
    found = power_spectrum(white(200_000), 40.0)
    assert found.density[:, 1].mean() == pytest.approx(49.0 / 20.0, rel=0.02)


def test_a_line_has_the_power_of_its_amplitude() -> None:
    """A sine of amplitude 3 has the variance 4.5, all of it about its frequency."""
    time = np.arange(40_000) / 100.0
    signal = 3.0 * np.sin(2.0 * np.pi * 17.3 * time)
    found = power_spectrum(signal, 100.0)
    near = np.abs(found.frequency - 17.3) < 3.0 * found.resolution
    step = found.frequency[1] - found.frequency[0]
    assert step * found.density[near].sum() == pytest.approx(4.5, rel=1e-3)


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
