"""The conditions of holds and turns: their derivatives, their covariance, and where the chain breaks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from tumble.calibration.equations.turn import (
    EARTH,
    FORCE,
    G_SENSITIVITY,
    GYRO_BIAS,
    GYRO_MATRIX,
    NORM,
    RATE,
    TOTAL,
    TURN,
    ExtraVariances,
    TurnConditions,
)
from tumble.earth import EARTH_RATE

EVERY = np.arange(TOTAL)


def conditions_of(
    tumbled: Any, site: Any, values: np.ndarray, extra: ExtraVariances | None = None
) -> TurnConditions:
    data = tumbled.data()
    return TurnConditions(
        data, site.gravity, values, EVERY, np.ones((data.holds, 6), dtype=bool), extra or ExtraVariances()
    )


def with_earth_rate(quiet: Any, site: Any, truth: np.ndarray) -> np.ndarray:
    """The true unknowns, the Earth rate of the first hold from its own first attitude."""
    values = truth.copy()
    rest = quiet.means.angular_rate[0] - values[GYRO_BIAS]
    force = np.linalg.solve(matrix_of(values), quiet.means.specific_force[0] - values[:3])
    rest = rest - values[G_SENSITIVITY].reshape(3, 3) @ force
    values[EARTH] = np.linalg.solve(values[GYRO_MATRIX].reshape(3, 3), rest)
    return values


def matrix_of(values: np.ndarray) -> np.ndarray:
    from tumble.calibration.equations.triad_unknowns import triad_from_unknowns

    return triad_from_unknowns(values[FORCE]).matrix


def test_the_truth_leaves_no_misclosure(quiet: Any, site: Any, truth: np.ndarray) -> None:
    """Every condition holds for a recording without noise, the Earth turning below it.

    Truncation: the accelerometer's sample is the middle's value, the gyro's the mean over its interval:
    g-sensitivity of 7e-4 (rad/s)/(m/s²) is seen to (1.5 rad/s x 0.01 s)² / 24 of itself; the gyro is
    linear between its samples.
    """
    values = with_earth_rate(quiet, site, truth)
    assert np.linalg.norm(values[EARTH]) == pytest.approx(EARTH_RATE, rel=1e-3)
    linear = conditions_of(quiet, site, values).linearise(values)
    np.testing.assert_allclose(linear.misclosure[:, NORM], 0.0, atol=1e-8)
    np.testing.assert_allclose(linear.misclosure[:, RATE], 0.0, atol=2e-8)
    np.testing.assert_allclose(linear.misclosure[:-1, TURN], 0.0, atol=2e-6)


def numerical_design(tumbled: Any, site: Any, values: np.ndarray) -> np.ndarray:
    """Central differences; each step is some 1e-5 of the unknown's size (g-sensitivity, Earth rate: absolute)."""
    step = np.full(TOTAL, 1e-6)
    step[9:12], step[G_SENSITIVITY], step[EARTH] = 1e-8, 1e-7, 1e-6
    columns = []
    for index in range(TOTAL):
        moved = []
        for sign in (1.0, -1.0):
            x = values.copy()
            x[index] += sign * step[index]
            moved.append(conditions_of(tumbled, site, x).linearise(x).misclosure)
        columns.append((moved[0] - moved[1]) / (2.0 * step[index]))
    return np.stack(columns, axis=2)


@pytest.fixture(scope="module")
def still_earth(play: Any) -> Any:
    """A recording without noise on an Earth that stands still, and the numerical design of its conditions."""
    return play(noise=(1e-9, 1e-11), earth=False)


