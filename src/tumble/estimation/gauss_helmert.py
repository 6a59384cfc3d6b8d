"""Least-squares adjustment of condition equations (the Gauss-Helmert model).

``f(Y_observed + e, parameters) = 0`` with ``e ~ (0, Q)`` is linearised anew in every iteration at the
adjusted observations *and* the parameters (Pope 1972; Hayal 2010, 3.39 to 3.53):

    A xi + B e + w = 0,   w = f(Y, Xi) + B (Y_observed - Y)                         (3.43, 3.44)
    C = B Q B',   N = A' C^-1 A,   xi = -N^-1 A' C^-1 w                             (3.32 - 3.34)
    e = -Q B' C^-1 (w + A xi)                                                       (3.38)

Hayal's 3.28 (w = f(Y_observed, Xi)) holds in the first iteration only. The observations' residuals
stay with the `Conditions`, which know what an observation is; the solver sees C.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.counting import stepped
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.records import dataclass


@dataclass(frozen=True)
class Linearisation:
    """Conditions in linear form, in groups that have no noise in common.

    Attributes
    ----------
    misclosure : (groups, size), w.
    design : (groups, size, parameters), A.
    covariance : (groups, size, size), the blocks of C.
    active : (groups, size) of bool: conditions that take part. Of inactive ones the solver wants
        zero rows in `misclosure` and `design` and a unit row in `covariance`.
    """

    misclosure: AnyArray
    design: AnyArray
    covariance: AnyArray
    active: np.ndarray

    @staticmethod
    def masked(w: AnyArray, A: AnyArray, C: AnyArray, active: np.ndarray) -> Linearisation:
        """Return conditions of which those that take no part say nothing.

        Parameters
        ----------
        w, A, C, active : misclosure, design, covariance and so on of all conditions.
        """
        V = np.where(active[:, :, None] & active[:, None, :], C, np.eye(active.shape[1]))
        return Linearisation(np.where(active, w, 0.0), np.where(active[:, :, None], A, 0.0), V, active)


@runtime_checkable
class Conditions(Protocol):
    """What an adjustment adjusts."""

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` and at the observations as adjusted so far."""
        ...

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Take ``C^-1 (w + A xi)``, (groups, size), and set the observations to Y_observed + e.

        By default nothing is set: means are known so well that a second order in their noise is nothing.
        """


@dataclass(frozen=True)
class Prior:
    """Knowledge of parameters before the adjustment: a mean and a precision (zero: nothing known)."""

    mean: Series
    precision: Square

    @property
    def rank(self) -> int:
        """How many independent things are known: what the prior adds to the redundancy."""
        size = np.sqrt(np.maximum(np.diag(self.precision), 0.0))
        # To a unit diagonal first: bias in counts and angles in rad differ by many powers of ten.
        known = np.flatnonzero(size)
        scaled = self.precision[np.ix_(known, known)] / np.outer(size[known], size[known])
        return int(np.linalg.matrix_rank(scaled, hermitian=True)) if known.size else 0


@dataclass(frozen=True)
class Adjustment:
    """The result of an adjustment.

    Attributes
    ----------
    parameters : (parameters,).
    cofactor : (parameters, parameters), N^-1: the covariance if the noise given is the true one.
    square_sum : e' P e, with the prior's own term.
    redundancy : conditions plus prior knowledge minus parameters.
    iterations : how many it took.
    linearisation : of the last iteration, for tests and diagnostics.
    residual : (groups, size), w + A xi: the conditions' remaining misclosure.
    """

    parameters: Series
    cofactor: Square
    square_sum: float
    redundancy: int
    iterations: int
    linearisation: Linearisation
    residual: AnyArray

    @property
    def sigma0(self) -> float:
        """Square root of the variance of unit weight (3.37); 1 if the noise given is true.

        Zero over zero when there are as many unknowns as conditions (nine attitudes for nine
        parameters): then it is not a number.
        """
        return float(np.sqrt(self.square_sum / self.redundancy)) if self.redundancy > 0 else float("nan")


def adjust(
    conditions: Conditions,
    start: Series,
    *,
    prior: Prior | None = None,
    iterations: int = 100,
    tolerance: float = 1e-6,
    once: bool = False,
) -> Adjustment:
    """Adjust `conditions` from the start values until nothing moves.

    Parameters
    ----------
    start : (parameters,) start values.
    prior : what is known of the parameters beforehand.
    iterations : after how many to give up.
    tolerance : converged when no parameter moves by more than this share of its sigma.
    once : take one step and no more, settled or not: for start values that are all but settled.

    Raises
    ------
    ObservabilityError
        If the conditions do not determine all parameters.
    ConvergenceError
        If it diverges or does not settle.
    """
    parameters = start.astype(float)
    step_before = np.inf
    for iteration in range(1, iterations + 1):
        stepped()
        linear = conditions.linearise(parameters)
        if not (np.all(np.isfinite(linear.misclosure)) and np.all(np.isfinite(linear.covariance))):
            raise ConvergenceError("The adjustment diverged: its unknowns left all bounds.")
        try:
            root = np.linalg.inv(np.linalg.cholesky(linear.covariance))
        except np.linalg.LinAlgError:
            raise ConvergenceError(
                "The covariance of the observations is not positive definite: "
                "a hold has no noise at all, or too few samples."
            ) from None
        white = (root @ linear.design).reshape(-1, parameters.size)
        normal, right = white.T @ white, -white.T @ np.einsum("gij,gj->gi", root, linear.misclosure).ravel()
        if prior is not None:
            normal = normal + prior.precision
            right = right - prior.precision @ (parameters - prior.mean)
        cofactor = invert_normal_matrix(normal)
        step = cofactor @ right
        if not np.all(np.isfinite(step)):
            raise ConvergenceError("The adjustment diverged: its unknowns left all bounds.")
        residual = linear.misclosure + linear.design @ step
        multipliers = np.einsum("gji,gjk,gk->gi", root, root, residual, optimize=True)
        conditions.adjust_observations(multipliers)
        parameters = parameters + step
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(cofactor))))
        # With noise-free data sigma is round-off: a step that no longer shrinks there is the end.
        settled = np.all(np.abs(step) <= 1e-13 * np.maximum(np.abs(parameters), 1.0))
        if once or size <= tolerance or settled or (size < 1e-3 and size >= step_before):
            square_sum = float(np.sum(multipliers * residual))
            known = 0
            if prior is not None:
                off = parameters - prior.mean
                square_sum += float(off @ prior.precision @ off)
                known = prior.rank
            redundancy = int(np.count_nonzero(linear.active)) + known - parameters.size
            return Adjustment(parameters, cofactor, square_sum, redundancy, iteration, linear, residual)
        step_before = size
    raise ConvergenceError(f"The adjustment did not settle within {iterations} iterations.")


def invert_normal_matrix(normal: Square) -> Square:
    """Return the inverse of a normal matrix, scaled to a unit diagonal first.

    Raises
    ------
    ObservabilityError
        If it is singular: some parameters are not determined.
    """
    diagonal = np.diag(normal)
    if np.any(diagonal <= 0) or not np.all(np.isfinite(normal)):
        raise ObservabilityError("Some parameters are not determined by the observations at all.")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = normal * np.outer(scale, scale)
    singular = "Some combination of the parameters is not determined by the observations."
    try:
        factor = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        raise ObservabilityError(singular) from None
    # The square of a pivot is what is left of a parameter's information after the others; below
    # 1e-12 it is the round-off of the others.
    if float(np.min(np.diag(factor))) <= 1e-6:
        raise ObservabilityError(singular)
    root = np.linalg.inv(factor)
    return (root.T @ root) * np.outer(scale, scale)
