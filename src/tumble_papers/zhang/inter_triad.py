"""The rotation between the triads from axes that both have seen (Zhang et al. 2010, (39) to (47)).

``axis_o = R axis_p``, with o the frame of the gyros and p that of the accelerometers. All functions take
many sets at once.

While a table turns, the specific force along its axis does not change: gravity's part along a fixed axis
is constant, and what a lever arm adds is always across it. The specific forces lie in a plane, and the
axis is its normal. If the axis is vertical they lie in a point, and nothing is to be seen.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import ObservabilityError

# Axes nearer to one another than this do not tell the turn about them: 3 degrees.
SMALLEST_SINE = 0.05


def rotation_from_two_axes(axes_o: AnyArray, axes_p: AnyArray) -> AnyArray:
    """Return R as (40) has it: two axes and their cross product.

    It is a rotation only if the two axes enclose the same angle in both frames; with noise it is one to
    the first order.

    Parameters
    ----------
    axes_o, axes_p : (..., 2, 3) unit vectors.

    Raises
    ------
    ObservabilityError
        If the two axes are nearly parallel.
    """
    _refuse_parallel(axes_p)
    return _columns(axes_o) @ np.linalg.inv(_columns(axes_p))


def triad_rotation(axes_o: AnyArray, axes_p: AnyArray) -> AnyArray:
    """Return the rotation that takes the first axis exactly, and the second as well as it can (TRIAD).

    Which comes first matters: an axis along x is seen by the x accelerometer alone, so that no error of
    the accelerometers' misalignments moves it; then y determines only the turn about x. Zhang's choice, z and
    then y, lets all three misalignments in.

    Parameters
    ----------
    axes_o, axes_p : (..., 2, 3) unit vectors.

    Raises
    ------
    ObservabilityError
        If the two axes are nearly parallel.

    Notes
    -----
    Shuster and Oh, J. Guid. Control 4 (1981) 70.
    """
    _refuse_parallel(axes_p)
    return _orthonormal(axes_o) @ np.swapaxes(_orthonormal(axes_p), -1, -2)


def wahba_rotation(axes_o: AnyArray, axes_p: AnyArray) -> AnyArray:
    """Return the rotation that fits many axes best by least squares.

    Parameters
    ----------
    axes_o, axes_p : (..., n, 3) unit vectors.

    Raises
    ------
    ObservabilityError
        If all axes are nearly parallel.

    Notes
    -----
    Wahba's problem by singular values (Markley, J. Astronaut. Sci. 36 (1988) 245).
    """
    scatter = np.einsum("...ni,...nj->...ij", axes_p, axes_p)
    values = np.linalg.eigvalsh(scatter)
    if bool(np.any(values[..., 1] < SMALLEST_SINE**2 * values[..., 2])):
        raise ObservabilityError(_PARALLEL)
    u, _, vt = np.linalg.svd(np.einsum("...ni,...nj->...ij", axes_o, axes_p))
    sign = np.ones(u.shape[:-1])
    sign[..., 2] = np.linalg.det(u) * np.linalg.det(vt)
    return np.asarray((u * sign[..., None, :]) @ vt, dtype=np.float64)


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


_PARALLEL = (
    "The rotations that both triads saw have one axis only, and a second one is needed: turn the unit about another "
    "axis too, across the first."
)


def _columns(axes: AnyArray) -> AnyArray:
    first, second = axes[..., 0, :], axes[..., 1, :]
    return np.stack([first, second, np.cross(first, second)], axis=-1)


def _orthonormal(axes: AnyArray) -> AnyArray:
    first, across = axes[..., 0, :], np.cross(axes[..., 0, :], axes[..., 1, :])
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    return np.asarray(np.stack([first, across, np.cross(first, across)], axis=-1), dtype=np.float64)


def _refuse_parallel(axes: AnyArray) -> None:
    sine = np.linalg.norm(np.cross(axes[..., 0, :], axes[..., 1, :]), axis=-1)
    if bool(np.any(sine < SMALLEST_SINE)):
        raise ObservabilityError(_PARALLEL)
