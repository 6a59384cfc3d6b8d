"""The filter of the level: the same as a Kalman filter of all states, and what it says of itself is so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.signal import lfilter

from tumble.noise.denoising.autoregression import Autoregression
from tumble.noise.denoising.level_filter import LevelFilter, fit_level_filter

TRUE = Autoregression(0.0, np.array([0.6, -0.2]), 1.0, 1)


def drawn(count: int, step: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A walking level, and it with noise."""
    rng = np.random.default_rng(seed)
    level = np.cumsum(step * rng.standard_normal(count)) + 7.0
    noise = lfilter([1.0], [1.0, -0.6, 0.2], rng.standard_normal(count + 100))[100:]
    return level, level + noise


def kalman_level(signal: np.ndarray, noise: Autoregression, walk: float) -> np.ndarray:
    """The level by the textbook filter of the level and all states of the noise."""
    system = noise.discrete(1.0)
    Phi, Q = block_diag(1.0, system.Phi), block_diag(walk, system.Q)
    H = np.concatenate([[1.0], system.H])
    x, P = np.concatenate([[signal[0]], np.zeros(noise.order)]), block_diag(1e6, system.start)
    result = np.empty(signal.size)
    for k, sample in enumerate(signal):
        K = P @ H / (H @ P @ H + 1e-12)
        x = x + K * (sample - H @ x)
        P = P - np.outer(K, H @ P)
        result[k] = x[0]
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
    return result


def test_it_is_the_kalman_filter_of_all_states() -> None:
    _, seen = drawn(4000, 0.02, 1)
    found = LevelFilter(TRUE, 0.03)
    exact = kalman_level(seen, TRUE, found.level_walk)
    # The walk within two samples, 3 % of a level's scatter, is what the short form neglects.
    off = (found.follow(seen, [(0, 4000)]) - exact)[200:]
    assert off.std() < 0.03 * (exact - 7.0)[200:].std()


def test_the_gain_is_that_of_the_walk() -> None:
    """Muth: g²/(1 − g) = walk/white; 20,000 samples know the gain to some 10 %."""
    step = 0.03
    level, seen = drawn(40_000, step, 2)
    found = fit_level_filter(seen, [(0, 40_000)], 256)
    assert found.noise.order == 2
    ratio = step**2 * 0.6**2
    expected = 0.5 * (-ratio + np.sqrt(ratio**2 + 4.0 * ratio))
    assert found.gain == pytest.approx(expected, rel=0.3)
    followed = found.follow(seen, [(0, 40_000)])
    assert (followed - level)[500:].std() < 0.25 * (seen - level).std()


def test_a_constant_stays_and_a_ramp_lags_by_the_delay() -> None:
    found = LevelFilter(TRUE, 0.05)
    assert found.follow(np.full(500, 3.25), [(0, 500)]) == pytest.approx(3.25, abs=1e-12)
    ramp = 0.1 * np.arange(2000.0)
    followed = found.follow(ramp, [(0, 2000)])
    assert (ramp - followed)[-1] / 0.1 == pytest.approx(found.delay, rel=1e-6)


def test_the_bandwidth_is_where_half_of_a_sine_is_left() -> None:
    found = LevelFilter(TRUE, 0.05)
    frequency = found.bandwidth()
    sine = np.sin(2.0 * np.pi * frequency * np.arange(20_000))
    followed = found.follow(sine, [(0, 20_000)])[2000:]
    assert np.sqrt(2.0) * followed.std() == pytest.approx(0.5, rel=0.01)
    assert found.response(np.array([1e-9]))[0] == pytest.approx(1.0, abs=1e-6)


def test_each_piece_begins_anew_and_nothing_outside_changes() -> None:
    _, seen = drawn(3000, 0.0, 3)
    seen[1500:] += 50.0
    followed = LevelFilter(TRUE, 0.01).follow(seen, [(0, 1500), (1600, 3000)])
    assert followed[1500:1600] == pytest.approx(seen[1500:1600], abs=0.0)
    assert abs(followed[2999] - 57.0) < 1.0
    assert abs(followed[1499] - 7.0) < 1.0
