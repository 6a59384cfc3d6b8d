"""Alignment, clocks, axes and outages on drives of which the truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.navigation.drives import measured, seen

from tumble.errors import ObservabilityError, RecordingError
from tumble.navigation import (
    Drive,
    GnssTrack,
    InertialSamples,
    NavigationState,
    Trajectory,
    TriadSpread,
    align_coarse,
    align_in_motion,
    find_rest,
    navigate,
    outages,
    plan_filter,
    prepare_drive,
)
from tumble.noise.terms import NoiseModel
from tumble.simulation import SplineTrajectory, simulate_drive

HERE = (0.83, 0.15, 400.0)
MOUNT = Rotation.from_euler("ZYX", [20.0, -6.0, 175.0], degrees=True)


@dataclass
class Field:
    samples: InertialSamples
    track: GnssTrack
    truth: Trajectory


@pytest.fixture(scope="module")
def field() -> Field:
    """A drive of a unit mounted askew, with 4 Hz fixes of 2 cm on a clock that is 1000.4 s ahead."""
    rng = np.random.default_rng(4)
    drive = simulate_drive(rng, 241.0, origin=HERE)
    time = np.arange(240 * 50) / 50.0
    samples, states = measured(drive, time, rng, mount=MOUNT), drive.states(time)
    attitude = (Rotation.from_quat(states.quaternion_nb) * MOUNT).as_quat()
    truth = Trajectory(time, states.latitude, states.longitude, states.height, states.velocity_n, attitude)
    return Field(samples, seen(drive, np.arange(0.25, 240.0, 0.25), rng).shifted(1000.4), truth)


@pytest.fixture(scope="module")
def prepared(field: Field) -> Drive:
    return prepare_drive(field.samples, field.track, setup=SETUP)


SETUP = plan_filter(
    NoiseModel(random_walk=0.003, rate_random_walk=1e-5),
    NoiseModel(random_walk=3e-4, rate_random_walk=1e-6),
    accelerometer=TriadSpread(bias=0.05),
    gyroscope=TriadSpread(bias=5e-3),
)


@pytest.mark.parametrize("beyond", [False, True])
def test_the_correlation_at_every_lag_is_that_of_each_lag_by_itself(beyond: bool) -> None:
    """Times that are uneven, some without weight, and lags that leave the grid on either side."""
    from tumble.navigation import time_alignment as one
    from tumble.navigation.time_alignment import correlate

    rng = np.random.default_rng(8)
    grid = 5.0 + 0.05 * np.arange(600, dtype=np.float64)
    rate = np.convolve(rng.standard_normal(600), np.full(40, 0.025), "same") + 0.3
    times = np.sort(rng.uniform(0.0, 20.0, 90))
    course = np.interp(times + 9.0, grid, rate) + 0.01 * rng.standard_normal(90)
    weights = (rng.uniform(size=90) > 0.2).astype(np.float64)
    lags = np.arange(-28.0, 52.0, one.STEP) if beyond else one._lags(grid, times)
    each = [correlate(grid, rate, times + lag, course, weights) for lag in lags]
    found = one._correlation_curve(grid, rate, times, course, weights, lags)
    # sums of a hundred numbers of order one, by Fourier transforms; near-perfect cosines lose half the digits
    np.testing.assert_allclose(found, each, atol=1e-7)
    assert np.isnan(each).any() == beyond


def test_a_drive_is_prepared_from_files_alone(field: Field, prepared: Drive) -> None:
    drive = prepared
    assert "GNSS times -1000." in str(drive.clock)
    assert drive.clock.offset == pytest.approx(-1000.4, abs=4.0 * drive.clock.sigma + 0.002)
    at = round(drive.start.time * 50.0)
    error = (
        Rotation.from_matrix(drive.start.C_nb) * Rotation.from_quat(field.truth.quaternion_nb[at]).inv()
    ).as_rotvec()
    # level: 0.05 m/s² of bias over g, and how the body sways at rest; heading: the statement's four sigmas
    assert np.abs(error[:2]).max() < 0.02
    assert abs(error[2]) < 4.0 * drive.alignment.sigmas[2]
    instants = np.arange(120.5, 235.0)
    run = drive.run(SETUP, interval=1.0, instants=instants)
    asked = np.isin(run.time, instants)
    truth = field.truth.rows(np.round(instants * 50.0).astype(int))
    position, _, attitude = run.trajectory.rows(asked).errors_against(truth)
    # half a second after fixes of 2 cm, at 15 m/s with clocks that are some milliseconds apart
    assert np.sqrt(np.mean(position**2)) < 0.05
    assert np.sqrt(np.mean(attitude**2)) < 0.01


def test_a_rest_and_a_heading_from_motion_are_found(field: Field) -> None:
    track = field.track.shifted(-1000.4)
    first, last = find_rest(field.samples, track)
    assert first < 1.0
    assert 6.0 < last < 12.0
    found = align_in_motion(field.samples, track, 1.0, rest=5.0)
    error = (
        Rotation.from_matrix(found.C_nb) * Rotation.from_quat(field.truth.quaternion_nb[50]).inv()
    ).as_rotvec()
    assert abs(error[2]) < 4.0 * found.sigmas[2] < 0.5
    with pytest.raises(RecordingError, match="does not rest"):
        align_in_motion(
            InertialSamples(
                field.samples.time, field.samples.specific_force_b / 9.8, field.samples.angular_rate_ib_b
            ),
            track,
            1.0,
            2.0,
        )


def test_a_good_unit_at_rest_finds_north_and_a_poor_one_says_that_it_cannot() -> None:
    rng = np.random.default_rng(2)
    body = SplineTrajectory.at_rest(HERE, np.array([0.2, -0.3, 2.1]), 120.0)
    time = np.arange(0.0, 120.0, 0.1)
    states = body.states(time)
    truth = Trajectory(
        time, states.latitude, states.longitude, states.height, states.velocity_n, states.quaternion_nb
    ).state(0)
    errors = []
    for _ in range(200):
        force = states.specific_force_b + rng.normal(0.0, 1e-3, 3)
        rate = states.angular_rate_ib_b + rng.normal(0.0, 1e-7, 3)
        found = align_coarse(
            InertialSamples(time, force, rate),
            HERE[0],
            accelerometer_sigma=1e-3,
            gyroscope_sigma=1e-7,
        )
        # phi of C_estimate = exp(-phi) C
        errors.append(-Rotation.from_matrix(found.C_nb @ truth.C_nb.T).as_rotvec())
    covariance = np.cov(np.array(errors).T)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4.0 * found.sigmas / np.sqrt(200.0))
    # 200 draws tell a variance to 10 %: four of that; the normal covariance to its scale
    assert np.diag(covariance) == pytest.approx(np.diag(found.covariance), rel=0.4)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs((covariance - found.covariance) / scale).max() < 0.45
    assert "gyrocompassing" in str(found)
    samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
    with pytest.raises(ObservabilityError, match="cannot determine the heading"):
        align_coarse(samples, HERE[0], accelerometer_sigma=0.01, gyroscope_sigma=1e-4)


def test_outages_grow_with_their_length(prepared: Drive) -> None:
    found = outages(prepared, SETUP, (2.0, 10.0, 30.0), settle=90.0, every=2.0)
    sizes = [float(np.sqrt(np.mean(errors.horizontal**2))) for errors in found]
    assert sizes[0] < sizes[1] < sizes[2]
    assert sizes[0] < 0.1
    gaps = outages(prepared, SETUP, (10.0,), settle=90.0, repeated=True)[0]
    assert 10 <= len(gaps.starts) <= 15
    with pytest.raises(RecordingError, match="too short"):
        outages(prepared, SETUP, (600.0,))


def test_an_outage_is_the_free_run_of_the_filter_s_state(prepared: Drive) -> None:
    """The sliding outage equals a filter that loses its fixes: two ways through the code."""
    one = outages(prepared, SETUP, (10.0,), settle=150.0, every=1000.0)[0]
    begin = float(one.starts[0])
    lost = prepared.run(SETUP, interval=1.0, without=((begin, begin + 9.6),))
    row = int(np.argmin(np.abs(lost.time[lost.fix_events] - begin - 10.0)))
    # the filter applies its decay-free states alike; the difference is in how samples are cut
    assert lost.innovations[row, :3] == pytest.approx(one.errors_n[0], abs=1e-4)


def test_free_navigation_of_a_drive_starts_between_samples(field: Field) -> None:
    start = field.truth.state(100)
    late = NavigationState(
        start.time + 0.007, start.latitude, start.longitude, start.height, start.velocity_n, start.C_nb
    )
    assert navigate(field.samples, late).time[0] == late.time
