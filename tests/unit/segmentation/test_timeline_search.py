"""What the search says of recordings that can be judged by eye."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.errors import SegmentationError
from tumble.recording.recording import Recording
from tumble.recording.stamps import find_gaps
from tumble.segmentation import find_timeline

RATE = 100.0
GRAVITY = 9.81
# Directions of gravity in the unit, in order: any two neighbours are a quarter turn apart.
POSES = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, -1], [-1, 0, 0], [0, -1, 0]], dtype=float)


def tumbled(
    holds: float = 3.0, turns: float = 1.0, noise: float = 0.002, seed: int = 1, poses: int = 6
) -> tuple[Recording, list[tuple[float, float]]]:
    """Poses of `holds` s with quarter turns of `turns` s at a smoothly rising and falling rate."""
    rng = np.random.default_rng(seed)
    force, rate, edges, now = [], [], [], 0.0
    for k in range(poses):
        here, there = POSES[k % 6], POSES[(k + 1) % 6]
        still = round(holds * RATE)
        force.append(np.tile(GRAVITY * here, (still, 1)))
        rate.append(np.zeros((still, 3)))
        edges.append((now, now + holds))
        now += holds
        if k == poses - 1:
            break
        moving = round(turns * RATE)
        phase = (np.arange(moving) + 0.5) / moving
        angle = 0.5 * np.pi * (phase - np.sin(2 * np.pi * phase) / (2 * np.pi))
        speed = 0.5 * np.pi * (1 - np.cos(2 * np.pi * phase)) / turns
        force.append(GRAVITY * (np.cos(angle)[:, None] * here + np.sin(angle)[:, None] * there))
        # the specific force turns by minus the body's rate: f' = -w x f
        rate.append(-speed[:, None] * np.cross(here, there))
        now += turns
    force_b, rate_b = np.concatenate(force), np.concatenate(rate)
    return (
        Recording(
            time=np.arange(len(force_b)) / RATE,
            specific_force=force_b + 10 * noise * rng.standard_normal(force_b.shape),
            angular_rate=rate_b + noise * rng.standard_normal(rate_b.shape) + [0.01, -0.02, 0.005],
            specific_force_unit="m/s^2",
            angular_rate_unit="rad/s",
            rate=RATE,
        ),
        edges,
    )


def assert_finds(recording: Recording, edges: list[tuple[float, float]], tolerance: float = 0.2) -> None:
    holds = find_timeline(recording).holds
    assert len(holds) == len(edges)
    for hold, (start, stop) in zip(holds, edges, strict=True):
        # 0.2 s is what docs/segmentation.md promises
        assert abs(recording.time[hold.start] - start) <= tolerance
        assert abs(recording.time[hold.stop - 1] - stop) <= tolerance


def test_six_poses_are_six_holds_and_five_turns() -> None:
    recording, edges = tumbled()
    timeline = find_timeline(recording)
    assert_finds(recording, edges)
    assert [(t.before, t.after, t.usable) for t in timeline.turns] == [(k, k + 1, True) for k in range(5)]
    assert all(
        t.start == timeline.holds[t.before].stop and t.stop == timeline.holds[t.after].start
        for t in timeline.turns
    )


def test_the_noise_floor_is_that_of_the_samples() -> None:
    floor = find_timeline(tumbled(noise=0.003)[0]).noise_floor
    # the median over some 400 blocks of five samples: 10 % bounds its spread and its bias
    np.testing.assert_allclose(floor.angular_rate, 0.003, rtol=0.15)
    np.testing.assert_allclose(floor.specific_force, 0.03, rtol=0.15)


def test_counts_with_an_offset_give_the_same_timeline_as_si() -> None:
    recording, _ = tumbled()
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    counts = replace(
        recording,
        specific_force=recording.specific_force * 415.0 + 33000.0,
        angular_rate=recording.angular_rate * 4770.0 + 32500.0,
        specific_force_unit="counts",
        angular_rate_unit="counts",
    )
    ours, theirs = find_timeline(recording), find_timeline(counts)
    assert len(ours.holds) == len(theirs.holds)
    # the scale is found within some per cent, and with it the limit: a block of 0.05 s either way
    assert all(
        abs(a.start - b.start) <= 5 and abs(a.stop - b.stop) <= 5
        for a, b in zip(ours.holds, theirs.holds, strict=True)
    )


def test_a_knock_is_left_out_of_the_hold_that_goes_on_after_it() -> None:
    recording, edges = tumbled()
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    first = round(5.5 * RATE)
    recording.angular_rate[first : first + 10] += 0.8 * np.sin(2 * np.pi * np.arange(10) / 10)[:, None]
    recording.specific_force[first : first + 4, 0] += [6.0, -6.0, 4.0, -4.0]
    assert_finds(recording, edges)
    hold = find_timeline(recording).holds[1]
    assert any(a <= first and first + 4 <= b for a, b in hold.excluded)
    assert sum(b - a for a, b in hold.excluded) < 0.6 * RATE


def test_a_change_by_a_coarse_step_is_no_knock() -> None:
    """Steps of five times the noise: of a hold's blocks most show one number all along, some the next for a sample."""
    recording, edges = tumbled()
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    still = recording.angular_rate - [0.01, -0.02, 0.005]

    def stepped(rate: np.ndarray) -> Recording:
        return replace(
            recording,
            specific_force=np.round(np.asarray(recording.specific_force) / 0.1) * 0.1,
            angular_rate=np.round(rate / 0.01) * 0.01,
        )

    assert_finds(stepped(still), edges)
    assert not any(hold.excluded for hold in find_timeline(stepped(still)).holds)
    first = round(5.5 * RATE)
    still[first : first + 10] += 0.8 * np.sin(2 * np.pi * np.arange(10) / 10)[:, None]
    (knocked,) = [hold for hold in find_timeline(stepped(still)).holds if hold.excluded]
    assert any(a <= first and first + 8 <= b for a, b in knocked.excluded)


