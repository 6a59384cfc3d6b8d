"""A settled estimate: where everything is, how well it is known, and how well the observations check each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from tumble.arrays import Square
from tumble.estimation.chain import Eliminated, Spread
from tumble.estimation.equations import Equations, Look, Tests, tested
from tumble.estimation.unknowns import Unknowns
from tumble.records import dataclass


@dataclass(slots=True)
class Settled:
    """The solution of any adjustment.

    Attributes
    ----------
    state : what the equations were asked at, moved to the solution.
    unknowns : the shared ones, at the solution.
    chain : the equations of everything, at the last linearisation; its outside are the free unknowns.
    cofactor : (free, free), their covariance if the noise given is the true one.
    square_sum, redundancy : of all residuals, and of what is left to check them.
    iterations : how many it took.
    start_sum : of all residuals before the last step, where the equations were linearised.
    last_step : the longest part of that step, in standard uncertainties.
    """

    state: Any
    unknowns: Unknowns
    chain: Eliminated
    cofactor: Square
    square_sum: float
    redundancy: int
    iterations: int
    start_sum: float = 0.0
    last_step: float = 0.0
    _tests: dict[str, Tests] | None = None

    @property
    def sigma0(self) -> float:
        """Square root of the variance of unit weight; NaN where nothing is checked."""
        if self.redundancy <= 0:
            return float("nan")
        return float(np.sqrt(max(self.square_sum, 0.0) / self.redundancy))

    @property
    def unit_weight(self) -> float:
        """Variance of unit weight, 1 at least: what the observations weigh less than they say."""
        return max(1.0, self.square_sum / self.redundancy) if self.redundancy > 0 else 1.0

    def spreads(self) -> Iterator[Spread]:
        """Yield the covariances of every chain."""
        return Spread(self.chain, self.cofactor).walk()

    def chains(self) -> Iterator[Eliminated]:
        """Yield every chain."""
        waiting = [self.chain]
        while waiting:
            chain = waiting.pop(0)
            yield chain
            waiting += [inner for _, inner in chain.within]

    def tests(self, names: Collection[str] | None = None) -> dict[str, Tests]:
        """Return the tests of residuals by name.

        Parameters
        ----------
        names : of the tests that are wanted at least; None for all.
        """
        if self._tests is None and names is not None:
            return self._tested(names)
        if self._tests is None:
            self._tests = self._tested(None)
        return self._tests

    def _tested(self, wanted: Collection[str] | None) -> dict[str, Tests]:
        names: list[str] = []
        looks: list[Look] = []
        for spread in self.spreads():
            for term in spread.chain.chain.terms_of(_is_tested):
                active = term.linear.active
                if active is not None and not np.any(active):
                    continue
                views = term.equations.views(self.state, term.linear)
                views = [view for view in views if wanted is None or view.name in wanted]
                if not views:
                    continue
                taken = term.root @ spread.taken(term) @ np.swapaxes(term.root, 1, 2)
                chosen = slice(None) if active is None else active
                place, raw = term.equations.place[chosen], term.raw[chosen]
                covariance, taken = term.linear.covariance[chosen], taken[chosen]
                names += [view.name for view in views]
                looks += [Look.at(place, raw, covariance, taken, view.of(chosen)) for view in views]
        found: dict[str, list[Tests]] = {}
        for name, made in zip(names, tested(looks), strict=True):
            found.setdefault(name, []).append(made)
        return {name: Tests.together(parts) if len(parts) > 1 else parts[0] for name, parts in found.items()}


def _is_tested(equations: Equations) -> bool:
    return type(equations).views is not Equations.views
