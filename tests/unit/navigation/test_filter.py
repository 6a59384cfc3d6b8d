"""The filter, free runs and predicted errors: against the mechanisation, closed forms and simulated truth."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document import read_calibration
from tumble.earth import curvature_radii
from tumble.errors import RecordingError, UsageError
from tumble.navigation import (
    FilterRun,
    FilterSetup,
    GnssTrack,
    InertialSamples,
    NavigationState,
    Trajectory,
    TriadSpread,
    covariance_from_calibration,
    navigate,
    plan_filter,
    run_filter,
    smooth,
)
from tumble.navigation.filter.kernels import apply_errors
from tumble.navigation.filter.run import unpacked
from tumble.navigation.filter.setup import sensor_states
from tumble.navigation.gnss import make_track
from tumble.navigation.mechanisation import navigate_from_each
from tumble.navigation.prediction import predict_errors
from tumble.noise import GaussMarkov, NoiseModel
from tumble.sensor import ImuModel, Triad
from tumble.simulation import SplineTrajectory, simulate_drive
from tumble.workflows import straight_course

LEVER = np.array([0.5, -0.3, -1.0])
FORCE_NOISE = NoiseModel(random_walk=1e-3, rate_random_walk=1e-5)
RATE_NOISE = NoiseModel(random_walk=1e-4, rate_random_walk=1e-6)
FORCE, RATE = TriadSpread(0.02, 1e-3, 1e-3), TriadSpread(2e-3, 1e-3, misalignment=1e-3)


def moved(state: NavigationState, errors: np.ndarray) -> NavigationState:
    """A state with errors added to its truth."""
    packed = state.packed
    apply_errors(packed, np.zeros(0), -errors)
    return unpacked(np.array([state.time]), packed[None]).state(0)


def planned(**more: float) -> FilterSetup:
    told: dict[str, Any] = {"accelerometer": FORCE, "gyroscope": RATE, "lever_arm_b": LEVER, **more}
    return plan_filter(FORCE_NOISE, RATE_NOISE, **told).with_start(0.02, 0.01, np.array([0.003, 0.003, 0.02]))


class Case:
    """A simulated drive with a unit's errors and noise, and 1 Hz positions of 2 cm."""

    def __init__(self, seed: int, duration: float = 120.0, rate: float = 100.0) -> None:
        rng = np.random.default_rng(seed)
        drive = simulate_drive(rng, duration + 1.0)
        time = np.arange(int(duration * rate) + 1) / rate
        states = drive.states(time)
        place = (states.latitude, states.longitude, states.height)
        self.truth = Trajectory(states.time, *place, states.velocity_n, states.quaternion_nb)
        force_bias, rate_bias = rng.normal(0.0, FORCE.bias, 3), rng.normal(0.0, RATE.bias, 3)
        force_error = np.diag(rng.normal(0.0, 1e-3, 3)) + np.tril(rng.normal(0.0, 1e-3, (3, 3)), -1)
        rate_error = rng.normal(0.0, 1e-3, (3, 3))
        shape = (len(time), 3)
        white = [N * np.sqrt(rate) * rng.standard_normal(shape) for N in (1e-3, 1e-4)]
        walk = [np.cumsum(K / np.sqrt(rate) * rng.standard_normal(shape), axis=0) for K in (1e-5, 1e-6)]
        force = states.specific_force_b @ (np.eye(3) + force_error).T + force_bias + white[0] + walk[0]
        angular = states.angular_rate_ib_b @ (np.eye(3) + rate_error).T + rate_bias + white[1] + walk[1]
        self.samples = InertialSamples(time, force, angular)
        of_force = force_bias + walk[0][-1], np.diag(force_error), force_error[[1, 2, 2], [0, 0, 1]]
        of_rate = rate_bias + walk[1][-1], np.diag(rate_error), rate_error[~np.eye(3, dtype=bool)]
        self.sensors = np.concatenate([*of_force, *of_rate])
        self.fixes = self.truth.rows(np.arange(int(rate), len(time), int(rate)))
        self.noise = rng.normal(0.0, 0.02, (len(self.fixes), 3))
        self.track = self.track_with(self.noise)
        self.setup = planned()
        spread = np.sqrt(np.diag(self.setup.navigation_covariance))
        self.start = moved(self.truth.state(0), spread * rng.standard_normal(9))

    def track_with(self, noise: np.ndarray, late: float = 0.0) -> GnssTrack:
        latitude, longitude, height = self.fixes.points(LEVER)
        meridian, across = curvature_radii(latitude)
        east = noise[:, 1] / (across * np.cos(latitude))
        position = latitude + noise[:, 0] / meridian, longitude + east, height - noise[:, 2]
        return make_track(self.fixes.time + late, position, np.full((len(noise), 3), 0.02))

    def run(self, **changed: Any) -> FilterRun:
        told = {"samples": self.samples, "track": self.track, "start": self.start, "setup": self.setup}
        return run_filter(**(told | changed))


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [Case(seed) for seed in range(6)]