def test_a_rest_too_short_for_a_hold_is_named_with_its_length() -> None:
    recording, _ = tumbled()
    # the pose in the middle lasts 0.6 s only
    keep = np.ones(len(recording), dtype=bool)
    keep[round(8.5 * RATE) : round(10.9 * RATE)] = False
    shorter = rows(recording, keep)
    shorter = replace(shorter, time=np.arange(len(shorter)) / RATE)
    timeline = find_timeline(shorter)
    assert len(timeline.holds) == 5
    assert any(r.reason.startswith("at rest for only 0.") for r in timeline.rejections)


def test_a_pose_that_creeps_is_no_hold_and_says_by_how_much() -> None:
    recording, _ = tumbled(holds=4.0)
    assert recording.specific_force is not None
    # the third pose, 10 to 14 s, sinks by 4 degrees at a constant rate beneath the gyro's notice
    creeping = slice(round(10 * RATE), round(14 * RATE))
    angle = np.radians(np.linspace(0.0, 4.0, 400))
    recording.specific_force[creeping] += GRAVITY * np.sin(angle)[:, None] * POSES[0]
    timeline = find_timeline(recording)
    assert len(timeline.holds) == 5
    assert any(r.reason.startswith(("creeps by 3.", "creeps by 4.")) for r in timeline.rejections)


def test_a_turn_with_missing_samples_or_a_saturated_gyro_is_not_usable() -> None:
    recording, _ = tumbled(poses=4)
    assert recording.angular_rate is not None
    np.clip(recording.angular_rate, -1.5, 1.5, out=recording.angular_rate)
    keep = np.ones(len(recording), dtype=bool)
    keep[round(7.5 * RATE) : round(7.6 * RATE)] = False
    lossy = rows(recording, keep)
    gap = round(7.5 * RATE)
    turns = find_timeline(replace(lossy, gaps=(gap,))).turns
    assert not turns[0].usable
    assert "saturated" in turns[0].reason
    assert not turns[1].usable
    assert turns[1].reason == "0.1 s of samples are missing in it"


def test_single_samples_that_are_missing_in_a_turn_do_not_cost_it() -> None:
    """Straight lines across them are better than noise; across a tenth of a second they are not."""
    recording, _ = tumbled(poses=4)
    keep = np.ones(len(recording), dtype=bool)
    keep[::41] = False
    assert all(turn.usable for turn in find_timeline(with_gaps(recording, keep)).turns)
    keep[round(7.5 * RATE) : round(7.6 * RATE)] = False
    turns = find_timeline(with_gaps(recording, keep)).turns
    assert [turn.usable for turn in turns] == [True, False, True]


def rows(recording: Recording, keep: np.ndarray) -> Recording:
    """Only the rows of `keep`."""
    force, rate = (np.asarray(part)[keep] for part in (recording.specific_force, recording.angular_rate))
    return replace(recording, time=recording.time[keep], specific_force=force, angular_rate=rate)


