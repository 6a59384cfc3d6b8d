"""Units and axes are found from gravity and rests, said, and what gravity contradicts is refused."""

import itertools
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.unit.recording.by_hand import GRAVITY, said, tumble_by_hand

from second_simulator import GRADES, PROCEDURES
from tumble.errors import RecordingError
from tumble.recording import Recording, find_axis_contradiction, gravity_check, read_recording

DEGREE = np.pi / 180.0


def scaled(tumbled, force: float = 1.0, rate: float = 1.0) -> np.ndarray:
    return np.column_stack([tumbled.time, tumbled.specific_force / force, tumbled.angular_rate / rate])


@pytest.mark.parametrize(
    ("unit", "factor", "rate_unit", "rate_factor"),
    [
        ("g", GRAVITY, "deg/s", DEGREE),
        ("mg", GRAVITY / 1000, "mdeg/s", DEGREE / 1000),
        ("m/s^2", 1.0, "deg/s", DEGREE),
    ],
)
def test_units_of_both_triads_are_found(tumbled, csv, unit, factor, rate_unit, rate_factor) -> None:
    for header in ("t,ax,ay,az,gx,gy,gz", None):
        recording = read_recording(csv(scaled(tumbled, factor, rate_factor), header=header))
        assert (recording.specific_force_unit, recording.angular_rate_unit) == (unit, rate_unit)
        assert sum(r.kind == "assumed" for r in recording.remarks) >= 3
        assert "sign of gravity" in said(recording, "unchecked")


def test_offset_counts_are_found_as_counts(tumbled, csv) -> None:
    """As the classic Xsens recording: 415 counts per m/s² and 4770 per rad/s around 32768."""
    rows = scaled(tumbled, 1 / 415, 1 / 4770)
    rows[:, 1:] = np.round(rows[:, 1:] + [33100, 33300, 32360, 32768, 32466, 32485])
    recording = read_recording(csv(rows, header=None))
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("counts", "counts")
    scale = gravity_check.gyro_scale_from_gravity(recording)
    assert scale.determined
    assert scale.scale == pytest.approx(1 / 4770, rel=0.05)  # the check is good to a few per cent


@pytest.mark.parametrize("rate", [25.0, 2000.0])
def test_the_gyro_s_scale_is_found_at_low_and_high_rates(rate) -> None:
    made = tumble_by_hand(rate=rate, holds=14)
    scale = gravity_check.gyro_scale_from_gravity(
        Recording(made.time, made.specific_force, made.angular_rate / DEGREE, "m/s^2", "counts", rate)
    )
    assert scale.determined
    assert scale.scale == pytest.approx(DEGREE, rel=0.05)


def at_rest() -> np.ndarray:
    noise = np.random.default_rng(3).normal(size=(3000, 6))
    return np.column_stack(
        [np.arange(3000) / 100, [0.1, 0.2, GRAVITY] + 0.02 * noise[:, :3], 0.002 * noise[:, 3:]]
    )


def test_a_recording_at_rest_leaves_the_gyro_s_unit_unchecked(csv) -> None:
    recording = read_recording(csv(at_rest()))
    assert recording.angular_rate_unit == "rad/s"
    assert "gyro's unit" in said(recording, "unchecked")


@pytest.mark.parametrize(
    ("units", "force", "rate", "words"),
    [
        ("mg", 1.0, 1.0, r"look like m/s\^2"),
        ("m/s,rad", 1.0, 1.0, "are no velocity increments"),
        ("m/s^2,rad/s", 1e4, 1.0, "gravity seems to have been removed"),
        ("m/s^2,rad/s", np.inf, 1.0, "all zeros"),
        ("m/s^2,rad/s", 1.0, np.inf, "all zeros"),
        (None, np.inf, np.inf, "all zeros"),
    ],
)
def test_a_unit_that_gravity_contradicts_is_refused(tumbled, csv, units, force, rate, words) -> None:
    with pytest.raises(RecordingError, match=words):
        read_recording(csv(scaled(tumbled, force, rate)), units=units)


