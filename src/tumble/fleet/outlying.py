"""Units that stand out from the others, by a robust multivariate distance with a stated chance of a false alarm.

Centre and spread are first found by the orthogonalised Gnanadesikan-Kettenring estimate (Maronna and Zamar 2002,
*Robust estimates of location and dispersion for high-dimensional datasets*, Technometrics 44, 307), which half of the
units cannot mislead. From there each unit is tested against all others that do not stand out: if x, and n others with
mean m and covariance S, are drawn from one p-dimensional normal distribution, then

    (x - m)' S^-1 (x - m) · n (n - p) / (p (n - 1) (n + 1))

has the F distribution with p and n - p degrees of freedom (Hotelling). Units and tests share the stated chance
(Bonferroni), so that it is the chance that any unit of a good fleet is named. Each unit's own uncertainty stands beside
the spread: one that is known worse than the others may be farther off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.fleet.unit_vector import Units
from tumble.parameters import in_families
from tumble.records import dataclass

FALSE_ALARM = 0.01
"""Chance that a fleet without a faulty unit has any unit named, or a column that bad ones share."""
FEWEST = 8
"""Units below which nothing is said to stand out."""
_ROUNDS = 20
# Standard deviation of a normal distribution over its median absolute deviation.
_MAD = 1.4826022185056018


@dataclass(frozen=True)
class Outlying:
    """A unit that stands out.

    Attributes
    ----------
    unit : its number among those given.
    what : the group of parameters, or "all parameters together".
    distance : root of the squared robust distance, in standard deviations.
    chance : that a good unit is as far off.
    worst : the parameter that is farthest off in it, by as many standard deviations as `sigmas`.
    """

    unit: int
    what: str
    distance: float
    chance: float
    worst: str
    sigmas: float


def find_outlying(units: Units, false_alarm: float = FALSE_ALARM) -> list[Outlying]:
    """Return the units that stand out, each by what it does most.

    Parameters
    ----------
    units : that can be compared.
    false_alarm : chance that any unit of a good fleet is named.
    """
    count, dimension = units.values.shape
    if count < FEWEST:
        return []
    tests = {name: at for name, at in in_families(units.names).items() if count > 2 * len(at) + 2}
    if count >= 3 * dimension and len(tests) > 1:
        tests["all parameters together"] = list(range(dimension))
    found: dict[int, Outlying] = {}
    level = false_alarm / max(len(tests), 1) / count
    for what, at in tests.items():
        for one in _outlying(units, what, at, level):
            if one.unit not in found or one.chance < found[one.unit].chance:
                found[one.unit] = one
    return [found[unit] for unit in sorted(found)]


def _outlying(units: Units, what: str, at: list[int], level: float) -> list[Outlying]:
    # A parameter that most units have the very same number of, as copies of one recording do, compares nothing.
    at = [one for one in at if _robust_scale(units.values[:, one]) > 0.0]
    if not at:
        return []
    values = units.values[:, at]
    own = units.covariances[:, at][:, :, at]
    scale = np.array([_robust_scale(column) for column in values.T])
    x, own = values / scale, own / np.outer(scale, scale)
    keep = _start(x)
    chances = distances = np.zeros(len(x))
    for _ in range(_ROUNDS):
        chances, distances = _chances(x, own, keep)
        now = chances > level
        if np.sum(now) < len(x) // 2 + 1:
            break
        if np.array_equal(now, keep):
            break
        keep = now
    named: list[Outlying] = []
    for unit in np.flatnonzero(chances <= level):
        off = (x[unit] - np.mean(x[keep], axis=0)) / np.std(x[keep], axis=0, ddof=1)
        worst = int(np.argmax(np.abs(off)))
        named.append(
            Outlying(
                units.which[unit],
                what,
                float(np.sqrt(distances[unit])),
                float(chances[unit]),
                units.names[at[worst]],
                float(off[worst]),
            )
        )
    return named


def _start(x: Table) -> np.ndarray:
    """Which units the robust estimate takes to be good: nearest to its centre."""
    centre, spread = robust_location_and_spread(x)
    distance = _squared(x - centre, spread)
    # The half that is nearest, and whatever is no farther than 97.5 % of good ones would be.
    median, most = quantile_beyond(x.shape[1], 0.5), quantile_beyond(x.shape[1], 0.025)
    return (distance * median / np.median(distance) <= most) | (distance <= np.median(distance))


def _chances(x: Table, own: np.ndarray, keep: np.ndarray) -> tuple[Series, Series]:
    """Chance of each unit being as far off the good others, and its squared distance."""
    from scipy.special import fdtrc

    dimension = x.shape[1]
    usual = np.mean(own[keep], axis=0)
    chances, distances = np.ones(len(x)), np.zeros(len(x))
    good = x[keep]
    total, squares, count = good.sum(axis=0), good.T @ good, len(good)
    for unit, row in enumerate(x):
        n = count - int(keep[unit])
        if n <= dimension + 1:
            continue
        sums = total - row if keep[unit] else total
        products = squares - np.outer(row, row) if keep[unit] else squares
        mean = sums / n
        spread = (products - n * np.outer(mean, mean)) / (n - 1)
        spread = spread + _worse_than(own[unit], usual)
        distances[unit] = _squared((row - mean)[None], spread)[0]
        statistic = distances[unit] * n * (n - dimension) / (dimension * (n - 1) * (n + 1))
        chances[unit] = fdtrc(dimension, n - dimension, statistic)
    return chances, distances


def _worse_than(own: Square, usual: Square) -> Square:
    """The part of a unit's covariance by which it is known worse than the others are."""
    values, vectors = np.linalg.eigh(own - usual)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


