"""What is observed along chains side by side, whitened and summed up: many of one shape cost little more than one.

The rotations of a table are alike: as many unknowns each, and the same kinds of observations. Their terms stand one
after another in the same arrays, so that each kind is whitened and added once and not once a rotation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Table
from tumble.estimation.equations import Equations, Linear
from tumble.records import dataclass


@dataclass
class Whitened:
    """Residuals and derivatives in units of their standard deviations, with where they come from.

    Attributes
    ----------
    equations, linear : what was observed, and its linearisation.
    root : (terms, m, m) Cholesky factor of the covariance: raw errors are ``root @ whitened``.
    residual : (terms, m).
    by_node, by_next, by_border : (terms, m, ...) derivatives.
    """

    equations: Equations
    linear: Linear
    root: AnyArray
    residual: AnyArray
    by_node: AnyArray | None
    by_next: AnyArray | None
    by_border: AnyArray

    @staticmethod
    def of(equations: Equations, linear: Linear) -> Whitened:
        """Whiten a linearisation.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a covariance is not positive.
        """
        from tumble.estimation.kernels import whiten

        given = [linear.residual[:, :, None], linear.by_border]
        given += [by for by in (linear.by_node, linear.by_next) if by is not None]
        made, root = [np.empty(one.shape) for one in given], np.empty(linear.covariance.shape)
        if whiten(linear.weighed, given, root, made) >= 0:
            raise np.linalg.LinAlgError("a covariance is not positive")
        by_node, by_next = (None if by is None else made.pop(2) for by in (linear.by_node, linear.by_next))
        return Whitened(equations, linear, root, made[0][:, :, 0], by_node, by_next, made[1])

    @property
    def square_sum(self) -> float:
        """Of the residuals that take part."""
        active = self.linear.active
        return float(np.sum((self.residual if active is None else self.residual[active]) ** 2))

    @property
    def raw(self) -> AnyArray:
        """(terms, m) residuals in their own units."""
        return np.einsum("tij,tj->ti", self.root, self.residual)

    def part(self, equations: Equations, at: slice, first: int) -> Whitened:
        """Return some of the terms, of a chain whose nodes begin at `first`."""
        by_node, by_next = (None if by is None else by[at] for by in (self.by_node, self.by_next))
        linear, root = self.linear.part(at, first), self.root[at]
        return Whitened(equations, linear, root, self.residual[at], by_node, by_next, self.by_border[at])

    def beside(self, more: AnyArray, first: int) -> Whitened:
        """Return the same terms with whitened derivatives (terms, m, ...) by unknowns of the border from `first` on."""
        by_border = np.concatenate([self.by_border, more], axis=2)
        columns = np.r_[self.linear.columns, first : first + more.shape[2]]
        return replace(self, linear=replace(self.linear, columns=columns), by_border=by_border)


NONE = Equations()
"""Of a chain along which nothing of a kind is observed."""


@dataclass
class Rows:
    """What is observed of one kind along chains side by side, whitened together.

    Attributes
    ----------
    whitened : of all chains, those of each one after another; nodes are counted through.
    equations : of each chain.
    stops : where the terms of each chain end; where it has none, with those of the chain before.
    """

    whitened: Whitened
    equations: Sequence[Equations]
    stops: Sequence[int]

    def at(self, chain: int) -> slice:
        """Return which terms are a chain's."""
        return slice(self.stops[chain - 1] if chain else 0, self.stops[chain])

    def move(self, nodes: Table, borders: Table) -> None:
        """Move the residuals by steps of all nodes (nodes, d) and of each chain's border (chains, b).

        Raises
        ------
        ValueError
            If there are not as many borders as chains.
        """
        if len(borders) != len(self.stops):
            raise ValueError("chains that are side by side move together")
        term = self.whitened
        borders = borders[:, term.linear.columns]
        if len(borders) == 1:
            moved = term.by_border @ borders[0]
        else:
            counts = np.diff(self.stops, prepend=0)
            moved = np.einsum("tmb,tb->tm", term.by_border, np.repeat(borders, counts, axis=0))
        for by, at in ((term.by_node, term.linear.node), (term.by_next, term.linear.node + 1)):
            if by is not None:
                moved = moved + np.einsum("tmd,td->tm", by, nodes[at])
        term.residual = term.residual + moved


