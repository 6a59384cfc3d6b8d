"""The error model of a whole IMU: its triads and what couples them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Vectors
from tumble.records import dataclass
from tumble.sensor.triad import Triad


@dataclass(frozen=True, slots=True)
class ImuModel:
    """Accelerometer, gyro and magnetometer triads in one body frame b.

    Attributes
    ----------
    accelerometer, gyroscope : the triads; either may be None if the unit has none or the data did
        not tell it.
    g_sensitivity : (3, 3) raw gyro units per m/s², acting on the true specific force in b, or None.
    magnetometer : raw units per tesla (or per local field): its bias is the hard iron, its matrix holds soft iron,
        scale factors, non-orthogonality and the rotation to b; None without one.
    """

    accelerometer: Triad | None
    gyroscope: Triad | None
    g_sensitivity: Matrix | None = None
    magnetometer: Triad | None = None

    @staticmethod
    def ideal() -> ImuModel:
        """Return a unit without errors whose raw numbers are SI."""
        return ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))

    def distort(self, specific_force_b: Vectors, angular_rate_ib_b: Vectors) -> tuple[Vectors, Vectors]:
        """Return the raw (specific force, angular rate) for true ones in b, m/s² and rad/s.

        Raises
        ------
        ValueError
            If a triad is missing.
        """
        accelerometer, gyroscope = self._both()
        raw_rate = gyroscope.distort(angular_rate_ib_b)
        if self.g_sensitivity is not None:
            raw_rate = raw_rate + specific_force_b @ self.g_sensitivity.T
        return accelerometer.distort(specific_force_b), raw_rate

    def correct(self, raw_force: Vectors, raw_rate: Vectors) -> tuple[Vectors, Vectors]:
        """Return the true (specific force, angular rate) in b for raw ones: inverse of `distort`.

        Raises
        ------
        ValueError
            If a triad is missing or its matrix is singular.
        """
        accelerometer, gyroscope = self._both()
        force = accelerometer.correct(raw_force)
        if self.g_sensitivity is not None:
            raw_rate = raw_rate - force @ self.g_sensitivity.T
        return force, gyroscope.correct(raw_rate)

    def turned(self, C_new_b: Matrix) -> ImuModel:
        """Return the same unit described in another body frame: ``true_new = C_new_b @ true_b``."""
        return ImuModel(
            accelerometer=_turned(self.accelerometer, C_new_b),
            gyroscope=_turned(self.gyroscope, C_new_b),
            g_sensitivity=None if self.g_sensitivity is None else self.g_sensitivity @ C_new_b.T,
            magnetometer=_turned(self.magnetometer, C_new_b),
        )

    def _both(self) -> tuple[Triad, Triad]:
        if self.accelerometer is None or self.gyroscope is None:
            missing = "accelerometer" if self.accelerometer is None else "gyroscope"
            raise ValueError(f"the model has no {missing}")
        return self.accelerometer, self.gyroscope


def _turned(triad: Triad | None, C_new_b: Matrix) -> Triad | None:
    if triad is None:
        return None
    return replace(triad, matrix=np.asarray(triad.matrix @ C_new_b.T))
