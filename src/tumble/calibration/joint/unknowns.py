"""The unknowns of the joint estimator, and the sensors' raw output with its derivatives by them.

The shared unknowns are those of `turn_conditions` without its Earth rate (which is each section's own
here): accelerometer bias, scale, angles and quadratic terms as Shin has them, the gyro's whole matrix, its
bias and its g-sensitivity. The model runs forwards, from true to raw: noise is a sensor's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vectors
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, COUNT, QUADRATIC, SCALE
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble.sensor.propagation import jacobian

FORCE = slice(0, COUNT)
GYRO_MATRIX = slice(12, 21)
GYRO_BIAS = slice(21, 24)
G_SENSITIVITY = slice(24, 33)
SHARED = 33
# Further ones, see `joint_wide`; a shorter vector has none of them.
FORCE_ASYMMETRY, RATE_ASYMMETRY, RATE_QUADRATIC = slice(36, 39), slice(39, 42), slice(52, 55)


@dataclass(frozen=True, slots=True)
class RawForce:
    """Raw output of the accelerometers: (rows, 3), by the true force (rows, 3, 3), by the unknowns (rows, 3, all)."""

    value: Vectors
    by_true: AnyArray
    by_unknowns: AnyArray


def raw_force(unknowns: Series, true: Vectors, apart: AnyArray | None = None) -> RawForce:
    """Return what the accelerometers show for a specific force in b, with derivatives.

    Parameters
    ----------
    unknowns : (33,) or more.
    true : (rows, 3) m/s².
    apart : (rows, 3, 3) m/s² that each accelerometer (second) feels beyond it where it sits; None for one place.
    """
    matrix = force_matrix(unknowns)
    quadratic = unknowns[QUADRATIC]
    felt = true[:, None, :] if apart is None else true[:, None, :] + apart
    own = np.einsum("ab,nab->na", matrix, np.broadcast_to(felt, (len(true), 3, 3)))
    asymmetry = _asymmetry(unknowns, FORCE_ASYMMETRY)
    slope = 1.0 + asymmetry * np.sign(own) + 2.0 * quadratic * own
    by_unknowns = np.zeros((true.shape[0], 3, unknowns.size))
    by_unknowns[:, range(3), range(BIAS.start, BIAS.stop)] = 1.0
    by_unknowns[:, range(3), range(QUADRATIC.start, QUADRATIC.stop)] = own**2
    if unknowns.size >= FORCE_ASYMMETRY.stop:
        by_unknowns[:, range(3), range(FORCE_ASYMMETRY.start, FORCE_ASYMMETRY.stop)] = np.abs(own)
    moves = jacobian(lambda p: matrix_from_shin(p[:3], p[3:6]).ravel(), unknowns[SCALE.start : ANGLE.stop])
    turned = np.einsum("abp,nab->nap", moves.reshape(3, 3, 6), np.broadcast_to(felt, (len(true), 3, 3)))
    by_unknowns[:, :, SCALE.start : ANGLE.stop] = slope[:, :, None] * turned
    return RawForce(
        own + asymmetry * np.abs(own) + quadratic * own**2 + unknowns[BIAS],
        slope[:, :, None] * matrix,
        by_unknowns,
    )


@dataclass(frozen=True, slots=True)
class RawRate:
    """Raw output of the gyros: (rows, 3), and by the unknowns (rows, 3, all)."""

    value: Vectors
    by_unknowns: AnyArray


def raw_rate(unknowns: Series, true: Vectors, force: Vectors) -> RawRate:
    """Return what the gyros show for an angular rate in b while a specific force acts.

    Parameters
    ----------
    unknowns : (33,) or more.
    true, force : (rows, 3) rad/s and m/s².
    """
    matrix, sensitivity = gyro_matrix(unknowns), unknowns[G_SENSITIVITY].reshape(3, 3)
    by_unknowns = np.zeros((true.shape[0], 3, unknowns.size))
    own, asymmetry = true @ matrix.T, _asymmetry(unknowns, RATE_ASYMMETRY)
    quadratic = _asymmetry(unknowns, RATE_QUADRATIC)
    slope = 1.0 + asymmetry * np.sign(own) + 2.0 * quadratic * own
    if unknowns.size >= RATE_ASYMMETRY.stop:
        by_unknowns[:, range(3), range(RATE_ASYMMETRY.start, RATE_ASYMMETRY.stop)] = np.abs(own)
    if unknowns.size >= RATE_QUADRATIC.stop:
        by_unknowns[:, range(3), range(RATE_QUADRATIC.start, RATE_QUADRATIC.stop)] = own**2
    for i in range(3):
        by_unknowns[:, i, GYRO_MATRIX.start + 3 * i : GYRO_MATRIX.start + 3 * i + 3] = (
            slope[:, i : i + 1] * true
        )
        by_unknowns[:, i, GYRO_BIAS.start + i] = 1.0
        by_unknowns[:, i, G_SENSITIVITY.start + 3 * i : G_SENSITIVITY.start + 3 * i + 3] = force
    value = own + asymmetry * np.abs(own) + quadratic * own**2 + force @ sensitivity.T + unknowns[GYRO_BIAS]
    return RawRate(value, by_unknowns)


def without_asymmetry(unknowns: Series, raw: Vectors) -> Vectors:
    """Return what the gyros would show if they were symmetric and linear, their own sign taken from the output.

    Parameters
    ----------
    unknowns : all.
    raw : (samples, 3).
    """
    asymmetry, quadratic = _asymmetry(unknowns, RATE_ASYMMETRY), _asymmetry(unknowns, RATE_QUADRATIC)
    if not np.any(asymmetry) and not np.any(quadratic):
        return raw
    output = raw - unknowns[GYRO_BIAS]
    slope = 1.0 + asymmetry * np.sign(output)
    # Of the two inputs that a parabola gives, the one that is near; beyond its vertex there is none.
    root = np.sqrt(np.maximum(slope**2 + 4.0 * quadratic * output, 0.0))
    return unknowns[GYRO_BIAS] + 2.0 * output / (slope + root)


def _asymmetry(unknowns: Series, place: slice) -> Series:
    if unknowns.size < place.stop:
        return np.zeros(3)
    return np.asarray(unknowns[place], dtype=np.float64)


def force_matrix(unknowns: Series) -> Matrix:
    """Return the accelerometers' matrix, raw per m/s², in the frame ``accelerometer-x``."""
    return np.ascontiguousarray(np.real(matrix_from_shin(unknowns[SCALE], unknowns[ANGLE])), dtype=np.float64)


def gyro_matrix(unknowns: Series) -> Matrix:
    """Return the gyros' matrix, raw per rad/s."""
    return np.ascontiguousarray(unknowns[GYRO_MATRIX].reshape(3, 3))
