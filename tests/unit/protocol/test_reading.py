"""What a protocol file says is what the steps hold: frames, signs, units and what holds without a key."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.earth import Site
from tumble.errors import ProtocolError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol, read_protocol

HEAD = "format: tumble protocol\nprocedure: multi-position\n"
SITE = "gravity: 9.81\n"
HOLD = "  - hold: rest\n    seconds: 9\n"
DEGREE = np.pi / 180.0
EXACT = 1e-12  # arithmetic: sines and cosines of round angles


def read(folder: Path, content: str) -> Protocol:
    path = folder / "test of the plate.yaml"
    path.write_text(content, encoding="utf-8")
    return read_protocol(path)


def step_of(folder: Path, lines: str) -> Step:
    """The last step of a protocol that has a hold before it."""
    return read(folder, f"{HEAD}{SITE}steps:\n{HOLD}{lines}").steps[-1]


def pose_of(folder: Path, lines: str) -> Pose:
    step = step_of(folder, f"  - hold: h\n    seconds: 1\n    {lines}\n")
    assert isinstance(step, HoldStep)
    assert step.pose is not None
    return step.pose


def test_only_what_is_needed_has_to_be_written(tmp_path: Path) -> None:
    protocol = read(tmp_path, f"{HEAD}{SITE}steps:\n{HOLD}")
    assert protocol.name == "test of the plate"
    assert protocol.procedure == "multi-position"
    assert protocol.site == Site.from_gravity(9.81)
    assert protocol.steps == (HoldStep(9.0, None, "rest"),)
    assert (protocol.description, protocol.recordings) == ("", ())
    assert (protocol.units, protocol.columns, protocol.rate) == (None, None, None)


def test_what_else_the_file_says_of_the_recordings(tmp_path: Path) -> None:
    protocol = read(
        tmp_path,
        f"{HEAD}{SITE}version: 1\ndescription: as told\nrecordings: [b.csv, a.csv]\nunits: g,deg/s\n"
        f"columns: ax,ay,az\nrate_hz: 12.5\nsteps:\n{HOLD}",
    )
    assert protocol.recordings == ("b.csv", "a.csv")
    assert (protocol.units, protocol.columns, protocol.rate) == ("g,deg/s", "ax,ay,az", 12.5)
    assert protocol.description == "as told"


def test_steps_of_a_named_protocol_need_only_a_site(tmp_path: Path) -> None:
    protocol = read(tmp_path, "format: tumble protocol\nlike: six-position\nsite: {latitude_deg: -33.9}\n")
    named = named_protocol("six-position")
    assert (protocol.name, protocol.procedure) == ("six-position", "six-position")
    assert [step.name for step in protocol.steps] == [step.name for step in named.steps]
    assert protocol.site == Site.from_latitude(-33.9 * DEGREE)


def test_a_named_protocol_may_be_evaluated_by_another_procedure(tmp_path: Path) -> None:
    content = f"format: tumble protocol\nlike: six-position\nprocedure: improved-six-position\n{SITE}"
    assert read(tmp_path, content).procedure == "improved-six-position"


def test_gravity_given_beside_a_latitude_is_believed_to_its_digits_unless_it_says_how_well(
    tmp_path: Path,
) -> None:
    place = "site:\n  latitude_deg: 48\n  height_m: 520\n  gravity: 9.8073\n"
    site = read(tmp_path, f"{HEAD}{place}steps:\n{HOLD}").site
    assert site is not None
    assert (site.gravity, site.height) == (9.8073, 520.0)
    assert site.gravity_sigma == pytest.approx(0.00005 / 3**0.5)
    assert site.latitude == 48 * DEGREE
    more = read(tmp_path, f"{HEAD}{place}  gravity_uncertainty: 2e-5\n  source: a tie\nsteps:\n{HOLD}").site
    assert more is not None
    assert (more.gravity_sigma, more.source) == (2e-5, "a tie")


def test_gravity_that_is_not_that_of_the_latitude_is_refused_with_its_line(tmp_path: Path) -> None:
    """9.85 m/s² at 48° would be a disturbance of 42 mm/s²; the largest on land are 3 to 4 mm/s²."""
    place = "site:\n  latitude_deg: 48\n  height_m: 520\n  gravity: 9.85\n"
    with pytest.raises(ProtocolError, match=r"9\.85 m/s² contradicts the latitude 48° .* it is 9\.80"):
        read(tmp_path, f"{HEAD}{place}steps:\n{HOLD}")


def test_a_byte_order_mark_windows_lines_and_json_do_not_matter(tmp_path: Path) -> None:
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
def test_a_direction_is_an_axis_or_a_vector_of_any_length(
    word: str, vector: list[float], tmp_path: Path
) -> None:
    np.testing.assert_allclose(pose_of(tmp_path, f"up: {word}").up_b, vector, rtol=0.0, atol=1e-16)
    turn = step_of(tmp_path, f"  - turn:\n    axis: {word}\n    seconds: 1\n")
    assert isinstance(turn, TurnStep)
    assert turn.axis_b is not None
    np.testing.assert_allclose(turn.axis_b, vector, rtol=0.0, atol=1e-16)


def test_a_pose_s_heading_and_uncertainty_are_degrees_and_unknown_or_exact_without(tmp_path: Path) -> None:
    pose = pose_of(tmp_path, "up: x\n    heading_deg: -90\n    uncertainty_deg: 0.5")
    assert pose.heading == -np.pi / 2
    assert pose.sigma == 0.5 * DEGREE
    bare = pose_of(tmp_path, "up: x")
    assert (bare.heading, bare.sigma) == (None, 0.0)


@pytest.mark.parametrize(
    ("attitude", "up_b", "x_n"),
    [
        # Level and north: z is down, so that -z is up.
        ("[0, 0, 0]", [0, 0, -1], [1, 0, 0]),
        # Heading 90: x points east.
        ("[0, 0, 90]", [0, 0, -1], [0, 1, 0]),
        # Nose up by 30: x is half up.
        ("[0, 30, 0]", [0.5, 0, -(0.75**0.5)], [0.75**0.5, 0, -0.5]),
        # Right side down by 30: y points half down, so that -y is half up.
        ("[30, 0, 0]", [0, -0.5, -(0.75**0.5)], [1, 0, 0]),
        # The order: heading last about the vertical, roll first about x.
        ("[90, 0, 90]", [0, -1, 0], [0, 1, 0]),
    ],
)
def test_an_attitude_is_roll_pitch_heading_as_aircraft_have_it(
    attitude: str, up_b: list[float], x_n: list[float], tmp_path: Path
) -> None:
    pose = pose_of(tmp_path, f"attitude_deg: {attitude}")
    np.testing.assert_allclose(pose.up_b, up_b, rtol=0.0, atol=EXACT)
    assert pose.heading is not None
    np.testing.assert_allclose(pose.rotation_nb().apply([1.0, 0.0, 0.0]), x_n, rtol=0.0, atol=EXACT)


@pytest.mark.parametrize(
    ("lines", "x_n"),
    [
        # z down and level: the shortest turn of -z up is none, and x points north; then clockwise to the east.
        ("up: -z\n    heading_deg: 0", [1, 0, 0]),
        ("up: -z\n    heading_deg: 90", [0, 1, 0]),
        # z up is half a turn about the north axis: x stays north.
        ("up: z\n    heading_deg: 0", [1, 0, 0]),
        ("up: z\n    heading_deg: 90", [0, 1, 0]),
        # y up: the shortest turn is about x, which stays north; clockwise by 90 it is east.
        ("up: y\n    heading_deg: 90", [0, 1, 0]),
    ],
)
def test_a_heading_is_clockwise_from_the_shortest_turn(lines: str, x_n: list[float], tmp_path: Path) -> None:
    rotation_nb = pose_of(tmp_path, lines).rotation_nb()
    np.testing.assert_allclose(rotation_nb.apply([1.0, 0.0, 0.0]), x_n, rtol=0.0, atol=EXACT)


def test_a_turn_s_angle_is_degrees_or_revolutions_of_any_size(tmp_path: Path) -> None:
    turn = step_of(
        tmp_path, "  - turn: a\n    axis: z\n    angle_deg: -90\n    uncertainty_deg: 0.1\n    seconds: 2\n"
    )
    assert isinstance(turn, TurnStep)
    assert (turn.angle, turn.sigma) == (-np.pi / 2, 0.1 * DEGREE)
    more = step_of(tmp_path, "  - turn:\n    axis: z\n    revolutions: -2.5\n    seconds: 2\n")
    assert isinstance(more, TurnStep)
    assert more.angle == -5.0 * np.pi


def test_a_turn_of_which_nothing_is_known_is_a_turn(tmp_path: Path) -> None:
    assert step_of(tmp_path, "  - turn:\n    seconds: 2\n") == TurnStep(2.0)


def test_a_spin_s_length_is_seconds_or_revolutions_and_its_axis_is_vertical(tmp_path: Path) -> None:
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
    assert other.axis_b is not None
    assert other.axis_b.tolist() == [0.0, -1.0, 0.0]
    up = step_of(tmp_path, "  - spin:\n    axis: up\n    rate_deg_per_s: 50\n    seconds: 20\n")
    assert isinstance(up, SpinStep)
    assert up.axis_b is None


def test_a_step_lasts_as_long_as_its_interval_unless_it_says(tmp_path: Path) -> None:
    step = step_of(tmp_path, "  - hold: h\n    interval_s: [12.5, 15]\n    file: a.csv\n")
    assert step == HoldStep(2.5, None, "h", file="a.csv", interval=(12.5, 15.0))


def test_words_that_yaml_takes_for_something_else_are_words(tmp_path: Path) -> None:
    protocol = read(
        tmp_path, f"{HEAD}{SITE}name: yes\nunits: 1.0\nsteps:\n  - hold: 010\n    up: y\n    seconds: 1_0\n"
    )
    assert (protocol.name, protocol.units, protocol.steps[0].name) == ("yes", "1.0", "010")


def test_the_angle_of_a_tables_display_is_any_number_of_turns_with_the_sign_of_the_rate(
    tmp_path: Path,
) -> None:
    """A table that stopped early shows less than rate times duration, and is believed."""
    path = tmp_path / "p.yaml"
    path.write_text(
        "format: tumble protocol\nprocedure: turntable\ngravity: 9.81\nsteps:\n"
        "  - hold:\n    seconds: 20\n"
        "  - spin:\n    axis: x\n    rate_deg_per_s: -10\n    seconds: 178\n"
        "    angle_deg: -1234.5\n    angle_uncertainty_arcsec: 3.6\n"
        "  - hold:\n    seconds: 20\n"
        "  - spin:\n    axis: x\n    rate_deg_per_s: 10\n    seconds: 178\n",
        encoding="utf-8",
    )
    _, read, _, unread = read_protocol(path).steps
    assert isinstance(read, SpinStep)
    assert isinstance(unread, SpinStep)
    assert read.angle == -1234.5 * (np.pi / 180.0)
    assert read.angle_sigma == pytest.approx(0.001 * np.pi / 180.0, rel=1e-15)
    assert (unread.angle, unread.angle_sigma) == (None, 0.0)
