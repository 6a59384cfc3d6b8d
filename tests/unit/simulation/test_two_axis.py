"""A two-axis fixture: where it brings the unit, which way each of its errors goes, and what it refuses."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import ProtocolError, UsageError
from tumble.protocol import (
    SEQUENCES,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    sequence_steps,
)
from tumble.simulation import FixtureErrors, TableErrors, fixture_angles, simulate_protocol
from tumble.simulation.fixtures import PlayedProtocol
from tumble.simulation.two_axis import play_sequences
from unit.given import signals

TEST = named_protocol("strapdown-rotation")
STILL = Site(9.81, 0.0)  # no latitude: an Earth that does not turn
X, Y, Z = np.eye(3)
NORTH, EAST, DOWN = X, Y, Z
WRONG = FixtureErrors(
    heading=3e-3,
    tilt=(-2e-3, 5e-3),
    orthogonality=4e-3,
    inner_zero=-6e-3,
    outer_zero=7e-3,
    mounting=(1e-3, -8e-3, 9e-3),
    execution=2e-3,
)


def play(errors=None, protocol=TEST, seed=1, **more):
    return play_sequences(protocol, np.random.default_rng(seed), errors or FixtureErrors(), **more)


def attitude(played: PlayedProtocol, step: int) -> np.ndarray:
    return Rotation.from_quat(played.motion.hold_quaternions_nb)[played.hold_steps.index(step)].as_matrix()


def only(*names: str) -> Protocol:
    """The named sequences alone, each with the turn before it."""
    chosen = [s for s in sequence_steps(TEST) if s.name in names]
    steps = [step for s in chosen for step in (TurnStep(8.0), *TEST.steps[s.start : s.end + 1])]
    return replace(TEST, steps=tuple(steps[1:]))


def test_every_sequence_starts_as_table_1_says_with_the_outer_axis_east() -> None:
    played, starts = play(), "zy zx xy zy zx xy zy zx xy yx zx xy yx zy xy zy zx"
    for (down, along), sequence in zip(starts.split(), sequence_steps(TEST), strict=True):
        C_nb = attitude(played, sequence.start)
        # 1e-12: rounding, of some fifty rotations one after another
        np.testing.assert_allclose(C_nb[:, "xyz".index(down)], DOWN, atol=1e-12)
        np.testing.assert_allclose(C_nb[:, "xyz".index(along)], EAST, atol=1e-12)


def aimed(azimuth: float) -> Protocol:
    """The test on a fixture whose outer axis points there, not east."""

    def turned(step: Any) -> Any:
        pose = getattr(step, "pose", None)
        if pose is None or pose.heading is None:
            return step
        return replace(step, pose=replace(pose, heading=pose.heading + azimuth - 0.5 * np.pi))

    return replace(TEST, steps=tuple(turned(step) for step in TEST.steps))


def test_the_fixture_s_angles_are_those_of_table_1_also_where_its_outer_axis_points_elsewhere() -> None:
    for azimuth in (0.5 * np.pi, -0.3):
        found = fixture_angles(aimed(azimuth))
        assert found.azimuth == pytest.approx(azimuth, abs=1e-12)
        for row, (_, start, turns, end) in zip(SEQUENCES, sequence_steps(TEST), strict=True):
            stops = np.array([found.stops[k] for k in (start, *turns)])
            np.testing.assert_allclose(stops, row.fixture_angles(), atol=1e-12)
            assert found.stops[end] == found.stops[turns[-1]]


def test_every_sequence_ends_where_its_rotations_about_the_unit_s_axes_lead() -> None:
    played = play()
    for row, sequence in zip(SEQUENCES, sequence_steps(TEST), strict=True):
        turned = Rotation.identity()
        for axis, angle in row.rotations:
            turned = turned * Rotation.from_rotvec(angle * np.eye(3)[axis])
        wanted = attitude(played, sequence.start) @ turned.as_matrix()
        np.testing.assert_allclose(attitude(played, sequence.end), wanted, atol=1e-12)


def test_the_attitude_is_continuous_and_each_axis_turns_about_a_line_fixed_in_the_unit() -> None:
    motion = play(WRONG).motion
    edges = motion.hold_edges.ravel()
    before, after = motion.rotation_nb(edges - 1e-7), motion.rotation_nb(edges + 1e-7)
    # At rest on one side, on the other a ramp that has hardly begun: 1e-12 rad; rounding of 1e-8 in a magnitude.
    assert np.max((before.inv() * after).magnitude()) < 1e-7
    middle = motion.rotation_nb(0.5 * (motion.hold_edges[:-1, 1] + motion.hold_edges[1:, 0]))
    half = (Rotation.from_quat(motion.hold_quaternions_nb)[:-1].inv() * middle).as_matrix()
    for k, vector in enumerate(motion.turn_vector_b):
        np.testing.assert_allclose(half[k], Rotation.from_rotvec(0.5 * vector).as_matrix(), atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("errors", "axis_b", "leans_n"),
    [
        ({"heading": 1e-3}, Y, -NORTH),  # clockwise from above: east goes south
        ({"tilt": (1e-3, 0.0)}, Z, -EAST),
        ({"tilt": (0.0, 1e-3)}, Z, NORTH),
        ({"orthogonality": 1e-3}, Z, -EAST),  # the inner axis away from the outer one
        ({"inner_zero": 1e-3}, Y, -NORTH),
        ({"outer_zero": 1e-3}, Z, NORTH),
        ({"mounting": (1e-3, 0.0, 0.0)}, Y, DOWN),
        ({"mounting": (0.0, 1e-3, 0.0)}, Z, NORTH),
        ({"mounting": (0.0, 0.0, 1e-3)}, X, EAST),
    ],
)
def test_each_error_moves_the_unit_s_axes_its_own_way(sign, errors, axis_b, leans_n):
    """At both angles zero, where x is north, y east and z down. 1e-6: the second order of 1e-3."""
    wrong = FixtureErrors(
        **{name: tuple(sign * np.array(v)) if np.ndim(v) else sign * v for name, v in errors.items()}
    )
    C_nb = wrong.C_nb(0.0, 0.0)
    np.testing.assert_allclose(C_nb @ axis_b, axis_b + sign * 1e-3 * leans_n, atol=1e-6)


def test_errors_of_execution_belong_to_stops_and_do_not_add_up() -> None:
    """Each stop of each axis has its own; angles are differences of two, and a whole test is off by as much."""
    turned = []
    for seed in range(12):
        played = play(FixtureErrors(execution=1e-3), seed=seed)
        inner = [r.angle for r in played.rotations if r.axis == "inner"]
        outer = [r.angle for r in played.rotations if r.axis == "outer"]
        for angles in (inner, outer):
            off = np.array(angles) - np.round(np.array(angles) / (0.5 * np.pi)) * 0.5 * np.pi
            turned.append((off.std(), off.sum()))
    spread, total = np.array(turned).T
    # √2 sigmas, from some twenty angles in each of 24: 3.5 %, four of them. The sum has two errors: 15 %, four of them;
    # were errors added up, it would be three times as large.
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(np.sqrt(2.0) * 1e-3, rel=0.14)
    assert np.std(total) == pytest.approx(np.sqrt(2.0) * 1e-3, rel=0.6)


def record(protocol, rate, fixture, arm=(0.0, 0.0, 0.0)):
    told: dict[str, Any] = {"site": STILL, "fixture": fixture, "lever_arm_b": np.array(arm)}
    return simulate_protocol(protocol, rate, np.random.default_rng(2), **told)


def test_rate_ramp_and_pause_are_those_that_are_asked_for() -> None:
    fixture = FixtureErrors(rate=0.5, ramp=1.0, pause=2.0)
    recording, truth = record(only("6"), 100.0, fixture, (0.0, 0.3, 0.4))
    force, rate = signals(recording)
    assert [r.step for r in truth.rotations] == list(range(1, 9))
    assert truth.fixture == fixture
    quarter = truth.rotations[1]
    assert quarter.angle == pytest.approx(0.5 * np.pi)
    assert quarter.stop - quarter.start == pytest.approx(np.pi + 1.0)
    assert quarter.start - truth.rotations[0].stop == pytest.approx(2.0)
    steady = int(100.0 * 0.5 * (quarter.start + quarter.stop))
    np.testing.assert_allclose(rate[steady], [0.0, 0.0, 0.5], atol=1e-12)
    # About z at 0.5 rad/s: 0.3 m along y is pulled back by 0.3 · 0.25 m/s²; z is level then.
    rest = force[int(100.0 * (quarter.start - 1.0))]
    assert np.linalg.norm(rest) == pytest.approx(9.81)
    centripetal = force[steady] - Rotation.from_rotvec([0.0, 0.0, -0.25 * np.pi]).apply(rest)
    # 0.01 s x 0.5 rad/s x g: the sample is not at the very middle of the rotation.
    np.testing.assert_allclose(centripetal, [0.0, -0.075, 0.0], atol=0.05)


def test_without_a_rate_a_ramp_or_a_pause_it_is_played_too() -> None:
    slow = replace(only("8"), steps=tuple(replace(s, duration=20.0) for s in only("8").steps))
    np.testing.assert_allclose(play(protocol=slow).step_edges, [[0.0, 20.0], [20.0, 40.0], [40.0, 60.0]])
    recording, truth = record(only("4", "9"), 50.0, FixtureErrors(ramp=0.0, pause=0.0))
    assert 0.5 < np.max(np.abs(signals(recording)[1])) < 1.2
    assert truth.hold_steps.count(None) >= 3


def test_poses_without_headings_are_reached_with_the_outer_axis_wherever_it_points() -> None:
    steps = tuple(
        replace(s, pose=Pose(s.pose.up_b)) if isinstance(s, HoldStep) and s.pose else s for s in TEST.steps
    )
    known = replace(TEST, steps=steps)
    assert fixture_angles(known).azimuth is None
    anyhow, turned = play(protocol=known), play(protocol=known, heading=1.0)
    for number, step in enumerate(steps):
        if isinstance(step, HoldStep) and step.pose is not None:
            for played in (anyhow, turned):
                np.testing.assert_allclose(attitude(played, number)[2], -step.pose.up_b, atol=1e-9)
    outer = next(r for r in turned.rotations if r.axis == "outer")
    axis_n = Rotation.from_quat(turned.motion.hold_quaternions_nb)[0].apply(outer.axis_b)
    np.testing.assert_allclose(np.abs(axis_n), [np.cos(1.0), np.sin(1.0), 0.0], atol=1e-9)


def test_holds_without_rotations_and_rests_in_one_place_are_played() -> None:
    up = HoldStep(5.0, Pose(-Z, 0.0))
    flip = TurnStep(4.0, Y, np.pi)
    steps = (up, up, flip, HoldStep(5.0), TurnStep(3.0), HoldStep(5.0, Pose(Z, np.pi)), TurnStep(2.0, Z, 1.0))
    played = play(protocol=Protocol("own", "strapdown-rotation", steps))
    np.testing.assert_allclose(attitude(played, 3)[2], [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(
        Rotation.from_quat(played.motion.hold_quaternions_nb)[-1].as_matrix()[2], [0.0, 0.0, -1.0], atol=1e-12
    )
    assert np.all(np.isfinite(played.step_edges))
    assert len(played.motion.hold_duration) == len(played.motion.turn_duration) + 1


def test_a_quality_is_drawn_with_one_sigma_each_and_keeps_its_profile() -> None:
    profile = {"execution": 1e-4, "rate": 2.0, "ramp": 0.2, "pause": 3.0}
    quality = FixtureErrors(1e-3, (2e-3, 3e-3), 4e-3, 5e-3, 6e-3, (7e-3, 8e-3, 9e-3), **profile)
    rng = np.random.default_rng(5)
    drawn = [quality.drawn(rng) for _ in range(100)]
    values = np.array(
        [[d.heading, *d.tilt, d.orthogonality, d.inner_zero, d.outer_zero, *d.mounting] for d in drawn]
    )
    # 100 numbers: 7 %, four of them
    np.testing.assert_allclose(values.std(axis=0), 1e-3 * np.arange(1.0, 10.0), rtol=0.28)
    assert {(d.execution, d.rate, d.ramp, d.pause) for d in drawn} == {tuple(profile.values())}


UP = HoldStep(5.0, Pose(-Z, 0.0))


TO_X, AT_REST = TurnStep(3.0, X, np.pi), HoldStep(5.0)


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ((UP, TurnStep(3.0), UP), "has no sequence of rotations"),
        ((UP, TO_X, AT_REST, TurnStep(3.0, X + Y, 1.0), AT_REST), "Step 4 turns about an axis"),
        ((UP, TurnStep(3.0, X + Z, 1.0), AT_REST), "Step 2 turns about an axis of the unit that then lies"),
        ((UP, TO_X, AT_REST, SpinStep(9.0, 1.0), UP), "Step 4 is a spin"),
        ((HoldStep(5.0, None, "where"), TO_X, UP), r"Step 1 \(where\) has no pose"),
        ((TO_X, UP, TO_X, AT_REST), "Step 1 begins where nothing is known"),
        (
            (UP, TO_X, AT_REST, TurnStep(3.0), HoldStep(5.0, Pose(X, 0.3))),
            r"Step 5: a fixture .* cannot bring the unit there\. z would have to lie [\d.]+ degrees off",
        ),
        ((UP, TurnStep(3.0, X, 1.0), UP), "contradicts itself"),
    ],
)
def test_what_a_two_axis_fixture_cannot_do_is_refused_by_the_step(steps: tuple[Any, ...], words: str) -> None:
    with pytest.raises(ProtocolError if words == "contradicts itself" else UsageError, match=words):
        play(protocol=Protocol("own", "strapdown-rotation", steps))


def test_a_table_beside_the_fixture_is_refused() -> None:
    told: dict[str, Any] = {"site": STILL, "table": TableErrors(), "fixture": FixtureErrors()}
    with pytest.raises(UsageError, match="on a turntable or on a two-axis fixture"):
        simulate_protocol(TEST, 50.0, np.random.default_rng(1), **told)
