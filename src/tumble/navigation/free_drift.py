"""Free inertial drift: a known start, and then the sensors alone, from many starts of one drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.errors import RecordingError
from tumble.navigation.mechanisation import navigate
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import Trajectory, position_differences


@dataclass(frozen=True, slots=True)
class FreeDrift:
    """Errors of position of free navigation from known starts.

    Attributes
    ----------
    seconds : (lengths,) s since the start.
    starts : (starts,) s.
    errors_n : (starts, lengths, 3) m in north, east, down; NaN where the drive ends before, or samples are missing.
    """

    seconds: Series
    starts: Series
    errors_n: AnyArray

    def horizontal_squares(self, length: int) -> Series:
        """Return (starts,) m², squared horizontal errors after one of the lengths, NaN where there is none."""
        return np.asarray(np.sum(self.errors_n[:, length, :2] ** 2, axis=1))

    def block(self, length: int) -> int:
        """Return how many neighbouring starts err together after one of the lengths."""
        if len(self.starts) < 2:
            return 1
        apart = float(np.median(np.diff(self.starts)))
        return max(1, round(2.0 * float(self.seconds[length]) / apart))


def free_drift(
    samples: InertialSamples,
    reference: Trajectory,
    seconds: Sequence[float],
    *,
    every: float = 5.0,
    gaps: Sequence[tuple[float, float]] = (),
) -> FreeDrift:
    """Return how free navigation departs from a reference that it starts from again and again.

    Position, velocity and attitude are the reference's at each start. Nothing of the sensors' errors is taken out
    of the samples beside what was before: what grows is what those errors do.

    Parameters
    ----------
    samples : in SI, corrected or not.
    reference : such as a smoothed filter's, denser than the lengths.
    seconds : s, the lengths.
    every : s between starts.
    gaps : stretches (from, to) s without samples, which no free navigation may cross.

    Raises
    ------
    RecordingError
        If the reference is too short for the shortest length.
    """
    lengths = np.sort(np.asarray(seconds, dtype=float))
    last = min(float(reference.time[-1]), float(samples.time[-1]))
    rows: list[int] = []
    for row, time in enumerate(reference.time.tolist()):
        if time + lengths[0] <= last and (not rows or time - reference.time[rows[-1]] >= every - 1e-6):
            rows.append(row)
    if not rows:
        raise RecordingError(
            f"The drive's reference lasts {last - float(reference.time[0]):.0f} s, which is too short for "
            f"{lengths[0]:g} s of free navigation."
        )
    errors = np.full((len(rows), len(lengths), 3), np.nan)
    for at, row in enumerate(rows):
        errors[at] = _errors_from(samples, reference, row, lengths, last, gaps)
    return FreeDrift(lengths, reference.time[rows].copy(), errors)


def _errors_from(
    samples: InertialSamples,
    reference: Trajectory,
    row: int,
    lengths: Series,
    last: float,
    gaps: Sequence[tuple[float, float]],
) -> AnyArray:
    begin = float(reference.time[row])
    ahead = [first for first, _ in gaps if first >= begin] + [
        begin for first, to in gaps if first < begin < to
    ]
    stop = min([last, begin + float(lengths[-1]) + 1.0, *ahead])
    found = np.full((len(lengths), 3), np.nan)
    reached = begin + lengths <= stop + 1e-6
    if not reached.any():
        return found
    free = navigate(samples.between(begin, stop), reference.state(row))
    goals = np.array([int(np.argmin(np.abs(reference.time - begin - length))) for length in lengths])
    # the reference has no rows for a while after missing samples
    near = np.abs(reference.time[goals] - begin - lengths) < 0.75 * float(np.median(np.diff(reference.time)))
    reached &= near
    if not reached.any():
        return found
    goals = goals[reached]
    rows = np.clip(np.searchsorted(free.time, reference.time[goals]), 1, len(free) - 1)
    rows -= np.abs(free.time[rows - 1] - reference.time[goals]) < np.abs(
        free.time[rows] - reference.time[goals]
    )
    there, seen = free.rows(rows), reference.rows(goals)
    errors = position_differences(
        (there.latitude, there.longitude, there.height), (seen.latitude, seen.longitude, seen.height)
    )
    found[reached] = errors + there.velocity_n * (seen.time - there.time)[:, None]
    return found


__all__ = ["FreeDrift", "free_drift"]
