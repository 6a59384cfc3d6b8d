"""Sets of poses that tell more than others with as many: of the 26 directions, or anywhere on the sphere.

Two senses of better, both with sigmas in the same measure (relative scale, radians, bias over gravity):

- average: the sum of the nine variances is least (A-optimal).
- minimax: the largest ratio of a sigma to what the nine poses of Zhang et al. (2010) give is least, so
  that the set is better than theirs in every unknown, not only on average.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors, inverted
from tumble.attitude.directions import twenty_six_directions
from tumble_papers.zhang.pose_sets import information, paper_nine

CRITERIA = ("average", "minimax")
# Ratios near the largest count as it: the 24-norm of nine is at most 10 % above the largest.
SHARPNESS = 24.0
# Beside the information of a set, so that a singular one is bad instead of an error.
FLOOR = 1e-9


def find_best_subset(
    count: int,
    rng: np.random.Generator,
    *,
    criterion: str = "average",
    starts: int = 20,
) -> Vectors:
    """Return the best set of the 26 directions found by exchanging one pose for another, from several starts.

    Parameters
    ----------
    count : how many poses, 9 to 26.
    rng : draws the starts.
    criterion : one of `CRITERIA`.
    starts : how many; the best end is returned, which may be a local one.

    Raises
    ------
    ValueError
        If fewer than 9 are asked for, or there is no such criterion.
    """
    directions = twenty_six_directions()
    _check(count, criterion)
    ends = [
        _exchanged(rng.permutation(directions.shape[0]), count, directions, criterion) for _ in range(starts)
    ]
    chosen = min(ends, key=lambda end: end[0])[1]
    return directions[np.sort(chosen)]


def find_best_on_sphere(
    count: int, rng: np.random.Generator, *, criterion: str = "average", starts: int = 20
) -> Vectors:
    """Return the best set found with its poses anywhere, from several starts.

    Parameters
    ----------
    count : how many poses, 9 at least.
    rng : draws the starts.
    criterion : one of `CRITERIA`.
    starts : how many; the best end is returned, which may be a local one.

    Raises
    ------
    ValueError
        If fewer than 9 are asked for, or there is no such criterion.
    """
    from scipy.optimize import minimize

    _check(count, criterion)

    def lost(values: Series) -> tuple[float, Series]:
        vectors = values.reshape(count, 3)
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        up = vectors / lengths
        value, slope = _badness_with_slope(up, criterion)
        # Along a vector itself nothing changes.
        across = (slope - up * np.sum(slope * up, axis=1, keepdims=True)) / lengths
        return value, across.ravel()

    ends: list[Any] = [
        minimize(lost, rng.standard_normal(3 * count), jac=True, method="BFGS", options={"maxiter": 2000})
        for _ in range(starts)
    ]
    best = min(ends, key=lambda end: float(end.fun)).x.reshape(count, 3)
    return np.asarray(best / np.linalg.norm(best, axis=1, keepdims=True), dtype=np.float64)


def badness(directions: Vectors, criterion: str = "average") -> float:
    """Return what the optimisers make small, of a set whose dwells have a sigma of one gravity.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    criterion : one of `CRITERIA`; "average" gives the sum of the nine variances, "minimax" the largest
        ratio of a sigma to that of the paper's nine (as the 24-norm).

    Raises
    ------
    ValueError
        If there is no such criterion.
    """
    _check(9, criterion)
    return _badness_with_slope(directions, criterion)[0]


def _check(count: int, criterion: str) -> None:
    if criterion not in CRITERIA:
        raise ValueError(f"{criterion!r} is none of {', '.join(CRITERIA)}")
    if count < 9:
        raise ValueError(f"{count} poses do not determine nine unknowns: ask for 9 at least")


def _exchanged(order: Any, count: int, directions: Vectors, criterion: str) -> tuple[float, Any]:
    """Exchange poses of the first `count` in `order` for others as long as that helps."""
    chosen, rest = order[:count].copy(), order[count:].copy()
    value = badness(directions[chosen], criterion)
    improved = True
    while improved:
        improved = False
        for i in range(count):
            for j in range(rest.size):
                chosen[i], rest[j] = rest[j], chosen[i]
                tried = badness(directions[chosen], criterion)
                if tried < value * (1.0 - 1e-9):
                    value, improved = tried, True
                else:
                    chosen[i], rest[j] = rest[j], chosen[i]
    return value, chosen


def _cofactor(directions: Vectors) -> Square:
    return inverted(information(directions, 1.0, 1.0) + FLOOR * np.eye(9))


def _badness_with_slope(directions: Vectors, criterion: str) -> tuple[float, Table]:
    """The criterion and its derivative by the directions: of a variance, -2 (Q r_p)_i times that of the row."""
    cofactor = _cofactor(directions)
    variances = np.diag(cofactor)
    if criterion == "average":
        value, by_variance = float(variances.sum()), np.ones(9)
    else:
        ratios = variances / np.diag(_cofactor(paper_nine()))
        half = 0.5 * SHARPNESS
        largest = float(ratios.max())
        total = float(np.sum((ratios / largest) ** half))
        value = float(np.sqrt(largest) * total ** (1.0 / SHARPNESS))
        by_variance = 0.5 * value / total * (ratios / largest) ** half / variances
    rows, by_direction = rows_with_slope(directions)
    projected = rows @ cofactor
    by_row = -2.0 * (projected * by_variance) @ cofactor
    return value, np.einsum("pr,prc->pc", by_row, by_direction)


def rows_with_slope(directions: Vectors) -> tuple[Table, Any]:
    """Return the rows of `information` in units of gravity, and their derivatives (n, 9, 3).

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    """
    x, y, z = directions.T
    nought, one = np.zeros_like(x), np.ones_like(x)
    rows = np.column_stack([x * x, y * y, z * z, x * y, -x * z, y * z, x, y, z])
    slope = [
        [2 * x, nought, nought],
        [nought, 2 * y, nought],
        [nought, nought, 2 * z],
        [y, x, nought],
        [-z, nought, -x],
        [nought, z, y],
        [one, nought, nought],
        [nought, one, nought],
        [nought, nought, one],
    ]
    return rows, np.transpose(np.array(slope), (2, 0, 1))
