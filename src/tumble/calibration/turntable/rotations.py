"""What the calibrated gyros make of a table's rotations, an axis at a time: for the turntable and the laboratory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Matrix, Vector, inverted
from tumble.calibration.closed_forms.rotation_pairs import RotationPair
from tumble.calibration.evidence import Spins, TurnedAngle


def spins_evidence(
    pairs: Sequence[RotationPair], axes_b: Sequence[Vector], matrix: Matrix, parts: dict[int, Vector]
) -> Spins:
    """Return mean rates of all rotations, found in a pair or not, and what the gyros show beyond them.

    Parameters
    ----------
    pairs : rotations both ways about each axis.
    axes_b : unit vectors in b.
    matrix : (3, 3) of the gyros.
    parts : of bias and Earth rate in each rotation, raw·s, by `Rotation.row`.
    """
    count = 1 + max(r.row for pair in pairs for r in pair.rotations)
    inverse = inverted(matrix)
    rates, names = np.zeros(count), ["a rotation without its counterpart"] * count
    residuals, sigmas = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    for pair, axis in zip(pairs, axes_b, strict=True):
        for side, sign in ((pair.forward, 1.0), (pair.backward, -1.0)):
            for r in side:
                rates[r.row] = sign * abs(r.angle) / r.seconds
                turned = inverse @ (r.integral - parts[r.row])
                residuals[r.row] = (turned - sign * abs(r.angle) * axis) / r.seconds
                spread = inverse @ r.covariance @ inverse.T + r.angle_sigma**2 * np.outer(axis, axis)
                sigmas[r.row] = np.sqrt(np.diag(spread)) / r.seconds
                names[r.row] = f"{pair.name}, {'counter-clockwise' if sign > 0 else 'clockwise'}"
    return Spins(rates, residuals, sigmas, tuple(names))


def turned_angles(
    pair: RotationPair, axis_b: Vector, matrix: Matrix, parts: dict[int, Vector]
) -> tuple[TurnedAngle, ...]:
    """Return the angles of one axis, as the table and as the gyros have them.

    Parameters
    ----------
    pair : rotations both ways.
    axis_b, matrix, parts : as for `spins_evidence`.
    """
    inverse = inverted(matrix)
    weight = axis_b @ inverse
    angles: list[TurnedAngle] = []
    for r in pair.rotations:
        sign = 1.0 if r in pair.forward else -1.0
        turned = float(axis_b @ (inverse @ (r.integral - parts[r.row]))) * sign
        sigma = float(np.sqrt(weight @ r.covariance @ weight + r.angle_sigma**2))
        residual = turned - abs(r.angle)
        angles.append(TurnedAngle(r.row, sign * abs(r.angle), residual, sigma, r.seconds, r.is_from_rest))
    return tuple(angles)
