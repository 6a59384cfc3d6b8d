"""The best designs of any candidates: a fixed number of visits, or a fixed time with free dwells.

Free dwells make a convex problem: shares w of the time with information ``Σ w_i M_i``. Multiplying each share
by a power of what more of it would gain (Silvey, Titterington and Torsney 1978), with steps towards the best
single candidate (Fedorov 1972), leads to its optimum, and the equivalence theorem says how far off it still is:

    optimum >= v² / max_i d_i,   d_i = tr(C L C M_i),   v = tr(L C),  L the criterion's slope

for every criterion that goes as one over the time. A fixed number of visits is a puzzle of whole numbers; an
exchange from many starts finds a good end, and the same bound says how much better any other could be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vectors, inverted
from tumble.design.candidates import Candidate, pose_rows, stacked_rows
from tumble.design.criteria import Criterion
from tumble.errors import ObservabilityError
from tumble.records import dataclass

# Beside the information, so that a singular start is bad instead of an error; of the mean of its diagonal.
RIDGE = 1e-10
# Variance of a wanted parameter, in units of what the ridge leaves, above which it is not told.
_UNTOLD = 1e-3
GAP = 1e-3
MOST_ITERATIONS = 5000
# Norms that stand for the largest of variances or eigenvalues, one after the other.
SHARPER = (12.0, 48.0, 200.0, 800.0)
# A share of the time below this is round-off of the iteration, and goes to the others.
LEAST_SHARE = 1e-5
# Of the starts, the shares of visits that are drawn, in turn; the rest of a start is what determines most.
DRAWN = (1.0, 1.0, 0.5)
# So many candidates are tried in every exchange; those that the continuous design likes least are left out
# until the end, when all are tried once more.
MOST_TRIED = 150


@dataclass(frozen=True, slots=True)
class ApproximateDesign:
    """Shares of a fixed time.

    Attributes
    ----------
    shares : (candidates,) of the time, adding up to one.
    covariance : (p, p) for one unit of time.
    value : the criterion, for one unit of time.
    bound : no design of these candidates is below it.
    """

    shares: Series
    covariance: Square
    value: float
    bound: float

    @property
    def efficiency(self) -> float:
        """Share of the time in which the best design there is would be as good; one for the best itself."""
        return self.bound / self.value


@dataclass(frozen=True, slots=True)
class ExactDesign:
    """Visits of whole numbers.

    Attributes
    ----------
    chosen : indices of the candidates, ascending, one for each visit.
    covariance : (p, p).
    value : the criterion.
    bound : no design with as many visits of these candidates is below it, found or not; zero if it was not sought.
    """

    chosen: list[int]
    covariance: Square
    value: float
    bound: float

    @property
    def efficiency(self) -> float:
        """Bound over value: as good as this is proved to be."""
        return self.bound / self.value


def find_approximate(
    candidates: Sequence[Candidate],
    criterion: Criterion,
    *,
    known: Square | None = None,
    most: int = MOST_ITERATIONS,
) -> ApproximateDesign:
    """Return the best shares of a fixed time.

    Parameters
    ----------
    candidates : with their information for the whole time, each.
    criterion : what is made small.
    known : (p, p) information that is there already; the bound then holds as far as the criterion is convex.
    most : iterations; where they do not suffice, `efficiency` says what was reached.

    Raises
    ------
    ObservabilityError
        If all candidates together do not tell a wanted parameter.
    """
    rows = stacked_rows(candidates)
    require_told(rows, criterion, known)
    base = np.zeros((rows.shape[2], rows.shape[2])) if known is None else known
    if criterion.name in ("E", "minimax"):
        return _approximate_with_corners(rows, base, criterion, GAP)
    shares = np.full(len(candidates), 1.0 / len(candidates))
    best = 0.0
    for iteration in range(most):
        covariance = inverted(_information(rows, shares, base))
        slope = criterion.slope(covariance)
        gains = _gains(rows, covariance, slope)
        value = float(criterion.value(covariance))
        best = max(best, _bound(rows, covariance, criterion, base))
        if best >= (1.0 - GAP) * value:
            break
        if iteration % 4 == 3:
            shares = _stepped(rows, shares, base, criterion, int(np.argmax(gains)))
        power = 1.0 if criterion.name == "D" else 0.5
        shares = shares * (gains / max(float(np.sum(shares * gains)), 1e-300)) ** power
        shares = np.where(shares < LEAST_SHARE * shares.max(), shares * 0.5, shares)
        shares /= shares.sum()
    return _design(rows, base, shares, criterion, best)


def _design(
    rows: AnyArray, base: Square, shares: Series, criterion: Criterion, bound: float
) -> ApproximateDesign:
    shares = np.where(shares < LEAST_SHARE, 0.0, shares)
    shares = shares / shares.sum()
    covariance = inverted(_information(rows, shares, base))
    return ApproximateDesign(shares, covariance, float(criterion.value(covariance)), bound)


def _approximate_with_corners(
    rows: AnyArray, base: Square, criterion: Criterion, gap: float
) -> ApproximateDesign:
    """Run down ever sharper norms in place of the largest, over the roots of the shares."""
    from scipy.optimize import minimize

    roots = np.full(rows.shape[0], 1.0 / np.sqrt(rows.shape[0]))
    bound, shares = 0.0, roots**2
    for sharpness in SHARPER:
        sharper = replace(criterion, sharpness=sharpness)

        def lost(values: Series, criterion: Criterion = sharper) -> tuple[float, Series]:
            length = float(values @ values)
            covariance = inverted(_information(rows, values**2 / length, base))
            gains = _gains(rows, covariance, criterion.slope(covariance))
            value = float(criterion.smooth_value(covariance))
            by_share = -gains / value
            by_root = 2.0 * values / length * (by_share - float(values**2 @ by_share) / length)
            return float(np.log(value)), by_root

        end = minimize(
            lost, roots, jac=True, method="L-BFGS-B", options={"maxiter": 500, "ftol": 1e-12, "gtol": 1e-8}
        )
        # A share of zero has no slope: lift it, so that it may come back.
        roots = np.maximum(np.abs(end.x) / np.linalg.norm(end.x), 1e-3)
        shares = np.asarray(end.x**2 / float(end.x @ end.x), dtype=np.float64)
        covariance = inverted(_information(rows, shares, base))
        bound = max(bound, _bound(rows, covariance, sharper, base))
        if bound >= (1.0 - gap) * float(criterion.value(covariance)):
            break
    return _design(rows, base, shares, criterion, bound)


def find_exact(
    candidates: Sequence[Candidate],
    count: int,
    criterion: Criterion,
    rng: np.random.Generator,
    *,
    known: Square | None = None,
    again: bool = True,
    starts: int = 30,
    also: Sequence[Sequence[int]] = (),
    bounded: bool = True,
) -> ExactDesign:
    """Return the best design of so many visits, by exchanging one for another from many starts.

    Parameters
    ----------
    candidates : with the information of one visit.
    count : visits.
    criterion : what is made small.
    rng : draws the starts.
    known : (p, p) information that is there already.
    again : a candidate may be visited more than once.
    starts : the best end of so many is returned.
    also : sets of `count` candidates to start from, too, so that the design is no worse than they are.
    bounded : also find the continuous design, for the bound.

    Raises
    ------
    ObservabilityError
        If all candidates together do not tell a wanted parameter, or so many visits do not.
    ValueError
        If fewer than one visit is asked for, or more than there are candidates without `again`.
    """
    if count < 1 or (not again and count > len(candidates)):
        raise ValueError(f"{count} visits of {len(candidates)} candidates cannot be chosen")
    rows = stacked_rows(candidates)
    require_told(rows, criterion, known)
    base = np.zeros((rows.shape[2], rows.shape[2])) if known is None else known
    bound, liked = 0.0, np.arange(len(candidates))
    if bounded or len(candidates) > MOST_TRIED:
        whole = [Candidate(c.name, c.rows * np.sqrt(count)) for c in candidates]
        many = find_approximate(whole, criterion, known=known, most=400)
        bound = many.bound
        gains = _gains(rows, many.covariance, criterion.slope(many.covariance))
        liked = np.argsort(-gains)[: max(MOST_TRIED, count)]
    searches = [_Exchange(rows, base, softer, again) for softer in _sharpened(criterion)]
    begun = [_start(rows, base, count, liked, rng, again, drawn=DRAWN[k % len(DRAWN)]) for k in range(starts)]
    begun += [np.array(one) for one in also]
    ends = [end for start in begun for end in _one_after_the_other(searches, start, liked)]
    ends += [(float(criterion.value(searches[0].covariance(np.array(one)))), np.array(one)) for one in also]
    value, chosen = min(ends, key=lambda end: end[0])
    if liked.size < len(candidates):
        again_all = _one_after_the_other(searches, chosen, np.arange(len(candidates)))
        chosen = min([(value, chosen), *again_all], key=lambda end: end[0])[1]
    total = _information(rows, np.bincount(chosen, minlength=len(candidates)).astype(float), base)
    if _untold(total, criterion):
        raise ObservabilityError(
            f"{count} visits of these candidates do not determine what is asked for: allow more of them."
        )
    covariance = inverted(total)
    return ExactDesign(sorted(chosen.tolist()), covariance, float(criterion.value(covariance)), bound)


def refine_on_sphere(
    directions: Vectors, weights: Series, criterion: Criterion, *, known: Square | None = None
) -> Vectors:
    """Return the poses moved over the sphere, all at once, until no small move is better.

    Parameters
    ----------
    directions : (n, 3) unit vectors up to start from.
    weights : (n,) information of each pose's norm: one over its variance, over gravity squared.
    criterion : over the nine parameters of `tumble.design.candidates.PARAMETERS`.
    known : (9, 9) information that is there already.
    """
    from scipy.optimize import minimize

    from tumble.design.optimal_sets import rows_with_slope

    base = np.zeros((9, 9)) if known is None else known
    ridge = RIDGE * float(weights.sum()) * np.eye(9)

    def lost(values: Series) -> tuple[float, Series]:
        vectors = values.reshape(-1, 3)
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        up = vectors / lengths
        rows, by_direction = rows_with_slope(up)
        covariance = inverted(rows.T @ (weights[:, None] * rows) + base + ridge)
        value = float(criterion.smooth_value(covariance))
        by_row = -2.0 * weights[:, None] * (rows @ covariance @ criterion.slope(covariance) @ covariance)
        slope = np.einsum("pr,prc->pc", by_row, by_direction)
        across = (slope - up * np.sum(slope * up, axis=1, keepdims=True)) / lengths
        # The logarithm: whatever the weights' unit, the search's steps and its end are the same.
        return float(np.log(value)), across.ravel() / value

    end = minimize(lost, directions.ravel(), jac=True, method="BFGS", options={"maxiter": 1000, "gtol": 1e-7})
    moved = np.asarray(end.x, dtype=np.float64).reshape(-1, 3)
    return moved / np.linalg.norm(moved, axis=1, keepdims=True)


def find_on_sphere(
    count: int,
    criterion: Criterion,
    rng: np.random.Generator,
    *,
    known: Square | None = None,
    starts: int = 12,
) -> Vectors:
    """Return the best poses found anywhere on the sphere, (count, 3), alike in time: best of many refined starts.

    Parameters
    ----------
    count : poses.
    criterion : over the nine parameters of norms.
    rng : draws the starts.
    known : (9, 9) information that is there already, in units of a pose's.
    starts : the best end is returned, which may be a local one.

    Raises
    ------
    ObservabilityError
        If so many poses do not tell what is asked for.
    """
    base = np.zeros((9, 9)) if known is None else known
    weights = np.ones(count)
    best: tuple[float, Vectors] | None = None
    for _ in range(starts):
        drawn = rng.standard_normal((count, 3))
        found = refine_on_sphere(
            drawn / np.linalg.norm(drawn, axis=1, keepdims=True), weights, criterion, known=known
        )
        rows = pose_rows(found)
        total = rows.T @ rows + base
        if _untold(total, criterion):
            continue
        value = float(criterion.value(inverted(total + RIDGE * np.eye(9))))
        if best is None or value < best[0]:
            best = value, found
    if best is None:
        raise ObservabilityError(f"{count} poses do not determine what is asked for: allow more.")
    return best[1]


def require_told(rows: AnyArray, criterion: Criterion, known: Square | None = None) -> None:
    """Refuse candidates that all together do not tell a wanted parameter.

    Parameters
    ----------
    rows : (candidates, k, p), see `stacked_rows`.
    criterion : for what is wanted.
    known : (p, p) information that is there already.

    Raises
    ------
    ObservabilityError
        If they do not.
    """
    total = np.einsum("nki,nkj->ij", rows, rows) + (0.0 if known is None else known)
    if _untold(total, criterion):
        raise ObservabilityError(
            f"The {rows.shape[0]} candidates all together do not determine what is asked for: they "
            "are too alike."
        )


def _untold(information: Square, criterion: Criterion) -> bool:
    """Whether the ridge alone makes a wanted parameter's variance finite."""
    ridge = RIDGE * float(np.mean(np.diag(information)))
    covariance = inverted(information + ridge * np.eye(information.shape[0]))
    variances = np.diag(covariance)
    told = variances if criterion.name == "I" else variances[criterion.wanted]
    return bool(np.any(told * ridge > _UNTOLD))