@pytest.mark.parametrize(
    ("rows", "columns", "limit"),
    [
        # Arithmetic: rounding of 1e-15 over steps of 1e-6 (1e-8 for quadratic terms), and the step squared.
        pytest.param(NORM, FORCE, 1e-6, id="norms by the accelerometer"),
        pytest.param(NORM, slice(12, 36), 0.0, id="norms by the gyro, which they do not know"),
        pytest.param(RATE, GYRO_MATRIX, 1e-8, id="rates by the gyro's matrix"),
        pytest.param(RATE, GYRO_BIAS, 1e-8, id="rates by the gyro's bias"),
        pytest.param(RATE, G_SENSITIVITY, 1e-6, id="rates by g-sensitivity"),
        pytest.param(RATE, EARTH, 1e-8, id="rates by the Earth rate"),
        # Truncation: integrals of the design are trapezoids, off by a sample's rotation squared over 12:
        # (2.9 rad/s x 0.01 s)² / 12 = 7e-5 of entries up to 2 (matrix, bias) and 13 (g-sensitivity).
        pytest.param(TURN, GYRO_MATRIX, 1.4e-4, id="turns by the gyro's matrix"),
        pytest.param(TURN, GYRO_BIAS, 1.4e-4, id="turns by the gyro's bias"),
        pytest.param(TURN, G_SENSITIVITY, 9e-4, id="turns by g-sensitivity"),
        pytest.param(TURN, EARTH, 1e-6, id="turns by the Earth rate"),
    ],
)
def test_the_design_is_the_derivative_of_the_misclosure(
    still_earth: Any, site: Any, truth: np.ndarray, rows: slice, columns: slice, limit: float
) -> None:
    exact = conditions_of(still_earth, site, truth).linearise(truth).design[:, rows, columns]
    numerical = numerical_design(still_earth, site, truth)[:, rows, columns]
    np.testing.assert_allclose(exact, numerical, atol=limit)


def test_the_design_by_the_accelerometer_leaves_out_only_what_passes_through_g_sensitivity(
    still_earth: Any, site: Any, truth: np.ndarray
) -> None:
    """A bias error of 1 mm/s² moves a rate by 7e-7 rad/s through a g-sensitivity of 7e-4: it is left out.

    What is left out is known in closed form for the rates, inverse(M_g) G d f / d unknown, and over a
    turn (2 s and both edge samples) at most its integral.
    """
    from tumble.calibration.equations.triad_unknowns import correct_with_derivatives

    exact = conditions_of(still_earth, site, truth).linearise(truth).design[:, :, FORCE]
    missing = numerical_design(still_earth, site, truth)[:, :, FORCE] - exact
    by_unknowns = correct_with_derivatives(truth[FORCE], still_earth.means.specific_force).by_unknowns
    through = (
        np.linalg.solve(truth[GYRO_MATRIX].reshape(3, 3), truth[G_SENSITIVITY].reshape(3, 3)) @ by_unknowns
    )
    np.testing.assert_allclose(missing[:, RATE], through, atol=1e-6)
    largest = np.max(np.linalg.norm(through, axis=1))
    assert np.max(np.abs(missing[:, TURN, :9])) < 2.1 * largest
    assert np.max(np.abs(through)) > 1e-3  # there is something to leave out


def test_on_a_turning_earth_the_design_is_off_by_no_more_than_the_earth_turns(
    quiet: Any, site: Any, truth: np.ndarray
) -> None:
    """The Earth rate is carried along by the gyro; how errors of the gyro turn it is left out.

    At most: the Earth rate times all that a gyro unknown turns from the first hold on, for a turn
    times its 2 s. That is below 1e-3 of the design, and moves the solution by that share of the residuals.
    """
    values = with_earth_rate(quiet, site, truth)
    exact = conditions_of(quiet, site, values).linearise(values).design
    missing = numerical_design(quiet, site, values) - exact
    gyro = slice(GYRO_MATRIX.start, G_SENSITIVITY.stop)
    turned = np.sum(np.linalg.norm(exact[:, TURN, gyro], axis=1), axis=0)
    for rows, seconds in ((RATE, 1.0), (TURN, 2.1)):
        # 3: the part about the vertical, which the turn conditions do not see, is as large as the others.
        assert np.all(np.abs(missing[:, rows, gyro]) <= 3.0 * seconds * EARTH_RATE * turned + 2e-4)


def dense(linear: Any) -> np.ndarray:
    """The whole covariance of the conditions from its blocks."""
    groups, size = linear.misclosure.shape
    whole = np.zeros((groups * size, groups * size))
    for k in range(groups):
        own = slice(k * size, (k + 1) * size)
        whole[own, own] = linear.covariance[k]
        if k:
            before = slice((k - 1) * size, k * size)
            whole[own, before] = linear.covariance_lower[k - 1]
            whole[before, own] = linear.covariance_lower[k - 1].T
    return whole


