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

from collections.abc import Callable, Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.errors import UsageError
from tumble.estimation import crossing
from tumble.noise.deviation import Deviation, Integers
from tumble.noise.fitting.allan_covariance import allan_covariance
from tumble.noise.fitting.weighted_fit import AllanTask, Method, Solution, misfit_of_scores, normal_scores
from tumble.noise.lines import FoundLine, allan_variance_of_lines
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.noise.variances import LETTERS, allan_variance_of, markov_allan_variance
from tumble.records import dataclass

FALSE_ALARM = 0.01
"""Probability that a term is kept which is not there, for each term that is tried."""

MOST_PROCESSES = 3
"""Gauss-Markov processes that are tried at most."""

# Correlation times that are tried lie this far apart in the natural logarithm: two an octave.
_STEP = 0.5 * float(np.log(2.0))


def with_processes(task: AllanTask, without: Solution, most: int) -> Solution:
    """Return the solution with as many Gauss-Markov processes as explain what it does not.

    One more is kept if the misfit falls by more than the best of all correlation times tried would take off
    it by chance. Starts of the search are the best time beside those that are there, and the clusters in
    which many processes at once, whose fit has one minimum, put their power.

    Parameters
    ----------
    task, without : the curve, and its fit without a process.
    most : processes at most.
    """
    times = _grid(task)
    if len(times) < 2:
        return without
    # each of the independent correlation times, an octave apart, is one more that may fit by chance
    limit = 2.0 * float(np.log(len(times) / 2.0 / FALSE_ALARM))
    kept = without
    while len(kept.times) < most:
        root = kept.root
        if _misfit(task, kept.letters, kept.times, root) - _many(task, kept, times, root)[0] < limit:
            break
        best = kept
        # once with the weights of fewer processes, which may be far off, and once with their own
        for _ in range(2):
            best = task.settle(kept.letters, _refined(task, kept, times, root))
            root = best.root
            if _misfit(task, kept.letters, kept.times, root) - best.misfit < limit:
                return kept
        if np.any(best.squares[len(best.letters) :] <= 0.0):
            break
        kept = best
    return kept


def without_the_unseen(task: AllanTask, full: Solution) -> Solution:
    """Leave terms out, the least wanted first, as long as the misfit does not grow beyond chance.

    The ramp is tried first: a short recording cannot tell it from a random walk, which every sensor has.

    Parameters
    ----------
    task, full : the curve, and its fit with all terms.
    """
    from scipy.special import ndtri

    limit = float(ndtri(1.0 - FALSE_ALARM)) ** 2
    solution = full
    if "R" in solution.letters and len(solution.letters) > 1:
        without, rise = _rise(task, solution, "R")
        solution = without if rise <= limit else solution
    while len(solution.letters) + len(solution.times) > 1 and solution.letters:
        trials = [_rise(task, solution, letter) for letter in solution.letters]
        without, rise = min(trials, key=lambda trial: trial[1])
        if rise > limit:
            break
        solution = without
    return _without_nothing(task, solution)


def in_moments(task: AllanTask, chosen: Solution) -> Solution:
    """Return the fit in the variances themselves of the terms that the logarithms chose.

    Parameters
    ----------
    task, chosen : by moments, and the solution in the logarithm.
    """
    solution = task.settle(chosen.letters, chosen.times)
    if chosen.times:
        times = _polished(task, solution.letters, [chosen.times], solution.root, _grid(task))
        solution = task.settle(chosen.letters, times)
    return _without_nothing(task, solution)


def _without_nothing(task: AllanTask, solution: Solution) -> Solution:
    """Leave out what came out as nothing at all."""
    here = solution.squares > 0.0
    while not np.all(here):
        count = len(solution.letters)
        letters = tuple(x for x, stays in zip(solution.letters, here[:count], strict=True) if stays)
        times = tuple(t for t, stays in zip(solution.times, here[count:], strict=True) if stays)
        if not letters and not times:
            raise UsageError(
                "No term of noise makes such a curve: the recording holds something else, such as motion."
            )
        solution = task.settle(letters, times)
        here = solution.squares > 0.0
    return solution


def _rise(task: AllanTask, solution: Solution, letter: str) -> tuple[Solution, float]:
    """The solution without a term, and what the term would take off its misfit.

    Both misfits are weighed as if the term were not there: its own spread must not hide it.
    """
    fewer = tuple(other for other in solution.letters if other != letter)
    without = task.settle(fewer, solution.times)
    return without, without.misfit - _misfit(task, solution.letters, solution.times, without.root)


