"""What each observation does to the shared unknowns, told apart by source of error.

At the solution the estimate is linear in the errors of the observations: ``dx = N^-1 J' e`` with whitened errors e.
Everything that was eliminated stands in N too, so that the gain of a term is ``Cov[shared, what the term depends on]
J'``, and the covariance is the sum of ``G G'`` over all terms. A term whose covariance has several causes is split
among them: ``G (L^-1 S L^-T) G'`` for each part S of ``L L'``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vector
from tumble.estimation.chain import Spread
from tumble.estimation.equations import Drift, Equations
from tumble.estimation.gauss_helmert import Prior
from tumble.estimation.solve import Settled
from tumble.estimation.sums import Whitened
from tumble.estimation.wander import carried, shared_wander, wider
from tumble.records import dataclass

PRIOR, OUTLYING, BENT = "prior", "observations left out", "attitudes to second order"


@dataclass(frozen=True)
class Influence:
    """One kind of observations of one chain.

    Attributes
    ----------
    kind : of the equations.
    place : (terms,) which hold, turn or rotation; -1 where it is none.
    active : (terms,) whether each takes part.
    gain : (terms, unknowns, m) by how much whitened errors move the free unknowns.
    parts : source -> (terms, m, m), the whitened covariance that it causes; they add up to the identity.
    taken : (terms, m, m) whitened covariance of the adjusted observations; None for what is not tested.
    root : (terms, m, m) Cholesky factor of the covariance: raw errors are ``root @ whitened``.
    drifts : source -> how its terms, whitened, show what a bias wanders by.
    equations : what was observed; None for what is believed beforehand.
    """

    kind: str
    place: np.ndarray
    active: np.ndarray
    gain: AnyArray
    parts: dict[str, AnyArray]
    taken: AnyArray | None
    root: AnyArray
    drifts: dict[str, Drift] = field(default_factory=dict[str, Drift])
    equations: Equations | None = None

    def share(self, source: str) -> Square:
        """Return (unknowns, unknowns) what a source adds to the covariance by these observations."""
        part = self.parts.get(source)
        if part is None:
            return np.zeros((self.gain.shape[1], self.gain.shape[1]))
        return carried(self.gain, part)


@dataclass(frozen=True)
class Influences:
    """All of them, and the covariance (unknowns, unknowns) of the free unknowns that their shares add up to.

    Attributes
    ----------
    each : the observations' own.
    covariance : of the free unknowns.
    neighbours : source -> (unknowns, unknowns), by how much it differs from that of independent observations to first
        order: because biases of neighbours wander together, and because equations are bent; part of `covariance`.
    """

    each: list[Influence]
    covariance: Square
    neighbours: dict[str, Square] = field(default_factory=dict[str, Square])

    @property
    def independent(self) -> Square:
        """Covariance (unknowns, unknowns) as it would be were each observation's wander its own."""
        return self.covariance - self.shared

    @property
    def shared(self) -> Square:
        """By how much the covariance is that of wanders in common and not of independent ones."""
        return sum(self.neighbours.values(), np.zeros(self.covariance.shape))

    def with_course(self, source: str, name: str, departure: Callable[[Series], AnyArray]) -> Influences:
        """Return those of an estimate whose biases take another course than it knows of: what it does is uncertain.

        Parameters
        ----------
        source : whose terms show it.
        name : of its share.
        departure : (times,) s to (times, axes) raw, by what the biases differ from what is stated.
        """
        moved = np.zeros(len(self.covariance))
        for influence in self.each:
            if source in influence.drifts:
                drift = influence.drifts[source]
                away = departure(0.5 * (drift.start + drift.stop))
                moved += np.einsum("tum,tma,ta->u", influence.gain, drift.by_bias, away)
        more = np.outer(moved, moved)
        before = self.neighbours.get(name, 0.0)
        return replace(
            self, covariance=self.covariance + more, neighbours={**self.neighbours, name: before + more}
        )

    def shares(self, order: Sequence[str]) -> dict[str, Square]:
        """Return source -> (unknowns, unknowns) share of the covariance, of the sources that there are.

        Parameters
        ----------
        order : all sources, as a budget shows them.
        """
        there = {source for influence in self.each for source in influence.parts} | set(self.neighbours)
        made: dict[str, Square] = {}
        for source in order:
            if source in there:
                total = np.zeros(self.covariance.shape)
                for influence in self.each:
                    if source in influence.parts:
                        total = total + influence.share(source)
                made[source] = total + self.neighbours.get(source, 0.0)
        return made


