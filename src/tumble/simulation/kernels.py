"""Recursions over samples, compiled; those with noise draw their own numbers from numpy's generator.

The numbers are drawn a few thousand at a time, in their order: a seed gives the same ones however many are asked for.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import floor, rint

_DRAWN = cython.declare(cython.Py_ssize_t, 4096)


def add_white(rng: np.random.Generator, scale: cython.double, total: cython.double[::1]) -> None:
    """Add white noise to all numbers in their order."""
    buffer = np.empty(min(_DRAWN, total.shape[0]))
    drawn: cython.double[::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                total[begin + i] += scale * drawn[i]


@cython.locals(value=cython.double, x=cython.double)
def add_markov(
    rng: np.random.Generator,
    memory: cython.const[cython.double][::1],
    gain: cython.const[cython.double][::1],
    state: cython.double[:, ::1],
    total: cython.double[:, ::1],
) -> None:
    """Add to each column the sum of the processes x_j[i] = memory_j x_j[i - 1] + gain_j z[i], the same z for all.

    `state` is (columns, processes), before the first sample, and is left as it is after the last.
    """
    processes = memory.shape[0]
    buffer = np.empty((min(_DRAWN, total.shape[0]), total.shape[1]))
    drawn: cython.double[:, ::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                for axis in range(total.shape[1]):
                    value = 0.0
                    for j in range(processes):
                        x = memory[j] * state[axis, j] + gain[j] * drawn[i, axis]
                        state[axis, j] = x
                        value += x
                    total[begin + i, axis] += value


def add_walk(rng: np.random.Generator, step: cython.double, total: cython.double[:, ::1]) -> None:
    """Add to each of three columns a random walk x[i] = x[i - 1] + step z[i] from x = 0."""
    x: cython.double = 0.0
    y: cython.double = 0.0
    z: cython.double = 0.0
    buffer = np.empty((min(_DRAWN, total.shape[0]), 3))
    drawn: cython.double[:, ::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                x += step * drawn[i, 0]
                y += step * drawn[i, 1]
                z += step * drawn[i, 2]
                total[begin + i, 0] += x
                total[begin + i, 1] += y
                total[begin + i, 2] += z


@cython.locals(value=cython.double)
def add_white_and_digitise(
    rng: np.random.Generator,
    scale: cython.double,
    step: cython.double,
    limit: cython.double,
    signal: cython.double[::1],
) -> None:
    """Add white noise, round to whole steps (none if zero), and stop at the limit, in one pass."""
    buffer = np.zeros(min(_DRAWN, signal.shape[0]))
    drawn: cython.double[::1] = buffer
    for begin in range(0, signal.shape[0], _DRAWN):
        count = min(_DRAWN, signal.shape[0] - begin)
        if scale > 0.0:
            rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                value = signal[begin + i] + scale * drawn[i]
                if step > 0.0:
                    value = step * rint(value / step)
                signal[begin + i] = min(max(value, -limit), limit)


@cython.locals(remainder=cython.double, wanted=cython.double)
def carry_remainders(signal: cython.double[:, ::1], step: cython.double) -> None:
    """Round each column to whole steps in place, what is left over going to the next sample."""
    with cython.nogil:
        for axis in range(signal.shape[1]):
            remainder = 0.0
            for i in range(signal.shape[0]):
                wanted = signal[i, axis] / step + remainder
                whole = floor(wanted + 0.5)
                remainder = wanted - whole
                signal[i, axis] = whole * step


__all__ = ["add_markov", "add_walk", "add_white", "add_white_and_digitise", "carry_remainders"]
