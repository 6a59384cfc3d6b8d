"""A triad's unknowns in Shin and El-Sheimy's convention, and the condition of a hold on them.

Twelve numbers in this order: bias (3, raw units), scale factor (3, raw per SI unit), the angles
yz, zx, zy (rad), quadratic terms (3, 1 / raw unit). An adjustment frees any subset of them.

Without rough values to start from, of raw counts or SI alike, an adjustment converges from zero only up to a scale
error of 1 and a bias of 0.5 g; from a scale of the wrong sign it lands in the mirror root 1 + s = -1 with the same
residuals.

The condition of a hold is that the corrected vector's norm is gravity (or the Earth rate): Hayal 2010, 3.19 to 3.24,
written as ``(|true|² - K²) / (2 K) = 0``, which is in SI units and close to ``|true| - K``. With K the condition of
Shin and El-Sheimy for 3 (bias), 6 (and scale) or 9 (and non-orthogonality) unknowns: `free` chooses.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors, inverted
from tumble.estimation import Conditions, Linearisation
from tumble.sensor import Triad, matrix_from_shin, shin_derivatives, shin_from_matrix

COUNT = 12
BIAS, SCALE, ANGLE, QUADRATIC = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


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


def rough_triad(means: Vectors, reference: float) -> Series:
    """Return the twelve unknowns of a rough six-position solution of hold means.

    The ellipsoid with axes along the sensors, ``sum(((y - b) / S)²) = reference²``, is fitted by
    linear least squares; where it is no ellipsoid (too few poses), half the span of each axis is
    its scale and the middle its bias (Hayal 2.3, 2.4 with the extreme poses). Scale factors come out
    positive: the norm cannot tell a sign.
    """
    middle = 0.5 * (means.max(axis=0) + means.min(axis=0))
    span = np.maximum(0.5 * (means.max(axis=0) - means.min(axis=0)), 1e-300)
    unknowns = np.zeros(COUNT)
    unknowns[BIAS], unknowns[SCALE] = middle, np.maximum(span, 0.2 * span.max()) / reference
    if means.shape[0] >= 6:
        scaled = (means - middle) / span.max()
        design = np.column_stack([scaled**2, scaled])
        solution, _, rank, _ = np.linalg.lstsq(design, np.ones(means.shape[0]), rcond=1e-6)
        square, linear = solution[:3], solution[3:]
        if rank == 6 and np.all(square > 0):
            centre = -0.5 * linear / square
            size = 1.0 + float(np.sum(square * centre**2))
            unknowns[BIAS] = middle + span.max() * centre
            unknowns[SCALE] = span.max() * np.sqrt(size / square) / reference
    return unknowns


def rough_gyro_matrix(
    time: Series,
    raw_rate: Vectors,
    raw_force: Vectors,
    triad: Triad,
    gyro_bias: Vector,
    stretches: list[tuple[int, int]],
    window: float = 0.25,
) -> tuple[Matrix, AnyArray]:
    """Return a rough (3, 3) rad/s per raw unit that maps raw rates to rates in b, and its covariance.

    Needs no start value, sign or axis order: over each short window of a turn the change of the
    specific force is regressed on the raw rates, ``f(t2) - f(t1) = integral of cross(f, A (raw - bias))``,
    which is linear in A. The hand's accelerations are noise in it; they average out over many turns
    to a few per cent.

    Parameters
    ----------
    raw_rate, raw_force : (samples, 3) raw units.
    triad : the accelerometers, roughly.
    stretches : half-open sample ranges of the turns.
    window : seconds of motion per equation.

    Raises
    ------
    ValueError
        If there are fewer than nine windows of motion, or no turn determines one of the gyro's axes.
    """
    designs: list[AnyArray] = []
    changes: list[AnyArray] = []
    for start, stop in stretches:
        steps = np.diff(time[start:stop])
        edges = np.arange(0, stop - start, max(1, round(window / max(float(np.median(steps)), 1e-9))))
        if edges.size < 2:
            continue
        force, rate = triad.correct(raw_force[start:stop]), raw_rate[start:stop] - gyro_bias
        # cross(f, A r)_i = sum_jk f_[i,j] A_jk r_k with f_ the cross-product matrix of f.
        middle = (force[:-1] + force[1:])[:, :, None] * (rate[:-1] + rate[1:])[:, None, :]
        outer = np.add.reduceat((0.25 * steps[:, None, None] * middle)[: edges[-1]], edges[:-1])
        cross = np.zeros((len(outer), 3, 3, 3))
        cross[:, 0, 1], cross[:, 0, 2] = -outer[:, 2], outer[:, 1]
        cross[:, 1, 0], cross[:, 1, 2] = outer[:, 2], -outer[:, 0]
        cross[:, 2, 0], cross[:, 2, 1] = -outer[:, 1], outer[:, 0]
        designs.append(cross.reshape(-1, 9))
        changes.append(np.diff(force[edges], axis=0).ravel())
    if sum(map(len, designs)) < 27:
        raise ValueError("too little motion to determine the gyro's axes")
    design, change = np.concatenate(designs), np.concatenate(changes)
    weight = _huber_weights(design, change)
    normal = design.T @ (design * weight[:, None])
    _require_all_axes(normal)
    inverse = np.linalg.pinv(normal, hermitian=True)
    solution = inverse @ (design.T @ (weight * change))
    residual = change - design @ solution
    variance = float(np.sum(weight * residual**2) / max(change.size - 9, 1))
    return solution.reshape(3, 3), np.asarray(inverse * variance, dtype=np.float64)


# Of the information that equally spread turns would give, the least that still determines an axis: turns
# that go astray by 3 degrees from a single axis give 1/400.
SMALLEST_EXCITATION = 3e-3


def _require_all_axes(normal: AnyArray) -> None:
    """Refuse motion that leaves an axis of the gyro untold."""
    # Column k of the gyro's matrix has the unknowns A_0k, A_1k, A_2k.
    information = [float(np.linalg.eigvalsh(normal[k::3, k::3])[0]) for k in range(3)]
    weakest = int(np.argmin(information))
    if information[weakest] < SMALLEST_EXCITATION * float(np.trace(normal)) / 9.0:
        axis = "xyz"[weakest]
        raise ValueError(f"no turn goes about its {axis} axis, or only while {axis} stands upright")


def _huber_weights(design: AnyArray, change: Series) -> Series:
    """Return weights that bound the pull of knocks (a residual beyond 1.5 robust sigma)."""
    weight = np.ones(change.size)
    for _ in range(5):
        root = np.sqrt(weight)
        solution = np.linalg.lstsq(design * root[:, None], change * root, rcond=None)[0]
        residual = np.abs(change - design @ solution)
        limit = 1.5 * 1.4826 * max(float(np.median(residual)), 1e-300)
        weight = np.minimum(1.0, limit / np.maximum(residual, 1e-300))
    return weight


class NormConditions(Conditions):
    """One condition a hold: `Conditions` for the adjustment of one triad, without quadratic terms.

    Parameters
    ----------
    observed : (holds, 3) mean raw vectors.
    covariance : (holds, 3, 3) of the means.
    reference : norm of the true vector, SI; one for all, or (holds,) of them (a table that spins faster
        one way than the other against inertial space).
    values : (12,) the triad's unknowns; those not in `free` keep these values.
    free : indices of the unknowns to adjust, of the first nine.
    extra_variance : variance added to each condition, SI².

    Notes
    -----
    ``true = inv(M) u`` with ``raw = u + bias``, hence ``d true = inv(M) (d raw - d bias - dM true)``.
    """

    def __init__(
        self,
        observed: Vectors,
        covariance: Matrices,
        reference: float | Series,
        values: Series,
        free: np.ndarray,
        *,
        extra_variance: float = 0.0,
    ) -> None:
        self.observed, self.covariance, self.extra_variance = observed, covariance, extra_variance
        self.reference = np.broadcast_to(np.asarray(reference, dtype=float), observed.shape[:1])
        self.values, self.free = values.astype(float), free
        self._adjusted, self._by_observed = observed.copy(), np.zeros((observed.shape[0], 3))

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` (the free unknowns) and the adjusted hold means."""
        full = self.values.copy()
        full[self.free] = parameters
        inverse = inverted(triad_from_unknowns(full).matrix)
        true = (self._adjusted - full[BIAS]) @ inverse.T
        towards = true / self.reference[:, None]
        self._by_observed = towards @ inverse
        misclosure = 0.5 * (np.einsum("ka,ka->k", true, towards) - self.reference)
        misclosure = misclosure + np.einsum("kb,kb->k", self._by_observed, self.observed - self._adjusted)
        by_matrix = np.einsum("kb,bcp,kc->kp", self._by_observed, shin_derivatives(full[3:9]), true)
        design = -np.concatenate([self._by_observed, by_matrix], axis=1)[:, None, self.free]
        variance = np.einsum("ka,kab,kb->k", self._by_observed, self.covariance, self._by_observed)
        active = np.ones((len(true), 1), dtype=bool)
        variance = (variance + self.extra_variance)[:, None, None]
        return Linearisation(misclosure[:, None], design, variance, active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Set the hold means to observed + e, with e = -Q B' C^-1 (w + A xi) (3.38)."""
        self._adjusted = (
            self.observed - np.einsum("kab,kb->ka", self.covariance, self._by_observed) * multipliers
        )
