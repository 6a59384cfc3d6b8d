"""Noise coefficients from a recording at rest: by the whole Allan curve, or by its wavelet moments.

Both fit the same model to the same kind of numbers, Allan variances at averaging times an octave apart
(twice the Haar wavelet variances), with coefficients that cannot be negative:

- `fit_curve` in the logarithm, where all averaging times count by their degrees of freedom and the bias of
  a logarithm is taken off;
- `fit_moments` in the variances themselves, the generalized method of wavelet moments.

Both weigh by the full covariance between averaging times, which is that of the model fitted so far (see
`allan_covariance`), and both begin again until it does not change.

References
----------
IEEE Std 952-2020, annex C. Guerrier, Skaloud, Stebler and Victoria-Feser, Journal of the American
Statistical Association 108 (2013) 1021-1030. Self and Liang, same journal 82 (1987) 605-610: half of the
tests of a coefficient at its bound zero find nothing at all, hence the one-sided threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, inverted
from tumble.errors import UsageError
from tumble.noise.allan_covariance import AllanCovariance, allan_covariance
from tumble.noise.deviation import Deviation, Integers, allan_deviation
from tumble.noise.freedom import chi_square_interval
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.noise.variances import LETTERS, allan_variance_of, markov_allan_variance

Method: TypeAlias = Literal["curve", "moments"]

FALSE_ALARM = 0.01
"""Probability that a term is kept which is not there, for each term that is tried."""

CONFIDENCE = 0.95
"""Probability of intervals and of upper limits unless another is asked for."""

# Averaging times up to this share of the recording: two degrees of freedom at least, for any noise.
_LONGEST_SHARE = 0.25
_ROUNDS = 5
_SETTLED = 0.01


@dataclass(frozen=True, slots=True)
class FittedTerm:
    """A coefficient in the signal's unit u.

    Attributes
    ----------
    name : the letter of IEEE Std 952, or "sigma" and "correlation time" of a Gauss-Markov process.
    value, low, high : coefficient, and its limits at the fit's confidence. Q in u·s, N in u·√s, B in u, K in
        u/√s, R in u/s, sigma in u, the correlation time in s.
    """

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class NoiseFit:
    """A noise model of one channel, as far as a recording shows it.

    Attributes
    ----------
    method : "curve" or "moments".
    model : fitted; terms that are not seen are zero.
    terms : of the model, each with its interval.
    covariance : of the values in `terms`, in their order.
    limits : upper limit of each of Q, N, B, K, R that is not seen, at the fit's confidence.
    chi_square, freedom, probability : misfit against its degrees of freedom, and how probable as much or more is
        if the model is right. Below 0.01 the curve has a shape that the terms do not make.
    tau, variance, expected : (taus,) of the Allan variance used, found and fitted.
    normalised : (taus,) log ratio of both over its standard deviation.
    confidence, rate, lengths : of the intervals; Hz; samples of each piece of the recording.
    """

    method: Method
    model: NoiseModel
    terms: tuple[FittedTerm, ...]
    covariance: Square
    limits: dict[str, float]
    chi_square: float
    freedom: int
    probability: float
    tau: Series
    variance: Series
    expected: Series
    normalised: Series
    confidence: float
    rate: float
    lengths: tuple[int, ...]

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the terms that the recording shows."""
        return tuple(term.name for term in self.terms if term.name != "correlation time")


def fit_curve(
    deviation: Deviation,
    channel: int = 0,
    *,
    letters: str = "QNBKR",
    gauss_markov: bool = True,
    confidence: float = CONFIDENCE,
) -> NoiseFit:
    """Fit a model to a channel's Allan curve in the logarithm.

    Parameters
    ----------
    deviation : overlapping Allan deviation. Of its averaging times those are used that are at least
        1.9 times the one before, up to a quarter of the recording.
    channel : which.
    letters : of the terms of IEEE Std 952 that are tried.
    gauss_markov : whether a Gauss-Markov process is tried.
    confidence : of intervals and limits.

    Raises
    ------
    UsageError
        If the deviation is of another kind, has fewer than three averaging times, or does not vary.
    """
    if deviation.kind != "overlapping":
        raise UsageError(f"A {deviation.kind} deviation is not fitted: take the overlapping Allan deviation.")
    used = _used(deviation.averaging, sum(deviation.pieces), max(deviation.pieces))
    return _fit(
        "curve",
        deviation.averaging[used],
        deviation.deviation[used, channel] ** 2,
        deviation.rate,
        deviation.pieces,
        letters,
        gauss_markov,
        confidence,
    )


