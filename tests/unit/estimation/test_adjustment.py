"""The adjustment of conditions, its outliers and its weak directions, against published and closed-form answers."""

import numpy as np
import numpy.typing as npt
import pytest
from scipy.stats import chi2, kstest

from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Linearisation, Prior, adjust, find_weak_directions, snoop_groups
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.estimation.reliability import WeakDirection, noncentrality, undetected

Array = npt.NDArray[np.float64]


class LineWithErrorsInBoth:
    """y = intercept + slope x, both coordinates observed with independent errors; one condition a point."""

    def __init__(self, x, y, variance_x, variance_y):
        self.observed = np.column_stack([x, y])
        self.variance = np.column_stack([variance_x, variance_y])
        self.adjusted = self.observed.copy()
        self.by_observed = np.zeros_like(self.observed)

    def linearise(self, parameters):
        intercept, slope = parameters
        x, y = self.adjusted.T
        self.by_observed = np.column_stack([np.full(x.size, -slope), np.ones(x.size)])
        misclosure = y - intercept - slope * x
        misclosure = misclosure + np.sum(self.by_observed * (self.observed - self.adjusted), axis=1)
        design = np.column_stack([-np.ones(x.size), -x])
        variance = np.sum(self.by_observed**2 * self.variance, axis=1)
        active = np.ones((x.size, 1), dtype=bool)
        return Linearisation(misclosure[:, None], design[:, None, :], variance[:, None, None], active)

    def adjust_observations(self, multipliers):
        self.adjusted = self.observed - self.variance * self.by_observed * multipliers


class LinearModel:
    """A xi - y = e, in groups: what weighted least squares solves in one step."""

    def __init__(self, design, observed, covariance, active=None):
        self.design, self.observed, self.covariance = design, observed, covariance
        self.active = np.ones(observed.shape, dtype=bool) if active is None else active

    def linearise(self, parameters):
        misclosure = self.design @ parameters - self.observed
        return Linearisation.masked(misclosure, self.design, self.covariance, self.active)

    def adjust_observations(self, multipliers):
        """Linear in parameters and observations: there is nothing to relinearise."""

    def dense_covariance(self):
        groups, size = self.observed.shape
        dense = np.zeros((groups * size, groups * size))
        for k in range(groups):
            own = slice(k * size, (k + 1) * size)
            dense[own, own] = self.covariance[k]
        return dense


def draw_linear_model(seed, groups=8, size=3, parameters=4):
    """A linear model whose conditions share noise within a group, with noise drawn from that covariance."""
    rng = np.random.default_rng(seed)
    own = 0.5 * rng.standard_normal((groups, size, size)) + 2.0 * np.eye(size)
    errors = np.einsum("gst,gt->gs", own, rng.standard_normal((groups, size)))
    design = rng.standard_normal((groups, size, parameters))
    truth = np.arange(1.0, parameters + 1.0)
    return LinearModel(design, design @ truth + errors, own @ np.swapaxes(own, 1, 2))


# Pearson's points with York's weights (York 1966; York et al. 2004, Am. J. Phys. 72, 367).
PEARSON_X = np.array([0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4])


PEARSON_Y = np.array([5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5])
WEIGHT_X = np.array([1000.0, 1000.0, 500.0, 800.0, 200.0, 80.0, 60.0, 20.0, 1.8, 1.0])
WEIGHT_Y = np.array([1.0, 1.8, 4.0, 8.0, 20.0, 20.0, 70.0, 70.0, 100.0, 500.0])


