"""A protocol whose turns do not lead to its poses is refused before anything is recorded or read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.errors import ProtocolError
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    Step,
    TurnStep,
    named_protocol,
    write_protocol,
)
from tumble.protocol.consistency import refuse_contradicting_turns
from tumble.workflows.calibrate import calibrate

X, Y, Z = np.eye(3)


def check(*steps: Step) -> None:
    refuse_contradicting_turns(Protocol("mine", "multi-position", steps))


def hold(up_b: np.ndarray | None, heading: float | None = None, sigma: float = 0.0) -> HoldStep:
    return HoldStep(5.0, None if up_b is None else Pose(up_b, heading, sigma))


def turn(axis_b: np.ndarray, degrees: float, sigma: float = 0.0) -> TurnStep:
    return TurnStep(3.0, axis_b, np.radians(degrees), sigma)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_named_protocols_do_not_contradict_themselves(name: str) -> None:
    refuse_contradicting_turns(named_protocol(name))


def test_a_turn_that_leads_elsewhere_is_named_with_its_hold() -> None:
    # b turns by +90 degrees about x, so that what is up in b goes from z to y.
    check(hold(Z), turn(X, 90.0), hold(Y))
    with pytest.raises(
        ProtocolError, match=r"mine contradicts itself: step 3 is .* 180.0 .* of step 2 leads"
    ):
        check(hold(Z), turn(X, -90.0), hold(Y))
    with pytest.raises(ProtocolError, match=r"step 5 is a hold .* turns of steps 2, 4 lead"):
        check(hold(Z), turn(X, 45.0), hold(None), turn(X, 45.0), hold(-Y))


def test_headings_are_compared_only_where_both_are_known() -> None:
    check(hold(Z), turn(Z, 90.0), hold(Z, 0.3))
    east = Rotation.from_rotvec([0.0, 0.0, 0.7]) * Pose(Z, 0.0).rotation_nb()
    ends = Pose.from_matrix((east * Rotation.from_rotvec([0.0, 0.0, 1.0])).as_matrix())
    check(HoldStep(5.0, Pose.from_matrix(east.as_matrix())), TurnStep(3.0, Z, 1.0), HoldStep(5.0, ends))
    with pytest.raises(ProtocolError, match="step 3"):
        check(HoldStep(5.0, Pose.from_matrix(east.as_matrix())), TurnStep(3.0, Z, -1.0), HoldStep(5.0, ends))


def test_a_heading_stays_known_over_a_hold_that_does_not_state_it() -> None:
    check(hold(Z, 0.0), turn(Z, 90.0), hold(Z), turn(Z, -90.0), hold(Z, 0.0))
    with pytest.raises(ProtocolError, match="step 5"):
        check(hold(Z, 0.0), turn(Z, 90.0), hold(Z), turn(Z, 90.0), hold(Z, 0.0))


def test_what_uncertainties_explain_is_no_contradiction() -> None:
    # 2 degrees off, and 5 sigma of half a degree are 2.5; of a third of a degree 1.7.
    check(hold(Z), turn(X, 88.0, np.radians(0.5)), hold(Y))
    with pytest.raises(ProtocolError, match="step 3"):
        check(hold(Z), turn(X, 88.0, np.radians(1.0 / 3.0)), hold(Y))


def test_where_nobody_knows_how_the_unit_was_moved_nothing_is_compared() -> None:
    check(hold(Z), turn(X, -90.0), hold(None), hold(Y))
    check(hold(Z), TurnStep(3.0), hold(Y))
    check(hold(Z), SpinStep(10.0, 0.5, X), turn(X, -90.0), hold(Y))
    check(hold(Z), TurnStep(3.0), turn(X, -90.0), hold(Y))


def test_calibrate_blames_the_protocol_before_it_reads_a_recording(tmp_path: Path) -> None:
    from tumble.earth import Site

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
