"""A body that travels: position and attitude by splines, and exactly what its IMU measures.

Position is a spline of fifth order in the Earth frame, attitude roll, pitch and yaw against the local level by
such splines, so that velocity, acceleration and angular rate are their closed derivatives. Specific force and
rate follow without any numerical integration; increments are Gauss-Legendre integrals of them.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Matrices, Quaternions, Series, Table, Vectors
from tumble.attitude import twenty_six_directions
from tumble.earth import (
    EARTH_RATE,
    curvature_radii,
    geodetic_position,
    gravity_vectors_n,
    position_in_earth_frame,
    rotations_to_earth_frame,
)
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.simulation.motion import Motion

_DEGREE = 5
# Instants at a time: some 30 MB of intermediate results.
_BLOCK = 20_000


@dataclass(frozen=True)
class TravelledStates:
    """Where a travelling body is, and what is measured there, at some instants.

    Attributes
    ----------
    time : (instants,) s.
    latitude, longitude, height : (instants,) geodetic, rad and m.
    velocity_n : (instants, 3) m/s against the Earth, in north, east, down.
    quaternion_nb : (instants, 4) of C_nb, scalar last.
    specific_force_b : (instants, 3) m/s².
    angular_rate_ib_b : (instants, 3) rad/s.
    """

    time: Series
    latitude: Series
    longitude: Series
    height: Series
    velocity_n: Vectors
    quaternion_nb: Quaternions
    specific_force_b: Vectors
    angular_rate_ib_b: Vectors


@dataclass(frozen=True)
class SplineTrajectory:
    """A trajectory by splines; build it with one of its constructors.

    Attributes
    ----------
    position_e : spline of (3,) m in the Earth frame.
    angles : spline of roll, pitch, yaw, (3,) rad, of b against the local level; yaw runs on past a turn.
    start, stop : s.
    """

    position_e: BSpline
    angles: BSpline
    start: float
    stop: float

    @staticmethod
    def near(
        origin: tuple[float, float, float], time: Series, position_n: Vectors, roll_pitch_yaw: Vectors
    ) -> SplineTrajectory:
        """Return the trajectory through points in the north, east, down of an origin, on the curved Earth.

        Parameters
        ----------
        origin : latitude and longitude (rad), height (m).
        time : (points,) s, increasing; six points or more.
        position_n : (points, 3) m north, east and down of the origin, along the ellipsoid.
        roll_pitch_yaw : (points, 3) rad.

        Raises
        ------
        UsageError
            If there are fewer than six points, or their times do not increase.
        """
        meridian, across = (float(r) for r in curvature_radii(origin[0]))
        latitude = origin[0] + position_n[:, 0] / (meridian + origin[2])
        longitude = origin[1] + position_n[:, 1] / ((across + origin[2]) * np.cos(latitude))
        position_e = position_in_earth_frame(latitude, longitude, origin[2] - position_n[:, 2])
        return _interpolated(time, position_e, roll_pitch_yaw)

    @staticmethod
    def at_rest(
        origin: tuple[float, float, float], roll_pitch_yaw: Series, duration: float
    ) -> SplineTrajectory:
        """Return a body that stays where it is from zero to `duration` s."""
        time = np.linspace(0.0, duration, 6)
        return SplineTrajectory.near(origin, time, np.zeros((6, 3)), np.tile(roll_pitch_yaw, (6, 1)))

    def states(self, time: Series) -> TravelledStates:
        """Return position, velocity, attitude and what an IMU measures at instants.

        Parameters
        ----------
        time : (instants,) s, inside the trajectory.

        Raises
        ------
        UsageError
            If an instant lies outside the trajectory.
        """
        self._refuse_outside(time)
        parts = [self._states(time[i : i + _BLOCK]) for i in range(0, len(time), _BLOCK)]
        return TravelledStates(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0]))
        )

    def increments(self, edges: Series, nodes: int = 4) -> tuple[Vectors, Vectors]:
        """Return (intervals, 3) integrals of angular rate (rad) and specific force (m/s) in b.

        Parameters
        ----------
        edges : (intervals + 1,) s.
        nodes : of the Gauss-Legendre rule in each interval: 4 leave 1e-12 of signals below a tenth of the rate.

        Raises
        ------
        UsageError
            If an edge lies outside the trajectory.
        """
        at, weight = np.polynomial.legendre.leggauss(nodes)
        interval = np.diff(edges)
        time = 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * interval[:, None] * at
        states = self.states(time.ravel())
        weights = 0.5 * interval[:, None] * weight
        shape = (len(interval), nodes, 3)
        return (
            np.einsum("ik,ikj->ij", weights, states.angular_rate_ib_b.reshape(shape)),
            np.einsum("ik,ikj->ij", weights, states.specific_force_b.reshape(shape)),
        )

    def _states(self, time: Series) -> TravelledStates:
        position, velocity, acceleration = (np.asarray(self.position_e(time, nu)) for nu in (0, 1, 2))
        latitude, longitude, height = geodetic_position(position)
        C_en = rotations_to_earth_frame(latitude, longitude)
        angles, slopes = np.asarray(self.angles(time)), np.asarray(self.angles(time, 1))
        rotation = Rotation.from_euler("ZYX", angles[:, ::-1])
        velocity_n = _into(C_en, velocity)
        coriolis = 2.0 * EARTH_RATE * np.column_stack([-velocity[:, 1], velocity[:, 0], 0.0 * time])
        force_n = _into(C_en, acceleration + coriolis) - gravity_vectors_n(latitude, height)
        rate_n = _level_rate(latitude, height, velocity_n)
        rate_b = rotation.inv().apply(rate_n) + _euler_rate(angles, slopes)
        return TravelledStates(
            np.asarray(time, dtype=np.float64),
            latitude,
            longitude,
            height,
            velocity_n,
            np.asarray(rotation.as_quat(), dtype=np.float64),
            np.asarray(rotation.inv().apply(force_n), dtype=np.float64),
            np.asarray(rate_b, dtype=np.float64),
        )

    def _refuse_outside(self, time: Series) -> None:
        slack = 1e-9 * (1.0 + self.stop - self.start)
        if len(time) and (np.min(time) < self.start - slack or np.max(time) > self.stop + slack):
            raise UsageError(
                f"The trajectory runs from {self.start:g} to {self.stop:g} s, and states were asked for from "
                f"{np.min(time):g} to {np.max(time):g} s."
            )


def drive_along(
    origin: tuple[float, float, float],
    time: Series,
    speed: Series,
    yaw: Series,
    *,
    climb: Series | None = None,
    roll_pitch: Table | None = None,
) -> SplineTrajectory:
    """Return the trajectory of a vehicle that drives where it points.

    Parameters
    ----------
    origin : latitude and longitude (rad), height (m) of the start.
    time : (points,) s, evenly spaced; the path between follows fifth-order splines.
    speed : (points,) m/s along the vehicle.
    yaw : (points,) rad from north to east, running on past a turn.
    climb : (points,) rad, the road's slope, up positive; also the pitch. None for a level road.
    roll_pitch : (points, 2) rad, what the body sways on its springs, on top.

    Raises
    ------
    UsageError
        If there are fewer than six points, or their times do not increase.
    """
    slope = np.zeros_like(speed) if climb is None else climb
    along = np.column_stack(
        [speed * np.cos(slope) * np.cos(yaw), speed * np.cos(slope) * np.sin(yaw), -speed * np.sin(slope)]
    )
    _refuse_knots(time)
    position_n = np.asarray(make_interp_spline(time, along, k=3).antiderivative()(time))
    sway = np.zeros((len(time), 2)) if roll_pitch is None else roll_pitch
    angles = np.column_stack([sway[:, 0], slope + sway[:, 1], yaw])
    return SplineTrajectory.near(origin, time, position_n - position_n[0], angles)


def simulate_drive(
    rng: np.random.Generator,
    duration: float,
    *,
    origin: tuple[float, float, float] = (0.7, -1.8, 1600.0),
    rest: float = 10.0,
    top_speed: float = 15.0,
) -> SplineTrajectory:
    """Draw a drive through a town: straights, turns at corners, stops, a road that rises and falls.

    Parameters
    ----------
    rng : source of all numbers.
    duration : s, the rest before it included.
    origin : latitude and longitude (rad), height (m) of the start.
    rest : s at rest before the drive.
    top_speed : m/s on straights; corners are taken at a third of it.

    Raises
    ------
    UsageError
        If the duration is shorter than the rest and ten seconds.
    """
    if not duration >= rest + 10.0:
        raise UsageError(f"A drive of {duration:g} s with {rest:g} s of rest is too short: give 10 s more.")
    step = 0.5
    time = np.arange(0.0, duration + 2.0 * step, step)
    speed, yaw_rate = np.zeros_like(time), np.zeros_like(time)
    at = rest
    while at < duration:
        straight, corner = rng.uniform(8.0, 25.0), rng.uniform(4.0, 8.0)
        stop = rng.uniform(2.0, 8.0) if rng.random() < 0.25 else 0.0
        row = (time >= at) & (time < at + straight)
        speed[row] = top_speed * rng.uniform(0.5, 1.0)
        at += straight
        row = (time >= at) & (time < at + corner)
        speed[row] = top_speed / 3.0
        yaw_rate[row] = rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.2) * 0.5 * np.pi / corner
        at += corner + stop
    speed, yaw_rate = _smoothed(speed, 10), _smoothed(yaw_rate, 4)
    speed[time < rest - step] = 0.0
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(yaw_rate) * step
    climb = _smoothed(rng.normal(0.0, 0.25, len(time)), 60) * (speed > 0.0)
    gain = np.gradient(speed, step)
    sway = np.column_stack([0.01 * speed * yaw_rate / 5.0, -0.01 * gain])
    sway += _smoothed(rng.normal(0.0, 0.02, (len(time), 2)), 3) * (speed / top_speed)[:, None]
    return drive_along(origin, time, speed, yaw, climb=_smoothed(climb, 8), roll_pitch=sway)


def _interpolated(time: Series, position_e: Vectors, angles: Vectors) -> SplineTrajectory:
    _refuse_knots(time)
    return SplineTrajectory(
        make_interp_spline(time, position_e, k=_DEGREE),
        make_interp_spline(time, angles, k=_DEGREE),
        float(time[0]),
        float(time[-1]),
    )


def _refuse_knots(time: Series) -> None:
    if len(time) <= _DEGREE or not np.all(np.diff(time) > 0.0):
        raise UsageError(
            f"A trajectory takes {_DEGREE + 1} points or more at increasing times, and here are {len(time)}."
        )


def _smoothed(signal: AnyArray, width: int) -> AnyArray:
    """A moving average, twice, over `width` points on either side, ends held."""
    kernel = np.ones(2 * width + 1) / (2 * width + 1)

    def once(column: AnyArray) -> AnyArray:
        return np.convolve(np.pad(column, width, mode="edge"), kernel, mode="valid")

    columns = signal.reshape(len(signal), -1).T
    return np.column_stack([once(once(column)) for column in columns]).reshape(signal.shape)


def _into(C_en: Matrices, vectors_e: Vectors) -> Vectors:
    return np.einsum("kji,kj->ki", C_en, vectors_e)


def _level_rate(latitude: Series, height: Series, velocity_n: Vectors) -> Vectors:
    """Rate of the local level against inertial space: Earth rate and transport rate, in n."""
    meridian, across = curvature_radii(latitude)
    east = velocity_n[:, 1] / (across + height)
    return np.column_stack(
        [
            EARTH_RATE * np.cos(latitude) + east,
            -velocity_n[:, 0] / (meridian + height),
            -EARTH_RATE * np.sin(latitude) - east * np.tan(latitude),
        ]
    )


def _euler_rate(angles: Vectors, slopes: Vectors) -> Vectors:
    """Rate of b against n, in b, of roll, pitch, yaw and their derivatives."""
    roll, pitch = angles[:, 0], angles[:, 1]
    turned, tilted, rolled = slopes[:, 2], slopes[:, 1], slopes[:, 0]
    return np.column_stack(
        [
            rolled - turned * np.sin(pitch),
            tilted * np.cos(roll) + turned * np.cos(pitch) * np.sin(roll),
            -tilted * np.sin(roll) + turned * np.cos(pitch) * np.cos(roll),
        ]
    )


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
