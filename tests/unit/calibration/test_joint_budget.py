"""The joint estimate's budget, reliability and drawn distributions against its own adjustment.

One hand-held recording of 26 holds and one short table recording; nothing here is compared with stored output.
"""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import chdtri

from recovery.played import jointly
from second_simulator.calibrating import calibrated, played
from tumble.calibration import (
    Budget,
    JointAdjustment,
    JointOutcome,
    Session,
    draw_distributions,
    gyro_matrix,
    objections,
    observe,
    recording_influences,
    start_adjustment,
    table_rotation,
)
from tumble.calibration.equations.causes import ANGLES, FORCE_REST, SOURCES, SWAY, TURNS
from tumble.calibration.equations.imu_unknowns import force_matrix
from tumble.calibration.outcome import budget, estimate
from tumble.earth import Site
from tumble.estimation import Noise, invert_normal_matrix, linearise, solve
from tumble.protocol import named_protocol
from tumble.simulation import find_grade, simulate_protocol

pytestmark = pytest.mark.slow
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
    return jointly(Session(recording, None, SITE), optional_terms=False)


def outcome_of(estimate) -> JointOutcome:
    """The solution behind an estimate."""
    assert isinstance(estimate.shown(Budget).statement.outcome, JointOutcome)
    return estimate.shown(Budget).statement.outcome


ADDED = {"force": 1e-6, "rate": 1e-9, "turn": 1e-7, "sway": 1e-8}


def noisy() -> JointAdjustment:
    """The hand-held adjustment with every variance component at work, and a hold and a turn left out."""
    task = outcome_of(hand_held()).task.copy()
    task.noise = Noise(dict(ADDED))
    task.taking_part["force"][4] = task.taking_part["turn"][7] = False
    solve(task)
    return task


def covariance_of(task: JointAdjustment) -> np.ndarray:
    """The free unknowns' covariance where everything is."""
    return invert_normal_matrix(linearise(task)[1])


def test_the_shares_of_all_sources_add_up_to_the_covariance() -> None:
    influences = recording_influences(noisy())
    whole = sum(influences.shares(SOURCES).values())
    sigma = np.sqrt(np.diag(influences.covariance))
    # A hold that is left out is held to 0.1 rad so that nothing floats: no source's share, 2e-5 of the covariance.
    assert np.max(np.abs((whole - influences.covariance) / np.outer(sigma, sigma))) < 1e-4


def test_the_shares_of_a_tables_rotations_add_up_too() -> None:
    """A turn of the hand-held recording is cut into windows as if a table had made it, and its angle read."""
    outcome = outcome_of(hand_held())
    base, u = deepcopy(outcome.data.base), outcome.task.unknowns
    made = []
    for k in (3, 8):
        start, stop = int(base.turn_start[k]) + 2, int(base.turn_stop[k]) - 2
        rate = np.linalg.solve(gyro_matrix(u), base.raw_rate[start:stop].mean(axis=0) - u["gyro.bias"])
        made.append(table_rotation(base, k, start, stop, rate, angle=1.0, angle_sigma=1e-4))
    task = start_adjustment(observe(base, u, made), u, SITE)
    # a wobble of a milliradian
    task.noise = Noise(dict(ADDED), {"axis": {3: 4e4, 8: 4e4}})
    influences = recording_influences(task)
    shares = influences.shares(SOURCES)
    assert ANGLES in shares
    sigma = np.sqrt(np.diag(influences.covariance))
    missed = (sum(shares.values()) - influences.covariance) / np.outer(sigma, sigma)
    assert np.max(np.abs(missed)) < 1e-9


@pytest.mark.parametrize(("source", "name"), [(TURNS, "turn"), (SWAY, "sway")])
def test_a_share_is_how_the_covariance_grows_with_its_variance(source: str, name: str) -> None:
    """d C / d ln(variance) is the share itself: taken by differences, one per cent either way."""
    task, step = noisy(), 0.01
    share = recording_influences(task).shares(SOURCES)[source]
    ends = []
    for sign in (-1.0, 1.0):
        other = task.copy()
        other.noise.set(name, task.noise[name] * np.exp(sign * step))
        ends.append(covariance_of(other))
    grown = np.diag(ends[1] - ends[0]) / (2.0 * step)
    # the third derivative adds a few 1e-5 of the whole
    assert grown == pytest.approx(np.diag(share), rel=1e-3, abs=1e-6 * np.max(np.diag(share)))


def test_the_budget_adds_up_to_the_stated_uncertainties() -> None:
    estimate = hand_held()
    whole = np.sqrt(sum(part**2 for part in estimate.shown(Budget).shares.values()))
    stated = [p.standard_uncertainty for p in estimate.parameters]
    # sources below 1e-4 of every variance are not in it
    assert whole == pytest.approx(stated, rel=1e-3)
    assert estimate.shown(Budget).shares[FORCE_REST][0] > 0.3 * stated[0]