def _grid(task: AllanTask) -> Series:
    """Correlation times that are tried, from two samples to half of the longest averaging time."""
    shortest, longest = 2.0 / task.rate, float(task.tau[-1]) / 2.0
    if longest < 4.0 * shortest:
        return np.zeros(0)
    count = int(np.log(longest / shortest) / _STEP) + 1
    return shortest * np.exp(_STEP * np.arange(count))


def _misfit(task: AllanTask, letters: tuple[str, ...], times: tuple[float, ...], root: Square) -> float:
    return task.solve(letters, times, task.design(letters, times), root).misfit


def _many(task: AllanTask, kept: Solution, times: Series, root: Square) -> tuple[float, list[float]]:
    """Misfit with a process at every time, and the times about which they have their power, strongest first."""
    every = tuple(float(time) for time in times)
    solution = task.solve(kept.letters, every, task.design(kept.letters, every), root)
    power = solution.squares[len(kept.letters) :]
    clusters: list[tuple[float, float]] = []
    inside = np.flatnonzero(power > 1e-6 * max(float(power.max()), 1e-300))
    for cluster in np.split(inside, np.flatnonzero(np.diff(inside) > 2) + 1):
        if len(cluster):
            weight = power[cluster]
            middle = np.exp(np.sum(weight * np.log(times[cluster])) / np.sum(weight))
            clusters.append((float(np.sum(weight)), float(middle)))
    return solution.misfit, [time for _, time in sorted(clusters, reverse=True)]


def _refined(task: AllanTask, kept: Solution, times: Series, root: Square) -> tuple[float, ...]:
    """Correlation times of one more process and of those that are there, best for given weights."""
    tried = [_misfit(task, kept.letters, (*kept.times, float(time)), root) for time in times]
    starts: list[tuple[float, ...]] = [(*kept.times, float(times[int(np.argmin(tried))]))]
    clusters = _many(task, kept, times, root)[1]
    if len(starts[0]) > 1 and len(clusters) >= len(starts[0]):
        starts.append(tuple(clusters[: len(starts[0])]))
    return _polished(task, kept.letters, starts, root, times)


def _polished(
    task: AllanTask,
    letters: tuple[str, ...],
    starts: list[tuple[float, ...]],
    root: Square,
    times: Series,
) -> tuple[float, ...]:
    """Correlation times about the starts that fit best for given weights, within the grid's ends."""
    from scipy.optimize import minimize

    low, high = np.log(times[0]), np.log(times[-1])

    def misfit(logs: Series) -> float:
        beyond = float(np.sum(np.maximum(logs - high, 0.0) + np.maximum(low - logs, 0.0)))
        inside = np.clip(logs, low, high)
        return _misfit(task, letters, tuple(np.exp(inside).tolist()), root) + 1e3 * beyond

    found: list[tuple[float, Series]] = []
    for start in starts:
        result = minimize(
            misfit,
            np.log(start),
            method="Nelder-Mead",
            options={"xatol": 1e-3, "fatol": 1e-4, "maxfev": 120 * len(start)},
        )
        found.append((float(result.fun), np.asarray(result.x, dtype=np.float64)))
    logs = min(found, key=lambda end: end[0])[1]
    return tuple(sorted(np.exp(np.clip(logs, low, high)).tolist()))


_TINY = 1e-300


