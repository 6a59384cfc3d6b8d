"""Lists of poses: the 26 attitudes of a cube, and what a hand does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.attitude import twenty_six_directions

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


# rad, the least angle by which gravity's direction in b moves from one pose of a hand to the next.
SMALLEST = 0.5


def poses_26(heading: float = 0.0) -> Rotation:
    """Return 26 attitudes in which b's up direction is a face, an edge or a corner of a cube.

    Parameters
    ----------
    heading : rad, turns all of them about the vertical; it decides what the gyros see of the Earth
        rate's horizontal part.
    """
    from scipy.spatial.transform import Rotation

    up_n = np.array([0.0, 0.0, -1.0])
    turned = Rotation.from_rotvec([0.0, 0.0, heading])
    return Rotation.concatenate(
        [turned * _turning_to(direction, up_n) for direction in twenty_six_directions()]
    )


def _turning_to(vector: np.ndarray, target: np.ndarray) -> Rotation:
    """The shortest rotation that brings one unit vector onto another."""
    from scipy.spatial.transform import Rotation

    axis = np.cross(vector, target)
    sine, cosine = float(np.linalg.norm(axis)), float(vector @ target)
    if sine < 1e-12:
        # opposite or equal: any horizontal axis will do
        return Rotation.from_rotvec([np.pi if cosine < 0.0 else 0.0, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))


def simulate_hand_pose(rng: np.random.Generator, after: Rotation | None = None) -> Rotation:
    """Draw an attitude as a hand takes it: anyhow, but clearly different from the one before.

    Parameters
    ----------
    rng : source of the attitude.
    after : attitude before, if there is one.
    """
    from scipy.spatial.transform import Rotation

    up_n = np.array([0.0, 0.0, -1.0])
    while True:
        # Any attitude as likely as any other.
        pose = Rotation.from_quat(rng.standard_normal(4))
        if after is None:
            return pose
        cosine = float(pose.inv().apply(up_n) @ after.inv().apply(up_n))
        if np.arccos(np.clip(cosine, -1.0, 1.0)) >= SMALLEST:
            return pose
