"""The error-state filter: its transition against the mechanisation, its estimates against simulated truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.earth import curvature_radii
from tumble.errors import RecordingError, UsageError
from tumble.navigation import (
    FilterRun,
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
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.sensor import ImuModel, Triad
from tumble.simulation import simulate_drive

LEVER = np.array([0.5, -0.3, -1.0])
FORCE_NOISE = NoiseModel(random_walk=1e-3, rate_random_walk=1e-5)
RATE_NOISE = NoiseModel(random_walk=1e-4, rate_random_walk=1e-6)
FORCE, RATE = TriadSpread(0.02, 1e-3, 1e-3), TriadSpread(2e-3, 1e-3, misalignment=1e-3)


def moved(state: NavigationState, errors: np.ndarray) -> NavigationState:
    """A state with errors added to its truth."""
    packed = state.packed
    apply_errors(packed, np.zeros(0), -errors)
    return unpacked(np.array([state.time]), packed[None]).state(0)


class Case:
    """A simulated drive with a unit's errors and noise, and 1 Hz positions of 2 cm."""

    def __init__(self, seed: int, duration: float = 120.0, rate: float = 100.0) -> None:
        rng = np.random.default_rng(seed)
        drive = simulate_drive(rng, duration + 1.0)
        time = np.arange(int(duration * rate) + 1) / rate
        states = drive.states(time)
        self.truth = Trajectory(
            states.time,
            states.latitude,
            states.longitude,
            states.height,
            states.velocity_n,
            states.quaternion_nb,
        )
        force_bias, rate_bias = rng.normal(0.0, FORCE.bias, 3), rng.normal(0.0, RATE.bias, 3)
        force_error = np.diag(rng.normal(0.0, 1e-3, 3)) + np.tril(rng.normal(0.0, 1e-3, (3, 3)), -1)
        rate_error = rng.normal(0.0, 1e-3, (3, 3))
        shape = (len(time), 3)
        white = [N * np.sqrt(rate) * rng.standard_normal(shape) for N in (1e-3, 1e-4)]
        walk = [np.cumsum(K / np.sqrt(rate) * rng.standard_normal(shape), axis=0) for K in (1e-5, 1e-6)]
        force = states.specific_force_b @ (np.eye(3) + force_error).T + force_bias + white[0] + walk[0]
        angular = states.angular_rate_ib_b @ (np.eye(3) + rate_error).T + rate_bias + white[1] + walk[1]
        self.samples = InertialSamples(time, force, angular)
        off = ~np.eye(3, dtype=bool)
        self.sensors = np.concatenate(
            [
                force_bias + walk[0][-1],
                np.diag(force_error),
                force_error[[1, 2, 2], [0, 0, 1]],
                rate_bias + walk[1][-1],
                np.diag(rate_error),
                rate_error[off],
            ]
        )
        self.fixes = self.truth.rows(np.arange(int(rate), len(time), int(rate)))
        self.noise = rng.normal(0.0, 0.02, (len(self.fixes), 3))
        self.track = self.track_with(self.noise)
        self.setup = plan_filter(
            FORCE_NOISE, RATE_NOISE, accelerometer=FORCE, gyroscope=RATE, lever_arm_b=LEVER
        ).with_start(0.02, 0.01, np.array([0.003, 0.003, 0.02]))
        spread = np.sqrt(np.diag(self.setup.navigation_covariance))
        self.start = moved(self.truth.state(0), spread * rng.standard_normal(9))

    def track_with(self, noise: np.ndarray, late: float = 0.0) -> GnssTrack:
        latitude, longitude, height = self.fixes.points(LEVER)
        meridian, across = curvature_radii(latitude)
        position = (
            latitude + noise[:, 0] / meridian,
            longitude + noise[:, 1] / (across * np.cos(latitude)),
            height - noise[:, 2],
        )
        return make_track(self.fixes.time + late, position, np.full((len(noise), 3), 0.02))

    def run(self, **options: object) -> FilterRun:
        return run_filter(self.samples, self.track, self.start, self.setup, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [Case(seed) for seed in range(6)]


def test_the_transition_is_the_derivative_of_the_mechanisation() -> None:
    case = Case(40, duration=25.0)
    setup = replace(case.setup, block=0.05)
    instants = np.array([15.0, 16.0])
    start = case.truth.state(0)
    run = run_filter(
        case.samples, case.track, start, setup, positions=False, instants=instants, keep_covariances=True
    )
    first, last = (int(np.argmin(np.abs(run.time - instant))) for instant in instants)
    begin = run.trajectory.state(first)
    part = case.samples.between(15.0, 16.0)

    def end(state: NavigationState) -> Trajectory:
        return navigate(part, state).rows(np.array([-1]))

    plain = end(begin)
    sizes = np.array([1.0] * 3 + [0.1] * 3 + [1e-4] * 3)
    found = np.empty((9, 9))
    for column, size in enumerate(sizes):
        errors = np.zeros(9)
        errors[column] = size
        found[:, column] = (
            np.concatenate([e[0] for e in end(moved(begin, errors)).errors_against(plain)]) / size
        )
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
    case = cases[0]
    noise = case.noise.copy()
    noise[60] += np.array([5.0, 0.0, 0.0])
    run = run_filter(case.samples, case.track_with(noise), case.start, case.setup)
    assert list(run.refused) == [60]
    noise[70:] += np.array([0.0, 1.0, 0.0])
    run = run_filter(case.samples, case.track_with(noise), case.start, case.setup)
    # after the patience of three the filter begins to follow
    assert len(run.refused) > 3
    follows = run.trajectory.errors_against(case.fixes)[0][-1, 1]
    assert follows > 0.3


def test_a_time_offset_is_found(cases: list[Case]) -> None:
    case = cases[1]
    setup = plan_filter(
        FORCE_NOISE,
        RATE_NOISE,
        accelerometer=FORCE,
        gyroscope=RATE,
        lever_arm_b=LEVER,
        time_offset_sigma=0.05,
    ).with_start(0.02, 0.01, np.array([0.003, 0.003, 0.02]))
    # stamps 30 ms early: what was there at t is told to have been at t - 0.03
    run = run_filter(case.samples, case.track_with(case.noise, late=-0.03), case.start, setup)
    value, sigma = run.sensor("time offset")
    assert value == pytest.approx(0.03, abs=4.0 * sigma + 1e-4)
    assert sigma < 0.005


def test_an_imu_gap_is_bridged_with_an_honest_sigma(cases: list[Case]) -> None:
    case = cases[2]
    rows = (case.samples.time < 60.2) | (case.samples.time > 60.8)
    samples = InertialSamples(
        case.samples.time[rows], case.samples.specific_force_b[rows], case.samples.angular_rate_ib_b[rows]
    )
    run = run_filter(samples, case.track, case.start, case.setup)
    whole = case.run()
    assert run.innovation_sigmas[60, 0] > 5.0 * whole.innovation_sigmas[60, 0]
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
    # by the definition: samples of the true unit, corrected by the model, have these errors left
    change = root @ rng.standard_normal(12)
    true = Triad(matrix + change[:9].reshape(3, 3), model.accelerometer.bias + change[9:])  # type: ignore[union-attr]
    E = np.linalg.solve(matrix, true.matrix) - np.eye(3)
    bias = np.linalg.solve(matrix, true.bias - model.accelerometer.bias)  # type: ignore[union-attr]
    index = {state.name: at for at, state in enumerate(states)}
    draws = root @ rng.standard_normal((12, 4000))
    sample = np.linalg.solve(matrix, draws[9:])
    at = index["accelerometer bias y"]
    # a variance of 4000 draws is good to 2 %
    assert covariance[at, at] == pytest.approx(np.var(sample[1]), rel=0.1)
    yx = np.array([np.linalg.solve(matrix, column[:9].reshape(3, 3))[1, 0] for column in draws.T])
    at = index["accelerometer non-orthogonality yx"]
    assert covariance[at, at] == pytest.approx(np.var(yx), rel=0.1)
    assert abs(bias[1]) < 6.0 * np.sqrt(
        covariance[index["accelerometer bias y"]][index["accelerometer bias y"]]
    )
    assert abs(E[1, 0]) < 6.0 * np.sqrt(covariance[at, at])
    # the gyro is not in the calibration: its states keep their own
    at = index["gyroscope bias x"]
    assert covariance[at, at] == RATE.bias**2


def test_noise_models_become_states() -> None:
    noise = NoiseModel(random_walk=1e-4, bias_instability=1e-5, gauss_markov=(GaussMarkov(2e-5, 50.0),))
    plain = plan_filter(FORCE_NOISE, noise, gyroscope=TriadSpread(bias=1e-3))
    names = [state.name for state in plain.states]
    assert names.count("gyroscope bias x") == 1
    assert "gyroscope bias x, 50 s" in names
    markov = plain.states[names.index("gyroscope bias x, 50 s")]
    assert markov.decay == pytest.approx(0.02)
    assert markov.drive == pytest.approx(2.0 * 4e-10 / 50.0)
    with pytest.raises(UsageError, match="three axes"):
        sensor_states(FORCE, RATE, accelerometer_noise=[noise] * 2, gyroscope_noise=[noise] * 3)


def test_tracks_elsewhere_in_time_are_refused(cases: list[Case]) -> None:
    case = cases[0]
    with pytest.raises(RecordingError, match="do not overlap in time"):
        run_filter(case.samples, case.track.shifted(1e6), case.start, case.setup)
    covariance = case.track.position_covariance_n.copy()
    covariance[5, 0, 1] = covariance[5, 1, 0] = 2.0 * covariance[5, 0, 0]
    with pytest.raises(RecordingError, match="not positive definite"):
        run_filter(
            case.samples, replace(case.track, position_covariance_n=covariance), case.start, case.setup
        )
    with pytest.raises(UsageError, match="no state"):
        case.run().sensor("colour")
    with pytest.raises(UsageError, match="kept no covariances"):
        smooth(case.run())
