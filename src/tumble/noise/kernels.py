"""Sums over the samples, compiled: each reads contiguous slices of the running sum of a signal.

A tile of the running sum is held against all averaging times before the next one is read: short averaging
times then find it in the cache, and long ones read two streams from memory instead of three. The sums of
the tiles are added up one by one, so that rounding stays that of some thousand terms.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython


def running_sum(
    signal: cython.const[cython.double][:],
    level: cython.double,
    phase: cython.double[::1],
) -> None:
    """Fill the sum of the signal less `level` up to each sample: zero first, one longer than the signal."""
    with cython.nogil:
        total = 0.0
        phase[0] = 0.0
        for i in range(signal.shape[0]):
            total += signal[i] - level
            phase[i + 1] = total


def second_difference_squares(
    phase: cython.const[cython.double][::1],
    steps: cython.const[cython.longlong][::1],
    sums: cython.double[::1],
) -> None:
    """Add to `sums` the squares of x[i + 2m] - 2 x[i + m] + x[i] over all i, for each m of `steps`, which rise."""
    with cython.nogil:
        for begin in range(0, phase.shape[0], 2048):
            for k in range(0, steps.shape[0], 4):
                last = min(k + 4, steps.shape[0])
                if last == k + 4 and begin + 2048 <= phase.shape[0] - 2 * steps[k + 3]:
                    _four_steps(phase, begin, begin + 2048, cython.address(steps[k]), cython.address(sums[k]))
                else:
                    for one in range(k, last):
                        end = min(begin + 2048, phase.shape[0] - 2 * steps[one])
                        sums[one] += _one_step(phase, begin, end, steps[one])


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _four_steps(
    phase: cython.const[cython.double][::1],
    begin: cython.Py_ssize_t,
    end: cython.Py_ssize_t,
    m: cython.pointer(cython.const[cython.longlong]),
    sums: cython.p_double,
) -> cython.void:
    """Add the squares of four averaging times at once: the sample that they begin at is read once."""
    a = b = c = d = 0.0
    for i in range(begin, end):
        a += _second(phase, i, m[0]) ** 2
        b += _second(phase, i, m[1]) ** 2
        c += _second(phase, i, m[2]) ** 2
        d += _second(phase, i, m[3]) ** 2
    sums[0] += a
    sums[1] += b
    sums[2] += c
    sums[3] += d


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _one_step(
    phase: cython.const[cython.double][::1],
    begin: cython.Py_ssize_t,
    end: cython.Py_ssize_t,
    m: cython.Py_ssize_t,
) -> cython.double:
    """Return the sum of the squares from `begin` on: four quarters, so that no sum waits for the one before it."""
    quarter = max(end - begin, 0) // 4
    a = b = c = d = 0.0
    for i in range(begin, begin + quarter):
        a += _second(phase, i, m) ** 2
        b += _second(phase, i + quarter, m) ** 2
        c += _second(phase, i + 2 * quarter, m) ** 2
        d += _second(phase, i + 3 * quarter, m) ** 2
    for i in range(begin + 4 * quarter, end):
        a += _second(phase, i, m) ** 2
    return (a + b) + (c + d)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _second(
    phase: cython.const[cython.double][::1],
    i: cython.Py_ssize_t,
    m: cython.Py_ssize_t,
) -> cython.double:
    """Second difference at m from i on."""
    return phase[i + 2 * m] - 2.0 * phase[i + m] + phase[i]


__all__ = ["running_sum", "second_difference_squares"]
