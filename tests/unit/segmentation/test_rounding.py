"""What rounding leaves in means, against samples that are rounded."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.segmentation.averages import mean_covariance
from tumble.segmentation.rounding import (
    carries_remainder,
    converter_step,
    integral_variance,
    rounding_variance,
)

STEP = np.array([0.4, 3.0, 0.07])


def rests(
    noise: float, places: np.ndarray, rng: np.random.Generator, samples: int = 400
) -> tuple[np.ndarray, list[list[tuple[int, int]]], np.ndarray]:
    """Rounded samples of rests at true values `places` (rests, 3), all in steps; their ranges and their means."""
    true = np.repeat(places, samples, axis=0) + noise * rng.standard_normal((len(places) * samples, 3))
    # What comes before shows the step.
    moving = rng.uniform(-40.0, 40.0, (100, 3))
    signal = np.rint(np.concatenate([moving, true])) * STEP
    ranges = [[(100 + k * samples, 100 + (k + 1) * samples)] for k in range(len(places))]
    return signal, ranges, signal[100:].reshape(len(places), samples, 3).mean(axis=1)


def test_a_step_is_found_and_numbers_without_one_have_none() -> None:
    fine = np.random.default_rng(3).standard_normal((500, 3))
    np.testing.assert_array_equal(converter_step(fine), np.zeros(3))
    np.testing.assert_allclose(converter_step(np.round(4.0 * fine) * STEP), STEP)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.4])
def test_the_variance_is_that_of_what_means_are_off(noise: float) -> None:
    """Rests at other places each: the mean square of what their means are off, but for the noise of 400 samples."""
    rng = np.random.default_rng(int(100 * noise))
    off, stated = np.zeros(3), np.zeros(3)
    for _ in range(40):
        # 12 rests that are far from one another, so that no two show the same number.
        places = 7.0 * np.arange(12)[:, None] + rng.uniform(-0.5, 0.5, (12, 3))
        signal, ranges, means = rests(noise, places, rng)
        off += (np.mean((means / STEP - places) ** 2, axis=0) - (noise**2 + 1.0 / 12.0) / 400.0) / 40.0
        stated += np.mean(rounding_variance(signal, ranges, means) / STEP**2, axis=0) / 40.0
    assert np.all(stated > 0.7 * off - 5e-4)
    assert np.all(stated < 2.0 * off + 1e-3)


def test_rests_that_show_the_same_number_know_no_more_than_one() -> None:
    rng = np.random.default_rng(1)
    errors, sigmas = list[np.ndarray](), list[np.ndarray]()
    for _ in range(60):
        place = rng.uniform(-0.5, 0.5, 3)
        signal, ranges, _ = rests(rng.uniform(0.0, 0.4), np.tile(place, (9, 1)), rng)
        found = mean_covariance(signal, ranges)
        weight = 1.0 / np.diagonal(found.covariance, axis1=1, axis2=2)
        errors.append(np.sum(weight * found.mean, axis=0) / weight.sum(axis=0) / STEP - place)
        sigmas.append(1.0 / np.sqrt(weight.sum(axis=0)) / STEP)
    z = np.array(errors) / np.array(sigmas)
    assert np.max(np.abs(z)) < 4.0
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.25


def test_noise_of_more_than_a_step_dithers() -> None:
    rng = np.random.default_rng(2)
    signal, ranges, means = rests(0.9, rng.uniform(-0.5, 0.5, (5, 3)), rng)
    np.testing.assert_array_equal(rounding_variance(signal, ranges, means), np.zeros((5, 3)))


def test_decimals_that_were_cut_off_leave_a_step_and_rests_without_noise_have_none() -> None:
    rng = np.random.default_rng(4)
    counts = rng.integers(-300, 300, (3000, 3))
    np.testing.assert_allclose(
        converter_step(np.round(counts * 0.06103515625, 3)), np.full(3, 0.061035), rtol=2e-3
    )
    still = np.repeat(rng.standard_normal((40, 3)), 50, axis=0)
    np.testing.assert_array_equal(converter_step(still), np.zeros(3))


def test_an_integral_over_a_tables_ramp_is_off_by_what_one_number_hides_and_by_late_stamps() -> None:
    """From rest to a rate: along the axis steps pass, across it one number stays; stamps matter where it changes."""
    rng, samples, runs = np.random.default_rng(5), 120, 400
    ramp = np.clip(np.arange(samples) / 60.0, 0.0, 1.0)[:, None] * np.array([0.05, 40.0, -0.1])
    off, stated = np.zeros(3), np.zeros(3)
    for _ in range(runs):
        true = ramp + rng.uniform(-0.5, 0.5, 3) + 0.03 * rng.standard_normal((samples, 3))
        signal = np.rint(true) * STEP
        off += np.sum(signal - true * STEP, axis=0) ** 2 / runs
        stated += integral_variance(signal, np.array([[0, samples]]), STEP**2 / 12.0, 0.0)[0] / runs
    # Of one number the whole run is off alike; steps that pass average out.
    np.testing.assert_allclose(np.sqrt(stated / off), 1.0, atol=0.15)
    late = integral_variance(ramp, np.array([[0, samples], [-1, 5]]), np.zeros(3), 0.01)
    np.testing.assert_allclose(late[0], 1e-4 * 59.25 * (ramp[-1] / 60.0) ** 2, rtol=1e-9)
    np.testing.assert_array_equal(late[1], np.zeros(3))


@pytest.mark.parametrize("own", [0.0, 0.3])
def test_pulses_of_an_integral_are_told_from_samples_that_are_rounded_each(own: float) -> None:
    """Their remainder is carried on. Noise that makes up for itself, too, is rounded each sample in the other."""
    rng = np.random.default_rng(5)
    shown = np.array([3.07, -1.4, 0.31]) + own * np.diff(rng.standard_normal((2001, 3)), axis=0)
    rests = [[(k * 200, (k + 1) * 200)] for k in range(10)]
    pulses = np.diff(np.floor(np.cumsum(np.vstack([np.zeros((1, 3)), shown]), axis=0)), axis=0)
    assert np.all(carries_remainder(pulses, rests))
    assert not np.any(carries_remainder(np.round(shown), rests))
    means = pulses.reshape(10, 200, 3).mean(axis=1)
    assert np.max(rounding_variance(pulses, rests, means)) < 1e-4
