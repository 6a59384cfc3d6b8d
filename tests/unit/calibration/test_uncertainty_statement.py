"""Degrees of freedom, coverage, detectable errors and drawn intervals against the guides' own examples."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.evidence import chi_square_probability, coverage_factors, effective_degrees
from tumble.calibration.outcome.budget import numerical_tolerance, shortest_intervals
from tumble.estimation.reliability import noncentrality, undetected


def test_the_end_gauge_of_the_gum_has_16_effective_degrees_of_freedom() -> None:
    """GUM H.1.6: 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, 50 and 2 degrees give 16, and k99 = 2.92 there."""
    sigmas = {
        name: np.array([value]) for name, value in (("ls", 25.0), ("d", 9.7), ("aT", 2.9), ("dT", 16.6))
    }
    degrees = effective_degrees(sigmas, {"ls": 18.0, "d": 25.6, "aT": 50.0, "dT": 2.0})
    assert int(degrees[0]) == 16
    # GUM table G.2: t95 of 16 degrees
    assert coverage_factors(degrees)[0] == pytest.approx(2.12, abs=0.005)


def test_what_is_known_exactly_leaves_the_normal_factor() -> None:
    degrees = effective_degrees({"gravity": np.array([1.0, 2.0])}, {})
    assert np.all(np.isinf(degrees))
    assert coverage_factors(degrees) == pytest.approx([1.96, 1.96], abs=1e-3)


def test_baardas_shift_for_one_in_a_thousand_and_eighty_per_cent_is_4_13() -> None:
    assert noncentrality() == pytest.approx(4.13, abs=0.005)


def test_an_error_of_one_number_goes_unnoticed_up_to_baardas_bound() -> None:
    """sigma 4.13 / sqrt(r), with its effect the gain times that; sigma 0.5 and r 0.36 here."""
    found = undetected(
        np.array([[0.36]]), np.array([[1.0 / 0.5]]), np.array([[0.02], [-0.3]]), np.array([1.0, 2.0])
    )
    assert found.size == pytest.approx(0.5 * noncentrality() / 0.6)
    assert found.parameter == 1
    assert found.effect == pytest.approx(0.15 * noncentrality() / 0.6)


def test_the_most_harmful_direction_is_found_by_trying_all_directions() -> None:
    rng = np.random.default_rng(5)
    half = rng.normal(size=(3, 3))
    left = half @ half.T / 20.0
    gain = rng.normal(size=(1, 3))
    found = undetected(left, np.eye(3), gain, np.ones(1))
    tried = rng.normal(size=(200_000, 3))
    harm = np.abs(tried @ gain[0]) / np.sqrt(np.einsum("ta,ab,tb->t", tried, left, tried))
    # directions that add less than 2 % of the squared harm are left out of what is told
    assert harm.max() * noncentrality() * 0.96 < found.effect <= harm.max() * noncentrality() * 1.001


def test_what_nothing_checks_and_does_harm_may_be_of_any_size() -> None:
    found = undetected(np.diag([0.0, 1.0]), np.eye(2), np.array([[0.4, 0.1]]), np.ones(1))
    assert np.isinf(found.size)
    assert found.parameter == 0


def test_what_nothing_checks_and_does_no_harm_is_passed_over() -> None:
    found = undetected(np.diag([0.0, 1.0]), np.eye(2), np.array([[0.0, 0.1]]), np.ones(1))
    assert found.effect == pytest.approx(0.1 * noncentrality())


def test_the_shortest_interval_of_an_exponential_begins_at_zero() -> None:
    drawn = np.random.default_rng(2).exponential(1.0, (100_000, 1))
    low, high = shortest_intervals(drawn, 0.95)
    # its end scatters by sqrt(0.05 0.95 / 100000) / 0.05 = 0.014
    assert low[0] == pytest.approx(0.0, abs=0.01)
    assert high[0] == pytest.approx(-np.log(0.05), abs=0.05)


def test_the_tolerance_is_half_a_unit_of_the_one_digit() -> None:
    told = numerical_tolerance(np.array([0.00035, 4.2, 9.7, 0.0]))
    assert told == pytest.approx([0.00005, 0.5, 5.0, 0.0])


def test_the_global_test_is_of_both_sides() -> None:
    assert chi_square_probability(3.94, 10.0) == pytest.approx(0.10, abs=2e-3)
    assert chi_square_probability(18.31, 10.0) == pytest.approx(0.10, abs=2e-3)
    assert chi_square_probability(9.5, 10.0) > 0.9
