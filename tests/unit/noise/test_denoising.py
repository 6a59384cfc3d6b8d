"""Wavelet de-noising: exact where it must be, and as good as theory says it is."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.noise.denoising.shrinkage import (
    Shrinkage,
    choose_level,
    denoise_signal,
    level_above,
    level_noise,
    motion_bandwidth,
    sure_threshold,
)
from tumble.noise.denoising.wavelets import Transform, deepest_level, filter_length
from tumble.noise.deviation import allan_deviation

RATE = 100.0


@pytest.mark.parametrize("stationary", [True, False])
@pytest.mark.parametrize("wavelet", ["haar", "db4", "sym4", "coif2"])
def test_a_transform_and_back_is_the_piece_itself(wavelet: str, stationary: bool) -> None:
    piece = np.random.default_rng(1).standard_normal(997)
    transform = Transform(4, wavelet, stationary)
    back = transform.synthesise(transform.analyse(piece))
    # Filters of PyWavelets carry some 1e-11.
    assert back == pytest.approx(piece, abs=1e-9)


@pytest.mark.parametrize("stationary", [True, False])
def test_white_noise_has_the_scale_that_is_stated_at_every_level(stationary: bool) -> None:
    piece = 3.0 * np.random.default_rng(2).standard_normal(200_000)
    found = Transform(6, "sym4", stationary).analyse(piece)
    for j in range(1, 7):
        expected = 3.0 * (2.0 ** (-0.5 * j) if stationary else 1.0)
        inner = found.inside(j)
        # 200,000 / 2^j coefficients are independent: 1.3 % at level 6, four of these.
        assert inner.std() == pytest.approx(expected, rel=4 * 2.0 ** (0.5 * j) / np.sqrt(4e5))
        assert inner.size == (200_000 if stationary else 200_000 >> j)


def test_the_haar_details_are_half_differences_of_means() -> None:
    """Level j of the stationary Haar transform has AVAR(2^(j-1) samples)/2 (Percival 1995)."""
    signal = np.cumsum(np.random.default_rng(3).standard_normal(50_000))
    found = Transform(4, "haar").analyse(signal)
    for j in range(1, 5):
        variance = 0.5 * allan_deviation(signal, 1.0, taus="octave").deviation[j - 1, 0] ** 2
        # `inside` may hold a few coefficients that an end touches.
        assert np.mean(found.inside(j) ** 2) == pytest.approx(variance, rel=1e-3)


def test_a_level_that_a_piece_does_not_bear_is_refused() -> None:
    assert deepest_level(13, "sym4") == 0
    assert deepest_level(14, "sym4") == 1
    assert deepest_level(7 * 64, "sym4") == 6
    with pytest.raises(UsageError, match="bears 6 levels of sym4, not 7"):
        Transform(7).analyse(np.zeros(7 * 64))
    with pytest.raises(UsageError, match=r"bior2\.2"):
        filter_length("bior2.2")


def test_the_level_follows_the_allan_minimum() -> None:
    """White N = 1 and a random walk of K: the minimum is at √3 N/K, here 4.3 s; a tenth above it from about half."""
    rng = np.random.default_rng(4)
    count, walk = 400_000, 0.04
    signal = 0.1 * rng.standard_normal(count) * np.sqrt(RATE) / 0.1
    signal += walk * 10.0 * np.cumsum(rng.standard_normal(count)) / np.sqrt(RATE)
    chosen = choose_level(signal, RATE, [(0, count)])
    minimum = np.sqrt(3.0) / (walk * 10.0)
    assert 0.35 * minimum < chosen.allan_minimum < 1.5 * minimum
    assert chosen.level == round(np.log2(chosen.allan_minimum * RATE))


def test_noise_correlated_from_sample_to_sample_does_not_hide_the_minimum() -> None:
    """A pole at 0.9: the Allan deviation rises over some 20 samples before it falls; drift alone only rises."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(14)
    signal = lfilter([1.0], [1.0, -0.9], rng.standard_normal(100_000))
    assert choose_level(signal, RATE, [(0, 100_000)]).level >= 9
    assert choose_level(np.cumsum(rng.standard_normal(100_000)), RATE, [(0, 100_000)]).level == 0


