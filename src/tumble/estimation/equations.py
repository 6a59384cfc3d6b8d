"""What a kind of observation is to the estimator: residuals with derivatives and noise, and words for an outlier.

An estimator that knows `Equations` alone adds them up, balances their noise, leaves outliers out, splits an
uncertainty by its causes and says how large an error would go unnoticed. What is observed is their own business.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, fields, replace
from itertools import zip_longest
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.records import dataclass

# Factor on the variance of an observation that is left out: it is made all but worthless and not taken away, for a
# chain without a link would have no heading.
LEFT_OUT = 1e10
# Eigenvalues of a redundancy below this are directions that nothing checks.
CHECKED = 0.05


@dataclass
class Linear:
    """Residuals at a state, with their derivatives: all of one kind of one chain, as arrays.

    Attributes
    ----------
    residual : (terms, m) predicted minus observed.
    covariance : (terms, m, m) of the observations.
    by_border : (terms, m, columns) derivatives by the chain's border: its own unknowns, then those outside.
    node : (terms,) the node that each depends on; empty for terms of the border alone.
    by_node, by_next : (terms, m, size) derivatives by that node, and by the one after it; None without.
    active : (terms,) of bool, whether each takes part; None for all.
    counted : how many observations they are, if not as many as active residuals.
    by_bias : (terms, m, axes) derivatives by the bias whose wander the terms show; None if they show none.
    columns : (columns,) which unknowns of the border `by_border` is by; all, if none are given.
    """

    residual: AnyArray
    covariance: AnyArray
    by_border: AnyArray
    node: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    by_node: AnyArray | None = None
    by_next: AnyArray | None = None
    active: np.ndarray | None = None
    counted: int | None = None
    by_bias: AnyArray | None = None
    columns: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    def __post_init__(self) -> None:
        """Take all columns where none are named."""
        if not self.columns.size:
            self.columns = np.arange(self.by_border.shape[2])

    @property
    def weighed(self) -> AnyArray:
        """Covariance with what is left out made all but worthless."""
        if self.active is None:
            return self.covariance
        return np.where(self.active, 1.0, LEFT_OUT)[:, None, None] * self.covariance

    @property
    def observations(self) -> int:
        """How many observations they are."""
        if self.counted is not None:
            return self.counted
        terms = len(self.residual) if self.active is None else int(np.count_nonzero(self.active))
        return terms * self.residual.shape[1]

    @property
    def shape(self) -> tuple[object, ...]:
        """What terms have in common that can stand in the same arrays."""
        derivatives = self.by_node, self.by_next, self.by_bias
        widths = (None if of is None else of.shape[1:] for of in derivatives)
        return self.residual.shape[1], self.node.size > 0, self.columns.tobytes(), *widths

    def part(self, at: slice, first: int) -> Linear:
        """Return some of the terms, of a chain whose nodes begin at `first`; `counted` stays behind."""
        by_node, by_next, active, by_bias = (
            None if values is None else values[at]
            for values in (self.by_node, self.by_next, self.active, self.by_bias)
        )
        node = self.node[at] - first if self.node.size else self.node
        given = self.residual[at], self.covariance[at], self.by_border[at]
        return Linear(*given, node, by_node, by_next, active, by_bias=by_bias, columns=self.columns)

    @staticmethod
    def together(parts: Sequence[Linear]) -> Linear:
        """Return terms of several chains as one, those of each after one another."""
        if len(parts) == 1:
            return parts[0]

        def joined(name: str) -> Any:
            values = [getattr(part, name) for part in parts]
            return None if any(value is None for value in values) else np.concatenate(values)

        every = [np.ones(len(p.residual), dtype=bool) if p.active is None else p.active for p in parts]
        return Linear(
            *(joined(name) for name in ("residual", "covariance", "by_border", "node", "by_node", "by_next")),
            active=None if all(p.active is None for p in parts) else np.concatenate(every),
            counted=None if all(p.counted is None for p in parts) else sum(p.observations for p in parts),
            by_bias=joined("by_bias"),
            columns=parts[0].columns,
        )


@dataclass(frozen=True)
class View:
    """One way to test the residuals of a kind.

    Attributes
    ----------
    name : of the test.
    projection : (p, m) or (terms, p, m), what of the residuals is looked at; None for all of them.
    scale : (p,) squared raw units per SI unit.
    least : eigenvalue of the redundancy below which a direction is not checked.
    pulled : whether a small variance pulls the residuals to nothing, so that what would be seen of a larger one is
        the variance over the redundancy.
    """

    name: str
    projection: AnyArray | None = None
    scale: Series | None = None
    least: float = CHECKED
    pulled: bool = False

    def of(self, terms: np.ndarray | slice) -> View:
        """Return the same of some of the terms."""
        if self.projection is None or self.projection.ndim == 2:
            return self
        return replace(self, projection=self.projection[terms])


@dataclass(frozen=True)
class Drift:
    """How terms show what a bias wanders by.

    Attributes
    ----------
    start, stop : (terms,) s.
    by_bias : (terms, m, axes) derivatives by the bias, raw.
    independent : (terms, m, m) covariance that the adjustment gives the wander, each term for itself.
    """

    start: Series
    stop: Series
    by_bias: AnyArray
    independent: AnyArray


# Linear equations of several chains, and how many of them are of each chain.
Grouped = list[tuple["Linear", list[int]]]


class Equations:
    """Observations of one kind along one chain; a class of its own for each kind.

    Attributes
    ----------
    kind : its name.
    place : (terms,) which hold, turn or rotation each belongs to; -1 for none.
    cause : what its noise is called in a budget, where it has one cause only.
    """

    kind: str = ""
    cause: str = ""
    # Of an outlier, where there may be one: what is left out ("hold", "turn", "spin"), and why.
    words: tuple[str, str] = "", ""
    place: np.ndarray

    @classmethod
    def linearise_all(cls, group: Sequence[Any], state: Any) -> Grouped:
        """Return what `linearise` returns, of all together, with how many terms each has.

        Parameters
        ----------
        group : of this kind, of chains of one shape that lie in the same one.
        state : where everything is.
        """
        made: Grouped = []
        for parts in zip_longest(*(one.linearise(state) for one in group)):
            # What one section sees of the Earth's rotation, say, are four numbers, and another one sees three.
            for shape in dict.fromkeys(part.shape for part in parts if part is not None):
                taken = [part if part is not None and part.shape == shape else None for part in parts]
                counts = [0 if part is None else len(part.residual) for part in taken]
                made.append((Linear.together([part for part in taken if part is not None]), counts))
        return made

    def linearise(self, state: Any) -> Sequence[Linear]:
        """Return residuals with derivatives at a state; several where not all depend on the same nodes.

        Raises
        ------
        TypeError
            If the kind has no equation of its own.
        """
        raise TypeError(f"observations of the kind {self.kind!r} have no equation")

    def views(self, state: Any, linear: Linear) -> Sequence[View]:
        """Return how the residuals are tested; empty if they are not."""
        return ()

    def causes(self, state: Any, linear: Linear) -> dict[str, AnyArray]:
        """Return cause -> (terms, m, m), covariances that add up to the terms' own."""
        return {self.cause: linear.covariance}

    def drifts(self, state: Any, linear: Linear, first: int) -> dict[str, Drift]:
        """Return cause -> how the terms show a bias that wanders; `first` terms came before these."""
        return {}

    def bent(self, state: Any, nodes: AnyArray) -> tuple[AnyArray, AnyArray] | None:
        """Return mean (terms, m) and covariance (terms, m, m) of what the second order of the nodes does to residuals.

        None where it does nothing; `nodes` (terms, size, size) is the covariance of each term's node.
        """
        return None

    def directions(self, state: Any) -> Table | None:
        """Return (m, d) raw errors per SI unit, of each direction that is looked at for one; None for no look."""
        return None


