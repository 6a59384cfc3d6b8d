"""How biases wander, from rests of which the noise is known."""

from __future__ import annotations

import numpy as np
import pytest

from second_simulator.sensors import flicker
from tumble.recording import Recording
from tumble.segmentation.rest_wander import SPREAD, USUAL, RestParts, find_density, observe_parts
from tumble.segmentation.timeline import Hold, NoiseFloor, Timeline

RATE, WHITE, INSTABILITY = 50.0, 4e-3, 4e-3


def parts(instability: float, seed: int, *, holds: int = 24, seconds: float = 20.0) -> RestParts:
    """Rests of `seconds` every 25 s; three sensors of white noise and of 1/f noise."""
    rng = np.random.default_rng(seed)
    every, own = round(25 * RATE), round(seconds * RATE)
    count = holds * every
    signal = WHITE * np.sqrt(RATE) * rng.standard_normal((count, 3))
    if instability:
        signal += flicker(count, RATE, instability, rng)
    recording = Recording(np.arange(count) / RATE, None, signal, "m/s^2", "rad/s", RATE)
    timeline = Timeline(
        tuple(Hold(k * every, k * every + own) for k in range(holds)),
        (),
        (),
        NoiseFloor(np.ones(3), np.ones(3), 1.0, "as simulated"),
    )
    return observe_parts(recording, timeline)


def found(own: RestParts, **options: np.ndarray) -> float:
    return float(np.mean(find_density(own, own.rate, own.rate_white, **options)))


def test_the_white_noise_is_that_of_short_times() -> None:
    assert np.sqrt(parts(0.0, 1).rate_white) == pytest.approx(np.full(3, WHITE), rel=0.1)


def test_the_density_of_flicker_is_found_from_what_all_rests_show() -> None:
    """IEEE Std 952: B² / (2 pi f) two-sided has B² / pi per unit of ln f."""
    design = np.ones((24, 1))
    every = [found(parts(INSTABILITY, seed), design=design) for seed in range(6)]
    assert np.exp(np.mean(np.log(every))) == pytest.approx(INSTABILITY**2 / np.pi, rel=0.35)


def test_what_rests_show_along_some_direction_each_tells_it_too() -> None:
    """Of three axes that wander apart, two rests along gravity show as much in common as their directions have."""
    up = np.random.default_rng(8).normal(size=(24, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    every: list[float] = []
    for seed in range(6):
        own = parts(INSTABILITY, seed)
        assert own.rate is not None
        along = np.sum(up[own.hold] * own.rate, axis=1, keepdims=True)
        white = np.mean(own.rate_white, keepdims=True)
        made = find_density(own, along, white, holds=np.arange(24), design=up, alike=up @ up.T)
        every.append(float(made[0]))
    assert np.exp(np.mean(np.log(every))) == pytest.approx(INSTABILITY**2 / np.pi, rel=0.35)


def test_white_noise_has_little_of_it() -> None:
    every = [found(parts(0.0, seed), design=np.ones((24, 1))) for seed in range(4)]
    assert np.mean(every) < 0.4 * USUAL * WHITE**2


def test_what_few_rests_leave_open_is_what_sheets_give() -> None:
    own = parts(0.0, 3, holds=2, seconds=4.0)
    assert 0.3 * USUAL * WHITE**2 < found(own) < 2.0 * USUAL * WHITE**2


def test_a_rest_that_was_knocked_does_not_make_it_wander() -> None:
    own = parts(0.0, 4)
    assert own.rate is not None
    knocked = own.rate.copy()
    knocked[4 * 7] += 100 * WHITE
    moved = float(np.mean(find_density(own, knocked, own.rate_white)))
    assert moved < 1.5 * found(own)


def test_where_few_rests_leave_it_open_the_density_is_right_on_average_as_a_variance_has_to_be() -> None:
    """Units as data sheets give them, six rests: true over stated has the mean 1, and had 1.4."""
    ratio: list[float] = []
    for seed in range(160):
        true = USUAL * np.exp(SPREAD * np.random.default_rng(seed).standard_normal())
        own = parts(WHITE * float(np.sqrt(np.pi * true)), 1000 + seed, holds=6)
        ratio.append(true * WHITE**2 / found(own))
    # The ratio's standard deviation is about 1.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.2)