def test_the_transition_is_the_derivative_of_the_mechanisation() -> None:
    case = Case(40, duration=25.0)
    told = {"start": case.truth.state(0), "setup": replace(case.setup, block=0.05), "positions": False}
    run = case.run(**told, instants=np.array([15.0, 16.0]), keep_covariances=True)
    first, last = (int(np.argmin(np.abs(run.time - instant))) for instant in (15.0, 16.0))
    begin, part = run.trajectory.state(first), case.samples.between(15.0, 16.0)

    def end(state: NavigationState) -> Trajectory:
        return navigate(part, state).rows(np.array([-1]))

    found, plain = np.empty((9, 9)), end(begin)
    for column, size in enumerate([1.0] * 3 + [0.1] * 3 + [1e-4] * 3):
        errors = np.zeros(9)
        errors[column] = size
        there = end(moved(begin, errors)).errors_against(plain)
        found[:, column] = np.concatenate([e[0] for e in there]) / size
    transition = run.transitions[last][:9, :9]
    # products of 1 + F dt at 100 Hz: second-order terms are 0.5 dt of each entry over a second, and of entries of
    # the size of gravity (10) and one, 5e-2 and 5e-3
    scale = np.array([1.0] * 3 + [1.0] * 3 + [0.1] * 3)
    assert (found / scale[:, None]) * scale == pytest.approx(transition / scale[:, None] * scale, abs=8e-3)
    assert transition[3, 7] == pytest.approx(found[3, 7], rel=2e-3)
    assert transition[4, 6] == pytest.approx(found[4, 6], rel=2e-3)


def test_estimates_and_sigmas_agree_with_the_truth(cases: list[Case]) -> None:
    normalised, sensors, distances = [], [], []
    for case in cases:
        run = case.run(keep_covariances=True)
        errors = np.hstack(run.trajectory.errors_against(case.fixes))
        last = errors[-1] @ np.linalg.solve(run.covariances[-1][:9, :9], errors[-1])
        normalised.append(last)
        left = run.sensors[-1] - case.sensors
        sensors.append(left @ np.linalg.solve(run.covariances[-1][9:, 9:], left))
        distances.append(np.mean(run.distances[:, 0]))
        assert not len(run.refused)
    # means of six chi-squares of 9 and of 21: their sigmas are 1.7 and 2.6; four of them
    assert np.mean(normalised) == pytest.approx(9.0, abs=7.0)
    assert np.mean(sensors) == pytest.approx(21.0, abs=11.0)
    # of 720 of 3: 0.09
    assert np.mean(distances) == pytest.approx(3.0, abs=0.4)


def test_smoothing_is_better_than_filtering_and_says_by_how_much(cases: list[Case]) -> None:
    filtered, smoothed, normalised = [], [], []
    for case in cases:
        run = case.run(keep_covariances=True)
        result = smooth(run)
        middle = np.arange(30, 90)
        errors = [np.hstack(r.trajectory.errors_against(case.fixes))[middle] for r in (run, result)]
        filtered.append(np.mean(errors[0] ** 2, axis=0))
        smoothed.append(np.mean(errors[1] ** 2, axis=0))
        at = errors[1][30]
        normalised.append(at @ np.linalg.solve(result.covariances[60][:9, :9], at))
        assert np.all(result.sigmas <= run.sigmas * (1.0 + 1e-6))
        # nothing comes after the last event
        assert result.sensors[-1] == pytest.approx(run.sensors[-1], abs=0.0)
    assert np.all(np.mean(smoothed, axis=0)[:6] < np.mean(filtered, axis=0)[:6])
    assert np.mean(normalised) == pytest.approx(9.0, abs=7.0)  # as above