def test_what_a_header_declares_is_judged_too(tumbled, csv) -> None:
    for rows, header, words in (
        (scaled(tumbled, GRAVITY), "t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx,gy,gz", "look like g"),
        (tumbled.rows(), "t,gx,gy,gz,ax,ay,az", "the triads seem exchanged"),
        (at_rest(), "t,gx,gy,gz,ax,ay,az", "the triads seem exchanged"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(csv(rows, header=header))


def test_a_wrong_sampling_rate_is_suspected(tumbled, csv) -> None:
    """At half the true rate every turn seems to take twice as long: half a radian a unit."""
    recording = read_recording(csv(tumbled.rows()[:, 1:], header=None), rate=50.0)
    assert "if it is in rad/s, the sampling rate is not 50 but 1" in said(recording)
    doubt = said(read_recording(csv(tumbled.rows()), units="m/s^2,counts,us"), "doubtful")
    assert "unusual for an IMU" in doubt
    assert "in s it would be 100 Hz" in doubt


@pytest.mark.parametrize(("shaken", "bias"), [(30.0, 0.0), (30.0, 3.0), (15.0, 3.0)])
def test_a_unit_that_is_shaken_all_the_time_is_neither_exchanged_nor_in_counts(csv, shaken, bias) -> None:
    noise = np.random.default_rng(8).normal(size=(3000, 6))
    force = [0.0, 0.0, GRAVITY] + shaken * noise[:, :3]
    rows = np.column_stack([np.arange(3000) / 100, force, [bias, 0.0, 0.0] + 0.3 * noise[:, 3:]])
    recording = read_recording(csv(rows), units="m/s^2,rad/s")
    assert recording.specific_force == pytest.approx(force, rel=1e-4)


# -- a unit that changes on the way, a triad without gravity ----------------------------------------

COUNT, RATE = 6000, 100.0


def twelve_poses(seed: int = 3) -> np.ndarray:
    """Specific force in m/s² of a unit in twelve poses, its biases those of a consumer unit."""
    rng = np.random.default_rng(seed)
    poses = rng.normal(size=(12, 3))
    poses *= GRAVITY / np.linalg.norm(poses, axis=1, keepdims=True)
    force = np.repeat(poses, COUNT // 12, axis=0) + np.array([0.3, -0.4, 0.2])
    return force + 0.02 * rng.normal(size=force.shape)


def frame(force, rate=None, *, names="a{}", gyro="g{}") -> pl.DataFrame:
    columns = {names.format(axis): force[:, i] for i, axis in enumerate("xyz")}
    columns |= {} if rate is None else {gyro.format(axis): rate[:, i] for i, axis in enumerate("xyz")}
    return pl.DataFrame({"t": np.arange(COUNT) / RATE, **columns})


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, np.ndarray]:
    """Specific force and rate of a unit that is tumbled by hand with rests between."""
    made = tumble_by_hand(holds=18, seed=8)
    return made.specific_force[:COUNT], made.angular_rate[:COUNT]


@pytest.mark.parametrize(("share", "factor"), [(0.15, 1.0), (0.5, 1000.0), (0.9, 1.0)])
def test_a_change_of_unit_on_the_way_is_refused_with_both_levels(share: float, factor: float) -> None:
    force = twelve_poses()
    force[int(share * COUNT) :] *= factor / GRAVITY
    with pytest.raises(RecordingError, match="the unit changes within the file"):
        read_recording(frame(force))


@pytest.mark.parametrize(
    ("share", "factor"), [(0.2, 180.0 / np.pi), (0.5, np.pi / 180.0), (0.5, 1000.0), (0.8, 180.0 / np.pi)]
)
def test_a_gyro_whose_unit_changes_while_it_is_turned_is_refused(motion, share: float, factor: float) -> None:
    rate = motion[1].copy()
    rate[int(share * COUNT) :] *= factor
    with pytest.raises(RecordingError, match=r"the gyro's numbers are some .* the unit changes within"):
        read_recording(frame(motion[0], rate))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_gyro_at_rest_whose_unit_changes_is_refused(share: float) -> None:
    rng = np.random.default_rng(11)
    force = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.normal(size=(COUNT, 3))
    rate = np.radians([0.8, -0.4, 0.5]) + 0.002 * rng.normal(size=(COUNT, 3))
    rate[int(share * COUNT) :] *= 180.0 / np.pi
    with pytest.raises(RecordingError, match="the unit changes within"):
        read_recording(frame(force, rate))


@pytest.mark.parametrize("seed", range(6))
def test_a_recording_in_one_unit_is_not_refused(motion, seed: int) -> None:
    """Shaken by hand for a third of the time, or still first and turned later, or an engine starts: both shake."""
    rng = np.random.default_rng(seed)
    shaken = twelve_poses(seed)
    shaken[2000:4000] *= 1.0 + 0.5 * rng.normal(size=(2000, 1))
    assert read_recording(frame(shaken)).specific_force_unit == "m/s^2"
    force, rate = motion[0].copy(), motion[1].copy()
    still = int(rng.integers(500, 4000))
    force[:still], rate[:still] = force[:1], np.radians([0.8, -0.4, 0.5])
    force[:still] += 0.002 * rng.normal(size=(still, 3))
    rate[:still] += 0.00004 * rng.normal(size=(still, 3))
    assert read_recording(frame(force, rate)).angular_rate_unit == "rad/s"


@pytest.mark.parametrize(("amplitude", "seeds"), [(2.5, (13, 33)), (4.0, (1, 33)), (40.0, (0, 2, 3))])
def test_a_unit_that_is_shaken_at_the_end_has_not_changed_its_units(motion, amplitude, seeds) -> None:
    """The force swings without a turn, or has the norm of some other unit by chance: these were refused."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        time = np.arange(round(12 * RATE)) / RATE
        way = rng.normal(size=3)
        swing = np.outer(np.sin(2.0 * np.pi * rng.uniform(2.0, 7.0) * time), way / np.linalg.norm(way))
        noise = rng.normal(size=(2, len(time), 3))
        ends = motion[0][-1] + amplitude * (swing + 0.2 * noise[0]), 0.02 * (swing + 0.2 * noise[1])
        joined = [np.vstack([a[: -len(time)], b]) for a, b in zip(motion, ends, strict=True)]
        assert read_recording(frame(*joined)).specific_force_unit == "m/s^2"


GRAVITY_FREE = 0.02 * np.random.default_rng(4).normal(size=(COUNT, 3))


@pytest.mark.parametrize(
    "free", ["userAcceleration.{}", "linear_acceleration_{}", "motionUserAcceleration{}"]
)
def test_the_acceleration_with_gravity_is_read_where_both_stand_side_by_side(free: str) -> None:
    force = twelve_poses()
    both = frame(GRAVITY_FREE, force, names=free, gyro="totalAcceleration.{}")
    assert np.array_equal(read_recording(both).specific_force, force)


@pytest.mark.parametrize("name", ["userAcceleration.{}", "linear_acceleration_{}", "a{}"])
def test_an_acceleration_without_gravity_is_refused(name: str) -> None:
    with pytest.raises(RecordingError, match="gravity was taken out of them"):
        read_recording(frame(GRAVITY_FREE, names=name))


def test_a_linear_acceleration_with_gravity_is_read_as_ros_names_it() -> None:
    for factor, unit in ((1.0, "m/s^2"), (1000.0, "counts")):
        got = read_recording(frame(np.round(factor * twelve_poses(), 6), names="linear_acceleration.{}"))
        assert got.specific_force_unit == unit


def test_columns_of_which_nothing_was_made_and_units_that_nobody_knows_are_said() -> None:
    force, rate = twelve_poses(), 0.01 * np.random.default_rng(5).normal(size=(COUNT, 3))
    got = said(read_recording(frame(force, force, gyro="g{}_rps")))
    assert "no gyro was recognised" in got
    assert "'gx_rps'" in got
    named = frame(force, rate, gyro="g{} [foo/s]")
    assert "the unit 'foo/s' of 'gx [foo/s]' is no known unit of angular rate" in said(read_recording(named))
    assert "foo/s' of" not in said(read_recording(named, units="deg/s"))


def test_increments_of_ten_hertz_look_like_g_which_is_said() -> None:
    """0.98 m/s over a tenth of a second is also the norm of a unit in g: the other reading is named."""
    slow = frame(twelve_poses() / 10.0).with_columns(pl.col("t") * 10.0)
    assert read_recording(slow).specific_force_unit == "g"
    assert "if it holds those, say --units m/s,rad" in said(read_recording(slow))


# -- axes and ranges ---------------------------------------------------------------------------------


def recording_of(tumbled, force=None, rate=None) -> Recording:
    force, rate = (np.eye(3) if m is None else np.asarray(m) for m in (force, rate))
    signals = tumbled.specific_force @ force.T, tumbled.angular_rate @ rate.T
    return Recording(tumbled.time, *signals, "m/s^2", "rad/s", 100.0)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))), ids=str)
def test_every_signed_permutation_of_the_gyro_is_told(tumbled, order) -> None:
    """The advice, followed with the option --columns, makes the gyro true again."""
    for signs in itertools.product((1.0, -1.0), repeat=3):
        raw = np.eye(3)[list(order)] * np.array(signs)[:, None]
        sentence = find_axis_contradiction(recording_of(tumbled, rate=raw))
        if np.array_equal(raw, np.eye(3)):
            assert sentence is None
            continue
        listed = sentence.split("columns ", 1)[1].split(" with")[0].replace(" ", "")
        turned = (tumbled.rows()[:, 4:] @ raw.T).T
        columns = dict(zip("abcdef", [*tumbled.specific_force.T, *turned], strict=True))
        mended = read_recording(
            pl.DataFrame(columns), columns="ax,ay,az," + listed, rate=100.0, units="m/s^2,rad/s"
        )
        assert np.array_equal(mended.angular_rate, tumbled.angular_rate)


def test_nothing_is_claimed_of_a_unit_that_turns_about_the_vertical_only_or_has_no_gyro(tumbled) -> None:
    rng = np.random.default_rng(8)
    rate = 0.001 * rng.normal(size=(4000, 3))
    rate[:, 2] += np.sin(np.arange(4000) / 100)
    force = np.array([0.0, 0.0, 9.8]) + 0.02 * rng.normal(size=(4000, 3))
    recording = Recording(np.arange(4000) / 100, force, rate, "m/s^2", "rad/s", 100.0)
    assert find_axis_contradiction(recording) is None
    agreement = gravity_check.axis_agreement(recording)
    assert agreement is None or not agreement.determined
    with pytest.raises(RecordingError, match="both triads"):
        gravity_check.axis_agreement(replace(recording, angular_rate=None))


def test_turns_about_a_single_level_axis_still_tell_a_gyro_that_counts_the_other_way_round() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    # Two seconds of turning, two of rest: about x alone, so that y and z of the gyro are never seen.
    speed = np.where(time % 4.0 < 2.0, 0.8, 0.0)
    angle = np.cumsum(speed) * 0.01
    noise = np.random.default_rng(4).normal(0.0, 0.01, (time.size, 6))
    force = 9.8 * np.column_stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)]) + noise[:, :3]
    # df/dt = -omega x f: gravity turns by +angle about -x in b.
    rate = np.column_stack([speed, np.zeros_like(speed), np.zeros_like(speed)]) + 0.1 * noise[:, 3:]
    assert find_axis_contradiction(Recording(time, force, rate, "m/s^2", "rad/s", 100.0)) is None
    sentence = find_axis_contradiction(Recording(time, force, -rate, "m/s^2", "rad/s", 100.0))
    assert "-gx, -gy, -gz" in str(sentence)


@pytest.mark.parametrize(
    ("ratio", "step"),
    [(2.1, 2.0), (0.48, 0.5), (3.8, 4.0), (0.25, 0.25), (1.02, None), (1.4, None), (0.0, None)],
)
def test_a_ratio_is_near_a_step_of_two_or_near_none(ratio: float, step: float | None) -> None:
    assert gravity_check.step_of_two(ratio) == step


def test_half_a_range_and_half_a_rate_are_named() -> None:
    made = PROCEDURES["by-hand"](GRADES["tactical"], np.random.default_rng(3), None, poses=14, rate=50.0)
    recording = Recording(made.time, made.force, made.rate, "m/s^2", "rad/s", 50.0)
    assert gravity_check.find_steps_of_two(recording) == []
    for changed, *words in (
        ({"angular_rate": 0.5 * made.rate}, "Gravity turns twice as fast", "25 Hz instead of 50 Hz"),
        ({"time": 2.0 * made.time, "rate": 25.0}, "Gravity turns half as fast", "50 Hz instead of 25 Hz"),
        ({"specific_force": 2.0 * made.force}, "at rest is twice gravity"),
    ):
        (told,) = gravity_check.find_steps_of_two(replace(recording, **changed))
        assert all(word in told for word in words)
    assert gravity_check.gyro_step_words(1.1, 100.0) is None
