"""Several recordings of one unit in one adjustment: what is stable is common, biases are each recording's own.

Each recording keeps its own adjustment: its attitudes, Earth rates and variances. What it tells of
the unknowns that all share is its normal equations with everything of its own eliminated, bias and fixture included.
The others' sum is a prior of each recording's adjustment, so that one step of it is the step of the adjustment of all:
repeated from where all are, it ends where the gradients of all recordings add up to nothing. Variance components and
outliers of a recording are its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.checks.observability import angle_prior
from tumble.calibration.checks.observability import together as both_priors
from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording
from tumble.calibration.equations.imu_unknowns import LAYOUT, terms_prior
from tumble.calibration.equations.pose_equations import mounting_prior
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Prior
from tumble.estimation.balance import Balanced, Outlier
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.estimation.settled import Settled
from tumble.estimation.solve import ROUND_OFF, TOLERANCE, linearise, longest, solve
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.outcome.estimate import JointOutcome

OWN = LAYOUT.indices("force.bias", "gyro.bias", "fixture")
"""Unknowns of a recording alone: biases change when the unit is switched on, the fixture when it is placed."""
ROUNDS = 30
# Eigenvalues of an information matrix of unit diagonal below this are round-off of the others.
NOTHING = 1e-12


@dataclass(slots=True)
class TurnOn:
    """One recording of the unit, from when it was switched on.

    Attributes
    ----------
    name : of the recording, for words.
    outcome : of its own joint adjustment, without the others.
    task : its equations; `task.prior` holds what the others know.
    solution : of the last step.
    scale : variance of unit weight of its residuals, 1 at least: what its observations weigh less.
    balanced : its variances and outliers with these unknowns; None before they were found.
    """

    name: str
    outcome: JointOutcome
    task: JointAdjustment
    solution: Settled
    scale: float = 1.0
    balanced: Balanced | None = None

    @staticmethod
    def of(name: str, outcome: JointOutcome) -> TurnOn:
        """Return a recording that was adjusted by itself; the outcome stays as it is."""
        solution = outcome.balanced.solution
        return TurnOn(name, outcome, outcome.task.copy(), solution, solution.unit_weight)

    @property
    def free(self) -> np.ndarray:
        """Indices of the unknowns that are adjusted."""
        return self.task.unknowns.free

    @property
    def values(self) -> Series:
        """Where all its unknowns are."""
        return self.task.unknowns.values

    @property
    def stable(self) -> np.ndarray:
        """Which of its unknowns the others share."""
        return np.setdiff1d(self.free, OWN)

    @property
    def own(self) -> np.ndarray:
        """Which of its unknowns are its own."""
        return np.intersect1d(self.free, OWN)

    @property
    def given(self) -> Prior | None:
        """What is believed of it without the others, and without any name plate."""
        u = self.task.unknowns
        mounting = None if self.task.data.poses is None else mounting_prior(u)
        levers, angles = terms_prior(u), angle_prior(u, self.outcome.knowledge)
        return both_priors(both_priors(mounting, levers), angles)

    @property
    def outliers(self) -> list[Outlier]:
        """What was left out of it, with its first unknowns and with these."""
        return [*self.outcome.balanced.outliers, *(self.balanced.outliers if self.balanced else [])]


@dataclass(frozen=True, slots=True)
class Told:
    """What a recording tells of the stable unknowns, everything of its own eliminated.

    Attributes
    ----------
    precision : (stable, stable) information; rows of unknowns that the recording does not have are zero.
    right : (stable,) precision times its own estimate.
    """

    precision: Square
    right: Series

    def __add__(self, other: Told) -> Told:
        """Return what two recordings tell together."""
        return Told(self.precision + other.precision, self.right + other.right)

    def __sub__(self, other: Told) -> Told:
        """Return what is told without one of the recordings."""
        return Told(self.precision - other.precision, self.right - other.right)


@dataclass(slots=True)
class SeveralSolution:
    """A settled adjustment of several recordings.

    Attributes
    ----------
    parts : the recordings, each at the common solution.
    stable : indices of the unknowns that are common.
    told : of each recording, at the solution.
    places : of each recording's free unknowns, where they stand in `covariance`.
    covariance : of the stable unknowns, and then of each recording's own.
    square_sum, redundancy : of all residuals, as they weigh.
    """

    parts: list[TurnOn]
    stable: np.ndarray
    told: list[Told]
    places: list[np.ndarray]
    covariance: Square
    square_sum: float
    redundancy: int

    @property
    def values(self) -> Series:
        """Where the stable unknowns are."""
        return stable_values(self.parts, self.stable)

    @property
    def sigma0(self) -> float:
        """Square root of the variance of unit weight; NaN where nothing is checked."""
        if self.redundancy <= 0:
            return float("nan")
        return float(np.sqrt(max(self.square_sum, 0.0) / self.redundancy))

    def own_places(self, index: int) -> np.ndarray:
        """Return where a recording's own unknowns stand in the covariance, in the order of `TurnOn.own`."""
        part = self.parts[index]
        return self.places[index][np.isin(part.free, part.own)]


