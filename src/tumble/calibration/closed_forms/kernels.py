"""The norm adjustment of one triad, compiled: many sets of hold means one after the other."""

from __future__ import annotations

import numpy as np
from numba import njit, types

_SETS = types.float64[:, :, ::1]
_ROWS = types.float64[:, ::1]
_ROW = types.float64[::1]
_WHOLE = types.int64[::1]

# How the conditions are weighed and linearised; see `norm_batch.ESTIMATORS`.
POPE, FIXED, NORM, SQUARE = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def _forward(values: np.ndarray, m: np.ndarray) -> None:
    """Lower-triangular matrix of bias, scale and angles (Hayal 3.13)."""
    m[0, 0] = values[3]
    m[1, 0] = -values[4] * np.sin(values[6])
    m[1, 1] = values[4] * np.cos(values[6])
    m[2, 0] = values[5] * np.sin(values[8])
    m[2, 1] = -values[5] * np.sin(values[7]) * np.cos(values[8])
    m[2, 2] = values[5] * np.cos(values[7]) * np.cos(values[8])


@njit(cache=True, nogil=True)
def _cholesky_solve(
    normal: np.ndarray,
    right: np.ndarray,
    size: int,
    step: np.ndarray,
    cofactor: np.ndarray,
    scratch: np.ndarray,
) -> bool:
    """Solve the scaled normal equations in place; return whether they are positive definite."""
    factor, root, scale = scratch[0], scratch[1], scratch[2, 0]
    for i in range(size):
        if not normal[i, i] > 0.0:
            return False
        scale[i] = 1.0 / np.sqrt(normal[i, i])
    for i in range(size):
        for j in range(i + 1):
            total = normal[i, j] * scale[i] * scale[j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                if not total > 1e-12:
                    return False
                factor[i, i] = np.sqrt(total)
                root[i, i] = 1.0 / factor[i, i]
            else:
                factor[i, j] = total * root[j, j]
    for i in range(size):
        for j in range(i):
            total = 0.0
            for k in range(j, i):
                total -= factor[i, k] * root[k, j]
            root[i, j] = total * root[i, i]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += root[k, i] * root[k, j]
            cofactor[i, j] = total * scale[i] * scale[j]
            cofactor[j, i] = cofactor[i, j]
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += cofactor[i, j] * right[j]
        step[i] = total
    return True


@njit(
    [
        types.void(
            _SETS,
            _ROWS,
            _ROW,
            _ROWS,
            types.int64,
            types.int64,
            types.int64,
            types.float64,
            _ROWS,
            _SETS,
            _ROW,
            _WHOLE,
        )
    ],
    cache=True,
    nogil=True,
)
def adjust_norm_sets(
    observed: np.ndarray,
    variance: np.ndarray,
    reference: np.ndarray,
    start: np.ndarray,
    size: int,
    estimator: int,
    limit: int,
    tolerance: float,
    parameters: np.ndarray,
    cofactors: np.ndarray,
    sigma0: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """Adjust every set; `iterations` is negative where it did not converge.

    `observed` (sets, holds, 3), `variance` (holds, 3), `reference` (holds,), `start` and `parameters`
    (sets, 9), `cofactors` (sets, size, size).
    """
    sets, holds = observed.shape[0], observed.shape[1]
    m, normal = np.zeros((3, 3)), np.zeros((size, size))
    right, step, row = np.zeros(size), np.zeros(size), np.zeros(9)
    adjusted, by_raw = np.zeros((holds, 3)), np.zeros((holds, 3))
    design, misclosure, spread = np.zeros((holds, 9)), np.zeros(holds), np.zeros(holds)
    t, w, over_scale, cofactor = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((size, size))
    scratch = np.zeros((3, size, size))
    # Least squares on the norm weighs all holds alike: by the mean variance of a sensor.
    alike = variance.mean()
    for number in range(sets):
        values = parameters[number]
        values[:] = start[number]
        adjusted[:] = observed[number]
        cofactor[:] = np.nan
        before, done, count = np.inf, False, 0
        while not done and count < limit:
            count += 1
            _forward(values, m)
            sin_yz, cos_yz = np.sin(values[6]), np.cos(values[6])
            sin_zx, cos_zx = np.sin(values[7]), np.cos(values[7])
            sin_zy, cos_zy = np.sin(values[8]), np.cos(values[8])
            over_x, over_y, over_z = 1.0 / m[0, 0], 1.0 / m[1, 1], 1.0 / m[2, 2]
            for a in range(3):
                over_scale[a] = 1.0 / values[3 + a]
            normal[:] = 0.0
            right[:] = 0.0
            for k in range(holds):
                ux = adjusted[k, 0] - values[0]
                uy = adjusted[k, 1] - values[1]
                uz = adjusted[k, 2] - values[2]
                t[0] = ux * over_x
                t[1] = (uy - m[1, 0] * t[0]) * over_y
                t[2] = (uz - m[2, 0] * t[0] - m[2, 1] * t[1]) * over_z
                square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
                K = reference[k]
                length = np.sqrt(square)
                # derivative of the condition by the true vector is t times this
                slope = 1.0 / length if estimator == 2 else (2.0 if estimator == 3 else 1.0 / K)
                if estimator == 2:
                    f = length - K
                elif estimator == 3:
                    f = square - K * K
                else:
                    f = 0.5 * (square - K * K) / K
                w[2] = slope * t[2] * over_z
                w[1] = (slope * t[1] - m[2, 1] * w[2]) * over_y
                w[0] = (slope * t[0] - m[1, 0] * w[1] - m[2, 0] * w[2]) * over_x
                row[0], row[1], row[2] = -w[0], -w[1], -w[2]
                row[3] = -w[0] * ux * over_scale[0]
                row[4] = -w[1] * uy * over_scale[1]
                row[5] = -w[2] * uz * over_scale[2]
                row[6] = w[1] * values[4] * (cos_yz * t[0] + sin_yz * t[1])
                row[7] = w[2] * values[5] * cos_zy * (cos_zx * t[1] + sin_zx * t[2])
                row[8] = -w[2] * values[5] * (cos_zy * t[0] + sin_zx * sin_zy * t[1] - cos_zx * sin_zy * t[2])
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
                biggest = max(biggest, abs(step[i]) / np.sqrt(cofactor[i, i]))
                settled = settled and abs(step[i]) <= 1e-13 * max(abs(values[i]), 1.0)
            if not np.isfinite(biggest):
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
            sigma0[number] = np.sqrt(square_sum / (holds - size)) if holds > size else np.nan
        cofactors[number, :, :] = cofactor
        iterations[number] = count if done else -count


@njit(cache=True, nogil=True)
def add_mean_noise(rng: np.random.Generator, sigma: float, samples: int, means: np.ndarray) -> None:
    """Add to every number of `means` (rows, 3) the mean of `samples` normal numbers of standard deviation `sigma`.

    Every single sample is drawn.
    """
    for k in range(means.shape[0]):
        for a in range(means.shape[1]):
            total = 0.0
            for _ in range(samples):
                total += rng.standard_normal()
            means[k, a] += sigma * total / samples


__all__ = ["FIXED", "NORM", "POPE", "SQUARE", "add_mean_noise", "adjust_norm_sets"]
