"""What the chain from a sensor to its file does."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.simulation import Imperfections
from tumble.simulation.sampling import count_increments, drop_samples, scatter_instants, scatter_stamps

RATE = 20.0


def test_increments_by_hand() -> None:
    """At 10 Hz a step of 0.5 is a rate of 5: 3 is one step with -2 left over, 3 - 2 is none with 1 left over."""
    signal = np.array([[3.0, -3.0, 0.0], [3.0, -3.0, 2.4], [3.0, -3.0, 2.4]])
    counted = count_increments(signal, 10.0, 0.5)
    np.testing.assert_allclose(counted, [[5.0, -5.0, 0.0], [0.0, 0.0, 0.0], [5.0, -5.0, 5.0]])


def test_what_is_left_over_is_carried_so_that_no_sum_is_off_by_more_than_half_a_step() -> None:
    signal = np.random.default_rng(51).normal(3.0, 2.0, (5000, 3))
    step = 0.07
    counted = count_increments(signal, RATE, step)
    whole = counted / (step * RATE)
    # arithmetic: a product of a whole number and its step, divided by the step again
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-9)
    off = np.cumsum(counted - signal, axis=0) / RATE
    assert np.max(np.abs(off)) <= 0.5 * step + 1e-9


def test_fine_increments_leave_a_long_mean_exact_to_a_step_over_its_time() -> None:
    """2⁻³³ rad over an hour: the carried remainder loses nothing to round-off."""
    signal = np.full((72_000, 3), [0.7, -0.3, 7.3e-5])
    counted = count_increments(signal, RATE, 2.0**-33)
    # half a step over an hour, and the round-off of a mean of numbers below one
    np.testing.assert_allclose(counted.mean(axis=0), signal[0], atol=2.0**-34 / 3600.0 + 2e-15)


def test_without_a_step_the_signal_stays_itself_and_it_is_never_changed_in_place() -> None:
    signal = np.array([[1.23, 4.56, 7.89]])
    assert count_increments(signal, RATE, 0.0) is signal
    before = signal.copy()
    count_increments(signal, RATE, 1.0)
    np.testing.assert_array_equal(signal, before)


def test_stamps_scatter_about_the_instants_and_stay_in_order() -> None:
    time = np.arange(20_000) / RATE
    stamps = scatter_stamps(time, RATE, 0.001, np.random.default_rng(52))
    # 20,000 numbers: 0.5 %, four and a half of them
    assert np.std(stamps - time) == pytest.approx(0.001, rel=0.023)
    wild = scatter_stamps(time, RATE, 10.0, np.random.default_rng(53))
    assert np.all(np.diff(wild) > 0.0)
    assert scatter_stamps(time, RATE, 0.0, np.random.default_rng(54)) is time


def test_instants_begin_where_the_recording_does() -> None:
    edges = 5.0 + np.arange(200) / RATE
    scattered = scatter_instants(edges, RATE, 0.003, np.random.default_rng(55))
    assert scattered[0] == 5.0
    assert np.all(scattered[1:] != edges[1:])


def test_the_first_and_the_last_sample_arrive() -> None:
    for seed in range(50):
        keep = drop_samples(12, 0.5, 3.0, np.random.default_rng(seed))
        assert keep.shape == (12,)
        assert keep[0]
        assert keep[-1]
    assert drop_samples(7, 0.0, 1.0, np.random.default_rng(1)).all()


def test_in_counts_the_increments_are_counts_times_seconds() -> None:
    chain = Imperfections(jitter=0.1, angle_increment=2e-6, velocity_increment=3e-3).in_raw_unit(1000.0, 5e5)
    assert chain == Imperfections(jitter=0.1, angle_increment=1.0, velocity_increment=3.0)
