"""The field campaign of Hayal (2010), chapter 5: a unit warms up, rests in 26 poses, and is pulled over a car park.

Printed are the twenty minutes of warm-up, the poses of five minutes, and that a cart was pulled by hand for about
25 minutes at walking speed along 25 straight sections with short and sharp curves between. The rest is assumed, and
stands as constants here.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import Series, Vectors
from tumble.attitude import twenty_six_directions
from tumble.simulation.motion import Motion
from tumble.simulation.trajectories import SplineTrajectory, drive_along

WARM_UP = 1200.0  # s, before the first pose
POSES, POSE, PAUSE = 26, 300.0, 30.0  # s; the pause is assumed
PLACEMENT = np.radians(2.0)  # of each of the three angles (4.2)
HEADING = np.radians(20.0)  # of the main directions, plus any quarter turn (4.2)
SECTIONS, CART = 25, 1500.0  # s
# Of all that follows the thesis says nothing.
REST = 60.0  # s on the cart before it is pulled
CURVE = 4.0  # s, half a turn
WALKING, IN_CURVE = 1.2, 0.5  # m/s
UNEVEN_SPEED, SWAY = 0.08, np.radians(0.5)  # rms, of the speed as a share, of roll and pitch
KNOT = 0.5  # s
ORIGIN = (float(np.radians(40.0)), float(np.radians(-83.04)), 220.0)
# A unit that is switched on drifts towards its working temperature: by its in-run stability, with this time constant.
WARMING = 300.0  # s


def pose_motion(rng: np.random.Generator) -> Motion:
    """Return the 26 poses, faces first, then edges and corners, each for five minutes.

    Parameters
    ----------
    rng : source of headings and of how far each pose is off.
    """
    up_b = twenty_six_directions()
    pitch, roll = np.arcsin(up_b[:, 0]), np.arctan2(-up_b[:, 1], -up_b[:, 2])
    off = rng.normal(0.0, PLACEMENT, (3, POSES))
    heading = HEADING + 0.5 * np.pi * rng.integers(0, 4, POSES)
    angles = np.column_stack([heading + off[2], pitch + off[1], roll + off[0]])
    rotations = Rotation.from_euler("ZYX", angles)
    return Motion.between_poses(rotations, np.full(POSES, POSE), np.full(POSES - 1, PAUSE))


def cart_trajectory(rng: np.random.Generator) -> SplineTrajectory:
    """Return the sweep of the cart: a rest, then straight sections there and back with half turns between.

    Parameters
    ----------
    rng : source of the uneven speed and of the swaying on the asphalt.
    """
    time = np.arange(0.0, REST + CART + 6.0 * KNOT, KNOT)
    section = CART / SECTIONS
    yaw, slow = np.full(len(time), HEADING), np.zeros(len(time))
    for k in range(1, SECTIONS + 1):
        since = time - REST - k * section + CURVE
        yaw += (1.0 if k % 2 else -1.0) * np.pi * _smooth_step(since / CURVE)
        slow += _smooth_step((since + 1.5) / 1.5) - _smooth_step((since - CURVE) / 1.5)
    moving = _smooth_step((time - REST) / 2.0)
    uneven = smoothed(rng.standard_normal((len(time), 3)), 2)
    speed = (WALKING - (WALKING - IN_CURVE) * slow) * (1.0 + UNEVEN_SPEED * uneven[:, 0]) * moving
    return drive_along(ORIGIN, time, speed, yaw, roll_pitch=SWAY * uneven[:, 1:] * moving[:, None])


def warming(seconds: Series, size: float) -> Series:
    """Return how far a bias still is from where it comes to, by the time since the unit was switched on.

    Parameters
    ----------
    seconds : since then.
    size : at the beginning.
    """
    return np.asarray(size * np.exp(-seconds / WARMING))


def _smooth_step(x: Series) -> Series:
    """Return a step from 0 to 1 over 0 to 1, with slope and bend zero at both ends."""
    y = np.clip(x, 0.0, 1.0)
    return np.asarray(y**3 * (10.0 - 15.0 * y + 6.0 * y**2))


def smoothed(white: Vectors, width: int) -> Vectors:
    """Return columns of white noise, averaged over `width` rows on either side, of rms one."""
    kernel = np.ones(2 * width + 1) / np.sqrt(2.0 * width + 1.0)
    columns: list[Series] = [np.convolve(column, kernel, mode="same") for column in white.T]
    return np.column_stack(columns)
