"""Which holds and spins belong to one placement on the table."""

from __future__ import annotations

import numpy as np

from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.segmentation.matching import MatchedHold, MatchedSpin, Matching
from tumble_papers.spin_groups import group_spins

X_UP, Y_UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def matched(protocol: Protocol, *missing: int) -> Matching:
    """Everything found in order, but for the steps named."""
    found = [k for k in range(len(protocol.steps)) if k not in missing]
    holds = [k for k in found if isinstance(protocol.steps[k], HoldStep)]
    spins = [k for k in found if isinstance(protocol.steps[k], SpinStep)]
    return Matching(
        tuple(MatchedHold(step, hold) for hold, step in enumerate(holds)),
        tuple(MatchedSpin(step, 10 * row, 10 * row + 5) for row, step in enumerate(spins)),
        missing,
        (),
    )


def test_a_turn_begins_a_placement_and_a_rest_between_spins_does_not() -> None:
    hold, spin = HoldStep(5.0, Pose(X_UP), "x up"), SpinStep(9.0, 0.5)
    other = HoldStep(5.0, Pose(Y_UP), "y up")
    protocol = Protocol("p", "rate-table", (hold, spin, hold, spin, TurnStep(2.0), other, spin))
    groups = group_spins(matched(protocol), protocol)
    assert [(group.name, group.holds, group.rows) for group in groups] == [
        ("x up", [0, 1], [0, 1]),
        ("y up", [2], [2]),
    ]


def test_a_hold_that_follows_a_hold_or_has_another_pose_begins_one_too() -> None:
    hold, spin = HoldStep(5.0, Pose(X_UP)), SpinStep(9.0, 0.5)
    protocol = Protocol("p", "rate-table", (hold, hold, spin, HoldStep(5.0, Pose(Y_UP)), spin))
    assert [(g.holds, g.rows) for g in group_spins(matched(protocol), protocol)] == [
        ([0], []),
        ([1], [0]),
        ([2], [1]),
    ]


def test_a_pose_that_differs_by_less_than_it_is_known_is_the_same() -> None:
    """A table about x that stopped within a revolution, its poses written to two digits and known to 5°."""
    spin, back = SpinStep(50.0, 0.4, axis_b=X_UP), SpinStep(50.0, -0.4, axis_b=X_UP)
    level, turned = ([0.0, 0.0, 1.0], [0.02, 0.17, 0.98])
    for sigma, placements in ((np.radians(5.0), 1), (np.radians(0.05), 3)):
        first, second = (
            HoldStep(9.0, Pose(np.array(up) / np.linalg.norm(up), None, sigma)) for up in (level, turned)
        )
        protocol = Protocol("p", "turntable", (first, spin, second, back, first))
        assert len(group_spins(matched(protocol), protocol)) == placements


def test_a_spin_that_was_not_found_leaves_the_rows_of_the_others_in_place() -> None:
    hold, spin, back = HoldStep(5.0), SpinStep(9.0, 0.5), SpinStep(9.0, -0.5)
    protocol = Protocol("p", "rate-table", (hold, spin, back, TurnStep(2.0), hold, spin, back))
    groups = group_spins(matched(protocol, 1), protocol)
    assert [group.rows for group in groups] == [[0], [1, 2]]
    assert [step.rate for step in groups[0].spins] == [-0.5]


def test_a_step_that_was_done_twice_is_there_twice() -> None:
    protocol = Protocol("p", "rate-table", (HoldStep(5.0), SpinStep(9.0, 0.5)))
    twice = Matching(
        (MatchedHold(0, 0), MatchedHold(0, 2)), (MatchedSpin(1, 0, 5), MatchedSpin(1, 9, 12)), (), ()
    )
    (group,) = group_spins(twice, protocol)
    assert (group.holds, group.rows, len(group.spins)) == ([0, 2], [0, 1], 2)
