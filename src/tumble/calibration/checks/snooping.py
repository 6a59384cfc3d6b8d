"""Variance components, gross errors, and Wald's test of a term: what the noise really does, and what is not noise.

The noise seen inside holds is not all: biases wander from hold to hold, knocks and bandwidth leave
their mark on turns. For each kind of condition a variance is added until its residuals are as large
as they should be. Before gross errors are gone the robust median of the residuals sets it, so that
an outlier cannot hide by inflating the noise; afterwards their mean square does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.estimate import TermTest
from tumble.estimation import Adjustment, GroupTest, Reliability
from tumble.estimation.balance import (
    CHANCE,
    FALSE_ALARM,
    LARGEST_SHARE_LEFT_OUT,
    MEDIAN_CHI_SQUARE,
    SETTLED,
    SHARE_AT_A_TIME,
    Outlier,
    limit_of_largest,
)
from tumble.records import dataclass

# A term that chance explains so often, tested by one step from the adjustment without it, is needless: the noise was
# found without it, and is larger by what it would explain.
NEEDLESS = 0.1


def wald_test(name: str, estimates: Series, covariance: Square, freedom: int, limit: float) -> TermTest:
    """Test estimates of a term jointly against zero.

    Parameters
    ----------
    name : of the term.
    estimates, covariance : of its unknowns, from the fit that contains them.
    freedom : degrees of freedom of the noise level.
    limit : the term is kept if chance gives as large a statistic more rarely than this.

    Notes
    -----
    ``estimates' covariance^-1 estimates / n`` is F with n and `freedom` degrees of freedom if the term
    is not there. The covariance is scaled to correlations first: unknowns in counts and in radians
    differ by many powers of ten.
    """
    from scipy.special import fdtrc

    scale = np.sqrt(np.diag(covariance))
    normalised = estimates / scale
    correlation = covariance / np.outer(scale, scale)
    statistic = float(normalised @ np.linalg.solve(correlation, normalised)) / estimates.size
    probability = float(fdtrc(estimates.size, max(freedom, 1), statistic))
    largest = float(normalised[np.argmax(np.abs(normalised))])
    return TermTest(
        name=name,
        kept=probability < limit,
        statistic=statistic,
        degrees=estimates.size,
        probability=probability,
        limit=limit,
        largest=f"{largest:+.1f} sigma",
    )


_PASSES = 12


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of condition: its columns in a group."""

    name: str
    columns: slice


@runtime_checkable
class Solve(Protocol):
    """Adjusts with extra variances by kind (SI²) and a mask of active conditions.

    With `once` a single step from the latest solution is enough: little has changed since.
    """

    def __call__(self, extra: dict[str, float], active: np.ndarray, *, once: bool) -> Adjustment:
        """Return the adjustment."""
        ...


@dataclass(frozen=True, slots=True)
class Balanced:
    """A settled adjustment, the variance added to each kind, and what was left out."""

    adjustment: Adjustment
    extra: dict[str, float]
    outliers: list[Outlier]


def balance(
    solve: Solve,
    kinds: list[Kind],
    active: np.ndarray,
    *,
    extra: dict[str, float] | None = None,
    robust: bool = True,
) -> Balanced:
    """Adjust, add variance where residuals ask for it, and leave out what is no noise.

    Parameters
    ----------
    solve : the adjustment; its last call is the one whose result is returned.
    kinds : the kinds of conditions that may need more variance.
    active : (groups, size) of bool, changed in place: outliers are switched off.
    extra : variances to start from.
    robust : look for outliers at all.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    variances = {kind.name: 0.0 for kind in kinds} if extra is None else dict(extra)
    adjustment = solve(variances, active, once=False)
    outliers: list[Outlier] = []
    for _ in range(_PASSES if robust else 0):
        adjustment, variances = _settle(solve, kinds, active, adjustment, variances, _robust_ratio)
        found = _gross_errors(adjustment, kinds, outliers, FALSE_ALARM)
        if not found:
            break
        for outlier, columns in found:
            active[outlier.group, columns] = False
            outliers.append(outlier)
        adjustment = solve(variances, active, once=True)
    adjustment, variances = _settle(solve, kinds, active, adjustment, variances, _mean_ratio)
    for kind in kinds:
        # A component that chance explains is no component: taking every excess for real, and no
        # deficit, would make the uncertainties too wide on average.
        if variances[kind.name] > 0.0:
            without = {**variances, kind.name: 0.0}
            if _explained_by_chance(solve(without, active, once=True), kind):
                variances = without
    return Balanced(solve(variances, active, once=False), variances, outliers)


def _settle(
    solve: Solve,
    kinds: list[Kind],
    active: np.ndarray,
    adjustment: Adjustment,
    extra: dict[str, float],
    ratio: Callable[[list[GroupTest]], float],
) -> tuple[Adjustment, dict[str, float]]:
    """Move the extra variances until each kind's residuals are as large as its variance says."""
    for _ in range(8):
        moved = False
        reliability = Reliability.of(adjustment)
        for kind in kinds:
            tests = [test for test in reliability.snoop(kind.columns) if test.degrees]
            if not tests:
                continue
            total = _typical_variance(adjustment, kind)
            wanted = max(0.0, extra[kind.name] + (ratio(tests) - 1.0) * total)
            if abs(wanted - extra[kind.name]) > SETTLED * total:
                extra = {**extra, kind.name: wanted}
                moved = True
        if not moved:
            break
        adjustment = solve(extra, active, once=True)
    return adjustment, extra


