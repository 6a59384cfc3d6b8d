"""The doctor's findings on recordings whose faults were put there on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.recording import Recording, find_saturated_channels, inspect_recording
from tumble.recording.rest import find_quiet_stretches, fit_sphere, one_a_direction


def recording_of(tumbled, **changes) -> Recording:
    whole = Recording(
        tumbled.time, tumbled.specific_force.copy(), tumbled.angular_rate.copy(), "m/s^2", "rad/s", 100.0
    )
    return replace(whole, **changes)


def test_rests_and_poses_are_counted(tumbled) -> None:
    """Twelve holds of 2 s and eleven turns of 1.5 s: 24 of 40.5 s at rest."""
    found = inspect_recording(recording_of(tumbled))
    assert found.quiet_stretches == 12
    assert 9 <= found.poses <= 12  # turns of 40 degrees and more may lead back near an earlier pose
    assert found.rest_share == pytest.approx(24 / 40.5, abs=0.15)  # blocks of 0.25 s at 23 ends
    assert found.motion_share == pytest.approx(16.5 / 40.5, abs=0.15)
    assert found.rest_share + found.motion_share <= 1.0
    assert all(abs(n - 9.80665) < 0.02 for n in found.rest_norms)
    assert found.axis_contradiction is None
    assert found.warnings == ()


def test_noise_floors_are_those_put_in(tumbled) -> None:
    found = inspect_recording(recording_of(tumbled))
    # The 5th percentile of the scatter of 25 samples lies at 0.76 sigma.
    assert found.noise_floor["ax"] == pytest.approx(0.02, rel=0.4)
    assert found.noise_floor["gz"] == pytest.approx(0.001, rel=0.4)


@pytest.mark.parametrize("limit", [1.0, 0.5])
def test_a_saturated_gyro_is_found(tumbled, limit) -> None:
    rate = tumbled.angular_rate.clip(-limit, limit)
    found = inspect_recording(recording_of(tumbled, angular_rate=rate))
    assert {s.value for s in found.saturations} <= {limit, -limit}
    assert {s.channel for s in found.saturations} == {"gx", "gy", "gz"}
    assert any("saturated" in w for w in found.warnings)


def test_a_saturated_accelerometer_is_said_to_show_too_little_gravity(tumbled) -> None:
    said = find_saturated_channels(
        recording_of(tumbled, specific_force=tumbled.specific_force.clip(-7.0, 7.0))
    )
    assert said
    assert all(one.startswith("a") and "shows too little gravity" in one for one in said)


def test_a_quantised_recording_at_rest_is_not_taken_as_saturated() -> None:
    rng = np.random.default_rng(4)
    force = np.round((np.array([0.3, 0.1, 9.8]) + 0.01 * rng.normal(size=(5000, 3))) / 0.01) * 0.01
    rate = np.round(0.002 * rng.normal(size=(5000, 3)) / 0.001) * 0.001
    recording = Recording(np.arange(5000) / 100, force, rate, "m/s^2", "rad/s", 100.0)
    assert inspect_recording(recording).saturations == ()


def test_a_stuck_channel_is_named(tumbled) -> None:
    rate = tumbled.angular_rate.copy()
    rate[:, 1] = 0.25
    found = inspect_recording(recording_of(tumbled, angular_rate=rate))
    assert found.stuck == ("gy",)
    assert any("gy never change" in w for w in found.warnings)


def test_gaps_are_measured(tumbled) -> None:
    parts = (
        np.delete(part, np.s_[300:350], axis=0)
        for part in (tumbled.time, tumbled.specific_force, tumbled.angular_rate)
    )
    recording = Recording(*parts, "m/s^2", "rad/s", 100.0, gaps=(300,))
    (gap,) = inspect_recording(recording).gaps
    assert (gap.index, gap.samples) == (300, 50)
    assert gap.time == pytest.approx(2.99)
    assert gap.duration == pytest.approx(0.51)


def test_swapped_gyro_axes_are_warned_of(tumbled) -> None:
    found = inspect_recording(recording_of(tumbled, angular_rate=tumbled.angular_rate[:, [1, 0, 2]].copy()))
    assert found.axis_contradiction is not None
    assert found.axis_contradiction in found.warnings


def test_one_pose_is_good_for_no_calibration() -> None:
    rng = np.random.default_rng(4)
    force = np.array([0.3, 0.1, 9.8]) + 0.01 * rng.normal(size=(70_000, 3))
    rate = 0.002 * rng.normal(size=(70_000, 3))
    recording = Recording(np.arange(70_000) / 100, force, rate, "m/s^2", "rad/s", 100.0)
    found = inspect_recording(recording)
    assert found.poses == 1
    assert found.rest_share > 0.9
    assert [s.partition(":")[0] for s in found.good_for] == ["Noise analysis"]


def test_the_temperature_s_range_is_told(tumbled) -> None:
    found = inspect_recording(recording_of(tumbled, temperature=np.linspace(20.0, 45.0, len(tumbled.time))))
    assert found.temperature_range == (20.0, 45.0)
    assert any("Temperature dependence: 20 to 45" in s for s in found.good_for)


def test_a_slow_steady_turn_is_no_rest() -> None:
    """Five degrees a second: the gyro scatters as at rest, but gravity moves 0.2 m/s² a block."""
    rng = np.random.default_rng(4)
    time = np.arange(3000) / 100
    angle = np.radians(5.0) * time
    force = 9.8 * np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    signals = np.column_stack([force, np.tile([0.0, np.radians(5.0), 0.0], (3000, 1))])
    signals += np.array([0.02] * 3 + [0.001] * 3) * rng.normal(size=signals.shape)
    quiet = find_quiet_stretches(signals, 100.0)
    assert len(quiet.at_least(100)) == 0


def test_a_sphere_through_five_points_and_more_has_their_centre_and_radius() -> None:
    rng = np.random.default_rng(6)
    points = rng.normal(size=(8, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    sphere = fit_sphere(4000.0 * points + [33100.0, 33300.0, 32360.0])
    assert sphere is not None
    assert sphere[0] == pytest.approx([33100.0, 33300.0, 32360.0], rel=1e-9)  # exact data: rounding only
    assert sphere[1] == pytest.approx(4000.0, rel=1e-9)
    assert fit_sphere(4000.0 * points[:3]) is None
    flat = points.copy()
    flat[:, 2] = 0.0
    assert fit_sphere(flat) is None


def test_directions_closer_than_fifteen_degrees_are_one_pose() -> None:
    angles = np.radians([0.0, 10.0, 20.0, 90.0, 95.0])
    directions = 9.8 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    assert len(one_a_direction(directions)) == 3  # 0, 20 and 90 degrees
