"""Loops over samples of a sensor whose errors change with temperature, compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def follow_temperature(
    time: np.ndarray,
    recorded: np.ndarray,
    smoothing: float,
    lag: float,
    width: float,
    dead_band: float,
    carried: np.ndarray,
    path: np.ndarray,
) -> None:
    """Fill `path` (samples, 3) with the sensor's temperature, its rate, and the hysteresis state.

    `carried` holds time, recorded temperature, smooth temperature, its rate, sensor's temperature, the
    play's temperature and the hysteresis state before the first sample, and after the last one.
    """
    before, given, smooth, speed, inner, play, state = carried
    for n in range(time.shape[0]):
        step = time[n] - before
        slope = 0.0
        if step > 0.0:
            slope = (recorded[n] - given) / step
        past = smooth
        if smoothing > 0.0:
            # e' = w - 2 e / tau, w' = -e / tau^2: two equal roots, exact for straight lines between samples.
            error, drift = smooth - given, speed - slope
            part = step / smoothing
            decay = math.exp(-part)
            smooth = recorded[n] + decay * ((1.0 - part) * error + step * drift)
            speed = slope + decay * ((1.0 + part) * drift - part / smoothing * error)
        else:
            smooth = recorded[n]
            if step > 0.0:
                speed = slope
        rate = speed
        if lag > 0.0:
            if step > 0.0:
                ramp = (smooth - past) / step
                decay = math.exp(-step / lag)
                inner = smooth - lag * ramp + (inner - past + lag * ramp) * decay
            rate = (smooth - inner) / lag
        else:
            inner = smooth
        move = inner - play
        if abs(move) > dead_band:
            sign = 1.0 if move > 0.0 else -1.0
            moved = abs(move) - dead_band
            play += sign * moved
            state = sign + (state - sign) * math.exp(-moved / width)
        path[n, 0], path[n, 1], path[n, 2] = inner, rate, state
        before, given = time[n], recorded[n]
    carried[0], carried[1], carried[2], carried[3] = before, given, smooth, speed
    carried[4], carried[5], carried[6] = inner, play, state


@njit(cache=True, nogil=True)
def correct_triad(
    raw: np.ndarray,
    coupled: np.ndarray,
    values: np.ndarray,
    bias: np.ndarray,
    bias_terms: np.ndarray,
    matrix: np.ndarray,
    matrix_terms: np.ndarray,
    sensitivity: np.ndarray,
    sensitivity_terms: np.ndarray,
    asymmetry: np.ndarray,
    quadratic: np.ndarray,
    true: np.ndarray,
) -> int:
    """Fill `true` (samples, 3) from raw samples and the values of all functions at each of them.

    `values` (samples, functions) has the basis functions first, then what only biases have (rate and
    hysteresis); `coupled` is the true specific force that a g-sensitivity acts on. Groups of terms that
    are empty are skipped. Returns the first sample whose matrix has no inverse, or -1.
    """
    B, M, G = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    u = np.empty(3)
    sign = _determinant(matrix)
    for n in range(raw.shape[0]):
        for i in range(3):
            B[i] = bias[i]
            for k in range(bias_terms.shape[0]):
                B[i] += values[n, k] * bias_terms[k, i]
            for j in range(3):
                M[i, j] = matrix[i, j]
                for k in range(matrix_terms.shape[0]):
                    M[i, j] += values[n, k] * matrix_terms[k, i, j]
        if coupled.shape[0]:
            for i in range(3):
                for j in range(3):
                    G[i, j] = sensitivity[i, j]
                    for k in range(sensitivity_terms.shape[0]):
                        G[i, j] += values[n, k] * sensitivity_terms[k, i, j]
                    B[i] += G[i, j] * coupled[n, j]
        for i in range(3):
            output = raw[n, i] - B[i]
            slope = 1.0
            if output > 0.0:
                slope += asymmetry[i]
            elif output < 0.0:
                slope -= asymmetry[i]
            if quadratic[i] == 0.0:
                u[i] = output / slope
            else:
                root = math.sqrt(max(slope * slope + 4.0 * quadratic[i] * output, 0.0))
                u[i] = 2.0 * output / (slope + root)
        determinant = _determinant(M)
        if not determinant * sign > 0.0:
            return n
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            total = 0.0
            for i in range(3):
                r, s = (i + 1) % 3, (i + 2) % 3
                total += (M[r, p] * M[s, q] - M[r, q] * M[s, p]) * u[i]
            true[n, j] = total / determinant
    return -1


@njit(cache=True, nogil=True)
def _determinant(m: np.ndarray) -> float:
    return (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )
