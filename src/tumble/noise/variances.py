"""Closed forms of every noise term at coefficient 1: Allan variance, spectrum, covariance of the integral.

The phase of a signal is its integral. All that contrasts of means can show, Allan variances among it,
follows from the generalised covariance s(t) of the phase, s″(t) = −R(t): it exists for terms that have no
variance, and polynomials in it up to the third degree cancel wherever two second differences meet.

References
----------
IEEE Std 952, annex C (two-sided densities). Riley, NIST SP 1065, section 5. For s(t): Greenhall and Riley,
"Uncertainty of stability variances based on finite differences", PTTI 2003.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.noise.flicker import flicker_corners, flicker_variance

LETTERS = ("Q", "N", "B", "K", "R")
"""The five terms of IEEE Std 952 in the order of their slopes: -1, -1/2, 0, +1/2, +1 of the deviation."""

FLOOR = 2.0 * np.log(2.0) / np.pi
"""Allan variance of flicker at B = 1, of which 0.664 is the root."""

# How far beyond the longest averaging time the ladder reaches that stands for flicker.
_REACH = 1024.0


def allan_variance_of(letter: str, tau: Series, rate: float | None = None) -> Series:
    """Return the Allan variance of a term whose coefficient is 1, over averaging times.

    Parameters
    ----------
    letter : "Q", "N", "B", "K" or "R".
    tau : s.
    rate : Hz of the samples, each the process at one instant (N: its mean since the last); None for a
        sensor that averages over the interval, the formulas of IEEE Std 952. The two differ where tau is
        a few samples, for B and K.
    """
    tau = np.asarray(tau, dtype=float)
    if letter == "Q":
        return 3.0 / tau**2
    if letter == "N":
        return 1.0 / tau
    if letter == "R":
        return 0.5 * tau**2
    if letter == "K":
        if rate is None:
            return tau / 3.0
        m = np.round(tau * rate)
        return (2.0 * m**2 + 1.0) / (6.0 * m * rate)
    if rate is None:
        return np.full(tau.shape, FLOOR)
    corners = flicker_corners(_REACH * float(tau.max(initial=1.0 / rate)), 0.5 * rate)
    parts = [markov_allan_variance(tau, 0.5 / (np.pi * corner), rate) for corner in corners]
    return flicker_variance() * np.sum(parts, axis=0)


def markov_allan_variance(tau: Series, correlation_time: float, rate: float | None = None) -> Series:
    """Return the Allan variance of a first-order Gauss-Markov process of variance 1.

    Parameters
    ----------
    tau, rate : as for `allan_variance_of`.
    correlation_time : s, over which the autocovariance falls to 1/e.
    """
    tau = np.asarray(tau, dtype=float)
    if rate is not None:
        return _sampled_markov(np.round(tau * rate), 1.0 / (rate * correlation_time))
    x = tau / correlation_time
    near = np.minimum(x, 0.05)
    far = np.maximum(x, 0.05)
    exact = 2.0 / far * (1.0 - (3.0 - 4.0 * np.exp(-far) + np.exp(-2.0 * far)) / (2.0 * far))
    # of the same by powers: the next term is 1e-9 of the first
    series = near * (
        2.0 / 3.0 - near * (0.5 - near * (7.0 / 30.0 - near * (1.0 / 12.0 - near * 31.0 / 1260.0)))
    )
    return np.where(x < 0.05, series, exact)


def _sampled_markov(m: Series, step: float) -> Series:
    """Allan variance over m samples that lie `step` correlation times apart."""
    loss = -np.expm1(-step)
    fallen = -np.expm1(-m * step)
    # of sums over i, j of a^|i - j|: within a block less between two neighbouring blocks
    exact = (m * loss * (2.0 - loss) - (1.0 - loss) * fallen * (2.0 + fallen)) / (m * loss) ** 2
    walk = 2.0 * loss * (2.0 * m**2 + 1.0) / (6.0 * m) * (1.0 - 0.75 * m * loss)
    near = m * step < 1e-3
    return near * walk + ~near * exact


def line_allan_variance(tau: Series, frequency: float, rate: float | None = None) -> Series:
    """Return the Allan variance of a sine of amplitude 1 and any phase.

    Parameters
    ----------
    tau, rate : as for `allan_variance_of`.
    frequency : Hz.
    """
    tau = np.asarray(tau, dtype=float)
    turn = np.pi * frequency * tau
    if rate is None:
        return np.sin(turn) ** 4 / turn**2
    return np.sin(turn) ** 4 / (np.round(tau * rate) * np.sin(np.pi * frequency / rate)) ** 2


def phase_covariance_of(letter: str, lag: AnyArray) -> AnyArray:
    """Return the generalised covariance s(t) of the integral of a term whose coefficient is 1; R has none.

    Parameters
    ----------
    letter : "Q", "N", "B" or "K".
    lag : s; for Q exact zeros matter.
    """
    t = np.abs(lag)
    if letter == "Q":
        return (t == 0.0).astype(float)
    if letter == "N":
        return -0.5 * t
    if letter == "K":
        return t**3 / 12.0
    return t**2 * np.log(np.where(t == 0.0, 1.0, t)) / (2.0 * np.pi)


def markov_phase_covariance(lag: AnyArray, correlation_time: float) -> AnyArray:
    """Return s(t) of a Gauss-Markov process of variance 1, -T² (e^-x + x - 1 - x²/2), x = abs(t)/T."""
    x = np.abs(lag) / correlation_time
    near = np.minimum(x, 0.05)
    series = -(near**3) / 6.0 * (1.0 - near / 4.0 * (1.0 - near / 5.0 * (1.0 - near / 6.0)))
    exact = np.expm1(-x) + x - 0.5 * x**2
    return -(correlation_time**2) * np.where(x < 0.05, series, exact)


def mean_variance_of(letter: str, seconds: Series) -> Series:
    """Return the variance of a mean over `seconds`, up to a constant that differences of it do not have.

    For B, K and R the variance itself is infinite, but not that of one mean against a longer one's.

    Parameters
    ----------
    letter : "Q", "N", "B", "K" or "R".
    seconds : s.
    """
    if letter == "R":
        return -(seconds**2) / 12.0
    return (
        -2.0
        * (phase_covariance_of(letter, seconds) - phase_covariance_of(letter, 0.0 * seconds))
        / seconds**2
    )