def fit_moments(
    signal: AnyArray,
    rate: float,
    *,
    gaps: Sequence[int] = (),
    letters: str = "QNBKR",
    gauss_markov: bool = True,
    confidence: float = CONFIDENCE,
) -> NoiseFit:
    """Fit a model to the Haar wavelet variances of a signal (generalized method of wavelet moments).

    Parameters
    ----------
    signal : (samples,) at rest, any unit.
    rate : Hz.
    gaps : as for `allan_deviation`.
    letters, gauss_markov, confidence : as for `fit_curve`.

    Raises
    ------
    UsageError
        If the signal is too short for three averaging times, or does not vary.
    """
    curve = allan_deviation(np.asarray(signal, dtype=float), rate, gaps=gaps)
    return fit_moments_of(curve, 0, letters=letters, gauss_markov=gauss_markov, confidence=confidence)


def fit_moments_of(
    deviation: Deviation,
    channel: int = 0,
    *,
    letters: str = "QNBKR",
    gauss_markov: bool = True,
    confidence: float = CONFIDENCE,
) -> NoiseFit:
    """Fit as `fit_moments` does to wavelet variances that are there already, half the Allan variances at octaves.

    Parameters
    ----------
    deviation, channel, letters, gauss_markov, confidence : as for `fit_curve`.

    Raises
    ------
    UsageError
        As `fit_curve`.
    """
    if deviation.kind != "overlapping":
        raise UsageError(
            f"A {deviation.kind} deviation has no Haar wavelet variances: take the overlapping one."
        )
    used = _used(deviation.averaging, sum(deviation.pieces), max(deviation.pieces))
    return _fit(
        "moments",
        deviation.averaging[used],
        deviation.deviation[used, channel] ** 2,
        deviation.rate,
        deviation.pieces,
        letters,
        gauss_markov,
        confidence,
    )


def _used(averaging: Integers, samples: int, longest: int) -> Integers:
    """Indices of averaging times about an octave apart that have two degrees of freedom."""
    found: list[int] = []
    for index, m in enumerate(averaging):
        far_enough = not found or m >= 1.9 * averaging[found[-1]]
        if far_enough and m <= _LONGEST_SHARE * longest and m <= samples:
            found.append(index)
    if len(found) < 3:
        raise UsageError(
            "The signal is too short for a noise model: it takes three averaging times an octave apart, "
            "16 samples in a row."
        )
    return np.array(found)


def _fit(
    method: Method,
    averaging: Integers,
    variance: Series,
    rate: float,
    lengths: tuple[int, ...],
    letters: str,
    gauss_markov: bool,
    confidence: float,
) -> NoiseFit:
    if np.any(variance <= 0.0):
        raise UsageError("The signal does not vary from sample to sample: there is no noise to model.")
    spread = allan_covariance(tuple(int(m) for m in averaging), rate, lengths)
    scale = float(np.sqrt(variance[0]))
    task = _Task(method, averaging / rate, variance / scale**2, rate, spread)
    chosen = [letter for letter in LETTERS if letter in letters]
    solution = task.settle(chosen, None)
    if gauss_markov:
        solution = task.with_markov(solution)
    solution = task.without_the_unseen(solution)
    return _gather(
        task, solution, [letter for letter in LETTERS if letter in letters], scale, lengths, confidence
    )


@dataclass(frozen=True, slots=True)
class _Solution:
    """Squares of coefficients (R²; σ² of the Gauss-Markov process last), and the weights they were found with."""

    letters: list[str]
    time: float | None
    squares: Series
    misfit: float
    root: Square  # of the weights: misfit = |root (observed - expected)|²

    @property
    def model(self) -> NoiseModel:
        values = np.sqrt(self.squares)
        markov = () if self.time is None else (GaussMarkov(float(values[-1]), self.time),)
        return NoiseModel.from_coefficients(dict(zip(self.letters, map(float, values), strict=False)), markov)