def test_white_noise_alone_takes_the_level_that_the_longest_rest_bears() -> None:
    signal = np.random.default_rng(5).standard_normal(1000)
    assert choose_level(signal, RATE, [(0, 400), (500, 1000)]).level <= deepest_level(500)
    with pytest.raises(UsageError, match="No rest is long enough"):
        choose_level(signal, RATE, [(0, 10)])
    assert choose_level(np.ones(1000), RATE, [(0, 1000)]).level == 0


def test_the_noise_of_each_level_is_found_beside_motion() -> None:
    """Coloured noise (a filtered sensor): each level has its own, and bursts of motion do not raise it."""
    rng = np.random.default_rng(6)
    white = rng.standard_normal(60_001)
    signal = 0.5 * (white[1:] + white[:-1])
    how = Shrinkage()
    quiet = level_noise(signal, [(0, 60_000)], 5, how)
    # |H|² = cos²(πf/rate) is 0.15 over the finest octave, and near 1 over the coarse ones.
    assert quiet[0] * np.sqrt(2.0) == pytest.approx(np.sqrt(0.18), rel=0.15)
    assert quiet[4] * 2.0**2.5 == pytest.approx(1.0, rel=0.06)
    signal[30_000:31_000] += 50.0 * np.sin(0.1 * np.arange(1000))
    beside = level_noise(signal, [(0, 30_000), (31_000, 60_000)], 5, how)
    assert beside == pytest.approx(quiet, rel=0.05)


def test_sure_is_universal_for_noise_alone_and_lower_where_there_is_signal() -> None:
    rng = np.random.default_rng(7)
    noise = rng.standard_normal(4096)
    assert sure_threshold(noise, 4096.0) == pytest.approx(np.sqrt(2.0 * np.log(4096.0)))
    dense = noise + rng.normal(0.0, 3.0, 4096)
    assert sure_threshold(dense, 4096.0) < 1.0


def test_stein_s_estimate_is_the_risk_that_simulation_finds() -> None:
    """The threshold chosen costs hardly more than the best of a grid, measured against the truth."""
    rng = np.random.default_rng(8)
    truth = np.where(rng.random(8192) < 0.2, rng.normal(0.0, 4.0, 8192), 0.0)
    seen = truth + rng.standard_normal(8192)

    def cost(limit: float) -> float:
        return float(np.mean((np.sign(seen) * np.maximum(np.abs(seen) - limit, 0.0) - truth) ** 2))

    best = min(cost(limit) for limit in np.linspace(0.0, 4.0, 81))
    assert cost(sure_threshold(seen, 8192.0)) < 1.03 * best


@pytest.mark.parametrize("how", [Shrinkage(), Shrinkage("universal", "hard"), Shrinkage(stationary=False)])
def test_noise_goes_and_a_step_stays(how: Shrinkage) -> None:
    """A step of 30 sigma: the noise falls to less than a fifth away from it, and the step is where it was."""
    rng = np.random.default_rng(9)
    truth = np.where(np.arange(8000) < 4000, 0.0, 30.0)
    seen = truth + rng.standard_normal(8000)
    found = denoise_signal(seen, [(0, 8000)], [(0, 3900), (4100, 8000)], 7, how)
    off = found.signal - truth
    assert off[:3500].std() < 0.2
    assert off[4500:].std() < 0.2
    # Soft thresholds take every coefficient of the step down by some four sigma of its level.
    assert np.abs(off[3990:4010]).max() < 6.0
    assert found.noise == pytest.approx(np.ones(7), rel=0.25)
    # A linear filter smears it.
    linear = denoise_signal(seen, [(0, 8000)], [(0, 8000)], 7, Shrinkage("remove"))
    assert np.abs(linear.signal - truth)[3990:4010].max() > 10.0


def test_the_stationary_transform_has_smaller_artefacts_at_a_step() -> None:
    rng = np.random.default_rng(10)
    truth = np.where(np.arange(4096) < 2011, -5.0, 5.0)
    lost = {True: 0.0, False: 0.0}
    for _ in range(10):
        seen = truth + rng.standard_normal(4096)
        for stationary in lost:
            how = Shrinkage("universal", "hard", "haar", stationary)
            found = denoise_signal(seen, [(0, 4096)], [(0, 2000), (2020, 4096)], 6, how).signal
            lost[stationary] += float(np.sum((found - truth) ** 2))
    assert lost[True] < 0.7 * lost[False]


