"""Loops over samples of a sensor whose errors change with temperature, compiled."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import exp, fabs, sqrt


@cython.locals(before=cython.double, move=cython.double, moved=cython.double)
def follow_temperature(
    time: cython.const[cython.double][:],
    recorded: cython.const[cython.double][:],
    smoothing: cython.double,
    lag: cython.double,
    width: cython.double,
    dead_band: cython.double,
    carried: cython.double[::1],
    path: cython.double[:, ::1],
) -> None:
    """Fill `path` (samples, 3) with the sensor's temperature, its rate, and the hysteresis state.

    `carried` holds time, recorded temperature, smooth temperature, its rate, sensor's temperature, the
    play's temperature and the hysteresis state before the first sample, and after the last one.
    """
    with cython.nogil:
        before, given, smooth, speed = carried[0], carried[1], carried[2], carried[3]
        inner, play, state = carried[4], carried[5], carried[6]
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
                decay = exp(-part)
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
                    decay = exp(-step / lag)
                    inner = smooth - lag * ramp + (inner - past + lag * ramp) * decay
                rate = (smooth - inner) / lag
            else:
                inner = smooth
            move = inner - play
            if fabs(move) > dead_band:
                sign = 1.0 if move > 0.0 else -1.0
                moved = fabs(move) - dead_band
                play += sign * moved
                state = sign + (state - sign) * exp(-moved / width)
            path[n, 0], path[n, 1], path[n, 2] = inner, rate, state
            before, given = time[n], recorded[n]
        carried[0], carried[1], carried[2], carried[3] = before, given, smooth, speed
        carried[4], carried[5], carried[6] = inner, play, state


@cython.locals(output=cython.double, total=cython.double, coupling=cython.double)
def correct_triad(
    raw: cython.const[cython.double][:, :],
    coupled: cython.const[cython.double][:, :],
    values: cython.const[cython.double][:, :],
    bias: cython.const[cython.double][:],
    bias_terms: cython.const[cython.double][:, :],
    matrix: cython.const[cython.double][:, :],
    matrix_terms: cython.const[cython.double][:, :, :],
    sensitivity: cython.const[cython.double][:, :],
    sensitivity_terms: cython.const[cython.double][:, :, :],
    asymmetry: cython.const[cython.double][:],
    quadratic: cython.const[cython.double][:],
    true: cython.double[:, ::1],
) -> int:
    """Fill `true` (samples, 3) from raw samples and the values of all functions at each of them.

    `values` (samples, functions) has the basis functions first, then what only biases have (rate and
    hysteresis); `coupled` is the true specific force that a g-sensitivity acts on. Groups of terms that
    are empty are skipped. Returns the first sample whose matrix has no inverse, or -1.
    """
    bias_now = cython.declare(cython.double[3])
    m = cython.declare(cython.double[9])
    u = cython.declare(cython.double[3])
    singular: cython.Py_ssize_t = -1
    with cython.nogil:
        for i in range(3):
            for j in range(3):
                m[3 * i + j] = matrix[i, j]
        sign = _determinant(m)
        for n in range(raw.shape[0]):
            for i in range(3):
                bias_now[i] = bias[i]
                for k in range(bias_terms.shape[0]):
                    bias_now[i] += values[n, k] * bias_terms[k, i]
                for j in range(3):
                    m[3 * i + j] = matrix[i, j]
                    for k in range(matrix_terms.shape[0]):
                        m[3 * i + j] += values[n, k] * matrix_terms[k, i, j]
            if coupled.shape[0]:
                for i in range(3):
                    for j in range(3):
                        coupling = sensitivity[i, j]
                        for k in range(sensitivity_terms.shape[0]):
                            coupling += values[n, k] * sensitivity_terms[k, i, j]
                        bias_now[i] += coupling * coupled[n, j]
            for i in range(3):
                output = raw[n, i] - bias_now[i]
                slope = 1.0
                if output > 0.0:
                    slope += asymmetry[i]
                elif output < 0.0:
                    slope -= asymmetry[i]
                if quadratic[i] == 0.0:
                    u[i] = output / slope
                else:
                    root = sqrt(max(slope * slope + 4.0 * quadratic[i] * output, 0.0))
                    u[i] = 2.0 * output / (slope + root)
            determinant = _determinant(m)
            if not determinant * sign > 0.0:
                singular = n
                break
            for j in range(3):
                p, q = (j + 1) % 3, (j + 2) % 3
                total = 0.0
                for i in range(3):
                    r, s = (i + 1) % 3, (i + 2) % 3
                    total += (m[3 * r + p] * m[3 * s + q] - m[3 * r + q] * m[3 * s + p]) * u[i]
                true[n, j] = total / determinant
    return singular


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _determinant(
    m: cython.p_double,
) -> cython.double:
    return (
        m[0] * (m[4] * m[8] - m[5] * m[7])
        - m[1] * (m[3] * m[8] - m[5] * m[6])
        + m[2] * (m[3] * m[7] - m[4] * m[6])
    )
