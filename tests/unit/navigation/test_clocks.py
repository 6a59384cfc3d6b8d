"""The clocks of an IMU and of satellite positions: found where they are apart, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.navigation.drives import POOR, measured, seen

from tumble.errors import RecordingError
from tumble.navigation import GnssTrack, InertialSamples, estimate_time_offset, prepare_drive
from tumble.navigation.drive import refuse_other_motion
from tumble.navigation.time_alignment import slowest_course
from tumble.simulation import simulate_drive
from tumble.simulation.field_campaign import cart_trajectory


def drive_of(seed: int, duration: float = 160.0) -> tuple[InertialSamples, GnssTrack]:
    """A unit whose gyros are off by 0.1 rad/s, as uncalibrated ones are, and 2 Hz fixes of 2 cm on the same clock."""
    rng = np.random.default_rng(seed)
    course = simulate_drive(rng, duration + 1.0)
    samples = measured(course, np.arange(int(duration * 50.0)) / 50.0, rng, biases=POOR, rate_noise=1e-3)
    return samples, seen(course, np.arange(0.5, duration - 0.5, 0.5), rng)


@pytest.fixture(scope="module")
def drives() -> dict[int, tuple[InertialSamples, GnssTrack]]:
    return {seed: drive_of(seed) for seed in (12, 13)}


@pytest.mark.parametrize(("seed", "offset"), [(12, -0.3), (13, 0.0), (12, 0.11), (13, 18.0)])
def test_the_offset_of_an_uncalibrated_unit_is_within_what_is_stated(
    drives: dict[int, tuple[InertialSamples, GnssTrack]], seed: int, offset: float
) -> None:
    samples, track = drives[seed]
    found = prepare_drive(samples, track.shifted(-offset)).clock
    assert found.offset == pytest.approx(offset, abs=3.0 * found.sigma)
    assert found.sigma < 0.05


def test_parts_that_overlap_as_stamped_are_compared_there(
    drives: dict[int, tuple[InertialSamples, GnssTrack]],
) -> None:
    samples, track = drives[12]
    late = track.rows(track.time > 100.0)
    found = estimate_time_offset(samples.between(0.0, 140.0), late)
    assert found.offset == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("seed", [12, 13])
def test_parts_and_drives_that_have_nothing_in_common_are_refused_with_both_spans(
    drives: dict[int, tuple[InertialSamples, GnssTrack]], seed: int
) -> None:
    samples, track = drives[seed]
    with pytest.raises(
        RecordingError, match=r"from 0\.0 to 70\.0 s and the fixes from 90\.5 to .* 20 s apart"
    ):
        estimate_time_offset(samples.between(0.0, 70.0), track.rows(track.time > 90.0))
    with pytest.raises(RecordingError, match="same motion"):
        estimate_time_offset(samples, drives[25 - seed][1].shifted(1000.0))


def test_in_little_motion_nothing_is_said_of_axes(
    drives: dict[int, tuple[InertialSamples, GnssTrack]],
) -> None:
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


def test_gyros_that_turn_otherwise_than_the_course_are_refused(
    drives: dict[int, tuple[InertialSamples, GnssTrack]],
) -> None:
    samples, track = drives[13]
    rate = samples.angular_rate_ib_b
    assert refuse_other_motion(samples, track) > 0.95
    for wrong, words in (
        (-rate, r"correlate at -"),
        (rate[:, [2, 1, 0]], "correlate at"),
        (np.degrees(rate), r"differ by a factor of 0\.0"),
        (np.radians(rate), r"differ by a factor of 5"),
    ):
        with pytest.raises(RecordingError, match=f"one motion.*{words}.*tumble inspect"):
            refuse_other_motion(replace(samples, angular_rate_ib_b=np.ascontiguousarray(wrong)), track)


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


def test_a_course_takes_the_speed_that_its_uncertainty_asks_for() -> None:
    _, track = drive_of(12, 60.0)
    assert slowest_course(track) == 0.4
    poor = replace(track, velocity_covariance_n=track.velocity_covariance_n * 100.0)
    assert slowest_course(poor) == 1.5
    fair = replace(track, velocity_covariance_n=track.velocity_covariance_n * 9.0)
    assert slowest_course(fair) == pytest.approx(8.0 * 0.09)
