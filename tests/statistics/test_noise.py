"""Simulated noise has the Allan deviation of its coefficients (IEEE Std 952), and reproduces bit for bit.

Each test averages the Allan variance of many short records. The averages are normal to a good
approximation, with a spread that is taken from the records themselves; a test with c comparisons allows
z = 4.5 for each, a false alarm in c times 7e-6.

Intervals of deviations hold what they say, over hundreds of such signals.
"""

import numpy as np
import pytest

from tumble.noise import allan_deviation
from tumble.simulation import TriadNoise, simulate_noise

RATE = 50.0
LARGEST_Z = 4.5


def overlapping_allan_variance(signal: np.ndarray, length: int) -> np.ndarray:
    """Of each column, IEEE Std 1554's overlapping estimate, from the definition by sums."""
    angle = np.concatenate([np.zeros((1, signal.shape[1])), np.cumsum(signal, axis=0)])
    second = angle[2 * length :] - 2.0 * angle[length:-length] + angle[: -2 * length]
    return 0.5 * np.mean(second**2, axis=0) / length**2


def records_of(noise: TriadNoise, lengths: tuple[int, ...], seed: int, samples: int = 4000) -> np.ndarray:
    """(records x axes, lengths) Allan variances of independent records."""
    rng = np.random.Generator(np.random.SFC64(seed))
    rows = [
        np.array([overlapping_allan_variance(record, length) for length in lengths]).T
        for record in (simulate_noise(noise, samples, RATE, rng) for _ in range(200))
    ]
    return np.concatenate(rows)


def check(records: np.ndarray, expected: np.ndarray) -> None:
    spread = records.std(axis=0) / np.sqrt(len(records))
    np.testing.assert_array_less(np.abs(records.mean(axis=0) - expected) / spread, LARGEST_Z)


LENGTHS = (1, 3, 10, 40, 200)


def test_white_noise_falls_as_n_over_the_root_of_tau() -> None:
    tau = np.array(LENGTHS) / RATE
    check(records_of(TriadNoise(random_walk=0.03), LENGTHS, 1), 0.03**2 / tau)


def test_a_rate_random_walk_rises_as_k_root_tau_over_three() -> None:
    """σ² = K² τ / 3 for the continuous process; for one of steps each of K²/rate, (2 m² + 1) / (6 m rate)."""
    m = np.array(LENGTHS)
    check(records_of(TriadNoise(rate_random_walk=0.2), LENGTHS, 2), 0.2**2 * (2 * m**2 + 1) / (6 * m * RATE))


def test_flicker_stays_at_its_floor() -> None:
    """0.664 B, from 0.2 s on (the sampling filters faster noise) to a tenth of the record.

    The ladder of corners makes a ripple of 2 % in the spectrum, which is allowed on top of statistics.
    """
    lengths = (10, 20, 50, 100, 200)
    records = records_of(TriadNoise(bias_instability=0.5), lengths, 3)
    floor = 2.0 * np.log(2.0) / np.pi * 0.5**2
    spread = records.std(axis=0) / np.sqrt(len(records))
    off = np.abs(records.mean(axis=0) - floor)
    np.testing.assert_array_less(off, 0.03 * floor + LARGEST_Z * spread)


def test_flicker_from_one_drive_has_the_covariances_of_independent_processes() -> None:
    """The lag covariances of the first 200 samples against the sum of Gauss-Markov processes, exactly known."""
    instability, samples = 0.7, 200
    corner, total = 0.25 * RATE / samples, np.zeros(samples)
    lag = np.arange(samples)
    while corner < 0.5 * RATE:
        # variance B² ln 4 / π for each corner, a factor four apart
        total += instability**2 * np.log(4.0) / np.pi * np.exp(-2.0 * np.pi * corner / RATE * lag)
        corner *= 4.0
    rng = np.random.default_rng(4)
    paths = np.concatenate(
        [simulate_noise(TriadNoise(bias_instability=instability), samples, RATE, rng).T for _ in range(3000)]
    )
    for first in (0, 57):
        products = paths[:, [first]] * paths[:, first:]
        spread = products.std(axis=0) / np.sqrt(len(paths))
        z = (products.mean(axis=0) - total[: samples - first]) / spread
        # neighbouring lags are strongly dependent: far fewer than 343 independent comparisons
        assert np.max(np.abs(z)) < LARGEST_Z


