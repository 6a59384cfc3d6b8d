"""How units differ from one another: mean and covariance between units, without what the estimates' errors add.

x_i = μ + b_i + e_i with e_i of the known covariance C_i of unit i's calibration, and b_i of the covariance B between
units, found by restricted maximum likelihood (EM; Laird and Ware 1982, *Biometrics* 38, 963).
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.records import dataclass

FEWEST = 5
"""Units that it takes to say how they differ."""
_ROUNDS = 400
_SETTLED = 1e-5


@dataclass(frozen=True, slots=True)
class Between:
    """Mean and spread of units.

    Attributes
    ----------
    mean, mean_covariance : (p,), (p, p).
    covariance : (p, p) between units.
    spread_sigma : (p,) standard uncertainty of the standard deviations between units.
    count : of units.
    """

    mean: Series
    mean_covariance: Square
    covariance: Square
    spread_sigma: Series
    count: int

    @property
    def spread(self) -> Series:
        """(p,) standard deviations between units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def predictive(self) -> Square:
        """(p, p) covariance of a next unit about `mean`, as wide as so few units know it.

        Correlations are drawn towards none as far as chance makes such ones (Schäfer and Strimmer 2005, *Stat. Appl.
        Genet. Mol. Biol.* 4, 32): those of few units would claim to know one parameter by the others. Variances are
        those of Student's t, which a next unit follows.
        """
        freedom = self.count - 1.0
        sigma = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        correlation = self.covariance / np.outer(sigma, sigma)
        apart = ~np.eye(sigma.size, dtype=bool)
        squares = float(np.sum(correlation[apart] ** 2))
        by_chance = float(np.sum((1.0 - correlation[apart] ** 2) ** 2)) / freedom
        kept = 1.0 - min(1.0, by_chance / squares) if squares > 0.0 else 1.0
        shrunk = np.where(apart, kept * self.covariance, self.covariance)
        return freedom / (freedom - 2.0) * shrunk + self.mean_covariance


def between_units(values: Table, covariances: np.ndarray) -> Between:
    """Return mean and covariance between units.

    Parameters
    ----------
    values : (n, p).
    covariances : (n, p, p) of each unit's own errors.
    """
    count = len(values)
    scale = np.std(values, axis=0, ddof=1)
    scale[scale == 0.0] = 1.0
    x, own = values / scale, covariances / np.outer(scale, scale)
    spread = np.cov(x.T).reshape(x.shape[1], x.shape[1])
    # A start inside the cone of covariances: EM keeps it there.
    eigen, vectors = np.linalg.eigh(spread - np.mean(own, axis=0))
    inside = (vectors * np.maximum(eigen, 1e-3 * np.max(np.diag(spread)))) @ vectors.T
    for _ in range(_ROUNDS):
        mean, mean_covariance, updated = _round(x, own, inside)
        moved = np.max(np.abs(updated - inside)) / np.max(np.diag(updated))
        inside = updated
        if moved < _SETTLED:
            break
    mean, mean_covariance, _ = _round(x, own, inside)
    variance, noise = np.diag(inside), np.mean(np.einsum("ijj->ij", own), axis=0)
    sd = np.sqrt(variance)
    spread_sigma = (variance + noise) / np.maximum(sd, 1e-12) / np.sqrt(2.0 * (count - 1))
    outer = np.outer(scale, scale)
    # To round-off an inverse is not symmetric, and a document's covariance has to be.
    mean_covariance = 0.5 * (mean_covariance + mean_covariance.T)
    return Between(mean * scale, mean_covariance * outer, inside * outer, spread_sigma * scale, count)


def _round(x: Table, own: np.ndarray, inside: Square) -> tuple[Series, Square, Square]:
    weights: np.ndarray = np.linalg.inv(inside + own)
    mean_covariance = inverted(np.sum(weights, axis=0))
    mean: Series = mean_covariance @ np.sum(weights @ x[:, :, None], axis=0)[:, 0]
    pulled = (weights @ (x - mean)[:, :, None])[:, :, 0]
    known = np.sum(weights @ mean_covariance @ weights, axis=0)
    middle = (pulled.T @ pulled + known - np.sum(weights, axis=0)) / len(x)
    updated = inside + inside @ middle @ inside
    symmetric: Square = 0.5 * (updated + updated.T)
    return mean, mean_covariance, symmetric
