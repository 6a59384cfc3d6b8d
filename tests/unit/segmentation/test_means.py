"""Means of holds, their noise and covariance, what rounding leaves in them, and how biases wander from rest to rest."""

import numpy as np
import pytest

from second_simulator.sensors import flicker
from tumble.errors import SegmentationError
from tumble.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, mean_covariance, observe_holds
from tumble.segmentation.activity import noise_per_sample
from tumble.segmentation.rest_wander import SPREAD, USUAL, find_density, observe_parts
from tumble.segmentation.rounding import (
    carries_remainder,
    converter_step,
    integral_variance,
    rounding_variance,
)

SIGMA = np.array([0.5, 1.0, 3.0])


def equal_items(count, length):
    return [[(k * length, (k + 1) * length)] for k in range(count)]


def test_means_leave_out_what_is_excluded():
    signal = np.arange(300.0).reshape(100, 3)
    signal[40:45] = 1e6
    timeline = Timeline((Hold(10, 90, ((40, 45),)),), (), (), NoiseFloor(np.ones(3), np.ones(3), 1.0, ""))
    recording = Recording(np.arange(100) / 10.0, signal, None, "m/s^2", "rad/s", 10.0, np.full(100, 21.5))
    means = observe_holds(recording, timeline)
    kept = [*range(10, 40), *range(45, 90)]
    assert means.temperature is not None
    # summed in another order: some units in the last place of 300
    np.testing.assert_allclose(means.specific_force[0], signal[kept].mean(axis=0), rtol=1e-13)
    assert means.angular_rate is None
    assert means.count[0] == 75
    assert means.duration[0] == 7.5
    assert means.time[0] == pytest.approx(0.5 * (1.0 + 8.9))
    assert means.temperature[0] == 21.5


def test_correlated_noise_is_seen_by_the_batches():
    rng = np.random.default_rng(12)
    white = rng.standard_normal((60 * 800 + 20, 3))
    signal = np.stack([np.convolve(white[:, k], np.ones(10), "valid")[: 60 * 800] for k in range(3)], axis=1)
    observed = mean_covariance(signal, equal_items(60, 800))
    variance = np.median(np.diagonal(observed.covariance, axis1=1, axis2=2))
    # a moving sum of ten: long-run variance 100, while s²/n would say 10; batches of 50 to 100 samples
    # see 87 % or more of it, the pool's spread is 5 %
    assert 0.75 * 100 / 800 < variance < 1.2 * 100 / 800


def test_a_noisier_item_keeps_its_own_variance_and_spoils_no_other():
    rng = np.random.default_rng(13)
    signal = rng.standard_normal((30 * 400, 3))
    signal[7 * 400 : 8 * 400, 1] += np.linspace(-8.0, 8.0, 400)
    observed = mean_covariance(signal, equal_items(30, 400))
    variance = np.diagonal(observed.covariance, axis1=1, axis2=2)
    assert variance[7, 1] > 20 * np.median(variance[:, 1])
    others = np.delete(variance, 7, axis=0)
    # within the pool's spread of 7 %, three of them
    np.testing.assert_allclose(np.median(others, axis=0), 1 / 400, rtol=0.25)


def test_means_over_their_sigma_are_standard_normal():
    signal = SIGMA * np.random.default_rng(14).standard_normal((200 * 300, 3))
    observed = mean_covariance(signal, equal_items(200, 300))
    z = observed.mean / np.sqrt(np.diagonal(observed.covariance, axis1=1, axis2=2))
    # chi-square of 600: standard deviation of z² mean is sqrt(2/600) = 0.058; 3.3 of them
    assert abs(np.mean(z**2) - 1.0) < 0.19
    variance = np.median(np.diagonal(observed.covariance, axis1=1, axis2=2), axis=0)
    # of the pool's 200 x 14 degrees of freedom: 3 % standard deviation, four of them and the median's bias
    np.testing.assert_allclose(variance, SIGMA**2 / 300, rtol=0.25)


