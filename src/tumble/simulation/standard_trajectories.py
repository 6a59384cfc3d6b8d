"""Trajectories that predictions are made on: a rest, a straight road, the thesis' cart."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.simulation.trajectories import SplineTrajectory, drive_along

STANDARD = {
    "rest": "at rest, level",
    "straight": "10 s to 15 m/s, and straight on to the north-east",
    "cart": "straight sections of a minute at walking speed, with sharp turns between (Hayal 2010, chapter 5)",
}
_STEP = 0.5
_DIAGONAL = float(np.pi / 4.0)


def standard_trajectory(
    name: str, duration: float, *, origin: tuple[float, float, float] = (0.7, 0.2, 100.0)
) -> SplineTrajectory:
    """Return one of the standard trajectories.

    Parameters
    ----------
    name : of `STANDARD`.
    duration : s.
    origin : latitude and longitude (rad), height (m).

    Raises
    ------
    UsageError
        If there is none of that name.
    """
    if name == "rest":
        return SplineTrajectory.at_rest(origin, np.array([0.0, 0.0, _DIAGONAL]), max(duration, 1.0) + 1.0)
    time = np.arange(0.0, duration + 6.0 * _STEP, _STEP)
    if name == "straight":
        speed = 15.0 * _smooth_step(time / 10.0)
        return drive_along(origin, time, speed, np.full(len(time), _DIAGONAL))
    if name == "cart":
        section, turn = 60.0, 3.0
        count = int(duration / section) + 2
        yaw = np.full(len(time), _DIAGONAL)
        for k in range(1, count):
            # there and back on strips side by side: two turns to the right, two to the left
            side = 1.0 if (k - 1) % 4 < 2 else -1.0
            yaw += side * 0.5 * np.pi * _smooth_step((time - k * section) / turn)
        return drive_along(origin, time, 1.2 * _smooth_step(time / 3.0), yaw)
    raise UsageError(
        f"There is no trajectory {name!r}: choose {', '.join(STANDARD)}, or give a file of positions."
    )


def trajectory_of_track(
    time: Series, position: tuple[Series, Series, Series], velocity_n: np.ndarray, duration: float
) -> SplineTrajectory:
    """Return the smooth trajectory of a vehicle that drives where its track goes, level.

    Parameters
    ----------
    time : (fixes,) s.
    position : latitude and longitude (rad), height (m).
    velocity_n : (fixes, 3) m/s.
    duration : s of it that are wanted, from the first fix.

    Raises
    ------
    UsageError
        If the track is shorter.
    """
    if time[-1] - time[0] < duration:
        raise UsageError(
            f"The track lasts {time[-1] - time[0]:.0f} s, and errors were asked for after {duration:g} s: give a "
            "longer one, or shorter times."
        )
    grid = np.arange(0.0, duration + 6.0 * _STEP, _STEP)
    good = np.isfinite(velocity_n).all(axis=1)
    north, east = (_averaged(grid, time[good] - time[0], velocity_n[good, axis]) for axis in (0, 1))
    speed = np.hypot(north, east)
    moving = speed > 1.0
    if not moving.any():
        heading = np.zeros(len(grid))
    else:
        heading = np.interp(grid, grid[moving], np.unwrap(np.arctan2(east[moving], north[moving])))
    origin = (float(position[0][0]), float(position[1][0]), float(position[2][0]))
    return drive_along(origin, grid, np.where(moving, speed, 0.0), _averaged(grid, grid, heading))


def _averaged(grid: Series, time: Series, signal: Series) -> Series:
    """A signal over a second on either side of each point of the grid."""
    near = np.linspace(-1.0, 1.0, 9)
    rows: list[Series] = [np.interp(grid + shift, time, signal) for shift in near.tolist()]
    return np.vstack(rows).mean(axis=0)


def _smooth_step(x: Series) -> Series:
    """From 0 to 1 over 0 to 1, with slope and bend zero at both ends."""
    y = np.clip(x, 0.0, 1.0)
    return y**3 * (10.0 - 15.0 * y + 6.0 * y**2)