def with_gaps(recording: Recording, keep: np.ndarray) -> Recording:
    """Only the rows of `keep`, with the gaps that a file of them has."""
    lossy = rows(recording, keep)
    return replace(lossy, gaps=find_gaps(lossy.time, RATE))


def test_a_gap_in_which_a_turn_can_hide_ends_the_hold() -> None:
    recording, _ = tumbled(holds=6.0, poses=3)
    keep = np.ones(len(recording), dtype=bool)
    keep[round(2.5 * RATE) : round(3.5 * RATE)] = False
    lossy = replace(rows(recording, keep), gaps=(round(2.5 * RATE),))
    holds = find_timeline(lossy).holds
    assert len(holds) == 4
    assert holds[0].stop <= round(2.5 * RATE) <= holds[1].start


def test_one_long_rest_is_one_hold() -> None:
    rng = np.random.default_rng(3)
    recording = Recording(
        time=np.arange(3000) / RATE,
        specific_force=np.array([0.1, -0.2, 9.8]) + 0.02 * rng.standard_normal((3000, 3)),
        angular_rate=np.array([0.01, 0.0, -0.02]) + 0.002 * rng.standard_normal((3000, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=RATE,
    )
    holds = find_timeline(recording).holds
    assert [(h.start, h.stop) for h in holds] == [(0, 3000)]


@pytest.mark.parametrize("missing", ["angular_rate", "specific_force"])
def test_one_triad_alone_is_enough(missing: str) -> None:
    recording, edges = tumbled()
    assert_finds(replace(recording, **{missing: None}), edges)


def test_a_recording_that_begins_and_ends_in_motion_has_its_first_hold_after_it() -> None:
    recording, edges = tumbled()
    cut = recording.between(round(3.4 * RATE), round(19.5 * RATE))
    timeline = find_timeline(cut)
    assert len(timeline.holds) == len(edges) - 2
    assert timeline.rejections[0].reason == "motion, before the first hold"
    assert timeline.rejections[-1].reason == "motion, after the last hold"


def test_the_samples_are_left_as_they_are_and_may_be_read_only() -> None:
    recording, edges = tumbled()
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    fortran = replace(
        recording,
        specific_force=np.asfortranarray(recording.specific_force),
        angular_rate=np.asfortranarray(recording.angular_rate),
    )
    for signal in (fortran.specific_force, fortran.angular_rate):
        assert signal is not None
        signal.flags.writeable = False
    assert_finds(fortran, edges)


def test_a_recording_without_rest_is_refused_in_a_sentence() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(2000) / RATE
    rate = 2.0 * np.sin(2.0 * np.pi * 0.7 * time + np.array([[0.0], [2.0], [4.0]])).T
    recording = Recording(
        time=time,
        specific_force=9.8 * np.array([np.sin(time), np.cos(time), 0 * time]).T,
        angular_rate=rate + 0.001 * rng.standard_normal((2000, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=RATE,
    )
    with pytest.raises(SegmentationError, match="No hold was found"):
        find_timeline(recording)


def test_a_recording_without_triads_or_of_few_samples_is_refused() -> None:
    recording, _ = tumbled()
    with pytest.raises(SegmentationError, match="neither accelerometer nor gyro"):
        find_timeline(replace(recording, specific_force=None, angular_rate=None))
    with pytest.raises(SegmentationError, match="30 samples"):
        find_timeline(recording.between(0, 30))


def test_two_rests_that_both_reach_for_what_lies_between_share_it() -> None:
    """A car brakes: the specific force leans over in 0.4 s while the gyro sees nothing."""
    time = np.arange(3000) / RATE
    lean = 0.15 * np.clip((time - 14.0) / 0.4, 0.0, 1.0)
    rng = np.random.default_rng(3)
    recording = Recording(
        time=time,
        specific_force=GRAVITY * np.column_stack([lean, 0.0 * lean, np.ones_like(lean)])
        + 0.02 * rng.standard_normal((3000, 3)),
        angular_rate=0.001 * rng.standard_normal((3000, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=RATE,
    )
    before, after = find_timeline(recording).holds
    # smoothing and the differences over it blur the 0.4 s by 0.3 s to either side
    assert 13.6 * RATE < before.stop <= after.start < 14.8 * RATE
