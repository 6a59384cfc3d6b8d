"""The axis of a rotation, as the gyros see it and as the accelerometers do (Zhang et al. 2010, (41) to (47)).

While a table turns, the specific force along its axis does not change: gravity's part along a fixed axis
is constant, and what a lever arm adds is always across it. The specific forces lie in a plane, and the
axis is its normal. If the axis is vertical they lie in a point, and nothing is to be seen.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray


def axis_from_rotation(matrix: AnyArray, rotation: AnyArray) -> AnyArray:
    """Return the unit axis in the gyros' frame o.

    Parameters
    ----------
    matrix : (..., 3, 3) of the gyros in o, raw per SI unit.
    rotation : (..., 3) raw·s, integral of a rotation without bias and Earth rate, such as the difference
        of the two directions.

    Notes
    -----
    Zhang et al. 2010, (41).
    """
    vector = np.linalg.solve(matrix, rotation[..., None])[..., 0]
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def scatter_in_p(matrix: AnyArray, raw_scatter: AnyArray) -> AnyArray:
    """Return the scatter (..., 3, 3) of true specific forces from that of raw ones.

    Parameters
    ----------
    matrix : (..., 3, 3) of the accelerometers.
    raw_scatter : (..., 3, 3), the mean of products of the deviations from the mean, raw units squared.
    """
    inverse = np.linalg.inv(matrix)
    return inverse @ raw_scatter @ np.swapaxes(inverse, -1, -2)


def axis_from_scatter(scatter: AnyArray) -> AnyArray:
    """Return the unit normal of the plane that the specific forces lie in; its sign is open.

    Parameters
    ----------
    scatter : (..., 3, 3) of the specific force about its mean, true units.

    Notes
    -----
    Zhang et al. 2010, (44) to (47). The matrix A of (46) is not square: ς is its right null vector.
    About the mean κ has gone; both ways are as good.
    """
    return np.ascontiguousarray(np.linalg.eigh(scatter)[1][..., :, 0])