@dataclass(frozen=True, slots=True)
class _Task:
    """Allan variances in units of the first, and how to fit them."""

    method: Method
    tau: Series
    variance: Series
    rate: float
    spread: AllanCovariance

    def settle(self, letters: list[str], time: float | None) -> _Solution:
        """Fit, take the weights from the fit, and fit again until nothing changes."""
        design = self.design(letters, time)
        rough = np.diag(np.sqrt(0.5 * self.spread.counts[0] / (self.rate * self.tau)))
        solution = self.solve(letters, time, design, rough, "curve")
        for turn in range(_ROUNDS):
            before = design @ solution.squares
            # variances far above the curve would draw it to them: it first comes near in the logarithm
            method: Method = "curve" if turn < 2 else self.method
            root = self.root(solution.model, before, method)
            solution = self.solve(letters, time, design, root, method)
            after = design @ solution.squares
            if method == self.method and np.max(np.abs(np.log(after / before))) < _SETTLED:
                break
        return solution

    def design(self, letters: list[str], time: float | None) -> Table:
        columns = [allan_variance_of(letter, self.tau, self.rate) for letter in letters]
        if time is not None:
            columns.append(markov_allan_variance(self.tau, time, self.rate))
        return np.column_stack(columns)

    def root(self, model: NoiseModel, expected: Series, method: Method) -> Square:
        """Root of the weights that follow from a model."""
        covariance = self.spread.of(model)
        if method == "curve":
            covariance = _of_logarithms(covariance, expected)
        return inverted(np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))

    def observed(self, root: Square, method: Method) -> Series:
        """What is fitted: variances, or logarithms less what the logarithm of an average is too small."""
        if method == "moments":
            return self.variance
        from scipy.special import digamma

        # trigamma of half the degrees of freedom is the logarithm's variance
        half = _half_freedom(np.diag(inverted(root.T @ root)))
        return np.log(self.variance) - (digamma(half) - np.log(half))

    def solve(
        self,
        letters: list[str],
        time: float | None,
        design: Table,
        root: Square,
        method: Method | None = None,
    ) -> _Solution:
        """Least squares with coefficients that are not negative, weights given."""
        from scipy.optimize import nnls

        method = self.method if method is None else method
        observed = self.observed(root, method)
        # columns of one size: nnls decides by absolute numbers what is zero
        size = np.max(design / self.variance[:, None], axis=0)
        if method == "moments":
            squares, left = nnls(root @ (design / size), root @ observed)
            return _Solution(letters, time, squares / size, float(left) ** 2, root)
        expected = self.variance
        squares, misfit = np.zeros(design.shape[1]), np.inf
        for _ in range(60):
            # about the last curve: log v = log v0 + (v - v0) / v0
            target = observed - np.log(expected) + 1.0
            step = nnls(root @ (design / size / expected[:, None]), root @ target)[0] / size
            share = 1.0
            while True:
                trial = squares + share * (step - squares) if np.isfinite(misfit) else step
                curve = np.maximum(design @ trial, 1e-12 * self.variance)
                now = float(np.sum((root @ (observed - np.log(curve))) ** 2))
                if now < misfit or share < 1e-3:
                    break
                share *= 0.5
            if not now < misfit * (1.0 - 1e-9):
                break
            squares, misfit, expected = trial, now, curve
        return _Solution(letters, time, squares, misfit, root)

    def with_markov(self, without: _Solution) -> _Solution:
        """The solution with a Gauss-Markov process, where it explains what the five terms do not."""
        from scipy.optimize import minimize_scalar

        span = self.tau[-1] / 2.0
        count = max(int(2 * np.log2(span * self.rate / 2.0)), 2)
        times: Series = np.exp(np.linspace(float(np.log(2.0 / self.rate)), float(np.log(span)), count))
        if span * self.rate < 8.0:
            return without

        def misfit(log_time: float) -> float:
            time = float(np.exp(log_time))
            return self.solve(without.letters, time, self.design(without.letters, time), root).misfit

        # each of the independent correlation times, an octave apart, is one more that may fit by chance
        limit = 2.0 * np.log(len(times) / 2.0 / FALSE_ALARM)
        root, best = without.root, None
        for _ in range(2):
            tried = [misfit(float(np.log(time))) for time in times]
            at = int(np.argmin(tried))
            bounds = np.log(times[[max(at - 1, 0), min(at + 1, len(times) - 1)]])
            found = minimize_scalar(misfit, bounds=(bounds[0], bounds[1]), method="bounded")
            plain = self.solve(without.letters, None, self.design(without.letters, None), root).misfit
            if plain - float(found.fun) < limit:
                return without
            best = self.settle(without.letters, float(np.exp(found.x)))
            root = best.root
        return without if best is None or best.squares[-1] <= 0.0 else best

    def without_the_unseen(self, full: _Solution) -> _Solution:
        """Leave terms out, the least wanted first, as long as the misfit does not grow beyond chance.

        The ramp is tried first: a short recording cannot tell it from a random walk, which every sensor has.
        """
        from scipy.special import ndtri

        limit = float(ndtri(1.0 - FALSE_ALARM)) ** 2
        solution = full
        if "R" in solution.letters and len(solution.letters) > 1:
            without, rise = self.rise(solution, "R")
            solution = without if rise <= limit else solution
        while len(solution.letters) + (solution.time is not None) > 1 and solution.letters:
            trials = [self.rise(solution, letter) for letter in solution.letters]
            without, rise = min(trials, key=lambda trial: trial[1])
            if rise > limit:
                break
            solution = without
        return solution

    def rise(self, solution: _Solution, letter: str) -> tuple[_Solution, float]:
        """The solution without a term, and what the term would take off its misfit.

        Both misfits are weighed as if the term were not there: its own spread must not hide it.
        """
        without = self.settle([other for other in solution.letters if other != letter], solution.time)
        design = self.design(solution.letters, solution.time)
        again = self.solve(solution.letters, solution.time, design, without.root)
        return without, without.misfit - again.misfit

    def fisher(self, solution: _Solution) -> Square:
        """Covariance of the squares, and of the logarithm of the correlation time after them."""
        design = self.design(solution.letters, solution.time)
        slopes = design
        if solution.time is not None:
            near, far = (
                markov_allan_variance(self.tau, solution.time * factor, self.rate)
                for factor in (0.999, 1.001)
            )
            slopes = np.column_stack([design, solution.squares[-1] * (far - near) / np.log(1.001 / 0.999)])
        if self.method == "curve":
            slopes = slopes / (design @ solution.squares)[:, None]
        weighed: Table = solution.root @ np.asarray(slopes, dtype=np.float64)
        size: Series = np.asarray(np.sqrt(np.sum(weighed**2, axis=0)), dtype=np.float64)
        inverse: Square = np.asarray(
            np.linalg.pinv((weighed / size).T @ (weighed / size), rcond=1e-13), dtype=np.float64
        )
        return inverse / np.outer(size, size)


