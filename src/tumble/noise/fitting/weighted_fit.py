"""Coefficients that fit Allan variances best, for terms and correlation times that are given.

All numbers are in units in which the first variance is one. Coefficients enter by their squares, of which
the Allan variance is a linear function, and none is negative. Lines, whose amplitudes the spectrum knows
better than the curve, enter as a known part with the covariance that their amplitudes' gives it.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.noise.fitting.allan_covariance import AllanCovariance
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.noise.variances import allan_variance_of, markov_allan_variance
from tumble.records import dataclass

Method: TypeAlias = Literal["curve", "moments"]

_ROUNDS = 5
_SETTLED = 0.01
_LEAST_SPREAD = 1e-6  # relative, of an Allan variance
_LEAST_EIGENVALUE = 1e-9  # of a matrix of correlations, of the largest


@dataclass(frozen=True)
class Solution:
    """Coefficients, and the weights that they were found with.

    Attributes
    ----------
    letters, times : of the terms; correlation times in s of the Gauss-Markov processes.
    squares : of the coefficients, R² last of the letters, then σ² of each process.
    misfit : square of the length of root (observed - expected).
    root : of the weights.
    """

    letters: tuple[str, ...]
    times: tuple[float, ...]
    squares: Series
    misfit: float
    root: Square

    @property
    def model(self) -> NoiseModel:
        """The noise that it is, without lines."""
        values = [float(value) for value in np.sqrt(self.squares)]
        count = len(self.letters)
        return NoiseModel.from_coefficients(
            dict(zip(self.letters, values[:count], strict=True)),
            tuple(GaussMarkov(s, t) for s, t in zip(values[count:], self.times, strict=True)),
        )


@dataclass(frozen=True)
class AllanTask:
    """Allan variances in units of the first, and how to fit them.

    Attributes
    ----------
    method : in the logarithm ("curve") or as they are ("moments").
    tau, variance, rate : s, of the first one's size, Hz.
    spread : covariance between averaging times, for any model.
    lines : (taus,) expected from lines, and lines_covariance (taus, taus) of that.
    """

    method: Method
    tau: Series
    variance: Series
    rate: float
    spread: AllanCovariance
    lines: Series
    lines_covariance: Square

    def settle(self, letters: tuple[str, ...], times: tuple[float, ...]) -> Solution:
        """Fit, take the weights from the fit, and fit again until nothing changes."""
        design = self.design(letters, times)
        rough = np.diag(np.sqrt(0.5 * self.spread.counts[0] / (self.rate * self.tau)))
        solution = self.solve(letters, times, design, rough, "curve")
        for turn in range(_ROUNDS):
            before = self.expected(design, solution)
            # variances far above the curve would draw it to them: it first comes near in the logarithm
            method: Method = "curve" if turn < 2 else self.method
            again = self.solve(letters, times, design, self.root(solution.model, before, method), method)
            after = self.expected(design, again)
            if not np.all(after > 0.0):
                # terms that cannot make this curve at all: what was found first says so
                break
            solution = again
            if method == self.method and np.max(np.abs(np.log(after / before))) < _SETTLED:
                break
        return solution

    def design(self, letters: tuple[str, ...], times: tuple[float, ...]) -> Table:
        """Return the Allan variance of each term whose coefficient is 1, (taus, terms)."""
        columns = [allan_variance_of(letter, self.tau, self.rate) for letter in letters]
        columns += [markov_allan_variance(self.tau, time, self.rate) for time in times]
        return np.column_stack(columns)

    def expected(self, design: Table, solution: Solution) -> Series:
        """Return what a solution makes of the curve, lines among it."""
        return np.asarray(design @ solution.squares + self.lines)

    def covariance(self, model: NoiseModel) -> Square:
        """Return the covariance of the variances that follows from a model."""
        # A ramp alone has no spread at all, and numbers have that of their digits at least.
        least = np.diag((_LEAST_SPREAD * self.variance) ** 2)
        return np.asarray(self.spread.of(model) + self.lines_covariance + least)

    def root(self, model: NoiseModel, expected: Series, method: Method) -> Square:
        """Return the root of the weights that follow from a model."""
        covariance = self.covariance(model)
        if method == "curve":
            covariance = _covariance_of_logarithms(covariance, expected)
        return root_of_weights(covariance)

    def solve(
        self,
        letters: tuple[str, ...],
        times: tuple[float, ...],
        design: Table,
        root: Square,
        method: Method | None = None,
    ) -> Solution:
        """Return the least squares with coefficients that are not negative, weights given."""
        from scipy.optimize import nnls

        method = self.method if method is None else method
        # columns of one size: nnls decides by absolute numbers what is zero
        size = np.max(design / self.variance[:, None], axis=0)
        if method == "moments":
            squares, left = nnls(root @ (design / size), root @ (self.variance - self.lines))
            return Solution(letters, times, squares / size, float(left) ** 2, root)
        observed = self._logarithms(root)
        expected = self.variance
        squares, misfit = np.zeros(design.shape[1]), np.inf
        for _ in range(60):
            # about the last curve: log v = log v0 + (v - v0) / v0
            target = observed - np.log(expected) + 1.0 - self.lines / expected
            step = nnls(root @ (design / size / expected[:, None]), root @ target)[0] / size
            share = 1.0
            while True:
                trial = squares + share * (step - squares) if np.isfinite(misfit) else step
                curve = np.maximum(design @ trial + self.lines, 1e-12 * self.variance)
                now = float(np.sum((root @ (observed - np.log(curve))) ** 2))
                if now < misfit or share < 1e-3:
                    break
                share *= 0.5
            if not now < misfit * (1.0 - 1e-9):
                break
            squares, misfit, expected = trial, now, curve
        return Solution(letters, times, squares, misfit, root)

    def _logarithms(self, root: Square) -> Series:
        """Logarithms of the variances less what the logarithm of an average is too small."""
        from scipy.special import digamma

        # trigamma of half the degrees of freedom is the logarithm's variance
        half = _half_freedom(np.diag(inverted(root.T @ root)))
        return np.log(self.variance) - (digamma(half) - np.log(half))

    def fisher(self, solution: Solution) -> Square:
        """Return the covariance of the squares, and of the logarithms of the correlation times after them."""
        design = self.design(solution.letters, solution.times)
        slopes = np.column_stack([design, *self.slopes_of_times(solution)])
        if self.method == "curve":
            slopes = slopes / self.expected(design, solution)[:, None]
        weighed: Table = solution.root @ np.asarray(slopes, dtype=np.float64)
        size: Series = np.asarray(np.sqrt(np.sum(weighed**2, axis=0)), dtype=np.float64)
        inverse: Square = np.asarray(
            np.linalg.pinv((weighed / size).T @ (weighed / size), rcond=1e-13), dtype=np.float64
        )
        return inverse / np.outer(size, size)

    def slopes_of_times(self, solution: Solution) -> list[Series]:
        """Return how the curve grows with the logarithm of each correlation time."""
        found: list[Series] = []
        for square, time in zip(solution.squares[len(solution.letters) :], solution.times, strict=True):
            near, far = (markov_allan_variance(self.tau, time * f, self.rate) for f in (0.999, 1.001))
            found.append(np.asarray(square * (far - near) / np.log(1.001 / 0.999)))
        return found


def root_of_weights(covariance: Square) -> Square:
    """Return the inverse of a covariance's Cholesky factor, also where rounding has left negative eigenvalues.

    Parameters
    ----------
    covariance : of variances, (taus, taus).
    """
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        factor = np.linalg.cholesky(_made_positive(covariance))
    return inverted(np.asarray(factor, dtype=np.float64))


def _covariance_of_logarithms(covariance: Square, expected: Series) -> Square:
    """Return the covariance of the logarithms of averages that are spread as chi square."""
    from scipy.special import polygamma

    half = expected**2 / np.diag(covariance)
    sigma = np.sqrt(polygamma(1, half) / np.diag(covariance))
    return covariance * np.outer(sigma, sigma)


def normal_scores(variance: Series, expected: Series, covariance: Square) -> Series:
    """Return how far off variances are, each as the normal number that is as improbable as it.

    A variance is spread as chi square; its cube root is all but normal (Wilson and Hilferty 1931).

    Parameters
    ----------
    variance, expected, covariance : found, expected, and the covariance expected.
    """
    ninths = 2.0 / 9.0 * np.diag(covariance) / (2.0 * expected**2)
    return np.asarray((np.cbrt(variance / expected) - (1.0 - ninths)) / np.sqrt(ninths))


def misfit_of_scores(scores: Series, covariance: Square) -> float:
    """Return the chi square of normal scores that are correlated as the variances are.

    Parameters
    ----------
    scores, covariance : as `normal_scores` gives them, and of the variances.
    """
    sigma = np.sqrt(np.diag(covariance))
    return float(scores @ np.linalg.solve(covariance / np.outer(sigma, sigma), scores))


def _made_positive(covariance: Square) -> Square:
    """The covariance of a model far from the curve, of which rounding has left negative eigenvalues."""
    sigma = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    lifted = vectors * np.maximum(values, _LEAST_EIGENVALUE * values[-1]) @ vectors.T
    return np.asarray(lifted * np.outer(sigma, sigma), dtype=np.float64)


def _half_freedom(log_variance: Series) -> Series:
    """Half the degrees of freedom whose trigamma is a variance of a logarithm, by Newton's method."""
    from scipy.special import polygamma

    half = 1.0 / log_variance + 0.5
    for _ in range(8):
        half = np.maximum(half - (polygamma(1, half) - log_variance) / polygamma(2, half), 0.25)
    return np.asarray(half)
