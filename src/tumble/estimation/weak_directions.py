"""Which combinations of parameters the observations tell badly."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class WeakDirection:
    """A combination of parameters and its standard uncertainty.

    `direction` is in units of `scale` (the sizes in which the parameters matter), of length 1;
    `sigma` is the combination's standard uncertainty in the same units, infinite if undetermined.
    """

    direction: Series
    sigma: float

    def leading(self, share: float = 0.3) -> list[int]:
        """Return the parameters that carry at least `share` of the largest weight, largest first."""
        weights = np.abs(self.direction)
        order = np.argsort(-weights)
        return [int(i) for i in order if weights[i] >= share * weights[order[0]]]


def find_weak_directions(normal: Square, scale: Series, limit: float) -> list[WeakDirection]:
    """Return the combinations whose sigma exceeds `limit`, worst first.

    Parameters
    ----------
    normal : (parameters, parameters) information matrix.
    scale : (parameters,) the size at which each parameter matters to the user, in its unit.
    limit : in those sizes: 1 asks for what cannot be told better than its own size.
    """
    eigenvalues, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    floor = max(float(eigenvalues[-1]), 0.0) * 1e-14
    weak: list[WeakDirection] = []
    for eigenvalue, vector in zip(eigenvalues, vectors.T, strict=True):
        sigma = float("inf") if eigenvalue <= floor else float(1.0 / np.sqrt(eigenvalue))
        if sigma > limit:
            weak.append(WeakDirection(vector, sigma))
    return weak
