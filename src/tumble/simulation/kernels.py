"""Recursions over samples, compiled; those with noise draw their own numbers from numpy's generator."""

from __future__ import annotations

import numpy as np
from numba import njit, types

_SIGNAL = types.float64[:, ::1]
_NUMBERS = types.float64[::1]
_GENERATOR = types.NumPyRandomGeneratorType("NumPyRandomGeneratorType")


@njit([types.void(_GENERATOR, types.float64, _NUMBERS)], cache=True, nogil=True)
def add_white(rng: np.random.Generator, scale: float, total: np.ndarray) -> None:
    """Add white noise to all numbers in their order."""
    for i in range(total.shape[0]):
        total[i] += scale * rng.standard_normal()


@njit([types.void(_GENERATOR, _NUMBERS, _NUMBERS, _SIGNAL, _SIGNAL)], cache=True, nogil=True)
def add_markov(
    rng: np.random.Generator, memory: np.ndarray, gain: np.ndarray, state: np.ndarray, total: np.ndarray
) -> None:
    """Add to each column the sum of the processes x_j[i] = memory_j x_j[i - 1] + gain_j z[i], the same z for all.

    `state` is (columns, processes), before the first sample, and is left as it is after the last. No
    fastmath: a seed gives the same numbers on every processor.
    """
    processes = memory.shape[0]
    for i in range(total.shape[0]):
        for axis in range(total.shape[1]):
            z = rng.standard_normal()
            value = 0.0
            for j in range(processes):
                x = memory[j] * state[axis, j] + gain[j] * z
                state[axis, j] = x
                value += x
            total[i, axis] += value


@njit([types.void(_GENERATOR, types.float64, _SIGNAL)], cache=True, nogil=True)
def add_walk(rng: np.random.Generator, step: float, total: np.ndarray) -> None:
    """Add to each of three columns a random walk x[i] = x[i - 1] + step z[i] from x = 0."""
    x = y = z = 0.0
    for i in range(total.shape[0]):
        x += step * rng.standard_normal()
        y += step * rng.standard_normal()
        z += step * rng.standard_normal()
        total[i, 0] += x
        total[i, 1] += y
        total[i, 2] += z


@njit([types.void(_GENERATOR, types.float64, types.float64, types.float64, _NUMBERS)], cache=True, nogil=True)
def add_white_and_digitise(
    rng: np.random.Generator, scale: float, step: float, limit: float, signal: np.ndarray
) -> None:
    """Add white noise, round to whole steps (none if zero), and stop at the limit, in one pass."""
    for i in range(signal.shape[0]):
        value = signal[i]
        if scale > 0.0:
            value += scale * rng.standard_normal()
        if step > 0.0:
            value = step * np.rint(value / step)
        signal[i] = min(max(value, -limit), limit)


@njit([types.void(_SIGNAL, types.float64)], cache=True, nogil=True)
def carry_remainders(signal: np.ndarray, step: float) -> None:
    """Round each column to whole steps in place, what is left over going to the next sample."""
    for axis in range(signal.shape[1]):
        remainder = 0.0
        for i in range(signal.shape[0]):
            wanted = signal[i, axis] / step + remainder
            whole = np.floor(wanted + 0.5)
            remainder = wanted - whole
            signal[i, axis] = whole * step


__all__ = ["add_markov", "add_walk", "add_white", "add_white_and_digitise", "carry_remainders"]
