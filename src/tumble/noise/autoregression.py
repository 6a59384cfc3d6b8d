"""Autoregressive models of noise: estimated by Burg's recursion, chosen by BIC, tested.

x[k] − m = a₁ (x[k−1] − m) + … + a_p (x[k−p] − m) + e[k], with white e. A first-order Gauss-Markov process
is the case p = 1.

References
----------
Burg, J. P., *Maximum entropy spectral analysis*, Stanford 1975. Box, G. E. P., G. M. Jenkins and G. C.
Reinsel, *Time Series Analysis*, 4th ed., Wiley 2008, chapters 3 and 7. Brockwell, P. J., and R. A. Davis,
*Time Series: Theory and Methods*, 2nd ed., Springer 1991, section 8.1 (asymptotic covariance). Ljung, G. M., and
G. E. P. Box, *On a measure of lack of fit in time series models*, Biometrika 65 (1978) 297-303. Nassar, S., and
N. El-Sheimy, *A combined algorithm of improving INS error modeling and sensor measurements for accurate INS/GPS
navigation*, GPS Solutions 10 (2006) 29-39: such models of inertial sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from tumble.arrays import Series, Square
from tumble.errors import UsageError
from tumble.records import dataclass

Ranges: TypeAlias = Sequence[tuple[int, int]]

_LEAST_BEYOND = 8  # samples that a piece must have beyond the order


@dataclass(frozen=True)
class Autoregression:
    """A stationary autoregressive model, in the signal's unit u.

    Attributes
    ----------
    mean : m, u.
    coefficients : (order,) a₁ … a_p.
    innovation_variance : of e, u².
    samples : that it was estimated from.
    """

    mean: float
    coefficients: Series
    innovation_variance: float
    samples: int

    @property
    def order(self) -> int:
        """Samples back that tell of the next."""
        return int(self.coefficients.size)

    @property
    def random_walk(self) -> float:
        """N of IEEE Std 952 times √rate, u: σ_e/(1 − Σ a), by which long means scatter times √samples."""
        return float(np.sqrt(self.innovation_variance) / (1.0 - self.coefficients.sum()))

    def autocovariance(self, lags: int) -> Series:
        """Return the autocovariance (u²) of lags 0 to `lags`, by the Yule-Walker equations.

        Parameters
        ----------
        lags : the longest, in samples.
        """
        p = self.order
        equations = np.eye(p + 1)
        for row in range(p + 1):
            for i, a in enumerate(self.coefficients, start=1):
                equations[row, abs(row - i)] -= a
        found = np.zeros(max(lags, p) + 1)
        found[: p + 1] = np.linalg.solve(equations, self.innovation_variance * np.eye(p + 1)[0])
        for k in range(p + 1, found.size):
            found[k] = float(self.coefficients @ found[k - p : k][::-1]) if p else 0.0
        return found[: lags + 1]

    @property
    def covariance(self) -> Square:
        """Return the asymptotic covariance σ_e² Γ⁻¹/n of the coefficients.

        It holds of many samples and away from the unit root.
        """
        from scipy.linalg import toeplitz

        if not self.order:
            return np.zeros((0, 0))
        gamma = np.asarray(toeplitz(self.autocovariance(self.order - 1)), dtype=np.float64)
        return np.asarray(np.linalg.inv(gamma) * self.innovation_variance / self.samples, dtype=np.float64)

    def power_spectrum(self, frequency: Series, rate: float) -> Series:
        """Return the spectral density, u²/Hz, over negative frequencies too.

        Parameters
        ----------
        frequency : Hz, up to half the rate.
        rate : Hz.
        """
        turn = np.exp(-2j * np.pi * np.outer(np.asarray(frequency) / rate, np.arange(1, self.order + 1)))
        transfer = np.abs(1.0 - turn @ self.coefficients) ** 2
        return self.innovation_variance / (rate * transfer)

    def predicted(self, signal: Series) -> Series:
        """Return what the samples before foretell of each sample; (samples,), the first few nan.

        Parameters
        ----------
        signal : (samples,) without gaps.
        """
        result = np.full(signal.size, np.nan)
        p = self.order
        if signal.size > p:
            result[p:] = self.mean
            for i, a in enumerate(self.coefficients, start=1):
                result[p:] += a * (signal[p - i : signal.size - i] - self.mean)
        return result

    def whiteness(self, signal: Series, pieces: Ranges | None = None) -> float:
        """Return how probable it is, of white noise, that what is left over is as correlated (Ljung and Box 1978).

        Parameters
        ----------
        signal, pieces : as for `burg`; lags up to 20 beyond the order are compared.

        Raises
        ------
        UsageError
            If no piece is longer than the lags.
        """
        from scipy.stats import chi2

        p, lags = self.order, self.order + 20
        ranges = [(0, signal.size)] if pieces is None else pieces
        left = [self.predicted(signal[a:b])[p:] - signal[a + p : b] for a, b in ranges if b - a > lags + p]
        if not left:
            raise UsageError(f"A test of whiteness over {lags} lags needs more samples than that in a row.")
        count = sum(e.size for e in left)
        mean = sum(float(e.sum()) for e in left) / count
        left = [e - mean for e in left]
        power, *shifted = (sum(float(e[k:] @ e[: e.size - k]) for e in left) for k in range(lags + 1))
        rho = np.array(shifted) / power
        statistic = count * (count + 2.0) * np.sum(rho**2 / (count - np.arange(1, lags + 1)))
        return float(chi2.sf(statistic, lags - p))


def burg(signal: Series, order: int, pieces: Ranges | None = None) -> Autoregression:
    """Estimate a model by Burg's recursion: least errors of prediction forwards and backwards (always stable).

    Parameters
    ----------
    signal : (samples,) evenly spaced; its mean is taken off.
    order : of the model.
    pieces : half-open ranges without gaps, whose errors are added; None for all of the signal.

    Raises
    ------
    UsageError
        If the signal is too short for the order, or never changes.
    """
    return burg_ladder(signal, order, pieces)[-1]


def burg_ladder(signal: Series, most: int, pieces: Ranges | None = None) -> list[Autoregression]:
    """Return Burg's models of orders 0 to `most`: each step of the recursion is one.

    Parameters
    ----------
    signal, pieces : as for `burg`.
    most : the highest order.

    Raises
    ------
    UsageError
        If the signal is too short for the order, or never changes.
    """
    parts, mean, count = _parts(signal, most, pieces)
    power = sum(float(x @ x) for x in parts) / count
    coefficients = np.zeros(0)
    ladder = [Autoregression(mean, coefficients, power, count)]
    ahead, back = [x[1:] for x in parts], [x[:-1] for x in parts]
    for _ in range(most):
        shared = sum(float(f @ b) for f, b in zip(ahead, back, strict=True))
        both = sum(float(f @ f) + float(b @ b) for f, b in zip(ahead, back, strict=True))
        reflection = 2.0 * shared / both if both > 0.0 else 0.0
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
        power *= 1.0 - reflection**2
        ladder.append(Autoregression(mean, coefficients, power, count))
        ahead, back = (
            [(f - reflection * b)[1:] for f, b in zip(ahead, back, strict=True)],
            [(b - reflection * f)[:-1] for f, b in zip(ahead, back, strict=True)],
        )
    return ladder


def choose_order(signal: Series, most: int, pieces: Ranges | None = None) -> Autoregression:
    """Return Burg's model of the order that has the least BIC, n ln σ_e² + p ln n.

    Parameters
    ----------
    signal, pieces : as for `burg`.
    most : the highest order that is tried.

    Raises
    ------
    UsageError
        If the signal is too short for the highest order, or never changes.
    """
    return min(burg_ladder(signal, most, pieces), key=_information_criterion)


def _parts(signal: Series, order: int, pieces: Ranges | None) -> tuple[list[Series], float, int]:
    """The pieces less their common mean, the mean, and the samples."""
    ranges = [(0, signal.size)] if pieces is None else pieces
    parts = [np.asarray(signal[a:b], dtype=np.float64) for a, b in ranges if b - a >= order + _LEAST_BEYOND]
    if order < 0 or not parts:
        raise UsageError(
            f"An autoregression of order {order} needs {max(order, 0) + _LEAST_BEYOND} samples in a row at least."
        )
    count = sum(x.size for x in parts)
    mean = sum(float(x.sum()) for x in parts) / count
    parts = [x - mean for x in parts]
    if not sum(float(x @ x) for x in parts) > 0.0:
        raise UsageError("The signal never changes: there is no noise to make a model of.")
    return parts, mean, count


def _information_criterion(model: Autoregression) -> float:
    n = float(model.samples)
    return n * float(np.log(model.innovation_variance)) + model.order * float(np.log(n))