def test_no_hold_and_a_hold_of_one_sample_are_refused():
    recording = Recording(np.arange(9.0), np.zeros((9, 3)), None, "m/s^2", "rad/s", 1.0)
    empty = Timeline((), (), (), NoiseFloor(np.ones(3), np.ones(3), 1.0, ""))
    with pytest.raises(SegmentationError, match="no holds"):
        observe_holds(recording, empty)
    with pytest.raises(SegmentationError, match="fewer than two samples"):
        mean_covariance(np.zeros((9, 3)), [[(3, 4)]])


STEP = np.array([0.4, 3.0, 0.07])


def rests(noise, places, rng, samples=400):
    """Rounded samples of rests at true values `places` (rests, 3), all in steps; their ranges and their means."""
    true = np.repeat(places, samples, axis=0) + noise * rng.standard_normal((len(places) * samples, 3))
    # What comes before shows the step.
    moving = rng.uniform(-40.0, 40.0, (100, 3))
    signal = np.rint(np.concatenate([moving, true])) * STEP
    ranges = [[(100 + k * samples, 100 + (k + 1) * samples)] for k in range(len(places))]
    return signal, ranges, signal[100:].reshape(len(places), samples, 3).mean(axis=1)


def test_a_step_is_found_and_numbers_without_one_have_none():
    fine = np.random.default_rng(3).standard_normal((500, 3))
    np.testing.assert_array_equal(converter_step(fine), np.zeros(3))
    np.testing.assert_allclose(converter_step(np.round(4.0 * fine) * STEP), STEP)
    # Decimals that were cut off leave a step, and rests without noise have none.
    rng = np.random.default_rng(4)
    counts = np.round(rng.integers(-300, 300, (3000, 3)) * 0.06103515625, 3)
    np.testing.assert_allclose(converter_step(counts), np.full(3, 0.061035), rtol=2e-3)
    still = np.repeat(rng.standard_normal((40, 3)), 50, axis=0)
    np.testing.assert_array_equal(converter_step(still), np.zeros(3))
    # Noise of more than a step dithers.
    signal, ranges, means = rests(0.9, rng.uniform(-0.5, 0.5, (5, 3)), rng)
    np.testing.assert_array_equal(rounding_variance(signal, ranges, means), np.zeros((5, 3)))


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.4])
def test_the_variance_is_that_of_what_means_are_off(noise):
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


def test_rests_that_show_the_same_number_know_no_more_than_one():
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


def test_an_integral_over_a_tables_ramp_is_off_by_what_one_number_hides_and_by_late_stamps():
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
def test_pulses_of_an_integral_are_told_from_samples_that_are_rounded_each(own):
    """Their remainder is carried on. Noise that makes up for itself, too, is rounded each sample in the other."""
    rng = np.random.default_rng(5)
    shown = np.array([3.07, -1.4, 0.31]) + own * np.diff(rng.standard_normal((2001, 3)), axis=0)
    rests = [[(k * 200, (k + 1) * 200)] for k in range(10)]
    pulses = np.diff(np.floor(np.cumsum(np.vstack([np.zeros((1, 3)), shown]), axis=0)), axis=0)
    assert np.all(carries_remainder(pulses, rests))
    assert not np.any(carries_remainder(np.round(shown), rests))
    means = pulses.reshape(10, 200, 3).mean(axis=1)
    assert np.max(rounding_variance(pulses, rests, means)) < 1e-4


EACH = np.array([1.0, 2.0, 5.0])


@pytest.mark.parametrize("samples", [30, 150, 740, 4000])
def test_it_is_that_of_white_noise(samples):
    """Twenty-six holds; their 26 to 1040 pieces of a hundred samples tell it to 2.5 % at worst, of which three."""
    rng = np.random.default_rng(5)
    signal = EACH * rng.normal(size=(26 * samples, 3))
    holds = [Hold(samples * k, samples * (k + 1)) for k in range(26)]
    # Short holds count as they are: a fifth a piece, 5 % together.
    np.testing.assert_allclose(noise_per_sample(signal, holds), EACH, rtol=0.075 if samples > 30 else 0.15)


