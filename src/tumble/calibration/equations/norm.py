"""The condition of a hold: the corrected vector's norm is gravity (or the Earth rate).

Hayal 2010, 3.19 to 3.24, written as ``(|true|² - K²) / (2 K) = 0``, which is in SI units and close to
``|true| - K``. With K the condition of Shin and El-Sheimy for 3 (bias), 6 (and scale) or 9 (and
non-orthogonality) unknowns: `free` chooses.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vectors
from tumble.calibration.equations.triad_unknowns import correct_with_derivatives
from tumble.estimation import Linearisation


class NormConditions:
    """One condition a hold: `Conditions` for the adjustment of one triad.

    Parameters
    ----------
    observed : (holds, 3) mean raw vectors.
    covariance : (holds, 3, 3) of the means.
    reference : norm of the true vector, SI; one for all, or (holds,) of them (a table that spins faster
        one way than the other against inertial space).
    values : (12,) the triad's unknowns; those not in `free` keep these values.
    free : indices of the unknowns to adjust.
    active : (holds,) of bool, holds that take part; all by default.
    extra_variance : variance added to each condition, SI².
    """

    def __init__(
        self,
        observed: Vectors,
        covariance: Matrices,
        reference: float | Series,
        values: Series,
        free: np.ndarray,
        active: np.ndarray | None = None,
        extra_variance: float = 0.0,
    ) -> None:
        self.observed = observed
        self.covariance = covariance
        self.reference = np.broadcast_to(np.asarray(reference, dtype=float), observed.shape[:1])
        self.values = values.astype(float)
        self.free = free
        self.active = np.ones(observed.shape[0], dtype=bool) if active is None else active
        self.extra_variance = extra_variance
        self._adjusted = observed.copy()
        self._by_observed = np.zeros((observed.shape[0], 3))

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` (the free unknowns) and the adjusted hold means."""
        full = self.values.copy()
        full[self.free] = parameters
        corrected = correct_with_derivatives(full, self._adjusted)
        towards = corrected.value / self.reference[:, None]
        self._by_observed = np.einsum("ka,kab->kb", towards, corrected.by_raw)
        length = np.einsum("ka,ka->k", corrected.value, towards)
        misclosure = 0.5 * (length - self.reference)
        misclosure = misclosure + np.einsum("kb,kb->k", self._by_observed, self.observed - self._adjusted)
        design = np.einsum("ka,kap->kp", towards, corrected.by_unknowns)[:, self.free]
        variance = np.einsum("ka,kab,kb->k", self._by_observed, self.covariance, self._by_observed)
        off = ~self.active
        misclosure[off], design[off], variance[off] = 0.0, 0.0, 1.0
        return Linearisation(
            misclosure[:, None],
            design[:, None, :],
            (variance + self.extra_variance * self.active)[:, None, None],
            self.active[:, None],
        )

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Set the hold means to observed + e, with e = -Q B' C^-1 (w + A xi) (3.38)."""
        moved = np.einsum("kab,kb->ka", self.covariance, self._by_observed) * multipliers
        self._adjusted = self.observed - np.where(self.active[:, None], moved, 0.0)
