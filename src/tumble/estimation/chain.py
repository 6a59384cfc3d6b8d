"""Normal equations of a chain, and of chains within chains: cost grows linearly with the nodes.

A chain has nodes (attitudes, say), each joined to its neighbours at most, and a border that every node may depend
on: unknowns of its own, and those outside of it. Nodes and own unknowns are eliminated; what is left are equations
of the outside. So a chain within another one (a rotation between two holds, a section of a recording, a recording of
a unit) is eliminated first and joined to that one, and steps and covariances come back the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, inverted
from tumble.errors import ObservabilityError
from tumble.estimation.equations import Equations, Linear


@dataclass(frozen=True, slots=True)
class Place:
    """Where a chain stands in the one around it: between a node and the next one, or nowhere along it.

    The outside of the inner chain is these parts of both nodes, and then the outer chain's border.

    Attributes
    ----------
    node : the node that it begins at; -1 for a chain that joins the border alone.
    at_node, at_next : which unknowns of that node, and of the one after it.
    """

    node: int = -1
    at_node: slice = field(default_factory=lambda: slice(0, 0))
    at_next: slice = field(default_factory=lambda: slice(0, 0))

    @property
    def width(self) -> int:
        """How many unknowns of nodes it joins."""
        return (self.at_node.stop - self.at_node.start) + (self.at_next.stop - self.at_next.start)

    def parts(self) -> tuple[slice, slice, slice]:
        """Return where both nodes and the border stand in the outside of the inner chain."""
        first = self.at_node.stop - self.at_node.start
        return slice(0, first), slice(first, self.width), slice(self.width, None)


@runtime_checkable
class Stretch(Protocol):
    """What a chain is made of: nodes, unknowns of its own, equations, and stretches within it."""

    @property
    def nodes(self) -> int:
        """How many nodes there are."""
        ...

    @property
    def size(self) -> int:
        """How many unknowns a node has."""
        ...

    @property
    def own(self) -> int:
        """How many unknowns of the border are its own."""
        ...

    @property
    def equations(self) -> Sequence[Equations]:
        """Everything that is observed along it."""
        ...

    @property
    def within(self) -> Sequence[tuple[Place, Stretch | Eliminated]]:
        """The stretches within it, or what is left of them, each with its place."""
        ...

    def undetermined(self, node: int) -> str:
        """Return what to say to people where what was observed does not determine a node."""
        ...

    def move(self, nodes: Table, own: Series) -> None:
        """Move its unknowns by a step."""
        ...


@dataclass(slots=True)
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

    def move(self, nodes: Table, border: Series) -> None:
        """Move the residuals by a step of what they depend on."""
        self.residual = self.residual + self.by_border @ border
        for by, at in ((self.by_node, self.linear.node), (self.by_next, self.linear.node + 1)):
            if by is not None:
                self.residual = self.residual + np.einsum("tmd,td->tm", by, nodes[at])

    @property
    def raw(self) -> AnyArray:
        """(terms, m) residuals in their own units."""
        return np.einsum("tij,tj->ti", self.root, self.residual)


def _terms_of(stretches: Sequence[Stretch], state: Any) -> list[list[Whitened]]:
    """Whitened residuals of stretches, all equations of one kind at once."""
    of_kind: dict[type[Equations], list[tuple[int, int]]] = {}
    for number, stretch in enumerate(stretches):
        for slot, equations in enumerate(stretch.equations):
            of_kind.setdefault(type(equations), []).append((number, slot))
    found: dict[tuple[int, int], Sequence[Linear]] = {}
    for kind, places in of_kind.items():
        members = [stretches[number].equations[slot] for number, slot in places]
        found.update(zip(places, kind.linearise_all(members, state), strict=True))
    return [
        [
            Whitened.of(equations, linear)
            for slot, equations in enumerate(stretch.equations)
            for linear in found[number, slot]
        ]
        for number, stretch in enumerate(stretches)
    ]


@dataclass(slots=True)
class Chain:
    """Normal equations ``H x = -g`` of a stretch, gathered term by term.

    Attributes
    ----------
    own : unknowns of the border that are the chain's own; they come first.
    diagonal : (nodes, d, d).
    lower : (nodes - 1, d, d), blocks in row k + 1 and column k.
    border : (nodes, d, b).
    gradient : (nodes, d).
    corner, corner_gradient : (b, b) and (b,), of the border itself.
    terms : what was added.
    within : chains within it, eliminated, and where.
    stretch : what it is made of; None if it was put together by hand.
    """

    own: int
    diagonal: AnyArray
    lower: AnyArray
    border: AnyArray
    gradient: Table
    corner: Square
    corner_gradient: Series
    terms: list[Whitened] = field(default_factory=list[Whitened])
    within: list[tuple[Place, Eliminated]] = field(default_factory=list[Any])
    stretch: Stretch | None = None

    @staticmethod
    def zero(nodes: int, size: int, own: int, outside: int) -> Chain:
        """Return the empty equations of `nodes` nodes of `size` unknowns, and of a border."""
        border = own + outside
        return Chain(
            own,
            np.zeros((nodes, size, size)),
            np.zeros((max(nodes - 1, 0), size, size)),
            np.zeros((nodes, size, border)),
            np.zeros((nodes, size)),
            np.zeros((border, border)),
            np.zeros(border),
        )

    @staticmethod
    def of(stretch: Stretch, state: Any, outside: int) -> Chain:
        """Return the equations of a stretch at a state, with what lies within it.

        Parameters
        ----------
        stretch : what is observed.
        state : where everything is; handed to the equations.
        outside : how many unknowns lie outside.
        """
        return Chain._of_all([(stretch, outside)], state)[0]

    @staticmethod
    def _of_all(given: Sequence[tuple[Stretch, int]], state: Any) -> list[Chain]:
        """The equations of stretches side by side, each with how many unknowns lie outside of it."""
        made: list[Chain] = []
        terms = _terms_of([stretch for stretch, _ in given], state)
        for (stretch, outside), whitened in zip(given, terms, strict=True):
            chain = Chain.zero(stretch.nodes, stretch.size, stretch.own, outside)
            chain.stretch = stretch
            chain.add(*whitened)
            fresh = [
                (inner, place.width + stretch.own + outside)
                for place, inner in stretch.within
                if not isinstance(inner, Eliminated)
            ]
            inners = iter(Chain._of_all(fresh, state) if fresh else [])
            for place, inner in stretch.within:
                chain.join(place, inner if isinstance(inner, Eliminated) else next(inners).eliminated())
            made.append(chain)
        return made

    def add(self, *terms: Whitened) -> None:
        """Add whitened residuals that depend on a node and the next one at most, and on the border."""
        from tumble.estimation.kernels import add_to_border, add_to_nodes

        sums = self.gradient, self.border, self.diagonal, self.lower
        for term in terms:
            node, residual, by_border = term.linear.node, term.residual, term.by_border
            if not node.size:
                # What is observed of the border alone is of a few of its unknowns each.
                add_to_border(residual, by_border, self.corner, self.corner_gradient)
                continue
            nothing = np.empty((len(residual), residual.shape[1], 0))
            if term.by_node is not None:
                add_to_nodes(node, residual, by_border, term.by_node, nothing, *sums)
            if term.by_next is not None:
                before = nothing if term.by_node is None else term.by_node
                add_to_nodes(node + 1, residual, by_border, term.by_next, before, *sums)
            # Of a rotation's border, each kind depends on a few unknowns.
            flat = by_border.reshape(-1, len(self.corner))
            used = np.flatnonzero(flat.any(axis=0))
            flat = flat[:, used]
            self.corner[np.ix_(used, used)] += flat.T @ flat
            self.corner_gradient[used] += flat.T @ residual.ravel()
        self.terms += terms

    def join(self, place: Place, inner: Eliminated) -> None:
        """Add what an eliminated chain says of its outside."""
        (first, second, rest), (k, at, after) = place.parts(), (place.node, place.at_node, place.at_next)
        M, g = inner.matrix, inner.right
        if k >= 0:
            self.diagonal[k, at, at] += M[first, first]
            self.diagonal[k + 1, after, after] += M[second, second]
            self.lower[k, after, at] += M[second, first]
            self.border[k, at] += M[first, rest]
            self.border[k + 1, after] += M[second, rest]
            self.gradient[k, at] += g[first]
            self.gradient[k + 1, after] += g[second]
        self.corner += M[rest, rest]
        self.corner_gradient += g[rest]
        self.within.append((place, inner))

    @property
    def square_sum(self) -> float:
        """Of all residuals, those within included."""
        return sum(t.square_sum for t in self.terms) + sum(i.chain.square_sum for _, i in self.within)

    @property
    def checks(self) -> int:
        """How many observations there are beyond the nodes and own unknowns, those within included."""
        unknowns = self.gradient.size + self.own
        observations = sum(t.linear.observations for t in self.terms)
        return observations - unknowns + sum(i.chain.checks for _, i in self.within)

    def eliminated(self) -> Eliminated:
        """Return the chain with nodes and own unknowns eliminated; the equations themselves are left as they are.

        Raises
        ------
        ObservabilityError
            If a node is not determined, whatever the border is.
        """
        from tumble.estimation.kernels import eliminate

        diagonal, lower, border = self.diagonal.copy(), self.lower.copy(), self.border.copy()
        gradient = self.gradient.copy()
        bad = eliminate(diagonal, lower, border, gradient)
        if bad >= 0:
            nameless = f"Node {bad + 1} of {len(self.diagonal)} is not determined by what was observed."
            raise ObservabilityError(nameless if self.stretch is None else self.stretch.undetermined(bad))
        flat = border.reshape(-1, len(self.corner))
        corner, right = self.corner - flat.T @ flat, self.corner_gradient - flat.T @ gradient.ravel()
        return Eliminated(self, diagonal, lower, border, gradient, corner, right)


@dataclass(slots=True)
class Eliminated:
    """A chain whose nodes and own unknowns are eliminated: factors, and what is left of the outside's equations.

    Attributes
    ----------
    chain : the equations as they were.
    diagonal, lower, border, gradient : factors, see `kernels.eliminate`.
    corner, corner_gradient : (b, b), (b,) what the nodes leave of the border's equations.
    gain, own_gradient : (own, outside), (own,) the inverse of the own unknowns' part of it times what stands beside.
    matrix, right : (outside, outside), (outside,) what is left when these are eliminated, too.
    """

    chain: Chain
    diagonal: AnyArray
    lower: AnyArray
    border: AnyArray
    gradient: Table
    corner: Square
    corner_gradient: Series
    gain: AnyArray = field(init=False)
    own_gradient: Series = field(init=False)
    matrix: Table = field(init=False)
    right: Series = field(init=False)

    def __post_init__(self) -> None:
        """Eliminate the own unknowns."""
        n = self.chain.own
        across, rest = self.corner[:n, n:], self.corner_gradient[:n, None]
        beside = np.concatenate([across, rest], axis=1)
        solved = np.asarray(np.linalg.solve(self.corner[:n, :n], beside), dtype=np.float64)
        self.gain, self.own_gradient = solved[:, :-1], solved[:, -1]
        self.matrix = self.corner[n:, n:] - across.T @ self.gain
        self.right = self.corner_gradient[n:] - across.T @ self.own_gradient

    def own_step(self, outside: Series) -> Series:
        """Return the step of the own unknowns that goes with the outside's."""
        return -(self.own_gradient + self.gain @ outside)

    def nodes_step(self, border: Series) -> Table:
        """Return (nodes, d) the nodes' steps that go with the border's."""
        from tumble.estimation.kernels import substitute

        steps = np.zeros(self.gradient.shape)
        if steps.size:
            substitute(self.diagonal, self.lower, self.border, self.gradient, border, steps)
        return steps

    def move(self, outside: Series, share: float = 1.0, *, residuals: bool = True) -> None:
        """Move everything in the chain, and within it, by a share of the step that goes with the outside's.

        Parameters
        ----------
        outside : the step.
        share : of it.
        residuals : move the residuals, too: of equations that are made anew nobody looks at them.
        """
        border = np.concatenate([self.own_step(outside), outside])
        nodes = self.nodes_step(border)
        for place, inner in self.within:
            k = place.node
            ends = [nodes[k, place.at_node], nodes[k + 1, place.at_next]] if k >= 0 else []
            inner.move(np.concatenate([*ends, border]), share, residuals=residuals)
        if residuals:
            for term in self.chain.terms:
                term.move(share * nodes, share * border)
        if self.chain.stretch is not None:
            self.chain.stretch.move(share * nodes, share * border[: self.chain.own])

    @property
    def within(self) -> list[tuple[Place, Eliminated]]:
        """The chains within it."""
        return self.chain.within


