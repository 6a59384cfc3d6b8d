"""What only many units tell: outliers, what is shared, drift, due dates, spread and charts, at the stated chances."""

import numpy as np
import pytest
from scipy.stats import binom

from tumble.fleet import find_outlying, find_shared
from tumble.fleet.drift import YEAR, due_after, ewma_chart, find_drift
from tumble.fleet.fleet_document import between_units
from tumble.fleet.outlying import loud_or_dead, robust_location_and_spread
from tumble.fleet.unit_vector import Units

GROUPS = ("accelerometer bias", "accelerometer scale factor error", "gyro bias", "gyro scale factor error")
NAMES = tuple(f"{group} {axis}" for group in GROUPS for axis in "xyz")
DIMENSION = len(NAMES)


def fleet(rng, count, sigma=0.03):
    """Units whose parameters are correlated, each known with an uncertainty of its own."""
    root = np.tril(rng.normal(0.0, 0.3, (DIMENSION, DIMENSION)), -1) + np.diag(
        np.linspace(0.5, 2.0, DIMENSION)
    )
    own = sigma * rng.uniform(0.7, 1.5, (count, DIMENSION))
    values = rng.normal(size=(count, DIMENSION)) @ root.T + own * rng.normal(size=(count, DIMENSION))
    covariances = np.array([np.diag(row**2) for row in own])
    return Units(NAMES, ("1",) * DIMENSION, tuple(range(count)), values, covariances)


@pytest.mark.parametrize(("count", "runs"), [(12, 60), (40, 30), (150, 20)])
def test_a_good_fleet_has_a_unit_named_no_more_often_than_stated(count, runs):
    """At 10 % more than the limit once in a thousand; at 40 % of 20 runs it is passed in six of ten."""
    rng, alarm = np.random.default_rng(count), 0.1
    named = sum(bool(find_outlying(fleet(rng, count), alarm)) for _ in range(runs))
    assert named <= binom.isf(1e-3, runs, alarm)


def test_faulty_units_are_named_by_what_is_wrong_with_them():
    rng = np.random.default_rng(3)
    units = fleet(rng, 120)
    units.values[17, 4] += 25.0
    units.values[80, 8] -= 25.0
    named = {one.unit: one for one in find_outlying(units)}
    assert set(named) == {17, 80}
    assert named[17].worst == "accelerometer scale factor error y"
    assert named[80].worst == "gyro bias z"
    assert named[80].sigmas < -4.0
    # A unit that is known worse may be farther off.
    units.covariances[17, 4, 4] = 15.0**2
    assert 17 not in {one.unit for one in find_outlying(units)}
    # A third of the fleet cannot hide itself, and copies of one recording compare nothing.
    third = fleet(np.random.default_rng(4), 60)
    third.values[:18, 1] += 40.0
    assert {one.unit for one in find_outlying(third)} == set(range(18))
    for copies in (20, 16):
        few = fleet(np.random.default_rng(8), 20)
        few.values[:copies] = few.values[0]
        assert find_outlying(few) == []


def test_units_and_order_of_parameters_do_not_matter():
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


def test_the_robust_spread_is_the_spread():
    rng = np.random.default_rng(8)
    root = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, 0.0], [-0.2, 0.4, 2.0]])
    x = rng.normal(size=(40_000, 3)) @ root.T + [1.0, -2.0, 3.0]
    centre, spread = robust_location_and_spread(x)
    # A few per cent: the estimate is not unbiased for correlated columns, and the tests after it are exact.
    assert np.allclose(centre, [1.0, -2.0, 3.0], atol=0.05)
    assert np.allclose(spread, root @ root.T, atol=0.2)


def test_a_lot_that_all_bad_units_are_of_is_said_and_chance_is_not():
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


def test_a_loud_and_a_dead_channel_are_found():
    rng = np.random.default_rng(11)
    noise = [0.01 * np.exp(0.05 * rng.normal(size=3)) for _ in range(60)]
    noise[5][1] *= 3.0
    noise[9][2] = 0.0
    found = {(unit, channel): factor for unit, channel, factor in loud_or_dead(noise)}
    assert set(found) == {(5, 1), (9, 2)}
    assert found[9, 2] == 0.0
    assert found[5, 1] == pytest.approx(3.0, rel=0.3)


