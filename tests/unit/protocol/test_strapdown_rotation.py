"""The sequences of the strapdown rotation test as steps of a protocol, and found again in one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.protocol import (
    HoldStep,
    Pose,
    Protocol,
    TurnStep,
    named_protocol,
    read_protocol,
    sequence_steps,
    write_protocol,
)
from tumble.protocol.consistency import refuse_contradicting_turns
from tumble.protocol.strapdown_rotation import SEQUENCES, fixture_rotation, start_down

NAMES = [row.name for row in SEQUENCES]
X, Y, Z = np.eye(3)


def renamed(protocol: Protocol, number: int, **changes: object) -> Protocol:
    steps = list(protocol.steps)
    steps[number] = replace(steps[number], **changes)  # type: ignore[arg-type]
    return replace(protocol, steps=tuple(steps))


def test_every_row_starts_as_table_1_says_which_axis_is_down_and_which_along_the_outer_axis() -> None:
    starts = "zy zx xy zy zx xy zy zx xy yx zx xy yx zy xy zy zx"
    for row, (down, along) in zip(SEQUENCES, starts.split(), strict=True):
        C_tb = fixture_rotation(row.inner, row.outer).as_matrix()
        # 1e-15: rounding of sines and cosines
        np.testing.assert_allclose(C_tb[:, "xyz".index(down)], Z, atol=1e-15)
        np.testing.assert_allclose(C_tb[:, "xyz".index(along)], Y, atol=1e-15)
        np.testing.assert_allclose(start_down(row), np.eye(3)["xyz".index(down)], atol=1e-15)


def test_the_poses_are_those_of_the_fixture_whose_outer_axis_points_east() -> None:
    holds = [s for s in named_protocol("strapdown-rotation").steps if isinstance(s, HoldStep)]
    assert len(holds) == 34
    for row, *pair in zip(SEQUENCES, holds[::2], holds[1::2], strict=True):
        for hold, at in zip(pair, (0, -1), strict=True):
            assert hold.pose is not None
            C_nb = hold.pose.rotation_nb()
            C_tb = fixture_rotation(*row.fixture_angles()[at])
            outer_n = (C_nb * C_tb.inv()).apply(Y)
            # 1e-12: rounding of a heading
            np.testing.assert_allclose(outer_n, [0.0, 1.0, 0.0], atol=1e-12)


def test_the_sequences_are_found_again_by_name_also_from_a_file(tmp_path: Path) -> None:
    protocol = replace(named_protocol("strapdown-rotation"), site=Site.from_latitude(0.8))
    refuse_contradicting_turns(protocol)
    write_protocol(protocol, tmp_path / "p.yaml")
    for read in (protocol, read_protocol(tmp_path / "p.yaml")):
        found = sequence_steps(read)
        assert [sequence.name for sequence in found] == NAMES
        for sequence, row in zip(found, SEQUENCES, strict=True):
            assert read.steps[sequence.start].name == f"{row.name} start"
            assert read.steps[sequence.end].name == f"{row.name} end"
            assert len(sequence.turns) == len(row.rotations)
    assert protocol.steps[1].name == "1: +360 y"
    assert protocol.steps[1].duration == pytest.approx(2.0 * np.pi + 0.5)


def test_a_row_is_known_by_what_is_done_and_not_by_its_name() -> None:
    protocol = named_protocol("strapdown-rotation")
    assert sequence_steps(renamed(protocol, 0, name="first"))[0].name == "1"
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


def test_an_own_sequence_is_never_taken_for_a_row_because_of_its_name() -> None:
    up = HoldStep(5.0, Pose(Z), "7")
    turn = TurnStep(3.0, X, 1.0)
    own = Protocol("own", "strapdown-rotation", (up, turn, HoldStep(5.0)))
    assert [sequence.name for sequence in sequence_steps(own)] == ["own 7"]
    nameless = replace(own, steps=(HoldStep(5.0), turn, HoldStep(5.0)))
    assert [sequence.name for sequence in sequence_steps(nameless)] == ["step 1"]


def test_a_hold_may_end_one_sequence_and_start_the_next_and_a_turn_anyhow_makes_none() -> None:
    rest, turn, anyhow = HoldStep(5.0, None, "r"), TurnStep(3.0, X, 1.0), TurnStep(3.0)
    steps = (rest, turn, turn, rest, turn, rest, anyhow, rest, rest, turn, anyhow, rest, turn)
    found = sequence_steps(Protocol("own", "strapdown-rotation", steps))
    assert [sequence[1:] for sequence in found] == [(0, (1, 2), 3), (3, (4,), 5)]
