"""What a spin tells: the mean of each triad at a constant rate, free of what goes round with the unit.

At a constant rate everything that is fixed to the Earth goes round in b once a revolution: the
horizontal Earth rate, gravity where the axis is not plumb. The model of a window is therefore

    raw(t) = mean + c₁ cos ωt + s₁ sin ωt + c₂ cos 2ωt + s₂ sin 2ωt + noise

with the known ω. Its least-squares mean is exact for any window of the motion, whole revolutions or
not, fractional samples or not: a sample that is the mean over its interval has the same shape, each
harmonic smaller by a factor that the amplitudes absorb. Leaving off samples until whole revolutions
remain is exact only if a revolution is a whole number of samples. Whole revolutions are
kept all the same, since higher harmonics then average out too. The second harmonic is there for
quadratic terms and asymmetry, which a rotating gravity excites.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from itertools import pairwise

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Table, Vectors, block_means
from tumble.errors import SegmentationError
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.averages import batch_length, mean_covariance
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.rounding import rounding_variance

# Of a revolution, the least at which the harmonic and the mean are told apart: their fit has there
# 5.3 times the variance of a plain mean, and 110 times at a quarter.
LEAST_REVOLUTION = 0.5
# A rate is mended where the phase shows it beyond this many of its own sigmas.
PHASE_SIGMAS = 4.0


@dataclass(frozen=True)
class SpinMeans(HoldMeans):
    """One row per spin; raw units. `period` (spins,) is s per revolution as it was used; NaN in too short a spin."""

    period: Series = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class _Window:
    """Samples that are averaged, seconds a revolution takes (NaN if not modelled), and the model's columns.

    `inflation` is the variance of the mean over that of a plain mean of as many samples.
    """

    start: int
    stop: int
    period: float
    columns: Table
    inflation: float


def observe_spins(
    recording: Recording, spins: Sequence[tuple[int, int]], period: Sequence[float]
) -> SpinMeans:
    """Average each spin over whole revolutions and say how well the averages are known.

    The mean is that of a least-squares fit of a constant and two harmonics (see the module's text).
    The covariance is that of the means of holds (`mean_covariance`), made from the samples *without*
    their harmonics: what goes round with the unit is no noise. It is raised by the fit's own factor
    where the window is no whole revolution. A table's ripple is in it, for it is seen in the samples.

    Parameters
    ----------
    recording : raw samples.
    spins : (start, stop) of the stretches of constant rate.
    period : s per revolution against the Earth, one per spin; NaN where it is not known.
        Without it, or in less than half a revolution, the mean is the plain mean of all samples
        and the harmonics are in its covariance as if they were noise. A period that the phase of the
        harmonics contradicts (a table 1 % too slow) is mended by it.

    Raises
    ------
    SegmentationError
        If there are no spins, or a spin has fewer than two samples.
    ValueError
        If there are not as many periods as spins.

    Notes
    -----
    Rotation rate test, Hayal 2010, section 2.4.1.2. The thesis averages all samples and leaves the
    horizontal Earth rate in; the harmonics here take it out.
    """
    if not spins:
        raise SegmentationError(
            "There are no spins to average: nowhere is the unit turned at a constant rate."
        )
    windows = [_window(recording, *spin, abs(float(p))) for spin, p in zip(spins, period, strict=True)]
    counts = np.array([w.stop - w.start for w in windows], dtype=float)
    force = _means(recording.specific_force, windows)
    rate = _means(recording.angular_rate, windows)
    temperature = recording.temperature
    return SpinMeans(
        *force,
        *rate,
        duration=counts / recording.rate,
        count=counts,
        time=np.array([0.5 * (recording.time[w.start] + recording.time[w.stop - 1]) for w in windows]),
        period=np.array([w.period for w in windows]),
        temperature=None
        if temperature is None
        else np.array([float(np.mean(temperature[w.start : w.stop])) for w in windows]),
    )


def whole_revolutions(recording: Recording, start: int, stop: int, period: float) -> tuple[int, int]:
    """Return the middle part of a stretch that has whole revolutions, to the nearest sample.

    Parameters
    ----------
    recording : for the stamps.
    start, stop : samples of constant rate.
    period : s per revolution; a stretch of less than one, or NaN, stays as it is.
    """
    step = float(recording.time[stop - 1] - recording.time[start]) / max(stop - start - 1, 1)
    # a stretch that was cut to whole revolutions before may be half a sample short
    revolutions = np.floor((stop - start + 0.6) * step / period)
    if not revolutions >= 1.0:
        return start, stop
    count = min(round(revolutions * period / step), stop - start)
    first = start + (stop - start - count) // 2
    return first, first + count


def _window(recording: Recording, first: int, last: int, period: float) -> _Window:
    if last - first < 2:
        raise SegmentationError("A spin of fewer than two samples has no mean with an uncertainty.")
    start, stop = whole_revolutions(recording, first, last, period)
    time = recording.time[start:stop]
    revolutions = (stop - start) / recording.rate / period
    if not revolutions >= LEAST_REVOLUTION:
        return _Window(start, stop, float("nan"), np.ones((stop - start, 1)), 1.0)
    # rounding to samples may leave a little less than one
    harmonics = 2 if revolutions > 0.9 else 1
    since = time - 0.5 * (time[0] + time[-1])
    signals = [s[start:stop] for s in (recording.specific_force, recording.angular_rate) if s is not None]
    period = _mended_period(since, signals, period, harmonics)
    columns = _columns(since, period, harmonics)
    inflation = (stop - start) * float(_normal_inverse(columns)[0, 0])
    return _Window(start, stop, period, columns, inflation)


def _columns(since: Series, period: float, harmonics: int) -> Table:
    """Columns of the constant and the harmonics, (samples, 1 + 2 harmonics)."""
    phase = 2.0 * np.pi * since / period
    parts = [np.ones_like(since)]
    for order in range(1, harmonics + 1):
        parts += [np.cos(order * phase), np.sin(order * phase)]
    return np.column_stack(parts)


def _normal_inverse(columns: Table) -> AnyArray:
    return np.asarray(np.linalg.inv(columns.T @ columns), dtype=np.float64)


def _mended_period(since: Series, signals: list[Vectors], period: float, harmonics: int) -> float:
    """The period that the harmonics' phase shows, where they show it beyond doubt."""
    speed = nominal = 2.0 * np.pi / period
    sigma = np.inf
    for _ in range(6):
        change, sigma = _speed_change(since, signals, 2.0 * np.pi / speed, harmonics)
        speed += change
        # beyond a quarter turn of phase at the ends the linear step is not to be trusted
        if abs(speed - nominal) * (since[-1] - since[0]) > np.pi:
            return period
        if abs(change) < 0.01 * sigma:
            break
    return 2.0 * np.pi / speed if abs(speed - nominal) > PHASE_SIGMAS * sigma else period


def _speed_change(
    since: Series, signals: list[Vectors], period: float, harmonics: int
) -> tuple[float, float]:
    """Gauss-Newton step of the speed in rad/s, and its standard uncertainty."""
    columns = _columns(since, period, harmonics)
    inverse = _normal_inverse(columns)
    top = bottom = 0.0
    for signal in signals:
        values = inverse @ (columns.T @ signal)
        residual = signal - columns @ values
        slope = np.zeros_like(signal)
        for order in range(1, harmonics + 1):
            cosine, sine = columns[:, 2 * order - 1 : 2 * order], columns[:, 2 * order : 2 * order + 1]
            slope += order * (cosine * values[2 * order] - sine * values[2 * order - 1])
        slope *= since[:, None]
        slope -= columns @ (inverse @ (columns.T @ slope))
        # round-off stands in for noise where there is none
        least = (1e-12 * np.abs(signal).max(axis=0) + 1e-150) ** 2
        variance = np.maximum(np.mean(residual**2, axis=0), least)
        top += float(np.sum(np.sum(slope * residual, axis=0) / variance))
        bottom += float(np.sum(np.sum(slope**2, axis=0) / variance))
    return (top / bottom, 1.0 / np.sqrt(bottom)) if bottom > 0.0 else (0.0, np.inf)


def _means(signal: Vectors | None, windows: list[_Window]) -> tuple[Vectors | None, Matrices | None]:
    if signal is None:
        return None, None
    still: list[Vectors] = []
    for window in windows:
        piece = np.array(signal[window.start : window.stop], dtype=float)
        harmonics: Matrix | AnyArray = _normal_inverse(window.columns) @ (window.columns.T @ piece)
        still.append(piece - window.columns[:, 1:] @ harmonics[1:])
    edges = np.concatenate([[0], np.cumsum([len(piece) for piece in still])])
    items = [[(int(a), int(b))] for a, b in pairwise(edges)]
    span = max(w.stop for w in windows) - min(w.start for w in windows)
    own = [[(w.start, w.stop)] for w in windows]
    left = rounding_variance(signal, own, np.array([piece.mean(axis=0) for piece in still]))
    observed = mean_covariance(np.concatenate(still), items, span=span, rounding=left)
    counts = [len(piece) for piece in still]
    kept = np.array([_noise_kept(w.columns, batch_length(len(w.columns), min(counts))) for w in windows])
    raised = np.array([w.inflation for w in windows]) / kept
    return observed.mean, observed.covariance * raised[:, None, None]


def _noise_kept(columns: Table, length: int) -> float:
    """Share of white noise's variance of batch means that is left when the columns are taken out."""
    batches = len(columns) // length
    if batches < 2 or columns.shape[1] == 1:
        return 1.0
    orthonormal = np.asarray(np.linalg.qr(columns)[0], dtype=np.float64)
    means = block_means(orthonormal, length)
    taken = float(np.sum((means - means.mean(axis=0)) ** 2)) * length
    # two batches on half a revolution would leave nothing: a tenth is the least that is believed
    return max(1.0 - taken / (batches - 1), 0.1)