@dataclass
class Sums:
    """Normal equations ``H x = -g`` of chains side by side, gathered term by term: see `Chain`.

    Attributes
    ----------
    stops : where each chain's nodes end.
    diagonal, lower, border, gradient : as of one chain, their nodes one after another; between two, `lower` is zero.
    corner, corner_gradient : (chains, b, b) and (chains, b), of each one's border.
    rows : what was added.
    """

    stops: Sequence[int]
    diagonal: AnyArray
    lower: AnyArray
    border: AnyArray
    gradient: Table
    corner: AnyArray
    corner_gradient: Table
    rows: list[Rows] = field(default_factory=list[Rows])

    @staticmethod
    def zero(nodes: Sequence[int], size: int, border: int) -> Sums:
        """Return the empty equations of chains of so many `nodes` of `size` unknowns, and of their borders."""
        whole = sum(nodes)
        return Sums(
            np.cumsum(nodes).tolist(),
            np.zeros((whole, size, size)),
            np.zeros((max(whole - 1, 0), size, size)),
            np.zeros((whole, size, border)),
            np.zeros((whole, size)),
            np.zeros((len(nodes), border, border)),
            np.zeros((len(nodes), border)),
        )

    def at(self, chain: int) -> slice:
        """Return which nodes are a chain's."""
        return slice(self.stops[chain - 1] if chain else 0, self.stops[chain])

    def add(self, rows: Rows) -> None:
        """Add whitened residuals that depend on a node and the next one at most, and on the border."""
        from tumble.estimation.kernels import add_squares, add_to_border, add_to_nodes

        term, sums = rows.whitened, (self.gradient, self.border, self.diagonal, self.lower)
        node, columns = term.linear.node, term.linear.columns
        residual, by_border = term.residual, term.by_border
        self.rows.append(rows)
        counts = np.diff(rows.stops, prepend=0)
        if not node.size:
            # What is observed of the border alone is of a few of its unknowns each.
            chain = np.repeat(np.arange(counts.size), counts)
            add_to_border(chain, residual, columns, by_border, self.corner, self.corner_gradient)
            return
        nothing = np.empty((len(residual), residual.shape[1], 0))
        if term.by_node is not None:
            add_to_nodes(node, residual, columns, by_border, term.by_node, nothing, *sums)
        if term.by_next is not None:
            before = nothing if term.by_node is None else term.by_node
            add_to_nodes(node + 1, residual, columns, by_border, term.by_next, before, *sums)
        for count in sorted({*counts.tolist()} - {0}):
            # Chains with as many terms at once.
            chain = np.flatnonzero(counts == count)
            at = np.ravel(np.asarray(rows.stops)[chain, None] + np.arange(-count, 0))
            size = chain.size, count * residual.shape[1]
            flat = (by_border if at.size == len(residual) else by_border[at]).reshape(*size, columns.size)
            across = np.swapaxes(flat, 1, 2)
            right = (across @ residual[at].reshape(*size, 1))[:, :, 0]
            add_squares(chain, columns, across @ flat, right, self.corner, self.corner_gradient)

    def widened(self, columns: Callable[[Whitened], AnyArray | None], count: int) -> Sums:
        """Return the same sums with more unknowns of the border; see `Chain.widened`."""
        nodes, border = np.diff(self.stops, prepend=0).tolist(), self.corner.shape[1]
        made = Sums.zero(nodes, self.diagonal.shape[1], border + count)
        for rows in self.rows:
            more: AnyArray | None = None
            for chain, equations in enumerate(rows.equations):
                at = rows.at(chain)
                term = rows.whitened.part(equations, at, self.at(chain).start)
                by = columns(term) if at.stop > at.start else None
                if by is not None:
                    more = np.zeros((*rows.whitened.residual.shape, count)) if more is None else more
                    more[at] = np.linalg.solve(term.root, by)
            whitened = rows.whitened if more is None else rows.whitened.beside(more, border)
            made.add(replace(rows, whitened=whitened))
        return made

    def add_all(self, given: Sequence[Sequence[Equations]], state: Any) -> None:
        """Add what is observed along each chain, all of one kind at once.

        Parameters
        ----------
        given : of each chain.
        state : where everything is; handed to the equations.
        """
        of_kind: dict[tuple[type[Equations], int], dict[int, Equations]] = {}
        for number, observed in enumerate(given):
            for equations in observed:
                nth = 0
                while number in of_kind.setdefault((type(equations), nth), {}):
                    nth += 1
                of_kind[type(equations), nth][number] = equations
        firsts = np.array([0, *self.stops[:-1]])
        for (kind, _), members in of_kind.items():
            there, equations = [*members], [members.get(number, NONE) for number in range(len(given))]
            for linear, counts in kind.linearise_all([*members.values()], state):
                if linear.node.size and len(given) > 1:
                    linear.node = linear.node + np.repeat(firsts[there], counts)
                stops = np.zeros(len(given), dtype=int)
                stops[there] = counts
                self.add(Rows(Whitened.of(equations[0], linear), equations, np.cumsum(stops).tolist()))

    @property
    def square_sum(self) -> float:
        """Of all residuals that take part."""
        return sum(rows.whitened.square_sum for rows in self.rows)

    @property
    def observations(self) -> int:
        """How many there are."""
        return sum(rows.whitened.linear.observations for rows in self.rows)