@dataclass(frozen=True)
class _Profile:
    """Misfit over one coefficient's square, everything else adapting itself."""

    task: AllanTask
    solution: Solution
    letter: str | None
    process: int | None
    letters: tuple[str, ...]  # of the others
    column: Series
    others: Table

    def model(self, square: float, rest: Series) -> NoiseModel:
        """The noise with the coefficient and what the others then are."""
        values = np.sqrt(np.maximum(rest, 0.0))
        coefficients = dict(zip(self.letters, map(float, values), strict=False))
        sigmas = [float(value) for value in values[len(self.letters) :]]
        own = float(np.sqrt(square))
        if self.letter is not None:
            coefficients[self.letter] = own
        times = self.solution.times
        if self.process is not None:
            sigmas.insert(self.process, own)
        processes = tuple(GaussMarkov(s, t) for s, t in zip(sigmas, times, strict=False))
        return NoiseModel.from_coefficients(coefficients, processes)

    def excess(self, square: float) -> tuple[float, float]:
        """How much worse the coefficient fits than the best one, and that one's square, by its own spread."""
        target = self.task.variance - self.task.lines
        count = len(self.letters) + len(self.solution.times) - (self.process is not None)
        rest = self._start()
        root, fixed = np.eye(len(target)), 0.0
        for _ in range(2):
            # what every variance is at least is what the coefficient alone makes of it
            model = self.model(square, rest[:count])
            root = self.task.root(model, target, "moments")
            rest, fixed = _least(root, self.others, target - square * self.column)
        with_it, free = _least(root, np.column_stack([self.others, self.column]), target)
        return fixed - free, float(with_it[-1])

    def _start(self) -> Series:
        known = self.solution.model.coefficients
        squares = [known[letter] ** 2 for letter in self.letters]
        squares += [g.sigma**2 for k, g in enumerate(self.solution.model.gauss_markov) if k != self.process]
        return np.array(squares)


def letter_interval(task: AllanTask, solution: Solution, letter: str, sigmas: float) -> tuple[float, float]:
    """Return the limits of a term of IEEE Std 952, in the task's unit; the lower is 0 where none is needed.

    Parameters
    ----------
    task, solution : the curve, and the fit with the terms that were kept.
    letter : whose.
    sigmas : of a normal number, how far off either limit may be.
    """
    others = tuple(x for x in LETTERS if x != letter and (x != "R" or x in solution.letters))
    columns = [allan_variance_of(x, task.tau, task.rate) for x in others]
    columns += [markov_allan_variance(task.tau, time, task.rate) for time in solution.times]
    columns += _both_ways(task.slopes_of_times(solution))
    own = allan_variance_of(letter, task.tau, task.rate)
    design = np.column_stack(columns) if columns else np.zeros((len(own), 0))
    profile = _Profile(task, solution, letter, None, others, own, design)
    at = solution.letters.index(letter) if letter in solution.letters else None
    return _limits(profile, float(solution.squares[at]) if at is not None else 0.0, sigmas)


def process_interval(task: AllanTask, solution: Solution, process: int, sigmas: float) -> tuple[float, float]:
    """Return the limits of a Gauss-Markov process' σ, as `letter_interval` does.

    Parameters
    ----------
    task, solution, sigmas : as for `letter_interval`.
    process : which.
    """
    others = tuple(x for x in LETTERS if x != "R" or x in solution.letters)
    columns = [allan_variance_of(x, task.tau, task.rate) for x in others]
    times = solution.times
    columns += [
        markov_allan_variance(task.tau, time, task.rate) for k, time in enumerate(times) if k != process
    ]
    columns += _both_ways(task.slopes_of_times(solution))
    own = markov_allan_variance(task.tau, times[process], task.rate)
    profile = _Profile(task, solution, None, process, others, own, np.column_stack(columns))
    return _limits(profile, float(solution.squares[len(solution.letters) + process]), sigmas)


def _both_ways(columns: list[Series]) -> list[Series]:
    """Columns whose coefficients may be negative, as pairs."""
    return [sign * column for column in columns for sign in (1.0, -1.0)]


def _limits(profile: _Profile, square: float, sigmas: float) -> tuple[float, float]:
    """Root of the lowest and highest square that the data allow."""

    def beyond(log_square: float, above: bool) -> float:
        excess, best = profile.excess(float(np.exp(log_square)))
        # on the near side of the best value nothing speaks against it
        near = best > np.exp(log_square) if above else best < np.exp(log_square)
        return -1.0 if near else excess - sigmas**2

    # a coefficient that alone makes the curve, wherever the curve allows it most
    alone = float(np.log(max(float(np.min(profile.task.variance / profile.column)), _TINY)))
    start = float(np.log(square)) if square > 0.0 else alone - 12.0
    high = _crossing(lambda x: beyond(x, True), start, 0.25, alone + 40.0)
    low = 0.0
    if square > 0.0:
        least = min(start, alone) - 14.0  # a thousandth of the coefficient is none
        found = _crossing(lambda x: beyond(x, False), start, -0.25, least)
        low = 0.0 if found is None else float(np.exp(0.5 * found))
    return low, float(np.exp(0.5 * high)) if high is not None else float("inf")


