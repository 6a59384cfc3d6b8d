"""Variance components, gross errors, and Wald's test of a term: what the noise really does, and what is not noise.

The noise seen inside holds is not all: biases wander from hold to hold, knocks and bandwidth leave
their mark on turns. For each kind of condition a variance is added until its residuals are as large
as they should be. Before gross errors are gone the robust median of the residuals sets it, so that
an outlier cannot hide by inflating the noise; afterwards their mean square does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.estimate import TermTest
from tumble.estimation import Adjustment, snoop_groups
from tumble.estimation.balance import CHANCE, ROUNDS, SETTLED, Outlier, Screen, gross_errors, noise_ratio

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


Solve = Callable[[dict[str, float], np.ndarray, bool], Adjustment]
"""Adjusts with extra variances by kind (SI²) and a mask of active conditions.

With the last true a single step from the latest solution is enough: little has changed since.
"""


def balance(
    solve: Solve, kinds: Mapping[str, slice], active: np.ndarray, *, robust: bool = True
) -> tuple[Adjustment, list[Outlier]]:
    """Return an adjustment with variance added where residuals ask for it, and what was left out as no noise.

    Parameters
    ----------
    solve : the adjustment; its last call is the one whose result is returned.
    kinds : the kinds of conditions that may need more variance, and their columns in a group.
    active : (groups, size) of bool, changed in place: outliers are switched off.
    robust : look for outliers at all.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    variances = dict.fromkeys(kinds, 0.0)
    adjustment = solve(variances, active, False)
    outliers: list[Outlier] = []
    for _ in range(_PASSES if robust else 0):
        adjustment, variances = _settle(solve, kinds, active, adjustment, variances, robust=True)
        tests = {kind: snoop_groups(adjustment, columns) for kind, columns in kinds.items()}
        found = gross_errors([Screen(kind) for kind in kinds], tests, outliers)
        if not found:
            break
        for outlier in found:
            active[outlier.group, kinds[outlier.kind]] = False
        outliers += found
        adjustment = solve(variances, active, True)
    adjustment, variances = _settle(solve, kinds, active, adjustment, variances, robust=False)
    for kind in kinds:
        # A component that chance explains is no component: taking every excess for real, and no
        # deficit, would make the uncertainties too wide on average.
        if variances[kind] > 0.0:
            without = {**variances, kind: 0.0}
            if _explained_by_chance(solve(without, active, True), kinds[kind]):
                variances = without
    return solve(variances, active, False), outliers


def _settle(
    solve: Solve,
    kinds: Mapping[str, slice],
    active: np.ndarray,
    adjustment: Adjustment,
    extra: dict[str, float],
    *,
    robust: bool,
) -> tuple[Adjustment, dict[str, float]]:
    """Move the extra variances until each kind's residuals are as large as its variance says."""
    for _ in range(ROUNDS):
        before = extra
        for kind, columns in kinds.items():
            tests = snoop_groups(adjustment, columns)
            if not np.any(tests.degrees):
                continue
            # What the weight is worth: the harmonic mean of the conditions' variances.
            diagonal = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, columns]
            used = diagonal[adjustment.linearisation.active[:, columns]]
            total = float(used.size / np.sum(1.0 / used))
            wanted = max(0.0, extra[kind] + (noise_ratio(tests, robust=robust) - 1.0) * total)
            if abs(wanted - extra[kind]) > SETTLED * total:
                extra = {**extra, kind: wanted}
        if extra is before:
            break
        adjustment = solve(extra, active, True)
    return adjustment, extra


def _explained_by_chance(adjustment: Adjustment, columns: slice) -> bool:
    """Return whether the residuals of a kind are no larger than noise makes them in 97.5 % of cases."""
    from scipy.special import chdtrc

    tests = snoop_groups(adjustment, columns)
    redundancy = float(tests.redundancy.sum())
    statistic = noise_ratio(tests, robust=False) * redundancy if np.any(tests.degrees) else 0.0
    return redundancy < 1.0 or float(chdtrc(redundancy, statistic)) > CHANCE
