"""Many norm adjustments at once, for studies: the same equations as `norm.adjust_norm`, compiled.

One set is the hold means of one triad. Beside the Gauss-Helmert adjustment stand the estimators that
are found in the field instead of it, so that their bias can be shown.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import UsageError
from tumble.records import dataclass

ESTIMATORS = {
    "gauss-helmert": "adjusted anew at the adjusted observations in every iteration (Pope 1972)",
    "corrected": "the same with K² + 2σ² for K², which takes the noise's own square out of the norm",
    "fixed": "linearised at the observed values in every iteration (Hayal 3.28)",
    "norm": "least squares of |true| - K, without weights",
    "square": "least squares of |true|² - K², without weights",
}
_CODES = {"gauss-helmert": 0, "corrected": 0, "fixed": 1, "norm": 2, "square": 3}


@dataclass(frozen=True, slots=True)
class NormBatch:
    """The outcome of many adjustments.

    Attributes
    ----------
    parameters : (sets, 9) bias, scale factor, angles yz, zx, zy; those not estimated as they were given.
    sigmas : (sets, unknowns) standard uncertainties from the noise that was given (cofactor, 3.35).
    sigma0 : (sets,) root of the variance of unit weight (3.37); nan without redundancy.
    iterations : (sets,) how many it took.
    converged : (sets,) of bool.
    mirror : (sets,) of bool: settled with a scale factor that is not positive.
    """

    parameters: Table
    sigmas: Table
    sigma0: Series
    iterations: np.ndarray
    converged: np.ndarray
    mirror: np.ndarray

    @property
    def usable(self) -> np.ndarray:
        """(sets,) of bool: converged, and not in the mirror root."""
        return self.converged & ~self.mirror


def adjust_norms(
    observed: AnyArray,
    sigma: AnyArray | float,
    reference: Series | float,
    *,
    unknowns: int = 9,
    start: AnyArray | None = None,
    estimator: str = "gauss-helmert",
    limit: int = 100,
    tolerance: float = 1e-6,
) -> NormBatch:
    """Adjust the norm conditions of many sets of hold means.

    Parameters
    ----------
    observed : (sets, holds, 3) hold means, raw.
    sigma : standard deviation of a mean: one for all, or (holds,), or (holds, 3).
    reference : norm of the true vector; one for all, or (holds,).
    unknowns : 3 (bias), 6 (and scale factor) or 9 (and non-orthogonality).
    start : (9,) or (sets, 9) start values; None for no bias, scale factors of one, no angles.
    estimator : one of `ESTIMATORS`.
    limit : iterations after which a set has not converged.
    tolerance : converged when no parameter moves by more than this share of its sigma.

    Raises
    ------
    UsageError
        If `unknowns` or `estimator` is none of those, or there are fewer holds than unknowns.
    """
    from tumble_papers.hayal.kernels import adjust_norm_sets

    if unknowns not in (3, 6, 9) or estimator not in ESTIMATORS:
        raise UsageError(
            f"Unknowns are 3, 6 or 9 and not {unknowns}; estimators are {', '.join(ESTIMATORS)}."
        )
    sets, holds = observed.shape[:2]
    if holds < unknowns:
        raise UsageError(f"{holds} holds cannot determine {unknowns} unknowns.")
    spread = np.asarray(sigma, dtype=float)
    spread = np.broadcast_to(spread[:, None] if spread.ndim == 1 else spread, (holds, 3))
    norm = np.broadcast_to(np.asarray(reference, dtype=float), (holds,))
    if estimator == "corrected":
        norm = np.sqrt(norm**2 + 2.0 * np.mean(spread**2, axis=1))
    # Copies, because what is broadcast cannot be handed to compiled code.
    first = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) if start is None else start
    parameters, cofactors = np.empty((sets, 9)), np.zeros((sets, unknowns, unknowns))
    sigma0, iterations = np.full(sets, np.nan), np.zeros(sets, dtype=np.int64)
    adjust_norm_sets(
        np.array(observed, dtype=float, order="C"),
        np.array(spread**2, order="C"),
        np.array(norm),
        np.array(np.broadcast_to(first, (sets, 9)), dtype=float, order="C"),
        unknowns,
        _CODES[estimator],
        limit,
        tolerance,
        parameters,
        cofactors,
        sigma0,
        iterations,
    )
    converged = (iterations > 0) & np.all(np.isfinite(parameters), axis=1)
    return NormBatch(
        parameters=parameters,
        sigmas=np.sqrt(np.maximum(np.diagonal(cofactors, axis1=1, axis2=2), 0.0)),
        sigma0=sigma0,
        iterations=np.abs(iterations),
        converged=converged,
        mirror=converged & np.any(parameters[:, 3:6] <= 0.0, axis=1),
    )