def _half_freedom(log_variance: Series) -> Series:
    """Half the degrees of freedom whose trigamma is a variance of a logarithm, by Newton's method."""
    from scipy.special import polygamma

    half = 1.0 / log_variance + 0.5
    for _ in range(8):
        half = np.maximum(half - (polygamma(1, half) - log_variance) / polygamma(2, half), 0.25)
    return np.asarray(half)


def _of_logarithms(covariance: Square, expected: Series) -> Square:
    """Covariance of the logarithms of averages that are spread as chi square."""
    from scipy.special import polygamma

    half = expected**2 / np.diag(covariance)
    sigma = np.sqrt(polygamma(1, half) / np.diag(covariance))
    return covariance * np.outer(sigma, sigma)


def _gather(
    task: _Task,
    solution: _Solution,
    tried: list[str],
    scale: float,
    lengths: tuple[int, ...],
    confidence: float,
) -> NoiseFit:
    from scipy.special import gammaincc

    expected = task.design(solution.letters, solution.time) @ solution.squares
    freedom = max(len(task.tau) - len(solution.squares) - (solution.time is not None), 0)
    sigma = np.sqrt(np.diag(_of_logarithms(task.spread.of(solution.model), expected)))
    terms, covariance = _terms(task, solution, scale, confidence)
    unseen = [letter for letter in tried if letter not in solution.letters]
    return NoiseFit(
        method=task.method,
        model=solution.model.scaled(scale),
        terms=terms,
        covariance=covariance,
        limits={letter: scale * _upper_limit(task, solution, letter, confidence) for letter in unseen},
        chi_square=solution.misfit,
        freedom=freedom,
        probability=float(gammaincc(0.5 * freedom, 0.5 * solution.misfit)) if freedom else 1.0,
        tau=task.tau,
        variance=task.variance * scale**2,
        expected=expected * scale**2,
        normalised=np.log(task.variance / expected) / sigma,
        confidence=confidence,
        rate=task.rate,
        lengths=lengths,
    )


