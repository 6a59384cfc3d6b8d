"""What the search says of recordings that can be judged by eye, of other rests, and of holds that are given."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.unit.given import signals

import tumble
from second_simulator import GRADES, PROCEDURES
from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import named_protocol
from tumble.recording import Recording, find_gaps
from tumble.segmentation import find_timeline, read_intervals
from tumble.segmentation.creep import find_other_rests, in_other_poses_too
from tumble.sensor import ImuModel, Triad
from tumble.simulation import simulate_protocol

RATE = 100.0
GRAVITY = 9.81


# Directions of gravity in the unit, in order: any two neighbours are a quarter turn apart.
POSES = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, -1], [-1, 0, 0], [0, -1, 0]], dtype=float)


def recorded(force, rate, start=0.0, hz=RATE):
    return Recording(start + np.arange(len(force)) / hz, force, rate, "m/s^2", "rad/s", hz)


def tumbled(holds=3.0, turns=1.0, noise=0.002, seed=1, poses=6):
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
    force_b += 10 * noise * rng.standard_normal(force_b.shape)
    return recorded(force_b, rate_b + noise * rng.standard_normal(rate_b.shape) + [0.01, -0.02, 0.005]), edges


def assert_finds(recording, edges, tolerance=0.2):
    holds = find_timeline(recording).holds
    assert len(holds) == len(edges)
    for hold, (start, stop) in zip(holds, edges, strict=True):
        # 0.2 s is what docs/segmentation.md promises
        assert abs(recording.time[hold.start] - start) <= tolerance
        assert abs(recording.time[hold.stop - 1] - stop) <= tolerance


def test_six_poses_are_six_holds_and_five_turns():
    recording, edges = tumbled()
    timeline = find_timeline(recording)
    assert_finds(recording, edges)
    assert [(t.before, t.after, t.usable) for t in timeline.turns] == [(k, k + 1, True) for k in range(5)]
    assert all(
        t.start == timeline.holds[t.before].stop and t.stop == timeline.holds[t.after].start
        for t in timeline.turns
    )
    # the median over some 400 blocks of five samples: 10 % bounds its spread and its bias
    np.testing.assert_allclose(timeline.noise_floor.angular_rate, 0.002, rtol=0.15)
    np.testing.assert_allclose(timeline.noise_floor.specific_force, 0.02, rtol=0.15)
    # One triad alone is enough, and samples may be read-only and in Fortran's order.
    for missing in ("angular_rate", "specific_force"):
        assert_finds(replace(recording, **{missing: None}), edges)
    fortran = [np.asfortranarray(signal) for signal in signals(recording)]
    for signal in fortran:
        signal.flags.writeable = False
    assert_finds(recorded(*fortran), edges)
    cut = find_timeline(recording.between(round(3.4 * RATE), round(19.5 * RATE)))
    assert len(cut.holds) == len(edges) - 2
    assert cut.rejections[0].reason == "motion, before the first hold"
    assert cut.rejections[-1].reason == "motion, after the last hold"


def test_counts_with_an_offset_give_the_same_timeline_as_si():
    recording, _ = tumbled()
    force, rate = signals(recording)
    counts = replace(
        recorded(force * 415.0 + 33000.0, rate * 4770.0 + 32500.0),
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


def test_a_knock_is_left_out_of_the_hold_that_goes_on_after_it():
    recording, edges = tumbled()
    force, rate = signals(recording)
    first = round(5.5 * RATE)
    rate[first : first + 10] += 0.8 * np.sin(2 * np.pi * np.arange(10) / 10)[:, None]
    force[first : first + 4, 0] += [6.0, -6.0, 4.0, -4.0]
    assert_finds(recording, edges)
    hold = find_timeline(recording).holds[1]
    assert any(a <= first and first + 4 <= b for a, b in hold.excluded)
    assert sum(b - a for a, b in hold.excluded) < 0.6 * RATE


def test_a_change_by_a_coarse_step_is_no_knock():
    """Steps of five times the noise: of a hold's blocks most show one number all along, some the next for a sample."""
    recording, edges = tumbled()
    force, rate = signals(recording)
    still = rate - [0.01, -0.02, 0.005]

    def stepped(rate):
        return recorded(np.round(force / 0.1) * 0.1, np.round(rate / 0.01) * 0.01)

    assert_finds(stepped(still), edges)
    assert not any(hold.excluded for hold in find_timeline(stepped(still)).holds)
    first = round(5.5 * RATE)
    still[first : first + 10] += 0.8 * np.sin(2 * np.pi * np.arange(10) / 10)[:, None]
    (knocked,) = [hold for hold in find_timeline(stepped(still)).holds if hold.excluded]
    assert any(a <= first and first + 8 <= b for a, b in knocked.excluded)