def drawn(rng, units, counts, scatter):
    """Units that drift by rates of mean 0.3 and spread 0.5 a year, calibrated at irregular times."""
    unit = np.repeat(np.arange(units), counts)
    time = np.concatenate([np.sort(rng.uniform(0.0, 4.0, count)) for count in counts])
    rates = rng.normal(0.3, 0.5, units)
    sigmas = rng.uniform(0.05, 0.2, len(unit))
    level = rng.normal(0.0, 5.0, units)
    values = (
        level[unit]
        + rates[unit] * time
        + rng.normal(0.0, scatter, len(unit))
        + rng.normal(size=len(unit)) * sigmas
    )
    return unit, time * YEAR, values[:, None], sigmas[:, None], rates


@pytest.mark.slow
def test_the_rate_is_within_its_stated_uncertainty():
    rng = np.random.default_rng(1)
    inside = total = 0
    for _ in range(40):
        unit, time, values, sigmas, rates = drawn(rng, 30, rng.integers(1, 6, 30), 0.15)
        drift = find_drift(unit, time, values, sigmas)
        inside += int(np.sum(np.abs(drift.rate[:, 0] - rates) < 1.96 * drift.rate_sigma[:, 0]))
        total += 30
    # 95 % less what the spread's own uncertainty costs; binomial of 1200: ± 1.9 % at three sigma.
    assert 0.92 < inside / total < 0.97


def test_the_scatter_from_one_calibration_to_the_next_is_found():
    rng = np.random.default_rng(2)
    unit, time, values, sigmas, _ = drawn(rng, 400, np.full(400, 5), 0.3)
    assert find_drift(unit, time, values, sigmas).scatter[0] == pytest.approx(0.3, rel=0.06)
    unit, time, values, sigmas, _ = drawn(rng, 400, np.full(400, 5), 0.0)
    assert find_drift(unit, time, values, sigmas).scatter[0] < 0.03


def test_one_line_is_the_textbook_s():
    time = np.array([0.0, 1.0, 3.0]) * YEAR
    values, sigmas = np.array([[1.0], [1.5], [3.1]]), np.array([[0.1], [0.2], [0.1]])
    drift = find_drift(np.zeros(3, int), time, values, sigmas)
    design = np.column_stack([np.ones(3), time / YEAR])
    weights = np.diag(1.0 / sigmas[:, 0] ** 2)
    covariance = np.linalg.inv(design.T @ weights @ design)
    assert drift.scatter[0] == 0.0
    assert drift.rate[0, 0] == pytest.approx((covariance @ design.T @ weights @ values[:, 0])[1], rel=1e-9)
    assert drift.rate_sigma[0, 0] == pytest.approx(np.sqrt(covariance[1, 1]), rel=1e-9)


def test_a_unit_is_due_where_its_drift_and_twice_its_uncertainty_meet_the_tolerance():
    rng = np.random.default_rng(3)
    unit, time, values, sigmas, _ = drawn(rng, 20, rng.integers(2, 6, 20), 0.1)
    drift = find_drift(unit, time, values, sigmas)
    after = due_after(drift, np.array([3.0]))[:, 0]
    spread = np.sqrt((drift.rate_sigma[:, 0] * after) ** 2 + drift.last_sigma[:, 0] ** 2)
    assert np.allclose(np.abs(drift.rate[:, 0]) * after + 2.0 * spread, 3.0, rtol=1e-9)
    assert np.all(due_after(drift, np.array([0.01]))[:, 0] == 0.0)
    assert np.all(np.isinf(due_after(drift, np.array([np.inf]))[:, 0]))


def test_a_unit_with_one_calibration_is_judged_by_the_others():
    rng = np.random.default_rng(5)
    counts = np.array([1] + [4] * 30)
    unit, time, values, sigmas, _ = drawn(rng, 31, counts, 0.1)
    drift = find_drift(unit, time, values, sigmas)
    assert drift.rate[0, 0] == pytest.approx(drift.usual_rate[0])
    assert drift.rate_sigma[0, 0] == pytest.approx(drift.rate_spread[0])
    alone = find_drift(unit[:1], time[:1], values[:1], sigmas[:1])
    assert np.isinf(alone.rate_sigma[0, 0])
    assert np.isnan(due_after(alone, np.array([1.0]))[0, 0])