def test_the_axes_are_independent() -> None:
    noise = TriadNoise(random_walk=0.1, bias_instability=0.1, rate_random_walk=0.1)
    rng = np.random.default_rng(6)
    ends = np.array([simulate_noise(noise, 50, RATE, rng)[-1] for _ in range(4000)])
    correlation = np.corrcoef(ends.T)[np.triu_indices(3, 1)]
    assert np.max(np.abs(correlation)) < LARGEST_Z / np.sqrt(4000)


@pytest.mark.parametrize("generator", [np.random.PCG64, np.random.SFC64, np.random.MT19937])
def test_the_same_state_gives_the_same_numbers_whatever_the_generator(generator: type) -> None:
    noise = TriadNoise(random_walk=0.1, bias_instability=0.2, rate_random_walk=0.3)
    first, second = (
        simulate_noise(noise, 500, RATE, np.random.Generator(generator(9))).tobytes() for _ in range(2)
    )
    other = simulate_noise(noise, 500, RATE, np.random.Generator(generator(10))).tobytes()
    assert first == second
    assert first != other


def test_white_noise_is_numpy_s_own_stream() -> None:
    """Compiled drawing takes the same numbers from the generator as numpy does, and leaves it in the same state."""
    ours, numpys = np.random.default_rng(11), np.random.default_rng(11)
    drawn = simulate_noise(TriadNoise(random_walk=0.5), 1000, 4.0, ours)
    np.testing.assert_array_equal(drawn, 0.5 * 2.0 * numpys.standard_normal((1000, 3)))
    assert ours.random() == numpys.random()


RUNS, LENGTH = 1500, 1024
# Standard deviations of a share or of a variance over the runs; four of them at some twenty averaging times
# give a false alarm in a thousand.
SIGMAS = 4.0
ONE_SIGMA = 0.6827  # the probability of an interval


def signals(exponent: int) -> np.ndarray:
    white = np.random.default_rng(20).standard_normal((LENGTH + 1, RUNS))
    if exponent == 2:
        return np.diff(white, axis=0)
    return white[1:] if exponent == 0 else np.cumsum(white, axis=0)[1:]


def true_deviation(exponent: int, m: np.ndarray) -> np.ndarray:
    """Allan deviation of discrete white noise, its differences and its sums, worked out by hand."""
    m = m.astype(float)
    if exponent == 2:
        return np.sqrt(3.0) / m
    # A mean of m steps of a walk: the difference of neighbours has the variance (2 m² + 1)/(3 m).
    return 1.0 / np.sqrt(m) if exponent == 0 else np.sqrt((2.0 * m**2 + 1.0) / (6.0 * m))


@pytest.mark.parametrize("exponent", [2, 0, -2])
def test_two_thirds_of_the_intervals_hold_the_true_deviation(exponent: int) -> None:
    found = allan_deviation(signals(exponent), 1.0, noise=exponent)
    truth = true_deviation(exponent, found.averaging)[:, None]
    held = np.mean((found.low < truth) & (truth < found.high), axis=1)
    spread = np.sqrt(ONE_SIGMA * (1.0 - ONE_SIGMA) / RUNS)
    # Greenhall and Riley state a few per cent for their degrees of freedom, a per cent of the coverage; and a sum
    # of squares is not chi square to the last: two per cent more.
    assert held == pytest.approx(ONE_SIGMA, abs=SIGMAS * spread + 0.03)


def test_the_scatter_of_white_noise_is_that_of_its_degrees_of_freedom() -> None:
    found = allan_deviation(signals(0), 1.0, noise=0)
    variance = found.deviation**2
    observed = 2.0 * variance.mean(axis=1) ** 2 / variance.var(axis=1)
    # A variance of a chi square of few degrees of freedom is itself uncertain: kurtosis 12/ν.
    spread = np.sqrt((2.0 + 12.0 / found.edf[:, 0]) / RUNS)
    assert np.all(np.abs(observed / found.edf[:, 0] - 1.0) < SIGMAS * spread + 0.01)


def test_the_kind_of_noise_that_is_found_gives_the_same_coverage_as_the_true_kind() -> None:
    found = allan_deviation(signals(0), 1.0)
    truth = true_deviation(0, found.averaging)[:, None]
    held = np.mean((found.low < truth) & (truth < found.high), axis=1)
    assert held == pytest.approx(ONE_SIGMA, abs=0.08)