def _information(rows: AnyArray, shares: Series, base: Square) -> Square:
    weighted = rows * shares[:, None, None]
    total = np.tensordot(weighted, rows, axes=([0, 1], [0, 1])) + base
    return np.asarray(
        total + RIDGE * float(np.mean(np.diag(total))) * np.eye(total.shape[0]), dtype=np.float64
    )


def _gains(rows: AnyArray, covariance: Square, slope: Square) -> Series:
    """What each candidate would take off the value: tr(C L C M_i)."""
    middle = covariance @ slope @ covariance
    return np.einsum("nki,ij,nkj->n", rows, middle, rows, optimize=True)


def _bound(rows: AnyArray, covariance: Square, criterion: Criterion, base: Square) -> float:
    """The equivalence theorem's: what was there already is in every design, and no candidate adds it."""
    slope = criterion.bounding_slope(covariance)
    value = float(np.sum(slope * covariance))
    already = float(np.sum((covariance @ slope @ covariance) * base))
    return value**2 / (float(np.max(_gains(rows, covariance, slope))) + already)


def _stepped(rows: AnyArray, shares: Series, base: Square, criterion: Criterion, towards: int) -> Series:
    """Give the best of some shares of the time to one candidate."""
    steps = np.array([0.0, 0.003, 0.01, 0.03, 0.1])
    now = _information(rows, shares, 0.0 * base)
    added = rows[towards].T @ rows[towards]
    tried = (1.0 - steps)[:, None, None] * now + steps[:, None, None] * added + base
    step = float(steps[int(np.argmin(criterion.smooth_value(_inverses(tried))))])
    moved = shares * (1.0 - step)
    moved[towards] += step
    return moved


