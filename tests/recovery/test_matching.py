"""From a simulated protocol back to which hold and spin is which of its steps, whatever a table does wrong."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import PROTOCOLS, HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol
from tumble.recording import Recording
from tumble.segmentation import (
    Matching,
    Timeline,
    find_timeline,
    match_protocol,
    observe_holds,
    observe_matched_spins,
)
from tumble.simulation import TableErrors, Truth, find_grade, simulate_protocol

SITE = Site.from_latitude(np.radians(41.0))


def simulated(protocol, grade="consumer-mems", units="SI", rate=50.0) -> tuple[Recording, Truth]:
    kind, rng = None if grade is None else find_grade(grade), np.random.default_rng(1)
    return simulate_protocol(protocol, rate, rng, site=SITE, grade=kind, units=units)


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


def assert_in_place(played, matching, timeline, recording, truth) -> None:
    """Every hold and spin lies where its step was played; `played` has the place of each step, or -1."""
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


@pytest.mark.parametrize(
    ("protocol", "grade", "units"),
    [
        *(
            (named_protocol(name), "consumer-mems", units)
            for name, units in zip(NAMED, cycle(["SI", "counts"]))
        ),
        # With little or no noise it is found as well.
        (shortened("six-position"), "ring-laser", "SI"),
        (shortened("multi-position-26"), None, "SI"),
        (shortened("modified-multi-position"), "ring-laser", "SI"),
        (shortened("rate-table"), None, "SI"),
    ],
    ids=[*NAMED, "little noise", "no noise", "spins of little noise", "spins of no noise"],
)
def test_every_named_protocol_is_found_whole(protocol: Protocol, grade: str | None, units: str) -> None:
    recording, truth = simulated(protocol, grade, units, 50.0 if grade == "consumer-mems" else 100.0)
    matching, timeline = matched(protocol, recording)
    steps = [number for number, step in enumerate(protocol.steps) if not isinstance(step, TurnStep)]
    assert sorted([m.step for m in matching.holds] + [m.step for m in matching.spins]) == steps
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])
    assert_in_place(list(range(len(protocol.steps))), matching, timeline, recording, truth)


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


def again(protocol: Protocol, number: int) -> tuple[Step, ...]:
    """The user turns the unit away, finds the recording disturbed, and does the pose again."""
    step = protocol.steps[number]
    # away by a turn that ends where it began: no other hold lies between
    axis = np.cross(step.pose.up_b, [0.6, 0.0, 0.8])
    away = TurnStep(3.0, axis / np.linalg.norm(axis), 2.0 * np.pi)
    return (*protocol.steps[: number + 1], away, replace(step, pose=None), *protocol.steps[number + 1 :])


@pytest.mark.parametrize(
    ("name", "number"),
    [("six-position", 0), ("multi-position-26", 24), ("modified-multi-position", 8), ("rate-table", 3)],
)
def test_what_is_done_twice_is_used_twice(name: str, number: int) -> None:
    protocol = shortened(name)
    steps = protocol.steps
    spin = isinstance(steps[number], SpinStep)
    twice = (*steps[: number + 1], *steps[number - 1 :]) if spin else again(protocol, number)
    matching, _ = matched(protocol, simulated(replace(protocol, steps=twice))[0])
    assert [m.step for m in (*matching.holds, *matching.spins)].count(number) == 2
    assert matching.missing == ()
    assert f"Step {number + 1} ({steps[number].name}) was done twice: both are used." in matching.remarks
    assert spin or (matching.extra, len(matching.remarks)) == ((), 1)


MORE: dict[str, tuple[str, int, Callable[[Protocol], tuple[Step, ...]], str]] = {
    "an extra hold": (
        *(
            "six-position",
            5,
            lambda _: (TurnStep(3.0), HoldStep(5.0, Pose(np.array([0.6, 0.48, 0.64])), "edge")),
        ),
        r"The hold at {:.0f}–{:.0f} s is not in the protocol and was left out\.",
    ),
    "a hold in the wrong place": (
        *("six-position", 7, lambda protocol: (TurnStep(3.0), protocol.steps[0])),
        r"The hold at {:.0f}–{:.0f} s .*at this place \(it looks like step 1 \(x up\)\) and was left out\.",
    ),
    "an extra spin": (
        *("modified-multi-position", 4, lambda protocol: (protocol.steps[2], faster(protocol.steps[3]))),
        r"The spin at .* was left out\.",
    ),
}


def faster(step: Step) -> Step:
    return replace(step, rate=3.0 * step.rate)


@pytest.mark.parametrize("what", MORE)
def test_what_is_not_in_the_protocol_is_left_out_and_named(what: str) -> None:
    name, at, more, said = MORE[what]
    protocol = shortened(name)
    steps = (*protocol.steps[:at], *more(protocol), *protocol.steps[at:])
    recording, _ = simulated(replace(protocol, steps=steps))
    matching, timeline = matched(protocol, recording)
    assert matching.missing == ()
    if what != "an extra spin":
        (hold,) = matching.extra
        said = said.format(timeline.holds[hold].start / 50.0, (timeline.holds[hold].stop - 1) / 50.0)
        assert len(matching.remarks) == 1
    assert any(re.fullmatch(said, remark) for remark in matching.remarks)


def test_spins_are_averaged_row_by_row_as_they_were_matched() -> None:
    protocol = shortened("rate-table")
    recording, _ = simulated(protocol, None)
    matching, _ = matched(protocol, recording)
    means = observe_matched_spins(protocol, recording, matching)
    assert len(means) == len(matching.spins) == 48
    for row, spin in enumerate(matching.spins):
        step = protocol.steps[spin.step]
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


def turned_columns(recording: Recording, force: np.ndarray, rate: np.ndarray) -> Recording:
    return replace(
        recording,
        specific_force=recording.specific_force @ force.T,
        angular_rate=recording.angular_rate @ rate.T,
    )


# file's columns are z, -x, y of the unit: neither symmetric nor its own inverse
SWAPPED = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
# A rotation: x is -y, y is x.
MOUNTED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SAME, HALF = np.eye(3), np.diag([-1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("name", "force", "rate", "words"),
    [
        ("multi-position-26", SWAPPED, SAME, r"26 of the 26 poses fit .*--columns t,az,-ax,ay,gx,gy,gz "),
        ("six-position", MOUNTED, MOUNTED, r"x is -y, y is x.*--columns t,-ay,ax,az,-gy,gx,gz .*another order"),
        ("six-position", -SAME, SAME, r"once the axes x, y and z are reversed: x is -x, y is -y, z is -z"),
        ("six-position", HALF, HALF, r"once the axes x and y are reversed: x is -x, y is -y\."),
        ("six-position", np.diag([1.0, 1.0, -1.0]), SAME, r"once the z axis is reversed: z is -z\."),
        ("modified-multi-position", SAME, -SAME, r"Wrong way round, steps 2, 4, 8.*-gx,-gy,-gz"),
        ("rate-table", SAME, SWAPPED, r"spins fit once the gyro's axes are swapped.*t,ax,ay,az,gz,-gx,gy "),
        ("modified-multi-position", SAME, np.degrees(SAME), r"5\d\.\d times as fast.*look like deg/s: .*with --units"),
    ],
)  # fmt: skip
def test_axes_signs_and_units_that_would_do_are_told(name, force, rate, words) -> None:
    protocol = shortened(name)
    recording, _ = simulated(protocol, units="counts" if force is SWAPPED else "SI")
    with pytest.raises(SegmentationError, match=words):
        matched(protocol, turned_columns(recording, force, rate))


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
    recording, _ = simulated(protocol, None)
    assert matched(protocol, recording)[0].remarks == []
    words = r"Wrong way round, steps 2, 4, 6, 8: the holds .* fit the protocol"
    with pytest.raises(SegmentationError, match=words):
        matched(protocol, turned_columns(recording, SAME, -SAME))
    # Half a turn ends in the same pose.
    said, done = turned_protocol([np.pi, 0.5 * np.pi, 1.0]), turned_protocol([-np.pi, 0.5 * np.pi, 1.0])
    assert matched(said, simulated(done, None)[0])[0].remarks == [
        "Step 2: turned the other way round than the protocol says, to the same pose."
    ]


def with_rate(protocol: Protocol, number: int, rate: float) -> Protocol:
    steps = list(protocol.steps)
    spin = steps[number]
    steps[number] = replace(spin, rate=rate)
    return replace(protocol, steps=tuple(steps))


def test_a_spin_the_wrong_way_round_or_at_another_rate_is_named() -> None:
    protocol = shortened("modified-multi-position")
    other = with_rate(protocol, 3, -protocol.steps[3].rate)
    words = r"step 4: the protocol turns clockwise .* gyro saw counter-clockwise"
    with pytest.raises(SegmentationError, match=words):
        matched(other, simulated(protocol)[0])
    table = shortened("rate-table")
    assert np.degrees(table.steps[3].rate) == pytest.approx(-10.0)
    recording, _ = simulated(table, units="counts")
    (said,) = matched(with_rate(table, 3, np.radians(-33.0)), recording)[0].remarks
    # A consumer gyro's scale is off by some per cent, and in counts it is known from the other spins alone.
    stated = rf"Step 4 \({table.steps[3].name}\) was left out: it states -33°/s, and the gyro showed"
    assert re.fullmatch(rf"{stated} -(9\.[5-9]|10)\d*°/s at .* s\.", said)


def test_one_triad_alone_matches_what_it_sees() -> None:
    protocol = shortened("modified-multi-position")
    recording, _ = simulated(protocol)
    matching, _ = matched(protocol, replace(recording, angular_rate=None))
    # about the vertical: what a spin parts is one hold for the accelerometer
    assert [m.step for m in matching.holds] == [6 * pose for pose in range(12)]
    assert len(matching.missing) == 48
    (said,) = matching.remarks
    assert "no gyro: the protocol's 24 spins cannot be seen in it" in said
    matching, _ = matched(protocol, replace(recording, specific_force=None))
    spins = [n for n, step in enumerate(protocol.steps) if isinstance(step, SpinStep)]
    assert [m.step for m in matching.spins] == spins
    assert matching.missing == ()


def test_a_step_is_looked_for_in_its_interval_only() -> None:
    """Two steps of one pose: the interval decides which of them a single hold is, order or not."""
    protocol = shortened("six-position")
    recording, truth = simulated(protocol)
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
    recording, _ = simulated(protocol, "tactical")
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


ARC_SECOND = np.pi / 648_000.0
# Ten times what a table of arc-seconds does, and a ripple that the ear hears.
BAD = TableErrors(
    angle_sigma=20.0 * ARC_SECOND,
    once=10.0 * ARC_SECOND,
    twice=5.0 * ARC_SECOND,
    axis_tilt=np.radians(0.5),
    wobble=20.0 * ARC_SECOND,
    ripple=5e-3,
    ramp_spread=0.2,
)
EARLY = replace(BAD, stops_early=((1, 0.35), (2, 0.6)))


# Each protocol with each table, and all pairs of grades and units.
@pytest.mark.parametrize(
    ("name", "grade", "units", "table"),
    [
        # Its g-sensitivity moves the slow rate about a level axis by some per cent.
        ("turntable-9", "consumer-mems", "counts", None),
        ("laboratory", "consumer-mems", "SI", EARLY),
        ("turntable-9", "industrial-mems", "SI", EARLY),
        ("laboratory", "industrial-mems", "counts", BAD),
        ("turntable-9", "tactical", "SI", BAD),
        ("laboratory", "tactical", "counts", None),
    ],
)
def test_every_hold_and_rotation_is_found_where_it_was(name, grade, units, table) -> None:
    rng = np.random.Generator(np.random.SFC64(5))
    recording, truth = simulate_protocol(
        named_protocol(name),
        50.0,
        rng,
        site=SITE,
        grade=find_grade(grade),
        model=find_grade(grade).simulate_model(rng),
        units=units,
        table=table,
        lever_arm_b=np.array([0.05, -0.03, 0.02]),
    )
    protocol = replace(named_protocol(name), steps=truth.steps, site=SITE)
    matching, timeline = matched(protocol, recording)
    steps = protocol.steps
    assert [m.step for m in matching.holds] == [k for k, s in enumerate(steps) if isinstance(s, HoldStep)]
    assert [m.step for m in matching.spins] == [k for k, s in enumerate(steps) if isinstance(s, SpinStep)]
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])
    found = [(m.step, timeline.holds[m.hold].start, timeline.holds[m.hold].stop) for m in matching.holds]
    found += [(m.step, m.start, m.stop) for m in matching.spins]
    for step, start, stop in found:
        began, ended = truth.step_edges[step]
        # Edges are found to 0.2 s; the ends of a ramp, where the rate is all but constant, less well.
        assert recording.time[start] > began - 0.5
        assert recording.time[stop - 1] < ended + 0.5
        if isinstance(steps[step], HoldStep):
            assert recording.time[stop - 1] - recording.time[start] > 0.9 * (ended - began)
