"""One unit recorded twice under two names: two calibrations that agree as no two units of the fleet do."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Table
from tumble.fleet.outlying import quantile_beyond, robust_location_and_spread
from tumble.fleet.unit_vector import Units
from tumble.records import dataclass

FALSE_ALARM = 1e-3
"""Chance that any two different units of a fleet are taken for one."""
SAME = 1e-3
"""Chance that two calibrations of one unit are not seen to agree."""


@dataclass(frozen=True, slots=True)
class Twins:
    """Two numbers of units that are one unit, and the chance that two different ones agree so well."""

    first: int
    second: int
    chance: float


def find_twins(units: Units) -> list[Twins]:
    """Return the pairs of units that are one.

    Of one unit the difference has the covariance of both estimates, D = C_1 + C_2, and d' D^-1 d a chi-square
    distribution. Two different units differ by twice the spread B between units as well, and their difference falls
    into the ellipsoid d' D^-1 d < q with a probability of at most its volume times the density at zero::

        V_p q^(p/2) |D|^(1/2) / ((2π)^(p/2) |2B + D|^(1/2)),   V_p = π^(p/2) / Γ(p/2 + 1)

    A pair is named where it agrees and this bound, times the number of pairs, is below the stated chance. All
    parameters are tried, and those without the biases, which change when a unit is switched on anew.

    Parameters
    ----------
    units : that can be compared.
    """
    stable = [k for k, name in enumerate(units.names) if " bias " not in name]
    found = {(one.first, one.second): one for one in _twins(units, FALSE_ALARM / 2)}
    if 0 < len(stable) < len(units.names):
        found |= {(one.first, one.second): one for one in _twins(_part(units, stable), FALSE_ALARM / 2)}
    return [found[pair] for pair in sorted(found)]


def _part(units: Units, at: list[int]) -> Units:
    names, unit_names = tuple(units.names[i] for i in at), tuple(units.units[i] for i in at)
    return Units(names, unit_names, units.which, units.values[:, at], units.covariances[:, at][:, :, at])


def _twins(units: Units, false_alarm: float) -> list[Twins]:
    count, dimension = units.values.shape
    if count < dimension + 3:
        return _by_best(units, false_alarm) if count >= 6 else []
    scale = np.std(units.values, axis=0, ddof=1)
    scale[scale == 0.0] = 1.0
    x: Table = units.values / scale
    own = units.covariances / np.outer(scale, scale)
    between = _between(x, own)
    limit = quantile_beyond(dimension, SAME)
    pairs = count * (count - 1) / 2
    return [
        Twins(units.which[a], units.which[b], chance * pairs)
        for a, b in _near(x, own, limit)
        if (chance := _bound(own[a] + own[b], between, limit)) < false_alarm / pairs
    ]


def _by_best(units: Units, false_alarm: float) -> list[Twins]:
    """Of few units only as many parameters as their spread can be told of: the best known ones."""
    keep = min(len(units.names), len(units.which) - 3)
    spread = np.std(units.values, axis=0, ddof=1)
    sigma = np.sqrt(np.mean(np.einsum("ijj->ij", units.covariances), axis=0))
    best = np.sort(np.argsort(sigma / np.where(spread > 0.0, spread, 1e-300))[:keep])
    return _twins(_part(units, best.tolist()), false_alarm)


def _between(x: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Robust spread between units, without what their own uncertainty adds."""
    _, spread = robust_location_and_spread(x)
    values, vectors = np.linalg.eigh(spread - np.median(own, axis=0))
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


def _near(x: np.ndarray, own: np.ndarray, limit: float) -> list[tuple[int, int]]:
    """Pairs whose difference is one of a single unit; of thousands only neighbours in one coordinate are tried."""
    sigma = np.sqrt(np.einsum("ijj->ij", own))
    first = int(np.argmin(np.median(sigma, axis=0)))
    order = np.argsort(x[:, first])
    reach = np.sqrt(limit) * 2.0 * np.max(sigma[:, first])
    sorted_values = x[order, first]
    beyond = np.asarray(np.searchsorted(sorted_values, sorted_values + reach, side="right"), dtype=np.int64)
    found: list[tuple[int, int]] = []
    for place, a in enumerate(order):
        near = order[place + 1 : beyond[place]]
        both = np.sqrt(sigma[near] ** 2 + sigma[a] ** 2)
        for b in near[np.all(np.abs(x[near] - x[a]) <= np.sqrt(limit) * both, axis=1)]:
            difference = x[a] - x[b]
            if difference @ np.linalg.solve(own[a] + own[b], difference) < limit:
                found.append((min(int(a), int(b)), max(int(a), int(b))))
    return sorted(found)


def _bound(own: np.ndarray, between: np.ndarray, limit: float) -> float:
    from scipy.special import gammaln

    dimension = len(own)
    _, inside = np.linalg.slogdet(own)
    _, outside = np.linalg.slogdet(2.0 * between + own)
    log = 0.5 * dimension * np.log(limit / 2.0) - gammaln(0.5 * dimension + 1.0) + 0.5 * (inside - outside)
    return float(np.exp(min(log, 0.0)))
