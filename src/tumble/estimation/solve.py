"""Gauss-Newton on chains with shared unknowns, and what it settles at.

A settled estimate is where everything is, how well it is known, and how well the observations check each other.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import Series, Square
from tumble.counting import stepped
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation.chain import Chain, Eliminated, Spread, Stretch
from tumble.estimation.equations import Equations, Look, Tests, tested
from tumble.estimation.gauss_helmert import Prior, invert_normal_matrix
from tumble.estimation.unknowns import Unknowns
from tumble.records import dataclass


@dataclass
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


# Simulated tests take two to twelve steps; one whose steps are taken back goes on by shares of them.
ITERATIONS = 100
DIVERGED = "The adjustment diverged: its unknowns left all bounds."
# A thousandth of a sigma: the step itself is still taken, and the next would be a millionth.
TOLERANCE, ROUND_OFF = 1e-3, 1e-2
# A square sum may grow by so much and not be worse; a smaller share of a step is no step.
SLACK, LEAST_SHARE = 0.1, 1e-3
# A step that undoes so much of the last one belongs to equations that are bent: a share of it leads there.
GOES_BACK = -0.3


@runtime_checkable
class Adjustable(Protocol):
    """What can be adjusted: observations, what is believed beforehand, and where everything is.

    Attributes
    ----------
    unknowns : shared by all chains; replaced when they move.
    prior : of all of them, or None.
    state : what the equations are asked at.
    """

    unknowns: Unknowns
    prior: Prior | None

    @property
    def state(self) -> Any:
        """What the equations are asked at."""
        ...

    def stretch(self) -> Stretch:
        """Return everything that was observed."""
        ...

    def stepped(self, chain: Eliminated, cofactor: Square) -> bool:
        """Note what a step has changed of what is believed; return whether anything has."""
        ...

    def snapshot(self) -> Callable[[], None]:
        """Return a function that puts everything back where it is now."""
        ...


def linearise(task: Adjustable) -> tuple[Eliminated, Square, Series]:
    """Return the equations of everything, and the normal matrix and gradient of the free unknowns.

    Parameters
    ----------
    task : what is adjusted, at its state.

    Raises
    ------
    ObservabilityError
        If a node is not determined.
    """
    stepped()
    unknowns = task.unknowns
    chain = Chain.of(task.stretch(), task.state, unknowns.free.size).eliminated()
    normal, gradient = chain.matrix, chain.right
    if task.prior is not None:
        at = np.ix_(unknowns.free, unknowns.free)
        normal = normal + task.prior.precision[at]
        gradient = gradient + (task.prior.precision @ (unknowns.values - task.prior.mean))[unknowns.free]
    return chain, normal, gradient


def solve(task: Adjustable, *, once: bool = False, tolerance: float = TOLERANCE) -> Settled:
    """Adjust everything from where it is until nothing moves.

    Parameters
    ----------
    task : moved to the solution.
    once : take one step and no more.
    tolerance : sigmas; after a step that is no longer, everything is where it belongs.

    Raises
    ------
    ObservabilityError
        If unknowns are not determined.
    ConvergenceError
        If it diverges or does not settle.

    Notes
    -----
    Gauss-Newton. A step after which the square sum is larger, or nothing is determined any more, is taken back, and a
    quarter of it is tried; the share grows again with each step that is good. Where no share is good nothing settles.
    """
    before, share, last = np.inf, 1.0, _Step()
    for iteration in range(1, ITERATIONS + 1):
        made = _equations(task, final=last.back is None or share <= LEAST_SHARE)
        if last.back is not None and (made is None or last.is_bad(made.cost)):
            if share <= LEAST_SHARE:
                break
            last.back()
            # What the equations are there is known.
            share, made, last = 0.25 * share, last.made, _Step()
        assert made is not None
        step = -made.cofactor @ made.gradient
        if not np.all(np.isfinite(step)):
            raise ConvergenceError(DIVERGED)
        sigmas = step / np.sqrt(np.diag(made.cofactor))
        size = float(np.max(np.abs(sigmas), initial=0.0))
        share = last.share_after(sigmas, share)
        taken = 1.0 if once or size <= ROUND_OFF else share
        back = None if once else task.snapshot()
        values, free = task.unknowns.values.copy(), task.unknowns.free
        done = once or size <= tolerance or bool(size < ROUND_OFF and size >= before)
        done = done or bool(np.all(np.abs(step) <= 1e-13 * np.maximum(np.abs(values[free]), 1.0)))
        made.chain.move(step, taken, residuals=done)
        values[free] += taken * step
        task.unknowns = task.unknowns.at(values)
        changed = task.stepped(made.chain, made.cofactor)
        if done:
            return _settled(task, made, iteration, size)
        # What is believed may have changed with the step: then the square sum says nothing of it.
        last = _Step(made, np.inf if changed else made.cost, back, sigmas, taken)
        before, share = size, min(1.0, 2.0 * share)
    raise ConvergenceError("The adjustment did not settle.")


@dataclass(frozen=True)
class _Made:
    """The equations at a state: chain, covariance and gradient of the free unknowns, and the square sum."""

    chain: Eliminated
    cofactor: Square
    gradient: Series
    cost: float


def _equations(task: Adjustable, *, final: bool) -> _Made | None:
    """Return the equations where everything is; None where they determine nothing, if that is not `final`."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            chain, normal, gradient = linearise(task)
        return _Made(chain, invert_normal_matrix(normal), gradient, _cost(task, chain))
    except np.linalg.LinAlgError as error:
        if final:
            raise ConvergenceError(DIVERGED) from error
    except ObservabilityError:
        if final:
            raise
    return None


