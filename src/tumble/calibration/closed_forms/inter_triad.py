"""The rotation between the triads from axes that both have seen (Zhang et al. 2010, (39), (40)).

``axis_o = R axis_p``, with o the frame of the gyros and p that of the accelerometers. All functions take
many sets at once.
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
