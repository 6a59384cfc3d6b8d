"""Predicted errors are those of closed forms at rest and of the mechanisation on a straight course."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tumble.document import read_calibration
from tumble.navigation import (
    FilterSetup,
    InertialSamples,
    NavigationState,
    TriadSpread,
    navigate,
    plan_filter,
)
from tumble.navigation.prediction import predict_errors
from tumble.noise.terms import NoiseModel
from tumble.simulation import SplineTrajectory
from tumble.workflows.predict import straight_course

QUIET = NoiseModel(random_walk=1e-3), NoiseModel(random_walk=1e-5)
CALIBRATION = Path(__file__).resolve().parents[2] / "reference" / "drive_rtk" / "calibration.json"


def at_rest(seconds: float) -> tuple[InertialSamples, NavigationState]:
    angles = np.array([0.0, 0.0, 0.7])
    path = SplineTrajectory.at_rest((0.7, 0.2, 100.0), angles, seconds + 1.0)
    time = np.arange(int(seconds * 50.0) + 2) / 50.0
    states = path.states(time)
    start = NavigationState.from_angles(0.0, (0.7, 0.2, 100.0), np.zeros(3), angles)
    return InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), start


def moved(samples: InertialSamples, kind: str, row: int, column: int, by: float) -> InertialSamples:
    """Samples that err by a state of a filter."""
    force, rate = samples.specific_force_b.copy(), samples.angular_rate_ib_b.copy()
    own = force if kind == "accelerometer" else rate
    seen = samples.angular_rate_ib_b if kind == "gyroscope" else samples.specific_force_b
    own[:, row] += by * (seen[:, column] if column >= 0 else 1.0)
    return replace(samples, specific_force_b=force, angular_rate_ib_b=rate)


def test_states_do_what_the_mechanisation_says() -> None:
    """The error-state transition against differences of navigation, two ways that share no formula."""
    samples, start = straight_course(70.0, read_calibration(CALIBRATION))
    setup = plan_filter(
        *QUIET,
        accelerometer=TriadSpread(3e-3, 2e-3, misalignment=1e-3),
        gyroscope=TriadSpread(1e-4, 1e-3, misalignment=2e-3),
        g_sensitivity=1e-5,
    )
    # states go together by three: a mixture that no row or column of which is like another
    count = len(setup.states)
    sigmas = np.sqrt(np.diag(setup.sensor_covariance))
    mixed = np.eye(count) + 0.3 * np.tril(np.ones((count, count)), -1)
    shape = mixed @ mixed.T
    scale = sigmas / np.sqrt(np.diag(shape))
    known = shape * np.outer(scale, scale)
    found = predict_errors(samples, start, setup.with_sensor_covariance(known), [60.0, 5.0])
    by_state = np.zeros((2, 9, count))
    for at, (state, sigma) in enumerate(zip(setup.states, sigmas, strict=True)):
        step = 0.01 * sigma
        ends = [
            navigate(moved(samples, state.kind, state.row, state.column, sign * step), start)
            for sign in (1.0, -1.0)
        ]
        rows = np.searchsorted(ends[0].time, np.array([5.0, 60.0]) - 1e-6)
        parts = ends[0].rows(rows).errors_against(ends[1].rows(rows))
        by_state[:, :, at] = np.hstack(parts) / (2.0 * step)
    expected = by_state @ known @ by_state.transpose(0, 2, 1)
    ours, theirs = (np.sqrt(np.einsum("kii->ki", part)) for part in (found.calibration, expected))
    assert found.seconds.tolist() == [5.0, 60.0]
    # first-order steps of 20 ms are some 3 dt/t = 1.2 % off after 5 s where errors grow with t³
    assert np.allclose(ours[:, :6], theirs[:, :6], rtol=0.02, atol=1e-5)
    assert np.allclose(ours[:, 6:], theirs[:, 6:], rtol=0.02, atol=1e-6)


@pytest.mark.parametrize(
    ("setup", "moves"),
    [
        # b t²/2 and g w t³/6; Earth rate and Schuler's period change some 1e-4 of it in ten seconds,
        # the filter's steps of 20 ms some 3 dt/t
        (plan_filter(*QUIET, accelerometer=TriadSpread(1e-3)), 0.5 * 1e-3 * 100.0),
        (plan_filter(*QUIET, gyroscope=TriadSpread(1e-5)), 9.8 * 1e-5 * 1000.0 / 6.0),
    ],
)
def test_at_rest_a_bias_moves_by_half_its_square_of_time(setup: FilterSetup, moves: float) -> None:
    samples, start = at_rest(12.0)
    found = predict_errors(samples, start, setup, [10.0])
    assert np.sqrt(np.diag(found.calibration[0])[:2]) == pytest.approx([moves, moves], rel=0.01)
    # N² t³/3 of the accelerometers, and g² N² t⁵/20 of the gyros, for each level direction
    white = 1e-6 * 1000.0 / 3.0 + 9.8**2 * 1e-10 * 1e5 / 20.0
    assert found.noise[0][0, 0] == pytest.approx(white, rel=0.03)


def test_states_that_do_nothing_are_left_out_and_those_that_matter_are_not() -> None:
    samples, start = at_rest(62.0)
    setup = plan_filter(
        *QUIET, accelerometer=TriadSpread(0.01, 1e-9, 1e-9), gyroscope=TriadSpread(1e-3, 1e-7, 1e-7)
    )
    advice = {state.name: state for state in predict_errors(samples, start, setup, [60.0]).states}
    assert advice["gyroscope bias x"].carry
    assert advice["gyroscope bias z"].carry
    assert advice["accelerometer bias z"].carry
    assert not advice["accelerometer scale x"].carry
    assert not advice["gyroscope scale x"].carry
    assert advice["gyroscope bias x"].sigma == 1e-3


def test_a_walking_bias_is_carried() -> None:
    samples, start = at_rest(12.0)
    setup = plan_filter(QUIET[0], NoiseModel(random_walk=1e-5, rate_random_walk=1e-9))
    assert all(state.carry for state in predict_errors(samples, start, setup, [10.0]).states)