@pytest.mark.slow
def test_the_spread_between_units_is_recovered_and_covered():
    """Mean and standard deviations are within 1.96 of their stated uncertainties in some 95 % of 200 fleets."""
    rng = np.random.default_rng(6)
    truth = np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.3], [0.0, -0.3, 0.5]])
    root, mean = np.linalg.cholesky(truth), np.array([3.0, -1.0, 0.2])
    means = spreads = 0
    for _ in range(200):
        own = rng.uniform(0.2, 0.9, (40, 3))
        values = mean + rng.normal(size=(40, 3)) @ root.T + own * rng.normal(size=(40, 3))
        found = between_units(values, np.array([np.diag(row**2) for row in own]))
        means += int(np.sum(np.abs(found.mean - mean) < 1.96 * np.sqrt(np.diag(found.mean_covariance))))
        spreads += int(np.sum(np.abs(found.spread - np.sqrt(np.diag(truth))) < 1.96 * found.spread_sigma))
    # Binomial of 600, correlated in threes: ± 4 % at four sigma; t with 39 degrees takes 0.7 % off.
    assert 0.90 < means / 600 < 0.98
    assert 0.88 < spreads / 600 < 0.985


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 20, 60])
def test_a_next_unit_lies_where_the_fleet_says(count):
    """One parameter from the eight others, and all of them together: few units do not claim what they cannot know."""
    rng = np.random.default_rng(count)
    truth = np.kron(np.eye(3), 0.6 * np.ones((3, 3)) + 0.4 * np.eye(3))
    truth = truth * np.outer(np.linspace(0.5, 3.0, 9), np.linspace(0.5, 3.0, 9))
    root, distances, inside = np.linalg.cholesky(truth), list[float](), 0
    for _ in range(120):
        values = rng.normal(size=(count, 9)) @ root.T + 0.1 * rng.normal(size=(count, 9))
        found = between_units(values, np.tile(0.01 * np.eye(9), (count, 1, 1)))
        off, P = rng.normal(size=9) @ root.T - found.mean, found.predictive
        distances.append(float(off @ np.linalg.solve(P, off)) / 9.0)
        weights = np.linalg.solve(P[:8, :8], P[:8, 8])
        sigma = np.sqrt(P[8, 8] - weights @ P[:8, 8])
        inside += bool(abs(off[8] - weights @ off[:8]) < 2.0 * sigma)
    # The plain covariance of eight units gives distances of a hundred, and of twenty 2.4.
    assert 0.8 < np.mean(distances) < 1.7
    assert inside / 120 > 0.85


def test_restricted_maximum_likelihood_is_at_its_maximum():
    """Against the likelihood written down once more, tried in random directions."""
    rng = np.random.default_rng(7)
    own = rng.uniform(0.2, 0.9, (25, 2))
    covariances = np.array([np.diag(row**2) + 0.02 for row in own])
    values = rng.normal(size=(25, 2)) @ np.array([[1.0, 0.5], [0.0, 1.5]]) + own * rng.normal(size=(25, 2))
    found = between_units(values, covariances)

    def likelihood(between):
        v = covariances + between
        w = np.linalg.inv(v)
        information = w.sum(axis=0)
        mean = np.linalg.solve(information, np.einsum("ijk,ik->j", w, values))
        r = values - mean
        logs = np.linalg.slogdet(v)[1].sum() + np.linalg.slogdet(information)[1]
        return -0.5 * float(logs + np.einsum("ij,ijk,ik->", r, w, r))

    best = likelihood(found.covariance)
    for _ in range(50):
        step = rng.normal(size=(2, 2)) * 0.05
        assert likelihood(found.covariance + step + step.T) < best + 1e-4


@pytest.mark.slow
def test_the_chart_signals_a_shift_and_hardly_anything_else():
    rng = np.random.default_rng(8)
    alarms = 0
    for _ in range(200):
        values = rng.normal(size=(40, 3)) * [1.0, 5.0, 0.1]
        chart = ewma_chart(values, np.ones((40, 3)) * [1.0, 5.0, 0.1], np.zeros(3), 5)
        alarms += bool(np.any(chart.signals))
    assert alarms < 14  # 2.2 % of 1,000 such charts; binomial of 200: 14 or more once in ten thousand
    values = rng.normal(size=(40, 3))
    values[20:, 1] += 3.0
    chart = ewma_chart(values, np.ones((40, 3)), np.zeros(3), 5)
    assert np.any(chart.signals[20:, 1])
