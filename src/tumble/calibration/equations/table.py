"""The conditions of a unit in unknown poses on a table that turns about the vertical.

A placement k of the unit gives a group: the corrected specific force of its hold has the norm of gravity,
and its direction is the vertical, which the table turns about. For each of its spins s, averaged over
whole revolutions, with u the corrected specific force's direction and v the vertical Earth rate,

    raw_s = gyro_matrix @ (rate_s + v) u + g_sensitivity @ f + bias

in three components, written in rad/s. The norm of it is the condition of Syed et al. (2007); the other
two tell where the gyros stand against the accelerometers, as far as the table's axis is plumb.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vectors, inverted
from tumble.calibration.equations.triad_unknowns import correct_with_derivatives
from tumble.calibration.equations.turn import FORCE, G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX, TOTAL
from tumble.estimation import Linearisation
from tumble.records import dataclass

# The vertical Earth rate stands first of the three that the hand-held procedure has for it.
VERTICAL = 33


@dataclass(frozen=True, slots=True)
class TableReadings:
    """Placements on the table; spins padded to (placements, spins).

    Attributes
    ----------
    force, force_covariance : (placements, 3), (placements, 3, 3) raw means at rest.
    rate : (placements, spins) rad/s of the table about up, against the Earth.
    shown, shown_covariance : (placements, spins, 3), (placements, spins, 3, 3) raw mean rates.
    row : (placements, spins) which spin it is; -1 for padding and for what is left out.
    """

    force: Vectors
    force_covariance: Matrices
    rate: AnyArray
    shown: AnyArray
    shown_covariance: AnyArray
    row: np.ndarray

    @property
    def active(self) -> np.ndarray:
        """(placements, 1 + 3 spins) of bool, conditions that take part."""
        spins = np.repeat(self.row >= 0, 3, axis=1)
        return np.hstack([np.ones((self.row.shape[0], 1), dtype=bool), spins])


class TableConditions:
    """`Conditions` over the 36 unknowns of `turn_conditions`, the vertical Earth rate in place of three.

    Parameters
    ----------
    readings : see there.
    gravity : m/s².
    values : (36,) those not in `free` stay.
    free : indices of the unknowns to adjust.
    norm : (m/s²)², added to each norm: an accelerometer bias that wanders.
    wander : rad/s, added to each component of a spin.
    tilt : rad, of the table's axis against the vertical in each placement, about each axis.
    """

    def __init__(
        self,
        readings: TableReadings,
        gravity: float,
        values: Series,
        free: np.ndarray,
        *,
        norm: float = 0.0,
        wander: float = 0.0,
        tilt: float = 0.0,
    ) -> None:
        self.readings, self.gravity, self.values, self.free = readings, gravity, values.astype(float), free
        self.norm, self.wander, self.tilt = norm, wander, tilt
        self._force = readings.force.copy()
        self._by_force = np.zeros((*readings.active.shape, 3))

    def full(self, parameters: Series) -> Series:
        """Return all 36 unknowns with the free ones replaced."""
        values = self.values.copy()
        values[self.free] = parameters
        return values

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` (the free unknowns) and the adjusted means at rest."""
        readings, full = self.readings, self.full(parameters)
        groups, spins = readings.row.shape
        corrected = correct_with_derivatives(full[FORCE], self._force)
        true = corrected.value
        size = np.linalg.norm(true, axis=1)
        up = true / size[:, None]
        across = (np.eye(3) - np.einsum("ka,kb->kab", up, up)) / size[:, None, None]

        w, A = np.zeros((groups, 1 + 3 * spins)), np.zeros((groups, 1 + 3 * spins, TOTAL))
        by_true = np.zeros((groups, 1 + 3 * spins, 3))
        w[:, 0] = 0.5 * (size**2 / self.gravity - self.gravity)
        by_true[:, 0] = true / self.gravity
        inverse = inverted(full[GYRO_MATRIX].reshape(3, 3))
        sensitivity = inverse @ full[G_SENSITIVITY].reshape(3, 3)
        total = readings.rate + full[VERTICAL]
        for s in range(spins):
            at = slice(1 + 3 * s, 4 + 3 * s)
            turned = total[:, s, None] * up
            w[:, at] = turned + true @ sensitivity.T + (full[GYRO_BIAS] - readings.shown[:, s]) @ inverse.T
            by_true[:, at] = total[:, s, None, None] * across + sensitivity
            A[:, at, GYRO_BIAS], A[:, at, VERTICAL] = inverse, up
            for i in range(3):
                for j in range(3):
                    A[:, at, GYRO_MATRIX.start + 3 * i + j] = turned[:, j, None] * inverse[:, i]
                    A[:, at, G_SENSITIVITY.start + 3 * i + j] = true[:, j, None] * inverse[:, i]
        A[:, :, FORCE] = by_true @ corrected.by_unknowns
        self._by_force = by_true @ corrected.by_raw
        moved = readings.force - self._force
        w += np.einsum("kgb,kb->kg", self._by_force, moved)
        C = self._by_force @ readings.force_covariance @ np.swapaxes(self._by_force, 1, 2)
        C[:, 0, 0] += self.norm
        C[:, 1:, 1:] += self._spin_noise(inverse, total, up)
        self._by_force[~readings.active] = 0.0
        return Linearisation.masked(w, A[:, :, self.free], C, readings.active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Set the means at rest to observed + e, with e = -Q B' C^-1 (w + A xi) (Hayal 3.38)."""
        pull = np.einsum("kgb,kg->kb", self._by_force, multipliers)
        self._force = self.readings.force - np.einsum("kab,kb->ka", self.readings.force_covariance, pull)

    def _spin_noise(self, inverse: AnyArray, total: AnyArray, up: Vectors) -> AnyArray:
        """Return (groups, 3 spins, 3 spins) (rad/s)²: each spin's own, and the tilt common to a placement."""
        groups, spins = self.readings.row.shape
        across = np.eye(3) - np.einsum("ka,kb->kab", up, up)
        noise = self.tilt**2 * np.einsum("ks,kt,kab->kstab", total, total, across)
        own = inverse @ self.readings.shown_covariance @ inverse.T + self.wander**2 * np.eye(3)
        for spin in range(spins):
            noise[:, spin, spin] += own[:, spin]
        return np.swapaxes(noise, 2, 3).reshape(groups, 3 * spins, 3 * spins)
