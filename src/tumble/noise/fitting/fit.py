"""Noise coefficients from a recording at rest: by the whole Allan curve, or by its wavelet moments.

Both fit the same model to the same kind of numbers, Allan variances at averaging times an octave apart
(twice the Haar wavelet variances), with coefficients that cannot be negative:

- "curve" in the logarithm, where all averaging times count by their degrees of freedom and the bias of
  a logarithm is taken off;
- "moments" in the variances themselves, the generalized method of wavelet moments.

Both weigh by the full covariance between averaging times, which is that of the model fitted so far (see
`allan_covariance`), and both begin again until it does not change. Lines come from the spectrum (`lines`).

References
----------
IEEE Std 952-2020, annex C. Guerrier, Skaloud, Stebler and Victoria-Feser, Journal of the American
Statistical Association 108 (2013) 1021-1030.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square
from tumble.errors import UsageError
from tumble.noise.deviation import Deviation, Integers
from tumble.noise.fitting.allan_covariance import allan_covariance
from tumble.noise.fitting.identifiability import remarks_on, stand_ins
from tumble.noise.fitting.intervals import letter_interval, process_interval
from tumble.noise.fitting.selection import (
    FALSE_ALARM,
    MOST_PROCESSES,
    in_moments,
    with_processes,
    without_the_unseen,
)
from tumble.noise.fitting.weighted_fit import AllanTask, Method, Solution, misfit_of_scores, normal_scores
from tumble.noise.lines import FoundLine, allan_variance_of_lines
from tumble.noise.terms import NoiseModel
from tumble.noise.variances import LETTERS
from tumble.records import dataclass

CONFIDENCE = 0.95
"""Probability of intervals and of upper limits."""

MISFIT = 0.01
"""Probability of a fit below which its model is taken as wrong, and its weights with it."""

MISSED = 1.5
"""Factor by which a model misses the measured curve over a decade, from which on it is said."""

# Averaging times up to this share of the recording: two degrees of freedom at least, for any noise.
_LONGEST_SHARE = 0.25


@dataclass(frozen=True)
class Term:
    """A coefficient in the signal's unit u.

    Attributes
    ----------
    letter : Q, N, B, K or R of IEEE Std 952, or "sigma" and "correlation time" of a Gauss-Markov process; those of
        a second one are "sigma 2" and "correlation time 2".
    value, sigma : coefficient and its standard uncertainty. Q in u·s, N in u·√s, B in u, K in u/√s, R in u/s, sigma
        in u, the correlation time in s.
    low, high : limits at the fit's confidence.
    """

    letter: str
    value: float
    sigma: float
    low: float
    high: float


@dataclass(frozen=True)
class NoiseFit:
    """A noise model of one channel, as far as a recording shows it.

    Attributes
    ----------
    method : "curve" or "moments".
    model : fitted, lines among it; terms that are not seen are zero.
    terms : of the model, each with its interval, without the lines.
    covariance : of the values in `terms`, in their order.
    limits : upper limit of each of Q, N, B, K, R that is not seen, at the fit's confidence.
    chi_square, freedom, probability : misfit of all terms that were tried (one that is there unseen is no wrong
        shape) against its degrees of freedom, and how probable as much or more is if such a model is right.
        Below 0.01 the curve has a shape that the terms do not make.
    tau, variance, expected : (taus,) of the Allan variance used, found and fitted.
    rate, lengths : Hz; samples of each piece of the recording.
    lines : as the spectrum has them.
    remarks : sentences on terms that the recording does not tell apart.
    missed : of each term, the factor by which the model's curve misses the measured deviation over a decade of
        averaging times, its logarithm counted by the term's share in the model there; empty where the model fits.
        Covariance and limits count it.
    """

    method: Method
    model: NoiseModel
    terms: tuple[Term, ...]
    covariance: Square
    limits: dict[str, float]
    chi_square: float
    freedom: int
    probability: float
    tau: Series
    variance: Series
    expected: Series
    rate: float
    lengths: tuple[int, ...]
    lines: tuple[FoundLine, ...] = ()
    remarks: tuple[str, ...] = ()
    missed: dict[str, float] = field(default_factory=dict[str, float])

    @property
    def confidence(self) -> float:
        """Probability of the intervals and upper limits."""
        return CONFIDENCE

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the terms that the recording shows."""
        return tuple(term.letter for term in self.terms if not term.letter.startswith("correlation time"))