@dataclass(slots=True)
class Spread:
    """Covariances of an eliminated chain.

    Attributes
    ----------
    chain : with its terms.
    border : (b, b) covariance of the border.
    """

    chain: Eliminated
    border: Square
    _nodes: tuple[AnyArray, AnyArray, AnyArray] | None = None

    @staticmethod
    def of(chain: Eliminated, outside: Square) -> Spread:
        """Return the covariances that go with the outside's."""
        n = chain.chain.own
        gain = -chain.gain
        border = np.zeros((n + len(outside), n + len(outside)))
        border[n:, n:] = outside
        border[:n, n:] = gain @ outside
        border[n:, :n] = border[:n, n:].T
        border[:n, :n] = inverted(chain.corner[:n, :n]) + border[:n, n:] @ gain.T
        return Spread(chain, border)

    @property
    def nodes(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Covariances of nodes: (nodes, d, d), with the next one (nodes - 1, d, d), with the border (nodes, d, b)."""
        if self._nodes is None:
            from tumble.estimation.kernels import invert_selected

            c = self.chain
            made = np.zeros(c.diagonal.shape), np.zeros(c.lower.shape), np.zeros(c.border.shape)
            invert_selected(c.diagonal, c.lower, c.border, self.border, *made)
            self._nodes = made
        return self._nodes

    def within(self) -> list[Spread]:
        """Return the covariances of the chains within it."""
        made: list[Spread] = []
        for place, inner in self.chain.within:
            if place.node < 0:
                made.append(Spread.of(inner, self.border))
                continue
            own, following, with_border = self.nodes
            k, at, after = place.node, place.at_node, place.at_next
            first, second, rest = place.parts()
            outside = np.zeros((place.width + len(self.border),) * 2)
            outside[first, first], outside[second, second] = own[k][at, at], own[k + 1][after, after]
            outside[first, second] = following[k][at, after]
            outside[second, first] = outside[first, second].T
            outside[first, rest], outside[second, rest] = with_border[k][at], with_border[k + 1][after]
            outside[rest, : place.width] = outside[: place.width, rest].T
            outside[rest, rest] = self.border
            made.append(Spread.of(inner, outside))
        return made

    def walk(self) -> Iterator[Spread]:
        """Yield this chain's covariances, and those of all chains within it."""
        yield self
        for inner in self.within():
            yield from inner.walk()

    def gain(self, term: Whitened, last: int) -> AnyArray:
        """Return (terms, last, m): by how much whitened errors move the last unknowns of the border.

        Parameters
        ----------
        term : of the chain.
        last : how many of the border's unknowns.
        """
        rows = slice(len(self.border) - last, None)
        made = self.border[rows] @ np.swapaxes(term.by_border, 1, 2)
        for by, at in ((term.by_node, term.linear.node), (term.by_next, term.linear.node + 1)):
            if by is not None:
                across = np.swapaxes(self.nodes[2][at][:, :, rows], 1, 2)
                made = made + across @ np.swapaxes(by, 1, 2)
        return made

    def taken(self, term: Whitened) -> AnyArray:
        """Return (terms, m, m) the whitened covariance of the adjusted observations."""
        by_border, node = term.by_border, term.linear.node
        whole = by_border @ self.border @ np.swapaxes(by_border, 1, 2)
        for by, at in ((term.by_node, node), (term.by_next, node + 1)):
            if by is not None:
                cross = by @ self.nodes[2][at] @ np.swapaxes(by_border, 1, 2)
                whole = (
                    whole + by @ self.nodes[0][at] @ np.swapaxes(by, 1, 2) + cross + np.swapaxes(cross, 1, 2)
                )
        if term.by_node is not None and term.by_next is not None:
            cross = term.by_node @ self.nodes[1][node] @ np.swapaxes(term.by_next, 1, 2)
            whole = whole + cross + np.swapaxes(cross, 1, 2)
        return whole
