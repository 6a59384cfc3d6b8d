"""Rests of a unit whose biases drift with temperature: what temperature does is taken off before they are sought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors, block_means
from tumble.recording import Recording
from tumble.segmentation.search import find_timeline
from tumble.segmentation.timeline import Timeline

# Medians over so long are regressed on temperature: turns are a minority, and outliers.
WINDOW = 10.0  # s
ORDER, PASSES = 3, 20
# Stretches of so many seconds without motion are levelled; motion is a change of gravity by this share within two
# seconds, or a rate so many sigmas off.
LEAST_STRETCH, MOVING_SHARE, MOVING_SIGMAS = 60, 0.02, 30.0
LOCAL = 121  # s
LARGEST_DRIFT = 0.02  # rad/s


def find_thermal_timeline(
    recording: Recording, *, intervals: Sequence[tuple[float, float]] | None = None
) -> Timeline:
    """Find holds and turns in a recording whose gyro biases drift with temperature.

    A cubic in the recorded temperature, fitted to medians of ten seconds by least absolute values, is taken off
    the gyros first: a warming gyro would else look as if it turned slowly. Within each stretch that shows no
    motion over seconds, what a cubic in temperature explains of both triads is taken off, too (lag and rate are
    not in the first one): it would look as if the pose crept. The timeline is that of the recording as it was
    given; means are to be taken from it, not from what was taken off. A pose that really creeps with temperature
    is not told from a bias that does.

    Parameters
    ----------
    recording : with a temperature; without one the search is the ordinary one.
    intervals : (start, stop) s of the holds, where somebody said.

    Raises
    ------
    SegmentationError
        If there are no holds.
    """
    flat = recording
    if recording.temperature is not None and recording.angular_rate is not None:
        drift = _drift(recording.time, recording.temperature, recording.angular_rate)
        flat = replace(recording, angular_rate=recording.angular_rate - drift)
    if recording.temperature is not None and recording.specific_force is not None:
        force, rate = _level(flat, recording.temperature)
        flat = replace(flat, specific_force=force, angular_rate=rate)
    return find_timeline(flat, intervals=intervals)


def _drift(time: Series, celsius: Series, rate: Vectors) -> Vectors:
    """Return (samples, 3) of what a cubic in temperature explains, zero at its middle."""
    known = np.isfinite(celsius)
    if np.count_nonzero(known) < 100 or float(np.ptp(celsius[known])) == 0.0:
        return np.zeros_like(rate)
    filled = np.interp(time, time[known], celsius[known])
    step = max(1, int(WINDOW * (time.size - 1) / max(float(time[-1] - time[0]), 1e-9)))
    blocks = time.size // step
    if blocks < 4 * (ORDER + 1):
        return np.zeros_like(rate)
    smooth = _smoothed(filled, step)
    half = 0.5 * float(np.ptp(smooth))
    scaled = (smooth - 0.5 * float(smooth.max() + smooth.min())) / max(half, 1e-9)
    levels = np.median(rate[: blocks * step].reshape(blocks, step, 3), axis=1)
    at = block_means(scaled, step)
    powers = np.arange(1, ORDER + 1)
    design = np.column_stack([np.ones(blocks), at[:, None] ** powers])
    drift = np.empty_like(rate)
    for axis in range(3):
        coefficients = _least_absolute(design, levels[:, axis])
        drift[:, axis] = (scaled[:, None] ** powers) @ coefficients[1:]
    return drift


def _level(recording: Recording, celsius: Series) -> tuple[Vectors, Vectors | None]:
    """Return specific force and angular rate without what temperature does to them while nothing moves."""
    force, rate = recording.specific_force, recording.angular_rate
    assert force is not None
    step = max(1, round(recording.rate))
    blocks = len(force) // step
    known = np.isfinite(celsius)
    if blocks < 2 * LEAST_STRETCH or np.count_nonzero(known) < 100:
        return force, rate
    filled = _smoothed(np.interp(recording.time, recording.time[known], celsius[known]), 5 * step)
    moving = _moving(force, rate, step, blocks)
    level = force.copy()
    calm = None if rate is None else rate.copy()
    usual = None if rate is None else np.median(rate, axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[1], moving.astype(int), [1]])))
    for first, last in edges.reshape(-1, 2).tolist():
        if last - first < LEAST_STRETCH:
            continue
        part = slice(first * step, last * step)
        level[part] = force[part] - _explained(filled[part], force[part])
        if rate is not None and calm is not None and usual is not None:
            off = rate[part].mean(axis=0) - usual
            # A slow spin of a table is no drift: what temperature leaves after the cubic is small.
            if float(np.linalg.norm(off)) < LARGEST_DRIFT:
                calm[part] = rate[part] - _explained(filled[part], rate[part]) - off
    return level, calm


def _moving(force: Vectors, rate: Vectors | None, step: int, blocks: int) -> np.ndarray:
    """Return (blocks,) whether it moves in each second: gravity or the rates change faster than a drift does."""
    from scipy.ndimage import median_filter

    means = block_means(force, step)
    gravity = float(np.median(np.linalg.norm(means, axis=1)))
    # Over two seconds a pose that changes moves gravity; a warming sensor does not.
    change = np.zeros(blocks)
    change[1:-1] = np.linalg.norm(means[2:] - means[:-2], axis=1)
    moving = change > MOVING_SHARE * gravity
    if rate is not None:
        rates = block_means(rate, step)
        # Against the median of two minutes: a drift stays with it, a turn does not.
        followed: Vectors = np.empty_like(rates)
        median_filter(rates, size=(LOCAL, 1), output=followed, mode="nearest")
        off = np.linalg.norm(rates - followed, axis=1)
        usual = float(np.median(off))
        moving |= off > usual + MOVING_SIGMAS * 1.4826 * float(np.median(np.abs(off - usual)))
    return moving


def _explained(celsius: Series, force: Vectors) -> Vectors:
    """Return what a polynomial in temperature explains, without its mean; of a straight line below 3 K."""
    span = float(np.ptp(celsius))
    if span < 0.2:
        return np.zeros_like(force)
    scaled = (celsius - 0.5 * float(celsius.max() + celsius.min())) / (0.5 * span)
    powers = scaled[:, None] ** np.arange(1, (ORDER if span > 3.0 else 1) + 1)
    powers = powers - powers.mean(axis=0)
    normal = np.asarray(powers.T @ powers, dtype=np.float64)
    right = np.asarray(powers.T @ (force - force.mean(axis=0)), dtype=np.float64)
    solution: AnyArray = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
    return np.asarray(powers @ solution, dtype=np.float64)


def _smoothed(values: Series, width: int) -> Series:
    """Return a centred running mean, shorter at the ends: noise of the thermometer is none of the gyros'."""
    sums = np.concatenate([np.zeros(1), np.cumsum(values)])
    first = np.clip(np.arange(values.size) - width, 0, None)
    last = np.clip(np.arange(values.size) + width + 1, None, values.size)
    return (sums[last] - sums[first]) / (last - first)


def _least_absolute(design: np.ndarray, values: Series) -> Series:
    """Return the coefficients with the least sum of absolute residuals, by reweighting."""
    weight = np.ones(values.size)
    coefficients = np.zeros(design.shape[1])
    for _ in range(PASSES):
        root = np.sqrt(weight)
        coefficients = np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0]
        residual = np.abs(values - design @ coefficients)
        weight = 1.0 / np.maximum(residual, 1e-3 * float(np.median(residual)) + 1e-300)
    return np.asarray(coefficients, dtype=np.float64)
