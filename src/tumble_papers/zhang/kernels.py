"""Samples of a unit on a table, drawn and added up at once: what a calibration needs of them, and no more."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import cos, sin

_DRAWN = cython.declare(cython.Py_ssize_t, 1024)


def play_dwells(
    rng: np.random.Generator,
    true: cython.const[cython.double][:, ::1],
    sigma: cython.const[cython.double][::1],
    samples: cython.Py_ssize_t,
    means: cython.double[:, ::1],
) -> None:
    """Draw every sample of every dwell and write the means.

    `true` and `means` (dwells, sensors), `sigma` (sensors,) of a sample.
    """
    sensors = true.shape[1]
    total: cython.double[::1] = np.empty(sensors)
    buffer = np.empty((_DRAWN, sensors))
    drawn: cython.double[:, ::1] = buffer
    for k in range(true.shape[0]):
        for a in range(sensors):
            total[a] = 0.0
        for begin in range(0, samples, _DRAWN):
            count = min(_DRAWN, samples - begin)
            rng.standard_normal(out=buffer[:count])
            with cython.nogil:
                for i in range(count):
                    for a in range(sensors):
                        total[a] += sigma[a] * drawn[i, a]
        for a in range(sensors):
            means[k, a] = true[k, a] + total[a] / samples


def play_rotations(
    rng: np.random.Generator,
    wave: cython.const[cython.double][:, :, ::1],
    step: cython.const[cython.double][::1],
    sigma: cython.const[cython.double][::1],
    samples: cython.Py_ssize_t,
    interval: cython.double,
    integrals: cython.double[:, ::1],
    scatter: cython.double[:, :, ::1],
) -> None:
    """Draw every sample of every rotation; write the gyros' integrals and the accelerometers' scatter.

    `wave` (rotations, 3, 6): constant, cosine and sine of the six sensors (accelerometers first) in the angle
    turned; `step` (rotations,) is the angle from sample to sample, the first half a step from the beginning;
    `sigma` (6,) of a sample; `integrals` (rotations, 3); `scatter` (rotations, 3, 3) is the mean of products of
    the deviations from the mean.
    """
    buffer = np.empty((_DRAWN, 6))
    drawn: cython.double[:, ::1] = buffer
    x = cython.declare(cython.double[6])
    total = cython.declare(cython.double[6])
    products = cython.declare(cython.double[9])
    for r in range(wave.shape[0]):
        for a in range(6):
            total[a] = 0.0
        for a in range(9):
            products[a] = 0.0
        cosine, sine = cos(0.5 * step[r]), sin(0.5 * step[r])
        turn_cosine, turn_sine = cos(step[r]), sin(step[r])
        for begin in range(0, samples, _DRAWN):
            count = min(_DRAWN, samples - begin)
            rng.standard_normal(out=buffer[:count])
            with cython.nogil:
                for i in range(count):
                    # The constant is left out until the end: about nearly the mean the scatter keeps its digits.
                    for a in range(6):
                        x[a] = wave[r, 1, a] * cosine + wave[r, 2, a] * sine + sigma[a] * drawn[i, a]
                        total[a] += x[a]
                    for a in range(3):
                        for b in range(3):
                            products[3 * a + b] += x[a] * x[b]
                    before = cosine
                    cosine = before * turn_cosine - sine * turn_sine
                    sine = sine * turn_cosine + before * turn_sine
        for a in range(3):
            integrals[r, a] = interval * (samples * wave[r, 0, 3 + a] + total[3 + a])
            for b in range(3):
                scatter[r, a, b] = products[3 * a + b] / samples - total[a] / samples * (total[b] / samples)


__all__ = ["play_dwells", "play_rotations"]
