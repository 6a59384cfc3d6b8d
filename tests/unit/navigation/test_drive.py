"""Alignment, clocks, axes and outages on drives of which the truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.errors import ObservabilityError, RecordingError
from tumble.navigation import (
    GnssTrack,
    InertialSamples,
    NavigationState,
    Trajectory,
    TriadSpread,
    align_coarse,
    align_in_motion,
    estimate_time_offset,
    find_rest,
    navigate,
    outages,
    plan_filter,
    prepare_drive,
)
from tumble.navigation.gnss import make_track
from tumble.noise.terms import NoiseModel
from tumble.simulation import SplineTrajectory, simulate_drive

HERE = (0.83, 0.15, 400.0)
MOUNT = Rotation.from_euler("ZYX", [20.0, -6.0, 175.0], degrees=True)


@dataclass
class Field:
    samples: InertialSamples
    track: GnssTrack
    truth: Trajectory


def drive_of(seed: int, *, ahead: float = 0.0, duration: float = 240.0) -> Field:
    """A drive of a unit mounted askew, with 4 Hz fixes of 2 cm on a clock that is 1000.4 s ahead."""
    rng = np.random.default_rng(seed)
    drive = simulate_drive(rng, duration + 1.0, origin=HERE)
    time = np.arange(int(duration * 50.0)) / 50.0
    states = drive.states(time)
    force = (
        MOUNT.inv().apply(states.specific_force_b)
        + rng.normal(0.0, 0.02, (len(time), 3))
        + [0.05, -0.03, 0.02]
    )
    rate = (
        MOUNT.inv().apply(states.angular_rate_ib_b)
        + rng.normal(0.0, 2e-3, (len(time), 3))
        + [3e-3, -1e-3, 2e-3]
    )
    attitude = (Rotation.from_quat(states.quaternion_nb) * MOUNT).as_quat()
    truth = Trajectory(time, states.latitude, states.longitude, states.height, states.velocity_n, attitude)
    at = np.arange(0.25, duration, 0.25)
    fixes = drive.states(at)
    noise = rng.normal(0.0, 0.02, (len(at), 3))
    track = make_track(
        at + 1000.4,
        (
            fixes.latitude + noise[:, 0] / 6.4e6,
            fixes.longitude + noise[:, 1] / (6.4e6 * np.cos(fixes.latitude)),
            fixes.height - noise[:, 2],
        ),
        np.full((len(at), 3), 0.02),
        velocity_n=fixes.velocity_n + rng.normal(0.0, 0.03, (len(at), 3)),
        velocity_sigmas=np.full((len(at), 3), 0.03),
        quality=np.ones(len(at), dtype=int),
    )
    return Field(InertialSamples(time, force, rate), track, truth)


@pytest.fixture(scope="module")
def field() -> Field:
    return drive_of(4)


SETUP = plan_filter(
    NoiseModel(random_walk=0.003, rate_random_walk=1e-5),
    NoiseModel(random_walk=3e-4, rate_random_walk=1e-6),
    accelerometer=TriadSpread(bias=0.05),
    gyroscope=TriadSpread(bias=5e-3),
)


def test_the_clocks_are_brought_together_by_the_course(field: Field) -> None:
    found = estimate_time_offset(field.samples, field.track)
    assert found.offset == pytest.approx(-1000.4, abs=0.03)
    assert found.correlation > 0.95
    assert found.second_best < 0.7
    assert "GNSS times -1000." in str(found)


@pytest.mark.parametrize("beyond", [False, True])
def test_the_correlation_at_every_lag_is_that_of_each_lag_by_itself(beyond: bool) -> None:
    """Times that are uneven, some without weight, and lags that leave the grid on either side."""
    from tumble.navigation import time_alignment as one
    from tumble.navigation.course import correlate

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


def test_a_drive_is_prepared_from_files_alone(field: Field) -> None:
    drive = prepare_drive(field.samples, field.track, setup=SETUP)
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


def test_reversed_gyros_are_refused(field: Field) -> None:
    reversed_gyros = InertialSamples(
        field.samples.time, field.samples.specific_force_b, -field.samples.angular_rate_ib_b
    )
    with pytest.raises(RecordingError, match="one motion"):
        prepare_drive(reversed_gyros, field.track, offset=-1000.4)


def test_files_of_other_days_are_refused(field: Field) -> None:
    other = drive_of(77)
    with pytest.raises(RecordingError, match="same motion"):
        estimate_time_offset(field.samples, other.track)


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
            HERE[2],
            accelerometer_sigma=1e-3,
            gyroscope_sigma=1e-7,
        )
        # phi of C_estimate = exp(-phi) C
        errors.append(-Rotation.from_matrix(found.C_nb @ truth.C_nb.T).as_rotvec())
    covariance = np.cov(np.array(errors).T)
    # 200 draws tell a variance to 10 %: four of that; the normal covariance to its scale
    assert np.diag(covariance) == pytest.approx(np.diag(found.covariance), rel=0.4)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs((covariance - found.covariance) / scale).max() < 0.45
    assert "gyrocompassing" in str(found)
    samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
    with pytest.raises(ObservabilityError, match="cannot determine the heading"):
        align_coarse(samples, HERE[0], accelerometer_sigma=0.01, gyroscope_sigma=1e-4)
    given = align_coarse(
        samples, HERE[0], accelerometer_sigma=0.01, gyroscope_sigma=1e-4, heading=2.1, heading_sigma=0.01
    )
    assert given.roll_pitch_yaw == pytest.approx([0.2, -0.3, 2.1], abs=1e-4)


def test_outages_grow_with_their_length_and_say_how_well_they_are_known(field: Field) -> None:
    drive = prepare_drive(field.samples, field.track, offset=-1000.4)
    found = outages(drive, SETUP, (2.0, 10.0, 30.0), settle=90.0, every=2.0)
    sizes = [errors.horizontal_rms() for errors in found]
    assert sizes[0] < sizes[1] < sizes[2]
    assert sizes[0] < 0.1
    rng = np.random.default_rng(1)
    for errors in found[:2]:
        assert 0.0 < errors.uncertainty(rng) < errors.horizontal_rms()
    gaps = outages(drive, SETUP, (10.0,), settle=90.0, repeated=True)[0]
    assert 10 <= len(gaps.starts) <= 15
    with pytest.raises(RecordingError, match="too short"):
        outages(drive, SETUP, (600.0,))


def test_an_outage_is_the_free_run_of_the_filter_s_state(field: Field) -> None:
    """The sliding outage equals a filter that loses its fixes: two ways through the code."""
    drive = prepare_drive(field.samples, field.track, offset=-1000.4)
    one = outages(drive, SETUP, (10.0,), settle=150.0, every=1000.0)[0]
    begin = float(one.starts[0])
    lost = drive.run(SETUP, interval=1.0, without=((begin, begin + 9.6),))
    row = int(np.argmin(np.abs(lost.time[lost.fix_events] - begin - 10.0)))
    # the filter applies its decay-free states alike; the difference is in how samples are cut
    assert lost.innovations[row, :3] == pytest.approx(one.errors_n[0], abs=1e-4)


def test_free_navigation_of_a_drive_starts_between_samples(field: Field) -> None:
    start = field.truth.state(100)
    late = NavigationState(
        start.time + 0.007, start.latitude, start.longitude, start.height, start.velocity_n, start.C_nb
    )
    assert navigate(field.samples, late).time[0] == late.time