def fit_curve(
    deviation: Deviation,
    channel: int = 0,
    *,
    method: Method = "curve",
    gauss_markov: int = 1,
    lines: Sequence[FoundLine] = (),
) -> NoiseFit:
    """Fit a model to a channel's Allan curve.

    Parameters
    ----------
    deviation : overlapping Allan deviation. Of its averaging times those are used that are at least
        1.9 times the one before, up to a quarter of the recording.
    channel : which.
    method : "curve" in the logarithm, "moments" in the variances themselves (generalized method of wavelet moments).
    gauss_markov : how many Gauss-Markov processes are tried at most, up to three.
    lines : of the signal, from `tumble.noise.lines.find_lines`.

    Raises
    ------
    UsageError
        If the deviation has fewer than three averaging times, or does not vary.
    """
    rate, lengths = deviation.rate, deviation.pieces
    used = _used(deviation.averaging, sum(lengths), max(lengths))
    averaging = deviation.averaging[used]
    variance = np.asarray(deviation.deviation[used, channel] ** 2)
    if np.any(variance <= 0.0):
        raise UsageError("The signal does not vary from sample to sample: there is no noise to model.")
    spread = allan_covariance(tuple(int(m) for m in averaging), rate, lengths)
    scale = float(np.sqrt(variance[0]))
    of_lines, of_amplitudes = allan_variance_of_lines(lines, averaging, rate, spread.counts)
    task = AllanTask(
        method,
        averaging / rate,
        variance / scale**2,
        rate,
        spread,
        of_lines / scale**2,
        of_amplitudes / scale**4,
    )
    # which terms there are is asked of the logarithms, whose misfit is nearer to chi square, by both methods
    logarithms = replace(task, method="curve")
    solution = logarithms.settle(LETTERS, ())
    most = min(gauss_markov, MOST_PROCESSES)
    if most:
        solution = with_processes(logarithms, solution, most)
    solution = without_the_unseen(logarithms, solution)
    alike = stand_ins(logarithms, solution, terms_of(solution))
    if method == "moments":
        solution = in_moments(task, solution)
    fit = _gather(task, solution, scale, lengths, tuple(lines))
    return replace(fit, remarks=(*alike, *fit.remarks))


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


def _gather(
    task: AllanTask,
    solution: Solution,
    scale: float,
    lengths: tuple[int, ...],
    lines: tuple[FoundLine, ...],
) -> NoiseFit:
    from scipy.special import gammaincc, ndtri

    expected = task.expected(task.design(solution.letters, solution.times), solution)
    chi_square, freedom = _goodness(task, solution)
    probability = float(gammaincc(0.5 * freedom, 0.5 * chi_square)) if freedom else 1.0
    covariance = _covariance(task, solution, scale)
    remarks = remarks_on(solution, covariance, terms_of(solution))
    missed = _missed(task, solution) if probability < MISFIT else {}
    terms, covariance = _terms(task, solution, scale, covariance, missed)
    once = float(ndtri(CONFIDENCE))
    unseen = [letter for letter in LETTERS if letter not in solution.letters]
    return NoiseFit(
        method=task.method,
        model=replace(solution.model.scaled(scale), lines=tuple(line.line for line in lines)),
        terms=terms,
        covariance=covariance,
        limits={letter: scale * letter_interval(task, solution, letter, once)[1] for letter in unseen},
        chi_square=chi_square,
        freedom=freedom,
        probability=probability,
        tau=task.tau,
        variance=task.variance * scale**2,
        expected=expected * scale**2,
        rate=task.rate,
        lengths=lengths,
        lines=lines,
        remarks=remarks,
        missed=missed,
    )


