"""Least squares over a chain of nodes that all share some unknowns: cost grows linearly with the nodes.

Unknowns are nodes ``x_0 .. x_n`` (attitudes, say), each joined to its neighbours at most, and a border
``z`` (parameters of a sensor) that every node may depend on. The normal equations are block tridiagonal
with a border; nodes are eliminated one after the other, which leaves the border's own (Schur complement).
A chain whose border is again a part of another chain can be eliminated first and added to that one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.errors import ObservabilityError


@dataclass(slots=True)
class BorderedChain:
    """Normal equations ``H x = -g`` of a chain with a border, gathered term by term.

    Attributes
    ----------
    diagonal : (nodes, d, d).
    lower : (nodes - 1, d, d), blocks in row k + 1 and column k.
    border : (nodes, d, b).
    gradient : (nodes, d).
    corner, corner_gradient : (b, b) and (b,), of the border itself.
    """

    diagonal: AnyArray
    lower: AnyArray
    border: AnyArray
    gradient: Table
    corner: Square
    corner_gradient: Series

    @staticmethod
    def zero(nodes: int, size: int, border: int) -> BorderedChain:
        """Return the empty equations of `nodes` nodes of `size` unknowns and a border of `border`."""
        return BorderedChain(
            np.zeros((nodes, size, size)),
            np.zeros((max(nodes - 1, 0), size, size)),
            np.zeros((nodes, size, border)),
            np.zeros((nodes, size)),
            np.zeros((border, border)),
            np.zeros(border),
        )

    def source(self, name: str) -> None:
        """Say where the terms that follow come from: these equations do not care, `GatheredTerms` keeps it."""

    def add_unary(self, node: np.ndarray, residual: Table, by_node: AnyArray, by_border: AnyArray) -> None:
        """Add whitened residuals that depend on one node each and on the border.

        Parameters
        ----------
        node : (terms,) which node.
        residual : (terms, m) of unit variance.
        by_node, by_border : (terms, m, d), (terms, m, b) derivatives.
        """
        np.add.at(self.diagonal, node, np.swapaxes(by_node, 1, 2) @ by_node)
        np.add.at(self.border, node, np.swapaxes(by_node, 1, 2) @ by_border)
        np.add.at(self.gradient, node, np.einsum("tmd,tm->td", by_node, residual))
        self.add_border(residual, by_border)

    def add_links(
        self, node: np.ndarray, residual: Table, by_node: AnyArray, by_next: AnyArray, by_border: AnyArray
    ) -> None:
        """Add whitened residuals that depend on a node, on the next one and on the border.

        Parameters
        ----------
        node : (terms,) the first of the two.
        residual : (terms, m) of unit variance.
        by_node, by_next, by_border : (terms, m, d), (terms, m, d), (terms, m, b) derivatives.
        """
        np.add.at(self.lower, node, np.swapaxes(by_next, 1, 2) @ by_node)
        np.add.at(self.diagonal, node + 1, np.swapaxes(by_next, 1, 2) @ by_next)
        np.add.at(self.border, node + 1, np.swapaxes(by_next, 1, 2) @ by_border)
        np.add.at(self.gradient, node + 1, np.einsum("tmd,tm->td", by_next, residual))
        self.add_unary(node, residual, by_node, by_border)

    def add_border(self, residual: Table, by_border: AnyArray) -> None:
        """Add whitened residuals that depend on the border alone, (terms, m) with (terms, m, b)."""
        flat = by_border.reshape(-1, by_border.shape[2])
        self.corner += flat.T @ flat
        self.corner_gradient += flat.T @ residual.ravel()

    def eliminated(self) -> EliminatedChain:
        """Return the chain with its nodes eliminated; the equations themselves are left as they are.

        Raises
        ------
        ObservabilityError
            If a node is not determined, whatever the border is.
        """
        from tumble.estimation.kernels import eliminate

        made = EliminatedChain(
            self.diagonal.copy(),
            self.lower.copy(),
            self.border.copy(),
            self.gradient.copy(),
            self.corner.copy(),
            self.corner_gradient.copy(),
        )
        bad = eliminate(
            made.diagonal, made.lower, made.border, made.gradient, made.corner, made.corner_gradient
        )
        if bad >= 0:
            raise ObservabilityError(
                f"Node {bad + 1} of {len(self.diagonal)} of the motion is not determined by what was observed."
            )
        return made


@dataclass(frozen=True, slots=True)
class NodeCovariance:
    """Covariances of nodes: (nodes, d, d), with the next one (nodes - 1, d, d), with the border (nodes, d, b)."""

    own: AnyArray
    following: AnyArray
    with_border: AnyArray


@dataclass(slots=True)
class EliminatedChain:
    """A chain whose nodes are eliminated: factors, and the border's own equations.

    Attributes
    ----------
    diagonal, lower, border, gradient : factors, see `kernels.eliminate`.
    corner, corner_gradient : (b, b), (b,) what the nodes leave of the border's equations.
    """

    diagonal: AnyArray
    lower: AnyArray
    border: AnyArray
    gradient: Table
    corner: Square
    corner_gradient: Series

    def steps(self, corner_step: Series) -> Table:
        """Return (nodes, d) the nodes' steps that go with the border's."""
        from tumble.estimation.kernels import substitute

        steps = np.zeros(self.gradient.shape)
        substitute(self.diagonal, self.lower, self.border, self.gradient, corner_step, steps)
        return steps

    def covariance(self, corner_covariance: Square) -> NodeCovariance:
        """Return the nodes' covariances that go with the border's."""
        from tumble.estimation.kernels import invert_selected

        own = np.zeros(self.diagonal.shape)
        following, with_border = np.zeros(self.lower.shape), np.zeros(self.border.shape)
        invert_selected(
            self.diagonal, self.lower, self.border, corner_covariance, own, following, with_border
        )
        return NodeCovariance(own, following, with_border)

    def decrease(self, corner_step: Series) -> float:
        """Return by how much the square sum falls with the step, the border's whole equations aside."""
        return float(np.sum(self.gradient**2)) - float(corner_step @ self.corner_gradient)


def whiten(covariance: AnyArray, *arrays: AnyArray) -> list[AnyArray]:
    """Return ``L^-1 a`` for each array a of (terms, m, ...), with ``L L' = covariance`` (terms, m, m).

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is not positive definite.
    """
    root = np.linalg.cholesky(covariance)
    sizes = [a.reshape(*a.shape[:2], -1).shape[2] for a in arrays]
    stacked = np.concatenate([a.reshape(*a.shape[:2], -1) for a in arrays], axis=2)
    solved = np.asarray(np.linalg.solve(root, stacked), dtype=np.float64)
    parts = np.split(solved, np.cumsum(sizes)[:-1], axis=2)
    return [part.reshape(a.shape) for part, a in zip(parts, arrays, strict=True)]
