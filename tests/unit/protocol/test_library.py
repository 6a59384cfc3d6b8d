"""The named protocols are the field's tests, as their papers describe them."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.earth.site import EARTH_RATE
from tumble.errors import ProtocolError
from tumble.protocol import HoldStep, SpinStep, TurnStep, named_protocol


def poses(name: str) -> np.ndarray:
    """The direction that is up in each placement, in order; a repeated one after a spin once."""
    ups = [step.pose.up_b for step in named_protocol(name).steps if isinstance(step, HoldStep) and step.pose]
    return np.array([up for k, up in enumerate(ups) if k == 0 or not np.array_equal(up, ups[k - 1])])


@pytest.mark.parametrize("count", [26, 18, 10])
def test_multi_position_takes_the_first_of_the_cube_s_directions(count: int) -> None:
    np.testing.assert_array_equal(poses(f"multi-position-{count}"), twenty_six_directions()[:count])


def test_six_position_has_each_axis_up_and_down_on_a_level() -> None:
    assert np.sum(poses("six-position"), axis=0).tolist() == [0.0, 0.0, 0.0]
    assert np.abs(poses("six-position")).sum(axis=0).tolist() == [2.0, 2.0, 2.0]
    sigmas = {
        s.pose.sigma for s in named_protocol("six-position").steps if isinstance(s, HoldStep) and s.pose
    }
    assert sigmas == {0.5 * np.pi / 180.0}


def test_multi_position_knows_its_poses_only_roughly_and_their_headings_not_at_all() -> None:
    holds = [s for s in named_protocol("multi-position-26").steps if isinstance(s, HoldStep) and s.pose]
    assert {(s.pose.sigma, s.pose.heading) for s in holds if s.pose} == {(5.0 * np.pi / 180.0, None)}
    turns = [s for s in named_protocol("hand-held").steps if isinstance(s, TurnStep)]
    assert len(turns) == 25
    assert all(turn.axis_b is None and turn.angle is None for turn in turns)


def test_the_rate_table_spins_every_face_both_ways_at_four_rates() -> None:
    spins = [s for s in named_protocol("rate-table").steps if isinstance(s, SpinStep)]
    rates = np.round(np.degrees([spin.rate for spin in spins]), 9)
    assert len(spins) == 6 * 8
    assert sorted(rates[:8].tolist()) == [-200.0, -100.0, -50.0, -10.0, 10.0, 50.0, 100.0, 200.0]


def test_the_single_axis_table_spins_at_ten_thousand_times_the_earth_s_rate_clockwise_first() -> None:
    spins = [s for s in named_protocol("modified-multi-position").steps if isinstance(s, SpinStep)]
    assert [spin.rate for spin in spins] == [-1e4 * EARTH_RATE, 1e4 * EARTH_RATE] * 12
    assert np.degrees(spins[1].rate) == pytest.approx(41.78, abs=5e-3)  # as Hayal (4.4.1) has it, rounded


@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("six-position", "x up"),
        ("multi-position-26", "edge +x+y up"),
        ("multi-position-26", "corner +x-y-z up"),
        ("modified-multi-position", "z down, 41.78°/s, clockwise"),
    ],
)
def test_steps_are_called_by_what_a_person_sees(name: str, called: str) -> None:
    assert called in [step.name for step in named_protocol(name).steps]


def test_an_unknown_name_is_answered_with_those_that_there_are() -> None:
    with pytest.raises(ProtocolError, match="There is no protocol 'six': choose one of six-position, multi-"):
        named_protocol("six")
