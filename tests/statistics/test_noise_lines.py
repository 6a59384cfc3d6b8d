"""Lines are found where they are, and not where they are not; vibration does not pass for noise."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.noise.deviation import allan_deviation
from tumble.noise.fit import fit_curve, fit_moments_of
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


@pytest.mark.parametrize("fit_with", [fit_curve, fit_moments_of])
def test_vibration_does_not_pass_for_noise(fit_with: type) -> None:
    """N is known to 1 % of 8192 samples: five of these; without the lines it is off by far."""
    rng = np.random.default_rng(7)
    model = NoiseModel(random_walk=0.05, lines=(Line(2.0, 2.73),))
    signal = model.simulate(SAMPLES, RATE, rng)
    curve = allan_deviation(signal, RATE)
    fit = fit_with(curve, lines=find_lines(signal, RATE))
    assert fit.model.random_walk == pytest.approx(0.05, rel=0.05)
    assert fit.probability > 0.001
    assert fit_with(curve, gauss_markov=0).probability < 0.001