def test_an_outlier_is_refused_and_a_lasting_jump_is_not(cases: list[Case]) -> None:
    case, noise = cases[0], cases[0].noise.copy()
    noise[60] += np.array([5.0, 0.0, 0.0])
    assert list(case.run(track=case.track_with(noise)).refused) == [60]
    noise[70:] += np.array([0.0, 1.0, 0.0])
    run = case.run(track=case.track_with(noise))
    # after the patience of three the filter begins to follow
    assert len(run.refused) > 3
    assert run.trajectory.errors_against(case.fixes)[0][-1, 1] > 0.3


def test_a_time_offset_is_found(cases: list[Case]) -> None:
    # stamps 30 ms early: what was there at t is told to have been at t - 0.03
    late = cases[1].track_with(cases[1].noise, late=-0.03)
    value, sigma = cases[1].run(track=late, setup=planned(time_offset_sigma=0.05)).sensor("time offset")
    assert value == pytest.approx(0.03, abs=4.0 * sigma + 1e-4)
    assert sigma < 0.005


def test_an_imu_gap_is_bridged_with_an_honest_sigma(cases: list[Case]) -> None:
    case, whole = cases[2], cases[2].samples
    rows = (whole.time < 60.2) | (whole.time > 60.8)
    left = InertialSamples(whole.time[rows], whole.specific_force_b[rows], whole.angular_rate_ib_b[rows])
    run = case.run(samples=left)
    assert run.innovation_sigmas[60, 0] > 5.0 * case.run().innovation_sigmas[60, 0]
    # and it recovers: the positions at the end are as good as ever
    assert np.abs(run.trajectory.errors_against(case.fixes)[0][-10:]).max() < 0.1


