"""Samples of a unit on a table, drawn and added up at once: what a calibration needs of them, and no more."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def play_dwells(
    rng: np.random.Generator, true: np.ndarray, sigma: np.ndarray, samples: int, means: np.ndarray
) -> None:
    """Draw every sample of every dwell and write the means.

    `true` and `means` (dwells, sensors), `sigma` (sensors,) of a sample.
    """
    dwells, sensors = true.shape
    total = np.empty(sensors)
    for k in range(dwells):
        total[:] = 0.0
        for _ in range(samples):
            for a in range(sensors):
                total[a] += sigma[a] * rng.standard_normal()
        for a in range(sensors):
            means[k, a] = true[k, a] + total[a] / samples


@njit(cache=True, nogil=True)
def play_rotations(
    rng: np.random.Generator,
    wave: np.ndarray,
    step: np.ndarray,
    sigma: np.ndarray,
    samples: int,
    interval: float,
    integrals: np.ndarray,
    scatter: np.ndarray,
) -> None:
    """Draw every sample of every rotation; write the gyros' integrals and the accelerometers' scatter.

    `wave` (rotations, 3, 6): constant, cosine and sine of the six sensors (accelerometers first) in the angle
    turned; `step` (rotations,) is the angle from sample to sample, the first half a step from the beginning;
    `sigma` (6,) of a sample; `integrals` (rotations, 3); `scatter` (rotations, 3, 3) is the mean of products of
    the deviations from the mean.
    """
    for r in range(wave.shape[0]):
        gx, gy, gz = 0.0, 0.0, 0.0
        sx, sy, sz = 0.0, 0.0, 0.0
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        cosine, sine = np.cos(0.5 * step[r]), np.sin(0.5 * step[r])
        turn_cosine, turn_sine = np.cos(step[r]), np.sin(step[r])
        for _ in range(samples):
            # The constant is left out until the end: about nearly the mean the scatter keeps its digits.
            x = wave[r, 1, 0] * cosine + wave[r, 2, 0] * sine + sigma[0] * rng.standard_normal()
            y = wave[r, 1, 1] * cosine + wave[r, 2, 1] * sine + sigma[1] * rng.standard_normal()
            z = wave[r, 1, 2] * cosine + wave[r, 2, 2] * sine + sigma[2] * rng.standard_normal()
            sx, sy, sz = sx + x, sy + y, sz + z
            xx, xy, xz = xx + x * x, xy + x * y, xz + x * z
            yy, yz, zz = yy + y * y, yz + y * z, zz + z * z
            gx += wave[r, 1, 3] * cosine + wave[r, 2, 3] * sine + sigma[3] * rng.standard_normal()
            gy += wave[r, 1, 4] * cosine + wave[r, 2, 4] * sine + sigma[4] * rng.standard_normal()
            gz += wave[r, 1, 5] * cosine + wave[r, 2, 5] * sine + sigma[5] * rng.standard_normal()
            cosine, sine = cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine
        integrals[r, 0] = interval * (samples * wave[r, 0, 3] + gx)
        integrals[r, 1] = interval * (samples * wave[r, 0, 4] + gy)
        integrals[r, 2] = interval * (samples * wave[r, 0, 5] + gz)
        sx, sy, sz = sx / samples, sy / samples, sz / samples
        scatter[r, 0, 0] = xx / samples - sx * sx
        scatter[r, 1, 1] = yy / samples - sy * sy
        scatter[r, 2, 2] = zz / samples - sz * sz
        scatter[r, 0, 1] = scatter[r, 1, 0] = xy / samples - sx * sy
        scatter[r, 0, 2] = scatter[r, 2, 0] = xz / samples - sx * sz
        scatter[r, 1, 2] = scatter[r, 2, 1] = yz / samples - sy * sz


__all__ = ["play_dwells", "play_rotations"]
