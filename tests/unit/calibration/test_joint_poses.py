"""Believed poses: which ones are, and what they do to attitudes and to the fixture's rotation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tumble.calibration.joint.poses import align_with_poses, left_jacobian, pose_terms
from tumble.calibration.joint.terms import Extra, Section
from tumble.calibration.joint.wide import FIXTURE, WIDE

from tumble.attitude.rotations import matrices_from_rotation_vectors, matrix_from_rotation_vector
from tumble.calibration.equations.believed_poses import LEAST_SIGMA, BelievedPoses, believed_poses
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.segmentation.matching import MatchedHold, Matching


def _case(with_heading: bool) -> tuple[BelievedPoses, Section, np.ndarray]:
    rng = np.random.default_rng(11)
    attitudes = matrices_from_rotation_vectors(rng.normal(size=(4, 3)))
    unknowns = np.zeros(WIDE)
    unknowns[FIXTURE] = [0.03, -0.08, 0.05]
    C_bf = matrix_from_rotation_vector(unknowns[FIXTURE])
    off = matrices_from_rotation_vectors(0.02 * rng.normal(size=(4, 3)))
    C_nf = off @ attitudes @ C_bf
    up_f = -C_nf[:, 2]
    poses = BelievedPoses(
        np.arange(4), up_f, C_nf, np.full(4, with_heading), np.array([1e-3, 2e-3, 3e-3, 4e-3])
    )
    return poses, Section(0, 4, np.repeat(attitudes[:, None], 3, axis=1), np.zeros(3)), unknowns


@pytest.mark.parametrize("with_heading", [False, True])
def test_derivatives_of_poses_are_those_of_differences(with_heading: bool) -> None:
    poses, section, unknowns = _case(with_heading)
    (terms,) = pose_terms(poses, section, unknowns, Extra())
    step = 1e-6
    for axis in range(3):
        turn = np.zeros(3)
        turn[axis] = step
        moved = replace(section, C_wb=matrix_from_rotation_vector(turn) @ section.C_wb)
        (there,) = pose_terms(poses, moved, unknowns, Extra())
        # second order in 1e-6, over 1e-6
        np.testing.assert_allclose(
            (there.residual - terms.residual) / step, terms.by_node[:, :, 3 + axis], atol=2e-6
        )
        other = unknowns.copy()
        other[FIXTURE.start + axis] += step
        (there,) = pose_terms(poses, section, other, Extra())
        np.testing.assert_allclose(
            (there.residual - terms.residual) / step,
            terms.by_border[:, :, 3 + FIXTURE.start + axis],
            atol=2e-6,
        )


def test_left_jacobian_turns_a_change_of_the_vector_into_a_rotation() -> None:
    vector, change = np.array([0.7, -0.2, 0.4]), 1e-6 * np.array([0.3, 0.9, -0.5])
    after = matrix_from_rotation_vector(vector + change)
    expected = matrix_from_rotation_vector(left_jacobian(vector) @ change) @ matrix_from_rotation_vector(
        vector
    )
    # second order in 1e-6
    np.testing.assert_allclose(after, expected, atol=3e-12)


def test_sections_are_turned_to_believed_headings_and_the_fixture_is_found() -> None:
    poses, section, unknowns = _case(True)
    exact = replace(poses, C_nf=section.C_wb[:, 1] @ matrix_from_rotation_vector(unknowns[FIXTURE]))
    exact = replace(exact, up_f=-exact.C_nf[:, 2])
    section.C_wb = matrix_from_rotation_vector(np.array([0.0, 0.0, 2.2])) @ section.C_wb
    found = np.zeros(WIDE)
    align_with_poses(exact, [section], {}, found)
    (terms,) = pose_terms(exact, section, found, Extra())
    # The fixture's rotation starts a little pulled towards none: it is a start value.
    assert np.max(np.abs(terms.residual)) < 2e-3
    np.testing.assert_allclose(found[FIXTURE], unknowns[FIXTURE], atol=2e-3)


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
    assert poses is not None
    assert poses.hold.tolist() == [0, 2]
    assert poses.has_heading.tolist() == [False, True]
    np.testing.assert_allclose(poses.sigma, [sigma, LEAST_SIGMA])
    np.testing.assert_allclose(poses.C_nf[1].T @ [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], atol=1e-12)
