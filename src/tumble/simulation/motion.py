"""The motion of a unit that is held in one pose after another and turned in between.

Frames: n local level (north, east, down), b the unit's body frame, i inertial. A turn follows one
fixed axis with the minimum-jerk profile, ``s(x) = 10 x³ − 15 x⁴ + 6 x⁵``, which is how an arm moves
(Flash and Hogan, J. Neurosci. 5 (1985) 1688) and how a turntable is driven gently. A spin is a turn
that comes to a constant rate by that profile of its speed, keeps it, and stops the same way. Attitude,
rate and acceleration are closed formulas of time; nothing is differentiated or integrated numerically.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.simulation.kernels import (
    chain_turns,
    fill_attitudes,
    fill_mean_rates,
    fill_progress,
    fill_seen,
)
from tumble.simulation.spin_shapes import SpinShapes, directions_of, wobble_rotation, wobbling_axis

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Detours:
    """A hand does not turn about one fixed axis: during each of some turns the attitude leaves the path.

    It goes off as the square of a sine and is back at the turn's end. The unit's acceleration on the way
    is left out, as if it turned about itself.

    Attributes
    ----------
    time : (turns,) s, increasing, where each begins.
    duration : (turns,) s; each ends before the next begins.
    swing : (turns, 3) rad, the largest excursion in b.
    """

    time: Series
    duration: Series
    swing: Vectors

    def rotation(self, time: Series) -> Vectors:
        """Return the extra rotation vector in b, rad."""
        turn, angle = self._angle(time)
        vectors, away = np.zeros((len(time), 3)), np.flatnonzero(angle)
        vectors[away] = np.sin(angle[away])[:, None] ** 2 * self.swing[turn[away]]
        return vectors

    def rotation_rate(self, time: Series) -> Vectors:
        """Return its time derivative, rad/s."""
        turn, angle = self._angle(time)
        return (np.sin(2.0 * angle) * np.pi / self.duration[turn])[:, None] * self.swing[turn]

    def _angle(self, time: Series) -> tuple[np.ndarray, Series]:
        turn = np.maximum(np.searchsorted(self.time, time, side="right") - 1, 0)
        share = np.clip((time - self.time[turn]) / self.duration[turn], 0.0, 1.0)
        # sin(pi) is not zero to the last digit, and a hold shall be one
        return turn, np.where(share < 1.0, np.pi * share, 0.0)


@dataclass(frozen=True)
class Motion:
    """Holds and turns, one after another, beginning with a hold.

    Attributes
    ----------
    first_quaternion_nb : (4,) attitude at the beginning of the first hold, scalar last.
    hold_duration : (holds,) s.
    turn_duration : (holds - 1,) s.
    turn_vector_b : (holds - 1, 3) rad, rotation vector of each turn in b; may exceed half a turn.
    lever_arm_b : m, from the centre of the turns to the unit, which gives it acceleration while turned:
        (3,), or (3, 3) with a row for each accelerometer, whose own row gives its component of the force.
    detours : on top of the path; None for turns about fixed axes.
    spin_shapes : how spins come to their constant rate, and run; None for no spins at all.
    """

    first_quaternion_nb: Series
    hold_duration: Series
    turn_duration: AnyArray
    turn_vector_b: AnyArray
    lever_arm_b: AnyArray
    detours: Detours | None = None
    spin_shapes: SpinShapes | None = None

    @staticmethod
    def between_poses(
        rotations_nb: Rotation,
        hold_duration: Series,
        turn_duration: AnyArray,
    ) -> Motion:
        """Return the motion that goes through the poses by the shortest turns, about the unit itself.

        Parameters
        ----------
        rotations_nb : one attitude per hold, at its beginning.
        hold_duration, turn_duration : (holds,) and (holds - 1,) s.
        """
        return Motion(
            first_quaternion_nb=rotations_nb[0].as_quat(),
            hold_duration=hold_duration,
            turn_duration=turn_duration,
            turn_vector_b=(rotations_nb[:-1].inv() * rotations_nb[1:]).as_rotvec(),
            lever_arm_b=np.zeros(3),
        )

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
    def hold_quaternions_nb(self) -> AnyArray:
        """Attitude at the beginning of each hold, without detours: (holds, 4), scalar last."""
        return self._steps.quaternions_nb[::2]

    @cached_property
    def _steps(self) -> _Steps:
        holds = len(self.hold_duration)
        length, vector = np.empty(2 * holds - 1), np.empty((2 * holds - 1, 3))
        length[::2], length[1::2] = self.hold_duration, self.turn_duration
        vector[::2], vector[1::2] = 0.0, self.turn_vector_b
        shapes = (self.spin_shapes or SpinShapes.even(np.full(holds - 1, np.nan))).between_holds()
        wobble = np.empty((0, 3))
        if shapes.wobbles:
            axis, angle = directions_of(vector)
            wobble = wobble_rotation(axis, angle, shapes.wobble_b).as_rotvec()
        first = np.empty((len(vector), 4))
        first[0] = self.first_quaternion_nb
        chain_turns(vector, wobble, first)
        return _Steps(np.concatenate([[0.0], np.cumsum(length)]), vector, shapes, first)

    def rotation_nb(self, time: Series) -> Rotation:
        """Return the attitude at each time, detours included.

        Parameters
        ----------
        time : (samples,) s from the beginning; before it and after the end the unit stays.
        """
        from scipy.spatial.transform import Rotation

        path, step, (share, *_) = self._progress(time)
        return Rotation.from_quat(self._attitude(path, step, share, self._added(path, step, share, time)))

    def _attitude(
        self, path: _Steps, step: np.ndarray, share: Series, added: tuple[Vectors, Vectors]
    ) -> AnyArray:
        quaternions = np.empty((len(step), 4))
        fill_attitudes(path.quaternions_nb, path.vector, step, share, *added, quaternions)
        return quaternions

    def angular_rate_ib_b(self, time: Series, site: Site) -> Vectors:
        """Return the angular rate at each instant, rad/s, in b; Earth rate where the latitude is known.

        Parameters
        ----------
        time : (samples,) s.
        site : its latitude gives the Earth rate; without one the Earth stands still.
        """
        path, step, (share, speed, _) = self._progress(time)
        vector, _ = path.rate_vectors(step, share)
        rate = vector * speed[:, None]
        added = self._added(path, step, share, time)
        if self.detours is not None:
            from scipy.spatial.transform import Rotation

            away = added[1]
            away_rate = self.detours.rotation_rate(time)
            rate = Rotation.from_rotvec(away).inv().apply(rate) + _right_jacobian(away, away_rate)
        return rate + _seen(self._attitude(path, step, share, added), _earth_rate(site))

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
        path, step, (share, *_) = self._progress(edges)
        _refuse_half_turns(path, edges, step, share)
        rates, added = np.empty((len(edges) - 1, 3)), self._added(path, step, share, edges)
        edges = np.ascontiguousarray(edges, dtype=np.float64)
        fill_mean_rates(
            path.quaternions_nb, path.vector, step, share, *added, edges, _earth_rate(site), rates
        )
        return rates

    def _added(self, path: _Steps, step: np.ndarray, share: Series, time: Series) -> tuple[Vectors, Vectors]:
        """Rotation vectors that a wobbling axis and then detours add to the path's attitude; no rows for none."""
        none = np.empty((0, 3))
        wobble = path.wobble(step, share).as_rotvec() if path.shapes.wobbles else none
        return wobble, none if self.detours is None else self.detours.rotation(time)

    def specific_force_b(self, time: Series, site: Site) -> Vectors:
        """Return the specific force at each instant, m/s², in b; at rest it is minus gravity.

        Parameters
        ----------
        time : (samples,) s.
        site : gives gravity.
        """
        path, step, (share, speed, gain) = self._progress(time)
        added = self._added(path, step, share, time)
        force = _seen(self._attitude(path, step, share, added), np.array([0.0, 0.0, -site.gravity]))
        if not np.any(self.lever_arm_b):
            return force
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
        if self.detours is not None:
            from scipy.spatial.transform import Rotation

            acceleration = Rotation.from_rotvec(added[1]).inv().apply(acceleration)
        return force + acceleration

    def _progress(self, time: Series) -> tuple[_Steps, np.ndarray, AnyArray]:
        """The steps, step number, and (3, samples) the share of it done with its first and second time derivative."""
        path = self._steps
        shapes = path.shapes
        step, progress = np.empty(len(time), dtype=np.int64), np.empty((3, len(time)))
        time = np.ascontiguousarray(time, dtype=np.float64)
        fill_progress(time, path.edges, shapes.ramp_up, shapes.ramp_down, step, progress)
        if np.any(shapes.amplitude):
            spinning = ~np.isnan(shapes.ramp_up[step])
            rows, waved = step[spinning], progress[:, spinning]
            shapes.add_waves(rows, path.angle[rows], waved)
            progress[:, spinning] = waved
        return path, step, progress


@dataclass(frozen=True)
class _Steps:
    """Holds and turns in one row: edges in s, rotation vector, how spins run, first attitude."""

    edges: AnyArray
    vector: AnyArray
    shapes: SpinShapes
    quaternions_nb: AnyArray

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


def _seen(quaternions: AnyArray, vector_n: Vector) -> Vectors:
    """A vector's components in the frame of each attitude."""
    seen = np.empty((len(quaternions), 3))
    fill_seen(quaternions, np.asarray(vector_n, dtype=np.float64), seen)
    return seen


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
