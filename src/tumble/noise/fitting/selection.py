"""Which terms a curve shows: Gauss-Markov processes added while they explain more than chance, terms left out.

References
----------
Self and Liang, Journal of the American Statistical Association 82 (1987) 605-610: half of the tests of a
coefficient at its bound zero find nothing at all, hence the one-sided threshold. Lawson and Hanson, Solving
Least Squares Problems, chapter 23: with many processes of given correlation times at once, coefficients not
negative, the least squares have one minimum, which no start can miss.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square
from tumble.errors import UsageError
from tumble.noise.fitting.weighted_fit import AllanTask, Solution

FALSE_ALARM = 0.01
"""Probability that a term is kept which is not there, for each term that is tried."""

MOST_PROCESSES = 3
"""Gauss-Markov processes that are tried at most."""

# Correlation times that are tried lie this far apart in the natural logarithm: two an octave.
_STEP = 0.5 * float(np.log(2.0))


def with_processes(task: AllanTask, without: Solution, most: int) -> Solution:
    """Return the solution with as many Gauss-Markov processes as explain what it does not.

    One more is kept if the misfit falls by more than the best of all correlation times tried would take off
    it by chance. Starts of the search are the best time beside those that are there, and the clusters in
    which many processes at once, whose fit has one minimum, put their power.

    Parameters
    ----------
    task, without : the curve, and its fit without a process.
    most : processes at most.
    """
    times = _grid(task)
    if len(times) < 2:
        return without
    # each of the independent correlation times, an octave apart, is one more that may fit by chance
    limit = 2.0 * float(np.log(len(times) / 2.0 / FALSE_ALARM))
    kept = without
    while len(kept.times) < most:
        root = kept.root
        if _misfit(task, kept.letters, kept.times, root) - _many(task, kept, times, root)[0] < limit:
            break
        best = kept
        # once with the weights of fewer processes, which may be far off, and once with their own
        for _ in range(2):
            best = task.settle(kept.letters, _refined(task, kept, times, root))
            root = best.root
            if _misfit(task, kept.letters, kept.times, root) - best.misfit < limit:
                return kept
        if np.any(best.squares[len(best.letters) :] <= 0.0):
            break
        kept = best
    return kept


def without_the_unseen(task: AllanTask, full: Solution) -> Solution:
    """Leave terms out, the least wanted first, as long as the misfit does not grow beyond chance.

    The ramp is tried first: a short recording cannot tell it from a random walk, which every sensor has.

    Parameters
    ----------
    task, full : the curve, and its fit with all terms.
    """
    from scipy.special import ndtri

    limit = float(ndtri(1.0 - FALSE_ALARM)) ** 2
    solution = full
    if "R" in solution.letters and len(solution.letters) > 1:
        without, rise = _rise(task, solution, "R")
        solution = without if rise <= limit else solution
    while len(solution.letters) + len(solution.times) > 1 and solution.letters:
        trials = [_rise(task, solution, letter) for letter in solution.letters]
        without, rise = min(trials, key=lambda trial: trial[1])
        if rise > limit:
            break
        solution = without
    return _without_nothing(task, solution)


def in_moments(task: AllanTask, chosen: Solution) -> Solution:
    """Return the fit in the variances themselves of the terms that the logarithms chose.

    Parameters
    ----------
    task, chosen : by moments, and the solution in the logarithm.
    """
    solution = task.settle(chosen.letters, chosen.times)
    if chosen.times:
        times = _polished(task, solution.letters, [chosen.times], solution.root, _grid(task))
        solution = task.settle(chosen.letters, times)
    return _without_nothing(task, solution)


def _without_nothing(task: AllanTask, solution: Solution) -> Solution:
    """Leave out what came out as nothing at all."""
    here = solution.squares > 0.0
    while not np.all(here):
        count = len(solution.letters)
        letters = tuple(x for x, stays in zip(solution.letters, here[:count], strict=True) if stays)
        times = tuple(t for t, stays in zip(solution.times, here[count:], strict=True) if stays)
        if not letters and not times:
            raise UsageError(
                "No term of noise makes such a curve: the recording holds something else, such as motion."
            )
        solution = task.settle(letters, times)
        here = solution.squares > 0.0
    return solution


def _rise(task: AllanTask, solution: Solution, letter: str) -> tuple[Solution, float]:
    """The solution without a term, and what the term would take off its misfit.

    Both misfits are weighed as if the term were not there: its own spread must not hide it.
    """
    fewer = tuple(other for other in solution.letters if other != letter)
    without = task.settle(fewer, solution.times)
    return without, without.misfit - _misfit(task, solution.letters, solution.times, without.root)


def _grid(task: AllanTask) -> Series:
    """Correlation times that are tried, from two samples to half of the longest averaging time."""
    shortest, longest = 2.0 / task.rate, float(task.tau[-1]) / 2.0
    if longest < 4.0 * shortest:
        return np.zeros(0)
    count = int(np.log(longest / shortest) / _STEP) + 1
    return shortest * np.exp(_STEP * np.arange(count))


def _misfit(task: AllanTask, letters: tuple[str, ...], times: tuple[float, ...], root: Square) -> float:
    return task.solve(letters, times, task.design(letters, times), root).misfit


def _many(task: AllanTask, kept: Solution, times: Series, root: Square) -> tuple[float, list[float]]:
    """Misfit with a process at every time, and the times about which they have their power, strongest first."""
    every = tuple(float(time) for time in times)
    solution = task.solve(kept.letters, every, task.design(kept.letters, every), root)
    power = solution.squares[len(kept.letters) :]
    clusters: list[tuple[float, float]] = []
    inside = np.flatnonzero(power > 1e-6 * max(float(power.max()), 1e-300))
    for cluster in np.split(inside, np.flatnonzero(np.diff(inside) > 2) + 1):
        if len(cluster):
            weight = power[cluster]
            middle = np.exp(np.sum(weight * np.log(times[cluster])) / np.sum(weight))
            clusters.append((float(np.sum(weight)), float(middle)))
    return solution.misfit, [time for _, time in sorted(clusters, reverse=True)]


def _refined(task: AllanTask, kept: Solution, times: Series, root: Square) -> tuple[float, ...]:
    """Correlation times of one more process and of those that are there, best for given weights."""
    tried = [_misfit(task, kept.letters, (*kept.times, float(time)), root) for time in times]
    starts: list[tuple[float, ...]] = [(*kept.times, float(times[int(np.argmin(tried))]))]
    clusters = _many(task, kept, times, root)[1]
    if len(starts[0]) > 1 and len(clusters) >= len(starts[0]):
        starts.append(tuple(clusters[: len(starts[0])]))
    return _polished(task, kept.letters, starts, root, times)


def _polished(
    task: AllanTask,
    letters: tuple[str, ...],
    starts: list[tuple[float, ...]],
    root: Square,
    times: Series,
) -> tuple[float, ...]:
    """Correlation times about the starts that fit best for given weights, within the grid's ends."""
    from scipy.optimize import minimize

    low, high = np.log(times[0]), np.log(times[-1])

    def misfit(logs: Series) -> float:
        beyond = float(np.sum(np.maximum(logs - high, 0.0) + np.maximum(low - logs, 0.0)))
        inside = np.clip(logs, low, high)
        return _misfit(task, letters, tuple(np.exp(inside).tolist()), root) + 1e3 * beyond

    found: list[tuple[float, Series]] = []
    for start in starts:
        result = minimize(
            misfit,
            np.log(start),
            method="Nelder-Mead",
            options={"xatol": 1e-3, "fatol": 1e-4, "maxfev": 120 * len(start)},
        )
        found.append((float(result.fun), np.asarray(result.x, dtype=np.float64)))
    logs = min(found, key=lambda end: end[0])[1]
    return tuple(sorted(np.exp(np.clip(logs, low, high)).tolist()))
