"""Many short free navigations, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from tumble.navigation.filter.kernels import correct
from tumble.navigation.kernels import NOWHERE, Floats, body_increments, step_in_local_level, unpacked

_READ_ROW = types.Array(types.float64, 1, "C", readonly=True)
_READ_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_READ_STACKS = types.Array(types.float64, 4, "C", readonly=True)


@njit(cache=True, nogil=True, forceinline=True)
def _at(time, rate, force, means, instant, row, correction, raw, true):
    """The corrected sample at an instant before a row: straight between rows, or the mean that ends at the row."""
    share = 1.0 if means else (instant - time[row - 1]) / (time[row] - time[row - 1])
    before = max(row - 1, 0)
    for j in range(3):
        raw[j] = rate[row, j] if share == 1.0 else (1.0 - share) * rate[before, j] + share * rate[row, j]
        raw[3 + j] = (
            force[row, j] if share == 1.0 else (1.0 - share) * force[before, j] + share * force[row, j]
        )
    correct(raw, correction, true)
    return true[0], true[1], true[2], true[3], true[4], true[5]


@njit(
    types.void(
        *(_READ_ROW, _READ_ROWS, _READ_ROWS, types.boolean),
        *(_READ_ROWS, _READ_ROW, _READ_ROWS, _READ_STACKS, types.float64[:, :, ::1]),
    ),
    cache=True,
    nogil=True,
)
def run_from_each(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    starts: Floats,
    begins: Floats,
    goals: Floats,
    corrections: Floats,
    found: Floats,
) -> None:
    """Fill `found` (starts, goals, 10) with the states at goals, as for `tumble.navigation.free_runs`."""
    raw, true = np.empty(6), np.empty(6)
    weight = 0.0 if means else 0.5
    for one in range(starts.shape[0]):
        correction = corrections[one]
        state, place, now, previous = unpacked(starts[one]), NOWHERE, begins[one], np.inf
        row = min(np.searchsorted(time, now, side="right"), time.shape[0] - 1)
        old = _at(time, rate, force, means, now, row, correction, raw, true)
        for goal in range(goals.shape[1]):
            until = goals[one, goal]
            shown = state
            while now < until:
                # a goal between samples is looked at, and the run goes on from the sample before it
                end = min(time[row], until)
                interval = end - now
                new = _at(time, rate, force, means, end, row, correction, raw, true)
                share = interval / (interval + previous) if means else 0.5
                increments = body_increments(old, new, weight, share, interval)
                shown, moved = step_in_local_level(state, increments, place, interval)
                if end < time[row]:
                    break
                state, place, old, now, previous, row = shown, moved, new, end, interval, row + 1
            if until == until:
                for j, value in enumerate(shown):
                    found[one, goal, j] = value


__all__ = ["run_from_each"]
