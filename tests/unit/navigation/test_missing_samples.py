"""A drive of which the IMU's samples are missing for a while."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.navigation.drives import measured, seen

from tumble.navigation import (
    Drive,
    FilterRun,
    InertialSamples,
    TimeAlignment,
    Trajectory,
    TriadSpread,
    align_in_motion,
    find_rest,
    outages,
    plan_filter,
    prepare_drive,
    smooth,
)
from tumble.navigation.gnss import make_track
from tumble.noise.terms import NoiseModel
from tumble.simulation import simulate_drive

SETUP = plan_filter(
    NoiseModel(random_walk=0.003, rate_random_walk=1e-5),
    NoiseModel(random_walk=3e-4, rate_random_walk=1e-6),
    accelerometer=TriadSpread(bias=0.05),
    gyroscope=TriadSpread(bias=5e-3),
)
RATE, DURATION = 50.0, 200.0


@pytest.fixture(scope="module")
def whole() -> tuple[Drive, Trajectory]:
    """A drive with 2 Hz fixes of 2 cm, of biases (0.05, -0.03, 0.02) m/s² and (3, -1, 2) mrad/s, and its truth."""
    rng = np.random.default_rng(4)
    course = simulate_drive(rng, DURATION + 1.0)
    samples = measured(course, np.arange(int(DURATION * RATE)) / RATE, rng)
    at = np.arange(0.5, DURATION - 0.5, 0.5)
    track = seen(course, at, rng)
    fixes = course.states(at)
    truth = Trajectory(
        at, fixes.latitude, fixes.longitude, fixes.height, fixes.velocity_n, fixes.quaternion_nb
    )
    alignment = align_in_motion(samples, track, 0.5, rest=5.0)
    start = replace(truth.state(0), velocity_n=np.zeros(3), C_nb=alignment.C_nb)
    return Drive(samples, track, start, alignment, TimeAlignment(0.0, 0.0, 1.0, 0.0, 0.0)), truth


def without(drive: Drive, begin: float, length: float) -> Drive:
    samples = drive.samples
    keep = (samples.time <= begin) | (samples.time >= begin + length)
    cut = InertialSamples(samples.time[keep], samples.specific_force_b[keep], samples.angular_rate_ib_b[keep])
    return replace(drive, samples=cut)


def errors_of(run: FilterRun, truth: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = np.searchsorted(truth.time, run.time - 1e-6)
    return run.trajectory.errors_against(truth.rows(rows))


@pytest.mark.parametrize("length", [0.5, 5.0, 20.0, 60.0])
def test_a_filter_goes_on_after_missing_samples_with_what_it_knows_of_the_sensors(
    whole: tuple[Drive, Trajectory], length: float
) -> None:
    drive, truth = whole
    cut = without(drive, 90.0, length)
    assert cut.samples.missing() == [(90.0, 90.0 + length)]
    run = cut.run(SETUP, interval=1.0, keep_covariances=True)
    position, _, attitude = errors_of(run, truth)
    late = run.time > 90.0 + length + 30.0
    # as without missing samples: fixes of 2 cm, and a heading to a degree half a minute after the new start
    assert np.sqrt(np.mean(position[late] ** 2)) < 0.03
    assert np.abs(attitude[late]).max() < 0.03
    assert len(run.refused) == 0
    # consistent: chi-square of three, of which some 150 scatter by 0.07; four of that
    assert np.nanmean(run.distances[:, 0]) / 3.0 == pytest.approx(1.0, abs=0.3)
    for name, value in (("gyroscope bias z", 2e-3), ("gyroscope bias x", 3e-3)):
        found, sigma = run.sensor(name)
        assert found == pytest.approx(value, abs=4.0 * sigma)
    smoothed = smooth(run)
    assert np.abs(errors_of(replace(run, trajectory=smoothed.trajectory), truth)[2]).max() < 0.03


def test_no_event_lies_in_missing_samples_and_sensors_walk_on_there(whole: tuple[Drive, Trajectory]) -> None:
    drive, _ = whole
    cut = without(drive, 90.0, 60.0)
    run = cut.run(SETUP, interval=1.0, instants=np.arange(20.5, 190.0), keep_covariances=True)
    assert not np.any((run.time > 90.0) & (run.time < 150.0))
    assert np.all(np.diff(run.time) > 0.0)
    assert np.array_equal(
        run.fix_events, np.searchsorted(run.time, drive.track.thinned(1.0)[0].time[run.fixes])
    )
    before = int(np.flatnonzero(run.time <= 90.0)[-1])
    at = 9 + [state.name for state in SETUP.states].index("gyroscope bias z")
    grown = run.predicted[before + 1][at, at] - run.covariances[before][at, at]
    # K² over the time between the two events
    assert grown == pytest.approx(1e-12 * (run.time[before + 1] - run.time[before]), rel=1e-6)


def test_outages_stay_clear_of_missing_samples_and_of_the_new_start(whole: tuple[Drive, Trajectory]) -> None:
    drive, _ = whole
    cut = without(drive, 90.0, 5.0)
    for repeated in (False, True):
        for one in outages(cut, SETUP, (2.0, 10.0), settle=30.0, every=2.0, repeated=repeated):
            assert len(one.starts) > 5
            assert not np.any((one.starts < 125.0) & (one.starts + one.duration > 90.0))


def test_a_drive_starts_from_a_rest_that_motion_follows_without_missing_samples() -> None:
    at = np.arange(0.0, 100.0, 0.5)
    speed = np.where((at < 10.0) | ((at > 40.0) & (at < 60.0)), 0.0, 5.0)
    zero = np.zeros(len(at))
    track = make_track(
        at,
        (zero, zero, zero),
        np.full((len(at), 3), 0.02),
        velocity_n=speed[:, None] * [1.0, 0.0, 0.0],
        velocity_sigmas=np.full((len(at), 3), 0.01),
    )
    time = np.arange(0.0, 100.0, 0.1)
    still = InertialSamples(time, np.zeros((len(time), 3)), np.zeros((len(time), 3)))
    assert find_rest(still, track) == (0.0, 9.5)
    keep = (time < 15.0) | (time > 20.0)
    assert find_rest(InertialSamples(time[keep], *(np.zeros((keep.sum(), 3)),) * 2), track) == (40.5, 59.5)


def test_clocks_are_compared_on_both_sides_of_missing_samples(whole: tuple[Drive, Trajectory]) -> None:
    drive, _ = whole
    found = prepare_drive(without(drive, 90.0, 20.0).samples, drive.track.shifted(7.0))
    assert found.clock.offset == pytest.approx(-7.0, abs=4.0 * found.clock.sigma)
    assert found.clock.correlation > 0.95
