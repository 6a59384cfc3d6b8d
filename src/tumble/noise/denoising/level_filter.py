"""The level of a sensor at rest, followed through coloured noise by a filter that looks back only.

The sample is a level that walks slowly, plus noise that is an autoregression. Whitened, the noise is white
and the level is kept: the Kalman filter of a random walk in white noise is then exponential smoothing
(Muth 1960), whose gain is chosen by the likelihood of what it foretells. Against the Kalman filter of all
states only the walk within the order's few samples is neglected.

References
----------
Muth, J. F., *Optimal properties of exponentially weighted forecasts*, J. Am. Stat. Assoc. 55 (1960)
299-306. Harvey, A. C., *Forecasting, Structural Time Series Models and the Kalman Filter*, Cambridge 1989,
section 4.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from tumble.arrays import Series
from tumble.noise.denoising.autoregression import Autoregression, burg, choose_order
from tumble.records import dataclass

Ranges = Sequence[tuple[int, int]]

_MOST_ORDER = 12
_LEAST_BLOCK = 64  # samples from which an autoregression is estimated
_FREQUENCIES = 2000


@dataclass(frozen=True, slots=True)
class LevelFilter:
    """A model of the noise and the gain of the smoothing.

    Attributes
    ----------
    noise : of the sensor at rest, without its slow level.
    gain : share of a whitened sample in the level; below 1/n of the n samples there are, it is a plain mean.
    """

    noise: Autoregression
    gain: float

    @property
    def delay(self) -> float:
        """Samples by which the level lags behind a steady change of the true one."""
        order = np.arange(1, self.noise.order + 1)
        lead = float(order @ self.noise.coefficients) / self.noise.gain
        return (1.0 - self.gain) / self.gain - lead

    @property
    def level_walk(self) -> float:
        """Variance of the level's step in a sample, u², that has this gain."""
        white = self.noise.innovation_variance / self.noise.gain**2
        return white * self.gain**2 / (1.0 - self.gain)

    def response(self, frequency: Series) -> Series:
        """Return what is left of the amplitude of a sine.

        Parameters
        ----------
        frequency : over the sampling rate, up to a half.
        """
        turn = np.exp(-2j * np.pi * np.asarray(frequency))
        powers = turn[:, None] ** np.arange(1, self.noise.order + 1)
        whitening = (1.0 - powers @ self.noise.coefficients) / self.noise.gain
        return np.abs(whitening * self.gain / (1.0 - (1.0 - self.gain) * turn))

    def bandwidth(self) -> float:
        """Return the lowest frequency, over the sampling rate, of which half the amplitude is lost."""
        frequency = np.geomspace(1e-3 * self.gain, 0.5, _FREQUENCIES)
        lost = np.flatnonzero(self.response(frequency) < 0.5)
        return float(frequency[lost[0]]) if lost.size else 0.5

    def follow(self, signal: Series, pieces: Ranges) -> Series:
        """Return the level in the pieces, each begun anew; what is outside stays as it is.

        Parameters
        ----------
        signal : (samples,), the unit of the model.
        pieces : half-open ranges at rest, without gaps.
        """
        result = signal.copy()
        for first, last in pieces:
            if last > first:
                result[first:last] = _smoothed(self.noise.whitened(signal[first:last]), self.gain)
        return result


def fit_level_filter(signal: Series, rest: Ranges, block: int, *, order: int | None = None) -> LevelFilter:
    """Return the filter of a channel from its rests.

    Parameters
    ----------
    signal : (samples,), any unit.
    rest : half-open ranges without gaps.
    block : samples over which the level counts as constant, while the noise's model is estimated.
    order : of the autoregression; None lets BIC choose, up to 12.

    Raises
    ------
    UsageError
        If the rests are too short for the order, or the signal never changes.
    """
    from scipy.optimize import minimize_scalar

    size = max(block, _LEAST_BLOCK)
    level_free, blocks = signal.copy(), list[tuple[int, int]]()
    for first, last in rest:
        count = max((last - first) // size, 1)
        edges = np.linspace(first, last, count + 1).astype(int).tolist()
        for a, b in pairwise(edges):
            level_free[a:b] -= signal[a:b].mean()
            blocks.append((a, b))
    noise = (
        choose_order(level_free, _MOST_ORDER, pieces=blocks).model
        if order is None
        else burg(level_free, order, blocks)
    )
    white = [noise.whitened(signal[a:b]) for a, b in rest]
    longest = max(part.size for part in white)

    def misfit(logarithm: float) -> float:
        gain = float(np.exp(logarithm))
        return sum(float(np.sum((w[1:] - _smoothed(w, gain)[:-1]) ** 2)) for w in white if w.size > 1)

    found = minimize_scalar(misfit, bounds=(-float(np.log(longest)), -1e-3), method="bounded")
    return LevelFilter(noise, float(np.exp(found.x)))


def _smoothed(white: Series, gain: float) -> Series:
    """Exponential smoothing that begins as a mean: gain 1/k at sample k, until that is less."""
    from scipy.signal import lfilter

    start = min(int(np.ceil(1.0 / gain)), white.size)
    result = np.empty(white.size)
    result[:start] = np.cumsum(white[:start]) / np.arange(1, start + 1)
    if start < white.size:
        state = [(1.0 - gain) * result[start - 1]]
        result[start:] = lfilter([gain], [1.0, gain - 1.0], white[start:], zi=state)[0]
    return result
