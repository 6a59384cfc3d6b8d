"""Wavelet de-noising of a signal: levels and thresholds chosen by the signal itself.

What is small against the noise of its level is taken for noise. Nothing in a sample says whether it is
motion or noise: motion smaller than the thresholds is lost as noise is.

References
----------
Donoho, D. L., and I. M. Johnstone, *Adapting to unknown smoothness via wavelet shrinkage*, J. Am. Stat.
Assoc. 90 (1995) 1200-1224: SURE, and the universal threshold where the coefficients are sparse. Johnstone,
I. M., and B. W. Silverman, *Wavelet threshold estimators for data with correlated noise*, J. R. Stat. Soc.
B 59 (1997) 319-351: a noise of its own for each level. Coifman, R. R., and D. L. Donoho,
*Translation-invariant de-noising*, 1995: the stationary transform. Nassar, S., and N. El-Sheimy, *Wavelet
analysis for improving INS and INS/DGPS navigation accuracy*, J. Navigation 58 (2005) 119-134: the use for
inertial sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.noise.denoising.wavelets import USUAL, Coefficients, Transform, deepest_level, filter_length
from tumble.noise.deviation import allan_deviation
from tumble.noise.spectrum import power_spectrum
from tumble.records import dataclass

Rule: TypeAlias = Literal["sure", "universal", "remove"]
Shape: TypeAlias = Literal["soft", "hard"]
Ranges: TypeAlias = Sequence[tuple[int, int]]

_NORMAL = 0.6744897501960817  # median of |x| of a standard normal x
_KNOWN = 10.0  # degrees of freedom of an Allan deviation that may decide on the level
_LOWEST = 1.1  # times the lowest deviation: averaging that gains less than this is not worth a level
_MOTION_POWER = 0.999  # share of the motion's power that is to stay below the removed band
_ROOM = 1.5  # the filters of a level lose half the amplitude at the edge of the band, 7 % at two thirds of it
_MOTION_SEGMENT = 1024  # samples of a segment of the motion's spectrum, at most


@dataclass(frozen=True, slots=True)
class Shrinkage:
    """How coefficients are taken down.

    Attributes
    ----------
    rule : "sure" (least risk by Stein's estimate, universal where the level is sparse), "universal"
        (σ √(2 ln n), above all of the noise), or "remove" (all details go: a linear low-pass filter).
    shape : "soft" (what is above the threshold is taken down by it) or "hard" (it stays as it is).
    wavelet : a name of PyWavelets.
    stationary : whether the transform has no grid, see `tumble.noise.denoising.wavelets.Transform`.

    Raises
    ------
    UsageError
        If a name is unknown, or Stein's estimate is asked for hard thresholds, which it does not know.
    """

    rule: Rule | str = "sure"
    shape: Shape | str = "soft"
    wavelet: str = USUAL
    stationary: bool = True

    def __post_init__(self) -> None:
        if self.rule not in ("sure", "universal", "remove"):
            raise UsageError(f"{self.rule!r} is no rule for thresholds: sure, universal or remove.")
        if self.shape not in ("soft", "hard"):
            raise UsageError(f"{self.shape!r} is no shape of a threshold: soft or hard.")
        if self.rule == "sure" and self.shape == "hard":
            raise UsageError(
                "Stein's estimate of the risk is of soft thresholds: give the universal rule with hard ones."
            )
        filter_length(self.wavelet)


@dataclass(frozen=True, slots=True)
class ChosenLevel:
    """A level of decomposition, and what chose it.

    Attributes
    ----------
    level : 0 where there is nothing to gain.
    allan_minimum : s, the first averaging time at which the Allan deviation is as low as it gets.
    reason : a phrase for the user.
    """

    level: int
    allan_minimum: float
    reason: str


@dataclass(frozen=True, slots=True)
class DenoisedSignal:
    """A channel after de-noising, and what was done level by level (finest first).

    Attributes
    ----------
    signal : (samples,) as before outside the pieces.
    noise : (levels,) standard deviation of the noise, as of a sample of a white signal, in its unit.
    threshold : (levels,) the threshold in the same terms.
    kept : (levels,) share of the coefficients that stand above it.
    """

    signal: Series
    noise: Series
    threshold: Series
    kept: Series


def choose_level(signal: Series, rate: float, rest: Ranges, *, wavelet: str = USUAL) -> ChosenLevel:
    """Return the level below which noise at rest no longer averages down.

    Averaging over τ gains until the Allan deviation is at its minimum; beyond, what is seen is the bias as
    it wanders, which is to stay. The coarsest detail of level J compares means of 2^(J-1) samples.

    Parameters
    ----------
    signal : (samples,).
    rate : Hz.
    rest : half-open ranges at rest, without gaps.
    wavelet : a name of PyWavelets; its reach bounds the level by the longest rest.

    Raises
    ------
    UsageError
        If no rest is long enough for any level.
    """
    deepest = deepest_level(max((b - a for a, b in rest), default=0), wavelet)
    if deepest < 1:
        raise UsageError(
            f"No rest is long enough for one level of {wavelet}: {2 * (filter_length(wavelet) - 1)} samples at least."
        )
    values, gaps = _joined(signal, rest)
    curve = allan_deviation(values, rate, gaps=gaps)
    known = curve.edf[:, 0] >= _KNOWN
    deviation = curve.deviation[known, 0]
    if not deviation.size or not deviation.min() > 0.0:
        return ChosenLevel(0, 1.0 / rate, "the channel shows no noise that could be averaged")
    # Of noise that is correlated from sample to sample the curve rises first: its minimum is sought beyond.
    falling = np.flatnonzero(np.diff(deviation) < 0.0)
    if not falling.size:
        return ChosenLevel(0, 1.0 / rate, "no averaging makes the Allan deviation less")
    beyond = deviation[falling[0] :]
    first = int(falling[0] + np.flatnonzero(beyond <= _LOWEST * beyond.min())[0])
    tau = float(curve.tau[known][first])
    if first > deepest:
        return ChosenLevel(deepest, tau, f"the longest rest bears no more levels of {wavelet}")
    end = first == len(deviation) - 1
    why = "the longest averaging time that the rest shows" if end else "the Allan deviation is lowest there"
    return ChosenLevel(first, tau, f"{tau:.3g} s: {why}")


def motion_bandwidth(signal: Series, rate: float, motion: Ranges, rest: Ranges) -> float | None:
    """Return the frequency (Hz) below which 99.9 % of the motion's power lies, less the noise at rest.

    Parameters
    ----------
    signal : (samples,).
    rate : Hz.
    motion, rest : half-open ranges without gaps.

    Returns
    -------
    None where no motion is long enough for a spectrum, or none stands above the noise.
    """
    longest = max((b - a for a, b in motion), default=0)
    quiet = max((b - a for a, b in rest), default=0)
    size = min(1 << int(np.log2(max(min(longest, quiet), 1))), _MOTION_SEGMENT)
    if size < 16:
        return None
    moving = power_spectrum(*_with_gaps(signal, rate, motion), segment=size)
    still = power_spectrum(*_with_gaps(signal, rate, rest), segment=size)
    excess = np.maximum(moving.density[:, 0] - still.density[:, 0], 0.0)
    if excess.sum() <= still.density.sum():
        return None
    share = np.cumsum(excess) / excess.sum()
    return float(moving.frequency[np.searchsorted(share, _MOTION_POWER)])


def level_above(bandwidth: float, rate: float) -> int:
    """Return the most levels whose removed band begins at 1.5 times a bandwidth (Hz) or above.

    Parameters
    ----------
    bandwidth : Hz, above 0.
    rate : Hz.
    """
    return max(int(np.log2(rate / (2.0 * _ROOM * bandwidth))), 0)


def denoise_signal(
    signal: Series, pieces: Ranges, rest: Ranges, level: int, shrinkage: Shrinkage | None = None
) -> DenoisedSignal:
    """Return the signal with the noise in its pieces taken down.

    The noise of each level is the median absolute coefficient at rest; the thresholds are chosen from the
    coefficients of all pieces together. A piece too short for the level is taken down as far as it bears.

    Parameters
    ----------
    signal : (samples,), any unit.
    pieces : half-open ranges without gaps, each by itself; what is outside stays as it is.
    rest : half-open ranges without gaps that tell the noise.
    level : levels of decomposition, 0 changes nothing.
    shrinkage : how; soft with Stein's estimate where none is given.

    Raises
    ------
    UsageError
        If no rest bears the level.
    """
    how = shrinkage or Shrinkage()
    result = signal.copy()
    if level < 1:
        return DenoisedSignal(result, np.zeros(0), np.zeros(0), np.zeros(0))
    noise = level_noise(signal, rest, level, how)
    analysed = [
        (first, last, transform, transform.analyse(signal[first:last]))
        for first, last in pieces
        if (transform := _fitting(last - first, level, how)) is not None
    ]
    thresholds = _thresholds([each for *_, each in analysed], noise, how)
    kept, count = np.zeros(level), np.zeros(level)
    for first, last, transform, coefficients in analysed:
        for j in range(transform.level):
            inner = np.abs(coefficients.inside(j + 1))
            kept[j] += np.count_nonzero(inner > thresholds[j])
            count[j] += inner.size
        result[first:last] = transform.synthesise(_taken_down(coefficients, thresholds, how))
    scale = _white_scale(level, how)
    return DenoisedSignal(result, noise / scale, thresholds / scale, kept / np.maximum(count, 1.0))


def level_noise(signal: Series, rest: Ranges, level: int, shrinkage: Shrinkage) -> Series:
    """Return the noise's standard deviation in the coefficients of each level, finest first.

    Parameters
    ----------
    signal, rest, level, shrinkage : as for `denoise_signal`.

    Raises
    ------
    UsageError
        If no rest bears the level.
    """
    gathered: list[list[Series]] = [[] for _ in range(level)]
    for first, last in rest:
        transform = _fitting(last - first, level, shrinkage)
        if transform is None:
            continue
        coefficients = transform.analyse(signal[first:last])
        for j in range(transform.level):
            gathered[j].append(coefficients.inside(j + 1))
    if not gathered[-1]:
        raise UsageError(
            f"No rest is long enough for {level} levels of {shrinkage.wavelet}: give fewer with --level."
        )
    return np.array([float(np.median(np.abs(np.concatenate(each)))) / _NORMAL for each in gathered])


def sure_threshold(coefficients: Series, independent: float) -> float:
    """Return the soft threshold of least estimated risk, of coefficients in units of their noise.

    Where the coefficients have hardly more power than the noise, Stein's estimate is chance, and the
    universal threshold is taken (Donoho and Johnstone 1995, section 2.4).

    Parameters
    ----------
    coefficients : (n,) over the noise's standard deviation.
    independent : how many of them count as independent.
    """
    squares = np.sort(coefficients**2)
    count = squares.size
    universal = float(np.sqrt(2.0 * np.log(max(count, 2))))
    excess = float(squares.mean()) - 1.0
    if excess <= max(np.log2(max(independent, 2.0)), 1.0) ** 1.5 / np.sqrt(max(independent, 1.0)):
        return universal
    below = np.arange(1, count + 1)
    risk = count - 2.0 * below + np.cumsum(squares) + (count - below) * squares
    best = float(np.sqrt(squares[int(np.argmin(risk))]))
    return min(best, universal) if risk.min() < count else 0.0


def _fitting(samples: int, level: int, how: Shrinkage) -> Transform | None:
    """The transform to the level, or as far as so many samples bear it."""
    level = min(level, deepest_level(samples, how.wavelet))
    return Transform(level, how.wavelet, how.stationary) if level else None


def _white_scale(level: int, how: Shrinkage) -> Series:
    """What a coefficient of each level is of white noise of unit variance."""
    exponents = np.arange(1, level + 1, dtype=np.float64) if how.stationary else np.zeros(level)
    return np.asarray(2.0 ** (-0.5 * exponents), dtype=np.float64)


def _thresholds(pieces: Sequence[Coefficients], noise: Series, how: Shrinkage) -> Series:
    """Threshold of each level, of all pieces that have it."""
    result = np.full(noise.size, np.inf)
    if how.rule == "remove":
        return result
    for j, sigma in enumerate(noise):
        found = [each.inside(j + 1) for each in pieces if len(each.details) > j]
        if not found or sigma <= 0.0:
            result[j] = 0.0
            continue
        pooled = np.concatenate(found) / sigma
        if how.rule == "universal":
            result[j] = sigma * np.sqrt(2.0 * np.log(max(pooled.size, 2)))
        else:
            independent = pooled.size / (2.0 ** (j + 1) if how.stationary else 1.0)
            result[j] = sigma * sure_threshold(pooled, independent)
    return result


def _taken_down(coefficients: Coefficients, thresholds: Series, how: Shrinkage) -> Coefficients:
    """The coefficients after thresholds."""
    details: list[Series] = []
    for each, limit in zip(coefficients.details, thresholds, strict=False):
        if not np.isfinite(limit):
            details.append(np.zeros_like(each))
        elif how.shape == "hard":
            details.append(np.where(np.abs(each) > limit, each, 0.0))
        else:
            details.append(np.sign(each) * np.maximum(np.abs(each) - limit, 0.0))
    return replace(coefficients, details=tuple(details))


def _joined(signal: Series, ranges: Ranges) -> tuple[Series, tuple[int, ...]]:
    """The samples of ranges one after the other, and where one begins."""
    parts = [signal[a:b] for a, b in ranges if b > a]
    starts = np.cumsum([0, *(part.size for part in parts)])
    return np.concatenate([np.zeros(0), *parts]), tuple(int(b) for _, b in pairwise(starts))[:-1]


def _with_gaps(signal: Series, rate: float, ranges: Ranges) -> tuple[Series, float]:
    """The signal with nothing outside of the ranges, for functions that part it there."""
    masked = np.full(signal.size, np.nan)
    for first, last in ranges:
        masked[first:last] = signal[first:last]
    return masked, rate