def test_the_covariance_of_all_conditions_is_symmetric_and_positive_definite(
    tumbled: Any, site: Any, truth: np.ndarray
) -> None:
    """As a correlation matrix, so that m/s² and rad weigh alike; a share of 1e-6 is far above rounding."""
    linear = conditions_of(tumbled, site, truth, ExtraVariances(1e-6, 1e-10, 1e-6)).linearise(truth)
    whole = dense(linear)
    scale = np.sqrt(np.diag(whole))
    correlation = whole / np.outer(scale, scale)
    np.testing.assert_allclose(correlation, correlation.T, atol=1e-12)
    assert np.linalg.eigvalsh(correlation)[0] > 1e-6


def test_the_covariance_is_that_of_misclosures_of_many_recordings(
    play: Any, site: Any, truth: np.ndarray
) -> None:
    """120 recordings of the same motion with other noise; each condition's variance within its chi-square.

    28 ratios of 120 draws each stay inside 0.55 to 1.63 in 999 of 1000 cases: chi-square with 120
    degrees of freedom over 120 at 1e-3 / 56 on either side.
    """
    drawn, stated = [], []
    values = with_earth_rate(play(holds=5, noise=(1e-9, 1e-11)), site, truth)
    for seed in range(120):
        linear = conditions_of(play(holds=5, noise_seed=seed), site, values).linearise(values)
        drawn.append(linear.misclosure)
        stated.append(np.diagonal(linear.covariance, axis1=1, axis2=2))
    ratio = np.mean(np.square(drawn), axis=0) / np.mean(stated, axis=0)
    checked = np.concatenate([ratio[:, NORM].ravel(), ratio[:, RATE].ravel(), ratio[:-1, TURN].ravel()])
    assert checked.size == 28
    assert np.all((checked > 0.55) & (checked < 1.63))


@dataclass(frozen=True)
class WithWanderingBias:
    """A recording whose accelerometers' bias is another in every hold, and constant within it.

    The holds' covariance says so; that the bias wanders within a hold, too, is taken out of it.
    """

    tumbled: Any
    size: float
    seed: int

    def data(self) -> Any:
        data = self.tumbled.data()
        moved = self.size * np.random.default_rng(self.seed).standard_normal((data.holds, 3))
        force = data.raw_force.copy()
        for hold, offset in zip(self.tumbled.timeline.holds, moved, strict=True):
            force[hold.start : hold.stop] += offset
        return replace(
            data,
            raw_force=force,
            force_mean=data.force_mean + moved,
            force_covariance=data.force_covariance + self.size**2 * np.eye(3),
            force_floor=np.zeros(3),
        )


@pytest.mark.parametrize(("wander", "between"), [(0.0, "a turn and a norm"), (0.02, "a turn and the next")])
def test_conditions_are_correlated_as_the_covariance_says(
    play: Any, site: Any, truth: np.ndarray, wander: float, between: str
) -> None:
    """200 recordings: of a unit whose x accelerometer is ten times as noisy as z, or whose bias wanders.

    Rates at rest are left out: what the force's noise does to them through g-sensitivity (7e-4) is, too.
    A correlation of 200 draws is known to (1 - r²) / sqrt(200); the largest of 78 at 1e-3 is 4.4 of it.
    """
    noise = np.array([0.1, 0.03, 0.01]) if wander == 0.0 else 0.02
    values = with_earth_rate(play(holds=5, noise=(1e-9, 1e-11)), site, truth)
    drawn, stated = [], []
    for seed in range(200):
        tumbled = play(holds=5, noise=(noise, 1e-3), noise_seed=seed)
        linear = conditions_of(WithWanderingBias(tumbled, wander, 1000 + seed), site, values).linearise(
            values
        )
        drawn.append(linear.misclosure.ravel())
        stated.append(dense(linear))
    covariance = np.mean(stated, axis=0)
    linear.active[:, RATE] = False
    used = linear.active.ravel()
    scale = np.sqrt(np.diag(covariance))
    expected = covariance / np.outer(scale, scale)
    # The mean is zero: correlations about zero, not about the sample's mean.
    sample = np.array(drawn)[:, used]
    sample = sample / np.sqrt(np.mean(sample**2, axis=0))
    found, wanted = sample.T @ sample / len(sample), expected[np.ix_(used, used)]
    off = ~np.eye(len(found), dtype=bool)
    assert np.all(np.abs(found - wanted)[off] < 4.4 * (1.0 - wanted**2)[off] / np.sqrt(200.0) + 0.02)
    # There is something to see: a wrong sign would be twice this off.
    turns = [np.array([6 * k + 4, 6 * k + 5]) for k in range(4)]
    if between == "a turn and a norm":
        seen = [expected[np.ix_(turns[k], [6 * k, 6 * k + 6])] for k in range(4)]
    else:
        seen = [expected[np.ix_(turns[k], turns[k + 1])] for k in range(3)]
    assert max(np.max(np.abs(block)) for block in seen) > 0.3