def test_a_rest_too_short_for_a_hold_is_named_with_its_length():
    recording, _ = tumbled()
    # the pose in the middle lasts 0.6 s only
    keep = np.ones(len(recording), dtype=bool)
    keep[round(8.5 * RATE) : round(10.9 * RATE)] = False
    timeline = find_timeline(recorded(*(signal[keep] for signal in signals(recording))))
    assert len(timeline.holds) == 5
    assert any(r.reason.startswith("at rest for only 0.") for r in timeline.rejections)


def test_a_pose_that_creeps_is_no_hold_and_says_by_how_much():
    recording, _ = tumbled(holds=4.0)
    force, _ = signals(recording)
    # the third pose, 10 to 14 s, sinks by 4 degrees at a constant rate beneath the gyro's notice
    creeping = slice(round(10 * RATE), round(14 * RATE))
    angle = np.radians(np.linspace(0.0, 4.0, 400))
    force[creeping] += GRAVITY * np.sin(angle)[:, None] * POSES[0]
    timeline = find_timeline(recording)
    assert len(timeline.holds) == 5
    assert any(r.reason.startswith(("creeps by 3.", "creeps by 4.")) for r in timeline.rejections)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("11 13\n12 14\n", "line 2: the interval starts at 12 s"),
        ("11 13\n14 x\n", "line 2: '14 x' is not two numbers"),
        ("11 13\nstart stop\n", "line 2: 'start stop' is not two numbers"),
        ("11 13 15\n", "line 1: '11 13 15' is not two numbers"),
        ("13 11\n", "line 1: the interval ends at 11 s, not after 13 s"),
        ("11 nan\n", "line 1: '11 nan' is not two numbers"),
        ("# nothing\n", "holds no intervals"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / "holds.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SegmentationError, match=message):
        read_intervals(path)
    with pytest.raises(SegmentationError, match="There is no list of intervals"):
        read_intervals(tmp_path / "none.txt")


NORTH = Site.from_latitude(np.radians(52.0))
GYRO = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.3], [-0.25, 0.15, 1.05]])
FACES = np.vstack([np.eye(3), -np.eye(3)])


def by_hand():
    model = ImuModel(Triad(np.eye(3), np.full(3, 0.2)), Triad(GYRO, np.array([0.03, -0.02, 0.01])))
    rng = np.random.default_rng(2)
    recording, _ = simulate_protocol(named_protocol("hand-held"), 50.0, rng, site=NORTH, model=model)
    return noisy(recording, rng, 5e-3, 1e-3)


def noisy(recording, rng, *sigmas):
    force, rate = (
        one + rng.normal(0.0, sigma, one.shape) for one, sigma in zip(signals(recording), sigmas, strict=True)
    )
    return replace(recording, specific_force=force, angular_rate=rate)


def jumped(recording, jump, share):
    after = np.arange(len(recording))[:, None] >= share * len(recording)
    return replace(recording, angular_rate=signals(recording)[1] + after * np.radians(jump))


@pytest.mark.slow
def test_right_recordings_have_no_other_rests():
    """By another hand's simulator: 24 of the 400 recordings whose rate the module states."""
    for k in range(24):
        grade = list(GRADES.values())[k % len(GRADES)]
        made = PROCEDURES["by-hand"](grade, np.random.default_rng(900000 + k), None, poses=12, rate=50.0)
        recording = tumble.read_recording(pl.DataFrame(made.columns()))
        assert find_other_rests(recording, find_timeline(recording)) is None


