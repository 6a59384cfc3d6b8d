"""The adjustment of conditions, against published and closed-form answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Linearisation, Prior, adjust
from tumble.estimation.gauss_helmert import invert_normal_matrix

# Pearson's points with York's weights (York 1966; York et al. 2004, Am. J. Phys. 72, 367).
PEARSON_X = np.array([0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4])
PEARSON_Y = np.array([5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5])
WEIGHT_X = np.array([1000.0, 1000.0, 500.0, 800.0, 200.0, 80.0, 60.0, 20.0, 1.8, 1.0])
WEIGHT_Y = np.array([1.0, 1.8, 4.0, 8.0, 20.0, 20.0, 70.0, 70.0, 100.0, 500.0])

Model = Any


def test_york_s_line_through_points_with_errors_in_both_coordinates(line_with_errors_in_both: Model) -> None:
    line = line_with_errors_in_both(PEARSON_X, PEARSON_Y, 1.0 / WEIGHT_X, 1.0 / WEIGHT_Y)
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


@pytest.mark.parametrize("block", [np.diag([1.0, -1.0]), np.zeros((2, 2))])
def test_what_is_no_covariance_is_refused(linear_model: Model, block: np.ndarray) -> None:
    model = linear_model(np.ones((2, 2, 1)), np.ones((2, 2)), np.array([block, np.eye(2)]))
    with pytest.raises(ConvergenceError, match="covariance of the observations is not positive definite"):
        adjust(model, np.zeros(1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_linear_model_is_weighted_least_squares(
    random_linear_model: Callable[..., Model], seed: int
) -> None:
    model = random_linear_model(seed)
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


def test_inactive_conditions_are_as_if_they_were_not_there(
    random_linear_model: Callable[..., Model], linear_model: Model
) -> None:
    model = random_linear_model(4)
    active = np.ones(model.observed.shape, dtype=bool)
    active[2, 1] = active[5] = False
    spoilt = model.observed.copy()
    spoilt[~active] = 1e6
    partial = linear_model(model.design, spoilt, model.covariance, active)
    adjusted = adjust(partial, np.zeros(4))
    keep = active.ravel()
    A, y = model.design.reshape(-1, 4)[keep], model.observed.ravel()[keep]
    P = np.linalg.inv(model.dense_covariance()[np.ix_(keep, keep)])
    expected = np.linalg.solve(A.T @ P @ A, A.T @ P @ y)
    np.testing.assert_allclose(adjusted.parameters, expected, rtol=1e-10)
    assert adjusted.redundancy == 24 - 4 - 4
    assert adjusted.square_sum == pytest.approx((A @ expected - y) @ P @ (A @ expected - y), rel=1e-9)


def test_a_prior_acts_as_observations_of_the_parameters(
    random_linear_model: Callable[..., Model], linear_model: Model
) -> None:
    model = random_linear_model(5)
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
    stacked = adjust(linear_model(design, observed, covariance, active), np.zeros(4))
    np.testing.assert_allclose(adjusted.parameters, stacked.parameters, rtol=1e-10)
    np.testing.assert_allclose(adjusted.cofactor, stacked.cofactor, rtol=1e-9, atol=1e-12)
    assert adjusted.square_sum == pytest.approx(stacked.square_sum, rel=1e-9)
    assert adjusted.redundancy == stacked.redundancy == 24


def test_a_prior_counts_as_many_observations_as_it_knows_things() -> None:
    direction = np.array([0.3, -0.7, 1.1])
    assert Prior(np.zeros(3), np.outer(direction, direction)).rank == 1
    assert Prior(np.zeros(3), np.zeros((3, 3))).rank == 0
    # bias to 100 counts, angle to a microradian: 16 powers of ten apart
    assert Prior(np.zeros(3), np.diag([1e-4, 0.0, 1e12])).rank == 2


def test_a_prior_makes_up_for_what_observations_do_not_tell(linear_model: Model) -> None:
    design = np.ones((3, 1, 2))  # only the sum of both parameters is observed
    model = linear_model(design, np.array([[5.0], [5.0], [5.0]]), np.ones((3, 1, 1)))
    with pytest.raises(ObservabilityError, match="combination of the parameters is not determined"):
        adjust(model, np.zeros(2))
    known = adjust(model, np.zeros(2), prior=Prior(np.array([2.0, 0.0]), np.diag([4.0, 0.0])))
    np.testing.assert_allclose(known.parameters, [2.0, 3.0], rtol=1e-12)
    assert known.redundancy == 3 + 1 - 2


def test_as_many_conditions_as_unknowns_say_nothing_of_the_noise(linear_model: Model) -> None:
    model = linear_model(
        np.array([[[1.0, 2.0]], [[3.0, -1.0]]]), np.array([[5.0], [1.0]]), np.ones((2, 1, 1))
    )
    adjusted = adjust(model, np.zeros(2))
    np.testing.assert_allclose(adjusted.parameters, [1.0, 2.0], rtol=1e-14)
    assert adjusted.redundancy == 0
    assert np.isnan(adjusted.sigma0)


class Root:
    """x² = square, as one condition: real roots or none."""

    def __init__(self, square: float) -> None:
        self.square = square

    def linearise(self, parameters: np.ndarray) -> Linearisation:
        x = float(parameters[0])
        one = np.ones((1, 1), dtype=bool)
        return Linearisation(
            np.array([[x * x - self.square]]), np.array([[[2.0 * x]]]), np.full((1, 1, 1), 1e-12), one
        )

    def adjust_observations(self, multipliers: np.ndarray) -> None:
        """Nothing is kept."""


def test_a_condition_without_a_solution_does_not_settle() -> None:
    with pytest.raises(ConvergenceError, match="did not settle within 30 iterations"):
        adjust(Root(-2.0), np.array([3.0]), iterations=30)


def test_an_adjustment_that_leaves_all_bounds_is_said_to_diverge() -> None:
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(ConvergenceError, match="diverged"):
        adjust(Root(1e300), np.array([1e-160]))


def test_the_normal_matrix_is_inverted_whatever_the_units() -> None:
    root = np.array([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [-0.3, 0.4, 1.0]])
    units = np.array([1e-6, 1.0, 1e9])
    normal = (root @ root.T) * np.outer(units, units)
    expected = np.linalg.inv(root @ root.T) / np.outer(units, units)
    np.testing.assert_allclose(invert_normal_matrix(normal), expected, rtol=1e-13)


@pytest.mark.parametrize(
    ("normal", "said"),
    [
        (np.diag([1.0, 0.0]), "not determined by the observations at all"),
        (np.array([[1.0, 2.0], [2.0, 4.0]]), "combination of the parameters"),
        (np.array([[1.0, 1.0 - 1e-15], [1.0 - 1e-15, 1.0]]), "combination of the parameters"),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "combination of the parameters"),
    ],
)
def test_a_singular_normal_matrix_is_said_so(normal: np.ndarray, said: str) -> None:
    with pytest.raises(ObservabilityError, match=said):
        invert_normal_matrix(normal)
