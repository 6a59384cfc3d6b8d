"""A triad that is shown known vectors, by a unit that is placed with an uncertainty.

Reading k is ``raw_k = matrix @ true_k + bias + noise_k``. The true vector is the nominal one of the
pose, off by the small rotation theta_k with which the unit was really placed, sigma_k about each axis:

    true_k = nominal_k - theta_k x nominal_k + second order,

a covariance ``sigma_k² (|r|² I - r r')`` with r the nominal vector. Along r a tilt acts to second
order only: cos(theta) is below one by sigma_k² on average, with the standard deviation sigma_k².
Which direction of a reading that is depends on the matrix, whose elements are off by the placement too:
of the first-order part as much again, sigma_k² |r|, leaks into it.

The twelve unknowns, matrix (rows) and bias, are those of the improved six-position test (Hayal 2010,
2.7 to 2.12), with weights. Its least squares (2.11) treats every element of every reading alike; here a
sensor across gravity, whose reading a tilt moves to first order, weighs less than one along it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.errors import ObservabilityError
from tumble.estimation import Adjustment, Linearisation, adjust, critical_value, snoop_groups
from tumble.estimation.crossing import crossing
from tumble.records import dataclass

UNKNOWNS = 12
# Chance of finding a placement worse than stated in poses that are as stated.
EXCESS_FALSE_ALARM = 0.01
# Chance that any right pose is said to contradict the others alone.
APART_FALSE_ALARM = 0.01
# Poses whose tests are as alike are checked by one another only.
ALIKE = 0.9
# At most this share of the poses is told apart from the others.
LARGEST_SHARE_APART = 0.25
# A placement beyond so many times the stated one was not what was stated; from so many checks on it is found well
# enough to go by it all the same (its sigma is known to a fifth).
WORST_STATEMENT, ENOUGH_CHECKS = 3.0, 12
# Beyond 11 degrees a pose is another pose.
LARGEST_PLACEMENT = 0.2


@dataclass(frozen=True, slots=True)
class PlacedReadings:
    """Readings of one triad in nominal poses.

    Attributes
    ----------
    observed, covariance : (readings, 3), (readings, 3, 3) means and their noise, raw.
    nominal : (readings, 3) the vectors that the poses should show, SI, in the fixture's axes.
    sigma : (readings,) rad, standard uncertainty of the placement about each axis.
    """

    observed: Vectors
    covariance: Matrices
    nominal: Vectors
    sigma: Series

    def with_placement(self, added: float) -> PlacedReadings:
        """Return the readings with `added` (rad) joined to every placement sigma."""
        return replace(self, sigma=np.hypot(self.sigma, added))


class PlacementConditions:
    """Three conditions a reading: `Conditions` for the adjustment, in raw units.

    Parameters
    ----------
    readings : see there.
    matrix : that the placement's covariance is seen through; it stays as the unknowns move.
    """

    def __init__(self, readings: PlacedReadings, matrix: Matrix) -> None:
        self.readings = readings
        self._covariance = readings.covariance + placement_covariance(readings, matrix)
        n = readings.nominal.shape[0]
        self._design = np.zeros((n, 3, UNKNOWNS))
        for i in range(3):
            self._design[:, i, 3 * i : 3 * i + 3] = readings.nominal
            self._design[:, i, 9 + i] = 1.0

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise, which these conditions are."""
        misclosure = self._design @ parameters - self.readings.observed
        active = np.ones(misclosure.shape, dtype=bool)
        return Linearisation(misclosure, self._design, self._covariance, None, active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Do nothing: the conditions are linear in the observations."""


def placement_covariance(readings: PlacedReadings, matrix: Matrix) -> Matrices:
    """Return (readings, 3, 3) raw: what the placement adds to each reading's covariance."""
    r, variance = readings.nominal, readings.sigma**2
    along = np.einsum("ka,kb->kab", r, r)
    across = np.einsum("ka,ka->k", r, r)[:, None, None] * np.eye(3) - along
    # 2: the tilt's own second order and the leak, equal in size and independent.
    moved = variance[:, None, None] * across + 2.0 * (variance**2)[:, None, None] * along
    return matrix @ moved @ matrix.T


@dataclass(frozen=True, slots=True)
class PlacedFit:
    """A triad adjusted to placed readings.

    Attributes
    ----------
    matrix, bias : raw per SI unit, in the fixture's axes; raw.
    covariance : (12, 12) of the matrix (by rows) and the bias: second moments about the truth, the
        mean shift by second-order tilts included.
    alone : root of the variance of unit weight with the placement as stated.
    added : rad, placement found beyond what was stated, joined to it; zero unless significant.
    readings : with the placement that was used.
    adjustment : the last one.
    apart : readings that alone contradict the others by more than was stated; their placement has what they show.
    stated : (readings,) rad, the placement as stated.
    """

    matrix: Matrix
    bias: Vector
    covariance: Square
    alone: float
    added: float
    readings: PlacedReadings
    adjustment: Adjustment
    apart: tuple[int, ...]
    stated: Series

    @property
    def is_beyond_statement(self) -> bool:
        """Whether the placement is several times what was stated, by so few checks that it is itself hardly known."""
        stated = float(np.sqrt(np.mean(self.stated**2)))
        return self.has_few_checks and stated > 0.0 and self.added > WORST_STATEMENT * stated

    @property
    def has_few_checks(self) -> bool:
        """Whether what the poses say of one another is not enough to go by."""
        return self.adjustment.redundancy < ENOUGH_CHECKS


def fit_placed(readings: PlacedReadings) -> PlacedFit:
    """Adjust matrix and bias to placed readings; find the placement where it is worse than stated.

    Where the residuals with the placement as stated are larger than chance allows (1 %), the poses that alone explain
    it get the placement that they show. If none does, a common placement sigma is added in quadrature so that the
    residuals are as large as they should be.

    Raises
    ------
    ObservabilityError
        If the poses do not determine twelve unknowns.
    ConvergenceError
        If the adjustment fails.
    """
    design = np.column_stack([readings.nominal, np.ones(readings.nominal.shape[0])])
    size = float(np.max(np.abs(readings.nominal)))
    scaled = design / np.array([size, size, size, 1.0])
    if np.linalg.matrix_rank(scaled, tol=1e-3) < 4:
        raise ObservabilityError(
            "The poses do not determine all of the matrix and the bias. At least four are needed: up "
            "along three different axes, and one of them the other way up too."
        )
    start = plain_least_squares(readings.nominal, readings.observed)
    adjustment = _adjust(readings, start)
    alone, stated = adjustment.sigma0, readings.sigma
    readings, adjustment, apart = _told_apart(readings, adjustment)
    added = _added_placement(readings, adjustment)
    if added > 0.0:
        readings = readings.with_placement(added)
        adjustment = _adjust(readings, adjustment.parameters)
    matrix = adjustment.parameters[:9].reshape(3, 3)
    covariance = adjustment.cofactor + _second_order_shift(readings, adjustment, matrix)
    bias = adjustment.parameters[9:].copy()
    return PlacedFit(matrix, bias, covariance, alone, added, readings, adjustment, apart, stated)


def _told_apart(
    readings: PlacedReadings, adjustment: Adjustment
) -> tuple[PlacedReadings, Adjustment, tuple[int, ...]]:
    """Give poses that contradict the others the placement that they show; none if that does not explain all."""
    changed, trial = readings, adjustment
    apart: list[int] = []
    count = len(readings.sigma)
    while is_excessive(trial.square_sum, trial.redundancy):
        worst = _worst(trial, apart)
        if not worst or len({*apart, *worst}) > max(LARGEST_SHARE_APART * count, 2):
            return readings, adjustment, ()
        apart += worst
        loose = replace(
            changed, sigma=np.where(np.isin(np.arange(count), apart), LARGEST_PLACEMENT, readings.sigma)
        )
        trial = _adjust(loose, trial.parameters)
        tilt = _tilts(loose, trial)
        # Two that are checked by one another only share what they differ by.
        shown = np.where(np.isin(np.arange(count), worst), tilt * np.sqrt(len(worst)), 0.0)
        changed = replace(changed, sigma=np.hypot(changed.sigma, shown))
        trial = _adjust(changed, trial.parameters)
    return changed, trial, tuple(sorted(apart))


def _worst(adjustment: Adjustment, before: Sequence[int]) -> list[int]:
    """Return the reading that contradicts the others most, with those that nothing tells from it."""
    tests = [t for t in snoop_groups(adjustment, slice(0, 3)) if t.degrees and t.group not in before]
    if not tests:
        return []
    worst = max(tests, key=lambda test: test.statistic)
    if worst.statistic < critical_value(worst.degrees, len(tests), APART_FALSE_ALARM):
        return []
    return [test.group for test in tests if test.statistic >= ALIKE * worst.statistic]


def _tilts(readings: PlacedReadings, adjustment: Adjustment) -> Series:
    """Return (readings,) rad, by how much each reading lies across where the fit has it."""
    inverse = inverted(adjustment.parameters[:9].reshape(3, 3))
    off = adjustment.residual @ inverse.T
    size = np.linalg.norm(readings.nominal, axis=1)
    along = np.einsum("ki,ki->k", off, readings.nominal) / size
    return np.asarray(np.sqrt(np.maximum(np.sum(off**2, axis=1) - along**2, 0.0)) / size, dtype=np.float64)


def _adjust(readings: PlacedReadings, start: Series) -> Adjustment:
    """Adjust until the matrix that the covariance is seen through is the estimate's own, or all but it."""
    adjustment = adjust(PlacementConditions(readings, start[:9].reshape(3, 3)), start)
    for _ in range(2):
        start = adjustment.parameters
        adjustment = adjust(PlacementConditions(readings, start[:9].reshape(3, 3)), start)
    return adjustment


def plain_least_squares(nominal: Vectors, observed: Vectors) -> Series:
    """Return matrix (by rows) and bias by Hayal's 2.11: least squares without weights.

    Parameters
    ----------
    nominal, observed : (readings, 3) vectors that the poses should show, SI, and the raw readings.
    """
    design = np.column_stack([nominal, np.ones(nominal.shape[0])])
    solution: AnyArray = np.asarray(np.linalg.lstsq(design, observed, rcond=None)[0], dtype=np.float64)
    return np.concatenate([solution[:3].T.ravel(), solution[3]])


def _added_placement(readings: PlacedReadings, adjustment: Adjustment) -> float:
    def square_sum(added: float) -> float:
        conditions = PlacementConditions(readings.with_placement(added), matrix)
        return adjust(conditions, adjustment.parameters).square_sum

    matrix = adjustment.parameters[:9].reshape(3, 3)

    if not is_excessive(adjustment.square_sum, adjustment.redundancy):
        return 0.0
    return find_added_sigma(square_sum, adjustment.redundancy, 1e-8, LARGEST_PLACEMENT)


def is_excessive(square_sum: float, redundancy: int) -> bool:
    """Return whether chance gives so large a square sum of residuals in fewer than 1 % of cases."""
    from scipy.special import chdtrc

    return redundancy > 0 and float(chdtrc(redundancy, square_sum)) < EXCESS_FALSE_ALARM


def find_added_sigma(
    square_sum: Callable[[float], float], redundancy: int, least: float, largest: float
) -> float:
    """Return the sigma that, added to the noise, brings a square sum to its expectation.

    Parameters
    ----------
    square_sum : of the residuals by their covariance, with that sigma added; falls as it grows.
    redundancy : its expectation.
    least, largest : where to look; returned if the answer lies beyond.

    References
    ----------
    R. C. Paule, J. Mandel, Consensus values and weighting factors, J. Res. NBS 87 (1982) 377-385.
    """

    def excess(logarithm: float) -> float:
        return float(np.log(max(square_sum(float(np.exp(logarithm))), 1e-300) / redundancy))

    low, high = float(np.log(least)), float(np.log(largest))
    if (at_high := excess(high)) >= 0.0:
        return largest
    if (at_low := excess(low)) <= 0.0:
        return least
    # A thousandth of itself: the sigma is told to some per cent at best.
    return float(np.exp(crossing(excess, low, high, (at_low, at_high), 1e-3)))


def _second_order_shift(readings: PlacedReadings, adjustment: Adjustment, matrix: Matrix) -> Square:
    """Return what the mean shift of the readings, -sigma² M r, adds to the second moments."""
    shift = -(readings.sigma**2)[:, None] * (readings.nominal @ matrix.T)
    weighted = adjustment.chain.solve(shift[:, :, None])[:, :, 0]
    moved: AnyArray = adjustment.cofactor @ np.einsum("gsp,gs->p", adjustment.linearisation.design, weighted)
    return np.outer(moved, moved)


def up_down_pair(up: float, down: float, reference: float) -> tuple[float, float]:
    """Return bias and scale factor of a sensor shown a vector up and down its axis (Hayal 2.5, 2.6).

    The scale factor is raw per SI unit; Hayal's S is it minus one.

    Parameters
    ----------
    up, down : raw readings.
    reference : the vector's component along the axis when it points up, SI.

    Examples
    --------
    >>> bias, scale = up_down_pair(10.5, -9.5, 10.0)
    >>> bias, scale
    (0.5, 1.0)
    """
    return 0.5 * (up + down), 0.5 * (up - down) / reference
