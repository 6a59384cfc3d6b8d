"""Optional terms of accelerometers whose biases wander: what neighbours share looks like a second order."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import fdtrc

from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording
from tumble.calibration.equations.imu_unknowns import (
    PLAIN,
    imu_unknowns,
    name_plate,
    term_unknowns,
    unknowns_of,
)
from tumble.calibration.optional_terms import (
    determined_terms,
    implausible_words,
    possible_terms,
    term_limits,
    unknowns_with,
    untried_words,
    wanted_terms,
    worse_predicted,
)
from tumble.calibration.outcome.estimate import require_positive
from tumble.errors import ObservabilityError
from tumble.estimation import Balanced, Unknowns, wider

FLOOR = np.array([2e-3, 3e-3, 4e-3])  # m/s²
NAMES = ["quadratic", "accelerometer_asymmetry"]


@pytest.fixture(scope="module")
def settled(play: Any, started: Any) -> tuple[JointAdjustment, Balanced]:
    """Thirty holds whose accelerometers scatter, with both terms free."""
    base = play(noise=(1e-3, 1e-4), holds=30).data()
    base = replace(base, force_floor=FLOOR**2, force_covariance=base.force_covariance + np.diag(FLOOR**2))
    task = started(base, unknowns_with(PLAIN, NAMES))
    return task, balance_recording(task)


def chance(freedom: int, statistic: float) -> float:
    return float(np.asarray(fdtrc(3, freedom, statistic)))


def with_quadratic(task: JointAdjustment, balanced: Balanced, size: float) -> JointAdjustment:
    """Return an estimate whose quadratic terms are so many of their standard uncertainties."""
    made = task.copy()
    sigma = np.sqrt(np.diag(balanced.solution.cofactor))
    made.unknowns["force.quadratic"][:] = [size, 0.0, -size] * sigma[
        made.unknowns.places(["force.quadratic"])
    ]
    made.unknowns["force.asymmetry"][:] = 0.0
    return made


def test_terms_that_are_not_there_are_not_wanted_and_large_ones_are(settled) -> None:
    task, balanced = settled
    tests: dict[str, Any] = {}
    assert wanted_terms(task, balanced, list(NAMES), tests, term_limits(NAMES)) == []
    assert set(tests) == set(NAMES)
    large = with_quadratic(task, balanced, 40.0)
    assert "quadratic" in wanted_terms(large, balanced, list(NAMES), tests, term_limits(NAMES))


def test_one_step_rules_out_what_chance_explains_often_and_nothing_else(settled) -> None:
    """What is larger than any unit's, or checked by a few holds, may be anything once it settles."""
    task, balanced = settled
    assert possible_terms(task, balanced, list(NAMES), {}) == []
    assert "quadratic" in possible_terms(with_quadratic(task, balanced, 3.0), balanced, list(NAMES), {})
    assert possible_terms(task, balanced, list(NAMES), {}, frozenset(NAMES[1:])) == NAMES[1:]
    large = with_quadratic(task, balanced, 0.0)
    large.unknowns["force.asymmetry"][:] = [0.06, 0.0, 0.0]
    assert possible_terms(large, balanced, list(NAMES), {}) == NAMES
    few = replace(balanced, tests={"force": balanced.tests["force"].where(slice(0, 3))})
    assert possible_terms(task, few, list(NAMES), {}) == NAMES


def test_terms_are_tested_by_the_checks_of_their_own_kind(settled: tuple[JointAdjustment, Balanced]) -> None:
    """A noise level that thirty holds tell is not known as well as hundreds of observations of other kinds would."""
    task, balanced = settled
    tests: dict[str, Any] = {}
    some = with_quadratic(task, balanced, 3.0)
    wanted_terms(some, balanced, list(NAMES), tests, term_limits(NAMES))
    told = tests["quadratic"]
    assert told.statistic > 1.0
    assert told.probability > chance(balanced.solution.redundancy, told.statistic)
    assert told.probability < chance(10, told.statistic)


def _information(u: Unknowns, alike: tuple[str, str], apart: float) -> np.ndarray:
    """Everything is known to a hundredth of a name plate, but two terms that show as one number."""
    sizes = name_plate(u)
    scaled = 1e4 * np.eye(u.values.size)
    first, second = (term_unknowns(name) for name in alike)
    for i, j in zip(first, second, strict=True):
        scaled[i, j] = scaled[j, i] = 1e4 * (1.0 - apart)
    whole = scaled / np.outer(sizes, sizes)
    return whole[np.ix_(u.free, u.free)]


@pytest.mark.parametrize(("apart", "left"), [(1e-9, NAMES[1:]), (0.5, NAMES)])
def test_terms_that_look_alike_are_not_tried_together(apart, left, model, settled) -> None:
    """As faces up and down show an asymmetry and a quadratic term: the others are tried all the same."""
    names = [*NAMES, "gyro_asymmetry"]
    u = imu_unknowns(unknowns_of(model), unknowns_with(PLAIN, names))
    found = determined_terms(
        _information(u, ("quadratic", "accelerometer_asymmetry"), apart), u, PLAIN, names
    )
    assert found == [*left, "gyro_asymmetry"]
    (said,) = untried_words(["quadratic"], settled[0].copy(PLAIN))
    assert said.startswith("Quadratic terms of the accelerometers: ")
    assert "0.1 % at 1 g would put an accelerometer's bias off by up to" in said


def test_a_term_larger_than_any_unit_s_is_not_kept_and_said(settled) -> None:
    """Six per cent of asymmetry, three hundred of its sigmas."""
    task, balanced = settled
    large = with_quadratic(task, balanced, 0.0)
    large.unknowns["force.asymmetry"][:] = [0.06, 0.0, 0.0]
    tests: dict[str, Any] = {}
    assert wanted_terms(large, balanced, list(NAMES), tests, term_limits(NAMES)) == []
    assert tests["accelerometer_asymmetry"].probability < 1e-6
    (said,) = implausible_words(list(tests.values()))
    assert "asymmetries of the accelerometers" in said


def test_a_term_that_predicts_holds_worse_is_not_kept(settled: tuple[JointAdjustment, Balanced]) -> None:
    _, balanced = settled
    force = balanced.tests["force"]
    for more, worse in ((0.1, NAMES), (-0.1, [])):
        tests = {"force": replace(force, surprise=force.surprise + more)}
        assert worse_predicted(balanced, replace(balanced, tests=tests), list(NAMES)) == worse


def test_a_wider_covariance_is_not_narrower_in_any_direction() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(4, 4))
    covariance, change = root @ root.T, rng.normal(size=(4, 4))
    change = change + change.T
    made = wider(covariance, change)
    for other in (covariance, covariance + change):
        assert np.min(np.linalg.eigvalsh(made - other)) > -1e-12


def test_a_covariance_that_is_none_is_refused(model: Any) -> None:
    u = imu_unknowns(unknowns_of(model))
    require_positive(np.eye(u.free.size), u)
    bad = np.eye(u.free.size)
    bad[2, 3] = bad[3, 2] = 1.01
    with pytest.raises(ObservabilityError, match=r"accelerometer (z|x)"):
        require_positive(bad, u)