def _terms(
    task: _Task, solution: _Solution, scale: float, confidence: float
) -> tuple[tuple[FittedTerm, ...], Square]:
    """Coefficients from their squares, each square spread as chi square of its own degrees of freedom."""
    from scipy.special import ndtri

    of_squares = task.fisher(solution)
    sigma = np.sqrt(np.diag(of_squares))
    squares = solution.squares
    freedom = 2.0 * squares**2 / sigma[: len(squares)] ** 2
    low, high = chi_square_interval(squares, freedom, confidence)
    names = [*solution.letters, *([] if solution.time is None else ["sigma"])]
    values = scale * np.sqrt(squares)
    terms = [
        FittedTerm(name, float(value), float(scale * np.sqrt(below)), float(scale * np.sqrt(above)))
        for name, value, below, above in zip(names, values, low, high, strict=True)
    ]
    slopes = 0.5 * values / squares
    if solution.time is not None:
        factor = float(np.exp(ndtri(0.5 + 0.5 * confidence) * sigma[-1]))
        terms.append(
            FittedTerm("correlation time", solution.time, solution.time / factor, solution.time * factor)
        )
        slopes = np.append(slopes, solution.time)
    return tuple(terms), of_squares * np.outer(slopes, slopes)


def _upper_limit(task: _Task, solution: _Solution, letter: str, confidence: float) -> float:
    """The largest coefficient of a term that the variances still allow, all others adapting themselves.

    Each is weighed as if it were the true one, whatever the method: a large term is spread widely.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtri

    moments = _Task("moments", task.tau, task.variance, task.rate, task.spread)
    design = task.design(solution.letters, solution.time)
    column = allan_variance_of(letter, task.tau, task.rate)
    rise = float(ndtri(confidence)) ** 2
    present = solution.model

    def misfit(log_square: float) -> float:
        square = float(np.exp(log_square))
        with_it = {**present.coefficients, letter: float(np.sqrt(square))}
        model = NoiseModel.from_coefficients(with_it, present.gauss_markov)
        root = moments.root(model, task.variance, "moments")
        fixed = _left(root, design, task.variance - square * column)
        return fixed - _left(root, np.column_stack([design, column]), task.variance) - rise

    # from the coefficient that alone makes the curve somewhere, down to where it does no harm
    high = float(np.log(np.min(task.variance / column))) + 5.0
    while misfit(high) < 0.0 and high < 60.0:
        high += 2.0
    low = high
    while misfit(low) > 0.0 and low > high - 60.0:
        low -= 1.0
    if misfit(high) < 0.0 or misfit(low) > 0.0:
        return float(np.exp(0.5 * high))
    return float(np.exp(0.5 * float(brentq(misfit, low, low + 1.0 if low < high else high, xtol=1e-4))))


def _left(root: Square, design: Table, observed: Series) -> float:
    """Misfit of the best coefficients that are not negative."""
    from scipy.optimize import nnls

    size = np.max(np.abs(root @ design), axis=0)
    return float(nnls(root @ (design / size), root @ observed)[1]) ** 2


__all__ = [
    "CONFIDENCE",
    "FALSE_ALARM",
    "FittedTerm",
    "NoiseFit",
    "fit_curve",
    "fit_moments",
    "fit_moments_of",
]
