"""What believed poses add to the joint estimator: attitudes of holds against the axes of a fixture.

The unit sits in its fixture somehow: a rotation C_bf from the fixture's axes to the sensors' frame b is unknown
and the same in all poses. A pose of known heading tells the attitude in full; the room's north is then the
fixture's, and the heading of a section of holds is no longer nobody's business. A pose without heading tells
which way is up.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Series
from tumble.attitude.rotations import (
    find_nearest_rotation,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    rotation_vectors_from_matrices,
    skew,
    skews,
    tangent_basis,
)
from tumble.calibration.joint.believed import BelievedPoses
from tumble.calibration.joint.spins import SpinState
from tumble.calibration.joint.terms import MIDDLE, NODE, Extra, Section, Terms
from tumble.calibration.joint.wide import FIXTURE, is_wide
from tumble.estimation import Prior

# How far the unit's axes may be off the fixture's, one sigma.
MOUNTING_SIGMA = 0.2  # rad
_UP_W = np.array([0.0, 0.0, -1.0])


def pose_terms(poses: BelievedPoses, section: Section, unknowns: Series, extra: Extra) -> list[Terms]:
    """Return the residuals of a section's believed poses: kind "tilt" without a heading, "pose" with one.

    Parameters
    ----------
    poses : of all holds.
    section, unknowns, extra : the state, and the variance by which placements scatter beyond their sigma.
    """
    at = poses.of(section.first, section.last)
    return [
        make(poses, at[with_heading], section, unknowns, extra)
        for make, with_heading in (
            (_tilts, ~poses.has_heading[at]),
            (_attitudes, poses.has_heading[at]),
        )
        if np.any(with_heading)
    ]


def _tilts(poses: BelievedPoses, at: np.ndarray, section: Section, unknowns: Series, extra: Extra) -> Terms:
    node = poses.hold[at] - section.first
    C_bf = matrix_from_rotation_vector(unknowns[FIXTURE])
    backward = np.swapaxes(section.C_wb[node, 1], 1, 2)
    up_b = backward @ _UP_W
    basis = np.array([tangent_basis(up) for up in poses.up_f[at]])
    across = np.swapaxes(basis, 1, 2) @ C_bf.T
    residual = np.einsum("tij,tj->ti", across, up_b)
    by_node = np.zeros((at.size, 2, NODE))
    by_node[:, :, MIDDLE] = across @ backward @ skew(_UP_W)
    by_border = np.zeros((at.size, 2, 3 + unknowns.size))
    by_border[:, :, 3 + np.arange(FIXTURE.start, FIXTURE.stop)] = (
        across @ skews(up_b) @ left_jacobian(unknowns[FIXTURE])
    )
    covariance = (poses.sigma[at] ** 2 + extra.placement)[:, None, None] * np.eye(2)
    return Terms("tilt", poses.hold[at], node, residual, covariance, by_node, None, by_border)


def _attitudes(
    poses: BelievedPoses, at: np.ndarray, section: Section, unknowns: Series, extra: Extra
) -> Terms:
    node = poses.hold[at] - section.first
    C_wb = section.C_wb[node, 1]
    C_bf = matrix_from_rotation_vector(unknowns[FIXTURE])
    residual = rotation_vectors_from_matrices(C_wb @ C_bf @ np.swapaxes(poses.C_nf[at], 1, 2))
    slope = np.array([np.linalg.inv(left_jacobian(r)) for r in residual])
    by_node = np.zeros((at.size, 3, NODE))
    by_node[:, :, MIDDLE] = slope
    by_border = np.zeros((at.size, 3, 3 + unknowns.size))
    by_border[:, :, 3 + np.arange(FIXTURE.start, FIXTURE.stop)] = (
        slope @ C_wb @ left_jacobian(unknowns[FIXTURE])
    )
    covariance = (poses.sigma[at] ** 2 + extra.placement)[:, None, None] * np.eye(3)
    return Terms("pose", poses.hold[at], node, residual, covariance, by_node, None, by_border)


def left_jacobian(rotation_vector: Series) -> Matrix:
    """Return J with ``exp(v + dv) = exp(J dv) exp(v)`` to first order.

    Parameters
    ----------
    rotation_vector : (3,) rad.
    """
    angle = float(np.linalg.norm(rotation_vector))
    cross = skew(np.asarray(rotation_vector, dtype=np.float64))
    if angle < 1e-4:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    one = (1.0 - np.cos(angle)) / angle**2
    two = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + one * cross + two * (cross @ cross), dtype=np.float64)


def mounting_prior(unknowns: Series) -> Prior | None:
    """Return what is known of how the unit sits in its fixture; None where no fixture is believed.

    Parameters
    ----------
    unknowns : all of them.
    """
    if not is_wide(unknowns):
        return None
    precision = np.zeros((unknowns.size, unknowns.size))
    precision[FIXTURE, FIXTURE] = np.eye(3) / MOUNTING_SIGMA**2
    return Prior(np.zeros(unknowns.size), precision)


def sees_heading(poses: BelievedPoses | None, section: Section) -> bool:
    """Whether a believed heading tells where the section's north is."""
    return poses is not None and bool(np.any(poses.has_heading[poses.of(section.first, section.last)]))


def align_with_poses(
    poses: BelievedPoses, sections: list[Section], spins: dict[int, SpinState], unknowns: Series
) -> None:
    """Set the fixture's rotation, and turn each section about the vertical until its headings are as believed.

    Parameters
    ----------
    poses : what is believed.
    sections, spins, unknowns : the state, changed in place.
    """
    together = 0.01 * np.eye(3)
    for section in sections:
        for i in poses.of(section.first, section.last):
            up_b = section.C_wb[poses.hold[i] - section.first, 1].T @ _UP_W
            together = together + np.outer(up_b, poses.up_f[i])
    C_bf = find_nearest_rotation(together)
    unknowns[FIXTURE] = rotation_vector_from_matrix(C_bf)
    for section in sections:
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
            if k in spins:
                spins[k].C_wb, spins[k].axis_w = C @ spins[k].C_wb, C @ spins[k].axis_w
