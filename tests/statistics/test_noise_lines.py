"""Lines are found where they are, and not where they are not; vibration does not pass for noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tumble.noise.deviation import allan_deviation
from tumble.noise.fitting.fit import fit_curve
from tumble.noise.fitting.weighted_fit import Method
from tumble.noise.lines import LINE_FALSE_ALARM, find_lines
from tumble.noise.terms import GaussMarkov, Line, NoiseModel

RATE, SAMPLES = 10.0, 2**13


def test_noise_without_lines_seldom_shows_one() -> None:
    """60 series: 3.3 standard deviations above a share of 1 % are 5 %."""
    rng = np.random.default_rng(4)
    model = NoiseModel(0.02, 0.05, 0.05, 0.05, gauss_markov=(GaussMarkov(0.1, 2.0),))
    found = sum(bool(find_lines(model.simulate(SAMPLES, RATE, rng), RATE)) for _ in range(60))
    assert found / 60 <= LINE_FALSE_ALARM + 3.3 * np.sqrt(LINE_FALSE_ALARM / 60)


def test_a_lines_stated_uncertainty_is_its_scatter() -> None:
    """40 series know a standard deviation to 11 %; amplitudes of 3 and frequencies to 3.3 of that."""
    rng = np.random.default_rng(6)
    model = NoiseModel(random_walk=0.05, lines=(Line(0.08, 1.37),))
    lines = [find_lines(model.simulate(SAMPLES, RATE, rng), RATE)[0] for _ in range(40)]
    amplitude = [(line.amplitude - 0.08) / line.amplitude_sigma for line in lines]
    frequency = [(line.frequency - 1.37) / line.frequency_sigma for line in lines]
    assert np.std(amplitude) == pytest.approx(1.0, abs=0.37)
    assert np.std(frequency) == pytest.approx(1.0, abs=0.37)


@pytest.mark.parametrize("method", ["curve", "moments"])
def test_vibration_does_not_pass_for_noise(method: Method) -> None:
    """N is known to 1 % of 8192 samples: five of these; without the lines it is off by far."""
    rng = np.random.default_rng(7)
    model = NoiseModel(random_walk=0.05, lines=(Line(2.0, 2.73),))
    signal = model.simulate(SAMPLES, RATE, rng)
    curve = allan_deviation(signal, RATE)
    fit = fit_curve(curve, method=method, lines=find_lines(signal, RATE))
    assert fit.model.random_walk == pytest.approx(0.05, rel=0.05)
    assert fit.probability > 0.001
    assert fit_curve(curve, method=method, gauss_markov=0).probability < 0.001


def test_a_line_that_wanders_has_the_power_of_its_whole_band() -> None:
    """Its frequency wanders by 0.03 Hz within 5 s: at the finest resolution, 0.0008 Hz, it is in splinters."""
    rng = np.random.default_rng(8)
    kept = np.exp(-1.0 / 500.0)
    off = lfilter([0.03 * np.sqrt(1.0 - kept**2)], [1.0, -kept], rng.standard_normal(2**17))
    signal = 0.3 * np.sin(2.0 * np.pi * np.cumsum(12.3 + off) / 100.0) + rng.standard_normal(2**17)
    [line] = find_lines(signal, 100.0)
    assert line.amplitude == pytest.approx(0.3, abs=4.0 * line.amplitude_sigma)
    assert line.amplitude_sigma < 0.02
    assert line.frequency == pytest.approx(12.3, abs=4.0 * line.frequency_sigma)
    assert 0.03 < line.resolution < 0.2


def test_a_weak_steady_line_is_known_as_well_as_a_sine_can_be() -> None:
    """Cramér-Rao (Rife and Boorstyn): 12 σ² / ((2πA)² T² n) · 2; the window makes it 1.39 times as large."""
    rng = np.random.default_rng(9)
    model = NoiseModel(random_walk=0.05, lines=(Line(0.05, 1.37),))
    line = find_lines(model.simulate(2**15, RATE, rng), RATE)[0]
    sigma = 0.05 * np.sqrt(RATE)
    bound = np.sqrt(6.0 / 2**15) * sigma / (np.pi * 0.05 * 2**15 / RATE)
    # the level around is known to a tenth, the amplitude to some percent
    assert line.frequency_sigma == pytest.approx(1.39 * bound, rel=0.15)
    assert line.amplitude_sigma == pytest.approx(np.sqrt(1.5 * 2.0 / 2**15) * sigma, rel=0.12)
