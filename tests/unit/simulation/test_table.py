"""A table with errors: what it refuses, what it draws, and what simulated recordings say of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import ProtocolError, UsageError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, named_protocol
from tumble.simulation import TableErrors, play_protocol, simulate_protocol

SITE = Site.from_latitude(np.radians(38.0))
Z = np.array([0.0, 0.0, 1.0])
REST = HoldStep(3.0, Pose(Z, 0.0))


def protocol(*steps: Any) -> Protocol:
    return Protocol("t", "turntable", steps)


def test_a_spin_that_cannot_be_is_refused_in_words() -> None:
    rng = np.random.default_rng(1)
    small = SpinStep(1.0, 1.0, ramp=4.0, angle=3.0)
    with pytest.raises(ProtocolError, match=r"Step 2 turns by 171\.9 degrees, which its ramps alone exceed"):
        play_protocol(protocol(REST, small, REST), rng)
    wrong = SpinStep(9.0, 1.0, angle=-3.0, name="cw")
    with pytest.raises(ProtocolError, match=r"Step 2 \(cw\) shows an angle of -171\.887 degrees against"):
        play_protocol(protocol(REST, wrong, REST), rng)
    table = TableErrors(stops_early=((2, 0.5),))
    with pytest.raises(UsageError, match="stop spin 3 early, and the protocol's last one is number 1"):
        play_protocol(protocol(REST, SpinStep(9.0, 1.0), REST), rng, table=table)
    with pytest.raises(UsageError, match="the protocol has no spin"):
        play_protocol(protocol(REST), rng, table=table)


def test_a_spin_that_states_its_angle_turns_by_it_as_long_as_that_takes() -> None:
    angle = np.radians(-1234.5)
    spin = SpinStep(30.0, -0.5, angle=angle)
    played = play_protocol(protocol(REST, spin, HoldStep(3.0)), np.random.default_rng(1))
    (truth,) = played.spins
    assert (truth.angle, truth.shown, truth.rate) == (angle, angle, pytest.approx(-0.5, rel=1e-14))
    assert truth.stop - truth.start == pytest.approx(abs(angle) / 0.5 - 2.0, rel=1e-12)


def test_an_angle_s_own_uncertainty_is_made_with_the_placement_and_without_it_not() -> None:
    spin = SpinStep(10.0, 1.0, angle=12.0, angle_sigma=1e-3)
    steps = protocol(REST, *[spin, HoldStep(3.0)] * 200)
    off = [one.angle - 12.0 for one in play_protocol(steps, np.random.default_rng(1)).spins]
    # 200 numbers: 5 %, four of them
    assert np.std(off) == pytest.approx(1e-3, rel=0.2)
    assert play_protocol(steps, np.random.default_rng(1), placement=False).spins[0].angle == 12.0
    (read,) = play_protocol(steps, np.random.default_rng(1)).steps[1:2]
    assert isinstance(read, SpinStep)
    assert (read.angle, read.angle_sigma) == (12.0, 1e-3)


def test_without_a_table_nothing_else_is_drawn_and_nothing_is_read_off() -> None:
    given = named_protocol("modified-multi-position")
    plain = play_protocol(given, np.random.default_rng(4))
    perfect = play_protocol(given, np.random.default_rng(4), table=TableErrors())
    assert plain.steps == given.steps
    np.testing.assert_array_equal(plain.motion.turn_vector_b, perfect.motion.turn_vector_b)
    shown = [s.angle for s in perfect.steps if isinstance(s, SpinStep)]
    assert shown == [spin.angle for spin in perfect.spins]


@pytest.mark.parametrize("name", ["turntable-9", "laboratory"])
def test_the_table_s_protocols_are_played_from_rest_to_rest_in_whole_turns(name: str) -> None:
    given = named_protocol(name)
    played = play_protocol(given, np.random.default_rng(1), table=TableErrors(wobble=1e-4, ripple=1e-3))
    for spin in played.spins:
        assert abs(spin.shown) == pytest.approx(10.0 * np.pi)
        assert 1e-7 < abs(spin.angle - spin.shown) < 6e-5  # six of 2 arc-seconds
        assert spin.stop - spin.start == pytest.approx(178.0, abs=1e-3)
        level = abs(spin.axis_n[2])
        assert (level < 0.4) if name == "turntable-9" else (level > 0.999)
    attitudes = Rotation.from_quat(played.motion.hold_quaternions_nb)
    for k, move in enumerate(played.motion.turn_duration):
        if move > 100.0:
            # The table's errors are 2e-5 rad at most.
            assert (attitudes[k].inv() * attitudes[k + 1]).magnitude() < 1e-4


def test_gyro_samples_of_an_uneven_table_add_up_to_the_true_angle() -> None:
    still = Site.from_gravity(9.8)
    table = TableErrors(angle_sigma=1e-3, ripple=0.01, ramp_spread=0.2)
    spin = SpinStep(10.0, -1.0, np.array([3.0, 6.0, 2.0]) / 7.0)
    recording, truth = simulate_protocol(
        protocol(REST, spin, HoldStep(3.0)), 100.0, np.random.default_rng(1), site=still, table=table
    )
    assert recording.angular_rate is not None
    (was,) = truth.spins
    np.testing.assert_allclose(
        recording.angular_rate.sum(axis=0) / 100.0, was.angle * was.axis_b, rtol=0.0, atol=1e-11
    )
    assert was.angle < -11.0
    read = truth.steps[1]
    assert isinstance(read, SpinStep)
    assert read.angle == was.shown


def test_a_shaking_table_adds_noise_to_the_accelerometers_while_it_turns_and_only_then() -> None:
    still = Site.from_gravity(9.8)
    spin = SpinStep(40.0, 1.0, Z, angle=42.0)
    samples = []
    for table in (TableErrors(), TableErrors(shake=0.01)):
        recording, truth = simulate_protocol(
            protocol(REST, spin, HoldStep(3.0)), 100.0, np.random.default_rng(1), site=still, table=table
        )
        assert recording.specific_force is not None
        samples.append(recording.specific_force)
    added = samples[1] - samples[0]
    (was,) = truth.spins
    turning = (recording.time > was.start - 2.0) & (recording.time < was.stop + 2.0)
    assert np.array_equal(added[~turning], np.zeros((600, 3)))
    # 4400 numbers an axis: 1.1 %, four of them
    np.testing.assert_allclose(added[turning].std(axis=0), 0.01, rtol=0.045)
