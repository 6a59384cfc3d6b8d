"""From a simulated protocol back to which hold and spin is which of its steps."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import PROTOCOLS, HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol
from tumble.recording.recording import Recording
from tumble.segmentation import Timeline, find_spins, find_timeline, observe_holds
from tumble.segmentation.matching import Matching, match_protocol, observe_matched_spins
from tumble.simulation import Truth, find_grade
from tumble.simulation.protocols import simulate_protocol

SITE = Site.from_latitude(np.radians(41.0))


def simulated(
    protocol: Protocol,
    *,
    seed: int = 1,
    grade: str | None = "consumer-mems",
    units: str = "SI",
    rate: float = 50.0,
) -> tuple[Recording, Truth]:
    return simulate_protocol(
        protocol,
        rate,
        np.random.default_rng(seed),
        site=SITE,
        grade=None if grade is None else find_grade(grade),
        units=units,
    )


def matched(protocol: Protocol, recording: Recording) -> tuple[Matching, Timeline]:
    timeline = find_timeline(recording)
    return match_protocol(protocol, recording, timeline, observe_holds(recording, timeline)), timeline


def shortened(name: str) -> Protocol:
    """A named protocol with holds of 5 s at most and spins of some 5 s, for speed."""
    protocol = named_protocol(name)

    def short(step: Step) -> Step:
        if isinstance(step, SpinStep):
            period = 2.0 * np.pi / abs(step.rate)
            return replace(step, duration=period * max(1.0, np.round(5.0 / period)) if period < 10.0 else 5.0)
        return replace(step, duration=min(step.duration, 5.0))

    return replace(protocol, steps=tuple(short(step) for step in protocol.steps))


def assert_in_place(
    played: list[int], matching: Matching, timeline: Timeline, recording: Recording, truth: Truth
) -> None:
    """Every hold and spin lies where its step was played; `played` has the place of each step, or -1."""
    assert truth.step_edges is not None
    for hold in matching.holds:
        start, stop = truth.step_edges[played[hold.step]]
        found = timeline.holds[hold.hold]
        middle = 0.5 * (recording.time[found.start] + recording.time[found.stop - 1])
        assert start < middle < stop
    for spin in matching.spins:
        start, stop = truth.step_edges[played[spin.step]]
        assert start < recording.time[spin.start] < recording.time[spin.stop - 1] < stop


# Soaks and sweeps are played by a chamber: tests/unit/calibration/test_thermal.py has them.
NAMED = [name for name in PROTOCOLS if not name.startswith("thermal-")]


@pytest.mark.parametrize(("name", "units"), list(zip(NAMED, cycle(["SI", "counts"]), strict=False)))
def test_every_named_protocol_is_found_whole(name: str, units: str) -> None:
    protocol = named_protocol(name)
    recording, truth = simulated(protocol, units=units)
    matching, timeline = matched(protocol, recording)
    steps = [number for number, step in enumerate(protocol.steps) if not isinstance(step, TurnStep)]
    assert sorted([m.step for m in matching.holds] + [m.step for m in matching.spins]) == steps
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])
    assert_in_place(list(range(len(protocol.steps))), matching, timeline, recording, truth)


@pytest.mark.parametrize(
    ("name", "grade"),
    [
        ("six-position", "ring-laser"),
        ("multi-position-26", None),
        ("modified-multi-position", "ring-laser"),
        ("rate-table", None),
    ],
)
def test_with_little_or_no_noise_it_is_found_as_well(name: str, grade: str | None) -> None:
    protocol = shortened(name)
    recording, _ = simulated(protocol, grade=grade, rate=100.0)
    matching, _ = matched(protocol, recording)
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])


def without(protocol: Protocol, number: int) -> tuple[Protocol, list[int]]:
    """The protocol without a step (and the turn beside it), and where the others are played."""
    beside = number - 1 if number else 1
    dropped = {number, beside} if isinstance(protocol.steps[beside], TurnStep) else {number}
    kept = [k for k in range(len(protocol.steps)) if k not in dropped]
    places = [kept.index(k) if k in kept else -1 for k in range(len(protocol.steps))]
    return replace(protocol, steps=tuple(protocol.steps[k] for k in kept)), places


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("six-position", 0),
        ("six-position", 10),
        ("multi-position-26", 26),
        ("hand-held", 50),
        ("modified-multi-position", 9),
        ("rate-table", 61),
    ],
)
def test_a_missing_step_is_named(name: str, number: int) -> None:
    protocol = shortened(name)
    played, places = without(protocol, number)
    recording, truth = simulated(played)
    matching, timeline = matched(protocol, recording)
    assert matching.missing == (number,)
    step = protocol.steps[number]
    what = f", a spin at {np.degrees(step.rate):.4g}°/s," if isinstance(step, SpinStep) else ""
    assert matching.remarks == [f"Step {number + 1} ({step.name}){what} was not found."]
    assert_in_place(places, matching, timeline, recording, truth)


@pytest.mark.parametrize(
    ("name", "number"), [("six-position", 0), ("multi-position-26", 24), ("modified-multi-position", 8)]
)
def test_a_hold_done_twice_is_used_twice(name: str, number: int) -> None:
    """The user turns the unit away, finds the recording disturbed, and does the pose again."""
    protocol = shortened(name)
    step = protocol.steps[number]
    assert isinstance(step, HoldStep)
    assert step.pose is not None
    # away by a turn that ends where it began: no other hold lies between
    away = TurnStep(3.0, np.cross(step.pose.up_b, [0.6, 0.0, 0.8]), 2.0 * np.pi)
    axis = away.axis_b
    assert axis is not None
    away = replace(away, axis_b=axis / np.linalg.norm(axis))
    steps = (*protocol.steps[: number + 1], away, replace(step, pose=None), *protocol.steps[number + 1 :])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, _ = matched(protocol, recording)
    assert [m.step for m in matching.holds].count(number) == 2
    assert (matching.missing, matching.extra) == ((), ())
    assert matching.remarks == [f"Step {number + 1} ({step.name}) was done twice: both are used."]


def test_a_spin_done_twice_is_used_twice() -> None:
    protocol = shortened("rate-table")
    steps = (*protocol.steps[:4], *protocol.steps[2:4], *protocol.steps[4:])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, _ = matched(protocol, recording)
    assert matching.missing == ()
    assert [m.step for m in matching.spins].count(3) == 2
    assert f"Step 4 ({protocol.steps[3].name}) was done twice: both are used." in matching.remarks


def test_an_extra_hold_is_left_out_and_named() -> None:
    protocol = shortened("six-position")
    slanting = HoldStep(5.0, Pose(np.array([0.6, 0.48, 0.64])), "on the table's edge")
    steps = (*protocol.steps[:5], TurnStep(3.0), slanting, *protocol.steps[5:])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, timeline = matched(protocol, recording)
    assert (matching.missing, matching.extra) == ((), (3,))
    start, stop = timeline.holds[3].start / 50.0, (timeline.holds[3].stop - 1) / 50.0
    assert matching.remarks == [
        f"The hold at {start:.0f}–{stop:.0f} s is not in the protocol and was left out."
    ]


def test_a_hold_in_the_wrong_place_says_which_step_it_looks_like() -> None:
    protocol = shortened("six-position")
    steps = (*protocol.steps[:7], TurnStep(3.0), protocol.steps[0], *protocol.steps[7:])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, _ = matched(protocol, recording)
    assert matching.missing == ()
    assert len(matching.remarks) == 1
    assert "at this place (it looks like step 1 (x up)) and was left out." in matching.remarks[0]


def test_an_extra_spin_is_left_out_and_named() -> None:
    protocol = shortened("modified-multi-position")
    hold, spin = protocol.steps[2], protocol.steps[3]
    assert isinstance(spin, SpinStep)
    steps = (*protocol.steps[:4], hold, replace(spin, rate=3.0 * spin.rate), *protocol.steps[4:])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, _ = matched(protocol, recording)
    assert matching.missing == ()
    assert any(r.startswith("The spin at ") and r.endswith("was left out.") for r in matching.remarks)


def test_spins_are_averaged_row_by_row_as_they_were_matched() -> None:
    protocol = shortened("rate-table")
    recording, truth = simulated(protocol, grade=None)
    matching, _ = matched(protocol, recording)
    means = observe_matched_spins(protocol, recording, matching)
    assert len(means) == len(matching.spins) == 48
    assert means.angular_rate is not None
    assert truth.step_edges is not None
    for row, spin in enumerate(matching.spins):
        step = protocol.steps[spin.step]
        assert isinstance(step, SpinStep)
        # the Earth's rate is 7.3e-5 rad/s
        assert abs(np.linalg.norm(means.angular_rate[row]) - abs(step.rate)) < 8e-5


@pytest.mark.parametrize(
    ("protocol", "recorded", "message"),
    [
        (
            "multi-position-26",
            "six-position",
            r"6 of its 26 holds and spins fit in order. The recording has 6 holds",
        ),
        (
            "modified-multi-position",
            "hand-held",
            r"has 24 spins, but the recording has 26 holds and no spins",
        ),
        ("rate-table", "multi-position-18", r"has 48 spins, but the recording has 18 holds and no spins"),
        ("rate-table", "modified-multi-position", r"of its 102 holds and spins fit|times as fast"),
    ],
)
def test_another_protocol_s_recording_is_refused(protocol: str, recorded: str, message: str) -> None:
    recording, _ = simulated(shortened(recorded))
    with pytest.raises(SegmentationError, match=message):
        matched(shortened(protocol), recording)


def turned_columns(
    recording: Recording, force: Rotation | np.ndarray, rate: np.ndarray | None = None
) -> Recording:
    matrix = force.as_matrix() if isinstance(force, Rotation) else force
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    rates = recording.angular_rate if rate is None else recording.angular_rate @ rate.T
    return replace(recording, specific_force=recording.specific_force @ matrix.T, angular_rate=rates)


# file's columns are z, -x, y of the unit: neither symmetric nor its own inverse
SWAPPED = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_swapped_axes_are_told_with_the_columns_that_would_do() -> None:
    protocol = shortened("multi-position-26")
    recording, _ = simulated(protocol, units="counts")
    columns = "t,az,-ax,ay,gx,gy,gz"
    with pytest.raises(SegmentationError, match=f"26 of the 26 poses fit .*--columns {columns} "):
        matched(protocol, turned_columns(recording, SWAPPED))


def test_a_unit_mounted_otherwise_turns_both_triads() -> None:
    protocol = shortened("six-position")
    recording, _ = simulated(protocol)
    # a rotation: x is -y, y is x
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(
        SegmentationError, match=r"x is -y, y is x.*--columns t,-ay,ax,az,-gy,gx,gz .*another order"
    ):
        matched(protocol, turned_columns(recording, turn, turn))


def test_spins_the_wrong_way_round_are_named() -> None:
    protocol = shortened("modified-multi-position")
    recording, _ = simulated(protocol)
    with pytest.raises(SegmentationError, match=r"Wrong way round, steps 2, 4, 8.*-gx,-gy,-gz"):
        matched(protocol, turned_columns(recording, np.eye(3), -np.eye(3)))
    steps = list(protocol.steps)
    spin = steps[3]
    assert isinstance(spin, SpinStep)
    steps[3] = replace(spin, rate=-spin.rate)
    with pytest.raises(
        SegmentationError, match=r"step 4: the protocol turns clockwise .* gyro saw counter-clockwise"
    ):
        matched(replace(protocol, steps=tuple(steps)), recording)


def test_a_gyro_with_swapped_axes_is_told() -> None:
    protocol = shortened("rate-table")
    recording, _ = simulated(protocol)
    with pytest.raises(
        SegmentationError, match=r"spins fit once the gyro's axes are swapped.*t,ax,ay,az,gz,-gx,gy "
    ):
        matched(protocol, turned_columns(recording, np.eye(3), SWAPPED))


def test_rates_in_another_unit_are_told() -> None:
    protocol = shortened("modified-multi-position")
    recording, _ = simulated(protocol)
    assert recording.angular_rate is not None
    degrees = replace(recording, angular_rate=np.degrees(recording.angular_rate))
    with pytest.raises(
        SegmentationError, match=r"5\d\.\d times as fast.*look like deg/s: declare them with --units"
    ):
        matched(protocol, degrees)


def turned_protocol(angles: list[float]) -> Protocol:
    """Holds with turns about x between them, each with its angle."""
    rotation, steps = Rotation.from_rotvec([np.pi, 0.0, 0.0]), []
    for k, angle in enumerate([0.0, *angles]):
        if k:
            steps.append(TurnStep(3.0, np.array([1.0, 0.0, 0.0]), angle, name=f"turn {k}"))
            rotation = rotation * Rotation.from_rotvec([angle, 0.0, 0.0])
        steps.append(HoldStep(4.0, Pose.from_matrix(rotation.as_matrix()), f"pose {k + 1}"))
    return Protocol("turned", "turntable", tuple(steps))


def test_turns_the_wrong_way_round_are_told() -> None:
    protocol = turned_protocol([0.5 * np.pi, 0.25 * np.pi, -1.2, 0.4])
    recording, _ = simulated(protocol, grade=None)
    assert matched(protocol, recording)[0].remarks == []
    with pytest.raises(
        SegmentationError, match=r"Wrong way round, steps 2, 4, 6, 8: the holds .* fit the protocol"
    ):
        matched(protocol, turned_columns(recording, np.eye(3), -np.eye(3)))


def test_half_a_turn_the_other_way_round_is_a_remark() -> None:
    said, done = turned_protocol([np.pi, 0.5 * np.pi, 1.0]), turned_protocol([-np.pi, 0.5 * np.pi, 1.0])
    recording, _ = simulated(done, grade=None)
    assert matched(said, recording)[0].remarks == [
        "Step 2: turned the other way round than the protocol says, to the same pose."
    ]


def test_an_accelerometer_alone_matches_the_holds() -> None:
    protocol = shortened("modified-multi-position")
    recording, _ = simulated(protocol)
    matching, _ = matched(protocol, replace(recording, angular_rate=None))
    # about the vertical: what a spin parts is one hold for the accelerometer
    assert [m.step for m in matching.holds] == [6 * pose for pose in range(12)]
    assert len(matching.missing) == 48
    assert len(matching.remarks) == 1
    assert "no gyro: the protocol's 24 spins cannot be seen in it" in matching.remarks[0]


def test_a_gyro_alone_matches_the_spins() -> None:
    protocol = shortened("modified-multi-position")
    recording, _ = simulated(protocol)
    matching, _ = matched(protocol, replace(recording, specific_force=None))
    assert [m.step for m in matching.spins] == [
        n for n, step in enumerate(protocol.steps) if isinstance(step, SpinStep)
    ]
    assert matching.missing == ()


def test_a_step_is_looked_for_in_its_interval_only() -> None:
    """Two steps of one pose: the interval decides which of them a single hold is, order or not."""
    protocol = shortened("six-position")
    recording, truth = simulated(protocol)
    assert truth.step_edges is not None
    spans = [(float(a) - 1.0, float(b) + 1.0) for a, b in truth.step_edges]
    steps = [
        replace(step, interval=span) if isinstance(step, HoldStep) else step
        for step, span in zip(protocol.steps, spans, strict=True)
    ]
    # given in the reverse order, with their intervals
    matching, timeline = matched(replace(protocol, steps=tuple(steps[::-1])), recording)
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])
    places = list(range(len(steps)))[::-1]
    assert_in_place(places, matching, timeline, recording, truth)
    late = replace(steps[4], interval=(1.0, 3.0))
    missing, _ = matched(replace(protocol, steps=(*steps[:4], late, *steps[5:])), recording)
    assert missing.missing == (4,)
    assert "Step 5 (z up) was not found between 1 and 3 s." in missing.remarks


def test_a_saturated_spin_is_left_out_and_named() -> None:
    protocol = shortened("rate-table")
    recording, _ = simulated(protocol, grade="tactical")
    assert recording.angular_rate is not None
    clipped = replace(recording, angular_rate=np.clip(recording.angular_rate, -2.5, 2.5))
    matching, _ = matched(protocol, clipped)
    fast = [n for n, s in enumerate(protocol.steps) if isinstance(s, SpinStep) and abs(s.rate) > 3.0]
    assert matching.missing == tuple(fast)
    first = f"Step {fast[0] + 1} ({protocol.steps[fast[0]].name})"
    assert (
        matching.remarks[0] == f"{first} was left out: the gyro's x axis is at its extreme value: saturated."
    )
    assert len(matching.remarks) == 8
    assert matching.remarks[-1] == "5 more steps were not found."


def test_two_files_of_one_rate_are_two_spins() -> None:
    """A file a step: two recordings of the same spin lie side by side, with only a gap between them."""
    protocol = shortened("modified-multi-position")
    recording, truth = simulated(protocol)
    assert truth.step_edges is not None
    spin = next(n for n, step in enumerate(protocol.steps) if isinstance(step, SpinStep))
    start, stop = (int(50.0 * t) for t in truth.step_edges[spin])
    middle = (start + stop) // 2
    time = recording.time + np.where(np.arange(len(recording)) >= middle, 10.0, 0.0)
    timeline = find_timeline(parted := replace(recording, time=time, gaps=(middle,)))
    found = [s for s in find_spins(parted, timeline) if start <= s.start < stop]
    assert len(found) == 2
    assert found[0].stop <= middle <= found[1].start


def test_a_spin_at_another_rate_than_the_protocol_states_is_told_by_both_rates() -> None:
    protocol = shortened("rate-table")
    recording, _ = simulated(protocol, units="counts")
    steps = list(protocol.steps)
    spin = steps[3]
    assert isinstance(spin, SpinStep)
    assert np.degrees(spin.rate) == pytest.approx(-10.0)
    steps[3] = replace(spin, rate=np.radians(-33.0))
    (said,) = matched(replace(protocol, steps=tuple(steps)), recording)[0].remarks
    # A consumer gyro's scale is off by some per cent, and in counts it is known from the other spins alone.
    assert re.fullmatch(
        rf"Step 4 \({spin.name}\) was left out: it states -33°/s, and the gyro showed -(9\.[5-9]|10)\d*°/s at .* s\.",
        said,
    )


def test_axes_that_are_reversed_and_not_swapped_are_called_reversed() -> None:
    protocol = shortened("six-position")
    recording, _ = simulated(protocol)
    turned = turned_columns(recording, -np.eye(3), np.eye(3))
    with pytest.raises(
        SegmentationError, match=r"once the axes x, y and z are reversed: x is -x, y is -y, z is -z"
    ):
        matched(protocol, turned)
    half = np.diag([-1.0, -1.0, 1.0])
    with pytest.raises(SegmentationError, match=r"once the axes x and y are reversed: x is -x, y is -y\."):
        matched(protocol, turned_columns(recording, half, half))
    with pytest.raises(SegmentationError, match=r"once the z axis is reversed: z is -z\."):
        matched(protocol, turned_columns(recording, np.diag([1.0, 1.0, -1.0]), np.eye(3)))
