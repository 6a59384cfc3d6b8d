"""The joint estimate's budget, reliability and drawn distributions against its own adjustment.

One hand-held recording of 26 holds and one short table recording; nothing here is compared with stored output.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import chdtri
from tumble.calibration.joint.data import joint_data, window_spin
from tumble.calibration.joint.influence import ANGLES, FORCE_REST, SWAY, TURNS, joint_influences
from tumble.calibration.joint.system import JointProblem, Masks, linearise_joint, solve_joint, start_state
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.unknowns import GYRO_BIAS, force_matrix, gyro_matrix

from tumble.calibration import calibrate_hand_held
from tumble.calibration.equations.imu_unknowns import PLAIN
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.joint import draws as joint_draws
from tumble.calibration.outcome.budget import NamedParameters
from tumble.calibration.outcome.draws import draw_distributions, redrawn
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.earth import Site
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.protocol import named_protocol
from tumble.segmentation import find_timeline, observe_holds
from tumble.simulation import find_grade, simulate_protocol

SITE = Site.from_latitude(np.radians(46.0))


@cache
def hand_held():
    """A calibrated recording by hand, and its estimate."""
    recording, _ = simulate_protocol(
        named_protocol("hand-held"),
        25.0,
        np.random.default_rng(3),
        site=SITE,
        grade=find_grade("consumer-mems"),
    )
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    start = calibrate_hand_held(recording, timeline, means, SITE, optional_terms=False)
    return calibrate_joint(recording, timeline, means, SITE, start, optional_terms=False)


def outcome_of(estimate) -> JointOutcome:
    """The solution behind an estimate."""
    assert estimate.statement is not None
    assert isinstance(estimate.statement.outcome, JointOutcome)
    return estimate.statement.outcome


def noisy_problem() -> tuple[JointProblem, object]:
    """The hand-held problem with every variance component at work, and a hold and a turn left out."""
    outcome = outcome_of(hand_held())
    problem = replace(
        outcome.problem,
        extra=Extra(force=1e-6, rate=1e-9, turn=1e-7, sway=1e-8),
        masks=outcome.problem.masks.copy(),
    )
    problem.masks.force[4] = problem.masks.turn[7] = False
    state = deepcopy(outcome.state)
    solve_joint(problem, state)
    return problem, state


def covariance_of(problem: JointProblem, state) -> np.ndarray:
    """The shared unknowns' covariance at a state."""
    return invert_normal_matrix(linearise_joint(problem, state)[1])


def test_the_shares_of_all_sources_add_up_to_the_covariance() -> None:
    problem, state = noisy_problem()
    influences = joint_influences(problem, state)
    whole = sum(influences.shares().values())
    sigma = np.sqrt(np.diag(influences.covariance)[problem.free])
    missed = (whole - influences.covariance)[np.ix_(problem.free, problem.free)] / np.outer(sigma, sigma)
    # A hold that is left out is held to 0.1 rad so that nothing floats: no source's share, 2e-5 of the covariance.
    assert np.max(np.abs(missed)) < 1e-4


def test_the_shares_of_a_tables_rotations_add_up_too() -> None:
    """A turn of the hand-held recording is cut into windows as if a table had made it, and its angle read."""
    outcome = outcome_of(hand_held())
    base = deepcopy(outcome.data.base)
    values = outcome.state.unknowns.copy()
    made = []
    for k in (3, 8):
        start, stop = int(base.turn_start[k]) + 2, int(base.turn_stop[k]) - 2
        rate = np.linalg.solve(
            gyro_matrix(values), base.raw_rate[start:stop].mean(axis=0) - values[GYRO_BIAS]
        )
        made.append(window_spin(base, k, start, stop, rate, angle=1.0, angle_sigma=1e-4))
    data = joint_data(base, values, made)
    problem = JointProblem(
        data,
        SITE,
        PLAIN,
        Extra(force=1e-6, rate=1e-9, turn=1e-7, sway=1e-8),
        Masks.everything(data.holds),
        wobble={3: 1e-3, 8: 1e-3},
    )
    state = start_state(data, values, SITE)
    influences = joint_influences(problem, state)
    shares = influences.shares()
    assert ANGLES in shares
    sigma = np.sqrt(np.diag(influences.covariance)[PLAIN])
    missed = (sum(shares.values()) - influences.covariance)[np.ix_(PLAIN, PLAIN)] / np.outer(sigma, sigma)
    assert np.max(np.abs(missed)) < 1e-9


