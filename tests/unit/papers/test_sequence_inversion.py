"""From measurements to errors: (13) and (14) with the signs put right, and least squares for any set."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import ObservabilityError
from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble_papers.savage.sequences import (
    SequenceModel,
    invert_measurements,
    sequence_model,
    solve_measurements,
)

GRAVITY = 9.81
MODELS: dict[str, SequenceModel] = {
    row.name: sequence_model(row.rotations, start_down(row), GRAVITY) for row in SEQUENCES
}
# ppm, µrad and some µm/s²: no two alike
ERRORS = np.arange(1.0, 25.0) * np.where(np.arange(24) % 3 == 1, -1.0, 1.0) * 1e-4
WITHOUT_ASYMMETRY = np.where(np.isin(np.arange(24), [3, 4, 5]), 0.0, ERRORS)
# rounding of a division of numbers of 1e-2 by 40
ROUNDING = 1e-15


def measured(errors: np.ndarray, names: list[str] | None = None) -> dict[str, np.ndarray]:
    return {name: MODELS[name].coefficients @ errors for name in (names or list(MODELS))}


def solved(names: list[str], errors: np.ndarray = ERRORS, *, asymmetry: bool = True):
    return solve_measurements(
        [MODELS[name] for name in names],
        list(measured(errors, names).values()),
        [spread(name) for name in names],
        asymmetry=asymmetry,
    )


def spread(name: str) -> np.ndarray:
    """Some covariance with correlations, another one for each sequence."""
    rng = np.random.default_rng(sum(name.encode()))
    root = 1e-5 * (np.eye(5) + 0.2 * rng.normal(size=(5, 5)))
    return root @ root.T


def test_13_gives_back_every_error_of_the_linear_model_in_one_pass() -> None:
    np.testing.assert_allclose(
        invert_measurements(measured(ERRORS), GRAVITY), ERRORS, rtol=0, atol=10 * ROUNDING
    )


def test_14_needs_no_sequence_turned_back_where_the_gyros_have_no_asymmetry() -> None:
    told = measured(WITHOUT_ASYMMETRY, [name for name in MODELS if not name.endswith("a")])
    found = invert_measurements(told, GRAVITY, asymmetry=False)
    np.testing.assert_allclose(found, WITHOUT_ASYMMETRY, rtol=0, atol=10 * ROUNDING)


@pytest.mark.parametrize(("gone", "asymmetry"), [("9", True), ("2a", True), ("14", False)])
def test_the_formulas_refuse_a_sequence_that_is_missing_by_its_name(gone: str, asymmetry: bool) -> None:
    told = measured(ERRORS)
    del told[gone]
    with pytest.raises(ObservabilityError, match=f"need all sequences, and {gone} are missing"):
        invert_measurements(told, GRAVITY, asymmetry=asymmetry)


def test_least_squares_gives_what_the_formulas_give() -> None:
    solution = solved(list(MODELS))
    # 24 unknowns of a condition of some hundreds
    np.testing.assert_allclose(solution.errors, ERRORS, rtol=0, atol=1e-12)
    assert solution.determined.all()
    assert solution.degrees == 4 * 17 - 24
    # over the noise of 1e-5: rounding
    assert solution.square_sum < 1e-12
    np.testing.assert_allclose(solution.residuals, 0.0, rtol=0, atol=1e-13)


def test_least_squares_without_asymmetry_is_14() -> None:
    names = [name for name in MODELS if not name.endswith("a")]
    solution = solved(names, WITHOUT_ASYMMETRY, asymmetry=False)
    np.testing.assert_allclose(solution.errors, WITHOUT_ASYMMETRY, rtol=0, atol=1e-12)
    assert list(np.flatnonzero(~solution.determined)) == [3, 4, 5]


def test_least_squares_is_that_of_numpy_with_covariance_and_residuals() -> None:
    """Weighed by Cholesky factors of the covariances of what is observed; noise on top."""
    rng = np.random.default_rng(8)
    names = list(MODELS)
    told = [v + 1e-5 * rng.normal(size=5) for v in measured(ERRORS, names).values()]
    spreads = [1e-10 * np.diag([1.0, 1.0, 1.0, 2.0, 3.0]) for _ in names]
    solution = solve_measurements([MODELS[n] for n in names], told, spreads)
    design, right = [], []
    for name, value in zip(names, told, strict=True):
        down = int(np.argmax(np.abs(MODELS[name].down_start)))
        keep = [(down + 1) % 3, (down + 2) % 3, 3, 4]
        weight = 1.0 / np.sqrt(np.diag(spreads[0])[keep])
        design.append(weight[:, None] * MODELS[name].coefficients[keep])
        right.append(weight * value[keep])
    A, b = np.concatenate(design), np.concatenate(right)
    expected, square, _, _ = np.linalg.lstsq(A, b, rcond=None)
    np.testing.assert_allclose(solution.errors, expected, rtol=0, atol=1e-14)
    assert solution.square_sum == pytest.approx(float(square[0]), rel=1e-9)
    covariance = np.linalg.inv(A.T @ A)
    np.testing.assert_allclose(solution.covariance, covariance, rtol=1e-9, atol=1e-9 * np.max(covariance))
    expected_sigma = np.sqrt(np.array([1.0, 1.0, 2.0, 3.0])) * 1e-5
    np.testing.assert_allclose(solution.sigmas, np.tile(expected_sigma, (17, 1)), rtol=1e-12)
    # 44 degrees: the chance of more than twice as many is 1e-4
    assert 0.4 < solution.square_sum / solution.degrees < 2.0


# What is missing -----------------------------------------------------------------------------------

# What no other sequence tells. A row turned back (1a) is the only one of its axis where asymmetry and scale factor
# have other signs; the row itself (1) is not, for half turns of others have the same signs.


@pytest.mark.parametrize("gone", [(name,) for name in MODELS] + [("7", "8", "9", "10", "11", "12")])
def test_what_is_left_undetermined_is_what_the_null_space_has_in_it_and_the_rest_is_exact(
    gone: tuple[str, ...],
) -> None:
    names = [name for name in MODELS if name not in gone]
    solution = solved(names)
    rows = np.concatenate([MODELS[name].coefficients for name in names])
    _, values, directions = np.linalg.svd(rows)
    null = directions[np.concatenate([values, np.zeros(24 - values.size)]) < 1e-9 * values[0]]
    expected = np.all(np.abs(null) < 1e-9, axis=0)
    np.testing.assert_array_equal(solution.determined, expected)
    told = solution.determined
    np.testing.assert_allclose(solution.errors[told], ERRORS[told], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(solution.errors[~told], 0.0)
    np.testing.assert_array_equal(solution.covariance[~told], 0.0)
    assert np.all(np.diag(solution.covariance)[told] > 0.0)
    assert solution.degrees == 4 * len(names) - 24 + len(null)


def test_no_sequence_is_refused() -> None:
    with pytest.raises(ObservabilityError, match="no rotation sequence to solve from"):
        solve_measurements([], [], [])