def test_york_s_line_through_points_with_errors_in_both_coordinates():
    line = LineWithErrorsInBoth(PEARSON_X, PEARSON_Y, 1.0 / WEIGHT_X, 1.0 / WEIGHT_Y)
    adjusted = adjust(line, np.array([5.0, -0.5]), tolerance=1e-10)
    # the published digits
    np.testing.assert_allclose(adjusted.parameters, [5.47991022, -0.480533407], atol=6e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(adjusted.cofactor)), [0.29497, 0.057985], atol=6e-6)
    assert adjusted.square_sum == pytest.approx(11.8663531941, abs=6e-10)
    assert adjusted.redundancy == 8
    assert adjusted.sigma0 == pytest.approx(np.sqrt(11.8663531941 / 8.0), rel=1e-9)
    # The adjusted points lie on the line, and the sum is that of their moves: e' P e.
    x, y = line.adjusted.T
    np.testing.assert_allclose(y, adjusted.parameters[0] + adjusted.parameters[1] * x, atol=1e-9)
    moves = (line.adjusted - line.observed) ** 2 / line.variance
    assert np.sum(moves) == pytest.approx(adjusted.square_sum, rel=1e-7)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_linear_model_is_weighted_least_squares(seed):
    model = draw_linear_model(seed)
    adjusted = adjust(model, np.zeros(4))
    A, y = model.design.reshape(-1, 4), model.observed.ravel()
    P = np.linalg.inv(model.dense_covariance())
    cofactor = np.linalg.inv(A.T @ P @ A)
    expected = cofactor @ A.T @ P @ y
    # round-off times the condition of a covariance of 24 observations
    np.testing.assert_allclose(adjusted.parameters, expected, rtol=1e-10)
    np.testing.assert_allclose(adjusted.cofactor, cofactor, rtol=1e-9, atol=1e-12)
    residual = A @ expected - y
    assert adjusted.square_sum == pytest.approx(residual @ P @ residual, rel=1e-9)
    assert adjusted.redundancy == 24 - 4
    np.testing.assert_allclose(adjusted.residual.ravel(), residual, atol=1e-9)
    # the noise is drawn from the covariance given: chi-square of 20, 0.9999 two-sided
    assert 3.8 < adjusted.square_sum < 55.0


def test_inactive_conditions_are_as_if_they_were_not_there():
    model = draw_linear_model(4)
    active = np.ones(model.observed.shape, dtype=bool)
    active[2, 1] = active[5] = False
    spoilt = model.observed.copy()
    spoilt[~active] = 1e6
    partial = LinearModel(model.design, spoilt, model.covariance, active)
    adjusted = adjust(partial, np.zeros(4))
    keep = active.ravel()
    A, y = model.design.reshape(-1, 4)[keep], model.observed.ravel()[keep]
    P = np.linalg.inv(model.dense_covariance()[np.ix_(keep, keep)])
    expected = np.linalg.solve(A.T @ P @ A, A.T @ P @ y)
    np.testing.assert_allclose(adjusted.parameters, expected, rtol=1e-10)
    assert adjusted.redundancy == 24 - 4 - 4
    assert adjusted.square_sum == pytest.approx((A @ expected - y) @ P @ (A @ expected - y), rel=1e-9)


def test_a_prior_acts_as_observations_of_the_parameters():
    model = draw_linear_model(5)
    mean = np.array([3.0, 1.0, -2.0, 0.5])
    root = np.array(
        [[2.0, 0.0, 0.0, 0.0], [0.5, 1.0, 0.0, 0.0], [-0.3, 0.2, 3.0, 0.0], [0.1, 0.4, -0.6, 1.5]]
    )
    precision = np.linalg.inv(root @ root.T)
    adjusted = adjust(model, np.zeros(4), prior=Prior(mean, precision))
    # The same rows stacked below: one more group with an identity design (padded by inactive rows).
    design = np.zeros((10, 4, 4))
    design[:8, :3], design[9] = model.design, np.eye(4)
    observed = np.zeros((10, 4))
    observed[:8, :3], observed[9] = model.observed, mean
    covariance = np.tile(np.eye(4), (10, 1, 1))
    covariance[:8, :3, :3], covariance[9] = model.covariance, root @ root.T
    active = np.zeros((10, 4), dtype=bool)
    active[:8, :3] = active[9] = True
    stacked = adjust(LinearModel(design, observed, covariance, active), np.zeros(4))
    np.testing.assert_allclose(adjusted.parameters, stacked.parameters, rtol=1e-10)
    np.testing.assert_allclose(adjusted.cofactor, stacked.cofactor, rtol=1e-9, atol=1e-12)
    assert adjusted.square_sum == pytest.approx(stacked.square_sum, rel=1e-9)
    assert adjusted.redundancy == stacked.redundancy == 24
    # It counts as many observations as it knows things: 16 powers of ten apart, too.
    direction = np.array([0.3, -0.7, 1.1])
    for known, rank in (
        (np.outer(direction, direction), 1),
        (np.zeros((3, 3)), 0),
        (np.diag([1e-4, 0.0, 1e12]), 2),
    ):
        assert Prior(np.zeros(3), known).rank == rank


