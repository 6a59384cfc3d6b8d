"""Flicker noise as a sum of first-order Gauss-Markov processes whose corners lie a constant factor apart."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Square

# Corner frequencies of neighbouring Gauss-Markov processes differ by this factor; the sum of their
# spectra then follows 1/f within 2 %.
OCTAVES = 4.0


def flicker_variance() -> float:
    """Return the variance of each process of the ladder for B = 1: ln r / π.

    Each of variance σ² adds a two-sided density σ² / (π f_c (1 + (f/f_c)²)); the sum over corners is
    σ² / (2 ln r f), which is B² / (2π f) with σ² = B² ln r / π. Between the ends the sum ripples about
    1/f by 0.3 % at r = 4, its Allan variance about the floor by 0.05 %.
    """
    return float(np.log(OCTAVES) / np.pi)


def flicker_corners(span: float, fastest: float) -> Series:
    """Return the corner frequencies of the ladder, Hz, from a quarter of 1/span upwards.

    Parameters
    ----------
    span : s, the longest time over which the noise is to wander as flicker does.
    fastest : Hz, where the ladder may end, such as half a sampling rate.
    """
    lowest = 0.25 / span
    count = max(int(np.ceil(np.log(fastest / lowest) / np.log(OCTAVES))), 1)
    return np.asarray(lowest * OCTAVES ** np.arange(count), dtype=np.float64)


@lru_cache(maxsize=32)
def flicker_recursions(samples: int, rate: float) -> tuple[Series, Series, Square]:
    """Return, for B = 1, memories and gains of recursions with one drive, and a root of their states' covariance.

    The sum of k processes with a drive each is drawn with a single drive: a sum of rational spectra is
    rational, and its minimum-phase factor splits into k first-order recursions of the same memories with
    other gains. Covariances, and with normal numbers the distribution, are the same, for one random
    number a sample instead of k.

    Parameters
    ----------
    samples, rate : of the sequence, the latter in Hz.
    """
    variance = np.log(OCTAVES) / np.pi
    lowest = 0.25 * rate / samples
    count = max(int(np.ceil(np.log(0.5 * rate / lowest) / np.log(OCTAVES))), 1)
    # 1 - memory, because a memory close to one keeps no digits of it
    loss = -np.expm1(-2.0 * np.pi * lowest * OCTAVES ** np.arange(count) / rate)
    gain = _single_drive(loss, variance * loss * (2.0 - loss))
    # E[x_i x_j] = g_i g_j / (1 - a_i a_j)
    covariance = np.outer(gain, gain) / (loss[:, None] + loss - np.outer(loss, loss))
    values, vectors = np.linalg.eigh(covariance)
    return 1.0 - loss, gain, vectors * np.sqrt(np.maximum(values, 0.0))


def _single_drive(loss: AnyArray, power: AnyArray) -> AnyArray:
    """Gains of recursions with one common drive whose sum has the spectrum of independent ones.

    With y = z + 1/z - 2 the spectrum of process j is ``power_j / (loss_j² - memory_j y)``. The sum has
    one zero between each two poles in y; taken inside the unit circle they give the minimum-phase factor,
    and its partial fractions the gains.
    """
    memory = 1.0 - loss
    below, above = np.log(loss[:-1] ** 2 / memory[:-1]), np.log(loss[1:] ** 2 / memory[1:])
    # bisection in log y: from minus infinity behind one pole to plus infinity before the next
    for _ in range(60):
        middle = 0.5 * (below + above)
        spectrum = np.sum(power / (loss**2 - memory * np.exp(middle)[:, None]), axis=1)
        below, above = np.where(spectrum < 0.0, middle, below), np.where(spectrum < 0.0, above, middle)
    y = np.exp(0.5 * (below + above))
    # w² / (1 - w) = y for w = 1 - zero
    zero_loss = 0.5 * (np.sqrt(y**2 + 4.0 * y) - y)
    # the residue at a_j is Π (a_j - b_k) / Π (a_j - a_k), both differences of losses
    distance = loss - loss[:, None]
    np.fill_diagonal(distance, 1.0)
    gain = np.prod(zero_loss - loss[:, None], axis=1) / np.prod(distance, axis=1)
    # H(1) is Σ gain / loss, and the spectrum there is Σ power / loss²
    return gain * np.sqrt(np.sum(power / loss**2)) / np.abs(np.sum(gain / loss))
