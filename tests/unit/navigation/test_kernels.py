"""The compiled step: what it carries from one sample to the next is what it would work out afresh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumble.navigation.kernels import integrate
from tumble.navigation.trajectory import NavigationState


def test_sine_and_cosine_turned_from_nearby_stay_exact_over_hours(as_python: Callable[[str], Any]) -> None:
    sine_and_cosine = as_python("tumble.navigation.kernels").sine_and_cosine
    rng = np.random.default_rng(1)
    # four hours at 1 Hz, northward and back at up to 300 m/s, across the equator
    rate = 4.7e-5 * np.sin(2.0 * np.pi * np.arange(14_400) / 14_400.0) + 1e-6 * rng.standard_normal(14_400)
    latitudes = -0.1 + np.cumsum(rate)
    place, found, moved = [1e9, 0.0, 0.0], np.empty((14_400, 2)), 0
    for i, latitude in enumerate(latitudes.tolist()):
        before = place[0]
        sine_and_cosine(latitude, place, found[i])
        moved += place[0] != before
    # two roundings of numbers up to one, and the series' 7e-17
    assert found[:, 0] == pytest.approx(np.sin(latitudes), rel=0.0, abs=4e-16)
    assert found[:, 1] == pytest.approx(np.cos(latitudes), rel=0.0, abs=4e-16)
    # most were turned, not worked out
    assert 170 < moved < 7000


@pytest.mark.parametrize("means", [False, True])
def test_the_filter_s_step_is_the_mechanisation_s(means: bool, as_python: Callable[[str], Any]) -> None:
    advance = as_python("tumble.navigation.kernels").advance
    rng = np.random.default_rng(2)
    rate, force = 0.2 * rng.standard_normal((400, 3)), rng.normal([0.3, 1.0, -9.0], 1.0, (400, 3))
    time = np.cumsum(rng.uniform(0.005, 0.02, 400))
    start = NavigationState.from_angles(
        0.0, (0.8, -2.0, 300.0), np.array([200.0, -30.0, 4.0]), np.array([0.3, -0.4, 2.0])
    )
    outputs = np.empty((400, 3)), np.empty((400, 3)), np.empty((400, 4))
    integrate(time, rate, force, means, 1, start.packed, *outputs)
    nav, both = start.packed, np.hstack([rate, force])
    for i in range(1, 400):
        before, after = both[i - 1], both[i]
        if means:
            share = (time[i] - time[i - 1]) / (time[i] - time[max(i - 2, 0)]) if i > 1 else 0.0
            half = share * (both[i] - both[i - 1])
            before, after = both[i] - half, both[i] + half
        advance(nav, before, after, time[i] - time[i - 1])
    # rounding over 400 steps, of radians, of metres per second, and of a quaternion
    assert nav[:2] == pytest.approx(outputs[0][-1, :2], abs=1e-14)
    assert nav[3:6] == pytest.approx(outputs[1][-1], abs=1e-11)
    assert nav[6:] == pytest.approx(outputs[2][-1], abs=1e-13)
