"""Autoregressive models of noise: estimated, chosen, tested, and as what filters need.

x[k] − m = a₁ (x[k−1] − m) + … + a_p (x[k−p] − m) + e[k], with white e. A first-order Gauss-Markov process
is the case p = 1.

References
----------
Burg, J. P., *Maximum entropy spectral analysis*, Stanford 1975. Box, G. E. P., G. M. Jenkins and G. C.
Reinsel, *Time Series Analysis*, 4th ed., Wiley 2008, chapters 3 and 7. Brockwell, P. J., and R. A. Davis,
*Time Series: Theory and Methods*, 2nd ed., Springer 1991, sections 8.1 and 9.3 (asymptotic covariance,
AICc). Akaike, H., *Fitting autoregressive models for prediction*, Ann. Inst. Stat. Math. 21 (1969) 243-247
(FPE). Ljung, G. M., and G. E. P. Box, *On a measure of lack of fit in time series models*, Biometrika 65
(1978) 297-303. Nassar, S., and N. El-Sheimy, *A combined algorithm of improving INS error modeling and
sensor measurements for accurate INS/GPS navigation*, GPS Solutions 10 (2006) 29-39: such models of
inertial sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import Series, Square
from tumble.errors import UsageError
from tumble.noise.state_space import DiscreteNoise
from tumble.records import dataclass

Method: TypeAlias = Literal["burg", "yule-walker"]
Criterion: TypeAlias = Literal["bic", "aicc", "fpe"]
Ranges: TypeAlias = Sequence[tuple[int, int]]

_LEAST_BEYOND = 8  # samples that a piece must have beyond the order


@dataclass(frozen=True, slots=True)
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

        It holds for Burg's and Yule and Walker's estimates alike, of many samples and away from the unit root.
        """
        from scipy.linalg import toeplitz

        if not self.order:
            return np.zeros((0, 0))
        gamma = np.asarray(toeplitz(self.autocovariance(self.order - 1)), dtype=np.float64)
        return np.asarray(np.linalg.inv(gamma) * self.innovation_variance / self.samples, dtype=np.float64)

    def power_spectrum(self, frequency: Series, rate: float, *, sides: int = 2) -> Series:
        """Return the spectral density, u²/Hz.

        Parameters
        ----------
        frequency : Hz, up to half the rate.
        rate : Hz.
        sides : 2 as in IEEE Std 952; 1 for twice as much, as Welch's method gives it.
        """
        turn = np.exp(-2j * np.pi * np.outer(np.asarray(frequency) / rate, np.arange(1, self.order + 1)))
        transfer = np.abs(1.0 - turn @ self.coefficients) ** 2
        return (2.0 if sides == 1 else 1.0) * self.innovation_variance / (rate * transfer)

    def discrete(self, interval: float) -> DiscreteNoise:
        """Return the model as a process of a Kalman filter: the last p samples are its states.

        Nothing white is added to the sample: all of the noise is in the states. The mean is not among them.

        Parameters
        ----------
        interval : s between samples.
        """
        from scipy.linalg import toeplitz

        p = self.order
        if not p:
            empty = np.zeros((0, 0))
            return DiscreteNoise((), empty, empty, np.zeros(0), empty, self.innovation_variance, interval)
        transition = np.eye(p, k=-1)
        transition[0] = self.coefficients
        noise = np.zeros((p, p))
        noise[0, 0] = self.innovation_variance
        start = np.asarray(toeplitz(self.autocovariance(p - 1)), dtype=np.float64)
        names = tuple("autoregression" if i == 0 else f"{i} sample(s) before" for i in range(p))
        return DiscreteNoise(names, transition, noise, np.eye(p)[0], start, 0.0, interval)

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


