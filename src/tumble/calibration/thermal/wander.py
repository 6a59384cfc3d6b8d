"""Biases that wander: what the rests of a thermal test have in common beside temperature, and how much of it.

A bias of low-cost sensors is never still: 1/f noise (flicker) makes neighbouring rests alike and rests hours apart
different. Over a thermal test, which takes hours, it is the largest of all errors. Two rests have the covariance

    F / (2 ln 2) mean of ln(T / |t - t'|) over both,

F the floor of the Allan variance (IEEE Std 952: F = (2 ln 2 / π) B²) and T the length of the test. It goes into the
adjustment in full. How large F is, and what single rests have beside it, restricted maximum likelihood tells
(Patterson and Thompson 1971): the likelihood of what the unknowns leave, so that what they take up is not missed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.calibration.thermal.conditions import ThermalConditions
from tumble.estimation import Linearisation, Prior

TRIADS = {"force": slice(0, 3), "rate": slice(3, 6)}
# Start of the search, the share of what either alone would be that is taken for scatter from rest to rest.
SHARE = 0.3
# Either side of the most likely logarithm, to tell how it bends.
BENT = 0.5
# In twice the log likelihood, what one more level has to bring (Akaike 1974).
ONE_MORE = 2.0
# Rounding of a singular kernel: two rests at the same time are never given.
JITTER = 1e-9


@dataclass(frozen=True, slots=True)
class Levels:
    """Variance beyond the rests' own noise, by triad ("force", "rate"), in near SI units squared.

    Attributes
    ----------
    single : of each rest for itself.
    flicker : F, the floor of the Allan variance.
    freedom : degrees of freedom of what was found; infinite where nothing was.
    """

    single: dict[str, float] = field(default_factory=lambda: {"force": 0.0, "rate": 0.0})
    flicker: dict[str, float] = field(default_factory=lambda: {"force": 0.0, "rate": 0.0})
    freedom: dict[str, float] = field(default_factory=lambda: {"force": np.inf, "rate": np.inf})


def flicker_kernel(start: Series, stop: Series, whole: float) -> Square:
    """Return (rests, rests): the covariance of the means of flicker with F = 1 over rests.

    Exact means of ``ln(whole / |t - t'|) / (2 ln 2)`` over both rests.

    Parameters
    ----------
    start, stop : s.
    whole : s, the length of the test.
    """

    def twice_integrated(x: AnyArray) -> AnyArray:
        size = np.maximum(np.abs(x), 1e-12)
        return 0.5 * size**2 * np.log(size / whole) - 0.75 * size**2

    length = np.maximum(stop - start, 1e-9)
    # The integral of k(t - t') over two intervals from the second antiderivative of k at their ends.
    summed = (
        twice_integrated(stop[:, None] - start[None])
        - twice_integrated(stop[:, None] - stop[None])
        - twice_integrated(start[:, None] - start[None])
        + twice_integrated(start[:, None] - stop[None])
    )
    kernel = -summed / (length[:, None] * length[None]) / (2.0 * np.log(2.0))
    symmetric: Square = 0.5 * (kernel + kernel.T)
    return symmetric


class WanderingConditions:
    """`Conditions` of a thermal test with biases that wander: equations made independent of one another.

    The rows of `ThermalConditions` are multiplied by the inverse root of their whole covariance, which leaves as many
    rows of variance one.

    Parameters
    ----------
    inner : the equations; their own covariance has the levels of single rests in it.
    levels : of the flicker.
    """

    def __init__(self, inner: ThermalConditions, levels: Levels) -> None:
        self.inner, self.levels = inner, levels
        inner.extra = dict(levels.single)
        self._roots: list[tuple[np.ndarray, AnyArray]] | None = None

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`, with independent rows."""
        linear = self.inner.linearise(parameters)
        if self._roots is None:
            self._roots = self._factored(linear)
        rows, unknowns = linear.active.size, linear.design.shape[2]
        misclosure = linear.misclosure.reshape(rows).copy()
        design = linear.design.reshape(rows, unknowns).copy()
        for at, inverse in self._roots:
            misclosure[at] = inverse @ misclosure[at]
            design[at] = inverse @ design[at]
        shape = linear.active.shape
        one = np.repeat(np.eye(shape[1])[None], shape[0], axis=0)
        return Linearisation(
            misclosure.reshape(shape), design.reshape(*shape, unknowns), one, None, linear.active
        )

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Means are known so well that a second order in their noise is nothing."""

    def _factored(self, linear: Linearisation) -> list[tuple[np.ndarray, AnyArray]]:
        """Return the rows of each independent block with the inverse root of its covariance."""
        roots: list[tuple[np.ndarray, AnyArray]] = []
        for name in TRIADS:
            for block in blocks_of(self.inner, linear, name):
                covariance = block.own + self.levels.flicker[name] * block.flicker
                roots.append((block.rows, np.asarray(np.linalg.inv(_root(covariance)), dtype=np.float64)))
        return roots


@dataclass(frozen=True, slots=True)
class Block:
    """Rows that have noise in common.

    Attributes
    ----------
    rows : (rows,) of the flattened (points, 6).
    own, flicker : (rows, rows) covariance of the rests' own noise, and of flicker with F = 1.
    white : (rows,) variance per unit of variance of single rests.
    """

    rows: np.ndarray
    own: AnyArray
    flicker: AnyArray
    white: AnyArray


def blocks_of(conditions: ThermalConditions, linear: Linearisation, name: str) -> list[Block]:
    """Return the rows of a triad, by axis where nothing couples the axes.

    Parameters
    ----------
    conditions, linear : the equations, and the same in linear form.
    name : "force" or "rate".
    """
    points, columns = conditions.points, TRIADS[name]
    active = linear.active[:, columns]
    if not np.any(active):
        return []
    whole = float(points.path.time[-1] - points.path.time[0])
    kernel = flicker_kernel(points.start, points.stop, max(whole, 1e-9))
    kernel = kernel + JITTER * float(np.max(np.diag(kernel))) * np.eye(len(points))
    straight = np.repeat(np.eye(3)[None], len(points), axis=0)
    noise = conditions.force_noise if name == "force" else straight
    own = linear.covariance[:, columns, columns]
    apart = np.eye(3, dtype=bool)
    couples = np.any(own[:, ~apart] != 0.0) or np.any(noise[:, ~apart] != 0.0)
    groups = [np.ones(3, dtype=bool)] if couples else [apart[k] for k in range(3)]
    found: list[Block] = []
    for group in groups:
        point, axis = np.nonzero(active & group)
        if not point.size:
            continue
        same = point[:, None] == point[None]
        shared = noise[point, axis] @ noise[point, axis].T
        found.append(
            Block(
                6 * point + axis + columns.start,
                np.where(same, own[point[:, None], axis[:, None], axis[None]], 0.0),
                kernel[np.ix_(point, point)] * shared,
                np.sum(noise[point, axis] ** 2, axis=1),
            )
        )
    return found


def wander_variance(conditions: ThermalConditions, levels: Levels) -> AnyArray:
    """Return (points, 6) the variance of flicker alone in each equation, rows of specific force first.

    Parameters
    ----------
    conditions : whose noise goes into a norm as it does in the last linearisation.
    levels : of the flicker.
    """
    points = conditions.points
    whole = max(float(points.path.time[-1] - points.path.time[0]), 1e-9)
    own = np.diag(flicker_kernel(points.start, points.stop, whole))[:, None]
    force = np.sum(conditions.force_noise**2, axis=2) * levels.flicker["force"]
    rate = np.full((len(points), 3), levels.flicker["rate"])
    return np.concatenate([own * force, own * rate], axis=1)


def find_levels(
    conditions: ThermalConditions, values: Series, prior: Prior, start: dict[str, float]
) -> Levels:
    """Return how much biases wander, by restricted maximum likelihood.

    Parameters
    ----------
    conditions : with the rows that take part.
    values : of the unknowns, near the estimate.
    prior : of the unknowns; those that it knows are random, with its variance.
    start : variance of single rests beyond their noise, by triad, if neighbours had nothing in common.
    """
    extra = conditions.extra
    conditions.extra = {"force": 0.0, "rate": 0.0}
    try:
        linear = conditions.linearise(values)
    finally:
        conditions.extra = extra
    found = Levels()
    for name in TRIADS:
        if start.get(name, 0.0) > 0.0 and (blocks := blocks_of(conditions, linear, name)):
            levels = _most_likely(blocks, linear, values, prior, start[name])
            found.single[name], found.flicker[name], found.freedom[name] = levels
    return found


def _most_likely(
    blocks: list[Block], linear: Linearisation, values: Series, prior: Prior, excess: float
) -> tuple[float, float, float]:
    """Return (single, flicker, degrees of freedom), the most likely; one zero where two bring too little more."""
    from scipy.optimize import minimize, minimize_scalar

    parts = [_prepared(block, linear, values, prior) for block in blocks]
    spread = float(np.mean([np.mean(np.diag(b.flicker)) for b in blocks]))

    def cost(single: float, flicker: float) -> float:
        try:
            return sum(part.cost(single, flicker) for part in parts)
        except np.linalg.LinAlgError:
            return np.inf

    def least(single: float, flicker: float) -> tuple[float, float]:
        """Return (cost, factor) of the most likely multiple of a pair."""
        found = minimize_scalar(
            lambda x: cost(single * float(np.exp(x)), flicker * float(np.exp(x))),
            bounds=(-4.0, 4.0),
            method="bounded",
            options={"xatol": 0.05, "maxiter": 16},
        )
        return float(found.fun), float(np.exp(found.x))

    scattered, by_rest = least(excess, 0.0)
    wandering, by_flicker = least(0.0, excess / spread)
    # Sensors have flicker: of scatter alone it is believed where it is plainly likelier.
    if scattered < wandering - ONE_MORE:
        best = (scattered, by_rest * excess, 0.0)
    else:
        best = (wandering, 0.0, by_flicker * excess / spread)
    if cost(0.0, 0.0) < best[0] + ONE_MORE:
        return 0.0, 0.0, np.inf
    begin = np.log([SHARE * by_rest * excess, (1.0 - SHARE) * by_flicker * excess / spread])
    both = minimize(
        lambda x: cost(float(np.exp(x[0])), float(np.exp(x[1]))),
        begin,
        method="Nelder-Mead",
        options={"xatol": 0.05, "fatol": 0.02, "maxfev": 40, "initial_simplex": begin + _SIMPLEX},
    )
    # Two levels where they are more likely by what a level costs: else a chance would halve the flicker.
    if float(both.fun) < best[0] - ONE_MORE:
        best = (float(both.fun), *(float(value) for value in np.exp(both.x)))
    # Twice the log likelihood of a variance bends by its degrees of freedom over its logarithm.
    aside = cost(best[1] * np.exp(BENT), best[2] * np.exp(BENT)) + cost(
        best[1] * np.exp(-BENT), best[2] * np.exp(-BENT)
    )
    return best[1], best[2], max((aside - 2.0 * best[0]) / BENT**2, 1.0)


_SIMPLEX = np.array([[0.0, 0.0], [-1.5, 0.0], [0.0, -1.0]])


@dataclass(frozen=True, slots=True)
class _Part:
    """A block's misclosure, the design of what is not known beforehand, and its covariances."""

    misclosure: AnyArray
    design: AnyArray
    known: AnyArray
    block: Block

    def cost(self, single: float, flicker: float) -> float:
        """Return minus twice the restricted log likelihood, without its constant."""
        covariance = self.known + single * np.diag(self.block.white) + flicker * self.block.flicker
        root = _root(covariance)
        both = _solved(root, np.column_stack([self.misclosure, self.design]))
        w, A = both[:, 0], both[:, 1:]
        total = 2.0 * float(np.sum(np.log(np.diag(root)))) + float(w @ w)
        if A.shape[1]:
            q, r = np.linalg.qr(A)
            total += 2.0 * float(np.sum(np.log(np.abs(np.diag(r))))) - float(np.sum((q.T @ w) ** 2))
        return total


def _prepared(block: Block, linear: Linearisation, values: Series, prior: Prior) -> _Part:
    unknowns = values.size
    design = linear.design.reshape(-1, unknowns)[block.rows]
    misclosure = linear.misclosure.reshape(-1)[block.rows]
    precision = np.diag(prior.precision)
    known = precision > 0.0
    random = design[:, known]
    misclosure = misclosure + random @ (prior.mean - values)[known]
    covariance = block.own + (random / precision[known]) @ random.T
    return _Part(misclosure, _independent(design[:, ~known]), covariance, block)


def _independent(design: AnyArray) -> AnyArray:
    """Return orthonormal columns that span the design's: what of it this block shows at all."""
    size = np.linalg.norm(design, axis=0)
    seen = design[:, size > 0.0] / size[size > 0.0]
    if not seen.shape[1]:
        return seen
    left, strength, _ = np.linalg.svd(seen, full_matrices=False)
    return left[:, strength > 1e-9 * strength[0]]


def _root(covariance: AnyArray) -> AnyArray:
    return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


def _solved(root: AnyArray, right: AnyArray) -> AnyArray:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(root, right, lower=True, check_finite=False), dtype=np.float64)