@pytest.mark.parametrize(("jump", "share"), [([0.0, 0.0, 3.0], 0.55), ([2.0, -1.5, 4.0], 0.75)])
def test_rests_after_a_jump_of_the_biases_are_found_where_they_are(jump, share):
    whole = by_hand()
    holds = find_timeline(whole).holds
    assert find_other_rests(whole, find_timeline(whole)) is None
    recording = jumped(whole, jump, share)
    timeline = find_timeline(recording)
    other = find_other_rests(recording, timeline)
    lost = [hold for hold in holds if hold.stop > share * len(recording)]
    assert len(timeline.holds) + len(other.spans) == pytest.approx(len(holds), abs=1)
    assert len(other.spans) == pytest.approx(len(lost), abs=1)
    for start, stop in other.spans:
        assert any(start < hold.stop and hold.start < stop for hold in lost)
    assert other.rate == pytest.approx(np.linalg.norm(np.radians(jump)), rel=0.2)


def test_holds_that_only_look_as_if_they_turned_are_kept_where_other_poses_show_the_same():
    """0.4 °/s over four seconds are 1.6°, as of a pose that creeps about the vertical; but all poses creep alike."""
    whole = by_hand()
    assert len(find_timeline(jumped(whole, [0.3, 0.0, -0.3], 0.7)).holds) == len(find_timeline(whole).holds)


def test_a_g_sensitivity_of_half_a_degree_per_second_is_no_turning():
    """A consumer gyro shows another rate with another face up: every hold is found all the same."""
    sensitivity = np.radians(0.05) * np.array([[1.0, -0.4, 0.2], [0.3, -0.8, 0.5], [-0.6, 0.2, 0.9]])
    model = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.full(3, 0.01)), sensitivity)
    protocol = replace(named_protocol("turntable-9"), site=NORTH)
    rng = np.random.default_rng(11)
    recording, truth = simulate_protocol(protocol, 50.0, rng, site=NORTH, model=model)
    assert len(find_timeline(noisy(recording, rng, 2e-3, 5e-4)).holds) == len(truth.hold_edges)


def without(recording, *seconds, every=None):
    """The recording without what lies between, and without every so manieth row, with the gaps that its file has."""
    keep = np.ones(len(recording), dtype=bool)
    keep[:: every or len(keep) + 1] = every is None
    for start, stop in seconds:
        keep[round(start * RATE) : round(stop * RATE)] = False
    force, rate = (signal[keep] for signal in signals(recording))
    time = recording.time[keep]
    return replace(recording, time=time, specific_force=force, angular_rate=rate, gaps=find_gaps(time, RATE))


def test_a_turn_with_missing_samples_or_a_saturated_gyro_is_not_usable_and_single_samples_do_not_cost_it():
    recording, _ = tumbled(poses=4)
    assert all(turn.usable for turn in find_timeline(without(recording, every=41)).turns)
    lossy = without(recording, (7.5, 7.6), every=41)
    assert [turn.usable for turn in find_timeline(lossy).turns] == [True, False, True]
    _, rate = signals(recording)
    np.clip(rate, -1.5, 1.5, out=rate)
    turns = find_timeline(without(recording, (7.5, 7.6))).turns
    assert [turn.usable for turn in turns[:2]] == [False, False]
    assert "saturated" in turns[0].reason
    assert turns[1].reason == "0.1 s of samples are missing in it"


def test_a_gap_in_which_a_turn_can_hide_ends_the_hold():
    recording, _ = tumbled(holds=6.0, poses=3)
    holds = find_timeline(without(recording, (2.5, 3.5))).holds
    assert len(holds) == 4
    assert holds[0].stop <= round(2.5 * RATE) <= holds[1].start


