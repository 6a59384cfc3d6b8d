"""The sequences of the strapdown rotation test played with finite errors, without samples: exact and fast.

A fixture turns the unit about lines that are fixed in the unit, so that each rotation is one exponential of
what the gyros make of it, and a test with any errors is a product of some rotations. Products of errors, which
a first-order analysis leaves out, are all in it; noise and the Earth's rotation are not.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Table
from tumble.protocol.strapdown_rotation import RotationSequence, start_down
from tumble.records import dataclass
from tumble.sensor.conventions.savage import GROUPS, OFF_DIAGONAL, PAIRS

SENSORS = 24
MOUNTING = slice(24, 27)
TILT = slice(27, 29)
SHARED = 29
"""Columns of `errors` that all sequences share: 24 of the sensors, mounting about b, lean about the fixture's x, y."""


def error_count(row: RotationSequence) -> int:
    """Return how many errors a sequence has: those shared, and each stop's: inner, outer, then one a rotation.

    Parameters
    ----------
    row : of table 1.
    """
    return SHARED + 2 + len(row.rotations)


def play_exactly(
    row: RotationSequence, errors: Table, gravity: float, *, norm: bool = True, known: Table | None = None
) -> Table:
    """Return what a sequence measures, (runs, 5) m/s², with the errors of each run.

    Parameters
    ----------
    row : of table 1.
    errors : (runs, `error_count(row)`): sensor errors as `savage.NAMES`, the fixture's in rad.
    gravity : m/s².
    norm : down is gravity less the length of the acceleration, not its projection.
    known : (runs, 24) errors that the compensation takes out; none by default.

    Notes
    -----
    Savage 2018, (1) and (2), with rotations of the fixture of `simulation.two_axis`.
    """
    sensors = _Sensors(errors[:, :SENSORS])
    believed = _Sensors(np.zeros((len(errors), SENSORS)) if known is None else known)
    mounting_t = np.swapaxes(_exponentials(errors[:, MOUNTING]), 1, 2)
    lean = np.zeros((len(errors), 3))
    lean[:, :2] = errors[:, TILT]
    down_t = np.swapaxes(_exponentials(lean), 1, 2)[:, :, 2]
    inner, outer = row.inner + errors[:, SHARED], row.outer + errors[:, SHARED + 1]
    nominal = row.fixture_angles()
    attitude = np.tile(np.eye(3), (len(errors), 1, 1))
    first = _down(mounting_t, inner, outer, down_t)
    for k, (axis, _) in enumerate(row.rotations):
        error = errors[:, SHARED + 2 + k]
        if axis == 2:
            # The inner axis is the body's z, but for the mounting.
            along, turned = mounting_t[:, :, 2], nominal[k + 1][0] + error - inner
            inner = inner + turned
        else:
            along = np.einsum("rij,rj->ri", mounting_t, _turned_back(inner, 2)[:, :, 1])
            turned = nominal[k + 1][1] + error - outer
            outer = outer + turned
        increment = believed.rates(sensors.gyros(along * turned[:, None]))
        attitude = attitude @ _exponentials(increment)
    start = believed.forces(sensors.accelerometers(-gravity * first))
    last = _down(mounting_t, inner, outer, down_t)
    end = np.einsum("rij,rj->ri", attitude, believed.forces(sensors.accelerometers(-gravity * last)))
    down = start_down(row)
    measured = np.empty((len(errors), 5))
    change = end - start
    measured[:, :3] = change - (change @ down)[:, None] * down
    for column, seen in ((3, start), (4, end)):
        measured[:, column] = gravity - np.linalg.norm(seen, axis=1) if norm else seen @ down + gravity
    return measured


@dataclass(slots=True)
class _Triads:
    """Matrices and the rest of both triads, by runs."""

    gyro: AnyArray
    gyro_asymmetry: AnyArray
    force: AnyArray
    force_asymmetry: AnyArray
    bias: AnyArray


class _Sensors:
    """Both triads by runs: forward, and what corrects them."""

    def __init__(self, errors: Table) -> None:
        gyro = np.tile(np.eye(3), (len(errors), 1, 1))
        force = gyro.copy()
        for i in range(3):
            gyro[:, i, i] += errors[:, i]
            force[:, i, i] += errors[:, 12 + i]
        for number, (i, j) in enumerate(PAIRS):
            gyro[:, i, j] = gyro[:, j, i] = 0.5 * errors[:, 6 + number]
        for number, (i, j) in enumerate(OFF_DIAGONAL):
            force[:, i, j] = errors[:, 18 + number]
        self.triads = _Triads(
            gyro,
            errors[:, GROUPS["kappa_asym"]],
            force,
            errors[:, GROUPS["lambda_asym"]],
            errors[:, GROUPS["lambda_bias"]],
        )

    def gyros(self, true: Table) -> AnyArray:
        own = np.einsum("rij,rj->ri", self.triads.gyro, true)
        return own + self.triads.gyro_asymmetry * np.abs(own)

    def accelerometers(self, true: Table) -> AnyArray:
        own = np.einsum("rij,rj->ri", self.triads.force, true)
        return own + self.triads.force_asymmetry * np.abs(own) + self.triads.bias

    def rates(self, raw: AnyArray) -> AnyArray:
        own = raw / (1.0 + self.triads.gyro_asymmetry * np.sign(raw))
        return np.asarray(np.linalg.solve(self.triads.gyro, own[:, :, None])[:, :, 0], dtype=np.float64)

    def forces(self, raw: AnyArray) -> AnyArray:
        shifted = raw - self.triads.bias
        own = shifted / (1.0 + self.triads.force_asymmetry * np.sign(shifted))
        return np.asarray(np.linalg.solve(self.triads.force, own[:, :, None])[:, :, 0], dtype=np.float64)


def _down(mounting_t: AnyArray, inner: AnyArray, outer: AnyArray, down_t: AnyArray) -> AnyArray:
    """(runs, 3) down in the body frame."""
    back = mounting_t @ _turned_back(inner, 2) @ _turned_back(outer, 1)
    return np.einsum("rij,rj->ri", back, down_t)


def _turned_back(angle: AnyArray, axis: int) -> AnyArray:
    """(runs, 3, 3): the inverse of a rotation by the angle about x, y or z."""
    vector = np.zeros((len(angle), 3))
    vector[:, axis] = -angle
    return _exponentials(vector)


def _exponentials(vectors: AnyArray) -> AnyArray:
    """(runs, 3, 3) rotations of rotation vectors."""
    angle = np.linalg.norm(vectors, axis=1)
    # sin(x)/x and (1 - cos(x))/x², which numpy's sinc has at zero, too
    one = np.sinc(angle / np.pi)
    two = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    cross = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= np.swapaxes(cross, 1, 2)
    return np.eye(3) + one[:, None, None] * cross + two[:, None, None] * (cross @ cross)
