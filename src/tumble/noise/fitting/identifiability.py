"""What a recording does not tell apart, in words."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Square
from tumble.noise.fitting.weighted_fit import AllanTask, Solution
from tumble.noise.variances import LETTERS

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
