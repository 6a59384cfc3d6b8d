"""Motion by closed forms: holds, turns by a hand, and turns by a motor, strung together without a jump.

A path is a list of pieces. Each gives attitude and place at any time from formulas; the path evaluates them on a
grid several times as fine as the recording's and then takes differences of exact attitudes (the logarithm of a
quaternion), so that a sample is the mean over its own interval, as a converter with a low-pass gives it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from . import rotations as so3

Profile = Callable[[np.ndarray], np.ndarray]


def eased(share: np.ndarray) -> np.ndarray:
    """Return the path of least jerk from 0 to 1, as hands move."""
    return share**3 * (10 - 15 * share + 6 * share**2)


def bump(share: np.ndarray) -> np.ndarray:
    """Return what rises from 0 and comes back to 0 with no jump in rate."""
    return np.sin(np.pi * share) ** 4


def trapezoid_angle(time: np.ndarray, rate: float, steady: float, ramp: float) -> np.ndarray:
    """Return the angle of a table that comes to its rate, keeps it, and stops, over ramps of cosine shape."""

    def risen(t: np.ndarray) -> np.ndarray:
        t = np.clip(t, 0.0, ramp)
        return rate * (0.5 * t - 0.5 * ramp / np.pi * np.sin(np.pi * t / ramp))

    end = 2 * ramp + steady
    return (
        risen(time)
        + rate * np.clip(time - ramp, 0.0, steady)
        + 0.5 * rate * ramp * (time > ramp + steady)
        - risen(np.clip(end - time, 0.0, ramp)) * (time > ramp + steady)
    )


@dataclass(frozen=True)
class Hand:
    """How a hand holds: amplitudes (one sigma between holds) of trembling and swaying, in rad and m.

    A tremor is between 7 and 11 Hz, a sway below 0.6 Hz. `lift` is how far a hand carries the unit in a turn.
    """

    tremor: float = 2e-5
    sway: float = 5e-5
    shake: float = 4e-7
    lift: float = 0.08
    astray: float = 0.15


STILL = Hand(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class Step:
    """One step as it happened: what kind, from when to when (s), and what it was for."""

    kind: str
    start: float
    stop: float
    name: str = ""


@dataclass
class Path:
    """A motion under construction.

    `rate` samples a second, each evaluated `fineness` times; the first attitude brings the body to the room.
    """

    rate: float
    fineness: int
    attitude: np.ndarray = field(default_factory=lambda: so3.exponential(np.zeros(3)))
    place: np.ndarray = field(default_factory=lambda: np.zeros(3))
    steps: list[Step] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._quaternions: list[np.ndarray] = []
        self._places: list[np.ndarray] = []
        self.samples = 0

    @property
    def seconds(self) -> float:
        """How long the path is so far."""
        return self.samples / self.rate

    def _grid(self, seconds: float) -> tuple[np.ndarray, int, float]:
        count = max(1, round(seconds * self.rate))
        exact = count / self.rate
        return np.arange(count * self.fineness) / (count * self.fineness) * exact, count, exact

    def add(self, kind, seconds, attitude, place=None, name="") -> None:
        """Append a piece.

        `attitude` and `place` are functions of the seconds since its start; at its end the next piece starts.
        """
        time, count, exact = self._grid(seconds)
        here = self.place
        moved = place or (lambda t: np.zeros((*np.shape(t), 3)))
        self._quaternions.append(attitude(time))
        self._places.append(here + moved(time))
        end = np.array([exact])
        self.attitude = attitude(end)[0]
        self.place = here + moved(end)[0]
        self.steps.append(Step(kind, self.seconds, self.seconds + exact, name))
        self.samples += count

    def hold(self, seconds, hand=STILL, rng=None, name="") -> None:
        """Rest, as steadily as the hand does; the pose at the end is that of the start."""
        start = self.attitude
        exact = max(1, round(seconds * self.rate)) / self.rate
        if rng is None or hand is STILL:
            self.add("hold", seconds, lambda t: np.broadcast_to(start, (*np.shape(t), 4)).copy(), None, name)
            return
        frequencies = np.concatenate((rng.uniform(7, 11, 3), rng.uniform(0.1, 0.6, 2)))
        phases = rng.uniform(0, 2 * np.pi, (5, 3, 2))
        sizes = rng.standard_normal((5, 3, 2)) * np.array([hand.tremor] * 3 + [hand.sway] * 2)[:, None, None]
        sizes[:, :, 1] *= hand.shake / max(hand.tremor, 1e-30)
        sizes[3:, :, 1] *= 10.0

        def waves(t: np.ndarray, which: int) -> np.ndarray:
            inside = np.clip(np.minimum(t, exact - t) / 0.4, 0.0, 1.0)
            angle = 2 * np.pi * t[:, None, None] * frequencies[None, :, None] + phases[None, :, :, which]
            return eased(inside)[:, None] * np.sum(sizes[None, :, :, which] * np.sin(angle), axis=1)

        self.add(
            "hold",
            seconds,
            lambda t: so3.multiply(start, so3.exponential(waves(t, 0))),
            lambda t: waves(t, 1),
            name,
        )

    def creep(self, seconds: float, by: np.ndarray, profile: Profile = eased, name: str = "") -> None:
        """Rest badly: the pose moves during the hold and stays there.

        `by` is a rotation vector in the body, rad; the profile is its share by share of the time.
        """
        start = self.attitude
        exact = max(1, round(seconds * self.rate)) / self.rate
        self.add(
            "hold",
            seconds,
            lambda t: so3.multiply(start, so3.exponential(profile(t / exact)[:, None] * by)),
            None,
            name,
        )

    def reach(self, target, seconds, hand=STILL, rng=None) -> None:
        """Turn to another attitude, or begin there."""
        if self.samples:
            self.turn_to(target, seconds, hand, rng)
        else:
            self.attitude = target

    def turn_to(self, target, seconds, hand=STILL, rng=None, name="") -> None:
        """Turn to another attitude by the shortest way, as a hand does, with a detour and lifted where it does so."""
        start = self.attitude
        exact = max(1, round(seconds * self.rate)) / self.rate
        way = so3.logarithm(so3.multiply(so3.inverse(start), target))
        detour = np.zeros(3) if rng is None else hand.astray * rng.standard_normal(3)
        lift = np.zeros(3) if rng is None else hand.lift * rng.standard_normal(3)

        def attitude(t: np.ndarray) -> np.ndarray:
            share = t / exact
            main = so3.exponential(eased(share)[:, None] * way)
            return so3.multiply(so3.multiply(start, main), so3.exponential(bump(share)[:, None] * detour))

        self.add("turn", seconds, attitude, lambda t: bump(t / exact)[:, None] * lift, name)

    def revolve(self, axis, angle, seconds, name="", *, kind="turn", profile=eased, wobble=0.0, slip=None):
        """Turn about an axis that is fixed in the room, as a motor does.

        The axis may go round on a cone once a revolution (`wobble`, rad), the unit slip in its mount (`slip`, rad).
        """
        start = self.attitude
        exact = max(1, round(seconds * self.rate)) / self.rate
        axis = np.asarray(axis, float) / np.linalg.norm(axis)
        across = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.8 else [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        other = np.cross(axis, across)
        moved = np.zeros(3) if slip is None else slip

        def attitude(t: np.ndarray) -> np.ndarray:
            share = t / exact
            turned = (angle * profile(share))[:, None]
            tilt = wobble * ((np.cos(turned) - 1) * across + np.sin(turned) * other)
            room = so3.multiply(so3.exponential(tilt), so3.exponential(turned * axis))
            return so3.multiply(so3.multiply(room, start), so3.exponential(eased(share)[:, None] * moved))

        self.add(kind, seconds, attitude, None, name)

    def track(self) -> tuple[np.ndarray, np.ndarray]:
        """Return s and quaternions (body to room) of the whole path, as finely as it is evaluated."""
        attitude = np.concatenate([*self._quaternions, self.attitude[None]])
        return np.arange(len(attitude)) / (self.rate * self.fineness), attitude

    def sampled(self, earth_rate: np.ndarray, gravity: float, lever: np.ndarray) -> Sampled:
        """Return what ideal sensors at one place see, each sample the mean over its interval.

        `lever` is from the point that the motions are about to the unit, along its axes, m.
        """
        q = np.concatenate([*self._quaternions, self.attitude[None]])
        where = np.concatenate([*self._places, self.place[None]]) + so3.rotate(q, lever)
        h = 1.0 / (self.rate * self.fineness)
        turned = so3.logarithm(so3.multiply(so3.inverse(q[:-1]), q[1:])) / h
        middle = q[:-1] + np.where(np.sum(q[:-1] * q[1:], axis=1, keepdims=True) < 0, -1.0, 1.0) * q[1:]
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        to_body = so3.inverse(middle)
        # At the path's ends the unit is at rest.
        padded = np.concatenate((where[:1], where, where[-1:]))
        at_points = (padded[2:] - 2 * padded[1:-1] + padded[:-2]) / h**2
        acceleration = 0.5 * (at_points[:-1] + at_points[1:])
        force = so3.rotate(to_body, acceleration - np.array([0.0, 0.0, gravity]))
        rate = turned + so3.rotate(to_body, earth_rate)
        shape = (self.samples, self.fineness, 3)
        time = (np.arange(self.samples) + 0.5) / self.rate
        return Sampled(
            time, force.reshape(shape), rate.reshape(shape), middle[self.fineness // 2 :: self.fineness]
        )


@dataclass
class Sampled:
    """What ideal sensors see: times of the samples, true specific force and rate at the fine instants of each."""

    time: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    attitude: np.ndarray
