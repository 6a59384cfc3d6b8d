"""Curves and spectra of a signal held against their definitions, closed forms and other programs.

Deviations, whole and as a stream; degrees of freedom; power spectra; autoregressive models.
"""

import numpy as np
import pytest
from scipy.signal import lfilter, welch
from scipy.stats import chi2

from tumble.arrays import block_means
from tumble.errors import UsageError
from tumble.noise.autoregression import Autoregression, burg, burg_ladder, choose_order
from tumble.noise.deviation import ONE_SIGMA, PLACES, StreamedDeviation, allan_deviation
from tumble.noise.freedom import chi_square_interval, degrees_of_freedom
from tumble.noise.spectrum import PowerSpectrum, StreamedSpectrum


def signal_of(samples: int, seed: int = 1) -> np.ndarray:
    """White noise on a random walk, three channels of different sizes; a counter's offset of 2^24 costs no digits."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal((samples, 3)), axis=0)
    return (rng.standard_normal((samples, 3)) + 0.03 * walk) * [1.0, 20.0, 0.3] + [9.8, 2.0**24, 0.01]


def by_definition(y: np.ndarray, m: int) -> float:
    """The deviation at m samples from means of clusters, as the standards define it."""
    mean = np.array([(y - y.mean())[i : i + m].mean() for i in range(len(y) - m + 1)])
    return float(np.sqrt(0.5 * np.mean((mean[m:] - mean[:-m]) ** 2)))


@pytest.mark.parametrize("samples", [6, 100, 1003])
def test_a_deviation_is_that_of_its_definition(samples):
    signal = signal_of(samples)
    found = allan_deviation(signal, 50.0, taus="log")
    plain = [[by_definition(signal[:, channel], int(m)) for channel in range(3)] for m in found.averaging]
    # Both round sums of some thousand terms.
    assert found.deviation == pytest.approx(np.array(plain), rel=1e-9)
    assert found.tau == pytest.approx(found.averaging / 50.0)
    assert found.channel(1).low.tolist() == found.low[:, 1:2].tolist()


def test_tiles_of_a_long_signal_join_without_a_seam():
    """Longer than several tiles of the kernel, with averaging times longer than a tile."""
    signal = signal_of(30_000)[:, 0]
    phase = np.concatenate([[0.0], np.cumsum(signal - signal.mean())])
    for m in (1, 7, 2048, 2049, 9000):
        change = phase[2 * m :] - 2.0 * phase[m:-m] + phase[: -2 * m]
        plain = np.sqrt(np.mean(change**2) / 2.0) / m
        found = allan_deviation(signal, 1.0, taus=[float(m)])
        assert found.deviation[0, 0] == pytest.approx(plain, rel=1e-9)
        assert found.count[0] == change.size


def test_pieces_between_gaps_are_pooled_by_their_differences():
    signal = signal_of(3000)
    whole = allan_deviation(signal, 1.0, gaps=[1000, 1900])
    parts = [allan_deviation(part, 1.0) for part in np.split(signal, [1000, 1900])]
    for k, m in enumerate(whole.averaging):
        here = [(part, list(part.averaging).index(m)) for part in parts if m in part.averaging]
        total = sum(part.deviation[i] ** 2 * part.count[i] for part, i in here)
        count = sum(int(part.count[i]) for part, i in here)
        assert whole.count[k] == count
        assert whole.deviation[k] ** 2 == pytest.approx(total / count, rel=1e-9)


def test_rows_that_are_not_finite_part_the_signal():
    signal = signal_of(2000)
    spoiled = signal.copy()
    # infinities of both signs do not hide each other
    spoiled[500:510, 1], spoiled[700, 0], spoiled[702, 0] = np.nan, np.inf, -np.inf
    found = allan_deviation(spoiled, 1.0)
    assert found.pieces == (500, 190, 1, 1297)
    kept = allan_deviation(np.delete(signal, [*range(500, 510), 700, 702], axis=0), 1.0, gaps=[500, 690, 691])
    assert found.deviation == pytest.approx(kept.deviation, rel=1e-12)


@pytest.mark.parametrize(
    ("taus", "expected"),
    [
        ("octave", [1, 2, 4, 8, 16]),
        ("log", [1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20]),
        # given ones are taken to whole samples, once
        (np.array([0.31, 0.1, 0.29, 2.0, 900.0]), [1, 3, 20]),
    ],
)
def test_averaging_times(taus, expected):
    assert allan_deviation(signal_of(45), 10.0, taus=taus).averaging.tolist() == expected


@pytest.mark.parametrize(
    ("make", "exponent"),
    [(lambda x: x[1:] - x[:-1], 2), (lambda x: x[1:], 0), (lambda x: np.cumsum(x, axis=0)[1:], -2)],
)
def test_the_kind_of_noise_is_told_from_the_slope(make, exponent):
    found = allan_deviation(make(np.random.default_rng(3).standard_normal((20_001, 2))), 1.0)
    assert np.all(found.exponent[1:9] == exponent)


def streamed(signal: np.ndarray, cuts: list[int]) -> StreamedDeviation:
    collector = StreamedDeviation(100.0, signal.shape[1])
    for block in np.split(signal, cuts):
        collector.add(block)
    return collector


def test_short_averaging_times_are_exact_wherever_the_blocks_are_cut():
    signal = signal_of(20_000)
    whole = allan_deviation(signal, 100.0)
    found = streamed(signal, [1, 3, 3, 100, 101, 400, 9000, 19_999]).deviation()
    assert found.tau == pytest.approx(whole.tau)
    short = found.averaging <= PLACES
    assert found.count[short].tolist() == whole.count[short].tolist()
    assert found.deviation[short] == pytest.approx(whole.deviation[short], rel=1e-9)


def test_long_averaging_times_are_those_of_the_averaged_signal():
    """Means of 2^h samples: no aliasing, the same statistics at fewer places, to rounding."""
    signal = signal_of(40_000)
    found = streamed(signal, [777, 20_001]).deviation()
    for height in (1, 3, 6):
        m = PLACES << height
        averaged = allan_deviation(block_means(signal, 1 << height), 1.0, taus=[float(PLACES)])
        at = list(found.averaging).index(m)
        assert found.deviation[at] == pytest.approx(averaged.deviation[0], rel=1e-9)


def test_no_difference_lies_across_a_gap():
    signal = signal_of(9000)
    collector = StreamedDeviation(100.0, 3)
    collector.add(signal[:4001])
    collector.add(signal[4001:5000] + 1e6, after_gap=True)
    collector.add(signal[5000:] + 1e6)
    found = collector.deviation()
    whole = allan_deviation(signal, 100.0, gaps=[4001])
    assert found.pieces == (4001, 4999)
    # Rounding against a jump of 1e6.
    assert found.deviation[:8] == pytest.approx(whole.deviation[:8], rel=1e-6)


def exact_for_white(m: int, samples: int) -> float:
    """2 E[V]²/var V for white noise, from the covariance of the overlapping differences itself."""
    # Differences of sums of m samples: a filter on white samples.
    filter_ = np.convolve([1.0] + [0.0] * (m - 1) + [-1.0], np.ones(m))
    count = samples - filter_.size + 1
    covariance = np.correlate(filter_, filter_, mode="full")[filter_.size - 1 :]
    lags = np.arange(min(count, filter_.size))
    share = (covariance[lags] / covariance[0]) ** 2
    return count / (1.0 + 2.0 * float(np.sum((1.0 - lags / count)[1:] * share[1:])))


@pytest.mark.parametrize(
    ("m", "samples"), [(1, 1000), (10, 1000), (100, 1000), (300, 1000), (64, 20_000), (700, 9000)]
)
def test_white_noise_has_the_degrees_of_freedom_of_its_exact_covariance(m, samples):
    """Within 1 %: beyond some hundred terms the sum is an integral, taken at 256 places."""
    assert degrees_of_freedom(0, m, samples) == pytest.approx(exact_for_white(m, samples), rel=0.01)


@pytest.mark.parametrize("exponent", [2, 0, -1, -2])
def test_one_difference_has_one_degree_of_freedom_and_none_knows_nothing(exponent):
    assert degrees_of_freedom(exponent, 40, 80) == 1.0
    assert degrees_of_freedom(exponent, 40, 79) == 0.0
    low, high = chi_square_interval(np.array([2.0]), np.array([0.0]), 0.9)
    assert (low[0], high[0]) == (0.0, np.inf)
    # differences begun less often lose next to nothing
    every = degrees_of_freedom(0, 4096, 400_000)
    assert degrees_of_freedom(0, 4096, 400_000, 128) == pytest.approx(every, rel=1e-3)


@pytest.mark.parametrize("exponent", [2, 0, -1, -2])
def test_degrees_of_freedom_never_jump_where_the_sum_becomes_an_integral(exponent):
    """Fourteen times as many averaging times as samples in one: what changes between them is smooth."""
    found = [degrees_of_freedom(exponent, m, 200 * m) / (1 + 198 * m) * m for m in range(60, 110)]
    scaled = np.array(found) if exponent != 2 else np.array(found) / np.arange(60, 110)
    assert np.max(np.abs(np.diff(scaled) / scaled[1:])) < 0.02


def test_noise_that_second_differences_cannot_tame_is_refused():
    with pytest.raises(ValueError, match="exponent -3"):
        degrees_of_freedom(-3, 10, 1000)


def test_the_interval_is_that_of_chi_square():
    edf = np.array([1.0, 8.5, 3000.0])
    low, high = chi_square_interval(np.full(3, 2.0), edf, 0.9)
    assert low == pytest.approx(2.0 * edf / chi2.ppf(0.95, edf), rel=1e-10)
    assert high == pytest.approx(2.0 * edf / chi2.ppf(0.05, edf), rel=1e-10)


def spectrum_of(
    signal: np.ndarray, rate: float, segment: int, bins: int | None = None, parted: int | None = None
) -> PowerSpectrum:
    """The spectrum of one channel or more, without a sample between `parted` and the one before."""
    collector = StreamedSpectrum(rate, signal[0].size, segment)
    for part in np.split(signal.reshape(len(signal), -1), [] if parted is None else [parted]):
        collector.add(part, after_gap=True)
    return collector.spectrum(bins_per_decade=bins)


def white(samples: int, seed: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((samples, 2)) * [1.0, 7.0] + [3.0, -100.0]


@pytest.mark.parametrize("segment", [64, 1000, 1001])
def test_the_spectrum_is_scipys_but_for_zero(segment):
    signal = white(10_000)
    frequency, density = welch(signal, 40.0, "hann", segment, axis=0)
    found = spectrum_of(signal, 40.0, segment)
    assert found.frequency == pytest.approx(frequency[1:], rel=1e-12)
    assert found.density == pytest.approx(density[1:], rel=1e-9)


def test_bins_keep_the_mean_density():
    found = spectrum_of(white(100_000), 40.0, 8192, 10)
    assert np.all(np.diff(np.log10(found.frequency)) > 0.04)
    assert found.density[-5:-1, 1] == pytest.approx(49.0 / 20.0, rel=0.05)  # 800 degrees of freedom and more


def test_no_segment_lies_across_a_gap():
    signal = white(8000)
    signal[4000:] += 1e5
    found = spectrum_of(signal, 40.0, 500, parted=4000)
    assert found.segments == 2 * 15
    assert found.density[:, 0].mean() == pytest.approx(1.0 / 20.0, rel=0.1)


@pytest.mark.parametrize("bins", [None, 8])
def test_intervals_of_the_spectrum_hold_the_true_density(bins):
    found = spectrum_of(np.random.default_rng(20).standard_normal((1024, runs := 1500)), 1.0, 128, bins)
    held = np.mean((found.low < 2.0) & (found.high > 2.0), axis=1)
    # The lowest line has lost the mean, and at the Nyquist frequency one of two degrees of freedom is missing.
    inner = held[2:-1]
    spread = np.sqrt(ONE_SIGMA * (1.0 - ONE_SIGMA) / runs)
    assert inner == pytest.approx(ONE_SIGMA, abs=4.0 * spread + 0.04)


# R's data set lh: luteinizing hormone in blood, 48 samples (Diggle 1990, table A.1).
LH = np.array(
    [2.4, 2.4, 2.4, 2.2, 2.1, 1.5, 2.3, 2.3, 2.5, 2.0, 1.9, 1.7, 2.2, 1.8, 3.2, 3.2, 2.7, 2.2, 2.2, 1.9, 1.9, 1.8,
     2.7, 3.0, 2.3, 2.0, 2.0, 2.9, 2.9, 2.7, 2.7, 2.3, 2.6, 2.4, 1.8, 1.7, 1.5, 1.4, 2.1, 3.3, 3.5, 3.5, 3.1, 2.6,
     2.1, 3.4, 3.0, 2.9]
)  # fmt: skip


def drawn(coefficients: list[float], count: int, seed: int) -> np.ndarray:
    """A stationary series with innovations of unit variance."""
    noise = np.random.default_rng(seed).standard_normal(count + 4000)
    return lfilter([1.0], [1.0, *(-a for a in coefficients)], noise)[4000:]


def test_the_autocovariances_of_orders_one_and_two_are_the_closed_forms():
    """Box, Jenkins and Reinsel, equations 3.2.20 and following."""
    model = Autoregression(0.0, np.array([-0.8]), 2.0, 100)
    assert model.autocovariance(5) == pytest.approx(2.0 / (1.0 - 0.64) * (-0.8) ** np.arange(6), rel=1e-13)
    first, second, power = 1.2, -0.5, 0.7
    model = Autoregression(0.0, np.array([first, second]), power, 100)
    variance = power * (1.0 - second) / ((1.0 + second) * ((1.0 - second) ** 2 - first**2))
    rho = [1.0, first / (1.0 - second)]
    for _ in range(4):
        rho.append(first * rho[-1] + second * rho[-2])
    assert model.autocovariance(5) == pytest.approx(variance * np.array(rho), rel=1e-12)


def test_the_covariance_of_the_coefficients_is_the_closed_form():
    """Order 1: (1 − a²)/n. Order 2: (1 − a₂²)/n each, −a₁ (1 + a₂)/n between them."""
    one = Autoregression(0.0, np.array([0.9]), 3.0, 500)
    assert one.covariance[0, 0] == pytest.approx((1.0 - 0.81) / 500.0, rel=1e-12)
    two = Autoregression(0.0, np.array([0.5, 0.3]), 3.0, 500)
    expected = np.array([[0.91, -0.65], [-0.65, 0.91]]) / 500.0
    assert two.covariance == pytest.approx(expected, rel=1e-12)


def test_a_known_series_gives_the_numbers_that_another_program_prints():
    """R 4: ar(lh, order.max = 3, method = "burg"); half a unit of the last printed digit."""
    model = burg(LH, 3)
    assert model.coefficients == pytest.approx([0.6588, -0.0608, -0.2234], abs=5.1e-5)
    assert model.innovation_variance == pytest.approx(0.1786, abs=5.1e-5)
    left = (LH - model.predicted(LH))[3:]
    assert np.isnan(model.predicted(LH)[:3]).all()
    # forward residuals of 45 samples; Burg's are forward and backward
    assert left.var() == pytest.approx(model.innovation_variance, rel=0.1)
    for order, one in enumerate(burg_ladder(LH, 4)):
        assert one.coefficients == pytest.approx(burg(LH, order).coefficients, rel=1e-12)


def test_pieces_are_pooled_and_nothing_is_taken_across_a_gap():
    series = drawn([0.9], 6000, 3)
    broken = np.concatenate([series[:2000], np.full(50, 1e6), series[2000:]])
    pieces = [(0, 2000), (2050, 6050)]
    model = burg(broken, 1, pieces)
    # (1 − a²)/n is 0.0056²; four of these.
    assert model.coefficients[0] == pytest.approx(0.9, abs=4 * 0.0056)
    assert model.samples == 6000
    assert model.whiteness(broken, pieces) > 0.01


def test_bic_finds_the_order_and_the_rest_is_white():
    series = drawn([0.6, 0.0, -0.4], 6000, 11)
    chosen = choose_order(series, 12)
    assert chosen.order == 3
    assert chosen.whiteness(series) > 0.01
    assert burg(series, 2).whiteness(series) < 1e-6


def test_white_noise_has_order_zero_and_an_honest_test():
    """Of 200 white series about 5 % fail at 5 %: 10 ± 3.1, four of these."""
    rng = np.random.default_rng(2)
    series = rng.standard_normal((200, 800))
    orders = [choose_order(x, 6).order for x in series[:40]]
    assert np.mean(np.array(orders) == 0) > 0.9
    failed = sum(burg(x, 0).whiteness(x) < 0.05 for x in series)
    assert 0 < failed < 23


def test_the_spectrum_integrates_to_the_variance_and_lies_on_welch():
    rate = 200.0
    series = drawn([1.2, -0.5], 200_000, 4)
    model = burg(series, 2)
    fine = (np.arange(20_000) + 0.5) / 20_000 * rate / 2
    whole = model.power_spectrum(fine, rate).mean() * rate
    assert whole == pytest.approx(model.autocovariance(0)[0], rel=1e-6)
    welch = spectrum_of(series, rate, 512)
    ratio = welch.density[2:-2, 0] / (2.0 * model.power_spectrum(welch.frequency[2:-2], rate))
    # 780 overlapping segments know each line to 4 %; 250 lines the mean to 0.3 %.
    assert ratio.mean() == pytest.approx(1.0, abs=0.012)
    assert ratio.std() < 0.06


def test_means_over_long_times_scatter_by_the_random_walk():
    series = drawn([0.9], 1_000_000, 6)
    means = series.reshape(2000, 500).mean(axis=1)
    # 2000 means know their scatter to 1.6 %; 500 samples are 50 correlation times, which makes 1 % less.
    assert means.std() * np.sqrt(500.0) == pytest.approx(burg(series, 1).random_walk, rel=0.07)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: allan_deviation(signal_of(50), 0.0), "rate"),
        (lambda: allan_deviation(signal_of(50), 1.0, noise=1), "exponent"),
        (lambda: allan_deviation(signal_of(50), 1.0, noise=-3), "exponent"),
        (lambda: allan_deviation(signal_of(50), 1.0, taus="weekly"), "weekly"),
        (lambda: allan_deviation(signal_of(50), 1.0, taus=[0.001]), "No averaging time"),
        (lambda: allan_deviation(signal_of(50), 1.0, taus=[np.nan]), "finite"),
        (lambda: allan_deviation(np.array([1.0]), 1.0), "too few samples"),
        (lambda: StreamedDeviation(1.0, 1).deviation(), "too few"),
        (lambda: spectrum_of(white(100), 40.0, 80, parted=50), "without a gap"),
        (lambda: burg(np.ones(100), 2), "never changes"),
        (lambda: burg(np.arange(5.0), 4), "12 samples"),
        (lambda: burg(LH, 2).whiteness(LH[:20]), "22 lags"),
    ],
)
def test_what_cannot_be_is_refused_in_words(call, words):
    with pytest.raises(UsageError, match=words):
        call()
