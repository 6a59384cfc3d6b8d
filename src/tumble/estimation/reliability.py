"""Reliability: tests of single groups against gross errors, how large one may go unnoticed, and what it does then.

Data snooping is Baarda's (1968). His (A testing procedure for use in geodetic networks, Netherlands Geodetic
Commission 2 (1968)) minimal detectable bias: the error whose test, at false-alarm rate alpha, finds it with the power
stated. An observation here is a few numbers, with an error in any direction; of all directions the one that moves a
parameter most while it stays at the edge of being found is taken, which is ``M^-1 g`` for the test's matrix M
and the parameter's gain g (for one number it is Baarda's own formula).

Weak directions are the combinations of parameters that the observations tell badly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.estimation.equations import Look, Tests, View, tested
from tumble.estimation.gauss_helmert import Adjustment
from tumble.records import dataclass


def snoop_groups(adjustment: Adjustment, columns: slice) -> Tests:
    """Return the tests of the conditions `columns` of every group that has any of them active.

    A group that no other observation checks has no degrees.

    Parameters
    ----------
    adjustment : settled.
    columns : of a kind of conditions, which has no noise in common with the others of the group.
    """
    active = adjustment.linearisation.active[:, columns]
    groups = np.flatnonzero(active.any(axis=1))
    residual, A, C = (
        of[groups][:, columns]
        for of in (adjustment.residual, adjustment.linearisation.design, adjustment.linearisation.covariance)
    )
    # What takes no part is taken whole: nothing of it is left to be checked.
    taken = A @ adjustment.cofactor @ np.swapaxes(A, 1, 2) + ~active[groups][:, :, None] * np.eye(
        active.shape[1]
    )
    return tested([Look.at(groups, residual, C[:, :, columns], taken, View("", least=UNTESTED))])[0]


# A share of redundancy below this is no check at all.
UNTESTED = 1e-6
# Baarda's false-alarm rate and power.
ALPHA, POWER = 0.001, 0.8
# Of the size of the largest: a direction less checked than this is not checked.
UNCHECKED = 1e-7
# A direction that adds less than this to no parameter's variance does no harm, checked or not.
HARMLESS = 1e-6
# Of the squared harm: what a direction must add to be part of the error that is told.
WORTH_IT = 0.02


class Undetected(NamedTuple):
    """The largest error that may go unnoticed.

    Attributes
    ----------
    size : length of the most harmful error; infinite if nothing checks it.
    parameter, effect : which parameter it moves most, and by how many of its standard uncertainties.
    """

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
    harm = along[:, ~seen] ** 2
    if harm.size and float(harm.max()) > HARMLESS:
        return Undetected(float("inf"), int(np.argmax(harm.max(axis=1))), float("inf"))
    inverse = np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)
    harms = along**2 * inverse
    worst = int(np.argmax(harms.sum(axis=1)))
    # A direction that hardly adds to the harm would only make the error look large.
    matters = harms[worst] > WORTH_IT * harms[worst].sum()
    inverse = np.where(matters, inverse, 0.0)
    effects = needed * np.sqrt(np.sum(along**2 * inverse, axis=1))
    norm = float(np.sqrt(np.sum(along[worst] ** 2 * inverse)))
    if norm <= 0.0:
        return Undetected(needed / float(np.sqrt(max(values.max(), 1e-300))), worst, 0.0)
    error = needed * (vectors @ (inverse * along[worst])) / norm / own
    return Undetected(float(np.linalg.norm(error)), worst, float(effects[worst]))


@dataclass(frozen=True)
class WeakDirection:
    """A combination of parameters and its standard uncertainty.

    `direction` is in units of `scale` (the sizes in which the parameters matter), of length 1;
    `sigma` is the combination's standard uncertainty in the same units, infinite if undetermined.
    """

    direction: Series
    sigma: float

    def leading(self, share: float = 0.3) -> list[int]:
        """Return the parameters that carry at least `share` of the largest weight, largest first."""
        weights = np.abs(self.direction)
        order = np.argsort(-weights)
        return [int(i) for i in order if weights[i] >= share * weights[order[0]]]


def find_weak_directions(normal: Square, scale: Series, limit: float) -> list[WeakDirection]:
    """Return the combinations whose sigma exceeds `limit`, worst first.

    Parameters
    ----------
    normal : (parameters, parameters) information matrix.
    scale : (parameters,) the size at which each parameter matters to the user, in its unit.
    limit : in those sizes: 1 asks for what cannot be told better than its own size.
    """
    eigenvalues, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    floor = max(float(eigenvalues[-1]), 0.0) * 1e-14
    weak: list[WeakDirection] = []
    for eigenvalue, vector in zip(eigenvalues, vectors.T, strict=True):
        sigma = float("inf") if eigenvalue <= floor else float(1.0 / np.sqrt(eigenvalue))
        if sigma > limit:
            weak.append(WeakDirection(vector, sigma))
    return weak
