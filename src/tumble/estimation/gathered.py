"""The terms of a bordered chain, kept one by one: what each observation does to the border's unknowns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import AnyArray, Square, Table
from tumble.estimation.bordered import BorderedChain, NodeCovariance


@dataclass(frozen=True, slots=True)
class GatheredTerms:
    """Whitened terms of one source.

    Attributes
    ----------
    source : where they come from, as `BorderedChain.source` was told.
    node : (terms,) which node; empty of terms of the border alone.
    by_node, by_next : (terms, m, d) derivatives, None where there is no dependence.
    by_border : (terms, m, b).
    """

    source: str
    node: np.ndarray
    by_node: AnyArray | None
    by_next: AnyArray | None
    by_border: AnyArray

    def gain(self, nodes: NodeCovariance, border: Square, rows: slice) -> AnyArray:
        """Return (terms, rows, m): by how much a whitened error of each term moves the border's unknowns `rows`.

        Parameters
        ----------
        nodes, border : covariances of nodes, and of the border (b, b), of the whole estimate.
        rows : which of the border's unknowns.
        """
        made = border[rows] @ np.swapaxes(self.by_border, 1, 2)
        for derivative, at in ((self.by_node, self.node), (self.by_next, self.node + 1)):
            if derivative is not None:
                across = np.swapaxes(nodes.with_border[at][:, :, rows], 1, 2)
                made = made + across @ np.swapaxes(derivative, 1, 2)
        return made

    def taken(self, nodes: NodeCovariance, border: Square) -> AnyArray:
        """Return (terms, m, m) the covariance of what is adjusted, where that of the observations is the identity.

        Parameters
        ----------
        nodes, border : as for `gain`.
        """
        whole = self.by_border @ border @ np.swapaxes(self.by_border, 1, 2)
        for derivative, at in ((self.by_node, self.node), (self.by_next, self.node + 1)):
            if derivative is not None:
                cross = derivative @ nodes.with_border[at] @ np.swapaxes(self.by_border, 1, 2)
                own = derivative @ nodes.own[at] @ np.swapaxes(derivative, 1, 2)
                whole = whole + own + cross + np.swapaxes(cross, 1, 2)
        if self.by_node is not None and self.by_next is not None:
            cross = self.by_node @ nodes.following[self.node] @ np.swapaxes(self.by_next, 1, 2)
            whole = whole + cross + np.swapaxes(cross, 1, 2)
        return whole


@dataclass(slots=True)
class GatheringChain(BorderedChain):
    """A chain that keeps the terms that it is given, and adds none up."""

    terms: list[GatheredTerms] = field(default_factory=list[GatheredTerms])
    told: str = ""

    @staticmethod
    def of(size: int, border: int) -> GatheringChain:
        """Return an empty one for nodes of `size` unknowns and a border of `border`."""
        empty = BorderedChain.zero(1, size, border)
        return GatheringChain(
            empty.diagonal, empty.lower, empty.border, empty.gradient, empty.corner, empty.corner_gradient
        )

    def source(self, name: str) -> None:
        """Say where the terms that follow come from."""
        self.told = name

    def add_unary(self, node: np.ndarray, residual: Table, by_node: AnyArray, by_border: AnyArray) -> None:
        """Keep terms of one node each and the border; see `BorderedChain`."""
        self.terms.append(GatheredTerms(self.told, np.asarray(node), by_node, None, by_border))

    def add_links(
        self, node: np.ndarray, residual: Table, by_node: AnyArray, by_next: AnyArray, by_border: AnyArray
    ) -> None:
        """Keep terms of a node, the next one and the border; see `BorderedChain`."""
        self.terms.append(GatheredTerms(self.told, np.asarray(node), by_node, by_next, by_border))

    def add_border(self, residual: Table, by_border: AnyArray) -> None:
        """Keep terms of the border alone; see `BorderedChain`."""
        self.terms.append(GatheredTerms(self.told, np.zeros(0, dtype=int), None, None, by_border))
