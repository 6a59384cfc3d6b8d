"""Motion: closed formulas against one another and against integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.simulation import Motion, poses_26
from tumble.simulation.motion import Detours
from tumble.simulation.spin_shapes import SpinShapes

SITE = Site.from_latitude(np.radians(-33.0))
STILL = Site.from_gravity(9.79)


@pytest.fixture
def motion() -> Motion:
    poses = poses_26(0.7)[[0, 9, 22, 4]]
    return replace(
        Motion.between_poses(poses, np.array([1.0, 2.0, 1.5, 1.0]), np.array([0.8, 1.2, 2.0])),
        lever_arm_b=np.array([0.1, -0.05, 0.2]),
        detours=Detours(
            np.array([1.0, 3.8, 6.5]),
            np.array([0.8, 1.2, 2.0]),
            np.array([[0.2, 0.0, -0.5], [0.0, 0.1, 0.3], [-0.2, 0.3, 0.0]]),
        ),
    )


def test_holds_and_turns_follow_one_another(motion: Motion) -> None:
    np.testing.assert_allclose(motion.hold_edges, [[0, 1], [1.8, 3.8], [5, 6.5], [8.5, 9.5]], rtol=1e-14)
    assert motion.duration == pytest.approx(9.5)


def test_increments_chain_to_the_attitude(motion: Motion) -> None:
    edges = np.linspace(0.0, motion.duration, 951)
    rate = motion.mean_angular_rate_ib_b(edges, STILL)
    attitude = motion.rotation_nb(edges[:1])[0]
    for step in Rotation.from_rotvec(rate * np.diff(edges)[:, None]):
        attitude = attitude * step
    end = motion.rotation_nb(edges[-1:])[0]
    # 950 products of rotations, each good to one unit in the last place
    assert (attitude.inv() * end).magnitude() < 1e-12


def test_the_instantaneous_rate_is_the_limit_of_the_increments(motion: Motion) -> None:
    time = np.array([0.4, 1.3, 2.3, 2.67, 4.6, 5.7, 7.77, 9.1])
    step = 1e-4
    for t, exact in zip(time, motion.angular_rate_ib_b(time, SITE), strict=True):
        mean = motion.mean_angular_rate_ib_b(np.array([t - step, t + step]), SITE)[0]
        # truncation: third derivative of the attitude (some 1e3 /s³ in a detour) times step²
        np.testing.assert_allclose(mean, exact, atol=3e-5)


def test_a_lever_arm_feels_the_centripetal_acceleration() -> None:
    """At the middle of a half turn of 1 s about z the rate is 1.875 π rad/s and changes not."""
    motion = Motion(
        Rotation.identity().as_quat(),
        np.array([1.0, 1.0]),
        np.array([1.0]),
        np.array([[0.0, 0.0, np.pi]]),
        np.array([0.2, 0.0, 0.0]),
    )
    force = motion.specific_force_b(np.array([1.5]), STILL)[0]
    np.testing.assert_allclose(force, [-((1.875 * np.pi) ** 2) * 0.2, 0.0, -9.79], atol=1e-12)


def test_acceleration_is_the_second_derivative_of_the_lever_arm_s_end(motion: Motion) -> None:
    calm = replace(motion, detours=None)
    h = 1e-4
    for t in (1.25, 4.3, 7.9):
        before, now, after = calm.rotation_nb(np.array([t - h, t, t + h])).apply(motion.lever_arm_b)
        acceleration = (before - 2 * now + after) / h**2
        expected = calm.rotation_nb(np.array([t])).inv().apply(acceleration - [0.0, 0.0, 9.79])
        # rounding: 1e-16 / h²; truncation: fourth derivative times h² / 12
        np.testing.assert_allclose(calm.specific_force_b(np.array([t]), STILL), expected, atol=1e-5)


def test_a_detour_s_rate_is_the_derivative_of_its_rotation_and_holds_are_free_of_it() -> None:
    detours = Detours(
        np.array([1.0, 5.0]), np.array([2.0, 0.5]), np.array([[0.1, -0.2, 0.05], [-0.03, 0.0, 0.2]])
    )
    time = np.array([1.3, 1.9, 2.6, 5.1, 5.33])
    difference = (detours.rotation(time + 1e-5) - detours.rotation(time - 1e-5)) / 2e-5
    # truncation: third derivative (8 π³/T³ times the swing) times 1e-10 / 6; rounding 1e-17 / 1e-5
    np.testing.assert_allclose(detours.rotation_rate(time), difference, atol=1e-8)
    np.testing.assert_allclose(detours.rotation(np.array([2.0]))[0], [0.1, -0.2, 0.05], rtol=1e-14)
    resting = np.array([0.0, 0.99, 3.0, 4.2, 5.5, 9.0])
    assert not detours.rotation(resting).any()
    assert not detours.rotation_rate(resting).any()


def test_half_a_turn_between_two_samples_is_refused() -> None:
    motion = Motion(
        Rotation.identity().as_quat(),
        np.array([1.0, 1.0]),
        np.array([4.0]),
        np.array([[0.0, 0.0, 20.0]]),
        np.zeros(3),
        spin_shapes=SpinShapes.even(np.array([0.5])),
    )
    motion.mean_angular_rate_ib_b(np.arange(0.0, 6.01, 0.5), STILL)
    with pytest.raises(UsageError, match="Between 2 s and 3 s the unit turns by 327 degrees"):
        motion.mean_angular_rate_ib_b(np.arange(0.0, 6.1, 1.0), STILL)
