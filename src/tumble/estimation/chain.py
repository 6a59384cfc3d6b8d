"""Normal equations of a chain, and of chains within chains: cost grows linearly with the nodes.

A chain has nodes (attitudes, say), each joined to its neighbours at most, and a border that every node may depend
on: unknowns of its own, and those outside of it. Nodes and own unknowns are eliminated; what is left are equations
of the outside. So a chain within another one (a rotation between two holds, a section of a recording, a recording of
a unit) is eliminated first and joined to that one, and steps and covariances come back the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, inverted
from tumble.errors import ObservabilityError
from tumble.estimation.equations import Equations
from tumble.estimation.sums import Rows, Sums, Whitened
from tumble.records import dataclass


@dataclass(frozen=True)
class Place:
    """Where a chain stands in the one around it: between a node and the next one, or nowhere along it.

    The outside of the inner chain is these parts of both nodes, and then the outer chain's border.

    Attributes
    ----------
    node : the node that it begins at; -1 for a chain that joins the border alone.
    at_node, at_next : which unknowns of that node, and of the one after it.
    at_border : which unknowns of the border it knows, of a chain that joins the border alone.
    weight : what its equations count, of such a chain.
    """

    node: int = -1
    at_node: slice = field(default_factory=lambda: slice(0, 0))
    at_next: slice = field(default_factory=lambda: slice(0, 0))
    at_border: np.ndarray | slice = field(default_factory=lambda: slice(None))
    weight: float = 1.0

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


@dataclass
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
    sums, number : of all chains side by side, and which of them it is; the arrays are parts of theirs.
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
    sums: Sums
    number: int = 0
    within: list[tuple[Place, Eliminated]] = field(default_factory=list[Any])
    stretch: Stretch | None = None

    @staticmethod
    def part(sums: Sums, number: int, own: int, stretch: Stretch | None = None) -> Chain:
        """Return one of the chains side by side."""
        at = sums.at(number)
        between = slice(at.start, max(at.stop - 1, at.start))
        nodes = sums.diagonal[at], sums.lower[between], sums.border[at], sums.gradient[at]
        borders = sums.corner[number], sums.corner_gradient[number]
        return Chain(own, *nodes, *borders, sums, number, stretch=stretch)

    @staticmethod
    def zero(nodes: int, size: int, own: int, outside: int) -> Chain:
        """Return the empty equations of `nodes` nodes of `size` unknowns, and of a border."""
        return Chain.part(Sums.zero([nodes], size, own + outside), 0, own)

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
        """The equations of stretches, each with how many unknowns lie outside of it; those of one shape at once."""
        shapes: dict[tuple[Any, ...], list[int]] = {}
        for number, (stretch, outside) in enumerate(given):
            shapes.setdefault((type(stretch), stretch.size, stretch.own, outside), []).append(number)
        made: dict[int, Chain] = {}
        for (_, size, own, outside), numbers in shapes.items():
            stretches = [given[number][0] for number in numbers]
            sums = Sums.zero([stretch.nodes for stretch in stretches], size, own + outside)
            sums.add_all([stretch.equations for stretch in stretches], state)
            for at, (number, stretch) in enumerate(zip(numbers, stretches, strict=True)):
                made[number] = chain = Chain.part(sums, at, own, stretch)
                chain._join_all(stretch.within, state)
        return [made[number] for number in range(len(given))]

    def _join_all(self, within: Sequence[tuple[Place, Stretch | Eliminated]], state: Any) -> None:
        """Join what lies within."""
        border = len(self.corner)
        fresh = [
            (inner, place.width + border) for place, inner in within if not isinstance(inner, Eliminated)
        ]
        inners = iter(_eliminated(Chain._of_all(fresh, state)))
        for place, inner in within:
            self.join(place, inner if isinstance(inner, Eliminated) else next(inners))

    @property
    def terms(self) -> list[Whitened]:
        """What was added."""
        return self.terms_of(lambda _: True)

    def terms_of(self, wanted: Callable[[Equations], bool]) -> list[Whitened]:
        """Return what was added of some equations."""
        first, made = self.sums.at(self.number).start, list[Whitened]()
        for rows in self.sums.rows:
            at, equations = rows.at(self.number), rows.equations[self.number]
            if at.stop > at.start and wanted(equations):
                made.append(rows.whitened.part(equations, at, first))
        return made

    def add(self, *terms: Whitened) -> None:
        """Add whitened residuals to a chain that stands alone; see `Sums.add`."""
        for term in terms:
            self.sums.add(Rows(term, [term.equations], [len(term.residual)]))

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
        among, weight = np.arange(len(self.corner))[place.at_border], place.weight
        self.corner[np.ix_(among, among)] += weight * M[rest, rest]
        self.corner_gradient[among] += weight * g[rest]
        self.within.append((place, inner))

    @property
    def square_sum(self) -> float:
        """Of all residuals, those within included."""
        return sum(weight * sums.square_sum for weight, sums in self._sums())

    @property
    def checks(self) -> int:
        """How many observations there are beyond the nodes and own unknowns, those within included."""
        unknowns = sum(chain.gradient.size + chain.own for _, chain in self._chains())
        return sum(sums.observations for _, sums in self._sums()) - unknowns

    def _chains(self, weight: float = 1.0) -> Iterator[tuple[float, Chain]]:
        """Yield this chain and all within it, with what each counts."""
        yield weight, self
        for place, inner in self.within:
            yield from inner.chain._chains(weight * place.weight)

    def _sums(self) -> list[tuple[float, Sums]]:
        """Those of this chain and of all within it, which lie in one side by side."""
        return [*{id(chain.sums): (weight, chain.sums) for weight, chain in self._chains()}.values()]

    def widened(self, columns: Callable[[Whitened], AnyArray | None], count: int) -> Chain:
        """Return the same equations with unknowns outside that nobody has adjusted, after all others of the border.

        Parameters
        ----------
        columns : whitened terms of one chain to their raw derivatives (terms, m, count); None where there are none.
        count : of the unknowns.
        """
        return Chain._widened_all([self], columns, count)[0]

    @staticmethod
    def _widened_all(
        chains: Sequence[Chain], columns: Callable[[Whitened], AnyArray | None], count: int
    ) -> list[Chain]:
        """The same of several chains, those side by side at once."""
        made = list[Chain]()
        wide: dict[int, Sums] = {}
        for chain in chains:
            if id(chain.sums) not in wide:
                wide[id(chain.sums)] = chain.sums.widened(columns, count)
            sums = wide[id(chain.sums)]
            made.append(Chain.part(sums, chain.number, chain.own, chain.stretch))
        within = [(outer, *joined) for outer, chain in enumerate(chains) for joined in chain.within]
        fresh = Chain._widened_all([inner.chain for *_, inner in within], columns, count) if within else []
        for (outer, place, _), inner in zip(within, _eliminated(fresh), strict=True):
            made[outer].join(place, inner)
        return made

    def eliminated(self) -> Eliminated:
        """Return the chain with nodes and own unknowns eliminated; the equations themselves are left as they are.

        Raises
        ------
        ObservabilityError
            If a node is not determined, whatever the border is.
        """
        return _eliminated([self])[0]


def _eliminated(chains: Sequence[Chain]) -> list[Eliminated]:
    """Chains with nodes and own unknowns eliminated, all of those side by side at once."""
    beside: dict[int, list[int]] = {}
    for number, chain in enumerate(chains):
        beside.setdefault(id(chain.sums), []).append(number)
    made: dict[int, Eliminated] = {}
    for numbers in beside.values():
        made.update(zip(numbers, _eliminate([chains[number] for number in numbers]), strict=True))
    return [made[number] for number in range(len(chains))]


def _eliminate(chains: Sequence[Chain]) -> list[Eliminated]:
    """The same of all chains that are side by side."""
    from tumble.estimation.kernels import eliminate

    sums, n = chains[0].sums, chains[0].own
    diagonal, lower, border = sums.diagonal.copy(), sums.lower.copy(), sums.border.copy()
    gradient = sums.gradient.copy()
    bad = eliminate(diagonal, lower, border, gradient)
    if bad >= 0:
        raise ObservabilityError(_undetermined(chains, bad))
    corner, right = sums.corner.copy(), sums.corner_gradient.copy()
    for chain in chains:
        at = sums.at(chain.number)
        flat = border[at].reshape(-1, border.shape[2])
        corner[chain.number] -= flat.T @ flat
        right[chain.number] -= flat.T @ gradient[at].ravel()
    across = np.swapaxes(corner[:, :n, n:], 1, 2)
    beside = np.concatenate([corner[:, :n, n:], right[:, :n, None]], axis=2)
    solved = np.asarray(np.linalg.solve(corner[:, :n, :n], beside), dtype=np.float64)
    left, left_right = (
        corner[:, n:, n:] - across @ solved[:, :, :-1],
        right[:, n:, None] - across @ solved[:, :, -1:],
    )
    made: list[Eliminated] = []
    for chain in chains:
        at, k = sums.at(chain.number), chain.number
        between = slice(at.start, max(at.stop - 1, at.start))
        nodes = diagonal[at], lower[between], border[at], gradient[at]
        own = solved[k, :, :-1], solved[k, :, -1]
        made.append(Eliminated(chain, *nodes, corner[k], right[k], *own, left[k], left_right[k, :, 0]))
    return made


def _undetermined(chains: Sequence[Chain], node: int) -> str:
    """What to say of a node that is not determined, of chains side by side."""
    (chain,) = (one for one in chains if (at := one.sums.at(one.number)).start <= node < at.stop)
    node -= chain.sums.at(chain.number).start
    nameless = f"Node {node + 1} of {len(chain.diagonal)} is not determined by what was observed."
    return nameless if chain.stretch is None else chain.stretch.undetermined(node)


@dataclass
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
    gain: AnyArray
    own_gradient: Series
    matrix: Table
    right: Series

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
        move_all([(self, outside)], share, residuals=residuals)

    @property
    def within(self) -> list[tuple[Place, Eliminated]]:
        """The chains within it."""
        return self.chain.within


def move_all(
    given: Sequence[tuple[Eliminated, Series]], share: float = 1.0, *, residuals: bool = True
) -> None:
    """Move chains, all of those that are side by side; see `Eliminated.move`.

    Parameters
    ----------
    given : chains, each with the step of its outside.
    share, residuals : as for one.
    """
    beside: dict[int, list[tuple[Eliminated, Series]]] = {}
    for one, outside in given:
        beside.setdefault(id(one.chain.sums), []).append((one, outside))
    for members in beside.values():
        borders = np.array([np.concatenate([one.own_step(outside), outside]) for one, outside in members])
        nodes = [one.nodes_step(border) for (one, _), border in zip(members, borders, strict=True)]
        inners: list[tuple[Eliminated, Series]] = []
        for (one, _), steps, border in zip(members, nodes, borders, strict=True):
            for place, inner in one.within:
                k = place.node
                ends = [steps[k, place.at_node], steps[k + 1, place.at_next]] if k >= 0 else []
                inners.append((inner, np.concatenate([*ends, border[place.at_border]])))
        move_all(inners, share, residuals=residuals)
        chains = [one.chain for one, _ in members]
        if residuals:
            for rows in chains[0].sums.rows:
                rows.move(share * np.concatenate(nodes), share * borders)
        for chain, steps, border in zip(chains, nodes, borders, strict=True):
            if chain.stretch is not None:
                chain.stretch.move(share * steps, share * border[: chain.own])


@dataclass
class Spread:
    """Covariances of an eliminated chain.

    Attributes
    ----------
    chain : with its terms.
    outside : (outside, outside) covariance of what is outside of it.
    """

    chain: Eliminated
    outside: Square
    _border: Square | None = None
    _nodes: tuple[AnyArray, AnyArray, AnyArray] | None = None
    _first: int = 0
    _shared: AnyArray | None = None

    @property
    def border(self) -> Square:
        """(b, b) covariance of the border."""
        if self._border is None:
            chain, n = self.chain, self.chain.chain.own
            gain = -chain.gain
            self._border = border = np.zeros((n + len(self.outside),) * 2)
            border[n:, n:] = self.outside
            border[:n, n:] = gain @ self.outside
            border[n:, :n] = border[:n, n:].T
            border[:n, :n] = inverted(chain.corner[:n, :n]) + border[:n, n:] @ gain.T
        return self._border

    @property
    def nodes(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Covariances of nodes: (nodes, d, d), with the next one (nodes - 1, d, d), with the border (nodes, d, b)."""
        return self._nodes_from(0)

    def _nodes_from(self, first: int) -> tuple[AnyArray, AnyArray, AnyArray]:
        """The same of the nodes from one on; those before are not filled."""
        if self._nodes is None or first < self._first:
            from tumble.estimation.kernels import invert_selected

            c = self.chain
            own, following, with_border = (np.zeros(of.shape) for of in (c.diagonal, c.lower, c.border))
            diagonal, lower, border = c.diagonal[first:], c.lower[first:], c.border[first:]
            made = own[first:], following[first:], with_border[first:]
            invert_selected(diagonal, lower, border, self.border, *made)
            self._nodes, self._first = (own, following, with_border), first
        return self._nodes

    def _with_shared(self, last: int) -> AnyArray:
        """(nodes, d, last) covariances of the nodes with the last unknowns of the border, without all the others."""
        if self._shared is None or self._shared.shape[2] != last:
            from tumble.estimation.kernels import solve_chain

            c, before = self.chain, self.chain.chain.border
            right = -before.reshape(-1, before.shape[2]) @ self._rows(last).T
            self._shared = np.ascontiguousarray(right).reshape(*before.shape[:2], last)
            solve_chain(c.diagonal, c.lower, self._shared)
        return self._shared

    def within(self) -> list[Spread]:
        """Return the covariances of the chains within it."""
        made: list[Spread] = []
        for place, inner in self.chain.within:
            if place.node < 0:
                made.append(Spread(inner, place.weight * self.border[place.at_border][:, place.at_border]))
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
            made.append(Spread(inner, outside))
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
        made = self._rows(last)[:, term.linear.columns] @ np.swapaxes(term.by_border, 1, 2)
        for by, at in ((term.by_node, term.linear.node), (term.by_next, term.linear.node + 1)):
            if by is not None:
                made = made + np.swapaxes(by @ self._with_shared(last)[at], 1, 2)
        return made

    def _rows(self, last: int) -> Table:
        """(last, b) covariances of the last unknowns of the border with all of it."""
        outside = self.outside[len(self.outside) - last :]
        return np.concatenate([-outside @ self.chain.gain.T, outside], axis=1)

    def _taken_at_end(self, term: Whitened) -> AnyArray:
        """`taken` of terms of the border and the last node at most: without the covariances of all own unknowns."""
        c, n = self.chain, self.chain.chain.own
        by = np.zeros((*term.residual.shape, n + len(self.outside)))
        by[:, :, term.linear.columns] = term.by_border
        whole = np.zeros((1, 1, 1))
        if term.by_node is not None:
            turned = term.by_node @ inverted(c.diagonal[-1]).T
            by, whole = by - turned @ c.border[-1], turned @ np.swapaxes(turned, 1, 2)
        own, outer = by[:, :, :n], by[:, :, n:] - by[:, :, :n] @ c.gain
        told = np.asarray(np.linalg.solve(c.corner[:n, :n], own.reshape(-1, n).T), dtype=np.float64)
        whole = whole + own @ np.swapaxes(told.T.reshape(own.shape), 1, 2)
        return whole + outer @ self.outside @ np.swapaxes(outer, 1, 2)

    def taken(self, term: Whitened) -> AnyArray:
        """Return (terms, m, m) the whitened covariance of the adjusted observations."""
        by_border, node, columns = term.by_border, term.linear.node, term.linear.columns
        if self._border is None and term.by_next is None and np.all(node == len(self.chain.diagonal) - 1):
            return self._taken_at_end(term)
        whole = by_border @ self.border[np.ix_(columns, columns)] @ np.swapaxes(by_border, 1, 2)
        if not node.size:
            return whole
        own, following, with_border = self._nodes_from(int(np.min(node)))
        for by, at in ((term.by_node, node), (term.by_next, node + 1)):
            if by is not None:
                cross = by @ with_border[at][:, :, columns] @ np.swapaxes(by_border, 1, 2)
                whole = whole + by @ own[at] @ np.swapaxes(by, 1, 2) + cross + np.swapaxes(cross, 1, 2)
        if term.by_node is not None and term.by_next is not None:
            cross = term.by_node @ following[node] @ np.swapaxes(term.by_next, 1, 2)
            whole = whole + cross + np.swapaxes(cross, 1, 2)
        return whole
