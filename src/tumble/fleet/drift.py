"""How units change between calibrations, and when one is due again, for all units and parameters at once.

Each parameter of a unit follows a line in time. About it lie the calibrations' own errors, of known variance, and what
changes from one calibration to the next (switching on anew), whose variance is common to the units and found from
those with three calibrations or more (Paule and Mandel 1982, *J. Res. NBS* 87, 377). The units' rates have a
distribution, too: what it tells of a unit with one calibration is all that is known of its drift.

A calibration is due when the drift since then may exceed the tolerance: |b| t + 2 u(t) = T with u² = s_b² t² + u_0²,
the way in which ILAC-G24 / OIML D 10 (2022) judges by a control chart.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tumble.arrays import Series, Table
from tumble.records import dataclass

YEAR = 365.25 * 86400.0
COVERAGE = 2.0
FEWEST_RATES = 5
"""Units with two calibrations or more that it takes to know how rates are distributed."""
_STEPS = 60
_ENOUGH = 500
"""Units that tell the scatter between calibrations well enough, to a few per cent."""


@dataclass(frozen=True)
class Drift:
    """Lines of all units; a time is in years.

    Attributes
    ----------
    rate, rate_sigma : (units, p) a year; infinite sigma where nothing is known.
    last, last_sigma : (units, p) the newest value, and what it is uncertain by: its own error and `scatter`.
    last_time : (units,) s since 1970.
    count : (units,) calibrations.
    scatter : (p,) standard deviation from one calibration to the next.
    usual_rate, rate_spread : (p,) of the units' rates; NaN where too few are known.
    """

    rate: Table
    rate_sigma: Table
    last: Table
    last_sigma: Table
    last_time: Series
    count: Series
    scatter: Series
    usual_rate: Series
    rate_spread: Series


def find_drift(unit: np.ndarray, seconds: Series, values: Table, sigmas: Table) -> Drift:
    """Return the drift of units.

    Parameters
    ----------
    unit : (n,) the unit's number, rising.
    seconds : (n,) s since 1970, rising in each unit.
    values, sigmas : (n, p).
    """
    units = int(unit[-1]) + 1
    count = np.bincount(unit, minlength=units).astype(float)
    last = np.cumsum(count).astype(int) - 1
    time = (seconds - seconds[last][unit]) / YEAR
    scale = np.maximum(np.sqrt(np.mean(sigmas**2, axis=0)), 1e-300)
    y, own = values / scale, (sigmas / scale) ** 2
    scatter = _scatter(unit, units, time, y, own, count)
    _, rate, variance, _ = _lines(unit, units, time, y, own + scatter)
    usual, spread = _rates(rate, variance)
    known = np.isfinite(usual)
    between = np.where(known, spread**2, np.inf)
    centre = np.where(known, usual, 0.0)
    precision = 1.0 / variance + 1.0 / np.maximum(between, 1e-300)
    own_share = np.where(np.isfinite(variance), rate / variance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shrunk = np.where(
            precision > 0.0, (own_share + centre / np.maximum(between, 1e-300)) / precision, 0.0
        )
        sigma = np.where(precision > 0.0, 1.0 / np.sqrt(precision), np.inf)
    return Drift(
        shrunk * scale,
        sigma * scale,
        values[last],
        np.sqrt(own[last] + scatter) * scale,
        seconds[last],
        count,
        np.sqrt(scatter) * scale,
        usual * scale,
        spread * scale,
    )


def _sums(unit: np.ndarray, units: int, x: Table) -> Table:
    return np.array([np.bincount(unit, column, units) for column in x.T], dtype=float).T


def _lines(
    unit: np.ndarray, units: int, time: Series, y: Table, variance: Table
) -> tuple[Table, Table, Table, Table]:
    """Level at the newest calibration, rate, its variance and weighted squares of the residuals, by unit."""
    w, t = 1.0 / variance, time[:, None]
    sw, st, stt = (_sums(unit, units, w * t**power) for power in (0, 1, 2))
    sy, sty = _sums(unit, units, w * y), _sums(unit, units, w * t * y)
    determinant = sw * stt - st**2
    told = determinant > 1e-9 * sw * np.maximum(stt, 1e-300)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.where(told, (sw * sty - st * sy) / determinant, 0.0)
        variance_of_rate = np.where(told, sw / determinant, np.inf)
    level: Table = (sy - rate * st) / sw
    residual = y - level[unit] - rate[unit] * t
    return level, rate, variance_of_rate, _sums(unit, units, w * residual**2)


def _scatter(unit: np.ndarray, units: int, time: Series, y: Table, own: Table, count: Series) -> Series:
    """Variance beyond the calibrations' own, by which the weighted squares are as many as there are freedoms."""
    enough = count >= 3
    # Of thousands every so many will do.
    enough &= np.cumsum(enough) % max(int(np.sum(enough)) // _ENOUGH, 1) == 0
    freedom = float(np.sum(count[enough] - 2.0))
    parameters = int(y.shape[1])
    if freedom < 1.0:
        return np.zeros(parameters)
    keep = enough[unit]
    number = np.cumsum(enough) - 1
    unit, units = number[unit[keep]], int(np.sum(enough))
    time, y, own = time[keep], y[keep], own[keep]

    def excess(variance: Series) -> Series:
        return np.sum(_lines(unit, units, time, y, own + variance)[3], axis=0) - freedom

    return _root(excess, np.ones(parameters))


def _root(excess: Callable[[Series], Series], high: Series) -> Series:
    """Where falling functions, one a parameter, are zero; 0 where they begin below that."""
    low: Series = np.zeros_like(high)
    for _ in range(_STEPS):
        above: np.ndarray = excess(high) > 0.0
        if not np.any(above):
            break
        high = np.where(above, 4.0 * high, high)
    for _ in range(_STEPS):
        middle: Series = 0.5 * (low + high)
        above = excess(middle) > 0.0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.where(excess(np.zeros_like(high)) > 0.0, 0.5 * (low + high), 0.0)


def _rates(rate: Table, variance: Table) -> tuple[Series, Series]:
    """Mean and standard deviation of the units' rates."""
    mean, spread = np.full((2, rate.shape[1]), np.nan)
    told = np.isfinite(variance)
    known = np.sum(told, axis=0) >= FEWEST_RATES
    b, v, told = rate[:, known], variance[:, known], told[:, known]

    def weighted(between: Series) -> tuple[Series, Series, Series]:
        """Squares beyond as many as there are freedoms, mean, and its variance."""
        w = 1.0 / (v + between)
        total = np.sum(w, axis=0)
        centre = np.sum(w * b, axis=0) / total
        return np.sum(w * (b - centre) ** 2, axis=0) - np.sum(told, axis=0) + 1, centre, 1.0 / total

    between = _root(lambda between: weighted(between)[0], np.var(b, axis=0, where=told) + 1e-300)
    _, mean[known], own = weighted(between)
    # The mean is not known better than this, and a new unit's rate differs from it.
    spread[known] = np.sqrt(between + own)
    return mean, spread


def due_after(drift: Drift, tolerance: Series) -> Table:
    """Return after how many years from its newest calibration each unit's parameter is due, (units, p).

    Zero where the calibration itself is known no better than the tolerance; NaN where nothing is known of the drift;
    infinite where it never is.

    Parameters
    ----------
    drift : of the units.
    tolerance : (p,) largest allowed change; infinite for none.
    """
    b, s, u = np.abs(drift.rate), COVERAGE * drift.rate_sigma, COVERAGE * drift.last_sigma
    limit = np.broadcast_to(tolerance, b.shape)
    with np.errstate(all="ignore"):
        # (T - b t)² = s² t² + u²
        a, half, c = b**2 - s**2, limit * b, limit**2 - u**2
        root = np.sqrt(np.maximum(half**2 - a * c, 0.0))
        # In this form the smaller positive root, for either sign of a.
        after = np.where(half + root > 0.0, c / (half + root), np.inf)
    after = np.where(u >= limit, 0.0, after)
    after = np.where(np.isfinite(drift.rate_sigma), after, np.nan)
    return np.where(np.isfinite(limit), after, np.inf)


@dataclass(frozen=True)
class Chart:
    """EWMA chart of a unit.

    Attributes
    ----------
    ewma, limit : (n, p) and (n,), in standard deviations of a single calibration.
    signals : (n, p) whether the chart is beyond its limit.
    """

    ewma: Table
    limit: Series
    signals: np.ndarray


# Weight of the newest calibration, λ.
_WEIGHT = 0.2


def ewma_chart(values: Table, sigmas: Table, scatter: Series, baseline: int) -> Chart:
    """Return the exponentially weighted moving average of a unit's calibrations (Roberts 1959).

    Parameters
    ----------
    values, sigmas : (n, p), in the order of time.
    scatter : (p,) standard deviation from one calibration to the next, beyond their own uncertainties.
    baseline : calibrations whose weighted mean is the reference.
    """
    from scipy.special import ndtri

    count, parameters = map(int, values.shape)
    variance = sigmas**2 + scatter**2
    variance = np.where(variance > 0.0, variance, 1.0)
    w = 1.0 / variance[:baseline]
    reference = np.sum(w * values[:baseline], axis=0) / np.sum(w, axis=0)
    z = (values - reference) / np.sqrt(variance)
    # Of the reference's own error all later points have the same share.
    shared = 1.0 / np.sum(w, axis=0) / np.mean(variance, axis=0)
    ewma = np.zeros_like(z)
    state = np.zeros(parameters)
    for k in range(count):
        state = _WEIGHT * z[k] + (1.0 - _WEIGHT) * state
        ewma[k] = state
    age: Series = np.arange(1.0, count + 1.0)
    own: Series = _WEIGHT / (2.0 - _WEIGHT) * (1.0 - (1.0 - _WEIGHT) ** (2 * age))
    quantile: float = -float(ndtri(0.00135 / parameters))
    limit: Series = quantile * np.sqrt(own + float(np.max(shared)))
    signals: np.ndarray = (np.abs(ewma) > limit[:, None]) & (age > baseline)[:, None]
    return Chart(ewma, limit, signals)
