"""What neighbours share: the covariance by biases that wander from hold to rotation to hold.

The adjustment takes the bias of each hold, each turn and each rotation for an independent draw. 1/f noise is none:
close stretches have it nearly in common, and what all have in common is no error, for the bias of a recording is its
mean. What the wander over each stretch does to each unknown is known, and so is the covariance of any two stretches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vector
from tumble.calibration.joint.wander import covariance_about_the_mean

# More stretches than these are taken together, two neighbours at a time.
MOST_STRETCHES = 2000


@dataclass(frozen=True, slots=True)
class Drift:
    """How the terms of one kind show what the gyros' biases wander by.

    Attributes
    ----------
    start, stop : (terms,) s.
    by_bias : (terms, m, 3) derivatives of the whitened residuals by the bias, raw.
    independent : (terms, m, m) whitened covariance that the adjustment gives the wander, each term for itself.
    """

    start: Series
    stop: Series
    by_bias: AnyArray
    independent: AnyArray


def shared_wander(drifts: list[tuple[Drift, AnyArray]], density: Vector, span: tuple[float, float]) -> Square:
    """Return (unknowns, unknowns) by how much the covariance differs from that of independent draws.

    Parameters
    ----------
    drifts : of all terms that show it, with the gains (terms, unknowns, m) by whitened errors.
    density : (3,) raw², of the wander per unit of ``ln f``.
    span : s, of the recording.
    """
    response = np.concatenate([gain @ drift.by_bias for drift, gain in drifts])
    start = np.concatenate([drift.start for drift, _ in drifts])
    stop = np.concatenate([drift.stop for drift, _ in drifts])
    start, stop, response = _fewer(start, stop, response)
    together = covariance_about_the_mean(start, stop, span)
    made = np.zeros((response.shape[1], response.shape[1]))
    for axis in range(3):
        made += density[axis] * response[:, :, axis].T @ together @ response[:, :, axis]
    for drift, gain in drifts:
        made -= np.einsum("tam,tmn,tbn->ab", gain, drift.independent, gain, optimize=True)
    return made


def _fewer(start: Series, stop: Series, response: AnyArray) -> tuple[Series, Series, AnyArray]:
    shown = np.any(response != 0.0, axis=(1, 2)) & (stop > start)
    start, stop, response = start[shown], stop[shown], response[shown]
    order = np.argsort(start)
    start, stop, response = start[order], stop[order], response[order]
    while start.size > MOST_STRETCHES:
        at = np.arange(0, start.size, 2)
        start, response = start[at], np.add.reduceat(response, at, axis=0)
        stop = np.maximum.reduceat(stop, at)
    return start, stop, response
