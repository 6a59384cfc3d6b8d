"""Biases that wander: what the rests of a thermal test have in common beside temperature, and how much of it.

A bias of low-cost sensors is never still: 1/f noise (flicker) makes neighbouring rests alike and rests hours apart
different. Over a thermal test, which takes hours, it is the largest of all errors. Two rests have the covariance

    F / (2 ln 2) mean of ln(T / |t - t'|) over both,

F the floor of the Allan variance (IEEE Std 952: F = (2 ln 2 / π) B²) and T the length of the test. It goes into the
adjustment in full. How large F is, and what single rests have beside it, the restricted likelihood determines
(Patterson and Thompson 1971): the likelihood of what the unknowns leave, so that what they take up is not missed.
Means over it are taken and not its maximum, which is at zero now and then though the biases do wander. The biases
would then be stated as if they were still.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.calibration.thermal.conditions import ThermalConditions
from tumble.calibration.thermal.points import ThermalPoints
from tumble.estimation import Conditions, Linearisation, Prior
from tumble.records import dataclass

TRIADS = {"force": slice(0, 3), "rate": slice(3, 6)}
# Shares of the variance of a rest that single rests have for themselves, the remainder flicker. Sensors have flicker:
# in the logarithm of the likelihood, scatter has to bring so much more (Akaike 1974).
SHARES = {0.0: 0.0, 0.5: 1.0, 1.0: 1.0}
# Sizes that are tried, in the rests' own noise; a root of them is believed as a half-Cauchy has it (Gelman 2006).
SIZES: Series = np.geomspace(1e-5, 1e8, 700)
# Rounding of a singular kernel: two rests at the same time are never given.
JITTER = 1e-9


@dataclass(frozen=True)
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


def _flicker_kernel(points: ThermalPoints) -> Square:
    """Return (rests, rests): the covariance of the means of flicker with F = 1 over rests.

    Exact means of ``ln(whole / |t - t'|) / (2 ln 2)`` over both rests.
    """
    start, stop = points.start, points.stop
    whole = max(float(points.path.time[-1] - points.path.time[0]), 1e-9)

    def twice_integrated(first: Series, last: Series) -> AnyArray:
        size = np.maximum(np.abs(last[:, None] - first[None]), 1e-12)
        return 0.5 * size**2 * np.log(size / whole) - 0.75 * size**2

    # The integral of k(t - t') over two intervals from the second antiderivative of k at their ends.
    summed = twice_integrated(start, stop) - twice_integrated(stop, stop)
    summed = summed - twice_integrated(start, start) + twice_integrated(stop, start)
    length = np.maximum(stop - start, 1e-9)
    kernel = -summed / (length[:, None] * length[None]) / (2.0 * np.log(2.0))
    symmetric: Square = 0.5 * (kernel + kernel.T)
    return symmetric


def _noise_of(conditions: ThermalConditions, name: str) -> AnyArray:
    """Return (points, 3, 3): how a rest's noise enters its equations."""
    if name == "force":
        return conditions.force_noise
    return np.broadcast_to(np.eye(3), (len(conditions.points), 3, 3))


class WanderingConditions(Conditions):
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
        misclosure = linear.misclosure.ravel()
        design = linear.design.reshape(misclosure.size, -1)
        for at, inverse in self._roots:
            misclosure[at], design[at] = inverse @ misclosure[at], inverse @ design[at]
        one = np.broadcast_to(np.eye(6), (len(linear.active), 6, 6))
        shape = linear.active.shape
        misclosure, design = misclosure.reshape(shape), design.reshape(*shape, -1)
        return Linearisation(misclosure, design, one, linear.active)

    def _factored(self, linear: Linearisation) -> list[tuple[np.ndarray, AnyArray]]:
        """Return the rows of each independent block with the inverse root of its covariance."""
        roots: list[tuple[np.ndarray, AnyArray]] = []
        for name in TRIADS:
            for block in blocks_of(self.inner, linear, name):
                root = np.linalg.cholesky(block.own + self.levels.flicker[name] * block.flicker)
                roots.append((block.rows, np.asarray(np.linalg.inv(root), dtype=np.float64)))
        return roots


@dataclass(frozen=True)
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
    active, own = linear.active[:, columns], linear.covariance[:, columns, columns]
    if not np.any(active):
        return []
    kernel, noise = _flicker_kernel(points), _noise_of(conditions, name)
    kernel = kernel + JITTER * float(np.max(np.diag(kernel))) * np.eye(len(points))
    apart = ~np.eye(3, dtype=bool)
    couples = np.any(own[:, apart] != 0.0) or np.any(noise[:, apart] != 0.0)
    found: list[Block] = []
    for group in [np.ones(3, dtype=bool)] if couples else list(~apart):
        point, axis = np.nonzero(active & group)
        if point.size:
            rows, here = 6 * point + axis + columns.start, noise[point, axis]
            of_own = own[point[:, None], axis[:, None], axis[None]]
            of_own = np.where(point[:, None] == point[None], of_own, 0.0)
            shared = kernel[np.ix_(point, point)] * (here @ here.T)
            found.append(Block(rows, of_own, shared, np.sum(here**2, axis=1)))
    return found


def wander_variance(conditions: ThermalConditions, levels: Levels) -> AnyArray:
    """Return (points, 6) the variance of flicker alone in each equation, rows of specific force first.

    Parameters
    ----------
    conditions : whose noise goes into a norm as it does in the last linearisation.
    levels : of the flicker.
    """
    own = np.diag(_flicker_kernel(conditions.points))[:, None]
    squares = {name: np.sum(_noise_of(conditions, name) ** 2, axis=2) for name in TRIADS}
    return np.concatenate([own * squares[name] * levels.flicker[name] for name in TRIADS], axis=1)


def find_levels(conditions: ThermalConditions, values: Series, prior: Prior) -> Levels:
    """Return how much biases wander, as the restricted likelihood lets one expect.

    Parameters
    ----------
    conditions : with the rows that take part.
    values : of the unknowns, near the estimate.
    prior : of the unknowns; those that it knows are random, with its variance.
    """
    extra = conditions.extra
    conditions.extra = {"force": 0.0, "rate": 0.0}
    try:
        linear = conditions.linearise(values)
    finally:
        conditions.extra = extra
    found = Levels()
    for name in TRIADS:
        parts = [_prepared(block, linear, values, prior) for block in blocks_of(conditions, linear, name)]
        if parts := [part for part in parts if part.misclosure.size]:
            found.single[name], found.flicker[name], found.freedom[name] = _expected(parts)
    return found


def _expected(parts: list[_Part]) -> tuple[float, float, float]:
    """Return (single, flicker, degrees of freedom), means over all mixtures and sizes by their likelihood."""
    white = sum(float(np.trace(part.white)) for part in parts)
    own = sum(float(np.trace(part.own)) for part in parts) / white
    flicker = own * white / sum(float(np.trace(part.flicker)) for part in parts)
    mixtures = [(share * own, (1.0 - share) * flicker) for share in SHARES]
    cost = np.array([sum(part.cost(*mixture) for part in parts) for mixture in mixtures])
    # Flat in the logarithm of the size, times the half-Cauchy of its root.
    log_weight = -0.5 * cost + 0.5 * np.log(SIZES) - np.log1p(SIZES)
    log_weight = log_weight - np.array(list(SHARES.values()))[:, None]
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    by_size, by_mixture = weight.sum(axis=0), weight @ SIZES
    mean = float(by_mixture.sum())
    spread = float(by_size @ SIZES**2) - mean**2
    levels = by_mixture @ np.array(mixtures)
    return float(levels[0]), float(levels[1]), max(2.0 * mean**2 / spread, 1.0)


@dataclass(frozen=True)
class _Part:
    """What a block shows beside its unknowns: misclosure, and covariance of each cause (Patterson, Thompson)."""

    misclosure: Series
    own: Square
    white: Square
    flicker: Square

    def cost(self, single: float, flicker: float) -> Series:
        """Return (sizes,) minus twice the log likelihood of each multiple of a pair, without its constant."""
        from scipy.linalg import eigh

        share, axes = eigh(single * self.white + flicker * self.flicker, self.own)
        grown = 1.0 + np.maximum(share, 0.0)[:, None] * SIZES
        seen = axes.T @ self.misclosure
        total: Series = np.sum(np.log(grown) + (seen**2)[:, None] / grown, axis=0)
        return total


def _prepared(block: Block, linear: Linearisation, values: Series, prior: Prior) -> _Part:
    precision = np.diag(prior.precision)
    known, design = precision > 0.0, linear.design.reshape(-1, values.size)[block.rows]
    random, seen = design[:, known], _independent(design[:, ~known])
    misclosure = linear.misclosure.reshape(-1)[block.rows] + random @ (prior.mean - values)[known]
    covariance = block.own + (random / precision[known]) @ random.T
    beside = np.linalg.qr(seen, mode="complete")[0][:, seen.shape[1] :]
    inner = (beside.T @ of @ beside for of in (covariance, np.diag(block.white), block.flicker))
    return _Part(beside.T @ misclosure, *inner)


def _independent(design: AnyArray) -> AnyArray:
    """Return orthonormal columns that span the design's: what of it this block shows at all."""
    size = np.linalg.norm(design, axis=0)
    seen = design[:, size > 0.0] / size[size > 0.0]
    if not seen.shape[1]:
        return seen
    left, strength, _ = np.linalg.svd(seen, full_matrices=False)
    return left[:, strength > 1e-9 * strength[0]]