@dataclass(frozen=True)
class _Step:
    """A step: from where, the square sum there, the way back, its parts in sigmas as a whole, and the share taken."""

    made: _Made | None = None
    cost: float = np.inf
    back: Callable[[], None] | None = None
    sigmas: Series | None = None
    taken: float = 1.0

    def share_after(self, sigmas: Series, share: float) -> float:
        """What share to take of the next one: less where it goes back, for then the last one was too long by that."""
        if self.sigmas is None:
            return share
        ahead = float(sigmas @ self.sigmas) / max(float(self.sigmas @ self.sigmas), 1e-300)
        return min(share, self.taken / (1.0 - ahead)) if ahead < GOES_BACK else share

    def is_bad(self, cost: float) -> bool:
        """Whether the square sum has grown by more than nothing."""
        return not cost <= self.cost + SLACK * (1.0 + abs(self.cost) * 1e-5)


def _cost(task: Adjustable, chain: Eliminated) -> float:
    """The square sum of all residuals and of what was believed beforehand."""
    cost = chain.chain.square_sum
    if task.prior is not None:
        off = task.unknowns.values - task.prior.mean
        cost += float(off @ task.prior.precision @ off)
    return cost


def settled_at(task: Adjustable) -> Settled:
    """Return the equations linearised where everything is, as if it had settled there; nothing is moved.

    Parameters
    ----------
    task : at its solution.

    Raises
    ------
    ObservabilityError
        If unknowns are not determined.
    """
    chain, normal, _ = linearise(task)
    return Settled(task.state, task.unknowns, chain, invert_normal_matrix(normal), 0.0, 0, 0)


def _settled(task: Adjustable, made: _Made, iterations: int, last_step: float) -> Settled:
    chain, free = made.chain, task.unknowns.free
    # An unknown that is told by what was believed of it beforehand takes nothing off the checks.
    believed = (
        0.0 if task.prior is None else float(np.sum(task.prior.precision[np.ix_(free, free)] * made.cofactor))
    )
    redundancy = chain.chain.checks - free.size + round(believed)
    # Residuals have moved with the step, to where they are smallest.
    square_sum = chain.chain.square_sum
    sums = square_sum, redundancy, iterations, made.cost, last_step
    return Settled(task.state, task.unknowns, chain, made.cofactor, *sums)
