"""The thesis' simulation played again: the same seed the same numbers, geometry and noise as it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.earth.site import EARTH_RATE
from tumble.errors import UsageError
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble_papers.hayal.norm_batch import (
    ATTITUDES,
    FORCE_NOISE,
    GRAVITY,
    LATITUDE,
    SAMPLES,
    Setting,
    run_setting,
    simulate_means,
    simulate_true,
    table_setting,
)


def rng(*seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(list(seed)))


def test_the_same_seed_gives_the_same_runs_bit_for_bit() -> None:
    setting = table_setting("4.4", 2)
    first, second = run_setting(setting, 20, rng(3)), run_setting(setting, 20, rng(3))
    for name in ("parameters", "sigmas", "differences", "sigma0", "iterations"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    assert not np.array_equal(first.differences, run_setting(setting, 20, rng(4)).differences)


def test_the_means_are_the_true_vectors_through_the_errors_of_table_4_1() -> None:
    setting = replace(table_setting("4.5", 2), noise=0.0)
    true, means = simulate_true(setting, 3, rng(6)), simulate_means(setting, 3, rng(6))
    matrix = np.real(matrix_from_shin(np.full(3, 1.0003), np.full(3, 1e-4)))
    for run in range(3):
        for k in range(ATTITUDES):
            np.testing.assert_allclose(means[run, k], matrix @ true[run, k] + 0.01, rtol=1e-14)


def test_faces_edges_and_corners_point_up_within_a_few_degrees() -> None:
    """Specific force is up; two angles off by 2° each, none of 2,600 beyond some 9°."""
    force = simulate_true(table_setting("4.5", 2), 100, rng(7))
    np.testing.assert_allclose(np.linalg.norm(force, axis=2), GRAVITY, rtol=1e-14)
    cosine = np.einsum("rka,ka->rk", force / GRAVITY, twenty_six_directions())
    off = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    assert off.max() < 10.0
    # rms of two angles of 2° (one where the pose is steep): between 2 and 2.9
    assert 2.0 < np.sqrt(np.mean(off**2)) < 2.0 * np.sqrt(2.0) * 1.05


def test_the_gyros_see_the_earth_s_rate_at_its_angle_to_the_vertical() -> None:
    """The Earth's rate points up by the sine of the latitude, whatever the heading."""
    up = simulate_true(table_setting("4.5", 2), 50, rng(8)) / GRAVITY
    rate = simulate_true(table_setting("4.4", 2), 50, rng(8))
    np.testing.assert_allclose(np.linalg.norm(rate, axis=2), EARTH_RATE, rtol=1e-13)
    np.testing.assert_allclose(np.sum(up * rate, axis=2), EARTH_RATE * np.sin(LATITUDE), rtol=1e-12)


def test_more_than_26_attitudes_are_all_of_them_again() -> None:
    setting = Setting("accelerometer", 9, attitudes=60)
    force = simulate_true(setting, 2, rng(9)) / GRAVITY
    assert force.shape == (2, 60, 3)
    nominal = np.tile(twenty_six_directions(), (3, 1))[:60]
    assert np.all(np.einsum("rka,ka->rk", force, nominal) > np.cos(np.radians(10.0)))


@pytest.mark.parametrize(("table", "case"), [("4.5", 3), ("4.6", 1), ("4.2", 4)])
def test_columns_that_the_thesis_has_not_are_refused(table: str, case: int) -> None:
    with pytest.raises(UsageError, match=f"no case {case} in table {table}"):
        table_setting(table, case)


def test_the_cases_are_the_thesis() -> None:
    assert table_setting("4.2", 1) == Setting("gyro", 3, noise=0.0)
    assert table_setting("4.3", 2) == Setting("gyro", 6)
    assert table_setting("4.4", 3).reference == pytest.approx(
        7.292115e-1, rel=1e-6
    )  # rad/s, 10⁴ × the Earth's
    assert table_setting("4.5", 2).reference == 9.801


def test_every_sample_is_drawn_and_averaged() -> None:
    """The means are those of numpy's own numbers from the same generator, sample by sample."""
    setting = table_setting("4.5", 2)
    means = simulate_means(setting, 2, rng(12))
    again = rng(12)
    quiet = simulate_means(replace(setting, noise=0.0), 2, again)  # draws the attitudes, and no more
    samples = FORCE_NOISE * again.standard_normal((2, ATTITUDES, 3, SAMPLES))
    # round-off of sums of 180, beside g
    np.testing.assert_allclose(means, quiet + samples.mean(axis=-1), rtol=0, atol=1e-14)