def test_a_calibration_s_covariance_becomes_the_states() -> None:
    rng = np.random.default_rng(7)
    matrix = np.array([[2.0, 0.1, -0.05], [0.2, 1.8, 0.03], [-0.1, 0.05, 2.2]])
    model = ImuModel(Triad(matrix, np.array([0.1, 0.2, -0.3])), Triad(1.1 * matrix.T, np.zeros(3)))
    states = plan_filter(FORCE_NOISE, RATE_NOISE, accelerometer=FORCE, gyroscope=RATE).states
    names = [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    names += [f"accelerometer.bias[{i}]" for i in range(3)]
    root = 1e-3 * rng.standard_normal((12, 12))
    covariance = covariance_from_calibration(states, model, names, root @ root.T)
    variance = {state.name: covariance[at, at] for at, state in enumerate(states)}
    # by the definition: samples of a true unit, corrected by the model, have these errors left
    draws = (root @ rng.standard_normal((12, 4000))).T
    bias = np.linalg.solve(matrix, draws[:, 9:].T)
    entries = np.linalg.solve(matrix, draws[:, :9].reshape(-1, 3, 3))
    # a variance of 4000 draws is good to 2 %
    assert variance["accelerometer bias y"] == pytest.approx(np.var(bias[1]), rel=0.1)
    assert variance["accelerometer non-orthogonality yx"] == pytest.approx(np.var(entries[:, 1, 0]), rel=0.1)
    # the gyro is not in the calibration: its states keep their own
    assert variance["gyroscope bias x"] == RATE.bias**2


def test_noise_models_become_states() -> None:
    noise = NoiseModel(random_walk=1e-4, bias_instability=1e-5, gauss_markov=(GaussMarkov(2e-5, 50.0),))
    plain = plan_filter(FORCE_NOISE, noise, gyroscope=TriadSpread(bias=1e-3))
    names = [state.name for state in plain.states]
    assert names.count("gyroscope bias x") == 1
    markov = plain.states[names.index("gyroscope bias x, 50 s")]
    assert markov.decay == pytest.approx(0.02)
    assert markov.drive == pytest.approx(2.0 * 4e-10 / 50.0)
    with pytest.raises(UsageError, match="three axes"):
        sensor_states(FORCE, RATE, accelerometer_noise=[noise] * 2, gyroscope_noise=[noise] * 3)


def test_what_a_filter_cannot_do_is_refused(cases: list[Case]) -> None:
    case, run = cases[0], cases[0].run()
    with pytest.raises(RecordingError, match="do not overlap in time"):
        case.run(track=case.track.shifted(1e6))
    covariance = case.track.position_covariance_n.copy()
    covariance[5, 0, 1] = covariance[5, 1, 0] = 2.0 * covariance[5, 0, 0]
    with pytest.raises(RecordingError, match="not positive definite"):
        case.run(track=replace(case.track, position_covariance_n=covariance))
    with pytest.raises(UsageError, match="no state"):
        run.sensor("colour")
    with pytest.raises(UsageError, match="kept no covariances"):
        smooth(run)


@pytest.mark.parametrize("means", [False, True])
def test_each_of_many_short_free_runs_is_what_navigation_to_its_goal_alone_is(means: bool) -> None:
    rng = np.random.default_rng(3)
    rate, force = 0.2 * rng.standard_normal((500, 3)), rng.normal([0.3, 1.0, -9.0], 1.0, (500, 3))
    samples = InertialSamples(np.cumsum(rng.uniform(0.005, 0.02, 500)), force, rate, means)
    start = NavigationState.from_angles(
        0.0, (0.8, -2.0, 300.0), np.array([20.0, -30.0, 4.0]), np.array([0.3, -0.4, 2.0])
    )
    begins = samples.time[0] + np.array([0.0, 1.234, 2.5])
    goals = begins[:, None] + [0.5, 0.5777, 2.0]
    goals[1, 1] = np.nan
    found = navigate_from_each(samples, np.vstack([start.packed] * 3), begins, goals)
    assert np.isnan(found[1, 1]).all()
    for one, begin in enumerate(begins.tolist()):
        for at in (0, 2):
            part = samples.between(begin, float(goals[one, at]))
            alone = navigate(part, replace(start, time=begin)).state(-1).packed
            # rounding over 200 samples
            assert found[one, at, 3:6] == pytest.approx(alone[3:6], abs=1e-11)
            assert found[one, at, :2] == pytest.approx(alone[:2], abs=1e-12)


# Predicted errors: closed forms at rest, and the mechanisation on a straight course --------------------

QUIET = NoiseModel(random_walk=1e-3), NoiseModel(random_walk=1e-5)
CALIBRATION = Path(__file__).resolve().parents[2] / "reference" / "drive_rtk" / "calibration.json"


def at_rest(seconds: float) -> tuple[InertialSamples, NavigationState]:
    angles = np.array([0.0, 0.0, 0.7])
    path = SplineTrajectory.at_rest((0.7, 0.2, 100.0), angles, seconds + 1.0)
    time = np.arange(int(seconds * 50.0) + 2) / 50.0
    states = path.states(time)
    start = NavigationState.from_angles(0.0, (0.7, 0.2, 100.0), np.zeros(3), angles)
    return InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), start


def erring(samples: InertialSamples, kind: str, row: int, column: int, by: float) -> InertialSamples:
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
            navigate(erring(samples, state.kind, state.row, state.column, sign * step), start)
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


def test_states_that_do_nothing_are_left_out_and_those_that_matter_or_walk_are_not() -> None:
    samples, start = at_rest(62.0)
    spreads = {"accelerometer": TriadSpread(0.01, 1e-9, 1e-9), "gyroscope": TriadSpread(1e-3, 1e-7, 1e-7)}
    found = predict_errors(samples, start, plan_filter(*QUIET, **spreads), [60.0]).states
    carried = {state.name: state.carry for state in found}
    kept = "gyroscope bias x", "gyroscope bias z", "accelerometer bias z"
    left = "accelerometer scale x", "gyroscope scale x"
    assert [carried[name] for name in (*kept, *left)] == [True] * 3 + [False] * 2
    assert next(state.sigma for state in found if state.name == "gyroscope bias x") == 1e-3
    walking = plan_filter(QUIET[0], NoiseModel(random_walk=1e-5, rate_random_walk=1e-9))
    assert all(state.carry for state in predict_errors(samples, start, walking, [10.0]).states)