def test_a_prior_makes_up_for_what_observations_do_not_tell():
    design = np.ones((3, 1, 2))  # only the sum of both parameters is observed
    model = LinearModel(design, np.array([[5.0], [5.0], [5.0]]), np.ones((3, 1, 1)))
    with pytest.raises(ObservabilityError, match="combination of the parameters is not determined"):
        adjust(model, np.zeros(2))
    known = adjust(model, np.zeros(2), prior=Prior(np.array([2.0, 0.0]), np.diag([4.0, 0.0])))
    np.testing.assert_allclose(known.parameters, [2.0, 3.0], rtol=1e-12)
    assert known.redundancy == 3 + 1 - 2


def test_as_many_conditions_as_unknowns_say_nothing_of_the_noise():
    model = LinearModel(np.array([[[1.0, 2.0]], [[3.0, -1.0]]]), np.array([[5.0], [1.0]]), np.ones((2, 1, 1)))
    adjusted = adjust(model, np.zeros(2))
    np.testing.assert_allclose(adjusted.parameters, [1.0, 2.0], rtol=1e-14)
    assert adjusted.redundancy == 0
    assert np.isnan(adjusted.sigma0)


class Root:
    """x² = square, as one condition: real roots or none."""

    def __init__(self, square):
        self.square = square

    def linearise(self, parameters):
        x = float(parameters[0])
        one = np.ones((1, 1), dtype=bool)
        return Linearisation(
            np.array([[x * x - self.square]]), np.array([[[2.0 * x]]]), np.full((1, 1, 1), 1e-12), one
        )

    def adjust_observations(self, multipliers):
        """Nothing is kept."""


def test_what_has_no_solution_leaves_all_bounds_or_is_no_covariance_is_refused():
    with pytest.raises(ConvergenceError, match="did not settle within 30 iterations"):
        adjust(Root(-2.0), np.array([3.0]), iterations=30)
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(ConvergenceError, match="diverged"):
        adjust(Root(1e300), np.array([1e-160]))
    for block in (np.diag([1.0, -1.0]), np.zeros((2, 2))):
        model = LinearModel(np.ones((2, 2, 1)), np.ones((2, 2)), np.array([block, np.eye(2)]))
        with pytest.raises(ConvergenceError, match="covariance of the observations is not positive definite"):
            adjust(model, np.zeros(1))


def test_the_normal_matrix_is_inverted_whatever_the_units():
    root = np.array([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [-0.3, 0.4, 1.0]])
    units = np.array([1e-6, 1.0, 1e9])
    normal = (root @ root.T) * np.outer(units, units)
    expected = np.linalg.inv(root @ root.T) / np.outer(units, units)
    np.testing.assert_allclose(invert_normal_matrix(normal), expected, rtol=1e-13)
    for singular in (
        [[1.0, 2.0], [2.0, 4.0]],
        [[1.0, 1.0 - 1e-15], [1.0 - 1e-15, 1.0]],
        [[1.0, 2.0], [2.0, 1.0]],
    ):
        with pytest.raises(ObservabilityError, match="combination of the parameters"):
            invert_normal_matrix(np.array(singular))
    with pytest.raises(ObservabilityError, match="not determined by the observations at all"):
        invert_normal_matrix(np.diag([1.0, 0.0]))


ALL = slice(0, 3)


def test_the_statistic_is_what_leaving_the_group_out_takes_from_the_sum():
    model = draw_linear_model(31)
    adjusted = adjust(model, np.zeros(4))
    for columns in (ALL, slice(1, 3), slice(0, 1)):
        if columns != ALL:
            model.covariance = model.covariance * np.eye(3)
            adjusted = adjust(model, np.zeros(4))
        tests = snoop_groups(adjusted, columns)
        for group, statistic, degrees in zip(tests.place, tests.statistic, tests.degrees, strict=True):
            active = np.ones(model.observed.shape, dtype=bool)
            active[group, columns] = False
            left = LinearModel(model.design, model.observed, model.covariance, active)
            without = adjust(left, np.zeros(4))
            assert statistic == pytest.approx(adjusted.square_sum - without.square_sum, abs=1e-7)
            assert degrees == adjusted.redundancy - without.redundancy


def test_without_errors_the_statistic_is_chi_square():
    fourth = list[float]()
    for seed in range(600):
        tests = snoop_groups(adjust(draw_linear_model(1000 + seed), np.zeros(4)), ALL)
        assert set(tests.degrees.tolist()) == {3}
        fourth.append(float(tests.statistic[4]))
    # a false alarm of this test itself once in ten thousand seeds; the seed is fixed
    assert kstest(fourth, chi2(3).cdf).pvalue > 1e-4