def test_redundancy_numbers_of_all_observations_are_within_their_bounds() -> None:
    told = hand_held().shown(Budget).statement
    assert all(-1e-6 < d.redundancy < d.count + 1e-6 for d in told.detectable)
    assert {d.kind for d in told.detectable} == {"force", "rate", "turn"}


def test_an_error_that_would_go_unnoticed_moves_its_parameter_by_what_is_said() -> None:
    """Put into the hold's specific force and adjusted anew: the worst direction is found by trying all three."""
    estimate = hand_held()
    outcome = outcome_of(estimate)
    forces = [d for d in estimate.shown(Budget).statement.detectable if d.kind == "force"]
    worst = max(forces, key=lambda d: d.effect)
    named = budget.NamedParameters.of(outcome, [p.name for p in hand_held().parameters])
    sigma = estimate.parameters[worst.parameter].standard_uncertainty
    settled = outcome.task.copy()
    solve(settled)
    before = named.at(settled.unknowns.values)[worst.parameter]
    moved = []
    for axis in np.eye(3):
        task = settled.copy()
        parts = settled.data.parts.copy()
        # small enough for the first order, and scaled up
        parts[worst.index] += 1e-2 * worst.size * (force_matrix(settled.unknowns) @ axis)
        task.data = replace(settled.data, parts=parts)
        solve(task)
        moved.append(1e2 * (named.at(task.unknowns.values)[worst.parameter] - before) / sigma)
    # of that size in any direction it moves no more, and along the best direction at least as far
    assert np.linalg.norm(moved) >= 0.99 * worst.effect


def test_observations_drawn_anew_scatter_as_the_covariance_says() -> None:
    """20 full adjustments: chi-square of all parameters, at a false-alarm rate of one in a thousand."""
    estimate = hand_held()
    outcome = outcome_of(estimate)
    rng = np.random.default_rng(8)
    free = outcome.task.unknowns.free
    inverse = np.linalg.inv(covariance_of(outcome.task))
    total = 0.0
    for _ in range(20):
        task = budget.redrawn(outcome.task, rng)
        solve(task)
        off = (task.unknowns.values - outcome.values)[free]
        total += float(off @ inverse @ off)
    degrees = 20 * free.size
    assert chdtri(degrees, 0.9995) < total < chdtri(degrees, 0.0005)


def test_a_gravity_that_was_assumed_is_rectangular_and_contradicts_the_normal_interval(monkeypatch) -> None:
    """Where it is nearly all of a scale factor's uncertainty, 95 % of a rectangle end at 0.95 sqrt(3) sigma."""
    monkeypatch.setattr(budget, "READJUSTED", 2)
    estimate = deepcopy(hand_held())
    outcome = outcome_of(estimate)
    unknown = Site.unknown()
    outcome.task.site = replace(unknown, gravity=SITE.gravity)
    at = next(i for i, p in enumerate(estimate.parameters) if p.name == "accelerometer scale factor error x")
    sigma = unknown.gravity_sigma / SITE.gravity
    parameter = estimate.parameters[at]
    estimate.parameters[at] = replace(parameter, standard_uncertainty=float(np.hypot(sigma, 1e-5)))
    draw_distributions(estimate, 5000, np.random.default_rng(1), lambda _: None)
    drawn = estimate.shown(Budget).statement.drawn
    half = 0.5 * float(np.diff(drawn.intervals[at])[0])
    assert half == pytest.approx(0.95 * np.sqrt(3.0) * sigma, rel=0.05)
    assert not drawn.validated[at]
    assert "contradicted" in estimate.remarks[-1]


def test_an_angle_that_another_one_could_be_blamed_for_is_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of both ways about an axis the right one is left out: the other explains what was recorded better."""
    kept: list[JointOutcome] = []
    monkeypatch.setattr(estimate, "say_contradictions", lambda _, outcome, __: kept.append(outcome))
    calibrated(played("turntable", "industrial", 3, "misread", seconds=10.0, rate=25.0), rate="25±0.00003")
    monkeypatch.undo()
    outcome = kept[-1]
    rows = list(outcome.data.rotations)
    (wrong,) = (k for k in rows if not outcome.task.taking_part["angle"][k])
    found = estimate.joint_estimate(outcome)
    assert not found.objections
    # Rotations go both ways about an axis one after the other.
    right = rows[rows.index(wrong) ^ 1]
    task = outcome.task.copy()
    task.taking_part["angle"][[wrong, right]] = True, False
    masked = replace(outcome, task=task, balanced=replace(outcome.balanced, solution=solve(task)))
    objections.say_contradictions(found, masked, [])
    said = " ".join(found.objections)
    names = [outcome.data.rotations[k].name for k in (right, wrong)]
    assert f"The angle of {names[0]} contradicts the rest and was left out." in said
    assert f"Were that of {names[1]} wrong" in said
