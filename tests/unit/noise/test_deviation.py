"""Deviations held against their definitions, written out plainly."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.noise.deviation import allan_deviation, choose_averaging, find_pieces


def signal_of(samples: int, seed: int = 1) -> np.ndarray:
    """White noise on a random walk, far from zero, three channels of different sizes."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal((samples, 3)), axis=0)
    return (rng.standard_normal((samples, 3)) + 0.03 * walk) * [1.0, 20.0, 0.3] + [9.8, -400.0, 0.01]


def means_of(y: np.ndarray, m: int) -> np.ndarray:
    """The mean of m samples from each sample on."""
    return np.array([y[i : i + m].mean() for i in range(len(y) - m + 1)])


def by_definition(y: np.ndarray, m: int) -> float:
    """The deviation at m samples from means of clusters, as the standards define it."""
    mean = means_of(y - y.mean(), m)
    return float(np.sqrt(0.5 * np.mean((mean[m:] - mean[:-m]) ** 2)))


@pytest.mark.parametrize("samples", [6, 100, 1003])
def test_a_deviation_is_that_of_its_definition(samples: int) -> None:
    signal = signal_of(samples)
    found = allan_deviation(signal, 50.0, taus="log")
    for k, m in enumerate(found.averaging):
        for channel in range(3):
            plain = by_definition(signal[:, channel], int(m))
            # Both round sums of some thousand terms.
            assert found.deviation[k, channel] == pytest.approx(plain, rel=1e-9)
    assert found.tau == pytest.approx(found.averaging / 50.0)


def test_tiles_of_a_long_signal_join_without_a_seam() -> None:
    """Longer than several tiles of the kernel, with averaging times longer than a tile."""
    signal = signal_of(30_000)[:, 0]
    phase = np.concatenate([[0.0], np.cumsum(signal - signal.mean())])
    for m in (1, 7, 2048, 2049, 9000):
        change = phase[2 * m :] - 2.0 * phase[m:-m] + phase[: -2 * m]
        plain = np.sqrt(np.mean(change**2) / 2.0) / m
        found = allan_deviation(signal, 1.0, taus=[float(m)])
        assert found.deviation[0, 0] == pytest.approx(plain, rel=1e-9)
        assert found.count[0] == change.size


def test_the_level_of_a_signal_costs_no_digits() -> None:
    """A counter's offset of 2^24 is exact in a double; the deviation must not see it."""
    signal = np.round(signal_of(4000)[:, 1])
    plain = allan_deviation(signal, 1.0)
    offset = allan_deviation(signal + 2.0**24, 1.0)
    assert offset.deviation == pytest.approx(plain.deviation, rel=1e-9)


def test_a_ramp_is_a_straight_line() -> None:
    """Allan deviation of a ramp R is R τ/√2 exactly."""
    ramp = 0.25 * np.arange(1000.0)
    allan = allan_deviation(ramp, 10.0)
    assert allan.deviation[:, 0] == pytest.approx(2.5 * allan.tau / np.sqrt(2.0), rel=1e-9)


def test_pieces_between_gaps_are_pooled_by_their_differences() -> None:
    signal = signal_of(3000)
    whole = allan_deviation(signal, 1.0, gaps=[1000, 1900])
    parts = [allan_deviation(part, 1.0) for part in np.split(signal, [1000, 1900])]
    for k, m in enumerate(whole.averaging):
        here = [(part, list(part.averaging).index(m)) for part in parts if m in part.averaging]
        total = sum(part.deviation[i] ** 2 * part.count[i] for part, i in here)
        count = sum(int(part.count[i]) for part, i in here)
        assert whole.count[k] == count
        assert whole.deviation[k] ** 2 == pytest.approx(total / count, rel=1e-9)


def test_rows_that_are_not_finite_part_the_signal() -> None:
    signal = signal_of(2000)
    spoiled = signal.copy()
    spoiled[500:510, 1] = np.nan
    assert find_pieces(spoiled) == [(0, 500), (510, 2000)]
    kept = allan_deviation(np.delete(signal, slice(500, 510), axis=0), 1.0, gaps=[500])
    assert allan_deviation(spoiled, 1.0).deviation == pytest.approx(kept.deviation, rel=1e-12)


def test_infinities_of_both_signs_do_not_hide_each_other() -> None:
    assert find_pieces(np.array([1.0, np.inf, 2.0, -np.inf, 3.0, 4.0])) == [(0, 1), (2, 3), (4, 6)]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("octave", [1, 2, 4, 8, 16]),
        ("log", [1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20]),
    ],
)
def test_named_averaging_times(name: str, expected: list[int]) -> None:
    assert choose_averaging(name, 10.0, 23).tolist() == expected  # type: ignore[arg-type]


def test_given_averaging_times_are_taken_to_whole_samples_once() -> None:
    found = allan_deviation(signal_of(100), 10.0, taus=np.array([0.31, 0.1, 0.29, 4.0, 900.0]))
    assert found.averaging.tolist() == [1, 3, 40]


@pytest.mark.parametrize(
    ("make", "exponent"),
    [(lambda x: x[1:] - x[:-1], 2), (lambda x: x[1:], 0), (lambda x: np.cumsum(x, axis=0)[1:], -2)],
)
def test_the_kind_of_noise_is_told_from_the_slope(make, exponent: int) -> None:  # type: ignore[no-untyped-def]
    white = np.random.default_rng(3).standard_normal((20_001, 2))
    found = allan_deviation(make(white), 1.0)
    assert np.all(found.exponent[1:9] == exponent)


def test_a_single_channel_is_cut_out_as_it_is() -> None:
    found = allan_deviation(signal_of(500), 1.0)
    assert found.channel(1).low.tolist() == found.low[:, 1:2].tolist()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"rate": 0.0}, "rate"),
        ({"noise": 1}, "exponent"),
        ({"noise": -3}, "exponent"),
        ({"taus": "weekly"}, "weekly"),
        ({"taus": [0.001]}, "No averaging time"),
        ({"taus": [np.nan]}, "finite"),
    ],
)
def test_what_cannot_be_is_refused_in_words(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        allan_deviation(signal_of(50), **{"rate": 1.0, **arguments})  # type: ignore[arg-type]


def test_a_signal_of_one_sample_is_refused() -> None:
    with pytest.raises(UsageError, match="too few samples"):
        allan_deviation(np.array([1.0]), 1.0)
