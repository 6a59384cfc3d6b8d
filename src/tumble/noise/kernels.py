"""Sums over the samples, compiled: each reads contiguous slices of the running sum of a signal.

A tile of the running sum is held against all averaging times before the next one is read: short averaging
times then find it in the cache, and long ones read two streams from memory instead of three. The sums of
the tiles are added up one by one, so that rounding stays that of some thousand terms.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

_ROW = types.Array(types.float64, 1, "A", readonly=True)
_SUM = types.float64[::1]
_STEPS = types.int64[::1]
# Sums in any order, and products fused into them: what a wide register needs, without promises on nan.
_FAST = {"reassoc", "contract", "nsz"}
_TILE = 2048
_CHAINS = 8


@njit([types.void(_ROW, types.float64, _SUM)], cache=True, nogil=True)
def running_sum(signal: np.ndarray, level: float, phase: np.ndarray) -> None:
    """Fill the sum of the signal less `level` up to each sample: zero first, one longer than the signal."""
    total = 0.0
    phase[0] = 0.0
    for i in range(signal.shape[0]):
        total += signal[i] - level
        phase[i + 1] = total


@njit([types.void(_SUM, _STEPS, _SUM)], cache=True, nogil=True, fastmath=_FAST)
def second_difference_squares(phase: np.ndarray, steps: np.ndarray, sums: np.ndarray) -> None:
    """Add to `sums` the squares of x[i + 2m] - 2 x[i + m] + x[i] over all i, for each m of `steps`."""
    for begin in range(0, phase.shape[0], _TILE):
        for k in range(steps.shape[0]):
            m = steps[k]
            end = min(begin + _TILE, phase.shape[0] - 2 * m)
            if end <= begin:
                continue
            first = phase[begin:end]
            middle = phase[begin + m : end + m]
            last = phase[begin + 2 * m : end + 2 * m]
            total = 0.0
            for i in range(first.shape[0]):
                change = last[i] - 2.0 * middle[i] + first[i]
                total += change * change
            sums[k] += total


@njit([types.void(_SUM, _STEPS, _SUM)], cache=True, nogil=True, fastmath=_FAST)
def third_difference_squares(phase: np.ndarray, steps: np.ndarray, sums: np.ndarray) -> None:
    """Add to `sums` the squares of x[i + 3m] - 3 x[i + 2m] + 3 x[i + m] - x[i], for each m of `steps`."""
    for begin in range(0, phase.shape[0], _TILE):
        for k in range(steps.shape[0]):
            m = steps[k]
            end = min(begin + _TILE, phase.shape[0] - 3 * m)
            if end <= begin:
                continue
            a = phase[begin:end]
            b = phase[begin + m : end + m]
            c = phase[begin + 2 * m : end + 2 * m]
            d = phase[begin + 3 * m : end + 3 * m]
            total = 0.0
            for i in range(a.shape[0]):
                change = (d[i] - a[i]) + 3.0 * (b[i] - c[i])
                total += change * change
            sums[k] += total


@njit(cache=True, nogil=True, fastmath=_FAST)
def _third(phase: np.ndarray, j: int, m: int) -> float:
    """Third difference at m from j on."""
    return (phase[j + 3 * m] - phase[j]) - 3.0 * (phase[j + 2 * m] - phase[j + m])


@njit(cache=True, nogil=True, fastmath=_FAST)
def _window(phase: np.ndarray, begin: int, m: int) -> float:
    """Sum of m second differences at m from `begin` on."""
    a = phase[begin : begin + m]
    b = phase[begin + m : begin + 2 * m]
    c = phase[begin + 2 * m : begin + 3 * m]
    total = 0.0
    for i in range(m):
        total += c[i] - 2.0 * b[i] + a[i]
    return total


@njit(cache=True, nogil=True, fastmath=_FAST)
def _chains(phase: np.ndarray, window: np.ndarray, length: int, m: int) -> float:
    """Squares of `length` windows of each chain, from the chains' first windows on."""
    w0, w1, w2, w3, w4, w5, w6, w7 = (
        window[0],
        window[1],
        window[2],
        window[3],
        window[4],
        window[5],
        window[6],
        window[7],
    )
    total = w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3 + w4 * w4 + w5 * w5 + w6 * w6 + w7 * w7
    for j in range(length - 1):
        w0 += _third(phase, j, m)
        w1 += _third(phase, j + length, m)
        w2 += _third(phase, j + 2 * length, m)
        w3 += _third(phase, j + 3 * length, m)
        w4 += _third(phase, j + 4 * length, m)
        w5 += _third(phase, j + 5 * length, m)
        w6 += _third(phase, j + 6 * length, m)
        w7 += _third(phase, j + 7 * length, m)
        total += w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3 + w4 * w4 + w5 * w5 + w6 * w6 + w7 * w7
    return total


@njit([types.void(_SUM, _STEPS, _SUM)], cache=True, nogil=True, fastmath=_FAST)
def window_squares(phase: np.ndarray, steps: np.ndarray, sums: np.ndarray) -> None:
    """Add the squares of the sums of m successive second differences at m, for each m of `steps`.

    A window's sum is that of the window before, plus a third difference: a chain of additions. Eight
    chains run side by side, each begun anew, so that neither time nor rounding adds up along all samples.
    """
    window = np.zeros(_CHAINS)
    for k in range(steps.shape[0]):
        m = steps[k]
        count = phase.shape[0] - 3 * m + 1
        if count < 1:
            continue
        length = count // _CHAINS
        total = 0.0
        if length > 0:
            for chain in range(_CHAINS):
                window[chain] = _window(phase, chain * length, m)
            total += _chains(phase, window, length, m)
        at = _CHAINS * length
        if at < count:
            last = _window(phase, at, m)
            total += last * last
            for j in range(at, count - 1):
                last += (phase[j + 3 * m] - phase[j]) - 3.0 * (phase[j + 2 * m] - phase[j + m])
                total += last * last
        sums[k] += total


__all__ = ["running_sum", "second_difference_squares", "third_difference_squares", "window_squares"]
