"""Units that change on the way, as where two loggers' files were put together: found by how large numbers jump."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors, block_means
from tumble.errors import RecordingError
from tumble.recording.recording import Recording
from tumble.recording.rest import block_statistics, sample_pieces

_TOLERANCE = 0.15  # of a ratio of units, as a logarithm; an uncalibrated MEMS is off by a few per cent
# Between the units of specific force that recordings come in, m/s², g, mg and ft/s², and those of counts, lie these.
_FORCE_RATIOS = (9.80665, 1000.0 / 9.80665, 1000.0, 32.174, 3.28084)
_LEAST_SECONDS = 20
_LEAST_SHARE = 0.04  # of the seconds, in either unit
# Of deg/s, mrad/s and mdeg/s against rad/s and deg/s.
_RATE_RATIOS = (180.0 / np.pi, 1000.0, 1000.0 * np.pi / 180.0)
_WINDOW = 0.3  # s
_LEAST_TURN = 0.1  # rad that gravity turns over a window that determines
_LEAST_WINDOWS = 6  # on either side
_SAME_AXIS = 0.8  # cosine between the axes that gyro and gravity turn about, in either unit
_TURN_SPREAD = 0.6  # of logarithms: turns about inclined axes turn gravity less than themselves


def two_force_levels(force: Vectors, rate: float) -> tuple[float, float] | None:
    """Return two levels of the norm, second by second, as far apart as two units are and each steady, or None.

    Rest is not asked for: in the finer unit of two all noise is smaller, and nothing else would seem at rest.

    Parameters
    ----------
    force : (samples, 3) raw.
    rate : samples a second.
    """
    size = max(round(rate), 1)
    whole = force[: len(force) // size * size]
    seconds = np.sort(np.linalg.norm(whole, axis=1).reshape(-1, size), axis=1)
    low, middle, high = (seconds[:, int(share * size)] for share in (0.25, 0.5, 0.75))
    # a second in which it is shaken has no level
    norms = middle[high - low < _TOLERANCE * middle]
    if norms.size < _LEAST_SECONDS:
        return None
    ordered = np.sort(np.log(np.maximum(norms, 1e-300)))
    least = max(2, int(_LEAST_SHARE * ordered.size))
    cut = int(np.argmax(np.diff(ordered)[least - 1 : -least + 1])) + least
    low, high = ordered[:cut], ordered[cut:]
    spreads = [float(np.subtract(*np.quantile(part, [0.75, 0.25]))) for part in (low, high)]
    apart = float(np.median(high) - np.median(low))
    gap = float(high[0] - low[-1])
    if max(spreads) > _TOLERANCE or gap < 0.5 * apart or not _is_ratio(apart, _FORCE_RATIOS, _TOLERANCE):
        return None
    return float(np.exp(np.median(low))), float(np.exp(np.median(high)))


def _is_ratio(apart: float, ratios: tuple[float, ...], tolerance: float) -> bool:
    return min(abs(apart - float(np.log(ratio))) for ratio in ratios) < tolerance


def refuse_changed_force_unit(two: tuple[float, float] | None, name: str) -> None:
    """Refuse a recording whose accelerometer's unit changes on the way.

    Parameters
    ----------
    two : what `two_force_levels` found.
    name : of the file.

    Raises
    ------
    RecordingError
        If the norm jumps between two levels as far apart as two units are.
    """
    if two is not None:
        low, high = two
        raise RecordingError(
            f"{name}: the accelerometer's norm is near {low:.4g} for some of the time and near {high:.4g} for the "
            f"rest, {high / low:.4g} times as much: the unit changes within the file. Convert one part, or give the "
            "parts one by one."
        )


def refuse_changed_rate_unit(recording: Recording, name: str) -> None:
    """Refuse a recording whose gyro's unit changes on the way.

    Told by the turns, against how far gravity turns in them, or else by noise and bias at rest together.

    Raises
    ------
    RecordingError
        If from some moment on the gyro's numbers are as many times larger or smaller as two units are apart.
    """
    if recording.specific_force is None or recording.angular_rate is None:
        return
    cuts = sample_pieces(len(recording))
    time = np.concatenate([recording.time[c] for c in cuts])
    force = np.concatenate([recording.specific_force[c] for c in cuts])
    rates = np.concatenate([recording.angular_rate[c] for c in cuts])
    size = max(3, round(_WINDOW * recording.rate))
    found = _by_turns(force, rates, size, recording.rate) or _by_rest(force, rates, size)
    if found is None:
        return
    window, apart = found
    after = float(time[min(window * size, time.size - 1)] - time[0])
    ratio, how = float(np.exp(abs(apart))), "larger" if apart > 0.0 else "smaller"
    raise RecordingError(
        f"{name}: from about {after:.4g} s after the beginning on the gyro's numbers are some "
        f"{ratio:.3g} times {how} than before, as far apart as two units are. The accelerometer's are "
        "not: the unit changes within the file. Convert one part, or give the parts one by one."
    )


def _by_turns(force: Vectors, rates: Vectors, size: int, rate: float) -> tuple[int, float] | None:
    """Compare how far the gyro turns in each window with how far gravity does; returns window and jump."""
    count = len(force) // size
    if count < 2 * _LEAST_WINDOWS:
        return None
    ends = force[: count * size].reshape(count, size, 3)
    edge = max(1, size // 6)
    first, last = ends[:, :edge].mean(axis=1), ends[:, -edge:].mean(axis=1)
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(last, axis=1)
    cosine = np.einsum("wi,wi->w", first, last) / np.maximum(lengths, 1e-300)
    gravity = np.arccos(np.clip(cosine, -1.0, 1.0))
    turned = block_means(rates, size) * (size / rate)
    gyro = np.linalg.norm(turned, axis=1)
    told = np.flatnonzero((gravity > _LEAST_TURN) & (gyro > 0.0))
    jump = _jump(np.log(gyro[told] / gravity[told]), _TURN_SPREAD)
    if jump is None:
        return None
    # where it is shaken, the force swings about another axis than the gyros
    axes = np.cross(last[told], first[told])
    along = np.einsum("wi,wi->w", axes, turned[told])
    level = turned[told] - first[told] * _shares(turned[told], first[told])[:, None]
    cosine = along / np.maximum(np.linalg.norm(axes, axis=1) * np.linalg.norm(level, axis=1), 1e-300)
    agree = min(abs(float(np.median(part))) for part in (cosine[: jump[0]], cosine[jump[0] :]))
    return (int(told[jump[0]]), jump[1]) if agree > _SAME_AXIS else None


def _shares(vectors: Vectors, others: Vectors) -> Series:
    """How many times the other each vector has along it."""
    return np.einsum("wi,wi->w", vectors, others) / np.maximum(np.einsum("wi,wi->w", others, others), 1e-300)


def _by_rest(force: Vectors, rates: Vectors, size: int) -> tuple[int, float] | None:
    """Compare scatter and mean of the gyro at rest before and after; returns window and jump."""
    if len(rates) < 2 * _LEAST_WINDOWS * size:
        return None
    means, scatter = block_statistics(rates, size)
    _, shaking = block_statistics(force, size)
    noise = np.median(scatter, axis=1)
    still = np.flatnonzero((noise > 0.0) & np.all(shaking < 4.0 * np.median(shaking, axis=0), axis=1))
    jump = _jump(np.log(noise[still]), _TOLERANCE)
    if jump is None:
        return None
    parts = still[: jump[0]], still[jump[0] :]
    biases = [float(np.linalg.norm(np.median(means[part], axis=0))) for part in parts]
    quakes = [float(np.median(shaking[part])) for part in parts]
    if min(*biases, *quakes) <= 0.0 or abs(np.log(quakes[1] / quakes[0])) > np.log(3.0):
        return None
    same = abs(np.log(biases[1] / biases[0]) - jump[1]) < 3.0 * _TOLERANCE
    return (int(still[jump[0]]), jump[1]) if same else None


def _jump(values: Series, tolerance: float) -> tuple[int, float] | None:
    """Return where a series changes its level once, by as much as two units differ, and by how much."""
    if values.size < 2 * _LEAST_WINDOWS:
        return None
    middle = 0.5 * (float(np.quantile(values, 0.02)) + float(np.quantile(values, 0.98)))
    high = values > middle
    # Where to cut so that as few as possible stand on the wrong side, either way round.
    low_after = np.concatenate([[0], np.cumsum(high)]) + np.concatenate([np.cumsum(~high[::-1])[::-1], [0]])
    wrong = np.minimum(low_after, values.size - low_after)[_LEAST_WINDOWS:-_LEAST_WINDOWS]
    cut = int(np.argmin(wrong)) + _LEAST_WINDOWS
    before, after = values[:cut], values[cut:]
    apart = float(np.median(after) - np.median(before))
    spreads = [float(np.subtract(*np.quantile(part, [0.75, 0.25]))) for part in (before, after)]
    clean = wrong[cut - _LEAST_WINDOWS] <= 0.05 * min(before.size, after.size)
    return (
        (cut, apart)
        if clean and max(spreads) < tolerance and _is_ratio(abs(apart), _RATE_RATIOS, tolerance)
        else None
    )