def test_the_median_of_its_pieces_is_their_mean():
    """Of 20 000 pieces: to 0.1 %, where the median of a hundred samples' scatter is 0.5 % below its mean."""
    signal = EACH * np.random.default_rng(6).normal(size=(2_000_000, 3))
    np.testing.assert_allclose(noise_per_sample(signal, [Hold(0, len(signal))]), EACH, rtol=2e-3)


def test_turns_knocks_and_drift_are_no_noise():
    rng = np.random.default_rng(7)
    signal = EACH * rng.normal(size=(6000, 3)) + np.linspace(0.0, 100.0, 6000)[:, None]
    plain = noise_per_sample(signal, [Hold(0, 3000), Hold(3000, 6000)])
    signal[1000:1020] += 500.0 * rng.normal(size=(20, 3))
    signal[2900:3100] += 1e4 * np.sin(np.arange(200.0))[:, None]
    holds = [Hold(0, 2900, excluded=((100, 130),)), Hold(3100, 6000)]
    np.testing.assert_allclose(noise_per_sample(signal, holds), plain, rtol=0.05)


RATE, WHITE, INSTABILITY = 50.0, 4e-3, 4e-3


def parts(instability, seed, *, holds=24, seconds=20.0):
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


def density_of(own, **options):
    return float(np.mean(find_density(own, own.rate, own.rate_white, **options)))


def test_the_density_of_flicker_is_found_from_what_all_rests_show():
    """IEEE Std 952: B² / (2 pi f) two-sided has B² / pi per unit of ln f."""
    design = np.ones((24, 1))
    every = [density_of(parts(INSTABILITY, seed), design=design) for seed in range(6)]
    assert np.exp(np.mean(np.log(every))) == pytest.approx(INSTABILITY**2 / np.pi, rel=0.35)


def test_what_rests_show_along_some_direction_each_tells_it_too():
    """Of three axes that wander apart, two rests along gravity show as much in common as their directions have."""
    up = np.random.default_rng(8).normal(size=(24, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    every: list[float] = []
    for seed in range(6):
        own = parts(INSTABILITY, seed)
        along = np.sum(up[own.hold] * own.rate, axis=1, keepdims=True)
        white = np.mean(own.rate_white, keepdims=True)
        made = find_density(own, along, white, holds=np.arange(24), design=up, alike=up @ up.T)
        every.append(float(made[0]))
    assert np.exp(np.mean(np.log(every))) == pytest.approx(INSTABILITY**2 / np.pi, rel=0.35)


def test_white_noise_has_little_of_it_and_what_few_rests_leave_open_is_what_sheets_give():
    assert np.sqrt(parts(0.0, 1).rate_white) == pytest.approx(np.full(3, WHITE), rel=0.1)
    every = [density_of(parts(0.0, seed), design=np.ones((24, 1))) for seed in range(4)]
    assert np.mean(every) < 0.4 * USUAL * WHITE**2
    own = parts(0.0, 3, holds=2, seconds=4.0)
    assert 0.3 * USUAL * WHITE**2 < density_of(own) < 2.0 * USUAL * WHITE**2


def test_a_rest_that_was_knocked_does_not_make_it_wander():
    own = parts(0.0, 4)
    knocked = own.rate.copy()
    knocked[4 * 7] += 100 * WHITE
    moved = float(np.mean(find_density(own, knocked, own.rate_white)))
    assert moved < 1.5 * density_of(own)


def test_where_few_rests_leave_it_open_the_density_is_right_on_average_as_a_variance_has_to_be():
    """Units as data sheets give them, six rests: true over stated has the mean 1, and had 1.4."""
    ratio: list[float] = []
    for seed in range(160):
        true = USUAL * np.exp(SPREAD * np.random.default_rng(seed).standard_normal())
        own = parts(WHITE * float(np.sqrt(np.pi * true)), 1000 + seed, holds=6)
        ratio.append(true * WHITE**2 / density_of(own))
    # The ratio's standard deviation is about 1.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.2)
