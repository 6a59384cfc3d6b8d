"""The closed forms of Zhang et al. (2010): each triad by itself (12) to (25), and the turn between them (39) to (47).

The norm of the corrected vector is known, whatever the attitude: gravity at rest, the table's angle in a
rotation. Squared it is linear in the elements of a symmetric matrix, whose triangular factor is the
triad's. All functions take many sets at once: arrays of shape (..., n, 3).

Average first: the square of a noisy sample is too large by the noise's variance, which would be +84 ppm
of the scale with 500 µg/√Hz at 100 Hz; with the mean of a 100 s dwell it is 0.001 ppm.

The rotation between the triads comes from axes that both have seen:
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

# Below this ratio of singular values of the scaled design a direction is not observed: one that is has
# some 0.1, one that placement errors alone show 1e-3.
SINGULAR = 1e-5
ROUNDING = 1e-13


def ellipsoid_from_norms(
    raw: AnyArray, reference: float | AnyArray, weights: AnyArray | None = None
) -> tuple[AnyArray, AnyArray]:
    """Return a triad's matrix and bias from raw means whose true norms are known.

    Parameters
    ----------
    raw : (..., n, 3) raw means of n attitudes at rest.
    reference : true norm, SI: one number.
    weights : (..., n), of the squared norms; None for alike.

    Returns
    -------
    matrix : (..., 3, 3) lower triangular with a positive diagonal, raw per SI unit, in the triad's own
        frame: x along the x sensing axis, y in the plane of x and y.
    bias : (..., 3) raw.

    Raises
    ------
    ObservabilityError
        If the attitudes do not tell nine parameters, or no ellipsoid goes through the means.

    Notes
    -----
    Zhang et al. 2010, (12) to (14). Least squares on the ten elements of (13) is singular whatever the
    attitudes: m44 = |g|² and all others 0 fit every row. Here (13) is divided by c = |g|² - m44, which
    leaves nine unknowns and 1 on the left; then b = N⁻¹ n4 and c = |g|² / (1 + bᵀ N b).
    """
    raw = np.asarray(raw, dtype=float)
    # About the middle and in units of the size, so that counts and SI are alike to the solver.
    middle = 0.5 * (raw.max(axis=-2, keepdims=True) + raw.min(axis=-2, keepdims=True))
    size = np.max(np.linalg.norm(raw - middle, axis=-1), axis=-1)[..., None, None]
    x = (raw - middle) / size
    design = np.concatenate([_squares(x), -2.0 * x], axis=-1)
    solution = _least_squares(design, _ones(x), weights, "attitudes")
    quadric = _symmetric(solution[..., :6])
    centre = np.linalg.solve(quadric, solution[..., 6:, None])[..., 0]
    inside = 1.0 + np.einsum("...i,...ij,...j->...", centre, quadric, centre)
    factor = np.asarray(reference, dtype=float) ** 2 / inside
    matrix = _matrix_of(factor[..., None, None] * quadric / size**2)
    return matrix, middle[..., 0, :] + size[..., 0] * centre


def matrix_from_rotations(rotation: AnyArray, angle: AnyArray, weights: AnyArray | None = None) -> AnyArray:
    """Return a gyro triad's matrix from rotations by known angles.

    Parameters
    ----------
    rotation : (..., n, 3) raw·s: the integral of a counter-clockwise rotation minus that of the clockwise
        one about the same axis; bias and Earth rate have gone from the difference.
    angle : (..., n) rad, the difference of the table's two angles; its sign does not matter.
    weights : (..., n), of the squared norms; None for alike.

    Returns
    -------
    matrix : (..., 3, 3) lower triangular with a positive diagonal, raw per SI unit, in the triad's own
        frame o.

    Raises
    ------
    ObservabilityError
        If the axes do not tell six parameters.

    Notes
    -----
    Zhang et al. 2010, (18) to (22). Six rotations suffice ("nine" in the text counts the biases too).
    """
    rotation = np.asarray(rotation, dtype=float)
    per_radian = rotation / np.abs(np.asarray(angle, dtype=float))[..., None]
    size = np.max(np.linalg.norm(per_radian, axis=-1), axis=-1)[..., None, None]
    x = per_radian / size
    solution = _least_squares(_squares(x), _ones(x), weights, "rotation axes")
    return _matrix_of(_symmetric(solution) / size**2)


def bias_from_static_pairs(matrix: AnyArray, rate: AnyArray, weights: AnyArray | None = None) -> AnyArray:
    """Return the gyros' biases from their readings at rest, whose norms are all the Earth rate.

    Neither the Earth rate nor the latitude is needed: the difference of two squared norms is zero.

    Parameters
    ----------
    matrix : (..., 3, 3) of the gyros, in any frame.
    rate : (..., n, 3) raw means of n attitudes at rest.
    weights : (..., n), of the squared norms; None for alike.

    Returns
    -------
    bias : (..., 3) raw.

    Raises
    ------
    ObservabilityError
        If the attitudes do not tell three biases; four or more are needed.

    Notes
    -----
    Zhang et al. 2010, (24) and (25), whose last factor is of attitude j2. All pairs of attitudes, which
    is least squares on the differences from the mean.
    """
    rate = np.asarray(rate, dtype=float)
    turned = np.linalg.solve(matrix[..., None, :, :], rate[..., None])[..., 0]
    w = np.ones(turned.shape[:-1]) if weights is None else np.asarray(weights, dtype=float)
    share = w / np.sum(w, axis=-1, keepdims=True)
    middle = np.sum(share[..., None] * turned, axis=-2, keepdims=True)
    x = turned - middle
    size = np.max(np.linalg.norm(x, axis=-1), axis=-1)[..., None, None]
    # A mean of alike numbers differs from them by rounding.
    if not np.all(size > ROUNDING * np.max(np.abs(turned))):
        raise ObservabilityError("The gyros show the same in all attitudes: they do not see the Earth rate.")
    x = x / size
    square = np.sum(x * x, axis=-1)
    told = square - np.sum(share * square, axis=-1, keepdims=True)
    solution = _least_squares(2.0 * x, told, w, "attitudes")
    centre = middle[..., 0, :] + size[..., 0] * solution
    return np.einsum("...ij,...j->...i", matrix, centre)


def _ones(x: AnyArray) -> AnyArray:
    return np.ones(x.shape[:-1], dtype=np.float64)


def _squares(x: AnyArray) -> AnyArray:
    """Columns of (13) and (21): the squares and twice the products."""
    a, b, c = x[..., 0], x[..., 1], x[..., 2]
    return np.stack([a * a, b * b, c * c, 2.0 * a * b, 2.0 * a * c, 2.0 * b * c], axis=-1)


def _symmetric(elements: AnyArray) -> AnyArray:
    """The symmetric matrices of (..., 6) elements 11, 22, 33, 12, 13, 23."""
    order = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
    return np.ascontiguousarray(elements[..., order])


def _least_squares(design: AnyArray, told: AnyArray, weights: AnyArray | None, what: str) -> AnyArray:
    """Solve every set by QR; refuse if one of them is singular."""
    unknowns = design.shape[-1]
    if design.shape[-2] < unknowns:
        raise ObservabilityError(
            f"{design.shape[-2]} {what} do not determine {unknowns} unknowns: {unknowns} different "
            "ones are needed at least."
        )
    if weights is not None:
        root = np.sqrt(np.asarray(weights, dtype=float))
        design, told = design * root[..., None], told * root
    q, r = np.linalg.qr(design)
    values = np.linalg.svd(r, compute_uv=False)
    if bool(np.any(values[..., -1] < SINGULAR * values[..., 0])):
        raise ObservabilityError(
            f"The {what} do not determine all {unknowns} unknowns: some combination of scale factors, "
            f"misalignments and biases fits them all. Add {what} between the axes, with two sensors "
            "seeing the same share."
        )
    right = np.einsum("...ij,...i->...j", q, told)
    return np.asarray(np.linalg.solve(r, right[..., None])[..., 0], dtype=np.float64)


def _matrix_of(quadric: AnyArray) -> AnyArray:
    """Return the lower-triangular L with ``inv(L).T @ inv(L)`` equal to the quadric."""
    try:
        return np.asarray(np.linalg.cholesky(np.linalg.inv(quadric)), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise ObservabilityError(
            "No ellipsoid goes through the means: the norms do not fit a triad of three sensors. Check the columns "
            "and the units."
        ) from error


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