def _start(
    rows: AnyArray,
    base: Square,
    count: int,
    liked: np.ndarray,
    rng: np.random.Generator,
    again: bool,
    *,
    drawn: float,
) -> np.ndarray:
    """Draw a share of the visits, and add those that tell most of what is least known."""
    first = rng.choice(liked, size=min(max(int(drawn * count), 1), liked.size), replace=False)
    chosen = first.tolist()
    total = base + np.einsum("nki,nkj->ij", rows[first], rows[first])
    ridge = 1e-4 * float(np.mean(rows**2)) * rows.shape[1] * np.eye(rows.shape[2])
    while len(chosen) < count:
        gains = _gains(rows[liked], inverted(total + ridge), np.eye(rows.shape[2]))
        if not again:
            gains[np.isin(liked, chosen)] = -1.0
        new = int(liked[int(gains.argmax())])
        chosen.append(new)
        total = total + rows[new].T @ rows[new]
    return np.array(chosen)


def _sharpened(criterion: Criterion) -> list[Criterion]:
    if criterion.name not in ("E", "minimax"):
        return [criterion]
    return [replace(criterion, sharpness=sharpness) for sharpness in SHARPER[:3]]


def _one_after_the_other(
    searches: Sequence[_Exchange], start: np.ndarray, liked: np.ndarray
) -> list[tuple[float, np.ndarray]]:
    """Ends of the searches, each from where the last one ended."""
    ends: list[tuple[float, np.ndarray]] = []
    for search in searches:
        ends.append(search.run(start, liked))
        start = ends[-1][1]
    return ends


