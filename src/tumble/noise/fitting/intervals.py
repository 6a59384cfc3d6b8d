"""Limits of each coefficient that own that the choice of terms was made by the same data.

A coefficient is between its limits if, held at that value and all others free, the variances are no more
improbable than the confidence allows. Free are *all* terms that were tried, whether they were kept or not:
a flicker that the curve does not show may still be there and have its part in N. And every value is judged
by the spread that it would have itself, not by that of the best one: a large random walk scatters widely,
and a recording that happened to show little of it does not exclude it.

References
----------
Cox and Hinkley, Theoretical Statistics, section 7.2: limits by turning a test round. Leeb and Pötscher,
Econometric Theory 21 (2005) 21-59: intervals of the model that was chosen, as if nobody had chosen, do not
cover.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.estimation import crossing
from tumble.noise.fitting.weighted_fit import AllanTask, Solution
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.noise.variances import LETTERS, allan_variance_of, markov_allan_variance
from tumble.records import dataclass

_TINY = 1e-300


@dataclass(frozen=True)
class _Profile:
    """Misfit over one coefficient's square, everything else adapting itself."""

    task: AllanTask
    solution: Solution
    letter: str | None
    process: int | None
    letters: tuple[str, ...]  # of the others
    column: Series
    others: Table

    def model(self, square: float, rest: Series) -> NoiseModel:
        """The noise with the coefficient and what the others then are."""
        values = np.sqrt(np.maximum(rest, 0.0))
        coefficients = dict(zip(self.letters, map(float, values), strict=False))
        sigmas = [float(value) for value in values[len(self.letters) :]]
        own = float(np.sqrt(square))
        if self.letter is not None:
            coefficients[self.letter] = own
        times = self.solution.times
        if self.process is not None:
            sigmas.insert(self.process, own)
        processes = tuple(GaussMarkov(s, t) for s, t in zip(sigmas, times, strict=False))
        return NoiseModel.from_coefficients(coefficients, processes)

    def excess(self, square: float) -> tuple[float, float]:
        """How much worse the coefficient fits than the best one, and that one's square, by its own spread."""
        target = self.task.variance - self.task.lines
        count = len(self.letters) + len(self.solution.times) - (self.process is not None)
        rest = self._start()
        root, fixed = np.eye(len(target)), 0.0
        for _ in range(2):
            # what every variance is at least is what the coefficient alone makes of it
            model = self.model(square, rest[:count])
            root = self.task.root(model, target, "moments")
            rest, fixed = _least(root, self.others, target - square * self.column)
        with_it, free = _least(root, np.column_stack([self.others, self.column]), target)
        return fixed - free, float(with_it[-1])

    def _start(self) -> Series:
        known = self.solution.model.coefficients
        squares = [known[letter] ** 2 for letter in self.letters]
        squares += [g.sigma**2 for k, g in enumerate(self.solution.model.gauss_markov) if k != self.process]
        return np.array(squares)


def letter_interval(task: AllanTask, solution: Solution, letter: str, sigmas: float) -> tuple[float, float]:
    """Return the limits of a term of IEEE Std 952, in the task's unit; the lower is 0 where none is needed.

    Parameters
    ----------
    task, solution : the curve, and the fit with the terms that were kept.
    letter : whose.
    sigmas : of a normal number, how far off either limit may be.
    """
    others = tuple(x for x in LETTERS if x != letter and (x != "R" or x in solution.letters))
    columns = [allan_variance_of(x, task.tau, task.rate) for x in others]
    columns += [markov_allan_variance(task.tau, time, task.rate) for time in solution.times]
    columns += _both_ways(task.slopes_of_times(solution))
    own = allan_variance_of(letter, task.tau, task.rate)
    design = np.column_stack(columns) if columns else np.zeros((len(own), 0))
    profile = _Profile(task, solution, letter, None, others, own, design)
    at = solution.letters.index(letter) if letter in solution.letters else None
    return _limits(profile, float(solution.squares[at]) if at is not None else 0.0, sigmas)


def process_interval(task: AllanTask, solution: Solution, process: int, sigmas: float) -> tuple[float, float]:
    """Return the limits of a Gauss-Markov process' σ, as `letter_interval` does.

    Parameters
    ----------
    task, solution, sigmas : as for `letter_interval`.
    process : which.
    """
    others = tuple(x for x in LETTERS if x != "R" or x in solution.letters)
    columns = [allan_variance_of(x, task.tau, task.rate) for x in others]
    times = solution.times
    columns += [
        markov_allan_variance(task.tau, time, task.rate) for k, time in enumerate(times) if k != process
    ]
    columns += _both_ways(task.slopes_of_times(solution))
    own = markov_allan_variance(task.tau, times[process], task.rate)
    profile = _Profile(task, solution, None, process, others, own, np.column_stack(columns))
    return _limits(profile, float(solution.squares[len(solution.letters) + process]), sigmas)


def _both_ways(columns: list[Series]) -> list[Series]:
    """Columns whose coefficients may be negative, as pairs."""
    return [sign * column for column in columns for sign in (1.0, -1.0)]


def _limits(profile: _Profile, square: float, sigmas: float) -> tuple[float, float]:
    """Root of the lowest and highest square that the data allow."""

    def beyond(log_square: float, above: bool) -> float:
        excess, best = profile.excess(float(np.exp(log_square)))
        # on the near side of the best value nothing speaks against it
        near = best > np.exp(log_square) if above else best < np.exp(log_square)
        return -1.0 if near else excess - sigmas**2

    # a coefficient that alone makes the curve, wherever the curve allows it most
    alone = float(np.log(max(float(np.min(profile.task.variance / profile.column)), _TINY)))
    start = float(np.log(square)) if square > 0.0 else alone - 12.0
    high = _crossing(lambda x: beyond(x, True), start, 0.25, alone + 40.0)
    low = 0.0
    if square > 0.0:
        least = min(start, alone) - 14.0  # a thousandth of the coefficient is none
        found = _crossing(lambda x: beyond(x, False), start, -0.25, least)
        low = 0.0 if found is None else float(np.exp(0.5 * found))
    return low, float(np.exp(0.5 * high)) if high is not None else float("inf")


def _crossing(function: Callable[[float], float], start: float, step: float, end: float) -> float | None:
    """Where a function first becomes positive on the way from start to end, in growing steps; None if nowhere."""
    if (at_near := function(start)) > 0.0:
        return start
    near = start
    while (end - near) * step > 0.0:
        far = near + step
        if (at_far := function(far)) > 0.0:
            return crossing(function, near, far, (at_near, at_far), 2e-3)
        near, at_near, step = far, at_far, 1.4 * step
    return None


def _least(root: Square, design: Table, observed: Series) -> tuple[Series, float]:
    """Best coefficients that are not negative, and their misfit."""
    from scipy.optimize import nnls

    if not design.shape[1]:
        return np.zeros(0), float(np.sum((root @ observed) ** 2))
    weighed = root @ design
    size = np.maximum(np.max(np.abs(weighed), axis=0), _TINY)
    found, left = nnls(weighed / size, root @ observed)
    return found / size, float(left) ** 2
