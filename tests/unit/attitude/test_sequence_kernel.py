"""The attitude that a rotation sequence's gyros carry, against scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude.kernels import transform_sequence

STEP = 0.02
EARTH = np.array([4.1e-5, -2.3e-5, 5.5e-5])


def carried(
    rate: np.ndarray,
    force: np.ndarray,
    earth: np.ndarray,
    windows: tuple[tuple[np.ndarray, int], tuple[np.ndarray, int]],
) -> tuple[np.ndarray, np.ndarray]:
    averages, C = np.full((2, 3), np.nan), np.full((3, 3), np.nan)
    (first, at), (last, then) = windows
    transform_sequence(rate, force, STEP, earth, first, at, last, then, averages, C)
    return averages, C


def by_scipy(
    rate: np.ndarray,
    force: np.ndarray,
    earth: np.ndarray,
    windows: tuple[tuple[np.ndarray, int], tuple[np.ndarray, int]],
) -> tuple[np.ndarray, np.ndarray]:
    """The same sample by sample; the frame of the start has turned by the Earth until each one's middle."""
    averages, attitude = np.zeros((2, 3)), Rotation.identity()
    for k in range(len(rate)):
        attitude *= Rotation.from_rotvec(rate[k] * STEP)
        back = Rotation.from_rotvec(-earth * (k + 0.5) * STEP)
        for number, (weights, start) in enumerate(windows):
            if start <= k < start + len(weights):
                averages[number] += weights[k - start] * (back * attitude).apply(force[k])
    return averages, attitude.as_matrix()


def rates(kind: str) -> np.ndarray:
    time = np.arange(600)[:, None] * STEP
    if kind == "still":
        return np.zeros((600, 3))
    if kind == "constant":
        return np.tile([0.7, -1.1, 0.4], (600, 1))
    if kind == "fast":  # beyond the series: 0.5 rad a sample and more
        return np.tile([31.0, -20.0, 12.0], (600, 1))
    return np.column_stack(
        [np.sin(1.3 * time), 2.0 * np.cos(0.7 * time) - 0.4, np.where(time > 6.0, 3.0, -1.0) * np.sin(time)]
    )


@pytest.mark.parametrize("kind", ["still", "constant", "changing", "fast"])
def test_attitude_and_averages_are_those_of_scipy(kind: str) -> None:
    """600 products of unit quaternions round by 1e-13 at most, and forces are of 10 m/s²."""
    rng = np.random.default_rng(1)
    rate, force = rates(kind), rng.normal(0.0, 6.0, (600, 3))
    windows = ((rng.uniform(0.0, 0.02, 100), 3), (rng.uniform(0.0, 0.02, 50), 550))
    found, expected = carried(rate, force, EARTH, windows), by_scipy(rate, force, EARTH, windows)
    np.testing.assert_allclose(found[1], expected[1], rtol=0, atol=1e-12)
    # the Earth's turn is a series to the fourth power of 1e-3
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-11)


def test_over_minutes_the_earth_s_turn_is_still_exact() -> None:
    """Ten minutes of rest: 44 mrad, whose fifth power over 120 the series leaves out: 1.4e-8 of 10 m/s²."""
    count = 30_000
    rate = np.tile(EARTH, (count, 1))
    force = np.tile([2.0, -3.0, 9.0], (count, 1))
    averages, _ = carried(rate, force, EARTH, ((np.ones(1), 0), (np.ones(1), count - 1)))
    # Both are half a sample behind by the same half sample of the Earth's turn.
    late = 0.5 * STEP * np.cross(EARTH, force[0])
    np.testing.assert_allclose(averages, np.array([force[0] + late] * 2), rtol=0, atol=2e-8)
