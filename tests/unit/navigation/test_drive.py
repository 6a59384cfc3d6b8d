"""Alignment, clocks, axes, outages and missing samples, on simulated drives of which the truth is known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.errors import ObservabilityError, RecordingError
from tumble.navigation import (
    Drive,
    FilterRun,
    GnssTrack,
    InertialSamples,
    TimeAlignment,
    Trajectory,
    TriadSpread,
    align_coarse,
    find_rest,
    navigate,
    outages,
    plan_filter,
    prepare_drive,
    smooth,
)
from tumble.navigation.alignment import align_in_motion
from tumble.navigation.drive import refuse_other_motion
from tumble.navigation.gnss import make_track
from tumble.navigation.time_alignment import estimate_time_offset
from tumble.noise import NoiseModel
from tumble.simulation import SplineTrajectory, cart_trajectory, simulate_drive

BIASES = ([0.05, -0.03, 0.02], [3e-3, -1e-3, 2e-3])  # m/s², rad/s
POOR = ([0.15, -0.1, 0.1], [0.1, -0.05, 0.1])  # as of a unit that is not calibrated


def measured(course, time, rng, *, biases=BIASES, rate_noise=0.002, mount=None):
    """Samples with noise of 0.02 m/s² and `rate_noise`, of a unit that is mounted askew."""
    states = course.states(time)
    C_mb = (mount or Rotation.identity()).inv()
    shape = (len(time), 3)
    force = C_mb.apply(states.specific_force_b) + rng.normal(0.0, 0.02, shape) + biases[0]
    rate = C_mb.apply(states.angular_rate_ib_b) + rng.normal(0.0, rate_noise, shape) + biases[1]
    return InertialSamples(time, force, rate)


def seen(course, at, rng, velocity_sigma=0.03):
    """Fixes of 2 cm on the same clock."""
    fixes, shape = course.states(at), (len(at), 3)
    noise = rng.normal(0.0, 0.02, shape)
    latitude = fixes.latitude + noise[:, 0] / 6.4e6
    longitude = fixes.longitude + noise[:, 1] / (6.4e6 * np.cos(fixes.latitude))
    return make_track(
        at,
        (latitude, longitude, fixes.height - noise[:, 2]),
        np.full(shape, 0.02),
        velocity_n=fixes.velocity_n + rng.normal(0.0, velocity_sigma, shape),
        velocity_sigmas=np.full(shape, velocity_sigma),
        quality=np.ones(len(at), dtype=int),
    )


SETUP = plan_filter(
    NoiseModel(random_walk=0.003, rate_random_walk=1e-5),
    NoiseModel(random_walk=3e-4, rate_random_walk=1e-6),
    accelerometer=TriadSpread(bias=0.05),
    gyroscope=TriadSpread(bias=5e-3),
)
HERE = (0.83, 0.15, 400.0)
MOUNT = Rotation.from_euler("ZYX", [20.0, -6.0, 175.0], degrees=True)


@dataclass
class Field:
    samples: InertialSamples
    track: GnssTrack
    truth: Trajectory


def turned_by(start: np.ndarray, quaternion_nb: np.ndarray) -> np.ndarray:
    return (Rotation.from_matrix(start) * Rotation.from_quat(quaternion_nb).inv()).as_rotvec()


def truth_of(course: SplineTrajectory, time: np.ndarray, mount: Rotation | None = None) -> Trajectory:
    states = course.states(time)
    attitude = (Rotation.from_quat(states.quaternion_nb) * (mount or Rotation.identity())).as_quat()
    return Trajectory(time, states.latitude, states.longitude, states.height, states.velocity_n, attitude)


@pytest.fixture(scope="module")
def field() -> Field:
    """A drive of a unit mounted askew, with 4 Hz fixes of 2 cm on a clock that is 1000.4 s ahead."""
    rng = np.random.default_rng(4)
    drive = simulate_drive(rng, 241.0, origin=HERE)
    time = np.arange(240 * 50) / 50.0
    samples = measured(drive, time, rng, mount=MOUNT)
    track = seen(drive, np.arange(0.25, 240.0, 0.25), rng).shifted(1000.4)
    return Field(samples, track, truth_of(drive, time, MOUNT))


@pytest.fixture(scope="module")
def prepared(field: Field) -> Drive:
    return prepare_drive(field.samples, field.track, setup=SETUP)


def test_a_drive_is_prepared_from_files_alone(field: Field, prepared: Drive) -> None:
    drive = prepared
    assert "GNSS times -1000." in str(drive.clock)
    assert drive.clock.offset == pytest.approx(-1000.4, abs=4.0 * drive.clock.sigma + 0.002)
    at = round(drive.start.time * 50.0)
    error = turned_by(drive.start.C_nb, field.truth.quaternion_nb[at])
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
    assert abs(turned_by(found.C_nb, field.truth.quaternion_nb[50])[2]) < 4.0 * found.sigmas[2] < 0.5
    weak = replace(field.samples, specific_force_b=field.samples.specific_force_b / 9.8)
    with pytest.raises(RecordingError, match="does not rest"):
        align_in_motion(weak, track, 1.0, 2.0)


def test_a_good_unit_at_rest_finds_north_and_a_poor_one_says_that_it_cannot() -> None:
    rng = np.random.default_rng(2)
    body = SplineTrajectory.at_rest(HERE, np.array([0.2, -0.3, 2.1]), 120.0)
    time = np.arange(0.0, 120.0, 0.1)
    states, C_nb = body.states(time), truth_of(body, time).state(0).C_nb
    errors = []
    for _ in range(200):
        force = states.specific_force_b + rng.normal(0.0, 1e-3, 3)
        samples = InertialSamples(time, force, states.angular_rate_ib_b + rng.normal(0.0, 1e-7, 3))
        found = align_coarse(samples, HERE[0], accelerometer_sigma=1e-3, gyroscope_sigma=1e-7)
        # phi of C_estimate = exp(-phi) C
        errors.append(-Rotation.from_matrix(found.C_nb @ C_nb.T).as_rotvec())
    covariance = np.cov(np.array(errors).T)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4.0 * found.sigmas / np.sqrt(200.0))
    # 200 draws tell a variance to 10 %: four of that; the normal covariance to its scale
    assert np.diag(covariance) == pytest.approx(np.diag(found.covariance), rel=0.4)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs((covariance - found.covariance) / scale).max() < 0.45
    assert "gyrocompassing" in str(found)
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
    late = replace(start, time=start.time + 0.007)
    assert navigate(field.samples, late).time[0] == late.time


# The clocks of an IMU and of satellite positions: found where they are apart, or refused ---------------

Drives = dict[int, tuple[InertialSamples, GnssTrack]]


def drive_of(seed: int, duration: float = 160.0) -> tuple[InertialSamples, GnssTrack]:
    """A unit whose gyros are off by 0.1 rad/s, as uncalibrated ones are, and 2 Hz fixes of 2 cm on the same clock."""
    rng = np.random.default_rng(seed)
    course = simulate_drive(rng, duration + 1.0)
    samples = measured(course, np.arange(int(duration * 50.0)) / 50.0, rng, biases=POOR, rate_noise=1e-3)
    return samples, seen(course, np.arange(0.5, duration - 0.5, 0.5), rng)


@pytest.fixture(scope="module")
def drives() -> Drives:
    return {seed: drive_of(seed) for seed in (12, 13)}


@pytest.mark.parametrize(("seed", "offset"), [(12, -0.3), (13, 0.0), (12, 0.11), (13, 18.0)])
def test_the_offset_of_an_uncalibrated_unit_is_within_what_is_stated(drives, seed, offset):
    samples, track = drives[seed]
    found = prepare_drive(samples, track.shifted(-offset)).clock
    assert found.offset == pytest.approx(offset, abs=3.0 * found.sigma)
    assert found.sigma < 0.05


def test_parts_that_overlap_as_stamped_are_compared_there(drives: Drives) -> None:
    samples, track = drives[12]
    found = estimate_time_offset(samples.between(0.0, 140.0), track.rows(track.time > 100.0))
    assert found.offset == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("seed", [12, 13])
def test_parts_and_drives_that_have_nothing_in_common_are_refused_with_both_spans(drives, seed):
    samples, track = drives[seed]
    with pytest.raises(
        RecordingError, match=r"from 0\.0 to 70\.0 s and the fixes from 90\.5 to .* 20 s apart"
    ):
        estimate_time_offset(samples.between(0.0, 70.0), track.rows(track.time > 90.0))
    with pytest.raises(RecordingError, match="same motion"):
        estimate_time_offset(samples, drives[25 - seed][1].shifted(1000.0))


def test_in_little_motion_nothing_is_said_of_axes(drives):
    samples, track = drives[12]
    told = 0
    for begin in range(20, 130, 10):
        part, fixes = samples.between(begin, begin + 30.0), track.rows(abs(track.time - begin - 15.0) < 15.0)
        try:
            told += refuse_other_motion(part, fixes) > 0.8
        except RecordingError as error:
            if "too little" not in str(error):
                raise
    # most parts have enough turns
    assert told > 5


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda rate: -rate, r"correlate at -"),
        (lambda rate: rate[:, [2, 1, 0]], "correlate at"),
        (np.degrees, r"differ by a factor of 0\.0"),
        (np.radians, r"differ by a factor of 5"),
    ],
)
def test_gyros_that_turn_otherwise_than_the_course_are_refused(drives, wrong, words):
    samples, track = drives[13]
    assert refuse_other_motion(samples, track) > 0.95
    other = replace(samples, angular_rate_ib_b=np.ascontiguousarray(wrong(samples.angular_rate_ib_b)))
    with pytest.raises(RecordingError, match=f"one motion.*{words}.*tumble inspect"):
        refuse_other_motion(other, track)


@pytest.mark.parametrize("seed", [2, 4])
def test_eighty_seconds_of_a_walk_tell_the_clock(seed: int) -> None:
    """A cart at 1.2 m/s, 0.5 in its curve: fixes whose velocities are known to 0.05 m/s have a course there."""
    rng = np.random.default_rng(seed)
    cart = cart_trajectory(rng)
    begin = 50.0  # ten seconds of its rest
    samples = measured(cart, begin + np.arange(90 * 50) / 50.0, rng, biases=POOR, rate_noise=1e-3)
    track = seen(cart, np.arange(begin + 0.5, begin + 89.0, 0.2), rng, 0.05)
    found = prepare_drive(samples.shifted(-begin), track.shifted(500.0 - begin)).clock
    assert found.offset == pytest.approx(-500.0, abs=3.0 * found.sigma)
    assert found.sigma < 0.1


# Samples that are missing for a while ------------------------------------------------------------------

RATE, DURATION = 50.0, 200.0


@pytest.fixture(scope="module")
def whole() -> tuple[Drive, Trajectory]:
    """A drive with 2 Hz fixes of 2 cm, of biases (0.05, -0.03, 0.02) m/s² and (3, -1, 2) mrad/s, and its truth."""
    rng = np.random.default_rng(4)
    course = simulate_drive(rng, DURATION + 1.0)
    samples = measured(course, np.arange(int(DURATION * RATE)) / RATE, rng)
    at = np.arange(0.5, DURATION - 0.5, 0.5)
    track, truth = seen(course, at, rng), truth_of(course, at)
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
def test_a_filter_goes_on_after_missing_samples_with_what_it_knows_of_the_sensors(whole, length):
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
    at, time = np.arange(0.0, 100.0, 0.5), np.arange(0.0, 100.0, 0.1)
    moving = 5.0 * ~((at < 10.0) | ((at > 40.0) & (at < 60.0)))
    sigmas = np.full((len(at), 3), 0.02), np.full((len(at), 3), 0.01)
    velocity = moving[:, None] * [1.0, 0.0, 0.0]
    track = make_track(at, (0.0 * at,) * 3, sigmas[0], velocity_n=velocity, velocity_sigmas=sigmas[1])

    def still(time: np.ndarray) -> InertialSamples:
        return InertialSamples(time, np.zeros((len(time), 3)), np.zeros((len(time), 3)))

    assert find_rest(still(time), track) == (0.0, 9.5)
    assert find_rest(still(time[(time < 15.0) | (time > 20.0)]), track) == (40.5, 59.5)


def test_clocks_are_compared_on_both_sides_of_missing_samples(whole: tuple[Drive, Trajectory]) -> None:
    drive, _ = whole
    found = prepare_drive(without(drive, 90.0, 20.0).samples, drive.track.shifted(7.0))
    assert found.clock.offset == pytest.approx(-7.0, abs=4.0 * found.clock.sigma)
    assert found.clock.correlation > 0.95