@dataclass(frozen=True, slots=True)
class ChosenOrder:
    """A model of the order that a criterion prefers.

    Attributes
    ----------
    model : of that order.
    criterion : its name.
    values : (orders,) the criterion of orders 0, 1, 2, …, less its least.
    """

    model: Autoregression
    criterion: Criterion | str
    values: Series


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Ljung and Box's test of what a model leaves over.

    Attributes
    ----------
    statistic : chi-square distributed with `freedom` degrees if what is left over is white.
    freedom : lags less order.
    probability : of a statistic as large as that, if it is.
    lags : compared, in samples.
    """

    statistic: float
    freedom: int
    probability: float
    lags: int


def yule_walker(signal: Series, order: int, pieces: Ranges | None = None) -> Autoregression:
    """Estimate a model from the autocovariances, by the Yule-Walker equations (always stable).

    The autocovariances are the biased ones; near a unit root the estimate falls short, and Burg's is better.

    Parameters
    ----------
    signal : (samples,), any unit.
    order : p.
    pieces : half-open ranges without gaps; None for all of the signal.

    Raises
    ------
    UsageError
        If the signal is too short for the order, or never changes.
    """
    from scipy.linalg import solve_toeplitz

    parts, mean, count = _parts(signal, order, pieces)
    gamma = (
        np.array([sum(float(x[lag:] @ x[: x.size - lag]) for x in parts) for lag in range(order + 1)]) / count
    )
    if not order:
        return Autoregression(mean, np.zeros(0), float(gamma[0]), count)
    found = np.asarray(solve_toeplitz(gamma[:-1], gamma[1:]), dtype=np.float64)
    return Autoregression(mean, found, float(gamma[0] - found @ gamma[1:]), count)


def burg(signal: Series, order: int, pieces: Ranges | None = None) -> Autoregression:
    """Estimate a model by Burg's recursion: least errors of prediction forwards and backwards (always stable).

    Parameters
    ----------
    signal, order, pieces : as for `yule_walker`; the errors of all pieces are added.

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


def choose_order(
    signal: Series,
    most: int,
    *,
    criterion: Criterion | str = "bic",
    method: Method | str = "burg",
    pieces: Ranges | None = None,
) -> ChosenOrder:
    """Return the model whose order has the least criterion.

    BIC finds the true order of long series; AICc and FPE choose for prediction and tend to higher ones.

    Parameters
    ----------
    signal, pieces : as for `yule_walker`.
    most : the highest order that is tried.
    criterion : "bic", n ln σ_e² + p ln n; "aicc", n ln σ_e² + 2 (p + 1) n/(n − p − 2); "fpe",
        n ln(σ_e² (n + p + 1)/(n − p − 1)).
    method : "burg" or "yule-walker".

    Raises
    ------
    UsageError
        If a name is unknown, or the signal is too short for the highest order or never changes.
    """
    if method not in ("burg", "yule-walker"):
        raise UsageError(f"{method!r} is no method: burg or yule-walker.")
    ladder = (
        burg_ladder(signal, most, pieces)
        if method == "burg"
        else [yule_walker(signal, order, pieces) for order in range(most + 1)]
    )
    values = np.array([_criterion(model, criterion) for model in ladder])
    return ChosenOrder(ladder[int(np.argmin(values))], criterion, values - values.min())


def whiteness(
    signal: Series, model: Autoregression, *, lags: int | None = None, pieces: Ranges | None = None
) -> Whiteness:
    """Test whether what a model leaves over is white (Ljung and Box 1978).

    Parameters
    ----------
    signal, pieces : as for `yule_walker`.
    model : of it.
    lags : compared; None for 20 beyond the order.

    Raises
    ------
    UsageError
        If no piece is longer than the lags.
    """
    from scipy.stats import chi2

    lags = model.order + 20 if lags is None else lags
    ranges = [(0, signal.size)] if pieces is None else pieces
    left = [model.predicted(signal[a:b])[model.order :] - signal[a + model.order : b] for a, b in ranges]
    left = [e for e in left if e.size > lags]
    if not left or lags <= model.order:
        raise UsageError(
            f"A test of whiteness over {lags} lags needs more samples than that in a row, and more lags."
        )
    count = sum(e.size for e in left)
    mean = sum(float(e.sum()) for e in left) / count
    left = [e - mean for e in left]
    power = sum(float(e @ e) for e in left)
    rho = np.array([sum(float(e[k:] @ e[:-k]) for e in left) for k in range(1, lags + 1)]) / power
    statistic = float(count * (count + 2.0) * np.sum(rho**2 / (count - np.arange(1, lags + 1))))
    freedom = lags - model.order
    return Whiteness(statistic, freedom, float(chi2.sf(statistic, freedom)), lags)


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


def _criterion(model: Autoregression, criterion: str) -> float:
    """What is least for the order to choose."""
    n, p = float(model.samples), float(model.order)
    misfit = n * float(np.log(model.innovation_variance))
    if criterion == "bic":
        return misfit + p * float(np.log(n))
    if criterion == "aicc":
        return misfit + 2.0 * (p + 1.0) * n / (n - p - 2.0)
    if criterion == "fpe":
        return misfit + n * float(np.log((n + p + 1.0) / (n - p - 1.0)))
    raise UsageError(f"{criterion!r} is no criterion: bic, aicc or fpe.")