def solve_several(parts: Sequence[TurnOn]) -> SeveralSolution:
    """Adjust all recordings together, with their variances as they are.

    Parameters
    ----------
    parts : the recordings; moved.

    Raises
    ------
    ObservabilityError
        If unknowns are not determined by all recordings together.
    ConvergenceError
        If it does not settle.
    """
    parts = list(parts)
    stable = np.unique(np.concatenate([part.stable for part in parts]))
    before = np.inf
    for _ in range(ROUNDS):
        told = [tell(part, stable) for part in parts]
        together = _sum(told)
        at = stable_values(parts, stable)
        covariance = invert_normal_matrix(together.precision)
        size = longest(covariance @ (together.right - together.precision @ at), covariance)
        for part, own in zip(parts, told, strict=True):
            size = max(size, _step(part, stable, together - own))
        if size <= TOLERANCE or (size < ROUND_OFF and size >= before):
            return _solution(parts, stable)
        before = size
    raise ConvergenceError(
        f"The adjustment of {len(parts)} recordings together did not settle within {ROUNDS} rounds."
    )


def balance_several(solution: SeveralSolution) -> SeveralSolution:
    """Find variances and outliers anew of recordings whose unknowns are no longer those of their own adjustment.

    Each by itself, so that a recording that contradicts the others is not made to agree by larger variances; with what
    the others know only where it does not tell the unit alone. Where it does not settle, as with another unit's prior,
    the variances stay those of its own adjustment.

    Parameters
    ----------
    solution : settled; its parts are moved.

    Raises
    ------
    ObservabilityError, ConvergenceError
        From the adjustment of all.
    """
    moved = False
    for part, own in zip(solution.parts, solution.told, strict=True):
        alone, as_settled = part.outcome.untold is None, part.task.copy()
        part.balanced = replace(part.outcome.balanced, outliers=[])
        if alone and np.array_equal(part.free, part.outcome.task.unknowns.free):
            continue
        part.task.prior = part.given if alone else _prior(part, solution.stable, _sum(solution.told) - own)
        try:
            part.balanced = balance_recording(part.task)
        except (ObservabilityError, ConvergenceError):
            part.task = as_settled
            continue
        part.scale = part.balanced.solution.unit_weight
        moved = True
    return solve_several(solution.parts) if moved else _solution(solution.parts, solution.stable)


def tell(part: TurnOn, stable: np.ndarray) -> Told:
    """Return what a recording tells of the stable unknowns at its state.

    Parameters
    ----------
    part : the recording.
    stable : indices of the unknowns that all share.

    Raises
    ------
    ObservabilityError
        If its own unknowns are not determined even with the others known.
    """
    normal, gradient = own_equations(part)
    at, own = np.isin(part.free, part.stable), np.isin(part.free, part.own)
    across = normal[np.ix_(at, own)] @ invert_normal_matrix(normal[np.ix_(own, own)])
    reduced = normal[np.ix_(at, at)] - across @ normal[np.ix_(own, at)]
    place = np.searchsorted(stable, part.stable)
    precision, right = np.zeros((stable.size, stable.size)), np.zeros(stable.size)
    precision[np.ix_(place, place)] = 0.5 * (reduced + reduced.T)
    right[place] = reduced @ part.values[part.stable] - (gradient[at] - across @ gradient[own])
    return Told(precision, right)


def stable_values(parts: Sequence[TurnOn], stable: np.ndarray) -> Series:
    """Return where the stable unknowns are; each as the first recording that has it.

    Parameters
    ----------
    parts, stable : the recordings, and the indices.
    """
    values = np.zeros(stable.size)
    for part in reversed(parts):
        values[np.searchsorted(stable, part.stable)] = part.values[part.stable]
    return values


