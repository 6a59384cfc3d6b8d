"""What gyros of a known matrix show at rest: bias, g-sensitivity and the Earth's rotation.

Where up is, the accelerometers show; how much of the Earth rate is along it, the latitude tells. What is
across the vertical depends on a heading that nobody knows, and counts as noise: gyros that see the Earth
well are thereby judged along the vertical alone, gyros that do not by all three components.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.earth import EARTH_RATE
from tumble.records import dataclass

BIAS, SENSITIVITY = slice(0, 3), slice(3, 12)
UNKNOWNS = 12
# A recording without noise has weights all the same; the best gyros know a hold to some hundred times that.
LEAST_NOISE = 1e-5 * EARTH_RATE


@dataclass(frozen=True, slots=True)
class RestSolution:
    """Biases and g-sensitivity.

    Attributes
    ----------
    bias : (3,) raw.
    sensitivity : (3, 3) raw per m/s²; zero where it was not asked for.
    covariance : (12, 12) of bias and sensitivity (by rows); zero rows for what was not asked for.
    square_sum, degrees : of the residuals.
    """

    bias: Vector
    sensitivity: Matrix
    covariance: Square
    square_sum: float
    degrees: int


def solve_rests(
    matrix: Matrix,
    rest: Vectors,
    covariance: AnyArray,
    force_b: Vectors,
    vertical_rate: float,
    horizontal_rate: float,
    *,
    with_sensitivity: bool,
) -> RestSolution:
    """Solve biases, and the g-sensitivity if wanted, by least squares over all rests.

    Parameters
    ----------
    matrix : (3, 3) of the gyros, from b to raw.
    rest, covariance : (rests, 3), (rests, 3, 3) raw means.
    force_b : (rests, 3) true specific force, m/s².
    vertical_rate : rad/s, of the Earth rate upwards.
    horizontal_rate : rad/s, of the Earth rate across, whose heading is not known.
    with_sensitivity : estimate it.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the rests do not tell the unknowns.
    """
    up = force_b / np.linalg.norm(force_b, axis=1, keepdims=True)
    told = rest - vertical_rate * (up @ matrix.T)
    across = np.eye(3) - np.einsum("ki,kj->kij", up, up)
    spread = covariance + 0.5 * horizontal_rate**2 * (matrix @ across @ matrix.T)
    spread = spread + LEAST_NOISE**2 * (matrix @ matrix.T)
    weight = np.asarray(np.linalg.inv(spread), dtype=np.float64)
    count = UNKNOWNS if with_sensitivity else 3
    design = np.zeros((len(rest), 3, count))
    design[:, :, :3] = np.eye(3)
    if with_sensitivity:
        for i in range(3):
            design[:, i, 3 + 3 * i : 6 + 3 * i] = force_b
    weighted = np.einsum("kij,kjp->kip", weight, design)
    normal = np.einsum("kip,kiq->pq", design, weighted)
    # Raw counts of rate and of rate per m/s² differ by powers of ten.
    size = 1.0 / np.sqrt(np.diag(normal))
    cofactor = np.outer(size, size) * inverted(normal * np.outer(size, size))
    values: Series = cofactor @ np.einsum("kip,ki->p", weighted, told)
    residual = told - np.einsum("kip,p->ki", design, values)
    full = np.zeros((UNKNOWNS, UNKNOWNS))
    full[:count, :count] = cofactor
    return RestSolution(
        bias=values[:3].copy(),
        sensitivity=values[3:].reshape(3, 3).copy() if with_sensitivity else np.zeros((3, 3)),
        covariance=full,
        square_sum=float(np.einsum("ki,kij,kj->", residual, weight, residual)),
        degrees=3 * len(rest) - count,
    )