def test_outside_the_pieces_nothing_changes_and_edges_do_not_bend() -> None:
    rng = np.random.default_rng(11)
    seen = rng.standard_normal(5000) + 100.0
    seen[2000:3000] = np.nan
    found = denoise_signal(seen, [(0, 2000), (3000, 5000)], [(0, 2000), (3000, 5000)], 6).signal
    assert np.isnan(found[2000:3000]).all()
    # 64 samples averaged scatter by 0.125; an end is known half as well at worst.
    for end in (0, 1999, 3000, 4999):
        assert abs(found[end] - 100.0) < 4 * 0.25
    moved = denoise_signal(seen, [(0, 2000)], [(0, 2000)], 6).signal
    assert moved[3000:] == pytest.approx(seen[3000:], abs=0.0)


def test_the_mean_of_a_rest_does_not_change() -> None:
    """Details have no mean: what moves is of the ends alone."""
    rng = np.random.default_rng(12)
    seen = rng.standard_normal(2000)
    found = denoise_signal(seen, [(0, 2000)], [(0, 2000)], 6).signal
    # The mean scatters by 1/√2000; a fiftieth of the pieces' length is at the ends.
    assert abs(found.mean() - seen.mean()) < 0.5 / np.sqrt(2000.0)


@pytest.mark.parametrize("level", [2, 4])
def test_a_sine_below_the_threshold_is_lost_and_one_above_stays(level: int) -> None:
    """What the statement calls lost: peaks under threshold · 2^(-j/2) in the octave of level j."""
    rng = np.random.default_rng(15)
    count = 40_000
    noise = rng.standard_normal(count)
    rest, whole = [(0, 20_000)], [(0, count)]
    how = Shrinkage("universal", "hard")
    limit = denoise_signal(noise, whole, rest, 5, how).threshold[level - 1] * 2.0 ** (-0.5 * level)
    # In the middle of the octave, where the level's filter passes nearly all.
    sine = np.sin(2.0 * np.pi * 0.75 / 2.0**level * np.arange(count))
    sine[:20_000] = 0.0
    # Of a larger sine a stretch about each zero is below the threshold: two thirds or more are left.
    for peak, least, most in ((0.3 * limit, 0.0, 0.1), (2.0 * limit, 0.6, 1.05)):
        found = denoise_signal(noise + peak * sine, whole, rest, 5, how).signal
        part = slice(21_000, 39_000)
        left = float(found[part] @ sine[part] / (peak * sine[part] @ sine[part]))
        assert least <= left <= most


def test_the_bandwidth_of_a_motion_is_found() -> None:
    rng = np.random.default_rng(13)
    time = np.arange(12_000) / RATE
    signal = 0.01 * rng.standard_normal(12_000)
    signal[6000:] += np.sin(2.0 * np.pi * 3.0 * time[6000:])
    found = motion_bandwidth(signal, RATE, [(6000, 12_000)], [(0, 6000)])
    # A line is as wide as Welch's window: 0.15 Hz at 1024 samples.
    assert found is not None
    assert 3.0 <= found < 3.5
    assert level_above(found, RATE) == 3  # removes from 6.25 Hz on; the next would from 3.1 on
    assert motion_bandwidth(signal[:6000], RATE, [(0, 3000)], [(3000, 6000)]) is None


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Shrinkage("best"), "'best'"),  # type: ignore[arg-type]
        (lambda: Shrinkage(shape="firm"), "'firm'"),  # type: ignore[arg-type]
        (lambda: Shrinkage("sure", "hard"), "Stein"),
        (lambda: Shrinkage(wavelet="morl"), "'morl'"),
        (lambda: denoise_signal(np.ones(100), [(0, 100)], [(0, 100)], 9), "9 levels"),
    ],
)
def test_what_cannot_be_is_a_sentence(call: object, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        call()  # type: ignore[operator]