@dataclass(frozen=True)
class Tests:
    """Tests of every observation of one kind against what noise and redundancy make of it.

    Attributes
    ----------
    place : (terms,) which hold, turn or rotation.
    statistic : (terms,) chi-square with `degrees` if the noise given is the true one.
    degrees : (terms,) how many of its directions something else checks.
    square : (terms,) sum of squared whitened residuals.
    redundancy : (terms,) what is left of its observations to check it, the trace of a matrix.
    redundancy_square : (terms,) the trace of that matrix's square.
    variance : (terms,) SI², typical of one component.
    residual : (terms, p) raw or rad.
    predicted : (terms,) SI², squared residual against what the others predict without it, in what they check.
    surprise : (terms,) -2 ln of the density that the others' prediction gives it, in what they check, up to a constant:
        a prediction that knows how uncertain it is surprises less than one that does not.
    """

    place: np.ndarray
    statistic: Series
    degrees: np.ndarray
    square: Series
    redundancy: Series
    redundancy_square: Series
    variance: Series
    residual: AnyArray
    predicted: Series
    surprise: Series

    def where(self, taken: np.ndarray | slice) -> Tests:
        """Return the tests of some of them, (terms,) of bool or a range."""
        return Tests(*(getattr(self, f.name)[taken] for f in fields(self)))

    @staticmethod
    def together(parts: Sequence[Tests]) -> Tests:
        """Return tests of one kind of several chains as one."""
        return Tests(*(np.concatenate([getattr(t, f.name) for t in parts]) for f in fields(Tests)))


