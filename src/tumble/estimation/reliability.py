"""Tests of single groups of conditions against gross errors (data snooping, Baarda 1968)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray
from tumble.estimation.gauss_helmert import Adjustment
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class GroupTest:
    """The test of some conditions of one group against a gross error in them.

    `statistic` is chi-square with `degrees` of freedom if there is none (and the noise given is the
    true one).
    """

    group: int
    statistic: float
    degrees: int

    @property
    def normalised(self) -> float:
        """Root of the statistic per degree of freedom: about 1 where nothing is wrong."""
        return float(np.sqrt(self.statistic / self.degrees)) if self.degrees else 0.0


@dataclass(frozen=True, slots=True)
class Reliability:
    """How well each condition of an adjustment is checked by the others.

    Attributes
    ----------
    adjustment : what is judged.
    inverse : (groups, size, size), diagonal blocks of P = C^-1.
    loss : (groups, size, size), diagonal blocks of P A N^-1 A' P: what the unknowns take up.
    """

    adjustment: Adjustment
    inverse: AnyArray
    loss: AnyArray

    @staticmethod
    def of(adjustment: Adjustment) -> Reliability:
        """Return the reliability of an adjustment, with the work that all kinds of conditions share."""
        linear, chain = adjustment.linearisation, adjustment.chain
        weighted = chain.solve(linear.design)
        root = np.linalg.cholesky(adjustment.cofactor)
        moved = weighted @ root
        return Reliability(adjustment, chain.inverse_diagonal(), moved @ np.swapaxes(moved, 1, 2))

    def snoop(self, columns: slice) -> list[GroupTest]:
        """Test the conditions `columns` of every group that has them active.

        Notes
        -----
        With P = C^-1 and v the conditions' residual, P v has the cofactor
        S = P - P A N^-1 A' P. A gross error in the group's own conditions shows in
        T = (P v)_g' S_gg^-1 (P v)_g, chi-square under the hypothesis that there is none. A group
        whose S_gg vanishes is not checked by any other observation: its degrees are 0.
        """
        rows: npt.NDArray[np.int64] = np.arange(
            self.adjustment.linearisation.misclosure.shape[1], dtype=np.int64
        )[columns]
        active = self.adjustment.linearisation.active[:, rows]
        block = self.inverse[:, rows[:, None], rows]
        # Whitened by the group's own part of P, the eigenvalues are shares of redundancy, 0 to 1.
        whiten = np.linalg.inv(np.linalg.cholesky(block))
        own_loss = self.loss[:, rows[:, None], rows]
        spread = np.eye(rows.size) - whiten @ own_loss @ np.swapaxes(whiten, 1, 2)
        # Inactive rows take no part: their own redundancy is set to nothing.
        spread = np.where(active[:, :, None] & active[:, None, :], spread, 0.0)
        eigenvalues, vectors = np.linalg.eigh(spread)
        # A share of redundancy below 1e-6 is no check at all.
        checked = eigenvalues > 1e-6
        pulls = np.einsum("gst,gt->gs", whiten, np.where(active, self.adjustment.multipliers[:, rows], 0.0))
        components = np.einsum("gse,gs->ge", vectors, pulls) ** 2
        parts = np.divide(components, eigenvalues, out=np.zeros_like(components), where=checked)
        statistics, degrees = parts.sum(axis=1), checked.sum(axis=1)
        return [
            GroupTest(group, float(statistics[group]), int(degrees[group]))
            for group in np.flatnonzero(active.any(axis=1)).tolist()
        ]


def snoop_groups(adjustment: Adjustment, columns: slice) -> list[GroupTest]:
    """Test the conditions `columns` of every group: `Reliability.snoop` for one kind alone."""
    return Reliability.of(adjustment).snoop(columns)


def critical_value(degrees: int, groups: int, false_alarm: float = 0.01) -> float:
    """Return the limit that the largest of `groups` chi-square statistics passes by chance rarely.

    `false_alarm` is the chance that any of them does when nothing is wrong (Sidak's inequality).
    """
    from scipy.special import chdtri

    single: float = 1.0 - (1.0 - false_alarm) ** (1.0 / max(groups, 1))
    return float(chdtri(degrees, single))
