"""Gauss-Newton on chains with shared unknowns."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import Series, Square
from tumble.errors import ConvergenceError
from tumble.estimation.chain import Chain, Eliminated, Stretch
from tumble.estimation.gauss_helmert import Prior, invert_normal_matrix
from tumble.estimation.settled import Settled
from tumble.estimation.unknowns import Unknowns

ITERATIONS = 100
DIVERGED = "The joint adjustment diverged: its unknowns left all bounds."
# A thousandth of a sigma: the step itself is still taken, and the next would be a millionth.
TOLERANCE, ROUND_OFF = 1e-3, 1e-2


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

    def stepped(self, chain: Eliminated, cofactor: Square) -> None:
        """Note what a step has changed of what is believed."""
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
    unknowns = task.unknowns
    chain = Chain.of(task.stretch(), task.state, unknowns.free.size).eliminated()
    normal, gradient = chain.matrix, chain.right
    if task.prior is not None:
        at = np.ix_(unknowns.free, unknowns.free)
        normal = normal + task.prior.precision[at]
        gradient = gradient + (task.prior.precision @ (unknowns.values - task.prior.mean))[unknowns.free]
    return chain, normal, gradient


def solve(task: Adjustable, *, once: bool = False) -> Settled:
    """Adjust everything from where it is until nothing moves.

    Parameters
    ----------
    task : moved to the solution.
    once : take one step and no more.

    Raises
    ------
    ObservabilityError
        If unknowns are not determined.
    ConvergenceError
        If it diverges or does not settle.
    """
    before = np.inf
    for iteration in range(1, ITERATIONS + 1):
        try:
            with np.errstate(divide="ignore", invalid="ignore"):
                chain, normal, gradient = linearise(task)
            cofactor = invert_normal_matrix(normal)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(DIVERGED) from error
        step = -cofactor @ gradient
        if not np.all(np.isfinite(step)):
            raise ConvergenceError(DIVERGED)
        chain.move(step)
        task.unknowns = _moved(task.unknowns, step)
        size = longest(step, cofactor)
        task.stepped(chain, cofactor)
        here = np.abs(task.unknowns.values[task.unknowns.free])
        settled = bool(np.all(np.abs(step) <= 1e-13 * np.maximum(here, 1.0)))
        if once or size <= TOLERANCE or settled or (size < ROUND_OFF and size >= before):
            return _settled(task, chain, cofactor, iteration)
        before = size
    raise ConvergenceError(f"The joint adjustment did not settle within {ITERATIONS} iterations.")


def longest(step: Series, covariance: Square) -> float:
    """Return the longest step in standard uncertainties; 0 of none.

    Parameters
    ----------
    step, covariance : (unknowns,), (unknowns, unknowns).
    """
    return float(np.max(np.abs(step) / np.sqrt(np.diag(covariance)), initial=0.0))


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


def _moved(unknowns: Unknowns, step: Series) -> Unknowns:
    values = unknowns.values.copy()
    values[unknowns.free] += step
    return unknowns.at(values)


def _settled(task: Adjustable, chain: Eliminated, cofactor: Square, iterations: int) -> Settled:
    known = 0 if task.prior is None else task.prior.rank
    redundancy = chain.chain.checks - task.unknowns.free.size + known
    # Residuals have moved with the step, to where they are smallest.
    return Settled(task.state, task.unknowns, chain, cofactor, chain.chain.square_sum, redundancy, iterations)
