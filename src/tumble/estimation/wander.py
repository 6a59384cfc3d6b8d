"""Biases that wander (1/f noise): cosines over a stretch of time, and what neighbouring stretches share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vector, inverted
from tumble.errors import ObservabilityError
from tumble.estimation.equations import Drift


def wander_basis(places: Series, count: int) -> tuple[AnyArray, Series]:
    """Return cosines (places, count) over a rotation, and the variance of each one's amplitude by 1/f noise.

    Parameters
    ----------
    places : (places,) of the rotation, 0 to 1.
    count : how many.

    Notes
    -----
    In units of the wander's density per ``ln f``. The integral of ``-4 ln |t - s| cos(n pi t) cos(n pi s)`` over the
    unit square, for ``a = n pi``: ``4 (Si(a) / a - (1 - cos a) / a²)``, which nears 2 / n; two cosines correlate
    by 0.12 at most.
    """
    turns = np.pi * np.arange(1, count + 1)
    return np.cos(turns * places[:, None]), _variances(count)


@cache
def _variances(count: int) -> Series:
    turns = np.pi * np.arange(1, count + 1)
    # Si half a wave at a time: Gauss's formula of twenty places is exact to rounding, and scipy.special slow to import.
    places, weights = np.polynomial.legendre.leggauss(20)
    x = turns[:, None] - 0.5 * np.pi * (1.0 - places)
    sine_integral = 0.5 * np.pi * np.cumsum((np.sin(x) / x) @ weights)
    made = np.asarray(4.0 * (sine_integral / turns - (1.0 - np.cos(turns)) / turns**2), dtype=np.float64)
    made.flags.writeable = False
    return made


def faster_variance(windows: int, count: int) -> float:
    """Return the variance of a window's mean by what wanders faster than `count` cosines, down to the window.

    Parameters
    ----------
    windows : as many as go into the stretch; all in all their variance about the stretch's mean is ``ln(windows)``.
    count : of cosines, of which each has half its amplitude's variance on average.
    """
    return max(float(np.log(windows) - 0.5 * np.sum(_variances(count))), 0.0)


def covariance_about_the_mean(starts: Series, stops: Series, span: tuple[float, float]) -> Square:
    """Return (stretches, stretches) covariance of the means of stretches by a wander, about its mean over all.

    Parameters
    ----------
    starts, stops : (stretches,) s.
    span : s, from when to when the wander's mean is taken.

    Notes
    -----
    In units of the wander's density per ``ln f``. But for a constant that no difference from a mean shows, the
    covariance of 1/f noise is minus the logarithm of the time between; its means over two stretches are closed.
    """
    starts, stops = np.append(starts, span[0]), np.append(stops, span[1])
    whole = _mean_of_minus_logarithm(starts, stops)
    own, of_mean = whole[:-1, :-1], whole[:-1, -1]
    return np.asarray(own - of_mean[:, None] - of_mean[None] + whole[-1, -1], dtype=np.float64)


def _mean_of_minus_logarithm(starts: Series, stops: Series) -> Square:
    """Return the mean of ``-ln |t - s|`` over t of one stretch and s of another, of any two."""
    # Windows meet: of most edges the one is another's.
    edges, at = np.unique(np.concatenate([starts, stops]), return_inverse=True)
    size, (first, last) = np.abs(edges[:, None] - edges), np.split(at, 2)
    # Integral, twice, of the logarithm.
    whole = 0.5 * size**2 * np.log(np.maximum(size, 1e-300)) - 0.75 * size**2
    across = whole[last][:, first]
    total = across + across.T - whole[last][:, last] - whole[first][:, first]
    return -total / ((stops - starts)[:, None] * (stops - starts))


# Of more stretches than these neighbours are taken together.
MOST_STRETCHES = 2000


def shared_wander(
    drifts: Sequence[tuple[Drift, AnyArray]],
    density: Vector,
    span: tuple[float, float],
    once: dict[bytes, AnyArray] | None = None,
) -> Square:
    """Return (unknowns, unknowns) by how much the covariance differs from that of independent draws.

    The adjustment takes the bias of each hold, each turn and each rotation for an independent draw. 1/f noise is none:
    close stretches have it nearly in common, and what all have in common is no error, for the bias of a recording is
    its mean. What the wander over each stretch does to each unknown is known, and so is the covariance of any two.

    Parameters
    ----------
    drifts : whitened, of all terms that show it, with the gains (terms, unknowns, m) by whitened errors.
    density : (3,) raw², of the wander per unit of ``ln f``.
    span : s, of the recording.
    once : is given the covariance of the stretches, and asked for it first.
    """
    response = np.concatenate([gain @ drift.by_bias for drift, gain in drifts])
    start = np.concatenate([drift.start for drift, _ in drifts])
    stop = np.concatenate([drift.stop for drift, _ in drifts])
    start, stop, response = _fewer(start, stop, response)
    once, key = {} if once is None else once, np.concatenate([start, stop, span]).tobytes()
    if key not in once:
        once[key] = covariance_about_the_mean(start, stop, span)
    together = once[key]
    made = np.zeros((response.shape[1], response.shape[1]))
    for axis in range(3):
        made += density[axis] * response[:, :, axis].T @ together @ response[:, :, axis]
    for drift, gain in drifts:
        made -= carried(gain, drift.independent)
    return made


def carried(gain: AnyArray, covariance: AnyArray) -> Square:
    """Return (unknowns, unknowns) the covariance of what errors of terms do together.

    Parameters
    ----------
    gain : (terms, unknowns, m).
    covariance : (terms, m, m) of the errors.
    """
    return np.tensordot(gain @ covariance, gain, axes=((0, 2), (0, 2)))


def _fewer(start: Series, stop: Series, response: AnyArray) -> tuple[Series, Series, AnyArray]:
    shown = np.any(response != 0.0, axis=(1, 2)) & (stop > start)
    start, stop, response = start[shown], stop[shown], response[shown]
    order = np.argsort(start)
    start, stop, response = start[order], stop[order], response[order]
    at = first_of_neighbours(start.size, MOST_STRETCHES)
    return start[at], np.maximum.reduceat(stop, at), np.add.reduceat(response, at, axis=0)


def first_of_neighbours(count: int, most: int) -> np.ndarray:
    """Return (groups,) the first of each group of neighbours, of groups of one size but the last.

    Parameters
    ----------
    count, most : of neighbours, and of groups: each has as few as that takes.
    """
    return np.arange(0, count, max(1, -(-count // most)))


def wider(covariance: Square, change: Square) -> Square:
    """Return a covariance that is at least as wide as it is with and without a change, in every direction.

    Parameters
    ----------
    covariance, change : (unknowns, unknowns) positive definite, and symmetric.

    Raises
    ------
    ObservabilityError
        If the covariance is not positive definite.
    """
    try:
        root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise ObservabilityError("The covariance of the adjustment is not positive definite.") from error
    inverse = inverted(root)
    values, vectors = np.linalg.eigh(inverse @ change @ inverse.T)
    along = root @ vectors
    return covariance + (along * np.maximum(values, 0.0)) @ along.T