def test_a_group_that_no_other_checks_has_no_degrees_and_one_that_takes_no_part_is_not_tested():
    # Only the last group sees the second parameter.
    design = np.array([[[1.0, 0.0]], [[1.0, 0.0]], [[2.0, 0.0]], [[1.0, 3.0]]])
    model = LinearModel(design, np.array([[1.1], [0.9], [2.2], [99.0]]), 0.01 * np.ones((4, 1, 1)))
    tests = snoop_groups(adjust(model, np.zeros(2)), slice(0, 1))
    assert tests.degrees.tolist() == [1, 1, 1, 0]
    assert tests.statistic[3] == 0.0
    # by hand: the other two say 1.0, so w = 2.2 - 2 * 1.0 with variance 0.01 (1 + 4 / 2)
    assert tests.statistic[2] == pytest.approx(0.2**2 / 0.03, rel=1e-10)
    active = np.array([[True, True], [False, False], [True, False], [True, True]])
    drawn = draw_linear_model(6, 4, 2, 2)
    adjusted = adjust(LinearModel(drawn.design, drawn.observed, drawn.covariance, active), np.zeros(2))
    tests = snoop_groups(adjusted, slice(0, 2))
    assert tests.place.tolist() == [0, 2, 3]
    assert tests.degrees.tolist() == [2, 1, 2]
    assert snoop_groups(adjusted, slice(1, 2)).place.tolist() == [0, 3]


def test_a_known_combination_is_found_with_its_sigma():
    # The sum of the first two is known to 0.01, their difference to 5, the third to 0.1.
    total, difference = np.array([1.0, 1.0, 0.0]), np.array([1.0, -1.0, 0.0])
    normal = np.outer(total, total) / 0.01**2 + np.outer(difference, difference) / 5.0**2
    normal[2, 2] = 1.0 / 0.1**2
    (weak,) = find_weak_directions(normal, np.ones(3), 1.0)
    # of the unit vector difference / sqrt(2): 5 / sqrt(2)
    assert weak.sigma == pytest.approx(5.0 / np.sqrt(2.0), rel=1e-6)
    np.testing.assert_allclose(np.abs(weak.direction), np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), atol=1e-6)
    assert weak.direction[0] * weak.direction[1] < 0
    assert sorted(weak.leading()) == [0, 1]
    leaning = WeakDirection(np.array([0.1, -0.9, 0.3, 0.26]), 1.0)
    assert leaning.leading() == [1, 2]
    assert leaning.leading(0.05) == [1, 2, 3, 0]
    # In the sizes that matter: 0.02 rad and 30 counts.
    normal = np.diag([1.0 / 0.02**2, 1.0 / 30.0**2])
    assert find_weak_directions(normal, np.array([1.0, 100.0]), 1.0) == []
    (weak,) = find_weak_directions(normal, np.array([0.01, 100.0]), 1.0)
    assert weak.sigma == pytest.approx(2.0)
    assert weak.leading() == [0]


def test_what_is_not_determined_at_all_comes_first_and_is_infinite():
    direction = np.array([3.0, -4.0, 0.0]) / 5.0
    across = np.array([4.0, 3.0, 0.0]) / 5.0
    normal = np.outer(across, across) * 0.25 + np.diag([0.0, 0.0, 1.0 / 9.0])
    weak = find_weak_directions(normal, np.ones(3), 1.0)
    assert [w.sigma for w in weak] == [np.inf, pytest.approx(3.0), pytest.approx(2.0)]
    assert abs(weak[0].direction @ direction) == pytest.approx(1.0)
    assert all(w.sigma == np.inf for w in find_weak_directions(np.zeros((2, 2)), np.ones(2), 1.0))


def test_an_error_of_one_number_goes_unnoticed_up_to_baardas_bound() -> None:
    """sigma 4.13 / sqrt(r), with its effect the gain times that; sigma 0.5 and r 0.36 here.

    Baarda's shift is that of one in a thousand and eighty per cent.
    """
    assert noncentrality() == pytest.approx(4.13, abs=0.005)
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


def test_what_nothing_checks_may_be_of_any_size_and_is_passed_over_where_it_does_no_harm() -> None:
    found = undetected(np.diag([0.0, 1.0]), np.eye(2), np.array([[0.4, 0.1]]), np.ones(1))
    assert np.isinf(found.size)
    assert found.parameter == 0
    found = undetected(np.diag([0.0, 1.0]), np.eye(2), np.array([[0.0, 0.1]]), np.ones(1))
    assert found.effect == pytest.approx(0.1 * noncentrality())
