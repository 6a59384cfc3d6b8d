"""Equivalent degrees of freedom of Allan variances, and their intervals.

A variance that is estimated from overlapping differences is spread like chi square with fewer degrees of
freedom than there are differences. How many depends on the kind of noise, named here by the exponent α of
the spectrum of the signal, S(f) ~ f^α: 2 quantisation, 0 white, -1 flicker, -2 random walk.

References
----------
Greenhall, C. A., and W. J. Riley, *Uncertainty of stability variances based on finite differences*, 35th
PTTI Meeting, 2003: the combined algorithm, which is that of W. J. Riley, *Handbook of Frequency Stability
Analysis*, NIST SP 1065, 2008, section 5.4.1. Departures: where the sum has more than some hundred terms,
they read it from tables of two coefficients; here it is taken at fewer, evenly spaced places instead, as
they do themselves near the end of the data. Their phase is averaged over a sample before differences are
taken (F = m), which the integral of a rate is not: for α of 0 and below it is taken at instants here
(F infinite). For white noise that is exact at all averaging times, and theirs is off by up to a sixth at a
single sample. α = 1 is left out, because no term of an inertial sensor's model has it.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from tumble.arrays import AnyArray, Series

EXPONENTS = (2, 0, -1, -2)
_MOST_TERMS = 256


def _kernel(t: AnyArray, exponent: int) -> AnyArray:
    """Return s_w(t, α), the generalised autocovariance of the phase up to a factor."""
    size = np.abs(t)
    power = 3 - exponent
    if exponent % 2 == 0:
        return (-1.0) ** (exponent // 2) * size**power
    # t^(3-α) ln t, which is 0 at 0
    sign = (-1.0) ** ((exponent - 1) // 2)
    return sign * size**power * np.log(np.where(size > 0.0, size, 1.0))


def _differenced(t: Series, exponent: int) -> Series:
    """Return s_z(t, α): the autocovariance of the second differences, F infinite."""
    lags = np.arange(-2, 3)
    weights = np.array([(-1.0) ** lag * comb(4, 2 + lag) for lag in lags.tolist()])
    # A sum, not a product of matrices: linear algebra would wake a thread for each core.
    return np.sum(weights[:, None] * _kernel(t + lags[:, None], exponent + 2), axis=0)


def _inverse_freedom(terms: int, count: float, stride: float, exponent: int) -> float:
    """Return the basic sum over J terms, divided by s_z(0)² M: one over the degrees of freedom."""
    every, later = _sums(terms, stride, exponent)
    return (every - later / count) / count


@lru_cache(maxsize=128)
def _sums(terms: int, stride: float, exponent: int) -> tuple[float, float]:
    """Return the sum of squared autocovariances, and that by their lags: long averaging times have the same."""
    values = _differenced(np.arange(terms + 1) / stride, exponent) ** 2
    weights = np.full(terms + 1, 2.0)
    weights[0], weights[-1] = 1.0, (1.0 if terms else 0.5)
    shares = weights * values / values[0]
    return float(np.sum(shares)), float(np.sum(np.arange(terms + 1) * shares))


@lru_cache(maxsize=65_536)
def degrees_of_freedom(exponent: int, averaging: int, samples: int, stride: int | None = None) -> float:
    """Return the equivalent degrees of freedom of an Allan variance from overlapping differences; 0 if there are none.

    Parameters
    ----------
    exponent : α of the noise assumed, 2, 0, -1 or -2.
    averaging : samples in an averaging time, m.
    samples : of the signal, without gaps.
    stride : differences begun in each averaging time; None for one at every sample.

    Raises
    ------
    ValueError
        If there is no formula for the exponent.

    Examples
    --------
    A single second difference has one degree of freedom, whatever the noise:

    >>> degrees_of_freedom(0, 50, 100)
    1.0
    """
    if exponent not in EXPONENTS:
        raise ValueError(f"no degrees of freedom for noise of exponent {exponent}")
    per_time = averaging if stride is None else min(stride, averaging)
    spare = samples - 2 * averaging
    if spare < 0:
        return 0.0
    count = 1 + (per_time * spare) // averaging
    if exponent == 2:
        return _of_quantisation(count, per_time)
    terms = min(count, 3 * per_time)
    coarse = max(1.0, terms / _MOST_TERMS)
    inverse = _inverse_freedom(round(terms / coarse), count / coarse, per_time / coarse, exponent)
    # Fewer than one, and more than there are differences, is rounding.
    return float(np.clip(1.0 / inverse, 1.0, count))


def _of_quantisation(count: int, per_time: int) -> float:
    """White noise of the phase: differences agree only at whole averaging times, so the sum is short."""
    total = 1.0
    for lag in (1, 2):
        if lag * per_time < count:
            share = comb(4, 2 + lag) / comb(4, 2)
            total += 2.0 * (1.0 - lag * per_time / count) * share**2
    return count / total


def chi_square_interval(variance: AnyArray, edf: AnyArray, confidence: float) -> tuple[AnyArray, AnyArray]:
    """Return the limits between which the true variance lies with the stated probability.

    Parameters
    ----------
    variance, edf : of one shape; where there are no degrees of freedom, the limits are 0 and infinity.
    confidence : two-sided, between 0 and 1; as much is left out above as below.
    """
    from scipy.special import gammaincinv  # of the chi-square distribution's 0.3 s of import, this is 0.05

    known = edf > 0.0
    half = 0.5 * np.where(known, edf, 1.0)
    low = half * variance / gammaincinv(half, 0.5 + 0.5 * confidence)
    high = half * variance / gammaincinv(half, 0.5 - 0.5 * confidence)
    return np.where(known, low, 0.0), np.where(known, high, np.inf)
