"""Predicted errors are those of closed forms at rest and of the filter's transition on a drive."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.navigation import (
    InertialSamples,
    NavigationState,
    TriadSpread,
    covariance_from_calibration,
    plan_filter,
)
from tumble.navigation.prediction import advise_states, moved, predict_errors, propagated_noise
from tumble.noise.terms import NoiseModel
from tumble.sensor import ImuModel, Triad
from tumble.simulation.standard_trajectories import STANDARD, standard_trajectory
from tumble.simulation.trajectories import SplineTrajectory

QUIET = NoiseModel(random_walk=1e-3), NoiseModel(random_walk=1e-5)
MODEL = ImuModel(
    Triad(np.array([[2.0, 0.01, -0.02], [0.03, 2.1, 0.02], [0.01, -0.04, 1.9]]), np.array([0.1, -0.2, 0.3])),
    Triad(np.array([[50.0, 0.4, -0.3], [0.2, 51.0, 0.1], [-0.5, 0.6, 49.0]]), np.array([3.0, -2.0, 1.0])),
    # small: what the force's errors do to the rate through it, filters leave out
    1e-2 * np.array([[1e-2, 2e-2, -1e-2], [0.0, 1e-2, 3e-2], [2e-2, 0.0, -1e-2]]),
)
NAMES = [
    *(
        f"{kind}.{what}"
        for kind in ("accelerometer", "gyroscope")
        for what in ("matrix[1,0]", "matrix[2,2]", "bias[1]")
    ),
    "gyroscope.g_sensitivity[0,2]",
]
SIGMAS = np.array([2e-3, 1e-3, 3e-3, 0.02, 0.03, 0.01, 2e-3])


def along(
    path: SplineTrajectory, seconds: float, rate: float = 50.0
) -> tuple[InertialSamples, NavigationState]:
    time = np.arange(int(seconds * rate) + 2) / rate
    states = path.states(time)
    first = path.states(time[:1])
    roll, pitch, yaw = np.asarray(path.angles(0.0))
    start = NavigationState.from_angles(
        0.0,
        (float(first.latitude[0]), float(first.longitude[0]), float(first.height[0])),
        first.velocity_n[0],
        np.array([roll, pitch, yaw]),
    )
    return InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), start


def covariance() -> np.ndarray:
    mixed = np.eye(7) + 0.3 * np.tril(np.ones((7, 7)), -1)
    shape = mixed @ mixed.T
    scale = SIGMAS / np.sqrt(np.diag(shape))
    return shape * np.outer(scale, scale)


@pytest.mark.parametrize("name", sorted(STANDARD))
def test_parameters_do_what_the_filter_s_transition_says(name: str) -> None:
    """Differences of the mechanisation against the error-state transition, two ways that share no formula."""
    samples, start = along(standard_trajectory(name, 70.0), 70.0)
    bare = plan_filter(*QUIET)
    found = predict_errors(samples, start, MODEL, NAMES, covariance(), bare, [5.0, 60.0])
    setup = plan_filter(
        *QUIET,
        accelerometer=TriadSpread(1e-9, 1e-9, misalignment=1e-9),
        gyroscope=TriadSpread(1e-9, 1e-9, misalignment=1e-9),
        g_sensitivity=1e-12,
    )
    known = covariance_from_calibration(setup.states, MODEL, NAMES, covariance())
    _, by_state = propagated_noise(samples, start, setup, np.array([5.0, 60.0]))
    expected = by_state @ known @ by_state.transpose(0, 2, 1)
    ours, theirs = (np.sqrt(np.einsum("kii->ki", part)) for part in (found.calibration, expected))
    # first-order steps of 20 ms are some 3 dt/t = 1.2 % off after 5 s where errors grow with t³
    assert np.allclose(ours[:, :6], theirs[:, :6], rtol=0.02, atol=1e-5)
    assert np.allclose(ours[:, 6:], theirs[:, 6:], rtol=0.02, atol=1e-6)


def test_at_rest_a_bias_moves_by_half_its_square_of_time() -> None:
    samples, start = along(standard_trajectory("rest", 12.0), 12.0)
    unit = ImuModel.ideal()
    sigma = np.diag([1e-3, 1e-5]) ** 2
    found = predict_errors(
        samples,
        start,
        unit,
        ["accelerometer.bias[0]", "gyroscope.bias[1]"],
        sigma,
        plan_filter(*QUIET),
        [10.0],
    )
    moves = np.hypot(found.of_each()[0, 0], found.of_each()[0, 1])
    # b t²/2 and g w t³/6; Earth rate and Schuler's period change some 1e-4 of it in ten seconds
    assert moves == pytest.approx([0.5 * 1e-3 * 100.0, 9.8 * 1e-5 * 1000.0 / 6.0], rel=3e-3)
    white = found.noise[0]
    # N² t³/3 of the accelerometers, and g² N² t⁵/20 of the gyros, for each level direction
    assert white[0, 0] == pytest.approx(1e-6 * 1000.0 / 3.0 + 9.8**2 * 1e-10 * 1e5 / 20.0, rel=0.03)


def test_states_that_do_nothing_are_left_out_and_those_that_matter_are_not() -> None:
    samples, start = along(standard_trajectory("rest", 62.0), 62.0)
    setup = plan_filter(
        *QUIET, accelerometer=TriadSpread(0.01, 1e-9, 1e-9), gyroscope=TriadSpread(1e-3, 1e-7, 1e-7)
    )
    advice = {state.name: state for state in advise_states(samples, start, setup, [60.0])}
    assert advice["gyroscope bias x"].carry
    assert advice["gyroscope bias z"].carry
    assert advice["accelerometer bias z"].carry
    assert not advice["accelerometer scale x"].carry
    assert not advice["gyroscope scale x"].carry
    assert advice["gyroscope bias x"].sigma == 1e-3


def test_a_walking_bias_is_carried() -> None:
    samples, start = along(standard_trajectory("rest", 12.0), 12.0)
    setup = plan_filter(QUIET[0], NoiseModel(random_walk=1e-5, rate_random_walk=1e-9))
    assert all(state.carry for state in advise_states(samples, start, setup, [10.0]))


def test_names_that_are_no_parameters_are_refused() -> None:
    for name in ("gyroscope.bias[3]", "magnetometer.bias[0]", "accelerometer.scale[0]", "accelerometer.bias"):
        with pytest.raises(UsageError, match="no parameter"):
            moved(MODEL, name, 1.0)
    samples, start = along(standard_trajectory("rest", 12.0), 12.0)
    with pytest.raises(UsageError, match="lasts"):
        predict_errors(samples, start, MODEL, NAMES, covariance(), plan_filter(*QUIET), [100.0])
    with pytest.raises(UsageError, match="no trajectory"):
        standard_trajectory("zigzag", 10.0)
