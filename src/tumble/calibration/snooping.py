"""Variance components and gross errors: what the noise really does, and what is not noise.

The noise seen inside holds is not all: biases wander from hold to hold, knocks and bandwidth leave
their mark on turns. For each kind of condition a variance is added until its residuals are as large
as they should be. Before gross errors are gone the robust median of the residuals sets it, so that
an outlier cannot hide by inflating the noise; afterwards their mean square does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tumble.estimation import Adjustment, GroupTest, critical_value, snoop_groups

# Median of chi-square over its degrees of freedom, for 1 to 6 degrees.
_MEDIAN_CHI_SQUARE = (0.4549, 1.3863, 2.3660, 3.3567, 4.3515, 5.3481)
# At most this share of a kind may be left out; beyond it, the rest is no majority to judge by.
LARGEST_SHARE_LEFT_OUT = 0.25
# Residuals this likely by chance ask for no added variance.
CHANCE = 0.025


@dataclass(slots=True)
class Kind:
    """One kind of condition: its columns in a group, and the variance added to it so far."""

    name: str
    columns: slice
    extra: float = 0.0


@dataclass(frozen=True, slots=True)
class Outlier:
    """A group of conditions found to be no noise: `normalised` is in standard deviations."""

    kind: str
    group: int
    normalised: float


def balance(
    solve: Callable[[dict[str, float], np.ndarray], Adjustment],
    kinds: list[Kind],
    active: np.ndarray,
    *,
    false_alarm: float = 0.01,
    robust: bool = True,
    passes: int = 12,
) -> tuple[Adjustment, dict[str, float], list[Outlier]]:
    """Adjust, add variance where residuals ask for it, and leave out what is no noise.

    Parameters
    ----------
    solve : adjusts with extra variances by kind (SI²) and an `active` mask.
    kinds : the kinds of conditions that may need more variance.
    active : (groups, size) of bool, changed in place: outliers are switched off.
    false_alarm : chance that any good group is left out.
    robust : look for outliers at all.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    extra = {kind.name: kind.extra for kind in kinds}
    adjustment = solve(extra, active)
    outliers: list[Outlier] = []
    for _ in range(passes if robust else 0):
        adjustment, extra = _settle(solve, kinds, active, adjustment, extra, _robust_ratio)
        found = _worst(adjustment, kinds, active, outliers, false_alarm)
        if not found:
            break
        for outlier, columns in found:
            active[outlier.group, columns] = False
            outliers.append(outlier)
        adjustment = solve(extra, active)
    adjustment, extra = _settle(solve, kinds, active, adjustment, extra, _mean_ratio)
    for kind in kinds:
        # A component that chance explains is no component: taking every excess for real, and no
        # deficit, would make the uncertainties too wide on average.
        if extra[kind.name] > 0.0:
            without = {**extra, kind.name: 0.0}
            bare = solve(without, active)
            if _explained_by_chance(bare, kind):
                adjustment, extra = bare, without
    return solve(extra, active), extra, outliers


def _settle(
    solve: Callable[[dict[str, float], np.ndarray], Adjustment],
    kinds: list[Kind],
    active: np.ndarray,
    adjustment: Adjustment,
    extra: dict[str, float],
    ratio: Callable[[list[GroupTest]], float],
) -> tuple[Adjustment, dict[str, float]]:
    """Move the extra variances until each kind's residuals are as large as its variance says."""
    for _ in range(8):
        moved = False
        for kind in kinds:
            tests = snoop_groups(adjustment, kind.columns)
            tests = [test for test in tests if test.degrees]
            if not tests:
                continue
            total = _typical_variance(adjustment, kind)
            wanted = max(0.0, extra[kind.name] + (ratio(tests) - 1.0) * total)
            # 2 % of the variance is far below what any number of holds can tell.
            if abs(wanted - extra[kind.name]) > 0.02 * total:
                extra = {**extra, kind.name: wanted}
                moved = True
        if not moved:
            break
        adjustment = solve(extra, active)
    return adjustment, extra


def _explained_by_chance(adjustment: Adjustment, kind: Kind) -> bool:
    """Tell whether the residuals of a kind are no larger than noise makes them in 97.5 % of cases."""
    from scipy.special import chdtrc

    tests = [test for test in snoop_groups(adjustment, kind.columns) if test.degrees]
    redundancy = _redundancy(adjustment, kind)
    statistic = _mean_ratio(tests) * redundancy if tests else 0.0
    return redundancy < 1.0 or float(chdtrc(redundancy, statistic)) > CHANCE


def _redundancy(adjustment: Adjustment, kind: Kind) -> float:
    """Return the share of a kind's conditions that is left to check it, summed: its own redundancy."""
    linear, chain = adjustment.linearisation, adjustment.chain
    weighted = chain.solve(linear.design)[:, kind.columns]
    loss = float(np.einsum("gsp,pq,gsq->", linear.design[:, kind.columns], adjustment.cofactor, weighted))
    return float(np.count_nonzero(linear.active[:, kind.columns])) - loss


def _typical_variance(adjustment: Adjustment, kind: Kind) -> float:
    """Return the harmonic mean of the conditions' variances: what the weight is worth."""
    diagonal = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, kind.columns]
    used = diagonal[adjustment.linearisation.active[:, kind.columns]]
    return float(used.size / np.sum(1.0 / used))


def _mean_ratio(tests: list[GroupTest]) -> float:
    return sum(test.statistic for test in tests) / sum(test.degrees for test in tests)


def _robust_ratio(tests: list[GroupTest]) -> float:
    ratios = [test.statistic / _MEDIAN_CHI_SQUARE[min(test.degrees, 6) - 1] for test in tests]
    return float(np.median(ratios))


def _worst(
    adjustment: Adjustment,
    kinds: list[Kind],
    active: np.ndarray,
    before: list[Outlier],
    false_alarm: float,
) -> list[tuple[Outlier, slice]]:
    """Return the worst group of each kind that exceeds its limit."""
    found: list[tuple[Outlier, slice]] = []
    for kind in kinds:
        tests = [test for test in snoop_groups(adjustment, kind.columns) if test.degrees]
        gone = sum(outlier.kind == kind.name for outlier in before)
        if not tests or gone + 1 > LARGEST_SHARE_LEFT_OUT * (len(tests) + gone):
            continue
        worst = max(tests, key=lambda test: test.statistic / critical_value(test.degrees, 1))
        # The noise level itself is estimated from the same residuals: F instead of chi-square.
        limit = _limit(worst.degrees, len(tests), sum(test.degrees for test in tests), false_alarm)
        if worst.statistic > limit:
            normalised = float(np.sqrt(worst.statistic / worst.degrees))
            found.append((Outlier(kind.name, worst.group, normalised), kind.columns))
    return found


def _limit(degrees: int, groups: int, all_degrees: int, false_alarm: float) -> float:
    """Return the limit of the largest of `groups` statistics when their scale is estimated too."""
    from scipy.special import fdtri

    single = (1.0 - false_alarm) ** (1.0 / groups)
    # The robust scale has 37 % of the efficiency of the mean square.
    scale_degrees = max(0.37 * (all_degrees - degrees), 1.0)
    return float(degrees * fdtri(degrees, scale_degrees, single))
