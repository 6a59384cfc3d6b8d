"""The motion of a unit that is held in one pose after another and turned in between.

Frames: n local level (north, east, down), b the unit's body frame, i inertial. A turn follows one
fixed axis with the minimum-jerk profile, ``s(x) = 10 x³ − 15 x⁴ + 6 x⁵``, which is how an arm moves
(Flash and Hogan, J. Neurosci. 5 (1985) 1688) and how a turntable is driven gently. A spin is a turn
that comes to a constant rate by that profile of its speed, keeps it, and stops the same way. Attitude,
rate and acceleration are closed formulas of time; nothing is differentiated or integrated numerically.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.earth.site import Site
from tumble.errors import UsageError
from tumble.simulation.disturbances import Disturbance
from tumble.simulation.spin_shapes import SpinShapes, directions_of, wobble_rotation, wobbling_axis


@dataclass(frozen=True)
class Motion:
    """Holds and turns, one after another, beginning with a hold.

    Attributes
    ----------
    first_rotation_nb : attitude at the beginning of the first hold.
    hold_duration : (holds,) s.
    turn_duration : (holds - 1,) s.
    turn_vector_b : (holds - 1, 3) rad, rotation vector of each turn in b; may exceed half a turn.
    creep_vector_b : (holds, 3) rad, rotation vector in b by which each hold creeps at a constant rate.
    lever_arm_b : m, from the centre of the turns to the unit, which gives it acceleration while turned:
        (3,), or (3, 3) with a row for each accelerometer, whose own row gives its component of the force.
    disturbances : tremor, vibration, knocks: on top of the path, at all times.
    turn_ramp : (holds - 1,) s that a spin takes to come to its constant rate and to stop from it; NaN
        for a turn without a constant part. None for no spins at all.
    spin_shapes : how spins run that are not even, instead of `turn_ramp`.
    """

    first_rotation_nb: Rotation
    hold_duration: Series
    turn_duration: AnyArray
    turn_vector_b: AnyArray
    creep_vector_b: AnyArray
    lever_arm_b: AnyArray
    disturbances: tuple[Disturbance, ...] = ()
    turn_ramp: AnyArray | None = None
    spin_shapes: SpinShapes | None = None

    @staticmethod
    def between_poses(
        rotations_nb: Rotation,
        hold_duration: Series,
        turn_duration: AnyArray,
        *,
        creep_vector_b: AnyArray | None = None,
        lever_arm_b: AnyArray | None = None,
        disturbances: tuple[Disturbance, ...] = (),
    ) -> Motion:
        """Return the motion that goes through the poses by the shortest turns.

        Parameters
        ----------
        rotations_nb : one attitude per hold, at its beginning.
        hold_duration, turn_duration : (holds,) and (holds - 1,) s.
        creep_vector_b : (holds, 3) rad, or None for holds that stay.
        lever_arm_b : (3,) or (3, 3) m, or None for turns about the unit itself.
        disturbances : see `Motion`.

        Raises
        ------
        ValueError
            If the numbers of poses and durations do not fit together.
        """
        holds = len(rotations_nb)
        creep = np.zeros((holds, 3)) if creep_vector_b is None else creep_vector_b
        if len(hold_duration) != holds or len(turn_duration) != holds - 1 or len(creep) != holds:
            raise ValueError(
                f"{holds} poses take {holds} hold durations and {holds - 1} turn durations, "
                f"not {len(hold_duration)} and {len(turn_duration)}"
            )
        left = rotations_nb[:-1] * Rotation.from_rotvec(creep[:-1])
        return Motion(
            first_rotation_nb=rotations_nb[0],
            hold_duration=hold_duration,
            turn_duration=turn_duration,
            turn_vector_b=(left.inv() * rotations_nb[1:]).as_rotvec(),
            creep_vector_b=creep,
            lever_arm_b=np.zeros(3) if lever_arm_b is None else lever_arm_b,
            disturbances=disturbances,
        )

    def disturbed(self, *disturbances: Disturbance) -> Motion:
        """Return the same motion with further disturbances."""
        return replace(self, disturbances=(*self.disturbances, *disturbances))

    @property
    def duration(self) -> float:
        """Seconds from the beginning of the first hold to the end of the last."""
        return float(np.sum(self.hold_duration) + np.sum(self.turn_duration))

    @property
    def hold_edges(self) -> AnyArray:
        """Beginning and end of each hold, (holds, 2) s."""
        return self._steps.edges.reshape(-1)[self._hold_index()]

    def _hold_index(self) -> np.ndarray:
        return 2 * np.arange(len(self.hold_duration))[:, None] + np.arange(2)

    @property
    def hold_rotations_nb(self) -> Rotation:
        """Attitude at the beginning of each hold, without disturbances."""
        return self._steps.rotations_nb[::2]

    @cached_property
    def _steps(self) -> _Steps:
        holds = len(self.hold_duration)
        length, vector = np.empty(2 * holds - 1), np.empty((2 * holds - 1, 3))
        length[::2], length[1::2] = self.hold_duration, self.turn_duration
        vector[::2], vector[1::2] = self.creep_vector_b, self.turn_vector_b
        ramp = np.full(holds - 1, np.nan) if self.turn_ramp is None else self.turn_ramp
        shapes = SpinShapes.even(ramp) if self.spin_shapes is None else self.spin_shapes
        shapes = shapes.between_holds()
        moved = Rotation.from_rotvec(vector)
        if shapes.wobbles:
            axis, angle = directions_of(vector)
            moved = moved * wobble_rotation(axis, angle, shapes.wobble_b)
        rotations = [self.first_rotation_nb]
        for step in moved[:-1] if holds > 1 else ():
            rotations.append(rotations[-1] * step)
        edges = np.concatenate([[0.0], np.cumsum(length)])
        return _Steps(edges, length, vector, shapes, Rotation.concatenate(rotations))

    def rotation_nb(self, time: Series) -> Rotation:
        """Return the attitude at each time, disturbances included.

        Parameters
        ----------
        time : (samples,) s from the beginning; before it and after the end the unit stays.
        """
        path, step, share, *_ = self._progress(time)
        return self._attitude(path, step, share, self._shake(time) if self.disturbances else None)

    def _attitude(self, path: _Steps, step: np.ndarray, share: Series, shake: Vectors | None) -> Rotation:
        turned = Rotation.from_rotvec(path.vector[step] * share[:, None])
        rotation = _product(path.rotations_nb[step], turned)
        if path.shapes.wobbles:
            rotation = _product(rotation, path.wobble(step, share))
        return rotation if shake is None else _product(rotation, Rotation.from_rotvec(shake))

    def angular_rate_ib_b(self, time: Series, site: Site) -> Vectors:
        """Return the angular rate at each instant, rad/s, in b; Earth rate where the latitude is known.

        Parameters
        ----------
        time : (samples,) s.
        site : its latitude gives the Earth rate; without one the Earth stands still.
        """
        path, step, share, speed, _ = self._progress(time)
        vector, _ = path.rate_vectors(step, share)
        rate = vector * speed[:, None]
        shake = None
        if self.disturbances:
            shake = self._shake(time)
            shake_rate = np.sum([d.rotation_rate(time) for d in self.disturbances], axis=0)
            rate = Rotation.from_rotvec(shake).inv().apply(rate) + _right_jacobian(shake, shake_rate)
        return rate + self._attitude(path, step, share, shake).inv().apply(_earth_rate(site))

    def mean_angular_rate_ib_b(self, edges: Series, site: Site) -> AnyArray:
        """Return the rotation vector from each edge to the next over the time between, rad/s, in b.

        It is what a gyro's increments tell without coning error: the rotations by ``rate * step``,
        chained, return the attitude exactly. Within one hold, turn or spin the path's part is made from
        the angle and the Earth's from its rate, so that both keep all their digits at any sampling rate;
        a difference of attitudes would leave of the Earth rate at 1 kHz only eight.

        Parameters
        ----------
        edges : (samples + 1,) s, strictly increasing.
        site : as for `angular_rate_ib_b`.

        Raises
        ------
        UsageError
            If the unit turns by half a turn or more between two edges: no gyro sample determines that.
        """
        path, step, share, *_ = self._progress(edges)
        _refuse_half_turns(path, edges, step, share)
        before = _product(path.rotations_nb[step], Rotation.from_rotvec(path.vector[step] * share[:, None]))
        across = step[1:] != step[:-1]
        turned = path.vector[step[:-1]] * np.diff(share)[:, None]
        if across.any():
            ends = before.as_quat()
            first, last = Rotation.from_quat(ends[:-1][across]), Rotation.from_quat(ends[1:][across])
            turned[across] = (first.inv() * last).as_rotvec()
        moved = Rotation.from_rotvec(turned)
        added = self._added(path, step, share, edges)
        if added is not None:
            before = _product(before, added)
            moved = _product(_product(added[:-1].inv(), moved), added[1:])
        interval = np.diff(edges)[:, None]
        earth_b = before[:-1].inv().apply(_earth_rate(site))
        return _product(Rotation.from_rotvec(interval * earth_b), moved).as_rotvec() / interval

    def _added(self, path: _Steps, step: np.ndarray, share: Series, time: Series) -> Rotation | None:
        """What a wobbling axis and disturbances add to the path's attitude; None for nothing."""
        wobble = path.wobble(step, share) if path.shapes.wobbles else None
        shake = Rotation.from_rotvec(self._shake(time)) if self.disturbances else None
        if wobble is None or shake is None:
            return shake if wobble is None else wobble
        return _product(wobble, shake)

    def specific_force_b(self, time: Series, site: Site) -> Vectors:
        """Return the specific force at each instant, m/s², in b; at rest it is minus gravity.

        Parameters
        ----------
        time : (samples,) s.
        site : gives gravity.
        """
        path, step, share, speed, gain = self._progress(time)
        vector, bend = path.rate_vectors(step, share)

        def acceleration_at(lever_arm_b: Vector) -> Vectors:
            across = np.cross(vector, lever_arm_b)
            # a = ω' x l + ω x (ω x l), with ω = vector * speed
            result = across * gain[:, None] + np.cross(vector, across) * (speed**2)[:, None]
            return result if bend is None else result + np.cross(bend, lever_arm_b) * (speed**2)[:, None]

        if self.lever_arm_b.ndim == 1:
            acceleration = acceleration_at(self.lever_arm_b)
        else:
            each = [acceleration_at(row)[:, axis] for axis, row in enumerate(self.lever_arm_b)]
            acceleration = np.stack(each, axis=1)
        shake = None
        if self.disturbances:
            shake = self._shake(time)
            acceleration = Rotation.from_rotvec(shake).inv().apply(acceleration)
            acceleration += np.sum([d.acceleration(time) for d in self.disturbances], axis=0)
        gravity_n = [0.0, 0.0, site.gravity]
        return acceleration - self._attitude(path, step, share, shake).inv().apply(gravity_n)

    def _shake(self, time: Series) -> Vectors:
        return np.sum([d.rotation(time) for d in self.disturbances], axis=0)

    def _progress(self, time: Series) -> tuple[_Steps, np.ndarray, Series, Series, Series]:
        """The steps, step number, share of it done, and the share's first and second time derivative."""
        path = self._steps
        step = np.clip(np.searchsorted(path.edges, time, side="right") - 1, 0, len(path.length) - 1)
        length = path.length[step]
        x = np.clip((time - path.edges[step]) / length, 0.0, 1.0)
        turning = step % 2 == 1
        inside = (x > 0.0) & (x < 1.0)
        share = np.where(turning, x**3 * (10.0 - 15.0 * x + 6.0 * x**2), x)
        speed = np.where(turning, 30.0 * x**2 * (1.0 - x) ** 2, inside) / length
        gain = np.where(turning, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x), 0.0) / length**2
        spinning = ~np.isnan(path.shapes.ramp_up[step])
        if np.any(spinning):
            rows = step[spinning]
            share[spinning], speed[spinning], gain[spinning] = path.shapes.progress(
                rows, time[spinning] - path.edges[rows], path.length[rows], path.angle[rows]
            )
        return path, step, share, speed, gain