def test_one_rest_is_one_hold_and_two_that_both_reach_for_what_lies_between_share_it():
    """A car brakes: the specific force leans over in 0.4 s while the gyro sees nothing."""
    rng = np.random.default_rng(3)
    noise, rate = 0.02 * rng.standard_normal((3000, 3)), 0.001 * rng.standard_normal((3000, 3))
    (whole,) = find_timeline(
        recorded(noise + np.array([0.1, -0.2, 9.8]), rate + np.array([0.01, 0.0, -0.02]))
    ).holds
    assert (whole.start, whole.stop) == (0, 3000)
    lean = 0.15 * np.clip((np.arange(3000) / RATE - 14.0) / 0.4, 0.0, 1.0)
    leaning = GRAVITY * np.column_stack([lean, 0.0 * lean, np.ones_like(lean)])
    before, after = find_timeline(recorded(leaning + noise, rate)).holds
    # smoothing and the differences over it blur the 0.4 s by 0.3 s to either side
    assert 13.6 * RATE < before.stop <= after.start < 14.8 * RATE


def test_a_recording_without_rest_without_triads_or_of_few_samples_is_refused():
    time = np.arange(2000) / RATE
    rate = 2.0 * np.sin(2.0 * np.pi * 0.7 * time + np.array([[0.0], [2.0], [4.0]])).T
    rate += 0.001 * np.random.default_rng(5).standard_normal((2000, 3))
    restless = recorded(9.8 * np.array([np.sin(time), np.cos(time), 0 * time]).T, rate)
    recording, _ = tumbled()
    for refused, said in (
        (restless, "No hold was found"),
        (replace(recording, specific_force=None, angular_rate=None), "neither accelerometer nor gyro"),
        (recording.between(0, 30), "30 samples"),
    ):
        with pytest.raises(SegmentationError, match=said):
            find_timeline(refused)


@pytest.mark.parametrize(
    "text",
    [
        "11 13\n15 18.5\n",
        "start,stop\n11,13\n15,18.5",
        "# holds\n\n11;13;\n 15\t18.5 \n",
        "11, 13\n15, 18.5\n",
    ],
)
def test_intervals_of_any_usual_layout_replace_the_search(tmp_path, text):
    (tmp_path / "holds.txt").write_text(text, encoding="utf-8")
    timeline = find_timeline(given(), intervals=read_intervals(tmp_path / "holds.txt"))
    # stamps are 10.00, 10.02, ...: the first at or after 11 s is number 50
    assert [(h.start, h.stop) for h in timeline.holds] == [(50, 150), (250, 425)]
    assert [(t.start, t.stop) for t in timeline.turns] == [(150, 250)]


def given():
    rng = np.random.default_rng(8)
    force, rate = 0.01 * rng.standard_normal((1000, 3)), 0.001 * rng.standard_normal((1000, 3))
    return recorded(force + np.array([0.0, 0.0, 9.8]), rate, start=10.0, hz=50.0)


@pytest.mark.parametrize(
    ("intervals", "message"),
    [
        ([(11.0, 13.0), (12.5, 14.0)], "Interval 2 .* overlaps"),
        ([(5.0, 13.0)], "beyond the recording, which goes from 10 to 29.98 s"),
        ([(11.0, 40.0)], "beyond the recording"),
        ([(13.0, 12.0)], "stops before it starts"),
        ([(11.0, 11.01)], "1 samples"),
        ([], "No intervals were given"),
    ],
)
def test_wrong_intervals_are_refused(intervals, message):
    with pytest.raises(SegmentationError, match=message):
        find_timeline(given(), intervals=intervals)


def test_one_rate_in_two_poses_is_told_and_spins_and_the_same_pose_again_are_not():
    rates = np.array([[0.05, 0.0, 0.01], [0.051, 0.001, 0.01], [0.05, 0.0, 0.01], [0.0, 0.05, 0.0]])
    up = np.array([[9.8, 0.0, 0.1], [0.2, 9.7, 0.0], [-9.8, 0.0, 0.0], [0.0, 9.8, 0.0]])
    assert in_other_poses_too(rates, up).tolist() == [True, True, True, False]
    assert in_other_poses_too(rates[[0, 2, 3]], up[[0, 2, 3]]).tolist() == [False, False, False]
    # Six faces both ways at one speed and at another, by gyros whose axes lean and differ by tens of per cent.
    spins = np.vstack([speed * FACES @ GYRO.T for speed in (0.05, -0.05, 0.4, -0.4)])
    assert not in_other_poses_too(spins, np.tile(9.8 * FACES, (4, 1))).any()