def _crossing(function: Callable[[float], float], start: float, step: float, end: float) -> float | None:
    """Where a function first becomes positive on the way from start to end, in growing steps; None if nowhere."""
    if (at_near := function(start)) > 0.0:
        return start
    near = start
    while (end - near) * step > 0.0:
        far = near + step
        if (at_far := function(far)) > 0.0:
            return crossing(function, near, far, (at_near, at_far), 2e-3)
        near, at_near, step = far, at_far, 1.4 * step
    return None


def _least(root: Square, design: Table, observed: Series) -> tuple[Series, float]:
    """Best coefficients that are not negative, and their misfit."""
    from scipy.optimize import nnls

    if not design.shape[1]:
        return np.zeros(0), float(np.sum((root @ observed) ** 2))
    weighed = root @ design
    size = np.maximum(np.max(np.abs(weighed), axis=0), _TINY)
    found, left = nnls(weighed / size, root @ observed)
    return found / size, float(left) ** 2


# Two estimates that are correlated by more than this are one number more than two.
_ALIKE = 0.95
# A correlation time that may be this many times longer or shorter (one sigma) is hardly known.
_VAGUE = 2.0
# Terms of the long averaging times, of which a short recording shows that there is one, and hardly which.
_LONG = "BKR"
# A curve that is this many times less probable with another term in the place of one excludes it.
_EXCLUDED = 100.0


def remarks_on(solution: Solution, covariance: Square, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return a sentence for each pair of terms that are not told apart, and each correlation time hardly known.

    Parameters
    ----------
    solution : fitted.
    covariance : of its coefficients and correlation times.
    names : of these, in the same order.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    said: list[str] = []
    count = len(solution.squares)
    words = [_words(name, solution) for name in names]
    for i in range(count):
        for j in range(i + 1, count):
            if abs(correlation[i, j]) > _ALIKE:
                said.append(
                    f"{words[i]} and {words[j]} are hardly separated: their estimates are correlated "
                    f"by {correlation[i, j]:.2f}. Only both together are known; a longer recording "
                    "may part them."
                )
    for k, time in enumerate(solution.times):
        relative = float(sigma[count + k]) / time
        if relative > np.log(_VAGUE):
            said.append(
                f"The correlation time of {words[len(solution.letters) + k]} is known only to a factor of "
                f"{np.exp(min(relative, 10.0)):.1f} (one standard uncertainty)."
            )
    return tuple(said)


def stand_ins(task: AllanTask, solution: Solution, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return a sentence for each term of the long averaging times in whose place another fits nearly as well.

    Parameters
    ----------
    task, solution, names : the curve, the fit with the terms that were kept, and their names.
    """
    said: list[str] = []
    others = [letter for letter in _LONG if letter not in solution.letters]
    slow = [k for k, time in enumerate(solution.times) if 4.0 * time > task.tau[len(task.tau) // 2]]
    for gone in (*(x for x in solution.letters if x in _LONG), *slow):
        letters = [x for x in solution.letters if x != gone]
        times = tuple(time for k, time in enumerate(solution.times) if k != gone)
        alike: list[tuple[float, str]] = []
        for other in others:
            again = task.settle(tuple(x for x in LETTERS if x in letters or x == other), times)
            if np.all(again.squares > 0.0):
                alike.append((_improbability(again) - _improbability(solution), other))
        worse, other = min(alike, default=(np.inf, ""))
        if worse < 2.0 * np.log(_EXCLUDED):
            word = gone if isinstance(gone, str) else _words(names[len(solution.letters) + gone], solution)
            said.append(_as_well(word, other, float(np.exp(0.5 * worse))))
    return tuple(said)


def _as_well(word: str, other: str, factor: float) -> str:
    how = f"{factor:.2g} times less probable, too little to exclude it" if factor > 1.1 else "as probable"
    return (
        f"{word[0].upper() + word[1:]} may really be {other}: a model with {other} instead makes the "
        f"curve {how}. A longer recording separates them."
    )


def _improbability(solution: Solution) -> float:
    """Minus twice the logarithm of the probability of the curve's logarithms, up to a constant."""
    return solution.misfit - 2.0 * float(np.sum(np.log(np.abs(np.diag(solution.root)))))


def _words(name: str, solution: Solution) -> str:
    if not name.startswith("sigma"):
        return name
    place = int(name[5:] or 1) - 1
    return f"the Gauss-Markov process of {solution.times[place]:.3g} s"


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