def quantile_beyond(freedom: int, chance: float) -> float:
    """Return what a chi-square variable exceeds with a chance.

    Parameters
    ----------
    freedom, chance : degrees of freedom, and probability.
    """
    from scipy.special import chdtri

    inverse: Any = chdtri
    return float(inverse(float(freedom), chance))


def _robust_scale(x: Series) -> float:
    """Return the median absolute deviation, as a standard deviation of a normal distribution."""
    return float(_MAD * np.median(np.abs(x - np.median(x))))


def robust_location_and_spread(x: Table) -> tuple[Series, Square]:
    """Return centre (p,) and spread (p, p) that half of the rows cannot mislead (orthogonalised GK estimate).

    Parameters
    ----------
    x : (n, p).
    """
    scale = np.array([_robust_scale(column) for column in x.T])
    scale[scale == 0.0] = 1.0
    z = x / scale
    dimension = x.shape[1]
    u = np.eye(dimension)
    for i in range(dimension):
        for j in range(i):
            plus, minus = _robust_scale(z[:, i] + z[:, j]), _robust_scale(z[:, i] - z[:, j])
            u[i, j] = u[j, i] = (plus**2 - minus**2) / 4.0
    _, vectors = np.linalg.eigh(u)
    principal = z @ vectors
    lengths = np.array([_robust_scale(column) for column in principal.T])
    lengths = np.maximum(lengths, 1e-9 * max(np.max(lengths), 1e-300))
    back = scale[:, None] * vectors
    centre = back @ np.median(principal, axis=0)
    return centre, (back * lengths**2) @ back.T


def _squared(rows: Table, spread: Square) -> Series:
    return np.einsum("ij,ij->i", rows, np.linalg.solve(spread, rows.T).T)


def loud_or_dead(
    noise: Sequence[Series | None], false_alarm: float = FALSE_ALARM
) -> list[tuple[int, int, float]]:
    """Return units whose noise at rest is not that of the others: (unit, channel, factor over the median).

    The logarithms of a channel's noise are compared; a channel without any noise stands out always.

    Parameters
    ----------
    noise : (channels,) of each unit, standard deviation of a sample at rest; None for a unit without.
    false_alarm : chance that any unit of a good fleet is named.
    """
    which = [k for k, one in enumerate(noise) if one is not None]
    if len(which) < FEWEST:
        return []
    size = max(len(one) for one in noise if one is not None)
    which = [k for k in which if len(noise[k]) == size]  # pyright: ignore[reportArgumentType]
    table = np.array([noise[k] for k in which])
    found: list[tuple[int, int, float]] = []
    for channel in range(table.shape[1]):
        column = table[:, channel]
        seen = np.flatnonzero(column > 0.0)
        middle = float(np.median(column[seen])) if seen.size else 0.0
        found += [(which[k], channel, 0.0) for k in np.flatnonzero(column <= 0.0) if middle > 0.0]
        if seen.size < FEWEST:
            continue
        one = Units(
            ("noise",),
            ("",),
            tuple(map(int, seen)),
            np.log(column[seen])[:, None],
            np.zeros((seen.size, 1, 1)),
        )
        level = false_alarm / table.shape[1] / seen.size
        named = _outlying(one, "noise", [0], level)
        found += [(which[out.unit], channel, float(column[out.unit] / middle)) for out in named]
    return found


# Of a column with more values than this, none is a lot.
_MOST_VALUES = 50


def find_shared(bad: Sequence[bool], columns: Mapping[str, Sequence[str]]) -> list[str]:
    """Return sentences about values of columns that bad units have more often than by chance.

    Fisher's exact test, one side, over all values that two bad units share (Bonferroni).

    Parameters
    ----------
    bad : (n,) whether each unit failed or stands out.
    columns : what the manifest says of each unit, by the column's name.
    """
    from scipy.stats import hypergeom

    flags = np.asarray(bad, dtype=bool)
    total, count = len(flags), int(np.sum(flags))
    cases: list[tuple[str, str, int, int]] = []
    for column, values in columns.items():
        known = {value for value in values if value}
        if 1 < len(known) <= _MOST_VALUES or (len(known) == 1 and "" in values):
            for value in sorted(known):
                has = np.array([one == value for one in values])
                both = int(np.sum(has & flags))
                if both >= 2:
                    cases.append((column, value, both, int(np.sum(has))))
    said: list[tuple[float, str]] = []
    for column, value, both, has in cases:
        chance = float(hypergeom.sf(both - 1, total, has, count))
        if chance < FALSE_ALARM / len(cases):
            words = (
                f"Of the {count} units that are not accepted or stand out {both} have {column} {value!r}, as "
                f"{has} of all {total} have (probability by chance {chance:.1g})."
            )
            said.append((chance, words))
    return [words for _, words in sorted(said)]
