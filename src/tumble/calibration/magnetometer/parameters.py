"""A magnetometer's numbers as people know them: hard iron, soft iron, and how it is turned against the body frame.

The matrix is split as ``M = P R``: P symmetric (scale factors and soft iron), R the rotation from b to the sensor's own
axes, of which the nearest turn by right angles is taken off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series, Square
from tumble.attitude.rotations import analytic_rotation_vector
from tumble.calibration.estimate import NamedValue
from tumble.sensor import polar_rotation, propagate

Complex = npt.NDArray[Any]


def named_parameters(
    numbers: Series, covariance: Square, raw_unit: str, field_unit: str, *, turned: bool = True
) -> list[NamedValue]:
    """Return bias, soft iron as a symmetric matrix, and the rotation from b to the magnetometer's own axes.

    Parameters
    ----------
    numbers, covariance : (12,) matrix by rows and bias, and (12, 12).
    raw_unit, field_unit : of what goes in and of what comes out.
    turned : with the rotation, which a magnetometer alone does not tell.
    """
    nearest = nearest_axes(np.real(numbers[:9]).reshape(3, 3))

    def evaluate(x: Complex) -> Complex:
        matrix = x[:9].reshape(3, 3)
        turn = polar_rotation(matrix)
        soft = matrix @ turn.T
        parts = [x[9:12], np.diag(soft), np.array([soft[1, 2], soft[0, 2], soft[0, 1]])]
        if turned:
            parts.append(analytic_rotation_vector(turn @ nearest.T))
        return np.concatenate(parts)

    values, spread = propagate(evaluate, numbers, covariance)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    per = f"{raw_unit}/({field_unit})"
    labels = [(f"magnetometer bias {a}", raw_unit) for a in "xyz"]
    labels += [(f"magnetometer scale factor {a}", per) for a in "xyz"]
    labels += [(f"magnetometer soft iron {pair}", per) for pair in ("yz", "xz", "xy")]
    if turned:
        labels += [(f"rotation of the magnetometer {a}", "rad") for a in "xyz"]
    return [
        NamedValue(name, float(v), float(s), unit)
        for (name, unit), v, s in zip(labels, values, sigmas, strict=True)
    ]


def nearest_axes(matrix: Matrix) -> Matrix:
    """Return the signed permutation that is nearest to a triad's own axes: rows are the axes of b along which they lie.

    Parameters
    ----------
    matrix : (3, 3) of a triad.
    """
    from itertools import permutations, product

    turn = np.real(polar_rotation(matrix))
    best, largest = np.eye(3), -np.inf
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        made = np.zeros((3, 3))
        made[range(3), order] = signs
        near = float(np.sum(made * turn))
        if near > largest and np.linalg.det(made) > 0.0:
            best, largest = made, near
    return best
