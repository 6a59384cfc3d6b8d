"""Holds: hands that tremble, poses that sway within one, poses that are believed, and holds that are left out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from tests.unit.adjusted import adjusted

from tumble.calibration.equations.adjustment import balance_recording
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.evidence import RestlessHold
from tumble.calibration.outcome.estimate import restless_remarks
from tumble.calibration.poses import LEAST_SIGMA, believed_poses
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.segmentation import MatchedHold, Matching, NoiseFloor, observe_holds


@pytest.mark.parametrize("samples", [1, 5])
def test_a_hand_is_no_noise_of_the_sensors(play, model, samples):
    """A tremor of ten times a gyro's noise, which a filter may cut at 9 Hz, a sway of five times what a mean shows."""
    still = play()
    force, rate, time = still.recording.specific_force, still.recording.angular_rate, still.recording.time
    for rest in [slice(hold.start, hold.stop) for hold in still.timeline.holds]:
        rate[rest] = uniform_filter1d(rate[rest], samples, axis=0)
    trembling = rate + 0.02 * np.sin(2.0 * np.pi * 9.0 * time[:, None] + [0.0, 1.0, 2.0])
    swaying = force + np.sin(2.0 * np.pi * 0.4 * time)[:, None] * np.cross(force, [[3e-4, 0.0, 4e-4]])
    recording = replace(still.recording, specific_force=swaying, angular_rate=trembling)
    timeline = replace(still.timeline, noise_floor=NoiseFloor(np.full(3, 0.02), np.full(3, 0.008), 1.0, ""))
    made = gather(recording, timeline, observe_holds(recording, timeline), imu_unknowns(unknowns_of(model)))
    assert np.all(np.abs(np.log(made.rate_random_walk / (2e-3**2 / 100.0))) < 0.4)
    assert np.all(np.abs(np.log(made.force_covariance[:, range(3), range(3)] / (0.02**2 / 300.0))) < 0.5)


def nodding(base: HoldsAndTurns, hold: int, angle: float, axis: int) -> HoldsAndTurns:
    """A hold that turns away about an axis of the gyros and comes back, farthest in its middle."""
    first, last = int(base.head[hold, 0]), int(base.tail[hold, 1])
    seconds = base.time[last - 1] - base.time[first]
    rate = base.raw_rate.copy()
    rate[first:last, axis] += angle * np.pi / seconds * np.cos(np.linspace(0.0, np.pi, last - first))
    return replace(base, raw_rate=rate)


def test_gyros_that_see_holds_swing_are_believed_where_accelerometers_scatter_too_much_to_tell(play, started):
    """Twelve nods of 0.1 mrad; parts of noisy accelerometers know their tilt to 0.3 mrad, gyros to 5 µrad."""
    base = play(noise=(3e-2, 1e-5), holds=12).data()
    for hold in range(12):
        base = nodding(base, hold, 1e-4 * (-1.0) ** hold, hold % 3)
    task = started(base)
    balanced = balance_recording(task)
    # a nod is a half wave of one axis of three there and back: its two steps are some 60 µrad about that axis
    assert 1e-5 < np.sqrt(task.noise["sway"]) < 1e-4
    swing = balanced.tests["swing"]
    assert swing.square.sum() < 2.0 * swing.redundancy.sum()


LEAN = 5e-3


@pytest.fixture(scope="module")
def leaning(play, site, model):
    """The fifth of twelve holds leans about x by 5 mrad in its middle, and comes back."""
    tumbled = play(noise=(1e-3, 1e-4), holds=12)
    recording, hold = tumbled.recording, slice(2000, 2300)
    share = np.linspace(0.0, np.pi, 300)
    rate, force = recording.angular_rate.copy(), recording.specific_force.copy()
    rate[hold] += np.outer(LEAN * np.pi / 3.0 * np.cos(share), model.gyroscope.matrix[:, 0])
    true, lean = model.accelerometer.correct(force[hold]), LEAN * np.sin(share)
    force[hold] += (
        np.column_stack([0.0 * lean, lean * true[:, 2], -lean * true[:, 1]]) @ model.accelerometer.matrix.T
    )
    # a clock that does not start at zero: times are told from the first sample on
    recording = replace(recording, specific_force=force, angular_rate=rate, time=recording.time + 1000.0)
    return adjusted(recording, tumbled.timeline, site, optional_terms=False)


def test_the_hold_is_named_with_its_time_and_its_sway(leaning):
    (one,) = leaning.holds.restless
    assert one.hold == 4
    # samples at the middle of their intervals, 100 Hz, the first at 5 ms
    assert (one.start, one.stop) == pytest.approx((20.0, 22.99), abs=0.011)
    # to the middle and back: of six numbers two are between 2/pi of 5 mrad and the whole of it; a variance of
    # one's own is sought to a tenth of it or two
    assert LEAN * 2.0 / np.pi / np.sqrt(3.0) < one.sway < 1.15 * LEAN / np.sqrt(3.0)
    assert one.others < 2e-4
    assert not leaning.left_out
    (said,) = [remark for remark in leaning.remarks if "rest alike" in remark]
    assert "hold 5 (20.0 to 23.0 s)" in said
    assert "record it again" in said


def test_of_many_the_worst_are_named_in_their_order():
    holds = [RestlessHold(k, 10.0 * k, 10.0 * k + 5.0, 1e-3 * (k + 1), 2e-4) for k in range(8)]
    (said,) = restless_remarks(holds)
    assert "the worst of 8" in said
    assert [word for word in range(1, 9) if f"hold {word} (" in said] == [4, 5, 6, 7, 8]
    assert "40 times as much as the others" in said


def test_what_was_left_out_before_the_terms_were_tried_is_told(play, site):
    """A hold is pushed by 0.2 m/s², a turn's gyro is off by 3 °/s; a g-sensitivity that is there is kept besides."""
    tumbled = play(noise=(1e-3, 1e-4), holds=26)
    force, rate = tumbled.recording.specific_force.copy(), tumbled.recording.angular_rate.copy()
    force[2000:2300, 0] += 0.2
    rate[3300:3500, 0] += 0.05
    recording = replace(tumbled.recording, specific_force=force, angular_rate=rate)
    estimate = adjusted(recording, tumbled.timeline, site)
    assert [test.name for test in estimate.terms if test.kept] == ["g_sensitivity"]
    assert {(left.kind, left.index) for left in estimate.left_out} == {("hold", 4), ("turn", 6)}


def test_a_unit_that_stays_on_its_table_is_placed_once_and_loose_poses_tell_nothing():
    up, sigma = np.array([0.0, 0.0, 1.0]), 0.001
    pose = Pose(up, None, sigma)
    steps = (
        HoldStep(5.0, pose),
        SpinStep(5.0, 1.0),
        HoldStep(5.0, pose),
        TurnStep(2.0),
        HoldStep(5.0, Pose(np.array([1.0, 0.0, 0.0]), 0.5, 0.0)),
        TurnStep(2.0),
        HoldStep(5.0, Pose(np.array([0.0, 1.0, 0.0]), None, 0.2)),
        TurnStep(2.0),
        HoldStep(5.0),
    )
    holds = tuple(MatchedHold(step, hold) for hold, step in enumerate((0, 2, 4, 6, 8)))
    poses = believed_poses(Protocol("mine", "joint", steps), Matching(holds, (), (), ()))
    assert poses.hold.tolist() == [0, 2]
    assert poses.has_heading.tolist() == [False, True]
    np.testing.assert_allclose(poses.sigma, [sigma, LEAST_SIGMA])
    np.testing.assert_allclose(poses.C_nf[1].T @ [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], atol=1e-12)
