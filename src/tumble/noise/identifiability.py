"""What a recording does not tell apart, in words."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Square
from tumble.noise.weighted_fit import Solution

# Two estimates that are correlated by more than this are one number more than two.
_ALIKE = 0.95
# A correlation time that may be this many times longer or shorter (one sigma) is hardly known.
_VAGUE = 2.0


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
                    f"{words[i]} and {words[j]} are hardly told apart: their estimates are correlated by "
                    f"{correlation[i, j]:.2f}. Only both together are known; a longer recording may part them."
                )
    for k, time in enumerate(solution.times):
        relative = float(sigma[count + k]) / time
        if relative > np.log(_VAGUE):
            said.append(
                f"The correlation time of {words[len(solution.letters) + k]} is known only to a factor of "
                f"{np.exp(min(relative, 10.0)):.1f} (one standard uncertainty)."
            )
    return tuple(said)


def _words(name: str, solution: Solution) -> str:
    if not name.startswith("sigma"):
        return name
    place = int(name[5:] or 1) - 1
    return f"the Gauss-Markov process of {solution.times[place]:.3g} s"


__all__ = ["remarks_on"]
