"""Reliability: tests of single groups against gross errors, how large one may go unnoticed, and what it does then.

Data snooping is Baarda's (1968). His (A testing procedure for use in geodetic networks, Netherlands Geodetic
Commission 2 (1968)) minimal detectable bias: the error whose test, at false-alarm rate alpha, finds it with the power
stated. An observation here is a few numbers, with an error in any direction; of all directions the one that moves a
parameter most while it stays at the edge of being found is taken, which is ``M^-1 g`` for the test's matrix M
and the parameter's gain g (for one number it is Baarda's own formula).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Square, Table
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


# Baarda's false-alarm rate and power.
ALPHA, POWER = 0.001, 0.8
# Of the size of the largest: a direction less checked than this is not checked.
UNCHECKED = 1e-7
# A direction that adds less than this to no parameter's variance does no harm, checked or not.
HARMLESS = 1e-6
# Of the squared harm: what a direction must add to be part of the error that is told.
WORTH_IT = 0.02


@dataclass(frozen=True, slots=True)
class Undetected:
    """The largest error that may go unnoticed.

    Attributes
    ----------
    redundancy : of the observation's numbers, how much the others check.
    size : length of the most harmful error; infinite if nothing checks it.
    parameter, effect : which parameter it moves most, and by how many of its standard uncertainties.
    """

    redundancy: float
    size: float
    parameter: int
    effect: float


def noncentrality() -> float:
    """Return by how many sigmas an error must stand out to be found by a two-sided test of one number: 4.13."""
    from scipy.special import ndtri

    return float(ndtri(1.0 - 0.5 * ALPHA) + ndtri(POWER))


def undetected(left: Square, directions: Table, gain: Table, sigma: Series) -> Undetected:
    """Return the largest error of one observation that may go unnoticed.

    Parameters
    ----------
    left : (m, m) covariance of the residuals over that of the observation, whitened: identity less what the
        adjustment takes.
    directions : (m, d) whitened, of the errors looked at, per unit of error.
    gain : (parameters, m) by how much whitened errors move each parameter.
    sigma : (parameters,) standard uncertainties.
    """
    needed = noncentrality()
    relative = (gain @ directions) / np.where(sigma > 0.0, sigma, np.inf)[:, None]
    test = directions.T @ left @ directions
    # In units in which the observation's own noise is one, whatever the directions' units are.
    own = np.sqrt(np.diag(directions.T @ directions))
    values, vectors = np.linalg.eigh(test / np.outer(own, own))
    along = (relative / own) @ vectors
    seen = values > UNCHECKED * np.maximum(values.max(initial=0.0), 1e-3)
    redundancy = float(np.trace(left))
    harm = along[:, ~seen] ** 2
    if harm.size and float(harm.max()) > HARMLESS:
        return Undetected(redundancy, float("inf"), int(np.argmax(harm.max(axis=1))), float("inf"))
    inverse = np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)
    harms = along**2 * inverse
    worst = int(np.argmax(harms.sum(axis=1)))
    # A direction that hardly adds to the harm would only make the error look large.
    matters = harms[worst] > WORTH_IT * harms[worst].sum()
    inverse = np.where(matters, inverse, 0.0)
    effects = needed * np.sqrt(np.sum(along**2 * inverse, axis=1))
    norm = float(np.sqrt(np.sum(along[worst] ** 2 * inverse)))
    if norm <= 0.0:
        return Undetected(redundancy, needed / float(np.sqrt(max(values.max(), 1e-300))), worst, 0.0)
    error = needed * (vectors @ (inverse * along[worst])) / norm / own
    return Undetected(redundancy, float(np.linalg.norm(error)), worst, float(effects[worst]))
