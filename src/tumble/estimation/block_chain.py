"""Symmetric block-tridiagonal matrices: factor, solve, and the diagonal blocks of the inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import ConvergenceError


@dataclass(frozen=True, slots=True)
class BlockChain:
    """A factored block-tridiagonal matrix with blocks of one size.

    Attributes
    ----------
    pivots_inverse : (groups, size, size) inverses of the pivots of the block LDL' factorisation.
    couplings : (groups - 1, size, size) blocks L_k of the unit lower factor, or None if the matrix
        is block diagonal.
    log_determinant : of the whole matrix.
    """

    pivots_inverse: AnyArray
    couplings: AnyArray | None
    log_determinant: float

    @staticmethod
    def factor(diagonal: AnyArray, lower: AnyArray | None = None) -> BlockChain:
        """Factor the matrix with blocks `diagonal` (groups, size, size) and `lower` below them.

        `lower[k]` stands in block row k + 1, block column k.

        Raises
        ------
        ConvergenceError
            If a pivot is not positive definite: the covariance given is not one.
        """
        couplings: AnyArray | None = None
        pivots = diagonal
        try:
            if lower is not None and np.any(lower):
                pivots = diagonal.copy()
                couplings = np.empty_like(lower)
                for k in range(lower.shape[0]):
                    solved: AnyArray = np.asarray(np.linalg.solve(pivots[k], lower[k].T), dtype=np.float64)
                    couplings[k] = solved.T
                    pivots[k + 1] = diagonal[k + 1] - couplings[k] @ lower[k].T
            factors = np.linalg.cholesky(pivots)
            if not np.all(np.isfinite(factors)):
                raise np.linalg.LinAlgError("not finite")
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "The covariance of the observations is not positive definite: "
                "a hold has no noise at all, or too few samples."
            ) from error
        logs = np.log(np.diagonal(factors, axis1=1, axis2=2))
        inverses: AnyArray = np.asarray(np.linalg.inv(pivots), dtype=np.float64)
        return BlockChain(inverses, couplings, 2.0 * float(np.sum(logs)))

    def solve(self, right: AnyArray) -> AnyArray:
        """Return the inverse times `right`, (groups, size, columns)."""
        if self.couplings is None:
            return self.pivots_inverse @ right
        forward = right.copy()
        for k in range(self.couplings.shape[0]):
            forward[k + 1] -= self.couplings[k] @ forward[k]
        solution = self.pivots_inverse @ forward
        for k in range(self.couplings.shape[0] - 1, -1, -1):
            solution[k] -= self.couplings[k].T @ solution[k + 1]
        return solution

    def inverse_diagonal(self) -> AnyArray:
        """Return the diagonal blocks of the inverse, (groups, size, size)."""
        blocks = self.pivots_inverse.copy()
        if self.couplings is not None:
            for k in range(self.couplings.shape[0] - 1, -1, -1):
                blocks[k] += self.couplings[k].T @ blocks[k + 1] @ self.couplings[k]
        return blocks
