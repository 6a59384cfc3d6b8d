"""How much white noise a rest's mean has, beside flicker that neighbouring rests have in common."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.thermal.points import white_variance
from tumble.simulation.noise import TriadNoise, simulate_noise

RATE = 5.0


def rests(white: float, flicker: float) -> list[np.ndarray]:
    drawn = simulate_noise(TriadNoise(white, flicker), 60_000, RATE, np.random.default_rng(2))
    return [part - part.mean(axis=0) for part in np.split(drawn, 100)]


@pytest.mark.parametrize("flicker", [0.0, 1.5])
def test_flicker_inside_the_rests_is_not_taken_for_white_noise(flicker: float) -> None:
    # A gyro's white noise and flicker are alike at one second: batches of ten seconds show five times the white noise.
    # 60 000 samples tell it to a few per cent beside flicker.
    np.testing.assert_allclose(white_variance(rests(1.0, flicker)), RATE, rtol=0.12)