@dataclass(frozen=True, slots=True)
class _Steps:
    """Holds and turns in one row: edges and length in s, rotation vector, how spins run, first attitude."""

    edges: AnyArray
    length: AnyArray
    vector: AnyArray
    shapes: SpinShapes
    rotations_nb: Rotation

    @property
    def angle(self) -> Series:
        return np.linalg.norm(self.vector, axis=1)

    def wobble(self, step: np.ndarray, share: Series) -> Rotation:
        """What a wobbling axis adds at that share of the step."""
        axis, angle = directions_of(self.vector)
        return wobble_rotation(axis[step], angle[step] * share, self.shapes.wobble_b[step])

    def rate_vectors(self, step: np.ndarray, share: Series) -> tuple[Vectors, Vectors | None]:
        """Angular rate in b per rate of the share, and its derivative by the share where there is one."""
        if not self.shapes.wobbles:
            return self.vector[step], None
        axis, angle = (rows[step] for rows in directions_of(self.vector))
        along, bend = wobbling_axis(axis, angle * share, self.shapes.wobble_b[step])
        return along * angle[:, None], bend * (angle**2)[:, None]


def _refuse_half_turns(path: _Steps, edges: Series, step: np.ndarray, share: Series) -> None:
    angle = np.linalg.norm(path.vector, axis=1)
    turned = np.diff(np.concatenate([[0.0], np.cumsum(angle)])[step] + angle[step] * share)
    worst = int(np.argmax(turned))
    if turned[worst] >= np.pi:
        raise UsageError(
            f"Between {edges[worst]:.6g} s and {edges[worst + 1]:.6g} s the unit turns by "
            f"{np.degrees(turned[worst]):.0f} degrees. A gyro sample of half a turn or more shows "
            "nothing: give a higher sampling rate, or slower turns."
        )