def _explained_by_chance(adjustment: Adjustment, kind: Kind) -> bool:
    """Return whether the residuals of a kind are no larger than noise makes them in 97.5 % of cases."""
    from scipy.special import chdtrc

    reliability = Reliability.of(adjustment)
    tests = [test for test in reliability.snoop(kind.columns) if test.degrees]
    redundancy = _redundancy(adjustment, kind)
    statistic = _mean_ratio(tests) * redundancy if tests else 0.0
    return redundancy < 1.0 or float(chdtrc(redundancy, statistic)) > CHANCE


def _redundancy(adjustment: Adjustment, kind: Kind) -> float:
    """Return the share of a kind's conditions that is left to check it, summed: its own redundancy."""
    linear, chain = adjustment.linearisation, adjustment.chain
    weighted = chain.solve(linear.design)[:, kind.columns]
    taken = np.einsum("gsp,gsq->pq", linear.design[:, kind.columns], weighted)
    loss = float(np.sum(taken * adjustment.cofactor))
    return float(np.count_nonzero(linear.active[:, kind.columns])) - loss


def _typical_variance(adjustment: Adjustment, kind: Kind) -> float:
    """Return the harmonic mean of the conditions' variances: what the weight is worth."""
    diagonal = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, kind.columns]
    used = diagonal[adjustment.linearisation.active[:, kind.columns]]
    return float(used.size / np.sum(1.0 / used))


def _mean_ratio(tests: list[GroupTest]) -> float:
    return sum(test.statistic for test in tests) / sum(test.degrees for test in tests)


def _robust_ratio(tests: list[GroupTest]) -> float:
    ratios = [test.statistic / MEDIAN_CHI_SQUARE[min(test.degrees, 6) - 1] for test in tests]
    return float(np.median(ratios))


def _gross_errors(
    adjustment: Adjustment, kinds: list[Kind], before: list[Outlier], false_alarm: float
) -> list[tuple[Outlier, slice]]:
    """Return the groups of each kind that exceed their limit, the worst and what is half as bad."""
    found: list[tuple[Outlier, slice]] = []
    reliability = Reliability.of(adjustment)
    for kind in kinds:
        tests = [test for test in reliability.snoop(kind.columns) if test.degrees]
        gone = sum(outlier.kind == kind.name for outlier in before)
        allowed = int(LARGEST_SHARE_LEFT_OUT * (len(tests) + gone)) - gone
        allowed = min(allowed, max(1, int(SHARE_AT_A_TIME * len(tests))))
        degrees = sum(test.degrees for test in tests)
        # The noise level itself is estimated from the same residuals: F instead of chi-square.
        limits = {
            d: limit_of_largest(d, len(tests), degrees, false_alarm) for d in {t.degrees for t in tests}
        }
        beyond = [test for test in tests if test.statistic > limits[test.degrees]]
        beyond.sort(key=lambda test: -test.statistic / limits[test.degrees])
        for test in beyond[: max(allowed, 0)]:
            if 2.0 * test.normalised >= beyond[0].normalised:
                found.append((Outlier(kind.name, test.group, test.normalised), kind.columns))
    return found