def influences_of(
    settled: Settled,
    prior: Prior | None,
    wanders: Mapping[str, tuple[Vector, float]],
    span: tuple[float, float],
    between: Mapping[str, Vector] | None = None,
    once: dict[bytes, AnyArray] | None = None,
) -> Influences:
    """Return what each observation does to the free unknowns.

    Parameters
    ----------
    settled : with its equations where everything is; see `solve.settled_at`.
    prior : what was believed of all unknowns beforehand.
    wanders : source -> (3,) raw², by which a triad's biases wander per unit of ``ln f``, and which share of what the
        adjustment takes for independent draws does so.
    span : s, of the recording.
    between : source -> (3,) raw², the density that the holds show against one another: all that a source causes is
        taken for a wander of this density, too, and the covariance is the wider of the two in every direction.
    once : see `shared_wander`; of one recording.
    """
    made: list[Influence] = []
    before: dict[tuple[int, str], int] = {}
    for number, spread in enumerate(settled.spreads()):
        for term in spread.chain.chain.terms:
            key = number, term.equations.kind
            made.append(_of_term(settled, spread, term, before.get(key, 0)))
            before[key] = before.get(key, 0) + len(term.residual)
    if prior is not None:
        values, vectors = np.linalg.eigh(prior.precision)
        rows = vectors[settled.unknowns.free]
        made.append(_of_prior((settled.cofactor @ rows) * np.sqrt(np.maximum(values, 0.0))))
    neighbours: dict[str, Square] = {}
    once = {} if once is None else once
    drifts = {of: [(i.drifts[of], i.gain) for i in made if of in i.drifts] for of in wanders}
    for source, (density, share) in wanders.items():
        if drifts[source] and np.any(density > 0.0):
            neighbours[source] = share * shared_wander(drifts[source], density, span, once)
    neighbours[BENT] = _second_order(settled)
    covariance = settled.cofactor + sum(neighbours.values(), np.zeros(settled.cofactor.shape))
    for source, density in (between or {}).items():
        other = shared_wander(drifts[source], density, span, once) - neighbours.get(source, 0.0)
        more = wider(covariance, other) - covariance
        neighbours[source] = neighbours.get(source, 0.0) + more
        covariance = covariance + more
    return Influences(made, covariance, neighbours)


def _second_order(settled: Settled) -> Square:
    """Return (free, free) what the second order of the nodes adds to the mean square error.

    An estimate to first order is off by the gain of what its residuals' second order is on average (M. J. Box, Bias in
    nonlinear estimation, J. R. Stat. Soc. B 33 (1971) 171-201), and scatters by as much.
    """
    free = settled.unknowns.free.size
    shift, spread_of = np.zeros(free), np.zeros((free, free))
    for spread in settled.spreads():
        for term in spread.chain.chain.terms_of(_is_bent):
            if not len(term.linear.node):
                continue
            made = term.equations.bent(settled.state, spread.nodes[0][term.linear.node])
            if made is None:
                continue
            inverse = np.asarray(np.linalg.inv(term.root), dtype=np.float64)
            gain = spread.gain(term, free) @ inverse
            shift += np.einsum("tam,tm->a", gain, made[0])
            spread_of += carried(gain, made[1])
    return np.outer(shift, shift) + spread_of


def _is_bent(equations: Equations) -> bool:
    return type(equations).bent is not Equations.bent


def _of_term(settled: Settled, spread: Spread, term: Whitened, first: int) -> Influence:
    linear, state, root = term.linear, settled.state, term.root
    active = np.ones(len(root), dtype=bool) if linear.active is None else linear.active
    inverse = np.asarray(np.linalg.inv(root), dtype=np.float64)
    turned = np.swapaxes(inverse, 1, 2)
    parts = {
        source: active[:, None, None] * (inverse @ part @ turned)
        for source, part in term.equations.causes(state, linear).items()
    }
    if not np.all(active):
        parts[OUTLYING] = ~active[:, None, None] * np.eye(root.shape[1])
    drifts = {
        source: Drift(d.start, d.stop, inverse @ d.by_bias, inverse @ d.independent @ turned)
        for source, d in term.equations.drifts(state, linear, first).items()
    }
    taken = spread.taken(term) if term.equations.views(state, linear) else None
    return Influence(
        term.equations.kind,
        _places(term),
        active,
        spread.gain(term, settled.unknowns.free.size),
        parts,
        taken,
        root,
        drifts,
        term.equations,
    )


def _places(term: Whitened) -> np.ndarray:
    """Of each residual; those of one rotation all have its place."""
    place = term.equations.place
    return place if len(place) == len(term.root) else np.full(len(term.root), place[0])


def _of_prior(gain: AnyArray) -> Influence:
    size = gain.shape[1]
    unit = np.eye(size)[None]
    return Influence("prior", np.array([-1]), np.ones(1, dtype=bool), gain[None], {PRIOR: unit}, None, unit)
