"""A triad's unknowns in Shin and El-Sheimy's convention, and what moves its corrected output.

Twelve numbers in this order: bias (3, raw units), scale factor (3, raw per SI unit), the angles
yz, zx, zy (rad), quadratic terms (3, 1 / raw unit). An adjustment frees any subset of them.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vectors, inverted
from tumble.records import dataclass
from tumble.sensor import Triad
from tumble.sensor.conventions.shin import matrix_from_shin, shin_derivatives, shin_from_matrix

COUNT = 12
BIAS, SCALE, ANGLE, QUADRATIC = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


@dataclass(frozen=True, slots=True)
class CorrectedOutput:
    """Corrected vectors and their derivatives.

    Attributes
    ----------
    value : (holds, 3) SI, in b.
    by_unknowns : (holds, 3, 12).
    by_raw : (holds, 3, 3), with respect to the raw vector.
    """

    value: Vectors
    by_unknowns: AnyArray
    by_raw: AnyArray


def triad_from_unknowns(unknowns: Series) -> Triad:
    """Return the triad of twelve unknowns, in the frame ``accelerometer-x``."""
    matrix: Matrix = np.real(matrix_from_shin(unknowns[SCALE], unknowns[ANGLE]))
    quadratic = unknowns[QUADRATIC]
    return Triad(matrix, unknowns[BIAS].copy(), None, quadratic.copy() if np.any(quadratic) else None)


def unknowns_from_triad(triad: Triad) -> Series:
    """Return the twelve unknowns of a triad in the frame ``accelerometer-x``.

    Raises
    ------
    ValueError
        If its matrix is not lower triangular.
    """
    scale, angles = shin_from_matrix(triad.matrix)
    quadratic = np.zeros(3) if triad.quadratic is None else triad.quadratic
    return np.concatenate([triad.bias, np.real(scale), np.real(angles), quadratic])


def correct_with_derivatives(unknowns: Series, raw: Vectors) -> CorrectedOutput:
    """Correct `raw` with twelve unknowns and differentiate by them and by `raw`.

    Notes
    -----
    ``true = inv(M) u`` with ``raw = u + quadratic u² + bias``, hence
    d true = inv(M) (du - dM true), du = (d raw - d bias - u² d quadratic) / (1 + 2 quadratic u).
    """
    triad = triad_from_unknowns(unknowns)
    own_input = triad.own_input(raw)
    inverse = inverted(triad.matrix)
    true = own_input @ inverse.T
    slope = 1.0 / (1.0 + 2.0 * unknowns[QUADRATIC] * own_input)

    by_raw = inverse[None, :, :] * slope[:, None, :]
    by_unknowns = np.empty((raw.shape[0], 3, COUNT))
    by_unknowns[:, :, BIAS] = -by_raw
    by_unknowns[:, :, QUADRATIC] = -by_raw * (own_input**2)[:, None, :]
    moves = np.einsum("ab,bcp->acp", inverse, shin_derivatives(unknowns[3:9]))
    by_unknowns[:, :, 3:9] = -np.einsum("acp,kc->kap", moves, true)
    return CorrectedOutput(true, by_unknowns, by_raw)
