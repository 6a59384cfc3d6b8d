"""Optional terms: all are tried at once, and the least significant is dropped until every one left is wanted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tumble.arrays import Series, Square, inverted


def keep_wanted(
    values: Series,
    covariances: Sequence[Square],
    places: Mapping[str, np.ndarray],
    test: Callable[[str, Series, list[Square]], tuple[float, bool]],
) -> list[str]:
    """Return the terms that are wanted.

    What the others would be without a term follows from the covariance: nothing is adjusted anew for it.

    Parameters
    ----------
    values : (free,) of all free unknowns, the terms' among them.
    covariances : (free, free) of them; the first is the adjustment's, the others what it might be besides.
    places : term -> where its unknowns stand.
    test : of a term's name, its values and its own part of each covariance, the probability of chance, and whether
        the term is kept.
    """
    left, values, covariances = list(places), values.copy(), [c.copy() for c in covariances]
    while left:
        found = {
            name: test(
                name, values[places[name]], [c[np.ix_(places[name], places[name])] for c in covariances]
            )
            for name in left
        }
        weakest = max(left, key=lambda name: found[name][0])
        if found[weakest][1]:
            break
        left.remove(weakest)
        gone = places[weakest]
        share = covariances[0][:, gone] @ inverted(covariances[0][np.ix_(gone, gone)])
        values = values - share @ values[gone]
        without = np.eye(values.size)
        without[:, gone] -= share
        covariances = [without @ c @ without.T for c in covariances]
    return left
