"""Rests of a unit whose biases drift with temperature: what temperature does is taken off before they are sought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.recording.recording import Recording
from tumble.segmentation.search import find_timeline
from tumble.segmentation.timeline import Timeline

# Medians over so long are regressed on temperature: turns are a minority, and outliers.
WINDOW = 10.0  # s
ORDER, PASSES = 3, 20


def find_thermal_timeline(
    recording: Recording, *, intervals: Sequence[tuple[float, float]] | None = None
) -> Timeline:
    """Find holds and turns in a recording whose gyro biases drift with temperature.

    A cubic in the recorded temperature, fitted to medians of ten seconds by least absolute values, is taken off
    the gyros first: a warming gyro would else look as if it turned slowly. The timeline is that of the recording
    as it was given; means are to be taken from it, not from what was taken off.

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
    at = scaled[: blocks * step].reshape(blocks, step).mean(axis=1)
    powers = np.arange(1, ORDER + 1)
    design = np.column_stack([np.ones(blocks), at[:, None] ** powers])
    drift = np.empty_like(rate)
    for axis in range(3):
        coefficients = _least_absolute(design, levels[:, axis])
        drift[:, axis] = (scaled[:, None] ** powers) @ coefficients[1:]
    return drift


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
