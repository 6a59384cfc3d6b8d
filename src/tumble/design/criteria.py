"""What makes one covariance better than another: A, D, E, minimax and I, over any subset of the parameters.

Each criterion is a number to be made small that goes down as one over the time spent, so that two designs'
values stand in the ratio of the times that they need for the same accuracy. With C the covariance of the
wanted parameters (the others are nuisances: inverting the whole information and taking the block is their
elimination by Schur complement), each divided by the size at which it matters:

- A: the mean of the variances.
- D: the p-th root of the determinant: the volume of the confidence ellipsoid.
- E: the largest eigenvalue: the worst combination.
- minimax: the largest variance.
- I: the mean square of a corrected vector's error over all directions (its own weights, no sizes).
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Square, inverted
from tumble.records import dataclass

CRITERIA = ("A", "D", "E", "minimax", "I")
# E and minimax have corners; the search runs down this norm of the eigenvalues or variances instead. Of sigmas it
# is twice as high, and for nine equal ones a tenth above the largest.
SMOOTH = 12.0


@dataclass(frozen=True, slots=True)
class Criterion:
    """A number to be made small, of the covariance of all parameters.

    Attributes
    ----------
    name : one of `CRITERIA`.
    wanted : indices of the parameters that matter; the others are nuisances.
    sizes : (wanted,) the size at which each matters, in its unit.
    weights : (parameters, parameters) of I: the mean over all directions of what an error of the parameters does
        to a corrected vector, squared. Not used by the others.
    sharpness : the norm that stands for the largest, in E and minimax.
    """

    name: str
    wanted: np.ndarray
    sizes: Series
    weights: Square | None = None
    sharpness: float = SMOOTH

    def __post_init__(self) -> None:
        """Refuse what is no criterion.

        Raises
        ------
        ValueError
            If there is no such criterion, nothing is wanted, or a size is not positive.
        """
        if self.name not in CRITERIA:
            raise ValueError(f"{self.name!r} is none of {', '.join(CRITERIA)}")
        if self.wanted.size == 0 or self.sizes.shape != self.wanted.shape or not np.all(self.sizes > 0.0):
            raise ValueError("a criterion wants one parameter at least, and a positive size of each")
        if self.name == "I" and self.weights is None:
            raise ValueError("I needs the weights of the prediction")

    def value(self, covariance: AnyArray) -> AnyArray:
        """Return the criterion of one covariance (p, p), or of many (..., p, p).

        Parameters
        ----------
        covariance : of all parameters.
        """
        if self.name == "I":
            return np.asarray(np.einsum("ij,...ij->...", self._weights(), covariance), dtype=np.float64)
        wanted = self._scaled(covariance)
        if self.name == "D":
            sign, log = np.linalg.slogdet(wanted)
            volume = np.where(sign > 0.0, np.exp(np.minimum(log / self.wanted.size, 700.0)), np.inf)
            return np.asarray(volume, dtype=np.float64)
        if self.name == "E":
            return np.asarray(np.linalg.eigvalsh(wanted)[..., -1], dtype=np.float64)
        variances = np.diagonal(wanted, axis1=-2, axis2=-1)
        return np.asarray(variances.mean(axis=-1) if self.name == "A" else variances.max(axis=-1))

    def smooth_value(self, covariance: AnyArray) -> AnyArray:
        """Return the criterion with E's and minimax' largest replaced by a norm, which has a slope.

        Parameters
        ----------
        covariance : (p, p) or (..., p, p), of all parameters.
        """
        if self.name not in ("E", "minimax"):
            return self.value(covariance)
        wanted = self._scaled(covariance)
        parts = np.linalg.eigvalsh(wanted) if self.name == "E" else np.diagonal(wanted, axis1=-2, axis2=-1)
        largest = parts.max(axis=-1)
        shares = np.maximum(parts / largest[..., None], 0.0)
        return np.asarray(largest * np.sum(shares**self.sharpness, axis=-1) ** (1.0 / self.sharpness))

    def slope(self, covariance: Square) -> Square:
        """Return the derivative L (p, p) of `smooth_value` by the covariance: tr(L C) is the value itself.

        Parameters
        ----------
        covariance : (p, p) of all parameters.
        """
        if self.name == "I":
            return self._weights()
        scaled, size = self._scaled(covariance), self.wanted.size
        if self.name == "A":
            inner = np.eye(size) / size
        elif self.name == "D":
            inner = float(self.value(covariance)) / size * inverted(scaled)
        elif self.name == "E":
            values, vectors = np.linalg.eigh(scaled)
            value = float(self.smooth_value(covariance))
            inner = (vectors * np.maximum(values / value, 0.0) ** (self.sharpness - 1.0)) @ vectors.T
        else:
            value = float(self.smooth_value(covariance))
            inner = np.diag((np.diag(scaled) / value) ** (self.sharpness - 1.0))
        return self._spread(inner, covariance.shape[0])

    def bounding_slope(self, covariance: Square) -> Square:
        """Return the slope scaled so that tr(L C') is at most the criterion of any covariance C'.

        It makes the equivalence theorem's bound that of the criterion itself, not of its smooth stand-in. Of D
        the bound is by the theorem directly, and this is its slope.

        Parameters
        ----------
        covariance : (p, p) of all parameters.
        """
        slope = self.slope(covariance)
        if self.name not in ("E", "minimax"):
            return slope
        # A mean over variances (eigenvectors) with weights that add up to one is at most the largest.
        sizes = np.zeros(covariance.shape[0])
        sizes[self.wanted] = self.sizes
        return np.asarray(slope / float(np.sum(np.diag(slope) * sizes**2)), dtype=np.float64)

    def _scaled(self, covariance: AnyArray) -> AnyArray:
        block = covariance[..., self.wanted[:, None], self.wanted]
        return block / np.outer(self.sizes, self.sizes)

    def _spread(self, inner: AnyArray, count: int) -> Square:
        whole = np.zeros((count, count))
        whole[np.ix_(self.wanted, self.wanted)] = inner / np.outer(self.sizes, self.sizes)
        return whole

    def _weights(self) -> Square:
        assert self.weights is not None
        return self.weights
