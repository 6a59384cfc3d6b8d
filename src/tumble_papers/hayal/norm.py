"""The Gauss-Helmert adjustment of a triad by the norm of its corrected vector (Hayal 2010, 3.19 to 3.24)."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.calibration import SCALE, NormConditions
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Adjustment, adjust


def adjust_norm(
    observed: Vectors,
    covariance: Matrices,
    reference: float | Series,
    start: Series,
    unknowns: int,
    *,
    extra_variance: float = 0.0,
    once: bool = False,
) -> tuple[Series, Adjustment]:
    """Return a triad's (12,) unknowns, of which the first `unknowns` were adjusted, and the adjustment.

    Parameters
    ----------
    observed, covariance, reference, extra_variance : as for `NormConditions`.
    start : (12,) start values; what is not adjusted keeps them.
    unknowns : 3 (bias), 6 (and scale factor) or 9 (and non-orthogonality).
    once : one step from start values that are all but settled.

    Raises
    ------
    ObservabilityError
        If there are no more attitudes than unknowns (3.37 is then zero over zero), or they do not tell them apart.
    ConvergenceError
        If it does not settle, or settles in the mirror root with a negative scale factor.
    """
    if observed.shape[0] <= unknowns:
        raise ObservabilityError(
            f"{observed.shape[0]} attitudes do not determine {unknowns} unknowns and the variance of unit weight: "
            f"record at least {unknowns + 1}."
        )
    free = np.arange(unknowns)
    conditions = NormConditions(observed, covariance, reference, start, free, extra_variance=extra_variance)
    adjustment = adjust(conditions, start[free], once=once)
    values = start.copy()
    values[free] = adjustment.parameters
    if np.any(values[SCALE] <= 0.0):
        raise ConvergenceError(
            "The adjustment ended in the mirror root, with a negative scale factor. The means are too noisy for so "
            "many unknowns, or the columns are wrong."
        )
    return values, adjustment
