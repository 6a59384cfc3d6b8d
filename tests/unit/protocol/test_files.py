"""What a protocol's file says is what its steps hold: frames, signs and units; it is readable, whole or not at all."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tumble.earth import Site
from tumble.errors import ProtocolError
from tumble.protocol import (
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    protocol_to_yaml,
    read_protocol,
    write_protocol,
)

HEAD = "format: tumble protocol\nprocedure: multi-position\n"
SITE = "gravity: 9.81\n"
HOLD = "  - hold: rest\n    seconds: 9\n"
DEGREE = np.pi / 180.0
X = np.array([1.0, 0.0, 0.0])
EXACT = 1e-12  # arithmetic: sines and cosines of round angles


def read(folder, content):
    path = folder / "test of the plate.yaml"
    path.write_text(content, encoding="utf-8")
    return read_protocol(path)


def step_of(folder, lines):
    """The last step of a protocol that has a hold before it."""
    return read(folder, f"{HEAD}{SITE}steps:\n{HOLD}{lines}").steps[-1]


def pose_of(folder, lines):
    step = step_of(folder, f"  - hold: h\n    seconds: 1\n    {lines}\n")
    assert isinstance(step, HoldStep)
    return step.pose


def test_only_what_is_needed_has_to_be_written(tmp_path):
    protocol = read(tmp_path, f"{HEAD}{SITE}steps:\n{HOLD}")
    assert protocol.name == "test of the plate"
    assert protocol.procedure == "multi-position"
    assert protocol.site == Site.from_gravity(9.81)
    assert protocol.steps == (HoldStep(9.0, None, "rest"),)
    assert (protocol.description, protocol.recordings) == ("", ())
    assert (protocol.units, protocol.columns, protocol.rate) == (None, None, None)
    more = read(
        tmp_path,
        f"{HEAD}{SITE}version: 1\ndescription: as told\nrecordings: [b.csv, a.csv]\nunits: g,deg/s\n"
        f"columns: ax,ay,az\nrate_hz: 12.5\nsteps:\n{HOLD}",
    )
    assert (more.recordings, more.description) == (("b.csv", "a.csv"), "as told")
    assert (more.units, more.columns, more.rate) == ("g,deg/s", "ax,ay,az", 12.5)


def test_steps_of_a_named_protocol_need_only_a_site_and_may_be_evaluated_by_another_procedure(tmp_path):
    like = "format: tumble protocol\nlike: six-position\n"
    protocol = read(tmp_path, f"{like}site: {{latitude_deg: -33.9}}\n")
    named = named_protocol("six-position")
    assert (protocol.name, protocol.procedure) == ("six-position", "six-position")
    assert [step.name for step in protocol.steps] == [step.name for step in named.steps]
    assert protocol.site == Site.from_latitude(-33.9 * DEGREE)
    other = read(tmp_path, f"{like}procedure: improved-six-position\n{SITE}")
    assert other.procedure == "improved-six-position"


def test_gravity_given_beside_a_latitude_is_believed_to_its_digits_unless_it_says_how_well(tmp_path):
    place = "site:\n  latitude_deg: 48\n  height_m: 520\n  gravity: 9.8073\n"
    site = read(tmp_path, f"{HEAD}{place}steps:\n{HOLD}").site
    assert (site.gravity, site.height) == (9.8073, 520.0)
    assert site.gravity_sigma == pytest.approx(0.00005 / 3**0.5)
    assert site.latitude == 48 * DEGREE
    more = read(tmp_path, f"{HEAD}{place}  gravity_uncertainty: 2e-5\n  source: a tie\nsteps:\n{HOLD}").site
    assert (more.gravity_sigma, more.source) == (2e-5, "a tie")
    # 9.85 m/s² at 48° would be a disturbance of 42 mm/s²; the largest on land are 3 to 4 mm/s².
    with pytest.raises(ProtocolError, match=r"9\.85 m/s² contradicts the latitude 48° .* it is 9\.80"):
        read(tmp_path, f"{HEAD}{place.replace('9.8073', '9.85')}steps:\n{HOLD}")


def test_a_byte_order_mark_windows_lines_and_json_do_not_matter(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + f"{HEAD}{SITE}steps:\n{HOLD}".replace("\n", "\r\n").encode())
    json = (
        '{"format": "tumble protocol", "procedure": "multi-position", "gravity": 9.81,'
        ' "steps": [{"hold": "rest", "seconds": 9}]}'
    )
    assert read_protocol(path).steps == read(tmp_path, json).steps


@pytest.mark.parametrize(
    ("word", "vector"),
    [
        ("x", [1, 0, 0]),
        ("+y", [0, 1, 0]),
        ("-z", [0, 0, -1]),
        ("[0, 3, -4]", [0, 0.6, -0.8]),
        ("[0.6, 0, 0.8]", [0.6, 0, 0.8]),
    ],
)
def test_a_direction_is_an_axis_or_a_vector_of_any_length(word, vector, tmp_path):
    np.testing.assert_allclose(pose_of(tmp_path, f"up: {word}").up_b, vector, rtol=0.0, atol=1e-16)
    turn = step_of(tmp_path, f"  - turn:\n    axis: {word}\n    seconds: 1\n")
    assert isinstance(turn, TurnStep)
    np.testing.assert_allclose(turn.axis_b, vector, rtol=0.0, atol=1e-16)


def test_a_pose_s_heading_and_uncertainty_are_degrees_and_unknown_or_exact_without(tmp_path):
    pose = pose_of(tmp_path, "up: x\n    heading_deg: -90\n    uncertainty_deg: 0.5")
    assert pose.heading == -np.pi / 2
    assert pose.sigma == 0.5 * DEGREE
    bare = pose_of(tmp_path, "up: x")
    assert (bare.heading, bare.sigma) == (None, 0.0)


@pytest.mark.parametrize(
    ("pose_text", "up_b", "x_n"),
    [
        # Level and north: z is down, so that -z is up.
        ("attitude_deg: [0, 0, 0]", [0, 0, -1], [1, 0, 0]),
        # Heading 90: x points east.
        ("attitude_deg: [0, 0, 90]", [0, 0, -1], [0, 1, 0]),
        # Nose up by 30: x is half up.
        ("attitude_deg: [0, 30, 0]", [0.5, 0, -(0.75**0.5)], [0.75**0.5, 0, -0.5]),
        # Right side down by 30: y points half down, so that -y is half up.
        ("attitude_deg: [30, 0, 0]", [0, -0.5, -(0.75**0.5)], [1, 0, 0]),
        # The order: heading last about the vertical, roll first about x.
        ("attitude_deg: [90, 0, 90]", [0, -1, 0], [0, 1, 0]),
        # z down and level: the shortest turn of -z up is none, and x points north; then clockwise to the east.
        ("up: -z\n    heading_deg: 0", [0, 0, -1], [1, 0, 0]),
        ("up: -z\n    heading_deg: 90", [0, 0, -1], [0, 1, 0]),
        # z up is half a turn about the north axis: x stays north.
        ("up: z\n    heading_deg: 0", [0, 0, 1], [1, 0, 0]),
        ("up: z\n    heading_deg: 90", [0, 0, 1], [0, 1, 0]),
        # y up: the shortest turn is about x, which stays north; clockwise by 90 it is east.
        ("up: y\n    heading_deg: 90", [0, 1, 0], [0, 1, 0]),
    ],
)
def test_an_attitude_is_roll_pitch_heading_and_a_heading_clockwise_from_the_shortest_turn(
    pose_text, up_b, x_n, tmp_path
):
    pose = pose_of(tmp_path, pose_text)
    np.testing.assert_allclose(pose.up_b, up_b, rtol=0.0, atol=EXACT)
    assert pose.heading is not None
    np.testing.assert_allclose(pose.rotation_nb().apply([1.0, 0.0, 0.0]), x_n, rtol=0.0, atol=EXACT)


def test_a_turn_s_angle_is_degrees_or_revolutions_of_any_size(tmp_path):
    turn = step_of(
        tmp_path, "  - turn: a\n    axis: z\n    angle_deg: -90\n    uncertainty_deg: 0.1\n    seconds: 2\n"
    )
    assert isinstance(turn, TurnStep)
    assert (turn.angle, turn.sigma) == (-np.pi / 2, 0.1 * DEGREE)
    more = step_of(tmp_path, "  - turn:\n    axis: z\n    revolutions: -2.5\n    seconds: 2\n")
    assert isinstance(more, TurnStep)
    assert more.angle == -5.0 * np.pi
    assert step_of(tmp_path, "  - turn:\n    seconds: 2\n") == TurnStep(2.0)
    lasting = step_of(tmp_path, "  - hold: h\n    interval_s: [12.5, 15]\n    file: a.csv\n")
    assert lasting == HoldStep(2.5, None, "h", file="a.csv", interval=(12.5, 15.0))


def test_a_spin_s_length_is_seconds_or_revolutions_and_its_axis_is_vertical(tmp_path):
    spin = step_of(
        tmp_path, "  - spin: s\n    rate_deg_per_s: -50\n    revolutions: 2\n    uncertainty_ppm: 30\n"
    )
    assert isinstance(spin, SpinStep)
    assert spin.duration == pytest.approx(14.4, rel=1e-15)
    assert spin.rate == -50 * DEGREE
    assert (spin.axis_b, spin.sigma, spin.ramp) == (None, 30 * 1e-6, 2.0)
    other = step_of(
        tmp_path, "  - spin:\n    axis: -y\n    rate_deg_per_s: 50\n    seconds: 20\n    ramp_s: 0\n"
    )
    assert isinstance(other, SpinStep)
    assert (other.duration, other.ramp) == (20.0, 0.0)
    assert other.axis_b.tolist() == [0.0, -1.0, 0.0]
    # A table that stopped early shows less than rate times duration, and is believed.
    shown = "    angle_deg: -1234.5\n    angle_uncertainty_arcsec: 3.6\n"
    up = step_of(tmp_path, "  - spin:\n    axis: up\n    rate_deg_per_s: -10\n    seconds: 178\n" + shown)
    assert isinstance(up, SpinStep)
    assert (up.axis_b, up.angle) == (None, -1234.5 * DEGREE)
    assert up.angle_sigma == pytest.approx(0.001 * DEGREE, rel=1e-15)
    assert (other.angle, other.angle_sigma) == (None, 0.0)


def test_words_that_yaml_takes_for_something_else_are_words(tmp_path):
    protocol = read(
        tmp_path, f"{HEAD}{SITE}name: yes\nunits: 1.0\nsteps:\n  - hold: 010\n    up: y\n    seconds: 1_0\n"
    )
    assert (protocol.name, protocol.units, protocol.steps[0].name) == ("yes", "1.0", "010")


PLACE = Site.from_latitude(np.radians(48.1), 520.0)


def test_a_file_reads_like_the_hand_of_a_person():
    edge = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    steps = (
        HoldStep(30.0, Pose(-X, 45.0 * DEGREE, 0.5 * DEGREE), "x down"),
        TurnStep(3.0, edge, -1.5 * np.pi, 0.1 * DEGREE),
        HoldStep(30.0, None, "#2: on its side", file="b.csv", interval=(1.0, 31.0)),
        SpinStep(4.0 * np.pi / (50.0 * DEGREE), 50.0 * DEGREE),
        TurnStep(9.0, X, 5.0 * np.pi),
    )
    text = protocol_to_yaml(Protocol("p", "multi-position", steps, PLACE)).partition("steps:\n")[2]
    parts = [
        [line.strip(" -") for line in part.splitlines()] for part in re.split(r"^  - ", text, flags=re.M)
    ]
    assert parts[1:] == [
        ["hold: x down", "up: -x", "heading_deg: 45", "uncertainty_deg: 0.5", "seconds: 30"],
        ["turn:", "axis: [1, 0, -1]", "angle_deg: -270", "uncertainty_deg: 0.1", "seconds: 3"],
        ["hold: '#2: on its side'", "seconds: 30", "file: b.csv", "interval_s: [1, 31]"],
        ["spin:", "axis: up", "rate_deg_per_s: 50", "revolutions: 2", "ramp_s: 2"],
        ["turn:", "axis: x", "revolutions: 2.5", "uncertainty_deg: 0", "seconds: 9"],
    ]


def test_the_file_explains_itself_and_says_its_conventions():
    text = protocol_to_yaml(replace(named_protocol("six-position"), site=PLACE))
    head, _, body = text.partition("format: tumble protocol\n")
    assert all(line.startswith("#") for line in head.splitlines())
    assert "docs/protocols.md" in head
    assert "site:\n  latitude_deg: 48.1\n  height_m: 520\n" in body
    assert "counter-clockwise for someone whom the axis points at" in body
    assert "north, east, down" in body
    table = protocol_to_yaml(replace(named_protocol("rate-table"), site=PLACE))
    assert "rate_deg_per_s: -200\n    revolutions: 10\n" in table
    assert max(map(len, table.partition("steps:")[2].splitlines())) < 50


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (HoldStep(0.0), "'p' cannot be a file, step 1: `seconds` is 0: it has to be more than 0."),
        (HoldStep(float("nan"), None, "h"), r"step 1 \(h\): `seconds` is nan: a finite number is needed."),
        (HoldStep(1.0, Pose(2.0 * X)), r"\[2.0, 0.0, 0.0\] has the length 2: divide it by that."),
        (HoldStep(1.0, Pose(X, None, -1.0)), "`uncertainty_deg` is -57.29"),
        (SpinStep(1.0, 1.0), "a spin without a hold before it"),
    ],
)
def test_what_cannot_be_read_is_not_written(step, said, tmp_path):
    with pytest.raises(ProtocolError, match=said):
        write_protocol(Protocol("p", "multi-position", (step,), PLACE), tmp_path / "p.yaml")
    with pytest.raises(ProtocolError, match="The protocol 'six-position' cannot be a file: it has no site"):
        write_protocol(named_protocol("six-position"), tmp_path / "p.yaml")
    assert not list(tmp_path.iterdir())
