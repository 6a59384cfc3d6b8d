"""Means of holds and the covariance of those means."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import SegmentationError
from tumble.recording.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, mean_covariance, observe_holds

SIGMA = np.array([0.5, 1.0, 3.0])


def equal_items(count: int, length: int) -> list[list[tuple[int, int]]]:
    return [[(k * length, (k + 1) * length)] for k in range(count)]


def test_means_leave_out_what_is_excluded() -> None:
    signal = np.arange(300.0).reshape(100, 3)
    signal[40:45] = 1e6
    timeline = Timeline((Hold(10, 90, ((40, 45),)),), (), (), NoiseFloor(np.ones(3), np.ones(3), 1.0, ""))
    recording = Recording(np.arange(100) / 10.0, signal, None, "m/s^2", "rad/s", 10.0, np.full(100, 21.5))
    means = observe_holds(recording, timeline)
    kept = [*range(10, 40), *range(45, 90)]
    assert means.specific_force is not None
    assert means.temperature is not None
    # summed in another order: some units in the last place of 300
    np.testing.assert_allclose(means.specific_force[0], signal[kept].mean(axis=0), rtol=1e-13)
    assert means.angular_rate is None
    assert means.count[0] == 75
    assert means.duration[0] == 7.5
    assert means.time[0] == pytest.approx(0.5 * (1.0 + 8.9))
    assert means.temperature[0] == 21.5


def test_white_noise_gives_the_variance_over_the_number_of_samples() -> None:
    signal = SIGMA * np.random.default_rng(11).standard_normal((40 * 500, 3))
    observed = mean_covariance(signal, equal_items(40, 500))
    variance = np.median(np.diagonal(observed.covariance, axis1=1, axis2=2), axis=0)
    # the pool has some 40 x 14 degrees of freedom: 6 % standard deviation, four of them allowed
    np.testing.assert_allclose(variance, SIGMA**2 / 500, rtol=0.25)


def test_correlated_noise_is_seen_by_the_batches() -> None:
    rng = np.random.default_rng(12)
    white = rng.standard_normal((60 * 800 + 20, 3))
    signal = np.stack([np.convolve(white[:, k], np.ones(10), "valid")[: 60 * 800] for k in range(3)], axis=1)
    observed = mean_covariance(signal, equal_items(60, 800))
    variance = np.median(np.diagonal(observed.covariance, axis1=1, axis2=2))
    # a moving sum of ten: long-run variance 100, while s²/n would say 10; batches of 50 to 100 samples
    # see 87 % or more of it, the pool's spread is 5 %
    assert 0.75 * 100 / 800 < variance < 1.2 * 100 / 800


def test_a_noisier_item_keeps_its_own_variance_and_spoils_no_other() -> None:
    rng = np.random.default_rng(13)
    signal = rng.standard_normal((30 * 400, 3))
    signal[7 * 400 : 8 * 400, 1] += np.linspace(-8.0, 8.0, 400)
    observed = mean_covariance(signal, equal_items(30, 400))
    variance = np.diagonal(observed.covariance, axis1=1, axis2=2)
    assert variance[7, 1] > 20 * np.median(variance[:, 1])
    others = np.delete(variance, 7, axis=0)
    # within the pool's spread of 7 %, three of them
    np.testing.assert_allclose(np.median(others, axis=0), 1 / 400, rtol=0.25)


def test_means_over_their_sigma_are_standard_normal() -> None:
    """200 items of white noise: the mean square of 600 normalised means lies within 99.9 % limits."""
    signal = SIGMA * np.random.default_rng(14).standard_normal((200 * 300, 3))
    observed = mean_covariance(signal, equal_items(200, 300))
    z = observed.mean / np.sqrt(np.diagonal(observed.covariance, axis1=1, axis2=2))
    # chi-square of 600: standard deviation of z² mean is sqrt(2/600) = 0.058; 3.3 of them
    assert abs(np.mean(z**2) - 1.0) < 0.19


def test_items_of_different_length_share_one_level() -> None:
    signal = np.random.default_rng(15).standard_normal((10_000, 3))
    items = [[(0, 4000)], [(4000, 4400)], [(4400, 4800)], [(4800, 8000)], [(8000, 8200), (8300, 10_000)]]
    observed = mean_covariance(signal, items)
    lengths = np.array([sum(b - a for a, b in item) for item in items])
    level = np.diagonal(observed.covariance, axis1=1, axis2=2) * lengths[:, None]
    # few batches: the level is known to 25 % for the longest, which have the longest batches
    assert np.all((level > 0.35) & (level < 2.5))


def test_no_hold_and_a_hold_of_one_sample_are_refused() -> None:
    recording = Recording(np.arange(9.0), np.zeros((9, 3)), None, "m/s^2", "rad/s", 1.0)
    empty = Timeline((), (), (), NoiseFloor(np.ones(3), np.ones(3), 1.0, ""))
    with pytest.raises(SegmentationError, match="no holds"):
        observe_holds(recording, empty)
    with pytest.raises(SegmentationError, match="fewer than two samples"):
        mean_covariance(np.zeros((9, 3)), [[(3, 4)]])