@dataclass(frozen=True)
class Look:
    """Adjusted residuals as one view has them.

    Attributes
    ----------
    place : (terms,).
    residual, covariance : (terms, p), (terms, p, p) of the observations.
    taken : (terms, p, p) covariance of the adjusted observations.
    scale, least, pulled : as the view has them.
    """

    place: np.ndarray
    residual: AnyArray
    covariance: AnyArray
    taken: AnyArray
    scale: Series
    least: float
    pulled: bool

    @staticmethod
    def at(place: np.ndarray, residual: AnyArray, covariance: AnyArray, taken: AnyArray, view: View) -> Look:
        """Return residuals (terms, m) with their covariances (terms, m, m) as a view has them."""
        if view.projection is not None:
            P = view.projection
            residual = np.einsum("...ij,...j->...i", P, residual)
            covariance, taken = (P @ C @ np.swapaxes(P, -1, -2) for C in (covariance, taken))
        scale = np.ones(residual.shape[1]) if view.scale is None else view.scale
        return Look(place, residual, covariance, taken, scale, max(view.least, 1e-12), view.pulled)


def tested(looks: Sequence[Look]) -> list[Tests]:
    """Return the tests of adjusted residuals, those of one width at once.

    Parameters
    ----------
    looks : at terms of one kind each.
    """
    alike: dict[int, list[int]] = {}
    for at, look in enumerate(looks):
        alike.setdefault(look.residual.shape[1], []).append(at)
    made: dict[int, Tests] = {}
    for members in alike.values():
        together = _tested([looks[at] for at in members])
        stop = 0
        for at in members:
            start, stop = stop, stop + len(looks[at].residual)
            made[at] = together.where(slice(start, stop))
    return [made[at] for at in range(len(looks))]


def _tested(looks: Sequence[Look]) -> Tests:
    counts = [len(look.residual) for look in looks]
    residual, covariance, taken = (
        np.concatenate([getattr(look, name) for look in looks])
        for name in ("residual", "covariance", "taken")
    )
    width = residual.shape[1]
    scale = np.repeat([look.scale for look in looks], counts, axis=0)
    least = np.repeat([look.least for look in looks], counts)
    pulled = np.repeat([look.pulled for look in looks], counts)
    root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    inverse = np.asarray(np.linalg.inv(root), dtype=np.float64)
    white = np.einsum("tij,tj->ti", inverse, residual)
    left = np.eye(width) - inverse @ taken @ np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh(0.5 * (left + np.swapaxes(left, 1, 2)))
    checked = values > least[:, None]
    along = np.einsum("tji,tj->ti", vectors, white)
    seen = np.where(checked, values, 1.0)
    alone = np.where(checked, along / seen, 0.0)
    statistic = (alone * along).sum(axis=1)
    unseen = np.einsum("tij,tjk,tk->ti", root, vectors, alone)
    redundancy = np.trace(left, axis1=1, axis2=2)
    variance: Series = width / np.sum(scale / np.diagonal(covariance, axis1=1, axis2=2), axis=1)
    return Tests(
        np.concatenate([look.place for look in looks]),
        statistic,
        checked.sum(axis=1),
        np.sum(white**2, axis=1),
        redundancy,
        np.sum(left**2, axis=(1, 2)),
        variance * np.where(pulled, width / np.maximum(redundancy, 1e-12), 1.0),
        residual,
        np.sum(unseen**2 / scale, axis=1),
        statistic
        + np.sum(2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        - np.sum(np.log(seen), axis=1),
    )
