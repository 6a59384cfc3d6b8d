"""What the noise of a unit does to the means of holds: together, not one by one, because a bias wanders.

White noise falls as one over the time of a hold. Flicker and rate random walk move the biases from hold to
hold, and neighbours alike: longer holds do not help, other poses do only in part. The part that is common to
all holds is the bias of that session itself, which is what a calibration is asked for; so everything here is
about the bias' mean over the whole test.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors, inverted
from tumble.noise import flicker_corners, flicker_variance
from tumble.simulation import TriadNoise

# Corners above this many times one over a hold average out within it.
_FASTEST = 20.0


def hold_times(dwells: Series, turn: float) -> Table:
    """Return (holds, 2): start and stop of holds one after the other, s.

    Parameters
    ----------
    dwells : (holds,) s.
    turn : s between two.
    """
    starts = np.concatenate([[0.0], np.cumsum(dwells[:-1] + turn)])
    return np.column_stack([starts, starts + dwells])


def white_density(noise: TriadNoise, rate: float) -> float:
    """Return the square root of the variance of one second's mean, converter included, SI·√s.

    Parameters
    ----------
    noise : of a triad.
    rate : Hz, of the samples.
    """
    return float(np.sqrt(noise.random_walk**2 + noise.resolution**2 / 12.0 / rate))


def hold_covariance(times: Table, noise: TriadNoise, rate: float = 100.0) -> Square:
    """Return (holds, holds): covariance of one axis' means over holds, less its mean over the whole test, SI².

    Parameters
    ----------
    times : (holds, 2) start and stop, s.
    noise : of the triad; flicker is the ladder of Gauss-Markov processes that the simulator plays.
    rate : Hz, of the samples.
    """
    begin, end = float(times[0, 0]), float(times[-1, 1])
    intervals = np.vstack([times, [[begin, end]]])
    wander = np.zeros((intervals.shape[0], intervals.shape[0]))
    if noise.bias_instability > 0.0:
        shortest = float(np.min(times[:, 1] - times[:, 0]))
        for corner in flicker_corners(end - begin, _FASTEST / shortest).tolist():
            wander += (
                flicker_variance()
                * noise.bias_instability**2
                * _markov(intervals, 1.0 / (2.0 * np.pi * corner))
            )
    if noise.rate_random_walk > 0.0:
        wander += noise.rate_random_walk**2 * _walk(intervals - begin)
    centred = wander - wander[:, -1:] - wander[-1:, :] + wander[-1, -1]
    white = white_density(noise, rate) ** 2 / (times[:, 1] - times[:, 0])
    return np.asarray(centred[:-1, :-1] + np.diag(white), dtype=np.float64)


def predict_covariance(
    rows: Table,
    directions: Vectors,
    covariance: Table,
    known: Square | None = None,
) -> Square:
    """Return the covariance of what least squares makes of the norms of holds, whose noise is not independent.

    Parameters
    ----------
    rows : (holds, p) what each norm says of the parameters, in the unit of the noise.
    directions : (holds, 3) unit vectors up: two holds share noise as far as they point alike.
    covariance : (holds, holds) of one axis' means, see `hold_covariance`; its diagonal weighs, as in a calibration
        that looks at each hold's own scatter and at their wander.
    known : (p, p) information that is there already, exact in what it says.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the holds do not tell the parameters.
    """
    weighted = rows / np.diag(covariance)[:, None]
    information = rows.T @ weighted + (0.0 if known is None else known)
    cofactor = inverted(information)
    true = (directions @ directions.T) * covariance
    spread = weighted.T @ true @ weighted + (0.0 if known is None else known)
    return np.asarray(cofactor @ spread @ cofactor, dtype=np.float64)


@lru_cache(maxsize=64)
def wander_sigma(noise: TriadNoise, dwell: float, span: float) -> float:
    """Return how far a bias' mean over one hold wanders from its mean over the test, one sigma, SI.

    Parameters
    ----------
    noise : of the triad.
    dwell, span : s, of a hold and of the whole test.
    """
    quiet = TriadNoise(bias_instability=noise.bias_instability, rate_random_walk=noise.rate_random_walk)
    starts = np.linspace(0.0, max(span - dwell, 0.0), 9)
    times = np.column_stack([starts, starts + dwell])
    return float(np.sqrt(max(float(np.mean(np.diag(hold_covariance(times, quiet)))), 0.0)))


def _markov(intervals: Table, memory: float) -> Square:
    """Covariances of means over intervals of a process of unit variance with exp(-t/memory)."""

    def twice(a: Table, b: Table) -> Table:
        lag = np.abs(a - b)
        return np.asarray(-lag - np.exp(-lag), dtype=np.float64)

    return _mean_product(twice, intervals / memory)


def _walk(intervals: Table) -> Square:
    """Covariances of means over intervals of a walk that starts at zero."""

    def twice(a: Table, b: Table) -> Table:
        low, high = np.minimum(a, b), np.maximum(a, b)
        return np.asarray(low**2 * high / 2.0 - low**3 / 6.0, dtype=np.float64)

    return _mean_product(twice, intervals)


def _mean_product(twice: Callable[[Table, Table], Table], intervals: Table) -> Square:
    """Means over pairs of intervals of a covariance whose integral over both of its times is given."""
    start, stop = intervals.T
    whole = (
        twice(stop[:, None], stop[None])
        - twice(stop[:, None], start[None])
        - twice(start[:, None], stop[None])
        + twice(start[:, None], start[None])
    )
    lengths = stop - start
    return np.asarray(whole / np.outer(lengths, lengths), dtype=np.float64)