def _goodness(task: AllanTask, solution: Solution) -> tuple[float, int]:
    """Misfit of the terms that were tried, kept or not: one that is there unseen is no wrong shape."""
    whole = task.settle(LETTERS, solution.times)
    expected = task.expected(task.design(LETTERS, solution.times), whole)
    covariance = task.covariance(whole.model)
    chi_square = misfit_of_scores(normal_scores(task.variance, expected, covariance), covariance)
    count = np.count_nonzero(whole.squares) + len(solution.times)
    return chi_square, max(len(task.tau) - int(count), 0)


def _missed(task: AllanTask, solution: Solution) -> dict[str, float]:
    """Mean factor by which a decade of the curve is missed, of each term by its share in the model there."""
    parts = task.design(solution.letters, solution.times) * solution.squares
    curve = np.maximum(np.sum(parts, axis=1) + task.lines, 1e-12 * task.variance)
    miss = 0.5 * np.abs(np.log(curve / task.variance))
    decades = [
        (task.tau >= first) & (task.tau <= 10.0 * first)
        for first in task.tau
        if first <= max(task.tau[-1] / 8.0, task.tau[0])
    ]
    blame = parts / curve[:, None] * miss[:, None]
    worst = np.exp(np.max([np.mean(blame[decade], axis=0) for decade in decades], axis=0)).tolist()
    # a correlation time is as its process
    return dict(zip(terms_of(solution), worst + worst[len(solution.letters) :], strict=True))


def terms_of(solution: Solution) -> tuple[str, ...]:
    """Return the names of a solution's coefficients, correlation times last.

    Parameters
    ----------
    solution : fitted.
    """
    marks = ["" if k == 0 else f" {k + 1}" for k in range(len(solution.times))]
    return (*solution.letters, *(f"sigma{m}" for m in marks), *(f"correlation time{m}" for m in marks))


def _covariance(task: AllanTask, solution: Solution, scale: float) -> Square:
    """Covariance of the coefficients, from that of their squares."""
    of_squares = task.fisher(solution)
    values = np.sqrt(solution.squares)
    # Of a coefficient that came out as nothing, the root has no slope: its own uncertainty stands for its size.
    spread = np.sqrt(np.sqrt(np.maximum(np.diag(of_squares)[: len(values)], 0.0)))
    sizes = np.where(values > 0.0, values, np.maximum(spread, 1e-300))
    slopes = np.concatenate([scale * 0.5 / sizes, np.array(solution.times, dtype=np.float64)])
    return of_squares * np.outer(slopes, slopes)


def _terms(
    task: AllanTask, solution: Solution, scale: float, covariance: Square, missed: dict[str, float]
) -> tuple[tuple[Term, ...], Square]:
    """Coefficients with limits for the choice of terms too, and one sigma more of what a model misses."""
    from scipy.special import ndtri

    z = float(ndtri(0.5 + 0.5 * CONFIDENCE))
    names, times = terms_of(solution), np.array(solution.times, dtype=np.float64)
    values = np.concatenate([scale * np.sqrt(solution.squares), times])
    limits = [letter_interval(task, solution, letter, z) for letter in solution.letters]
    limits += [process_interval(task, solution, k, z) for k in range(len(times))]
    ends = [(scale * low, scale * high) for low, high in limits]
    relative = np.sqrt(np.diag(covariance)[len(limits) :]) / times
    ends += [(t / f, t * f) for t, f in zip(times, np.exp(np.minimum(z * relative, 50.0)), strict=True)]
    factors = np.array([missed.get(name, 1.0) for name in names])
    wide = covariance + np.diag((values * np.log(factors)) ** 2)
    # what is stated lies between, also where the two methods disagree
    terms = tuple(
        Term(name, float(v), float(sigma), float(min(low, v / f**2)), float(max(high, v * f**2)))
        for name, v, sigma, (low, high), f in zip(
            names, values, np.sqrt(np.diag(wide)), ends, factors, strict=True
        )
    )
    return terms, wide


__all__ = [
    "CONFIDENCE",
    "FALSE_ALARM",
    "MISFIT",
    "MISSED",
    "NoiseFit",
    "Term",
    "fit_curve",
    "terms_of",
]
