"""Autoregressive models: closed forms, another program's numbers, recovery within what is stated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from tumble.errors import UsageError
from tumble.noise.autoregression import (
    Autoregression,
    burg,
    burg_ladder,
    choose_order,
    whiteness,
)
from tumble.noise.spectrum import power_spectrum

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


def test_the_autocovariance_of_order_one_is_the_closed_form() -> None:
    model = Autoregression(0.0, np.array([-0.8]), 2.0, 100)
    expected = 2.0 / (1.0 - 0.64) * (-0.8) ** np.arange(6)
    assert model.autocovariance(5) == pytest.approx(expected, rel=1e-13)


def test_the_autocovariance_of_order_two_is_the_closed_form() -> None:
    """Box, Jenkins and Reinsel, equations 3.2.20 and following."""
    first, second, power = 1.2, -0.5, 0.7
    model = Autoregression(0.0, np.array([first, second]), power, 100)
    variance = power * (1.0 - second) / ((1.0 + second) * ((1.0 - second) ** 2 - first**2))
    rho = [1.0, first / (1.0 - second)]
    for _ in range(4):
        rho.append(first * rho[-1] + second * rho[-2])
    assert model.autocovariance(5) == pytest.approx(variance * np.array(rho), rel=1e-12)


def test_the_covariance_of_the_coefficients_is_the_closed_form() -> None:
    """Order 1: (1 − a²)/n. Order 2: (1 − a₂²)/n each, −a₁ (1 + a₂)/n between them."""
    one = Autoregression(0.0, np.array([0.9]), 3.0, 500)
    assert one.covariance[0, 0] == pytest.approx((1.0 - 0.81) / 500.0, rel=1e-12)
    two = Autoregression(0.0, np.array([0.5, 0.3]), 3.0, 500)
    expected = np.array([[0.91, -0.65], [-0.65, 0.91]]) / 500.0
    assert two.covariance == pytest.approx(expected, rel=1e-12)


def test_a_known_series_gives_the_numbers_that_another_program_prints() -> None:
    """R 4: ar(lh, order.max = 3, method = "burg"); half a unit of the last printed digit."""
    model = burg(LH, 3)
    assert model.coefficients == pytest.approx([0.6588, -0.0608, -0.2234], abs=5.1e-5)
    assert model.innovation_variance == pytest.approx(0.1786, abs=5.1e-5)


def test_estimates_scatter_as_the_asymptotic_covariance_says() -> None:
    """120 series of 2000: the sum of squared normalised errors is chi-square of 240, inside 99.9 %."""
    truth = np.array([0.5, -0.3])
    models = [burg(drawn(list(truth), 2000, seed), 2) for seed in range(120)]
    off = np.array([m.coefficients - truth for m in models])
    total = sum(float(e @ np.linalg.solve(m.covariance, e)) for e, m in zip(off, models, strict=True))
    low, high = chi2.ppf([0.0005, 0.9995], 240)
    assert low < total < high


def test_near_a_unit_root_burg_is_close() -> None:
    """Poles at 0.995 exp(± 0.3 i), 200 samples: biased autocovariances would lose a tenth of the pole's sharpness."""
    truth = np.array([2.0 * 0.995 * np.cos(0.3), -(0.995**2)])
    off = np.array([burg(drawn(list(truth), 200, seed), 2).coefficients - truth for seed in range(40)])
    assert np.sqrt(np.mean(off**2)) < 0.02


def test_pieces_are_pooled_and_nothing_is_taken_across_a_gap() -> None:
    series = drawn([0.9], 6000, 3)
    broken = np.concatenate([series[:2000], np.full(50, 1e6), series[2000:]])
    pieces = [(0, 2000), (2050, 6050)]
    model = burg(broken, 1, pieces)
    # (1 − a²)/n is 0.0056²; four of these.
    assert model.coefficients[0] == pytest.approx(0.9, abs=4 * 0.0056)
    assert model.samples == 6000
    assert whiteness(broken, model, pieces) > 0.01


def test_bic_finds_the_order_and_the_rest_is_white() -> None:
    series = drawn([0.6, 0.0, -0.4], 6000, 11)
    chosen = choose_order(series, 12)
    assert chosen.order == 3
    assert whiteness(series, chosen) > 0.01
    assert whiteness(series, burg(series, 2)) < 1e-6


def test_white_noise_has_order_zero_and_an_honest_test() -> None:
    """Of 200 white series about 5 % fail at 5 %: 10 ± 3.1, four of these."""
    rng = np.random.default_rng(2)
    series = rng.standard_normal((200, 800))
    orders = [choose_order(x, 6).order for x in series[:40]]
    assert np.mean(np.array(orders) == 0) > 0.9
    failed = sum(whiteness(x, burg(x, 0)) < 0.05 for x in series)
    assert 0 < failed < 23


def test_the_spectrum_integrates_to_the_variance_and_lies_on_welch() -> None:
    rate = 200.0
    series = drawn([1.2, -0.5], 200_000, 4)
    model = burg(series, 2)
    fine = (np.arange(20_000) + 0.5) / 20_000 * rate / 2
    whole = model.power_spectrum(fine, rate).mean() * rate
    assert whole == pytest.approx(model.autocovariance(0)[0], rel=1e-6)
    welch = power_spectrum(series, rate, segment=512)
    ratio = welch.density[2:-2, 0] / (2.0 * model.power_spectrum(welch.frequency[2:-2], rate))
    # 780 overlapping segments know each line to 4 %; 250 lines the mean to 0.3 %.
    assert ratio.mean() == pytest.approx(1.0, abs=0.012)
    assert ratio.std() < 0.06


def test_means_over_long_times_scatter_by_the_random_walk() -> None:
    series = drawn([0.9], 1_000_000, 6)
    means = series.reshape(2000, 500).mean(axis=1)
    # 2000 means know their scatter to 1.6 %; 500 samples are 50 correlation times, which makes 1 % less.
    assert means.std() * np.sqrt(500.0) == pytest.approx(burg(series, 1).random_walk, rel=0.07)


def test_predictions_leave_the_innovations_over() -> None:
    series = drawn([1.2, -0.5], 20_000, 7) - 3.0
    model = burg(series, 2)
    left = (series - model.predicted(series))[2:]
    assert np.isnan(model.predicted(series)[:2]).all()
    assert left.var() == pytest.approx(model.innovation_variance, rel=1e-3)


def test_the_ladder_is_every_order_alone() -> None:
    ladder = burg_ladder(LH, 4)
    for order, model in enumerate(ladder):
        assert model.coefficients == pytest.approx(burg(LH, order).coefficients, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: burg(np.ones(100), 2), "never changes"),
        (lambda: burg(np.arange(5.0), 4), "12 samples"),
        (lambda: whiteness(LH[:20], burg(LH, 2)), "22 lags"),
    ],
)
def test_what_cannot_be_is_a_sentence(call: object, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        call()  # type: ignore[operator]
