"""The norm adjustment of one triad, compiled: many sets of hold means one after the other."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, NAN, cos, fabs, isfinite, sin, sqrt

# How the conditions are weighed and linearised; see `norm_batch.ESTIMATORS`.
POPE, FIXED, NORM, SQUARE = 0, 1, 2, 3


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _forward(
    values: cython.p_double,
    m: cython.p_double,
) -> cython.void:
    """Lower-triangular matrix of bias, scale and angles (Hayal 3.13)."""
    m[0] = values[3]
    m[3] = -values[4] * sin(values[6])
    m[4] = values[4] * cos(values[6])
    m[6] = values[5] * sin(values[8])
    m[7] = -values[5] * sin(values[7]) * cos(values[8])
    m[8] = values[5] * cos(values[7]) * cos(values[8])


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(total=cython.double)
def _cholesky_solve(
    normal: cython.double[:, ::1],
    right: cython.double[::1],
    size: cython.Py_ssize_t,
    step: cython.double[::1],
    cofactor: cython.double[:, ::1],
    scratch: cython.double[:, :, ::1],
) -> cython.bint:
    """Solve the scaled normal equations in place; return whether they are positive definite."""
    for i in range(size):
        if not normal[i, i] > 0.0:
            return False
        scratch[2, 0, i] = 1.0 / sqrt(normal[i, i])
    for i in range(size):
        for j in range(i + 1):
            total = normal[i, j] * scratch[2, 0, i] * scratch[2, 0, j]
            for k in range(j):
                total -= scratch[0, i, k] * scratch[0, j, k]
            if i == j:
                if not total > 1e-12:
                    return False
                scratch[0, i, i] = sqrt(total)
                scratch[1, i, i] = 1.0 / scratch[0, i, i]
            else:
                scratch[0, i, j] = total * scratch[1, j, j]
    for i in range(size):
        for j in range(i):
            total = 0.0
            for k in range(j, i):
                total -= scratch[0, i, k] * scratch[1, k, j]
            scratch[1, i, j] = total * scratch[1, i, i]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += scratch[1, k, i] * scratch[1, k, j]
            cofactor[i, j] = total * scratch[2, 0, i] * scratch[2, 0, j]
            cofactor[j, i] = cofactor[i, j]
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += cofactor[i, j] * right[j]
        step[i] = total
    return True


@cython.locals(
    done=cython.bint,
    f=cython.double,
    total=cython.double,
    settled=cython.bint,
    square_sum=cython.double,
    residual=cython.double,
    moved=cython.double,
)
def adjust_norm_sets(
    observed: cython.const[cython.double][:, :, ::1],
    variance: cython.const[cython.double][:, ::1],
    reference: cython.const[cython.double][::1],
    start: cython.const[cython.double][:, ::1],
    size: cython.Py_ssize_t,
    estimator: cython.Py_ssize_t,
    limit: cython.Py_ssize_t,
    tolerance: cython.double,
    parameters: cython.double[:, ::1],
    cofactors: cython.double[:, :, ::1],
    sigma0: cython.double[::1],
    iterations: cython.longlong[::1],
) -> None:
    """Adjust every set; `iterations` is negative where it did not converge.

    `observed` (sets, holds, 3), `variance` (holds, 3), `reference` (holds,), `start` and `parameters`
    (sets, 9), `cofactors` (sets, size, size).
    """
    sets, holds = observed.shape[0], observed.shape[1]
    normal: cython.double[:, ::1] = np.zeros((size, size))
    right: cython.double[::1] = np.zeros(size)
    step: cython.double[::1] = np.zeros(size)
    adjusted: cython.double[:, ::1] = np.zeros((holds, 3))
    by_raw: cython.double[:, ::1] = np.zeros((holds, 3))
    design: cython.double[:, ::1] = np.zeros((holds, 9))
    misclosure: cython.double[::1] = np.zeros(holds)
    spread: cython.double[::1] = np.zeros(holds)
    cofactor: cython.double[:, ::1] = np.zeros((size, size))
    scratch: cython.double[:, :, ::1] = np.zeros((3, size, size))
    # Least squares on the norm weighs all holds alike: by the mean variance of a sensor.
    alike: cython.double = np.mean(variance)
    m = cython.declare(cython.double[9])
    values = cython.declare(cython.double[9])
    row = cython.declare(cython.double[9])
    t = cython.declare(cython.double[3])
    w = cython.declare(cython.double[3])
    over_scale = cython.declare(cython.double[3])
    with cython.nogil:
        for number in range(sets):
            for i in range(9):
                values[i] = start[number, i]
            for k in range(holds):
                for a in range(3):
                    adjusted[k, a] = observed[number, k, a]
            for i in range(size):
                for j in range(size):
                    cofactor[i, j] = NAN
            before, done, count = INFINITY, False, 0
            while not done and count < limit:
                count += 1
                _forward(values, m)
                sin_yz, cos_yz = sin(values[6]), cos(values[6])
                sin_zx, cos_zx = sin(values[7]), cos(values[7])
                sin_zy, cos_zy = sin(values[8]), cos(values[8])
                over_x, over_y, over_z = 1.0 / m[0], 1.0 / m[4], 1.0 / m[8]
                for a in range(3):
                    over_scale[a] = 1.0 / values[3 + a]
                for i in range(size):
                    right[i] = 0.0
                    for j in range(size):
                        normal[i, j] = 0.0
                for k in range(holds):
                    ux = adjusted[k, 0] - values[0]
                    uy = adjusted[k, 1] - values[1]
                    uz = adjusted[k, 2] - values[2]
                    t[0] = ux * over_x
                    t[1] = (uy - m[3] * t[0]) * over_y
                    t[2] = (uz - m[6] * t[0] - m[7] * t[1]) * over_z
                    square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
                    K = reference[k]
                    length = sqrt(square)
                    # derivative of the condition by the true vector is t times this
                    slope = 1.0 / length if estimator == 2 else (2.0 if estimator == 3 else 1.0 / K)
                    if estimator == 2:
                        f = length - K
                    elif estimator == 3:
                        f = square - K * K
                    else:
                        f = 0.5 * (square - K * K) / K
                    w[2] = slope * t[2] * over_z
                    w[1] = (slope * t[1] - m[7] * w[2]) * over_y
                    w[0] = (slope * t[0] - m[3] * w[1] - m[6] * w[2]) * over_x
                    row[0], row[1], row[2] = -w[0], -w[1], -w[2]
                    row[3] = -w[0] * ux * over_scale[0]
                    row[4] = -w[1] * uy * over_scale[1]
                    row[5] = -w[2] * uz * over_scale[2]
                    row[6] = w[1] * values[4] * (cos_yz * t[0] + sin_yz * t[1])
                    row[7] = w[2] * values[5] * cos_zy * (cos_zx * t[1] + sin_zx * t[2])
                    row[8] = (
                        -w[2] * values[5] * (cos_zy * t[0] + sin_zx * sin_zy * t[1] - cos_zx * sin_zy * t[2])
                    )
                    total = 0.0
                    for a in range(3):
                        f += w[a] * (observed[number, k, a] - adjusted[k, a])
                        total += w[a] * w[a] * variance[k, a]
                        by_raw[k, a] = w[a]
                    spread[k] = total if estimator < 2 else (alike if estimator == 2 else 4.0 * K * K * alike)
                    misclosure[k] = f
                    # Divisions take most of the time: one a hold, not 64.
                    weight = 1.0 / spread[k]
                    for i in range(size):
                        design[k, i] = row[i]
                        weighed = weight * row[i]
                        right[i] -= weighed * f
                        for j in range(i + 1):
                            normal[i, j] += weighed * row[j]
                if not _cholesky_solve(normal, right, size, step, cofactor, scratch):
                    break
                biggest, settled = 0.0, True
                for i in range(size):
                    biggest = max(biggest, fabs(step[i]) / sqrt(cofactor[i, i]))
                    settled = settled and fabs(step[i]) <= 1e-13 * max(fabs(values[i]), 1.0)
                if not isfinite(biggest):
                    break
                square_sum = 0.0
                for k in range(holds):
                    residual = misclosure[k]
                    for i in range(size):
                        residual += design[k, i] * step[i]
                    square_sum += residual * residual / spread[k]
                    if estimator == 0:
                        for a in range(3):
                            moved = variance[k, a] * by_raw[k, a] * residual / spread[k]
                            adjusted[k, a] = observed[number, k, a] - moved
                for i in range(size):
                    values[i] += step[i]
                done = biggest <= tolerance or settled or (biggest < 1e-3 and biggest >= before)
                before = biggest
                sigma0[number] = sqrt(square_sum / (holds - size)) if holds > size else NAN
            for i in range(9):
                parameters[number, i] = values[i]
            for i in range(size):
                for j in range(size):
                    cofactors[number, i, j] = cofactor[i, j]
            iterations[number] = count if done else -count


def add_mean_noise(
    rng: np.random.Generator,
    sigma: cython.double,
    samples: cython.Py_ssize_t,
    means: cython.double[:, ::1],
) -> None:
    """Add to every number of `means` (rows, 3) the mean of `samples` normal numbers of standard deviation `sigma`.

    Every single sample is drawn.
    """
    buffer = np.empty(min(samples, 4096))
    drawn: cython.double[::1] = buffer
    for k in range(means.shape[0]):
        for a in range(means.shape[1]):
            total: cython.double = 0.0
            for begin in range(0, samples, 4096):
                count = min(samples - begin, 4096)
                rng.standard_normal(out=buffer[:count])
                for i in range(count):
                    total += drawn[i]
            means[k, a] += sigma * total / samples


__all__ = ["FIXED", "NORM", "POPE", "SQUARE", "add_mean_noise", "adjust_norm_sets"]
