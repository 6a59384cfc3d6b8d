"""A letter is not better known than the curve of its model is near the measured one."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.noise.advice import advise
from tumble.noise.channel import Channel, characterise_channel
from tumble.noise.deviation import allan_deviation
from tumble.noise.fitting.fit import MISSED

RATE = 50.0
SAMPLES = 360_000
TIME = np.arange(SAMPLES) / RATE


def characterised(signal: Series) -> tuple[Channel, tuple[str, ...]]:
    curve = allan_deviation(signal, RATE, taus="octave")
    channel = characterise_channel("ax", "m/s²", curve, curve, (), 0.0)
    return channel, advise((channel,), curve)


def test_a_walk_that_ends_is_not_stated_to_five_percent_where_the_curve_falls_below_it() -> None:
    # filtered noise, of a shape that the model has not, makes the weights sharp; the walk lasts a tenth
    rng = np.random.default_rng(5)
    white = np.convolve(rng.standard_normal(SAMPLES) * 7e-3, np.ones(25) / 25, "same")
    walk = np.cumsum(rng.standard_normal(SAMPLES)) * 1e-3 / np.sqrt(RATE)
    channel, said = characterised(white + np.where(TIME < 1000.0, walk, 0.0))
    term, fit = channel.term("K"), channel.fit
    assert term is not None
    assert fit is not None
    at_1000 = int(np.argmin(np.abs(fit.tau - 1000.0)))
    missed = float(np.sqrt(fit.expected[at_1000] / fit.variance[at_1000]))
    assert missed > 2.0
    assert fit.missed["K"] > MISSED
    assert term.sigma > np.log(MISSED) * term.value
    assert term.low < term.value / MISSED**2
    assert any("misses the measured curve" in text and "K" in text for text in said)


def test_white_noise_keeps_its_uncertainty_where_only_long_times_are_missed() -> None:
    rng = np.random.default_rng(4)
    signal = 1e-3 * np.sqrt(RATE) * rng.standard_normal(SAMPLES) + 0.01 * np.sin(2.0 * np.pi * TIME / 600.0)
    channel, _ = characterised(signal)
    white, process = channel.term("N"), channel.term("sigma")
    assert white is not None
    assert process is not None
    assert white.sigma < 0.1 * white.value
    assert process.sigma > process.value
