"""The closed forms of a noise model agree with one another and with sums over samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from tumble.noise.flicker import flicker_corners, flicker_variance
from tumble.noise.terms import GaussMarkov, Line, NoiseModel
from tumble.noise.variances import LETTERS, allan_variance_of, markov_allan_variance

ALL = NoiseModel(2e-4, 0.03, 0.02, 0.005, 0.001, (GaussMarkov(0.04, 3.0),), (Line(0.05, 0.7),))
TAU = np.array([0.02, 0.1, 1.0, 7.0, 60.0, 900.0])


def test_the_five_terms_are_those_of_ieee_std_952() -> None:
    """The table of IEEE Std 952, annex C, by hand for τ = 4 s and coefficients of 3."""
    four = np.array([4.0])
    expected = {"Q": 3 * 9 / 16, "N": 9 / 4, "B": 9 * 2 * np.log(2) / np.pi, "K": 9 * 4 / 3, "R": 9 * 16 / 2}
    for letter, value in expected.items():
        assert NoiseModel.from_coefficients({letter: 3.0}).allan_variance(four)[0] == pytest.approx(value)


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(random_walk=0.3),
        NoiseModel(bias_instability=0.3),
        NoiseModel(rate_random_walk=0.3),
        NoiseModel(gauss_markov=(GaussMarkov(0.4, 2.5),)),
    ],
)
def test_allan_variance_and_spectrum_are_one_another_s(model: NoiseModel) -> None:
    """σ²(τ) = 4 ∫ S(f) sin⁴(πfτ)/(πfτ)² df over positive f of the two-sided density (IEEE Std 952, C.2)."""
    for tau in (0.5, 4.0):

        def integrand(log_x: float, tau: float = tau) -> float:
            f = np.exp(log_x) / (np.pi * tau)
            density = model.power_spectrum(np.array([f]), 1e9)[0]
            return 4.0 * density * np.sin(np.exp(log_x)) ** 4 / np.exp(log_x) ** 2 * f

        low, _ = quad(integrand, -25.0, 2.0, limit=400)
        # above x = e²: sin⁴ averages to 3/8 within the tail's 5 %, by fine sums instead
        x = np.arange(np.exp(2.0), 3000.0, 0.02) + 0.01
        f = x / (np.pi * tau)
        high = np.sum(4.0 * model.power_spectrum(f, 1e9) * np.sin(x) ** 4 / x**2) * 0.02 / (np.pi * tau)
        # cut at x = 3000: 3/8 · 4 S / (π τ) / 3000, a 5000th of white noise's, less of others'
        assert low + high == pytest.approx(model.allan_variance(np.array([tau]))[0], rel=3e-4)


def test_the_sampled_processes_have_the_allan_variance_of_their_covariance() -> None:
    """Against the quadratic form of the second difference of block means, number by number."""
    rate, m = 20.0, 7
    contrast = np.concatenate([-np.ones(m), np.ones(m)]) / m / np.sqrt(2.0)
    i = np.arange(2 * m)
    lag = np.abs(i[:, None] - i)
    tau = np.array([m / rate])
    for time in (0.01, 0.4, 30.0, 1e5):
        covariance = np.exp(-lag / (rate * time))
        # at 1e5 s the sum itself loses seven digits
        assert markov_allan_variance(tau, time, rate)[0] == pytest.approx(
            contrast @ covariance @ contrast, rel=1e-6
        )
    walk = np.minimum(i[:, None], i) / rate
    assert allan_variance_of("K", tau, rate)[0] == pytest.approx(contrast @ walk @ contrast, rel=1e-12)
    sine = 0.5 * np.cos(2 * np.pi * 3.1 * lag / rate)
    line = NoiseModel(lines=(Line(1.0, 3.1),))
    assert line.allan_variance(tau, rate)[0] == pytest.approx(contrast @ sine @ contrast, rel=1e-10)


@pytest.mark.parametrize("x", [1e-3, 0.05])
def test_the_branches_of_a_formula_meet(x: float) -> None:
    """Either side of where a series takes over: relative jumps no larger than the slope times the step."""
    for rate in (None, 50.0):
        time = 2.0 / x
        m = np.round(np.array([0.995, 1.005]) * 2.0 * 50.0)
        values = markov_allan_variance(m / 50.0, time * 1.0, rate)
        assert values[1] / values[0] == pytest.approx(m[1] / m[0], rel=1e-3)


def test_sampled_and_averaging_sensors_agree_over_long_times() -> None:
    """The difference falls as the square of the samples in τ: 1e-4 at a hundred; flicker of a sampled sensor 0.2 %."""
    tau = np.array([2.0, 50.0])
    for letter in LETTERS:
        np.testing.assert_allclose(
            allan_variance_of(letter, tau, 50.0), allan_variance_of(letter, tau), rtol=3e-3
        )


def test_allan_variance_is_a_contrast_of_the_phase_s_covariance() -> None:
    """σ² = (6 s(0) − 8 s(τ) + 2 s(2τ)) / (2 τ²), all terms but the ramp."""
    model = NoiseModel(2e-4, 0.03, 0.02, 0.005, 0.0, ALL.gauss_markov, ALL.lines)
    s = model.phase_covariance
    phase = (6.0 * s(0.0 * TAU) - 8.0 * s(TAU) + 2.0 * s(2.0 * TAU)) / (2.0 * TAU**2)
    np.testing.assert_allclose(phase, model.allan_variance(TAU), rtol=1e-7)


def test_terms_add_up_and_scale() -> None:
    parts = [part for _, part in ALL.allan_terms(TAU)]
    assert len(parts) == 7
    np.testing.assert_allclose(np.sum(parts, axis=0), ALL.allan_variance(TAU), rtol=1e-14)
    np.testing.assert_allclose(ALL.scaled(3.0).allan_variance(TAU), 9.0 * ALL.allan_variance(TAU), rtol=1e-13)


# --- means of holds


def test_the_mean_s_variance_anywhere_in_the_span_is_that_of_tiles() -> None:
    """Tiling the span with holds, the full covariance averages to the formula without places, term by term.

    Only what is taken against the span's mean tiles; N and Q have theirs in full.
    """
    span, count = 120.0, 12
    seconds = np.full(count, span / count)
    starts = np.arange(count) * span / count
    for model in (
        NoiseModel(random_walk=0.3),
        NoiseModel(quantisation=0.3),
        NoiseModel(bias_instability=0.3),
        NoiseModel(rate_random_walk=0.3),
        NoiseModel(ramp=0.3),
        NoiseModel(gauss_markov=(GaussMarkov(0.3, 15.0),)),
        NoiseModel(lines=(Line(0.3, 0.013),)),
    ):
        full = np.diag(model.mean_covariance(seconds, span, starts)).mean()
        assert full == pytest.approx(model.mean_covariance(seconds, span)[0, 0], rel=1e-9)


def test_means_of_white_noise_and_flicker_are_the_known_formulas() -> None:
    seconds = np.array([5.0, 20.0])
    white, flicker = NoiseModel(random_walk=0.3), NoiseModel(bias_instability=0.2)
    np.testing.assert_allclose(np.diag(white.mean_covariance(seconds, 900.0)), 0.09 / seconds)
    np.testing.assert_allclose(
        np.diag(flicker.mean_covariance(seconds, 900.0)), 0.04 / np.pi * np.log(900.0 / seconds)
    )


def test_the_covariance_of_means_is_that_of_simulated_holds() -> None:
    """3000 sequences with all terms; each element's z below 4.5 (21 elements: a false alarm in 7,000)."""
    rng = np.random.default_rng(3)
    rate, samples = 10.0, 600
    first = np.array([0, 40, 150, 300, 450, 550])
    length = np.array([30, 50, 30, 100, 60, 50])
    model = NoiseModel(0.02, 0.05, 0.1, 0.04, 0.01, (GaussMarkov(0.1, 5.0),), (Line(0.2, 0.03),))
    off = np.empty((3000, 6))
    for k in range(len(off)):
        signal = model.simulate(samples, rate, rng)
        # white noise and lines of the span's mean belong to the difference too: hardly anything here
        means = np.array([signal[a : a + n].mean() for a, n in zip(first, length, strict=True)])
        off[k] = means - signal.mean()
    expected = model.mean_covariance(length / rate, samples / rate, first / rate)
    still = NoiseModel(0.02, 0.05, lines=model.lines)
    ends = np.append(first / rate, 0.0), np.append(length / rate, samples / rate)
    both = still.mean_covariance(ends[1], samples / rate, ends[0])
    less = np.column_stack([np.eye(6), -np.ones(6)])
    expected += less @ both @ less.T - both[:6, :6]
    products = off[:, :, None] * off[:, None, :]
    z = (products.mean(axis=0) - expected) / (products.std(axis=0) / np.sqrt(len(off)))
    assert np.max(np.abs(z)) < 4.5


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        # its floor is believed from 2.3 sigma on and grows from nothing: 35 %
        (NoiseModel(random_walk=0.005, bias_instability=0.02), 0.35),
        (NoiseModel(random_walk=0.02, gauss_markov=(GaussMarkov(0.01, 0.05),)), 0.2),
    ],
)
def test_wandering_means_are_found_by_segmentation_too(model: NoiseModel, tolerance: float) -> None:
    from tumble.segmentation.averages import mean_covariance

    rng = np.random.default_rng(6)
    rate, samples, hold = 50.0, 60_000, 500
    items = [[(a, a + hold)] for a in range(0, samples, hold)]
    found = []
    for _ in range(5):
        signal = np.column_stack([model.simulate(samples, rate, rng) for _ in range(3)])
        found.append(mean_covariance(signal, items).covariance[:, [0, 1, 2], [0, 1, 2]].mean())
    expected = model.mean_covariance(np.array([hold / rate]), samples / rate)[0, 0]
    assert np.mean(found) == pytest.approx(expected, rel=tolerance)


def test_the_ladder_of_flicker_is_as_accurate_as_said() -> None:
    """Its Allan variance about 0.664² B², well inside the ladder."""
    tau = np.geomspace(1.0, 100.0, 40)
    sums = sum(markov_allan_variance(tau, 0.5 / (np.pi * f)) for f in flicker_corners(1e7, 1e5))
    np.testing.assert_allclose(flicker_variance() * sums, 2.0 * np.log(2.0) / np.pi, rtol=0.001)


def test_the_same_state_gives_the_same_sequence() -> None:
    first, second = (ALL.simulate(500, 20.0, np.random.default_rng(1)) for _ in range(2))
    assert first.tobytes() == second.tobytes()
