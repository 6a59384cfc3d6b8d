"""Believed poses: which ones are, and what they do to attitudes and to the fixture's rotation."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.attitude.rotations import left_jacobian, matrix_from_rotation_vector
from tumble.calibration.equations.believed_poses import LEAST_SIGMA, BelievedPoses, believed_poses
from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe
from tumble.calibration.equations.pose_equations import Pose as PoseEquations
from tumble.calibration.equations.pose_equations import align_with_poses
from tumble.calibration.start import start_adjustment
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.segmentation.matching import MatchedHold, Matching


def test_left_jacobian_turns_a_change_of_the_vector_into_a_rotation() -> None:
    vector, change = np.array([0.7, -0.2, 0.4]), 1e-6 * np.array([0.3, 0.9, -0.5])
    after = matrix_from_rotation_vector(vector + change)
    expected = matrix_from_rotation_vector(left_jacobian(vector) @ change) @ matrix_from_rotation_vector(
        vector
    )
    # second order in 1e-6
    np.testing.assert_allclose(after, expected, atol=3e-12)


def test_sections_are_turned_to_believed_headings_and_the_fixture_is_found(
    play: Any, site: Any, model: Any
) -> None:
    u, fixture = imu_unknowns(unknowns_of(model)), np.array([0.03, -0.08, 0.05])
    task = start_adjustment(observe(play(noise=(1e-9, 1e-11), holds=4).data(), u), u, site)
    (section,) = task.sections
    C_nf = section.C_wb[:, 1] @ matrix_from_rotation_vector(fixture)
    task.data.poses = BelievedPoses(np.arange(4), -C_nf[:, 2], C_nf, np.ones(4, dtype=bool), np.full(4, 1e-3))
    section.C_wb = matrix_from_rotation_vector(np.array([0.0, 0.0, 2.2])) @ section.C_wb
    align_with_poses(task)
    (linear,) = PoseEquations(task.data.poses, np.arange(4), section).linearise(task)
    # The fixture's rotation starts a little pulled towards none: it is a start value.
    assert np.max(np.abs(linear.residual)) < 4e-3
    np.testing.assert_allclose(task.unknowns["fixture"], fixture, atol=4e-3)


def test_a_unit_that_stays_on_its_table_is_placed_once_and_loose_poses_tell_nothing() -> None:
    up, sigma = np.array([0.0, 0.0, 1.0]), 0.001
    pose = Pose(up, None, sigma)
    steps = (
        HoldStep(5.0, pose),
        SpinStep(5.0, 1.0),
        HoldStep(5.0, pose),
        TurnStep(2.0),
        HoldStep(5.0, Pose(np.array([1.0, 0.0, 0.0]), 0.5, 0.0)),
        TurnStep(2.0),
        HoldStep(5.0, Pose(np.array([0.0, 1.0, 0.0]), None, 0.2)),
        TurnStep(2.0),
        HoldStep(5.0),
    )
    holds = tuple(MatchedHold(step, hold) for hold, step in enumerate((0, 2, 4, 6, 8)))
    poses = believed_poses(Protocol("mine", "joint", steps), Matching(holds, (), (), ()))
    assert poses.hold.tolist() == [0, 2]
    assert poses.has_heading.tolist() == [False, True]
    np.testing.assert_allclose(poses.sigma, [sigma, LEAST_SIGMA])
    np.testing.assert_allclose(poses.C_nf[1].T @ [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], atol=1e-12)
