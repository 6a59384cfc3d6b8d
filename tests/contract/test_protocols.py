"""What every named protocol owes to those who play, match and evaluate it, run on each."""

from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tumble.earth import Site
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Protocol,
    SoakStep,
    SpinStep,
    TurnStep,
    named_protocol,
    read_protocol,
    write_protocol,
)

SITE = Site.from_latitude(np.radians(48.1), 520.0)

# How many of the nine unknowns of a triad (three biases, three scale factors, three non-orthogonalities)
# the norm of gravity in the protocol's poses tells; docs/protocols.md claims these.
OBSERVABLE = {
    "six-position": 6,
    "multi-position-26": 9,
    "multi-position-18": 9,
    "multi-position-10": 8,
    "multi-position-9": 9,
    "rate-table": 6,
    "modified-multi-position": 9,
    "turntable-9": 9,
    "turntable-18": 9,
    "laboratory": 6,
    "strapdown-rotation": 6,
    "thermal-soak": 9,
    "thermal-ramp": 1,
    "thermal-ramp-tumbled": 1,
    "thermal-fridge": 2,
    "hand-held": 9,
}


def same(one: Any, other: Any) -> bool:
    if is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one)
        )
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


def norm_design(vectors: np.ndarray) -> np.ndarray:
    """Derivatives of the norm by the nine unknowns of a triad near the ideal one, one row a vector."""
    x, y, z = vectors.T
    return np.column_stack((x, y, z, x * x, y * y, z * z, x * y, x * z, y * z))


def rank(design: np.ndarray) -> int:
    """1e-9: entries are of order one; what is zero is so to rounding."""
    return int(np.linalg.matrix_rank(design, tol=1e-9))


@pytest.fixture(params=PROTOCOLS)
def protocol(request: pytest.FixtureRequest) -> Protocol:
    return named_protocol(request.param)


def ups(protocol: Protocol) -> np.ndarray:
    return np.array([s.pose.up_b for s in protocol.steps if isinstance(s, HoldStep) and s.pose])


def spun(protocol: Protocol) -> np.ndarray:
    """Rate of each spin as a vector in b, of the length 1 at the fastest."""
    up, rates = np.zeros(3), []
    for step in protocol.steps:
        if isinstance(step, HoldStep) and step.pose:
            up = step.pose.up_b
        elif isinstance(step, SpinStep):
            rates.append(step.rate * up)
    return np.array(rates) / np.max(np.abs(rates))


def is_rotation(step: Any) -> bool:
    return isinstance(step, TurnStep) and step.axis_b is not None and step.angle is not None


def test_it_says_what_it_is_for_and_nobody_where_it_is_performed_or_recorded(protocol: Protocol) -> None:
    assert protocol.procedure in KNOWN_PROCEDURES
    assert protocol.description == PROTOCOLS[protocol.name]
    assert protocol.description.endswith(".")
    assert (protocol.site, protocol.recordings) == (None, ())
    assert all(step.file is None and step.interval is None for step in protocol.steps)


def test_its_steps_can_be_performed(protocol: Protocol) -> None:
    steps = protocol.steps
    if protocol.procedure == "thermal":
        # A working day; the unit rests while its surroundings change, so that these stand beside holds.
        assert 3600.0 < protocol.duration < 8.0 * 3600.0
        assert any(isinstance(step, SoakStep) for step in steps)
        return
    assert isinstance(steps[0], HoldStep)
    assert isinstance(steps[-1], HoldStep)
    assert all(0.0 < step.duration < 3600.0 for step in steps)
    assert 60.0 < protocol.duration < 5400.0
    for step, after in pairwise(steps):
        rotations = is_rotation(step) and is_rotation(after)
        assert rotations or HoldStep in (type(step), type(after)), "two motions without a rest"
        assert rotations or type(step) is not type(after), "two holds without a turn between"


def test_its_poses_are_directions_and_change_only_by_turns(protocol: Protocol) -> None:
    np.testing.assert_allclose(np.linalg.norm(ups(protocol), axis=1), 1.0, rtol=0.0, atol=1e-15)
    before, moved = None, None
    for step in protocol.steps:
        if not isinstance(step, HoldStep):
            moved = step
            continue
        assert step.pose.sigma > 0.0
        assert step.name
        if before is not None and not is_rotation(moved):  # rotations may come back to where they began
            assert ((*step.pose.up_b, step.pose.heading) == before) == isinstance(moved, SpinStep)
        before = (*step.pose.up_b, step.pose.heading)