class _Exchange:
    """Visits exchanged one by one for better ones."""

    def __init__(self, rows: AnyArray, base: Square, criterion: Criterion, again: bool) -> None:
        self._rows, self._base, self._criterion, self._again = rows, base, criterion, again

    def run(self, start: np.ndarray, liked: np.ndarray) -> tuple[float, np.ndarray]:
        """Exchange as long as that helps."""
        chosen = start.copy()
        value, improved = self._value(self.covariance(chosen)), True
        while improved:
            improved = False
            for place in range(chosen.size):
                covariance = self.covariance(chosen)
                tried = self._criterion.smooth_value(self._exchanged(covariance, int(chosen[place]), liked))
                tried = np.where(np.isfinite(tried) & (tried > 0.0), tried, np.inf)
                if not self._again:
                    tried[np.isin(liked, chosen)] = np.inf
                best = int(np.argmin(tried))
                if tried[best] < value * (1.0 - 1e-7):
                    before = chosen[place]
                    chosen[place] = liked[best]
                    now = self._value(self.covariance(chosen))
                    if now < value * (1.0 - 1e-9):
                        value, improved = now, True
                    else:  # an update of a nearly singular set, whose digits were lost
                        chosen[place] = before
        return float(self._criterion.value(self.covariance(chosen))), chosen

    def _value(self, covariance: Square) -> float:
        return float(self._criterion.smooth_value(covariance))

    def covariance(self, chosen: np.ndarray) -> Square:
        """Return that of these visits."""
        counts = np.bincount(chosen, minlength=self._rows.shape[0]).astype(float)
        return inverted(_information(self._rows, counts, self._base))

    def _exchanged(self, covariance: Square, out: int, liked: np.ndarray) -> AnyArray:
        """Covariances (liked, p, p) with each candidate in, then one visit out: never singular on the way."""
        added = _updated(np.broadcast_to(covariance, (liked.size, *covariance.shape)), self._rows[liked], 1.0)
        leaving = np.broadcast_to(self._rows[out], (liked.size, *self._rows[out].shape))
        return _updated(added, leaving, -1.0)


def _inverses(matrices: AnyArray) -> AnyArray:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)


def _updated(covariance: AnyArray, rows: AnyArray, sign: float) -> AnyArray:
    """Covariances after the observations `rows` (n, k, p) came or went (Woodbury)."""
    across = np.einsum("nij,nkj->nik", covariance, rows)
    inner = np.einsum("nki,nil->nkl", rows, across)
    inner = np.eye(rows.shape[1]) + sign * inner
    if rows.shape[1] == 1:
        inner = np.where(np.abs(inner) < 1e-12, 1e-12, inner)
        change = across * (1.0 / inner)
    else:
        inner = inner + 1e-12 * np.eye(rows.shape[1])
        change = across @ _inverses(inner)
    return covariance - sign * change @ np.swapaxes(across, -1, -2)


__all__: Sequence[str] = (
    "ApproximateDesign",
    "ExactDesign",
    "find_approximate",
    "find_exact",
    "find_on_sphere",
    "refine_on_sphere",
    "require_told",
)
