"""What believed poses add: attitudes of holds against the axes of a fixture.

The unit sits in its fixture somehow: a rotation C_bf from the fixture's axes to the sensors' frame b is unknown and the
same in all poses. A pose of known heading determines the attitude in full; the room's north is then the fixture's, and
the heading of a section of holds is no longer nobody's business. A pose without heading determines which way is up.
"""

from __future__ import annotations

import numpy as np

from tumble.attitude import (
    find_nearest_rotation,
    left_jacobian,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    rotation_vectors_from_matrices,
    skew,
    skews,
    tangent_basis,
)
from tumble.calibration.equations.causes import PLACEMENT
from tumble.calibration.equations.imu_unknowns import MOUNTING
from tumble.calibration.equations.observed import BelievedPoses
from tumble.calibration.equations.state import MIDDLE, NODE, RecordingState, Section
from tumble.estimation import Equations, Linear, Prior, Unknowns, View

_UP_W = np.array([0.0, 0.0, -1.0])


class PoseEquations(Equations):
    """Of some believed poses of a section."""

    cause = PLACEMENT
    words = "hold", "its pose is not what the protocol says, {times}: was it placed otherwise?"

    def __init__(self, poses: BelievedPoses, at: np.ndarray, section: Section) -> None:
        self.poses, self.at, self.section = poses, at, section
        self.place = poses.hold[at]
        self.node = self.place - section.first

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all of it."""
        return [View(self.kind)]

    def _linear(
        self, state: RecordingState, residual: np.ndarray, by_node: np.ndarray, by_fixture: np.ndarray
    ) -> list[Linear]:
        size = residual.shape[1]
        variance = self.poses.sigma[self.at] ** 2 + state.noise["placement"]
        by_border = state.unknowns.columns({"fixture": by_fixture}, 3)
        active = state.taking_part["pose"][self.place]
        covariance = variance[:, None, None] * np.eye(size)
        return [Linear(residual, covariance, by_border, self.node, by_node, None, active)]


class Tilt(PoseEquations):
    """Which way is up, of poses without a heading: ``B' C_bf' C' up``, B across the pose's own up."""

    kind = "tilt"

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return two residuals a pose, rad."""
        fixture = state.unknowns["fixture"]
        C_bf = matrix_from_rotation_vector(fixture)
        backward = np.swapaxes(self.section.C_wb[self.node, 1], 1, 2)
        up_b = backward @ _UP_W
        basis = np.array([tangent_basis(up) for up in self.poses.up_f[self.at]])
        across = np.swapaxes(basis, 1, 2) @ C_bf.T
        by_node = np.zeros((self.at.size, 2, NODE))
        by_node[:, :, MIDDLE] = across @ backward @ skew(_UP_W)
        by_fixture = across @ skews(up_b) @ left_jacobian(fixture)
        return self._linear(state, np.einsum("tij,tj->ti", across, up_b), by_node, by_fixture)


class Pose(PoseEquations):
    """The attitude, of poses with a heading: ``log(C C_bf C_nf')``."""

    kind = "pose"

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three residuals a pose, rad."""
        fixture, C_wb = state.unknowns["fixture"], self.section.C_wb[self.node, 1]
        C_bf, C_fn = matrix_from_rotation_vector(fixture), np.swapaxes(self.poses.C_nf[self.at], 1, 2)
        residual = rotation_vectors_from_matrices(C_wb @ C_bf @ C_fn)
        slope = np.array([np.linalg.inv(left_jacobian(r)) for r in residual])
        by_node = np.zeros((self.at.size, 3, NODE))
        by_node[:, :, MIDDLE] = slope
        return self._linear(state, residual, by_node, slope @ C_wb @ left_jacobian(fixture))


def pose_equations(poses: BelievedPoses, section: Section) -> list[Equations]:
    """Return the equations of a section's believed poses, with and without a heading.

    Parameters
    ----------
    poses, section : of all holds, and whose.
    """
    at = poses.of(section.first, section.last)
    made: list[Equations] = []
    for of_kind, chosen in ((Tilt, ~poses.has_heading[at]), (Pose, poses.has_heading[at])):
        if np.any(chosen):
            made.append(of_kind(poses, at[chosen], section))
    return made


def mounting_prior(u: Unknowns) -> Prior:
    """Return what is known of how the unit sits in its fixture: not far off its axes.

    Parameters
    ----------
    u : all unknowns.
    """
    return u.layout.sparse_prior(np.zeros(u.values.size), {"fixture": MOUNTING})


def align_with_poses(task: RecordingState) -> None:
    """Set the fixture's rotation, and turn each section about the vertical until its headings are as believed.

    Parameters
    ----------
    task : with believed poses; its state is changed.
    """
    poses = task.data.poses
    assert poses is not None
    together = 0.01 * np.eye(3)
    for section in task.sections:
        for i in poses.of(section.first, section.last):
            up_b = section.C_wb[poses.hold[i] - section.first, 1].T @ _UP_W
            together = together + np.outer(up_b, poses.up_f[i])
    C_bf = find_nearest_rotation(together)
    task.unknowns["fixture"][:] = rotation_vector_from_matrix(C_bf)
    for section in task.sections:
        at = [i for i in poses.of(section.first, section.last) if poses.has_heading[i]]
        if not at:
            continue
        across = sum(
            (section.C_wb[poses.hold[i] - section.first, 1] @ C_bf @ poses.C_nf[i].T for i in at),
            np.zeros((3, 3)),
        )
        heading = np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1])
        C = matrix_from_rotation_vector(np.array([0.0, 0.0, -float(heading)]))
        section.C_wb = C @ section.C_wb
        section.earth_w = C @ section.earth_w
        for k in range(section.first, section.last - 1):
            if k in task.rotations:
                rotation = task.rotations[k]
                rotation.C_wb, rotation.axis_w = C @ rotation.C_wb, C @ rotation.axis_w