def _product(first: Rotation, second: Rotation) -> Rotation:
    """The products of two equally long rows of rotations; scipy's own takes sixteen times as long."""
    one, other = first.as_quat(), second.as_quat()
    (x, y, z, w), (i, j, k, s) = one.T, other.T
    product = np.empty_like(one)
    product[:, 0] = w * i + x * s + y * k - z * j
    product[:, 1] = w * j - x * k + y * s + z * i
    product[:, 2] = w * k + x * j - y * i + z * s
    product[:, 3] = w * s - x * i - y * j - z * k
    return Rotation.from_quat(product)


def _earth_rate(site: Site) -> Vector:
    return np.zeros(3) if site.latitude is None else site.earth_rate_n


def _right_jacobian(vector: Vectors, rate: Vectors) -> Vectors:
    """Angular rate in b of a rotation vector and its derivative (Chirikjian, 2012, eq. 10.86)."""
    angle = np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-9)
    once = np.cross(vector, rate)
    twice = np.cross(vector, once)
    # 1 - cos loses all digits at small angles: 2 sin² of the half keeps them
    first = 2.0 * np.sin(0.5 * angle) ** 2 / angle**2
    exact: AnyArray = (angle - np.sin(angle)) / angle**3
    second = np.where(angle < 1e-3, (1.0 - angle**2 / 20.0) / 6.0, exact)
    return rate - first * once + second * twice
