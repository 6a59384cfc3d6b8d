"""How Allan variances at several averaging times are spread, and spread together, for a model of the noise.

For Gaussian noise the covariance of two averages of squared second differences is twice the mean square of
the differences' own covariances, over all pairs of places. Those follow from the model in closed form. The
Haar wavelet variance is half the Allan variance, so this is its covariance as well.

References
----------
Greenhall and Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003, for one
averaging time. Guerrier et al., "Wavelet-variance-based estimation for composite stochastic processes",
Journal of the American Statistical Association 108 (2013), for the estimator that weighs by it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.noise.terms import NoiseModel
from tumble.noise.variances import markov_phase_covariance, phase_covariance_of

_WANDERING = ("Q", "N", "B", "K")
_DIFFERENCE = (1.0, -2.0, 1.0)
# Lags at which covariances are taken lie this factor apart, from a place where they have a corner.
_GRADING = 1.4
# Correlation times for which a process' covariances are kept: so many in each natural logarithm, and in all.
_TIMES = 20.0
_KEPT = 64


class AllanCovariance:
    """Covariances of the overlapping Allan variances of a signal's pieces, for any model of its noise.

    Parameters
    ----------
    averaging : samples of each averaging time, increasing.
    rate : Hz.
    lengths : samples of each piece without gaps.
    """

    def __init__(self, averaging: tuple[int, ...], rate: float, lengths: tuple[int, ...]) -> None:
        self.averaging = averaging
        self.rate = rate
        self.counts = np.array([_count(m, lengths) for m in averaging], dtype=float)
        alike, repeats = np.unique(np.array(lengths), return_counts=True)
        size = len(averaging)
        places: list[tuple[AnyArray, Series, AnyArray]] = []
        self._squares = np.zeros((len(_WANDERING), len(_WANDERING), size, size))
        self._sums = np.zeros((len(_WANDERING), size, size))
        for i in range(size):
            for j in range(i, size):
                lag = _lags(averaging[i], averaging[j], max(lengths))
                weight = _weights(lag, averaging[i], averaging[j], alike.astype(float), repeats.astype(float))
                weight = weight / (self.counts[i] * self.counts[j])
                gamma = np.array([self._of_letter(letter, i, j, lag) for letter in _WANDERING])
                squares = 2.0 * (gamma * weight) @ gamma.T
                self._squares[:, :, i, j] = self._squares[:, :, j, i] = squares
                self._sums[:, i, j] = self._sums[:, j, i] = gamma @ weight
                places.append((lag, weight, gamma))
        # all pairs of averaging times in one row, for processes whose covariances are not known beforehand
        self._lags = [lag for lag, _, _ in places]
        self._weight = np.concatenate([weight for _, weight, _ in places])
        self._gamma = np.concatenate([gamma for _, _, gamma in places], axis=1)
        self._begins = np.cumsum([0, *(len(lag) for lag in self._lags)])[:-1]
        self._markov: dict[int, Series] = {}

    def of(self, model: NoiseModel) -> Square:
        """Return the covariance (taus, taus), the signal's unit to the fourth; lines are taken as removed.

        Parameters
        ----------
        model : of the noise. Its ramp is a slope of that size: it has no spread, but adds to that of others.
        """
        power = np.array([model.coefficients[letter] ** 2 for letter in _WANDERING])
        total = np.einsum("a,b,abij->ij", power, power, self._squares)
        sums = np.einsum("a,aij->ij", power, self._sums)
        if model.gauss_markov:
            processes = [g.sigma**2 * self._of_markov(g.correlation_time) for g in model.gauss_markov]
            extra = np.sum(processes, axis=0)
            both = 2.0 * self._weight * extra * (extra + 2.0 * (power @ self._gamma))
            self._fill(total, np.add.reduceat(both, self._begins))
            self._fill(sums, np.add.reduceat(self._weight * extra, self._begins))
        # of a difference with a mean: cov(z², w²) = 2 γ² + 4 μ_z μ_w γ
        mean = model.ramp * np.array(self.averaging) / self.rate / np.sqrt(2.0)
        return np.asarray(total + 4.0 * np.outer(mean, mean) * sums)

    def _of_letter(self, letter: str, i: int, j: int, lag: AnyArray) -> AnyArray:
        m, n = self.averaging[i], self.averaging[j]

        def of_phase(t: AnyArray) -> AnyArray:
            return phase_covariance_of(letter, t)

        found = self._contrast(of_phase, m, n, lag)
        # the phase's covariance is a cubic on one side of zero, of which nothing is left but rounding
        return found if letter == "B" else np.where((lag > 2 * m) | (lag < -2 * n), 0.0, found)

    def _of_markov(self, correlation_time: float) -> Series:
        """Covariances of differences of a process of variance 1 over all places; kept, to 2.5 % of the time."""
        key = round(_TIMES * float(np.log(correlation_time)))
        if key not in self._markov:
            if len(self._markov) >= _KEPT:
                self._markov.clear()
            time = float(np.exp(key / _TIMES))

            def of_phase(t: AnyArray) -> AnyArray:
                return markov_phase_covariance(t, time)

            size = len(self.averaging)
            pairs = ((i, j) for i in range(size) for j in range(i, size))
            self._markov[key] = np.concatenate(
                [
                    self._contrast(of_phase, self.averaging[i], self.averaging[j], lag)
                    for (i, j), lag in zip(pairs, self._lags, strict=True)
                ]
            )
        return self._markov[key]

    def _fill(self, matrix: Square, pairs: Series) -> None:
        """Add to both halves of a matrix what pairs of averaging times have."""
        first, second = np.triu_indices(len(self.averaging))
        matrix[first, second] += pairs
        off = first != second
        matrix[second[off], first[off]] += pairs[off]

    def _contrast(self, of_phase: Callable[[AnyArray], AnyArray], m: int, n: int, lag: AnyArray) -> AnyArray:
        """Covariance of the second differences over m and n samples that begin `lag` samples apart."""
        total = np.zeros(len(lag))
        for a, first in enumerate(_DIFFERENCE):
            for b, second in enumerate(_DIFFERENCE):
                total += first * second * of_phase((lag + b * n - a * m) / self.rate)
        return total * self.rate**2 / (2.0 * m * n)


@lru_cache(maxsize=32)
def allan_covariance(averaging: tuple[int, ...], rate: float, lengths: tuple[int, ...]) -> AllanCovariance:
    """Return `AllanCovariance`, kept for signals of the same shape."""
    return AllanCovariance(averaging, rate, lengths)


def _count(averaging: int, lengths: tuple[int, ...]) -> int:
    return sum(max(length + 1 - 2 * averaging, 0) for length in lengths)


def _lags(m: int, n: int, longest: int) -> AnyArray:
    """Whole lags, dense where the covariance has corners, thin where it is smooth."""
    steps = int(np.ceil(np.log(longest) / np.log(_GRADING))) + 1
    away = np.unique(np.round(_GRADING ** np.arange(steps))).astype(np.int64)
    away = np.concatenate([-away[::-1], [0], away])
    corners = np.array([a * m - b * n for a in range(3) for b in range(3)])
    lag = np.unique(corners[:, None] + away)
    return lag[(lag > -(longest + 1 - 2 * m)) & (lag < longest + 1 - 2 * n)].astype(float)


def _weights(lag: AnyArray, m: int, n: int, lengths: AnyArray, repeats: AnyArray) -> Series:
    """Pairs of places that lie about each lag apart, over all pieces."""
    pairs = np.zeros(len(lag))
    for length, often in zip(lengths, repeats, strict=True):
        first, second = length + 1 - 2 * m, length + 1 - 2 * n
        if first > 0 and second > 0:
            pairs += often * np.maximum(np.minimum(first, second - lag) - np.maximum(0.0, -lag), 0.0)
    if len(lag) == 1:
        return pairs
    # each stands for the lags half way to its neighbours
    reach = np.zeros(len(lag))
    reach[1:-1] = 0.5 * (lag[2:] - lag[:-2])
    reach[0] = 0.5 + 0.5 * (lag[1] - lag[0])
    reach[-1] = 0.5 + 0.5 * (lag[-1] - lag[-2])
    return pairs * reach
