"""Noise against the formulas of IEEE Std 952."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.attitude.directions import twenty_six_directions
from tumble.errors import UsageError
from tumble.simulation import (
    GRADES,
    TriadNoise,
    convert_to_digital,
    find_grade,
    poses_26,
    simulate_hand_poses,
    simulate_noise,
)


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


def test_a_grade_draws_units_of_its_spread() -> None:
    grade = find_grade("consumer-mems")
    rng = np.random.default_rng(34)
    models = [grade.simulate_model(rng) for _ in range(300)]
    biases = np.array([m.gyroscope.bias for m in models if m.gyroscope is not None])
    # 900 numbers: 2.4 %, four of them
    assert np.std(biases) == pytest.approx(np.radians(20.0) / 3.0, rel=0.1)


def test_the_noise_of_a_grade_is_its_data_sheet_s() -> None:
    """HG1700: 0.125 deg/√h is 0.125 deg after one hour."""
    gyro = GRADES["tactical"].gyroscope.noise
    assert gyro.random_walk * np.sqrt(3600.0) == pytest.approx(np.radians(0.125), rel=1e-12)


def test_an_unknown_grade_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(
        UsageError,
        match="'best'; choose one of consumer-mems, industrial-mems, hg1900, hg1700, tactical, ring-laser",
    ):
        find_grade("best")


def test_the_26_poses_point_up_along_faces_edges_and_corners() -> None:
    directions = twenty_six_directions()
    up_b = poses_26(0.3).inv().apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(up_b, directions, atol=1e-14)
    assert [int(np.count_nonzero(np.abs(d) > 0.1)) for d in directions] == [1] * 6 + [2] * 12 + [3] * 8


def test_hand_poses_differ_from_one_to_the_next() -> None:
    up_b = simulate_hand_poses(np.random.default_rng(35), 40).inv().apply([0.0, 0.0, -1.0])
    angles = np.arccos(np.sum(up_b[1:] * up_b[:-1], axis=1))
    assert angles.min() >= 0.5
