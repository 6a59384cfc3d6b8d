"""Many short free navigations, compiled."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.tumble.navigation.filter.kernels import correct
from cython.cimports.tumble.navigation.kernels import step_between

_NOWHERE = cython.declare(cython.double, 1e9)
_ENDLESS = cython.declare(cython.double, float("inf"))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _at(
    time: cython.const[cython.double][::1],
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    means: cython.bint,
    instant: cython.double,
    row: cython.Py_ssize_t,
    correction: cython.pointer[cython.const[cython.double]],
    true: cython.p_double,
) -> cython.void:
    """Fill the corrected sample at an instant before a row: straight between rows, or the mean that ends at the row."""
    raw = cython.declare(cython.double[6])
    share = 1.0 if means else (instant - time[row - 1]) / (time[row] - time[row - 1])
    before = max(row - 1, 0)
    for j in range(3):
        if share == 1.0:
            raw[j], raw[3 + j] = rate[row, j], force[row, j]
        else:
            raw[j] = (1.0 - share) * rate[before, j] + share * rate[row, j]
            raw[3 + j] = (1.0 - share) * force[before, j] + share * force[row, j]
    correct(raw, correction, true)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _row_after(time: cython.const[cython.double][::1], instant: cython.double) -> cython.Py_ssize_t:
    """Return the first row later than an instant, at most the last."""
    low, high = 0, time.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if time[middle] > instant:
            high = middle
        else:
            low = middle + 1
    return low


def run_from_each(
    time: cython.const[cython.double][::1],
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    means: cython.bint,
    starts: cython.const[cython.double][:, ::1],
    begins: cython.const[cython.double][::1],
    goals: cython.const[cython.double][:, ::1],
    corrections: cython.const[cython.double][:, :, :, ::1],
    found: cython.double[:, :, ::1],
) -> None:
    """Fill `found` (starts, goals, 10) with the states at goals, as for `tumble.navigation.free_runs`."""
    state = cython.declare(cython.double[10])
    shown = cython.declare(cython.double[10])
    place = cython.declare(cython.double[3])
    moved = cython.declare(cython.double[3])
    old = cython.declare(cython.double[6])
    new = cython.declare(cython.double[6])
    with cython.nogil:
        weight = 0.0 if means else 0.5
        for one in range(starts.shape[0]):
            correction = cython.address(corrections[one, 0, 0, 0])
            for j in range(10):
                state[j] = shown[j] = starts[one, j]
            place[0], place[1], place[2] = _NOWHERE, 0.0, 0.0
            now, previous = begins[one], _ENDLESS
            row = _row_after(time, now)
            _at(time, rate, force, means, now, row, correction, old)
            for goal in range(goals.shape[1]):
                until = goals[one, goal]
                for j in range(10):
                    shown[j] = state[j]
                while now < until:
                    # a goal between samples is looked at, and the run goes on from the sample before it
                    end = min(time[row], until)
                    interval = end - now
                    _at(time, rate, force, means, end, row, correction, new)
                    share = interval / (interval + previous) if means else 0.5
                    for j in range(10):
                        shown[j] = state[j]
                    for j in range(3):
                        moved[j] = place[j]
                    step_between(shown, moved, old, new, weight, share, interval)
                    if end < time[row]:
                        break
                    for j in range(10):
                        state[j] = shown[j]
                    for j in range(3):
                        place[j] = moved[j]
                    for j in range(6):
                        old[j] = new[j]
                    now, previous, row = end, interval, row + 1
                if until == until:
                    for j in range(10):
                        found[one, goal, j] = shown[j]


__all__ = ["run_from_each"]
