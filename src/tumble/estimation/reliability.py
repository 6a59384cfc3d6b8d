"""Tests of single groups of conditions against gross errors (data snooping, Baarda 1968)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.estimation.gauss_helmert import Adjustment


@dataclass(frozen=True, slots=True)
class GroupTest:
    """The test of some conditions of one group against a gross error in them.

    `statistic` is chi-square with `degrees` of freedom if there is none (and the noise given is the
    true one); `normalised` is the size of a normal deviate of the same rarity times nothing: the
    square root of statistic over degrees, about 1 on average.
    """

    group: int
    statistic: float
    degrees: int

    @property
    def normalised(self) -> float:
        """Root of the statistic per degree of freedom: about 1 where nothing is wrong."""
        return float(np.sqrt(self.statistic / self.degrees)) if self.degrees else 0.0


def snoop_groups(adjustment: Adjustment, columns: slice) -> list[GroupTest]:
    """Test the conditions `columns` of every group that has them active.

    Notes
    -----
    With P = C^-1 and v the conditions' residual, P v has the cofactor
    S = P - P A N^-1 A' P. A gross error in the group's own conditions shows in
    T = (P v)_g' S_gg^-1 (P v)_g, chi-square under the hypothesis that there is none. A group whose
    S_gg vanishes is not checked by any other observation: its degrees are 0.
    """
    linear, chain = adjustment.linearisation, adjustment.chain
    weighted_design = chain.solve(linear.design)
    inverse = chain.inverse_diagonal()
    loss = np.einsum("gsp,pq,gtq->gst", weighted_design, adjustment.cofactor, weighted_design)
    tests: list[GroupTest] = []
    for group in range(linear.misclosure.shape[0]):
        rows = np.arange(linear.misclosure.shape[1])[columns]
        rows = rows[linear.active[group, rows]]
        if rows.size == 0:
            continue
        block = inverse[group][np.ix_(rows, rows)]
        spread = block - loss[group][np.ix_(rows, rows)]
        scale = np.sqrt(np.diag(block))
        eigenvalues, vectors = np.linalg.eigh(spread / np.outer(scale, scale))
        # A share of redundancy below 1e-6 is no check at all.
        checked = eigenvalues > 1e-6
        component = vectors.T @ (adjustment.multipliers[group, rows] / scale)
        statistic = float(np.sum(component[checked] ** 2 / eigenvalues[checked]))
        tests.append(GroupTest(group, statistic, int(np.count_nonzero(checked))))
    return tests


def critical_value(degrees: int, groups: int, false_alarm: float = 0.01) -> float:
    """Return the limit that the largest of `groups` chi-square statistics passes by chance rarely.

    `false_alarm` is the chance that any of them does when nothing is wrong (Sidak's inequality).
    """
    from scipy.special import chdtri

    single = 1.0 - (1.0 - false_alarm) ** (1.0 / max(groups, 1))
    return float(chdtri(degrees, single))
