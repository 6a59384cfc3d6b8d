"""Noise against the formulas of IEEE Std 952."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.simulation import TriadNoise, convert_to_digital, poses_26, simulate_noise


def allan_variance(signal: np.ndarray, length: int) -> float:
    """Non-overlapping, over all columns."""
    means = signal[: len(signal) // length * length].reshape(-1, length, signal.shape[1]).mean(axis=1)
    return float(0.5 * np.mean(np.diff(means, axis=0) ** 2))


def test_white_noise_has_the_variance_of_its_density_times_the_rate() -> None:
    signal = simulate_noise(TriadNoise(random_walk=0.02), 100_000, 400.0, np.random.default_rng(31))
    # 300,000 numbers: 0.26 % standard deviation, four of them
    assert np.var(signal) == pytest.approx(0.02**2 * 400.0, rel=0.011)


def test_flicker_has_its_allan_floor() -> None:
    signal = simulate_noise(TriadNoise(bias_instability=0.5), 1_000_000, 100.0, np.random.default_rng(32))
    for length in (100, 1000, 10_000):
        # the floor is 2 ln 2 / π B²; the longest has 300 differences (8 %), the ripple is 2 %
        floor = 2.0 * np.log(2.0) / np.pi * 0.5**2
        assert allan_variance(signal, length) == pytest.approx(floor, rel=0.3)


def test_a_rate_random_walk_spreads_with_the_square_root_of_time() -> None:
    noise = TriadNoise(rate_random_walk=0.3)
    ends = [simulate_noise(noise, 200, 10.0, np.random.default_rng(k))[-1] for k in range(400)]
    # variance K² t after 20 s from 1200 numbers: 4 %, four of them
    assert np.var(ends) == pytest.approx(0.3**2 * 20.0, rel=0.17)


def test_a_converter_rounds_and_stops() -> None:
    digital = convert_to_digital(
        np.array([[0.24, -0.26, 9.0], [0.76, -9.0, 0.0]]), TriadNoise(resolution=0.5, full_scale=2.0)
    )
    np.testing.assert_array_equal(digital, [[0.0, -0.5, 2.0], [1.0, -2.0, 0.0]])


def test_the_26_poses_point_up_along_faces_edges_and_corners() -> None:
    directions = twenty_six_directions()
    up_b = poses_26(0.3).inv().apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(up_b, directions, atol=1e-14)
    assert [int(np.count_nonzero(np.abs(d) > 0.1)) for d in directions] == [1] * 6 + [2] * 12 + [3] * 8
