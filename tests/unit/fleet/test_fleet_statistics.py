"""What only many units tell: outliers and what is shared, at the stated chances, on fleets drawn anew."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tumble.fleet import Units, find_outlying, find_shared
from tumble.fleet.outlying import loud_or_dead, robust_location_and_spread

GROUPS = ("accelerometer bias", "accelerometer scale factor error", "gyro bias", "gyro scale factor error")
NAMES = tuple(f"{group} {axis}" for group in GROUPS for axis in "xyz")
DIMENSION = len(NAMES)


def fleet(rng: np.random.Generator, count: int, sigma: float = 0.03) -> Units:
    """Units whose parameters are correlated, each known with an uncertainty of its own."""
    root = np.tril(rng.normal(0.0, 0.3, (DIMENSION, DIMENSION)), -1) + np.diag(
        np.linspace(0.5, 2.0, DIMENSION)
    )
    own = sigma * rng.uniform(0.7, 1.5, (count, DIMENSION))
    values = rng.normal(size=(count, DIMENSION)) @ root.T + own * rng.normal(size=(count, DIMENSION))
    covariances = np.array([np.diag(row**2) for row in own])
    return Units(NAMES, ("1",) * DIMENSION, tuple(range(count)), values, covariances)


@pytest.mark.parametrize(("count", "runs"), [(12, 60), (40, 30), (150, 20)])
def test_a_good_fleet_has_a_unit_named_no_more_often_than_stated(count: int, runs: int) -> None:
    """At 10 % more than the limit once in a thousand; at 40 % of 20 runs it is passed in six of ten."""
    rng, alarm = np.random.default_rng(count), 0.1
    named = sum(bool(find_outlying(fleet(rng, count), alarm)) for _ in range(runs))
    assert named <= binom.isf(1e-3, runs, alarm)


def test_faulty_units_are_named_by_what_is_wrong_with_them() -> None:
    rng = np.random.default_rng(3)
    units = fleet(rng, 120)
    units.values[17, 4] += 25.0
    units.values[80, 8] -= 25.0
    named = {one.unit: one for one in find_outlying(units)}
    assert set(named) == {17, 80}
    assert named[17].worst == "accelerometer scale factor error y"
    assert named[80].worst == "gyro bias z"
    assert named[80].sigmas < -4.0


@pytest.mark.parametrize("copies", [20, 16])
def test_copies_of_one_recording_compare_nothing(copies: int) -> None:
    units = fleet(np.random.default_rng(8), 20)
    units.values[:copies] = units.values[0]
    assert find_outlying(units) == []


def test_a_third_of_the_fleet_cannot_hide_itself() -> None:
    rng = np.random.default_rng(4)
    units = fleet(rng, 60)
    units.values[:18, 1] += 40.0
    assert {one.unit for one in find_outlying(units)} == set(range(18))


def test_a_unit_that_is_known_worse_may_be_farther_off() -> None:
    rng = np.random.default_rng(5)
    units = fleet(rng, 100)
    units.values[7, 0] += 30.0
    units.covariances[7, 0, 0] = 15.0**2
    assert 7 not in {one.unit for one in find_outlying(units)}


def test_units_and_order_of_parameters_do_not_matter() -> None:
    rng = np.random.default_rng(6)
    units = fleet(rng, 50)
    units.values[3, 5] += 30.0
    scale = 10.0 ** rng.uniform(-6, 6, DIMENSION)
    scaled = Units(
        NAMES, units.units, units.which, units.values * scale, units.covariances * np.outer(scale, scale)
    )
    one, two = find_outlying(units), find_outlying(scaled)
    assert [x.unit for x in one] == [x.unit for x in two] == [3]
    assert one[0].distance == pytest.approx(two[0].distance, rel=1e-6)


def test_the_robust_spread_is_the_spread() -> None:
    rng = np.random.default_rng(8)
    root = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, 0.0], [-0.2, 0.4, 2.0]])
    x = rng.normal(size=(40_000, 3)) @ root.T + [1.0, -2.0, 3.0]
    centre, spread = robust_location_and_spread(x)
    # A few per cent: the estimate is not unbiased for correlated columns, and the tests after it are exact.
    assert np.allclose(centre, [1.0, -2.0, 3.0], atol=0.05)
    assert np.allclose(spread, root @ root.T, atol=0.2)


def test_a_lot_that_all_bad_units_are_of_is_said_and_chance_is_not() -> None:
    rng = np.random.default_rng(10)
    lots = ["A"] * 150 + ["B"] * 50
    bad = [False] * 152 + [True] * 6 + [False] * 42
    (sentence,) = find_shared(bad, {"lot": lots, "operator": [str(n % 3) for n in range(200)]})
    assert "6 have lot 'B', as 50 of all 200" in sentence
    said = sum(
        bool(find_shared(list(rng.permutation(bad)), {"lot": lots, "day": [str(n % 7) for n in range(200)]}))
        for _ in range(200)
    )
    assert said <= 8  # 1 %, binomial of 200: 9 or more once in ten thousand


def test_a_loud_and_a_dead_channel_are_found() -> None:
    rng = np.random.default_rng(11)
    noise = [0.01 * np.exp(0.05 * rng.normal(size=3)) for _ in range(60)]
    noise[5][1] *= 3.0
    noise[9][2] = 0.0
    found = {(unit, channel): factor for unit, channel, factor in loud_or_dead(noise)}
    assert set(found) == {(5, 1), (9, 2)}
    assert found[9, 2] == 0.0
    assert found[5, 1] == pytest.approx(3.0, rel=0.3)
