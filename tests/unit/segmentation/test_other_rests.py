"""Rests at another level of the gyros are told from spins about the vertical, which look as still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES
from tumble.earth import Site
from tumble.protocol import named_protocol
from tumble.recording import Recording
from tumble.segmentation import find_timeline
from tumble.segmentation.creep import find_other_rests, in_other_poses_too
from tumble.sensor import ImuModel, Triad
from tumble.simulation.protocols import simulate_protocol

SITE = Site.from_latitude(np.radians(52.0))
GYRO = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.3], [-0.25, 0.15, 1.05]])
FACES = np.vstack([np.eye(3), -np.eye(3)])


def tumbled() -> Recording:
    model = ImuModel(Triad(np.eye(3), np.full(3, 0.2)), Triad(GYRO, np.array([0.03, -0.02, 0.01])))
    rng = np.random.default_rng(2)
    recording, _ = simulate_protocol(named_protocol("hand-held"), 50.0, rng, site=SITE, model=model)
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    shape = recording.angular_rate.shape
    return replace(
        recording,
        specific_force=recording.specific_force + rng.normal(0.0, 5e-3, shape),
        angular_rate=recording.angular_rate + rng.normal(0.0, 1e-3, shape),
    )


def jumped(recording: Recording, jump: list[float], share: float) -> Recording:
    assert recording.angular_rate is not None
    after = np.arange(len(recording))[:, None] >= share * len(recording)
    return replace(recording, angular_rate=recording.angular_rate + after * np.radians(jump))


def test_a_tumbled_unit_has_no_other_rests() -> None:
    recording = tumbled()
    assert find_other_rests(recording, find_timeline(recording)) is None


@pytest.mark.slow
def test_right_recordings_have_no_other_rests() -> None:
    """By another hand's simulator: 24 of the 400 recordings whose rate the module states."""
    for k in range(24):
        grade = list(GRADES.values())[k % len(GRADES)]
        made = PROCEDURES["by-hand"](grade, np.random.default_rng(900000 + k), None, poses=12, rate=50.0)
        recording = tumble.read_recording(pl.DataFrame(made.columns()))
        assert find_other_rests(recording, find_timeline(recording)) is None


@pytest.mark.parametrize(("jump", "share"), [([0.0, 0.0, 3.0], 0.55), ([2.0, -1.5, 4.0], 0.75)])
def test_rests_after_a_jump_of_the_biases_are_found_where_they_are(jump: list[float], share: float) -> None:
    whole = tumbled()
    holds = find_timeline(whole).holds
    recording = jumped(whole, jump, share)
    timeline = find_timeline(recording)
    other = find_other_rests(recording, timeline)
    assert other is not None
    lost = [hold for hold in holds if hold.stop > share * len(recording)]
    assert len(timeline.holds) + len(other.spans) == pytest.approx(len(holds), abs=1)
    assert len(other.spans) == pytest.approx(len(lost), abs=1)
    for start, stop in other.spans:
        assert any(start < hold.stop and hold.start < stop for hold in lost)
    assert other.rate == pytest.approx(np.linalg.norm(np.radians(jump)), rel=0.2)


def test_holds_that_only_look_as_if_they_turned_are_kept_where_other_poses_show_the_same() -> None:
    """0.4 °/s over four seconds are 1.6°, as of a pose that creeps about the vertical; but all poses creep alike."""
    whole = tumbled()
    assert len(find_timeline(jumped(whole, [0.3, 0.0, -0.3], 0.7)).holds) == len(find_timeline(whole).holds)


def test_spins_about_the_vertical_show_no_rate_in_other_poses() -> None:
    """Six faces both ways at one speed and at another, by gyros whose axes lean and differ by tens of per cent."""
    rates = np.vstack([speed * FACES @ GYRO.T for speed in (0.05, -0.05, 0.4, -0.4)])
    assert not in_other_poses_too(rates, np.tile(9.8 * FACES, (4, 1))).any()


def test_one_rate_in_two_poses_is_told_and_the_same_pose_again_is_not() -> None:
    rates = np.array([[0.05, 0.0, 0.01], [0.051, 0.001, 0.01], [0.05, 0.0, 0.01], [0.0, 0.05, 0.0]])
    up = np.array([[9.8, 0.0, 0.1], [0.2, 9.7, 0.0], [-9.8, 0.0, 0.0], [0.0, 9.8, 0.0]])
    assert in_other_poses_too(rates, up).tolist() == [True, True, True, False]
    assert in_other_poses_too(rates[[0, 2, 3]], up[[0, 2, 3]]).tolist() == [False, False, False]
