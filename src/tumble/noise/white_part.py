"""Noise that is white but for the shortest times, as of a sensor behind a low-pass filter, as one number N.

Where the white noise of a sensor is filtered before it is sampled, the curve bends at its left end, and a
first-order Gauss-Markov process of a few hundredths of a second takes the place of N. Over longer times it
is white noise all the same, of density 2 σ² T. A filter that has no state for the process wants N² + 2 σ² T.
Where one process does not make the bend's shape, N is read off the curve to the right of it instead.
"""

from __future__ import annotations

import numpy as np

from tumble.errors import UsageError
from tumble.noise.deviation import Deviation
from tumble.noise.fitting.fit import MISFIT, NoiseFit, fit_curve
from tumble.noise.terms import GaussMarkov
from tumble.records import dataclass

SHORT = 0.1
"""s, correlation times up to which a process counts as white; where samples are rarer, four of their intervals."""

_SHORT_SAMPLES = 4.0
# Beyond, a process is what a filter has a bias state for.
_LONGEST = 10.0  # s
_BEYOND = (
    20.0,
    10.0,
    5.0,
)  # correlation times, behind which the curve is white noise's within 8, 15 and 30 %
_NORMAL = 1.959964  # 95 % of a normal number


@dataclass(frozen=True)
class WhitePart:
    """N of a channel as it is over times longer than that of its processes.

    Attributes
    ----------
    value, sigma : root of N² + 2 σ² T, u·√s, and its standard uncertainty.
    low, high : limits of 95 %.
    times : s, correlation times of the processes in it, each a good deal longer than which the noise is white.
    """

    value: float
    sigma: float
    low: float
    high: float
    times: tuple[float, ...]


def shortest_time(rate: float) -> float:
    """Return the correlation time (s) up to which a process counts as white at a sampling rate in Hz."""
    return max(SHORT, _SHORT_SAMPLES / rate)


def white_beyond(fit: NoiseFit, octaves: Deviation) -> WhitePart | None:
    """Return N over times longer than those of short processes, or None without such a process.

    Where the model does not fit, the curve itself is asked, right of the processes.

    Parameters
    ----------
    fit : of one channel.
    octaves : overlapping Allan deviation that it was fitted to.
    """
    part = white_part(fit)
    if part is None or fit.probability >= MISFIT:
        return part
    for times in _BEYOND:
        try:
            tail = fit_curve(octaves.from_tau(times * max(part.times)), gauss_markov=0, lines=fit.lines)
        except (UsageError, np.linalg.LinAlgError):
            continue
        for term in tail.terms:
            if term.letter == "N":
                return WhitePart(term.value, term.sigma, term.low, term.high, part.times)
    return part


def white_part(fit: NoiseFit, longest: float | None = None) -> WhitePart | None:
    """Return N with what short Gauss-Markov processes add to it, or None without such a process.

    Parameters
    ----------
    fit : of one channel.
    longest : s, up to which correlation time a process counts; None takes `shortest_time`.
    """
    limit = shortest_time(fit.rate) if longest is None else longest
    values = {term.letter: term.value for term in fit.terms}
    slopes = np.zeros(len(values))
    places = {name: k for k, name in enumerate(values)}
    square = values.get("N", 0.0) ** 2
    if "N" in places:
        slopes[places["N"]] = 2.0 * values["N"]
    times: list[float] = []
    for mark, process in zip(("", " 2", " 3"), fit.model.gauss_markov, strict=False):
        if process.correlation_time > limit:
            continue
        density, of_sigma, of_time = _density(process, fit.rate)
        square += density
        slopes[places[f"sigma{mark}"]] = of_sigma
        slopes[places[f"correlation time{mark}"]] = of_time
        times.append(process.correlation_time)
    if not times or square <= 0.0:
        return None
    value = float(np.sqrt(square))
    return _with_limits(
        value, float(np.sqrt(max(slopes @ fit.covariance @ slopes, 0.0))) / (2.0 * value), times
    )


def slower_part(fit: NoiseFit) -> WhitePart | None:
    """Return N with what processes of up to ten seconds add to it, or None where none is slower than short.

    Parameters
    ----------
    fit : of one channel.
    """
    limit = shortest_time(fit.rate)
    slower = any(limit < process.correlation_time <= _LONGEST for process in fit.model.gauss_markov)
    return white_part(fit, _LONGEST) if slower else None


def _density(process: GaussMarkov, rate: float) -> tuple[float, float, float]:
    """Density at frequency zero of a process sampled at instants, and its slopes over σ and T."""
    # σ² Δ coth(Δ/2T), which is 2 σ² T where samples are dense
    x = 0.5 / (rate * process.correlation_time)
    unit = 1.0 / (rate * np.tanh(x))
    steep = x / (rate * process.correlation_time * np.sinh(x) ** 2)
    square = process.sigma**2
    return square * unit, 2.0 * process.sigma * unit, square * steep


def _with_limits(value: float, sigma: float, times: list[float]) -> WhitePart:
    factor = float(np.exp(min(_NORMAL * sigma / value, 50.0)))
    return WhitePart(value, sigma, value / factor, value * factor, tuple(times))
