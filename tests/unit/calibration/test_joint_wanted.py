"""Optional terms of accelerometers whose biases wander: what neighbours share looks like a second order."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import fdtrc
from tumble.calibration.joint.data import joint_data
from tumble.calibration.joint.noise import BalancedJoint, balance_joint
from tumble.calibration.joint.scatter import shared_scatter, wider
from tumble.calibration.joint.system import JointProblem, Masks, start_state
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.trials import widened_problem
from tumble.calibration.joint.wanted import ALL_TERMS, term_limits, wanted_terms
from tumble.calibration.joint.wide import FORCE_ASYMMETRY

from tumble.calibration.equations.imu_unknowns import PLAIN, unknowns_of
from tumble.calibration.equations.triad_unknowns import QUADRATIC

FLOOR = np.array([2e-3, 3e-3, 4e-3])  # m/s²
NAMES = ["quadratic", "accelerometer_asymmetry"]


@pytest.fixture(scope="module")
def settled(play: Any, site: Any, model: Any) -> tuple[JointProblem, BalancedJoint]:
    """Thirty holds whose accelerometers scatter, with both terms free."""
    base = play(noise=(1e-3, 1e-4), holds=30).data()
    base = replace(base, force_floor=FLOOR**2, force_covariance=base.force_covariance + np.diag(FLOOR**2))
    values = unknowns_of(model)
    data = joint_data(base, values)
    problem = JointProblem(data, site, PLAIN, Extra(sway=1e-10), Masks.everything(data.holds))
    problem, state = widened_problem(problem, start_state(data, values, site))
    problem.free = np.sort(np.concatenate([PLAIN, *(ALL_TERMS[name] for name in NAMES)]))
    return problem, balance_joint(problem, state)


def chance(freedom: int, statistic: float) -> float:
    return float(np.asarray(fdtrc(3, freedom, statistic)))


def with_quadratic(balanced: BalancedJoint, size: float) -> BalancedJoint:
    """Return an estimate whose quadratic terms are so many of their standard uncertainties."""
    solution = balanced.solution
    sigma = np.sqrt(np.diag(solution.cofactor))
    state = replace(solution.state, unknowns=solution.state.unknowns.copy())
    at = np.arange(QUADRATIC.start, QUADRATIC.stop)
    state.unknowns[at] = [size, 0.0, -size] * sigma[np.searchsorted(solution.free, at)]
    state.unknowns[FORCE_ASYMMETRY] = 0.0
    return replace(balanced, solution=replace(solution, state=state))


def test_a_shared_scatter_leaves_a_covariance_and_hardly_touches_the_gyros(
    settled: tuple[JointProblem, BalancedJoint],
) -> None:
    problem, balanced = settled
    free = balanced.solution.free
    change = shared_scatter(problem, balanced.solution)
    assert np.allclose(change, change.T, atol=1e-18)
    shared = balanced.solution.cofactor + change[np.ix_(free, free)]
    assert np.all(np.linalg.eigvalsh(shared / np.sqrt(np.outer(np.diag(shared), np.diag(shared)))) > 0.0)
    at = np.searchsorted(free, PLAIN[9:])
    own = np.sqrt(np.diag(balanced.solution.cofactor)[at])
    assert np.all(np.abs(np.sqrt(np.diag(shared)[at]) / own - 1.0) < 0.2)


def test_without_scatter_nothing_is_shared(settled: tuple[JointProblem, BalancedJoint]) -> None:
    problem, balanced = settled
    still = replace(problem, data=replace(problem.data, force_density=np.zeros(3)))
    assert not np.any(shared_scatter(still, balanced.solution))


def test_a_wider_covariance_is_not_narrower_in_any_direction() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(4, 4))
    covariance, change = root @ root.T, rng.normal(size=(4, 4))
    change = change + change.T
    made = wider(covariance, change)
    for other in (covariance, covariance + change):
        assert np.min(np.linalg.eigvalsh(made - other)) > -1e-12


def test_terms_that_are_not_there_are_not_wanted_and_large_ones_are(
    settled: tuple[JointProblem, BalancedJoint],
) -> None:
    problem, balanced = settled
    tests: dict[str, Any] = {}
    assert wanted_terms(problem, balanced, list(NAMES), tests, term_limits(NAMES)) == []
    assert set(tests) == set(NAMES)
    large = with_quadratic(balanced, 40.0)
    assert "quadratic" in wanted_terms(problem, large, list(NAMES), tests, term_limits(NAMES))


def test_terms_are_tested_by_the_checks_of_their_own_kind(
    settled: tuple[JointProblem, BalancedJoint],
) -> None:
    """A noise level that thirty holds tell is not known as well as hundreds of observations of other kinds would."""
    problem, balanced = settled
    tests: dict[str, Any] = {}
    some = with_quadratic(balanced, 3.0)
    wanted_terms(problem, some, list(NAMES), tests, term_limits(NAMES))
    told = tests["quadratic"]
    assert told.statistic > 1.0
    assert told.probability > chance(balanced.solution.redundancy, told.statistic)
    assert told.probability < chance(10, told.statistic)
