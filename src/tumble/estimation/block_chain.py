"""Symmetric block-tridiagonal matrices: factor, solve, and the diagonal blocks of the inverse."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import ConvergenceError
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class BlockChain:
    """A factored block-tridiagonal matrix with blocks of one size.

    Attributes
    ----------
    factors : (groups, size, size) Cholesky factors L_k of the pivots.
    couplings : (groups - 1, size, size) ``L_k^-1 lower_k'``.
    """

    factors: AnyArray
    couplings: AnyArray

    @staticmethod
    def factor(diagonal: AnyArray, lower: AnyArray | None = None) -> BlockChain:
        """Factor the matrix with blocks `diagonal` (groups, size, size) and `lower` below them.

        `lower[k]` stands in block row k + 1, block column k.

        Raises
        ------
        ConvergenceError
            If a pivot is not positive definite: the covariance given is not one.
        """
        from tumble.estimation.kernels import eliminate

        groups, size, _ = diagonal.shape
        couplings = np.zeros((max(groups - 1, 0), size, size))
        if lower is not None:
            couplings[:] = lower
        chain = BlockChain(np.array(diagonal, dtype=np.float64, order="C"), couplings)
        bad = eliminate(chain.factors, couplings, np.empty((groups, size, 0)), np.zeros((groups, size)))
        if bad >= 0 or not np.all(np.isfinite(chain.factors)):
            raise ConvergenceError(
                "The covariance of the observations is not positive definite: "
                "a hold has no noise at all, or too few samples."
            )
        return chain

    def solve(self, right: AnyArray) -> AnyArray:
        """Return the inverse times `right`, (groups, size, columns)."""
        from tumble.estimation.kernels import solve_chain

        solution = np.array(right, dtype=np.float64, order="C")
        solve_chain(self.factors, self.couplings, solution)
        return solution

    def inverse_diagonal(self) -> AnyArray:
        """Return the diagonal blocks of the inverse, (groups, size, size)."""
        from tumble.estimation.kernels import invert_selected

        blocks, nothing = np.empty(self.factors.shape), np.empty((*self.factors.shape[:2], 0))
        invert_selected(
            *(self.factors, self.couplings, nothing, np.empty((0, 0))),
            *(blocks, np.empty(self.couplings.shape), nothing),
        )
        return blocks