def with_free(part: TurnOn, free: np.ndarray) -> TurnOn:
    """Return a copy of a recording's adjustment with other free unknowns, the others zero.

    Parameters
    ----------
    part : stays as it is.
    free : indices of the unknowns to adjust.
    """
    made = replace(part, task=part.task.copy(free))
    made.task.prior = made.given
    return made


def own_equations(part: TurnOn) -> tuple[Square, Series]:
    """Return a recording's normal matrix and gradient without what the others know, as it weighs.

    Parameters
    ----------
    part : the recording, at its state.
    """
    _, normal, gradient = linearise(replace(part.task, prior=part.given))
    return normal / part.scale, gradient / part.scale


def others_prior(part: TurnOn, stable: np.ndarray, others: Sequence[Told]) -> Prior:
    """Return what other recordings know as a prior of a recording's unknowns, with what is believed of it anyway.

    Parameters
    ----------
    part : the recording.
    stable : indices of the unknowns that all share.
    others : what the others tell.
    """
    return _prior(part, stable, _sum(others))


def _step(part: TurnOn, stable: np.ndarray, others: Told) -> float:
    """Take the recording's part of the step of all; return how long its own unknowns' step was."""
    part.task.prior = _prior(part, stable, others)
    before = part.values[part.own].copy()
    part.solution = solve(part.task, once=True)
    own = np.isin(part.free, part.own)
    return longest(part.values[part.own] - before, part.solution.cofactor[np.ix_(own, own)])


def _prior(part: TurnOn, stable: np.ndarray, others: Told) -> Prior:
    size, at = part.values.size, part.stable
    place = np.searchsorted(stable, at)
    told = _marginal(others, place)
    precision, right = np.zeros((size, size)), np.zeros(size)
    given = part.given
    if given is not None:
        precision, right = given.precision.copy(), given.precision @ given.mean
    # The recording's own equations are as they were observed; the others' are weighed against them.
    precision[np.ix_(at, at)] += part.scale * told.precision
    right[at] += part.scale * told.right
    here = part.values
    return Prior(here + _solved(precision, right - precision @ here), precision)


def _marginal(told: Told, place: np.ndarray) -> Told:
    """What is told of the unknowns at `place` whatever the rest is."""
    rest = np.setdiff1d(np.arange(told.right.size), place)
    rest = rest[np.diag(told.precision)[rest] > 0.0]
    if not rest.size:
        return Told(told.precision[np.ix_(place, place)], told.right[place])
    across = told.precision[np.ix_(place, rest)] @ invert_normal_matrix(told.precision[np.ix_(rest, rest)])
    return Told(
        told.precision[np.ix_(place, place)] - across @ told.precision[np.ix_(rest, place)],
        told.right[place] - across @ told.right[rest],
    )


def _solved(precision: Square, right: Series) -> Series:
    """Solve for what is known; zero along what is not."""
    known = np.flatnonzero(np.diag(precision) > 0.0)
    solved = np.zeros(right.size)
    if known.size:
        scale = 1.0 / np.sqrt(np.diag(precision)[known])
        own = precision[np.ix_(known, known)] * np.outer(scale, scale)
        solved[known] = scale * (np.linalg.pinv(own, rcond=NOTHING, hermitian=True) @ (scale * right[known]))
    return solved


def _solution(parts: list[TurnOn], stable: np.ndarray) -> SeveralSolution:
    """The settled adjustment, with the covariance of all unknowns and the sums over all recordings."""
    places: list[np.ndarray] = []
    stop = stable.size
    for part in parts:
        place = np.zeros(part.free.size, dtype=int)
        own = np.isin(part.free, part.own)
        place[~own] = np.searchsorted(stable, part.stable)
        place[own] = stop + np.arange(part.own.size)
        stop += part.own.size
        places.append(place)
    normal = np.zeros((stop, stop))
    square_sum, left = 0.0, -stop
    for part, place in zip(parts, places, strict=True):
        normal[np.ix_(place, place)] += own_equations(part)[0]
        solution, prior, given = part.solution, part.task.prior, part.given
        square_sum += solution.square_sum / part.scale
        left += solution.redundancy + part.free.size
        left += (0 if given is None else given.rank) - (0 if prior is None else prior.rank)
        if part.balanced is not None:
            part.balanced.solution = solution
            part.balanced.tests = solution.tests()
    told = [tell(part, stable) for part in parts]
    return SeveralSolution(parts, stable, told, places, invert_normal_matrix(normal), square_sum, left)


def _sum(told: Sequence[Told]) -> Told:
    total = told[0]
    for more in told[1:]:
        total = total + more
    return total
