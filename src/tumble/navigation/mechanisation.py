"""Free inertial navigation: position, velocity and attitude from an IMU alone, from one start or from many."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import RecordingError, UsageError
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import HIGHEST_LATITUDE, NavigationState, Trajectory


def samples_from(samples: InertialSamples, start: NavigationState) -> InertialSamples:
    """Return the samples from a start on.

    Parameters
    ----------
    samples, start : as for `navigate`.

    Raises
    ------
    UsageError
        If the start is within 0.1° of a pole.
    RecordingError
        If the samples do not reach over the start.
    """
    if abs(start.latitude) > HIGHEST_LATITUDE:
        raise UsageError(
            f"At a latitude of {np.degrees(start.latitude):.3f} degrees the local level has no north to hold: there is "
            "no way to navigate in it at a pole."
        )
    if not samples.time[0] <= start.time < samples.time[-1]:
        raise RecordingError(
            f"The start at {start.time:.3f} s is not inside the IMU's samples, which run from "
            f"{samples.time[0]:.3f} to {samples.time[-1]:.3f} s."
        )
    return samples if start.time == samples.time[0] else samples.between(start.time, float(samples.time[-1]))


def navigate(
    samples: InertialSamples,
    start: NavigationState,
    *,
    every: int = 1,
) -> Trajectory:
    """Integrate an IMU's samples from a start, in the local level (north, east, down).

    Coning and sculling are those of signals that run straight between samples; gravity is normal gravity with
    height (Somigliana). Errors of a step are of the third order in it.

    Parameters
    ----------
    samples : in SI; they must reach over `start.time`, where they are cut.
    start : at whose time the integration begins.
    every : keep each so many-th sample, and the first and last.

    Raises
    ------
    UsageError
        If `every` is below one, or the start is within 0.1° of a pole.
    RecordingError
        If the samples do not reach over the start.
    """
    from tumble.navigation.kernels import integrate

    if every < 1:
        raise UsageError(f"Every {every}-th sample cannot be kept: give 1 or more.")
    part = samples_from(samples, start)
    state = start.packed
    steps = len(part) - 1
    count = -(-steps // every) + 1
    position, velocity_n, quaternion = (np.empty((count, width)) for width in (3, 3, 4))
    integrate(
        np.ascontiguousarray(part.time),
        np.ascontiguousarray(part.angular_rate_ib_b),
        np.ascontiguousarray(part.specific_force_b),
        part.means,
        every,
        state,
        position,
        velocity_n,
        quaternion,
    )
    time = part.time if every == 1 else part.time[np.append(np.arange(0, steps, every), steps)]
    return Trajectory(time, position[:, 0], position[:, 1], position[:, 2], velocity_n, quaternion)


def navigate_from_each(
    samples: InertialSamples, starts: Table, begins: Series, goals: Table, parameters: Table | None = None
) -> AnyArray:
    """Return (starts, goals, 10) the local-level states at goals, as `NavigationState.packed`; NaN for none.

    Parameters
    ----------
    samples : in SI.
    starts : (starts, 10) states, as `NavigationState.packed`.
    begins : (starts,) s, when; inside the samples.
    goals : (starts, goals) s, rising; inside the samples, and NaN for none.
    parameters : (starts, 37) of the samples, as `tumble.navigation.filter.kernels.gather_sensors` fills them;
        None where they are right as they are.
    """
    from tumble.navigation.filter.kernels import run_from_each

    if parameters is None:
        parameters = np.zeros((len(starts), 37))
        parameters[:, [0, 4, 8, 9, 13, 17]] = 1.0
    found = np.full((*goals.shape, 10), np.nan)
    run_from_each(
        np.ascontiguousarray(samples.time),
        np.hstack([samples.angular_rate_ib_b, samples.specific_force_b]),
        samples.means,
        np.ascontiguousarray(starts),
        np.ascontiguousarray(begins),
        np.minimum(np.searchsorted(samples.time, begins, side="right"), len(samples) - 1),
        np.ascontiguousarray(goals),
        np.ascontiguousarray(parameters),
        found,
    )
    return found
