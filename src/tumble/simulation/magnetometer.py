"""A simulated magnetometer: the field of the place, seen along the unit's path, with iron, noise and resolution."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Matrix, Vector, Vectors
from tumble.errors import UsageError
from tumble.recording import MagneticField
from tumble.records import dataclass
from tumble.sensor import Triad
from tumble.simulation.motion import Motion

_MICRO = 1e-6


@dataclass(frozen=True)
class MagnetometerGrade:
    """What kind of magnetometer, SI.

    Attributes
    ----------
    name, source : as it is asked for, and where the numbers are from.
    rate : Hz.
    noise, resolution : T, of a sample (rms), and of one step.
    hard_iron : T, one sigma of each axis; boards differ more than chips do.
    soft_iron : one sigma of each entry of the matrix, as a share.
    rotation : rad about each axis, one sigma, against the unit's axes.
    """

    name: str
    source: str
    rate: float
    noise: float
    resolution: float
    hard_iron: float = 30e-6
    soft_iron: float = 0.05
    rotation: float = 0.03

    def simulate_triad(self, rng: np.random.Generator) -> Triad:
        """Return one magnetometer of the grade: raw µT of a true field in T.

        Parameters
        ----------
        rng : source of its errors.
        """
        x, y, z = self.rotation * rng.standard_normal(3)
        turn = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        left, _, right = np.linalg.svd(turn)
        soft = np.eye(3) + self.soft_iron * rng.standard_normal((3, 3))
        bias = self.hard_iron * rng.standard_normal(3) / _MICRO
        return Triad(np.asarray(soft @ (left @ right).T / _MICRO, dtype=np.float64), bias)


MAGNETOMETER_GRADES: dict[str, MagnetometerGrade] = {
    grade.name: grade
    for grade in (
        MagnetometerGrade(
            "lis3mdl",
            "ST DocID024204: 3.2 mgauss rms in ultra-high-performance mode, 2281 LSB/gauss at ±12 gauss, 80 Hz",
            80.0,
            0.32e-6,
            1e-4 / 2281.0,
        ),
        MagnetometerGrade(
            "rm3100",
            "PNI RM3100 user manual: 15 nT of noise, 75 LSB/µT at 200 cycles",
            75.0,
            15e-9,
            1e-6 / 75.0,
        ),
    )
}


@dataclass(frozen=True)
class SimulatedMagnetometer:
    """A magnetometer on a simulated unit, in the field of the place.

    Attributes
    ----------
    grade, triad : its kind and its own errors, raw µT of a true field in T along the unit's axes b.
    norm, dip, declination : of the field, T and rad; the dip is positive where it points down.
    noise : whether noise and steps are added.
    current : (3,) T, north, east, down, by which the field changes at `since` s.
    """

    grade: MagnetometerGrade
    triad: Triad
    norm: float
    dip: float
    declination: float = 0.0
    noise: bool = True
    current: Vector = field(default_factory=lambda: np.zeros(3))
    since: float = np.inf

    @property
    def field_n(self) -> Vector:
        """(3,) T, north, east, down."""
        level = self.norm * np.cos(self.dip)
        return np.array(
            [
                level * np.cos(self.declination),
                level * np.sin(self.declination),
                self.norm * np.sin(self.dip),
            ]
        )

    def record(self, motion: Motion, rng: np.random.Generator) -> MagneticField:
        """Return what it shows along a motion, at its own rate.

        Parameters
        ----------
        motion : of the unit.
        rng : source of the noise.
        """
        time = np.arange(0.5 / self.grade.rate, motion.duration, 1.0 / self.grade.rate)
        field_n: Vectors = np.tile(self.field_n, (time.size, 1))
        field_n[time >= self.since] += self.current
        raw = self.triad.distort(motion.rotation_nb(time).inv().apply(field_n))
        if self.noise:
            step = self.grade.resolution / _MICRO
            raw = raw + self.grade.noise / _MICRO * rng.standard_normal(raw.shape)
            raw = np.round(raw / step) * step
        return MagneticField(time, np.asarray(raw, dtype=np.float64), "uT")

    def in_frame(self, C_new_b: Matrix) -> Triad:
        """Return its errors along the axes of another frame."""
        return Triad(np.asarray(self.triad.matrix @ C_new_b.T, dtype=np.float64), self.triad.bias)


def find_magnetometer(name: str) -> MagnetometerGrade:
    """Return the grade of a name.

    Parameters
    ----------
    name : of one of `MAGNETOMETER_GRADES`.

    Raises
    ------
    UsageError
        If there is none.
    """
    if name not in MAGNETOMETER_GRADES:
        raise UsageError(
            f"There is no magnetometer {name!r}: choose one of {', '.join(MAGNETOMETER_GRADES)}."
        )
    return MAGNETOMETER_GRADES[name]