@pytest.mark.parametrize(("source", "name"), [(TURNS, "turn"), (SWAY, "sway")])
def test_a_share_is_how_the_covariance_grows_with_its_variance(source: str, name: str) -> None:
    """d C / d ln(variance) is the share itself: taken by differences, one per cent either way."""
    problem, state = noisy_problem()
    free = problem.free
    share = joint_influences(problem, state).shares()[source][np.ix_(free, free)]
    variance, step = getattr(problem.extra, name), 0.01
    ends = [
        covariance_of(
            replace(problem, extra=replace(problem.extra, **{name: variance * np.exp(sign * step)})), state
        )
        for sign in (-1.0, 1.0)
    ]
    grown = np.diag(ends[1] - ends[0]) / (2.0 * step)
    # the third derivative adds a few 1e-5 of the whole
    assert grown == pytest.approx(np.diag(share), rel=1e-3, abs=1e-6 * np.max(np.diag(share)))


def test_the_budget_adds_up_to_the_stated_uncertainties() -> None:
    estimate = hand_held()
    whole = np.sqrt(sum(part**2 for part in estimate.budget.values()))
    stated = [p.standard_uncertainty for p in estimate.parameters]
    # sources below 1e-4 of every variance are not in it
    assert whole == pytest.approx(stated, rel=1e-3)
    assert estimate.budget[FORCE_REST][0] > 0.3 * stated[0]


def test_redundancy_numbers_of_all_observations_are_within_their_bounds() -> None:
    told = hand_held().statement
    assert told is not None
    assert all(-1e-6 < d.redundancy < d.count + 1e-6 for d in told.detectable)
    assert {d.kind for d in told.detectable} == {"force", "rate", "turn"}


def test_an_error_that_would_go_unnoticed_moves_its_parameter_by_what_is_said() -> None:
    """Put into the hold's specific force and adjusted anew: the worst direction is found by trying all three."""
    estimate = hand_held()
    outcome = outcome_of(estimate)
    assert estimate.statement is not None
    forces = [d for d in estimate.statement.detectable if d.kind == "force"]
    worst = max(forces, key=lambda d: d.effect)
    named = NamedParameters.of(outcome, [p.name for p in hand_held().parameters])
    sigma = estimate.parameters[worst.parameter].standard_uncertainty
    state = deepcopy(outcome.state)
    solve_joint(outcome.problem, state)
    before = named.at(state.unknowns)[worst.parameter]
    moved = []
    for axis in np.eye(3):
        problem = deepcopy(outcome.problem)
        # small enough for the first order, and scaled up
        problem.data.parts[worst.index] += 1e-2 * worst.size * (force_matrix(state.unknowns) @ axis)
        other = deepcopy(state)
        solve_joint(problem, other)
        moved.append(1e2 * (named.at(other.unknowns)[worst.parameter] - before) / sigma)
    # of that size in any direction it moves no more, and along the best direction at least as far
    assert np.linalg.norm(moved) >= 0.99 * worst.effect


def test_observations_drawn_anew_scatter_as_the_covariance_says() -> None:
    """20 full adjustments: chi-square of all parameters, at a false-alarm rate of one in a thousand."""
    estimate = hand_held()
    outcome = outcome_of(estimate)
    rng = np.random.default_rng(8)
    free = outcome.problem.free
    inverse = np.linalg.inv(covariance_of(outcome.problem, outcome.state))
    total = 0.0
    for _ in range(20):
        state = deepcopy(outcome.state)
        solve_joint(redrawn(outcome.problem, outcome.state, rng), state)
        off = (state.unknowns - outcome.state.unknowns)[free]
        total += float(off @ inverse @ off)
    degrees = 20 * free.size
    assert chdtri(degrees, 0.9995) < total < chdtri(degrees, 0.0005)


def test_a_gravity_that_was_assumed_is_rectangular_and_contradicts_the_normal_interval(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where it is nearly all of a scale factor's uncertainty, 95 % of a rectangle end at 0.95 sqrt(3) sigma."""
    monkeypatch.setattr(joint_draws, "READJUSTED", 2)
    estimate = deepcopy(hand_held())
    outcome = outcome_of(estimate)
    unknown = Site.unknown()
    outcome.site = replace(unknown, gravity=SITE.gravity)
    at = next(i for i, p in enumerate(estimate.parameters) if p.name == "accelerometer scale factor error x")
    sigma = unknown.gravity_sigma / SITE.gravity
    parameter = estimate.parameters[at]
    estimate.parameters[at] = replace(parameter, standard_uncertainty=float(np.hypot(sigma, 1e-5)))
    draw_distributions(estimate, 5000, np.random.default_rng(1), lambda _: None)
    assert estimate.statement is not None
    drawn = estimate.statement.drawn
    assert drawn is not None
    half = 0.5 * float(np.diff(drawn.intervals[at])[0])
    assert half == pytest.approx(0.95 * np.sqrt(3.0) * sigma, rel=0.05)
    assert not drawn.validated[at]
    assert "contradicted" in estimate.remarks[-1]