def test_its_spins_go_both_ways_alike_in_whole_revolutions(protocol: Protocol) -> None:
    spins = [step for step in protocol.steps if isinstance(step, SpinStep)]
    turned = np.array([spin.rate * spin.duration if spin.angle is None else spin.angle for spin in spins])
    turned /= 2.0 * np.pi
    # 1e-9: rounding of the product and the quotient.
    np.testing.assert_allclose(turned, np.round(turned), rtol=1e-9, atol=0.0)
    assert sum(spin.rate for spin in spins) == pytest.approx(0.0, abs=1e-12)
    assert all(abs(spin.rate) * spin.ramp > 0.0 for spin in spins)
    for spin in spins:
        if spin.angle is not None:
            # A ramp turns half of what it does at the full rate. 1e-12: rounding.
            assert spin.angle == pytest.approx(spin.rate * (spin.duration + spin.ramp), rel=1e-12)


def test_its_file_reads_back_and_one_may_name_it_and_give_the_site_alone(protocol, tmp_path) -> None:
    placed, path = replace(protocol, site=SITE), tmp_path / "p.yaml"
    write_protocol(placed, path)
    assert same(read_protocol(path), placed)
    site = "site: {latitude_deg: 48.1, height_m: 520}"
    path.write_text(f"format: tumble protocol\nlike: {protocol.name}\n{site}\n", encoding="utf-8")
    assert same(read_protocol(path), placed)


def test_its_poses_tell_as_many_unknowns_of_the_accelerometers_as_is_claimed(protocol: Protocol) -> None:
    assert rank(norm_design(ups(protocol))) == OBSERVABLE[protocol.name]
    assert list(OBSERVABLE) == list(PROTOCOLS)


def test_ten_poses_miss_one_non_orthogonality_and_nine_leave_nothing_over_as_they_say() -> None:
    missed = np.flatnonzero(~norm_design(ups(named_protocol("multi-position-10"))).any(axis=0))
    assert missed.tolist() == [8]  # the product of y and z
    assert "y and z is not seen" in PROTOCOLS["multi-position-10"]
    assert norm_design(ups(named_protocol("multi-position-9"))).shape == (9, 9)
    assert "nothing checks the result" in PROTOCOLS["multi-position-9"]


def test_the_single_axis_table_tells_nine_unknowns_of_the_gyros() -> None:
    assert rank(norm_design(spun(named_protocol("modified-multi-position")))) == 9


def test_the_rate_table_tells_bias_matrix_and_asymmetry_of_every_gyro() -> None:
    """One gyro reads m·rate + bias + asymmetry times what it turns without sign: five unknowns in a row."""
    rates = spun(named_protocol("rate-table"))
    for axis in range(3):
        assert rank(np.column_stack((rates, np.ones(len(rates)), np.abs(rates[:, axis])))) == 5


@pytest.mark.parametrize("name", ["turntable-9", "turntable-18"])
def test_the_turntables_axes_lie_level_and_tell_six_unknowns_of_the_gyros(name: str) -> None:
    """Matrices only, without the bias, which the rotations both ways take out."""
    axes, up = [], np.zeros(3)
    for step in named_protocol(name).steps:
        if isinstance(step, HoldStep) and step.pose:
            up = step.pose.up_b
        elif isinstance(step, SpinStep):
            assert abs(step.axis_b @ up) < 1e-15
            axes.append(step.axis_b)
    assert rank(norm_design(np.array(axes))[:, 3:]) == 6


def test_the_laboratory_has_each_axis_up_and_down_with_the_next_one_at_four_headings() -> None:
    seen = set()
    for step in named_protocol("laboratory").steps:
        if isinstance(step, HoldStep) and step.duration == 100.0:
            C_nb = np.round(step.pose.rotation_nb().as_matrix(), 9)
            axis = int(np.flatnonzero(C_nb[2])[0])
            north, east, _ = C_nb[:, (axis + 1) % 3]
            heading = {(1, 0): "north", (0, -1): "west", (-1, 0): "south", (0, 1): "east"}[north, east]
            way = "up" if C_nb[2, axis] < 0 else "down"
            assert step.name == f"{'xyz'[axis]} {way}, {'xyz'[(axis + 1) % 3]} {heading}"
            seen.add(step.name)
    assert len(seen) == 24
