"""The norm conditions solved by iteration, as the field does where it has start values (Zhang 2010, (10), (11)).

For comparison with the closed form (`separate_norms`): all three minimise the squares of what the
*squared* norm misses, this one in the parameters themselves, the closed form in the elements of the
quadric. With as many attitudes as unknowns they agree to the last digit; with more, to the noise's square.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import Series, Table, Vectors
from tumble.calibration.equations.triad_unknowns import COUNT, correct_with_derivatives
from tumble.errors import ConvergenceError
from tumble.records import dataclass

NINE = slice(0, 9)
LIMIT = 100
# Converged where no parameter moves by more than this share of itself (or of a raw unit, a radian).
TOLERANCE = 1e-12


@dataclass(frozen=True, slots=True)
class IteratedNorms:
    """What an iteration ended with.

    Attributes
    ----------
    unknowns : (12,) as in `triad_unknowns`; the quadratic terms are zero.
    iterations : how many it took.
    cost : sum of squares of what the squared norms miss, SI.
    """

    unknowns: Series
    iterations: int
    cost: float


def minimise_norm_cost(raw: Vectors, reference: Series, start: Series) -> IteratedNorms:
    """Minimise the cost (10) by a general least-squares solver.

    Parameters
    ----------
    raw : (n, 3) raw means.
    reference : (n,) true norms, SI.
    start : (9,) or (12,) bias, scale factors, angles to begin with.

    Raises
    ------
    ConvergenceError
        If the solver gives up.
    """
    from scipy.optimize import least_squares

    scale = np.maximum(np.abs(_nine(start)), [1.0] * 6 + [1e-3] * 3)
    scale[:3] = np.mean(scale[3:6]) * np.mean(reference)

    def residual(x: Series) -> Series:
        return _linearised(raw, reference, x * scale)[0]

    def slope(x: Series) -> Table:
        return _linearised(raw, reference, x * scale)[1] * scale

    found: Any = least_squares(
        residual, _nine(start) / scale, jac=slope, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    if not found.success:
        raise ConvergenceError(f"The norm cost (10) has no minimum near the start values: {found.message}")
    return _finished(raw, reference, found.x * scale, int(found.nfev))


def iterate_linearised(raw: Vectors, reference: Series, start: Series) -> IteratedNorms:
    """Solve the linearised equations (11) again and again.

    The paper prints A and Y as if the squared norm were linear in the parameters: Y is to be what it
    misses at the last values, and the solution the step from them.

    Parameters
    ----------
    raw, reference, start : as for `minimise_norm_cost`.

    Raises
    ------
    ConvergenceError
        If the steps do not become small, which start values too far off or singular attitudes do.
    """
    values = _nine(start)
    for count in range(1, LIMIT + 1):
        missed, slope = _linearised(raw, reference, values)
        size = np.linalg.norm(slope, axis=0)
        step = np.asarray(np.linalg.lstsq(slope / size, -missed, rcond=1e-12)[0], dtype=np.float64) / size
        values = values + step
        if not np.all(np.isfinite(values)) or np.any(values[3:6] <= 0.0):
            break
        if np.all(np.abs(step) <= TOLERANCE * np.maximum(np.abs(values), 1.0)):
            return _finished(raw, reference, values, count)
    raise ConvergenceError(
        "The linearised norm equations (11) do not converge from these start values: the closed form needs none."
    )


def _nine(start: Series) -> Series:
    return np.array(start[NINE], dtype=float)


def _linearised(raw: Vectors, reference: Series, nine: Series) -> tuple[Series, Table]:
    """What the squared norms miss, and its derivatives (n, 9)."""
    unknowns = np.zeros(COUNT)
    unknowns[NINE] = nine
    corrected = correct_with_derivatives(unknowns, raw)
    missed = np.sum(corrected.value**2, axis=1) - reference**2
    return missed, 2.0 * np.einsum("ka,kap->kp", corrected.value, corrected.by_unknowns[:, :, NINE])


def _finished(raw: Vectors, reference: Series, nine: Series, count: int) -> IteratedNorms:
    unknowns = np.zeros(COUNT)
    unknowns[NINE] = nine
    missed = _linearised(raw, reference, nine)[0]
    return IteratedNorms(unknowns, count, float(missed @ missed))
