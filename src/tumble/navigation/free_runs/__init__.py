"""Many short free navigations of one recording: from each start to each of its goals."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.navigation.samples import InertialSamples


def navigate_from_each(
    samples: InertialSamples, starts: Table, begins: Series, goals: Table, corrections: AnyArray | None = None
) -> AnyArray:
    """Return (starts, goals, 10) the local-level states at goals, as `NavigationState.packed`; NaN for none.

    Parameters
    ----------
    samples : in SI.
    starts : (starts, 10) states, as `NavigationState.packed`.
    begins : (starts,) s, when; inside the samples.
    goals : (starts, goals) s, rising; inside the samples, and NaN for none.
    corrections : (starts, 4, 3, 3) of the samples, as `tumble.navigation.filter.kernels.gather_sensors` fills them;
        None for none.
    """
    from tumble.navigation.free_runs.kernels import run_from_each

    if corrections is None:
        corrections = np.zeros((len(starts), 4, 3, 3))
        corrections[:, :2] = np.eye(3)
    found = np.full((*goals.shape, 10), np.nan)
    run_from_each(
        np.ascontiguousarray(samples.time),
        np.ascontiguousarray(samples.angular_rate_ib_b),
        np.ascontiguousarray(samples.specific_force_b),
        samples.means,
        np.ascontiguousarray(starts),
        np.ascontiguousarray(begins),
        np.ascontiguousarray(goals),
        np.ascontiguousarray(corrections),
        found,
    )
    return found


__all__ = ["navigate_from_each"]