def test_a_turn_that_cannot_be_integrated_has_no_condition_and_breaks_the_chain(
    tumbled: Any, site: Any, truth: np.ndarray
) -> None:
    """Beyond it the Earth rate's direction in b is unknown: the rates get its variance instead."""
    whole = conditions_of(tumbled, site, truth).linearise(truth)
    broken = conditions_of(tumbled.without_turns(4), site, truth).linearise(truth)
    assert whole.active[:-1].all()
    assert not broken.active[4, TURN].any()
    np.testing.assert_array_equal(broken.misclosure[4, TURN], 0.0)
    np.testing.assert_array_equal(broken.design[4, TURN], 0.0)
    # Before the break everything is as it was, and turns after it too.
    np.testing.assert_allclose(broken.misclosure[:4], whole.misclosure[:4], rtol=1e-12)
    np.testing.assert_allclose(broken.design[:5, RATE, EARTH], whole.design[:5, RATE, EARTH], rtol=1e-12)
    np.testing.assert_array_equal(broken.design[5:, RATE, EARTH], 0.0)
    added = np.diagonal(broken.covariance - whole.covariance, axis1=1, axis2=2)[:, RATE]
    np.testing.assert_allclose(added[:5], 0.0, atol=1e-20)
    np.testing.assert_allclose(added[5:], EARTH_RATE**2 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(broken.misclosure[5:-1, TURN], whole.misclosure[5:-1, TURN], atol=1e-3)


def test_the_last_hold_has_no_turn(tumbled: Any, site: Any, truth: np.ndarray) -> None:
    linear = conditions_of(tumbled, site, truth).linearise(truth)
    assert not linear.active[-1, TURN].any()
    np.testing.assert_array_equal(linear.covariance[-1, TURN, TURN], np.eye(2))


def test_a_hold_s_mean_is_adjusted_towards_gravity(tumbled: Any, site: Any, truth: np.ndarray) -> None:
    """e = -Q B' C^-1 w: with the norm alone active, the adjusted mean has gravity's norm, to second order."""
    data = tumbled.data()
    active = np.zeros((data.holds, 6), dtype=bool)
    active[:, 0] = True
    conditions = TurnConditions(data, site.gravity, truth, EVERY, active, ExtraVariances())
    for _ in range(3):
        linear = conditions.linearise(truth)
        multipliers = np.zeros_like(linear.misclosure)
        multipliers[:, 0] = linear.misclosure[:, 0] / linear.covariance[:, 0, 0]
        conditions.adjust_observations(multipliers)
    from tumble.calibration.equations.triad_unknowns import triad_from_unknowns

    adjusted = triad_from_unknowns(truth[FORCE]).correct(conditions._mean)
    before = triad_from_unknowns(truth[FORCE]).correct(data.force_mean)
    assert np.max(np.abs(np.linalg.norm(before, axis=1) - site.gravity)) > 1e-4
    np.testing.assert_allclose(np.linalg.norm(adjusted, axis=1), site.gravity, atol=1e-9)
