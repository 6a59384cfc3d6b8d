"""What a short recording does not tell apart is said, and what a long one tells is not doubted."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.noise.deviation import allan_deviation
from tumble.noise.fitting.fit import NoiseFit, fit_curve
from tumble.noise.terms import NoiseModel

WALKS = NoiseModel(random_walk=0.01, rate_random_walk=8e-4)


def fit(model: NoiseModel, minutes: float, rate: float, seed: int) -> NoiseFit:
    signal = model.simulate(round(60.0 * minutes * rate), rate, np.random.default_rng(seed))
    return fit_curve(allan_deviation(signal, rate, taus="octave"))


def test_ten_minutes_that_read_a_walk_as_flicker_say_that_it_may_be_a_walk() -> None:
    found = fit(WALKS, 10.0, 100.0, 0)
    assert found.chosen == ("N", "B")  # wrong, and not known better
    assert any(text.startswith("B may really be K") for text in found.remarks)


def test_four_hours_tell_the_same_walk_from_flicker() -> None:
    found = fit(WALKS, 240.0, 10.0, 0)
    assert found.chosen == ("N", "K")
    assert found.missed == {}
    assert not any("may be" in text for text in found.remarks)


def test_white_noise_alone_has_no_stand_in() -> None:
    assert not fit(NoiseModel(random_walk=0.01), 10.0, 100.0, 1).remarks


@pytest.mark.filterwarnings("error")
def test_a_ramp_alone_is_fitted_without_dividing_by_its_spread_of_nothing() -> None:
    curve = allan_deviation(1e-3 * np.arange(6000) / 10.0, 10.0, taus="octave")
    found = fit_curve(curve)
    (ramp,) = found.terms
    assert ramp.value == pytest.approx(1e-3, rel=1e-6)
    assert np.isfinite([ramp.low, ramp.high]).all()
    assert np.isfinite(found.covariance).all()
