"""A magnetometer on the unit: a field of the place in, raw numbers out.

The field is a vector in the room (north, east, down) of norm F, dip I (down positive) and declination D::

    f   = F (cos I cos D, cos I sin D, sin I) + G p + c(t)
    raw = M C(q)' f + h + noise, rounded to steps

M holds soft iron, scale, non-orthogonality and the sensor's rotation against the case; h is the hard iron; p is where
the unit is (G: how the field differs from place to place); c(t) is what a current adds that is switched on.
"""

from dataclasses import dataclass, field

import numpy as np

from . import rotations as so3
from .motion import Path
from .recording import Simulation
from .sensors import DEGREE, small_rotation
from .truth import rotation_to


@dataclass(frozen=True)
class Disturbance:
    """What is wrong with the field.

    `gradient` (3, 3) in µT/m over the hand's path; `current` (3,) µT in the room from `since` s on; `iron` (3,) µT per
    hold that it stands near, by the hold's index; `reach` m by which a hand puts holds at different places.
    """

    gradient: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    current: np.ndarray = field(default_factory=lambda: np.zeros(3))
    since: float = np.inf
    iron: dict[int, np.ndarray] = field(default_factory=dict[int, np.ndarray])
    reach: float = 0.1


@dataclass(frozen=True)
class Magnetometer:
    """Its errors, raw units per µT along the case's axes, and raw units."""

    matrix: np.ndarray
    hard_iron: np.ndarray
    noise: float
    step: float
    rate: float


@dataclass(frozen=True)
class Seen:
    """What it recorded: stamps on the recording's axis, raw numbers, and the truth."""

    time: np.ndarray
    values: np.ndarray
    magnetometer: Magnetometer
    norm: float
    dip: float
    simulation: Simulation

    def matrix(self, frame: str) -> np.ndarray:
        """Return the matrix in one of the documented frames."""
        return self.magnetometer.matrix @ rotation_to(self.simulation.truth.unit, frame).T


def draw_magnetometer(rng, *, counts=6.0, noise=0.4, step=1.0, rate=50.0, turned=5.0 * DEGREE):
    """Draw a magnetometer with soft iron of 5 %, hard iron of 30 µT and axes of its own.

    `counts` a µT, `noise` of a sample in µT, `step` in raw units, `turned` rad against the case.
    """
    soft = np.eye(3) + 0.05 * rng.standard_normal((3, 3))
    matrix = counts * soft @ small_rotation(turned * rng.standard_normal(3))
    return Magnetometer(matrix, counts * 30.0 * rng.standard_normal(3), counts * noise, step, rate)


def see(made, magnetometer, rng, *, norm=49.2, dip=66.0 * DEGREE, declination=4.0 * DEGREE, disturbance=None):
    """Let a magnetometer go through the motion of a simulation."""
    wrong = Disturbance() if disturbance is None else disturbance
    path = made.path
    grid, attitude = path.track()
    time = np.arange(0.5 / magnetometer.rate, path.seconds, 1.0 / magnetometer.rate)
    at = np.minimum(np.searchsorted(grid, time), len(attitude) - 1)
    level = np.array([np.cos(dip) * np.cos(declination), np.cos(dip) * np.sin(declination), np.sin(dip)])
    room = norm * level + places(path, time, wrong.reach, rng) @ wrong.gradient.T
    room = room + np.where(time[:, None] >= wrong.since, wrong.current, 0.0)
    holds = [step for step in path.steps if step.kind == "hold"]
    for index, extra in wrong.iron.items():
        inside = (time >= holds[index].start) & (time <= holds[index].stop)
        room[inside] += extra
    body = so3.rotate(so3.inverse(attitude[at]), room)
    raw = body @ magnetometer.matrix.T + magnetometer.hard_iron
    raw = raw + magnetometer.noise * rng.standard_normal(raw.shape)
    if magnetometer.step:
        raw = np.round(raw / magnetometer.step) * magnetometer.step
    return Seen(time + 12.0, raw, magnetometer, norm, dip, made)


def places(path: Path, time: np.ndarray, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Return (samples, 3) m where the unit is: each hold at another place, and between them on the way.

    `reach` is one sigma of the places, m.
    """
    holds = [step for step in path.steps if step.kind == "hold"]
    where = reach * rng.standard_normal((len(holds), 3))
    knots = np.ravel([(step.start, step.stop) for step in holds])
    return np.column_stack([np.interp(time, knots, np.repeat(where[:, axis], 2)) for axis in range(3)])
