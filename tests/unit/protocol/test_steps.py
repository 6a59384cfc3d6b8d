"""Steps of protocols: turns lead to the poses, named ones are the field's tests, sequences are found again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import twenty_six_directions
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ProtocolError
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    RampStep,
    SoakStep,
    SpinStep,
    TurnStep,
    named_protocol,
    read_protocol,
    sequence_steps,
    write_protocol,
)
from tumble.protocol.consistency import refuse_contradicting_turns
from tumble.workflows import calibrate

X, Y, Z = np.eye(3)


def check(*steps):
    refuse_contradicting_turns(Protocol("mine", "multi-position", steps))


def hold(up_b, heading=None, sigma=0.0):
    return HoldStep(5.0, None if up_b is None else Pose(up_b, heading, sigma))


def turn(axis_b, degrees, sigma=0.0):
    return TurnStep(3.0, axis_b, np.radians(degrees), sigma)


def test_a_turn_that_leads_elsewhere_is_named_with_its_hold():
    for name in PROTOCOLS:
        refuse_contradicting_turns(named_protocol(name))
    # b turns by +90 degrees about x, so that what is up in b goes from z to y.
    check(hold(Z), turn(X, 90.0), hold(Y))
    with pytest.raises(
        ProtocolError, match=r"mine contradicts itself: step 3 is .* 180.0 .* of step 2 leads"
    ):
        check(hold(Z), turn(X, -90.0), hold(Y))
    with pytest.raises(ProtocolError, match=r"step 5 is a hold .* turns of steps 2, 4 lead"):
        check(hold(Z), turn(X, 45.0), hold(None), turn(X, 45.0), hold(-Y))


def test_headings_are_compared_only_where_both_are_known():
    check(hold(Z), turn(Z, 90.0), hold(Z, 0.3))
    east = Rotation.from_rotvec([0.0, 0.0, 0.7]) * Pose(Z, 0.0).rotation_nb()
    ends = Pose.from_matrix((east * Rotation.from_rotvec([0.0, 0.0, 1.0])).as_matrix())
    check(HoldStep(5.0, Pose.from_matrix(east.as_matrix())), TurnStep(3.0, Z, 1.0), HoldStep(5.0, ends))
    with pytest.raises(ProtocolError, match="step 3"):
        check(HoldStep(5.0, Pose.from_matrix(east.as_matrix())), TurnStep(3.0, Z, -1.0), HoldStep(5.0, ends))
    # A heading stays known over a hold that does not state it.
    check(hold(Z, 0.0), turn(Z, 90.0), hold(Z), turn(Z, -90.0), hold(Z, 0.0))
    with pytest.raises(ProtocolError, match="step 5"):
        check(hold(Z, 0.0), turn(Z, 90.0), hold(Z), turn(Z, 90.0), hold(Z, 0.0))


def test_what_uncertainties_explain_is_no_contradiction():
    # 2 degrees off, and 5 sigma of half a degree are 2.5; of a third of a degree 1.7.
    check(hold(Z), turn(X, 88.0, np.radians(0.5)), hold(Y))
    with pytest.raises(ProtocolError, match="step 3"):
        check(hold(Z), turn(X, 88.0, np.radians(1.0 / 3.0)), hold(Y))


def test_where_nobody_knows_how_the_unit_was_moved_nothing_is_compared():
    check(hold(Z), turn(X, -90.0), hold(None), hold(Y))
    check(hold(Z), TurnStep(3.0), hold(Y))
    check(hold(Z), SpinStep(10.0, 0.5, X), turn(X, -90.0), hold(Y))
    check(hold(Z), TurnStep(3.0), turn(X, -90.0), hold(Y))


def test_calibrate_blames_the_protocol_before_it_reads_a_recording(tmp_path):
    protocol = Protocol(
        "mine",
        "multi-position",
        (hold(Z), turn(X, 90.0), hold(Y), turn(X, 90.0), hold(Z)),
        Site.from_gravity(9.81),
        recordings=("recording.csv",),
    )
    write_protocol(protocol, tmp_path / "protocol.yaml")
    with pytest.raises(ProtocolError, match=r"contradicts itself: step 5 .* turn of step 4"):
        calibrate(protocol=tmp_path)


def poses(name):
    """The direction that is up in each placement, in order; a repeated one after a spin once."""
    ups = [step.pose.up_b for step in named_protocol(name).steps if isinstance(step, HoldStep) and step.pose]
    return np.array([up for k, up in enumerate(ups) if k == 0 or not np.array_equal(up, ups[k - 1])])


@pytest.mark.parametrize("count", [26, 18, 10])
def test_multi_position_takes_the_first_of_the_cube_s_directions(count):
    np.testing.assert_array_equal(poses(f"multi-position-{count}"), twenty_six_directions()[:count])


def test_six_position_has_each_axis_up_and_down_on_a_level():
    assert np.sum(poses("six-position"), axis=0).tolist() == [0.0, 0.0, 0.0]
    assert np.abs(poses("six-position")).sum(axis=0).tolist() == [2.0, 2.0, 2.0]
    sigmas = {
        s.pose.sigma for s in named_protocol("six-position").steps if isinstance(s, HoldStep) and s.pose
    }
    assert sigmas == {0.5 * np.pi / 180.0}


def test_multi_position_knows_its_poses_only_roughly_and_their_headings_not_at_all():
    holds = [s for s in named_protocol("multi-position-26").steps if isinstance(s, HoldStep) and s.pose]
    assert {(s.pose.sigma, s.pose.heading) for s in holds if s.pose} == {(5.0 * np.pi / 180.0, None)}
    turns = [s for s in named_protocol("hand-held").steps if isinstance(s, TurnStep)]
    assert len(turns) == 25
    assert all(turn.axis_b is None and turn.angle is None for turn in turns)


def test_steps_are_called_by_what_a_person_sees_and_an_unknown_name_is_answered_with_those_that_there_are():
    for name, called in (
        ("six-position", "x up"),
        ("multi-position-26", "edge +x+y up"),
        ("multi-position-26", "corner +x-y-z up"),
        ("modified-multi-position", "z down, 41.78°/s, clockwise"),
    ):
        assert called in [step.name for step in named_protocol(name).steps]
    with pytest.raises(ProtocolError, match="There is no protocol 'six': choose one of six-position, multi-"):
        named_protocol("six")


def test_tables_spin_every_face_both_ways_at_their_rates():
    spins = [s for s in named_protocol("rate-table").steps if isinstance(s, SpinStep)]
    rates = np.round(np.degrees([spin.rate for spin in spins]), 9)
    assert len(spins) == 6 * 8
    assert sorted(rates[:8].tolist()) == [-200.0, -100.0, -50.0, -10.0, 10.0, 50.0, 100.0, 200.0]
    # as Hayal (4.4.1) has it, rounded; ten thousand times the Earth's, clockwise first
    spins = [s for s in named_protocol("modified-multi-position").steps if isinstance(s, SpinStep)]
    assert [spin.rate for spin in spins] == [-1e4 * EARTH_RATE, 1e4 * EARTH_RATE] * 12
    assert np.degrees(spins[1].rate) == pytest.approx(41.78, abs=5e-3)


def renamed(protocol, number, **changes):
    steps = list(protocol.steps)
    steps[number] = replace(steps[number], **changes)  # type: ignore[arg-type]
    return replace(protocol, steps=tuple(steps))


def test_a_row_is_known_by_what_is_done_and_not_by_its_name():
    protocol = named_protocol("strapdown-rotation")
    assert sequence_steps(renamed(protocol, 0, name="first"))[0].name == "1"
    assert protocol.steps[1].name == "1: +360 y"
    assert protocol.steps[1].duration == pytest.approx(2.0 * np.pi + 0.5)
    # The other way round it is another row; about another axis, or by another angle, none.
    assert sequence_steps(renamed(protocol, 1, angle=-2.0 * np.pi))[0].name == "1a"
    assert sequence_steps(renamed(protocol, 1, axis_b=-Y))[0].name == "1a"
    assert sequence_steps(renamed(protocol, 1, axis_b=-Y, angle=-2.0 * np.pi))[0].name == "1"
    assert sequence_steps(renamed(protocol, 1, axis_b=X))[0].name == "2"
    assert sequence_steps(renamed(protocol, 1, angle=np.pi))[0].name == "11"
    assert sequence_steps(renamed(protocol, 1, angle=0.5 * np.pi))[0].name == "1 start"
    other = Pose.from_matrix(Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix())
    assert sequence_steps(renamed(protocol, 0, pose=other))[0].name == "1 start"
    assert sequence_steps(renamed(protocol, 0, pose=None))[0].name == "1 start"


def test_an_own_sequence_is_never_taken_for_a_row_because_of_its_name():
    up = HoldStep(5.0, Pose(Z), "7")
    turn = TurnStep(3.0, X, 1.0)
    own = Protocol("own", "strapdown-rotation", (up, turn, HoldStep(5.0)))
    assert [sequence.name for sequence in sequence_steps(own)] == ["own 7"]
    nameless = replace(own, steps=(HoldStep(5.0), turn, HoldStep(5.0)))
    assert [sequence.name for sequence in sequence_steps(nameless)] == ["step 1"]


def test_a_hold_may_end_one_sequence_and_start_the_next_and_a_turn_anyhow_makes_none():
    rest, turn, anyhow = HoldStep(5.0, None, "r"), TurnStep(3.0, X, 1.0), TurnStep(3.0)
    steps = (rest, turn, turn, rest, turn, rest, anyhow, rest, rest, turn, anyhow, rest, turn)
    found = sequence_steps(Protocol("own", "strapdown-rotation", steps))
    assert [sequence[1:] for sequence in found] == [(0, (1, 2), 3), (3, (4,), 5)]


def test_soaks_and_ramps_are_read_in_their_units_and_read_back_as_written(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(
        "format: tumble protocol\nprocedure: thermal\ngravity: 9.81\nsteps:\n  - hold: z up\n    seconds: 30\n"
        "  - soak: cold\n    temperature_celsius: -20\n    seconds: 1800\n"
        "  - ramp: down\n    from_celsius: 60\n    to_celsius: 20\n    rate_k_per_min: 0.5\n    tumble_every_s: 60\n",
        encoding="utf-8",
    )
    _, soak, ramp = read_protocol(path).steps
    assert isinstance(soak, SoakStep)
    assert isinstance(ramp, RampStep)
    assert (soak.temperature_celsius, soak.tolerance, soak.duration) == (-20.0, 1.0, 1800.0)
    # 40 K at half a kelvin a minute are 80 minutes, downwards.
    assert (ramp.duration, ramp.tumbled) == (4800.0, 60.0)
    assert ramp.rate == pytest.approx(-0.5 / 60.0)
    steps = (
        HoldStep(30.0),
        SoakStep(1801.3, -19.7, 0.35),
        RampStep(960.1, 61.3, 20.0, 45.5, interval=(4.0, 964.1)),
    )
    write_protocol(Protocol("mine", "thermal", steps, Site.from_gravity(9.81)), path)
    assert read_protocol(path).steps == steps
