"""The best so many poses of those that there are: visits exchanged one for another from many starts.

Best is the mean of the variances (A-optimal). It is a puzzle of whole numbers; the exchange ends where no single
exchange is better, and of many such ends the best is taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Square, Table, inverted

# Beside the information, so that a singular start is bad instead of an error; of the mean of its diagonal.
RIDGE = 1e-10
# Of the starts, the shares of visits that are drawn, in turn; the rest of a start is what determines most.
DRAWN = (1.0, 1.0, 0.5)


def find_visits(
    rows: Table,
    count: int,
    rng: np.random.Generator,
    *,
    known: Square | None = None,
    starts: int = 30,
    also: Sequence[Sequence[int]] = (),
) -> list[int]:
    """Return which poses to visit, ascending; one may be visited more than once.

    Parameters
    ----------
    rows : (poses, p) what a visit observes, over its standard uncertainty.
    count : visits.
    rng : draws the starts.
    known : (p, p) information that is there already.
    starts : the best end of so many is returned.
    also : sets of `count` poses to start from, too, so that the visits are no worse than they are.
    """
    base = np.zeros((rows.shape[1], rows.shape[1])) if known is None else known
    begun = [_start(rows, base, count, rng, DRAWN[k % len(DRAWN)]) for k in range(starts)]
    begun += [np.array(one) for one in also]
    ends = [_exchanged(rows, base, start) for start in begun]
    return sorted(min(ends, key=lambda end: end[0])[1].tolist())


def _start(rows: Table, base: Square, count: int, rng: np.random.Generator, drawn: float) -> np.ndarray:
    """Draw a share of the visits, and add those that tell most of what is least known."""
    first = rng.choice(len(rows), size=min(max(int(drawn * count), 1), len(rows)), replace=False)
    chosen = first.tolist()
    total = base + rows[first].T @ rows[first]
    ridge = 1e-4 * float(np.mean(rows**2)) * np.eye(rows.shape[1])
    while len(chosen) < count:
        covariance = inverted(total + ridge)
        new = int(np.argmax(np.sum((rows @ covariance) ** 2, axis=1)))
        chosen.append(new)
        total = total + np.outer(rows[new], rows[new])
    return np.array(chosen)


def _exchanged(rows: Table, base: Square, start: np.ndarray) -> tuple[float, np.ndarray]:
    """Exchange one visit for another as long as that helps; return the mean variance and the visits."""
    chosen = start.copy()
    value, improved = _mean_variance(_covariance(rows, base, chosen)), True
    while improved:
        improved = False
        for place in range(chosen.size):
            tried = _tried(rows, _covariance(rows, base, chosen), int(chosen[place]))
            tried = np.where(np.isfinite(tried) & (tried > 0.0), tried, np.inf)
            best = int(np.argmin(tried))
            if tried[best] < value * (1.0 - 1e-7):
                before = chosen[place]
                chosen[place] = best
                now = _mean_variance(_covariance(rows, base, chosen))
                if now < value * (1.0 - 1e-9):
                    value, improved = now, True
                else:  # an update of a nearly singular set, whose digits were lost
                    chosen[place] = before
    return value, chosen


def _mean_variance(covariance: Square) -> float:
    return float(np.mean(np.diag(covariance)))


def _covariance(rows: Table, base: Square, chosen: np.ndarray) -> Square:
    total = rows[chosen].T @ rows[chosen] + base
    return inverted(total + RIDGE * float(np.mean(np.diag(total))) * np.eye(total.shape[0]))


def _tried(rows: Table, covariance: Square, out: int) -> AnyArray:
    """Mean variances (poses,) with each pose in, then one visit out: never singular on the way."""
    added = _updated(np.broadcast_to(covariance, (len(rows), *covariance.shape)), rows, 1.0)
    changed = _updated(added, np.broadcast_to(rows[out], rows.shape), -1.0)
    return np.asarray(np.diagonal(changed, axis1=1, axis2=2).mean(axis=1), dtype=np.float64)


def _updated(covariance: AnyArray, rows: Table, sign: float) -> AnyArray:
    """Covariances (n, p, p) after the observations `rows` (n, p) came or went (Sherman and Morrison)."""
    across = np.einsum("nij,nj->ni", covariance, rows)
    inner = 1.0 + sign * np.einsum("ni,ni->n", rows, across)
    inner = np.where(np.abs(inner) < 1e-12, 1e-12, inner)
    return covariance - sign * across[:, :, None] * across[:, None, :] / inner[:, None, None]
