"""Free inertial drift: a known start, and then the sensors alone, from many starts of one drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.errors import RecordingError
from tumble.navigation.filter.run import unpacked
from tumble.navigation.mechanisation import navigate_from_each
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import Trajectory, position_differences
from tumble.records import dataclass


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
    return FreeDrift(
        lengths, reference.time[rows].copy(), _errors(samples, reference, rows, lengths, last, gaps)
    )


def _errors(
    samples: InertialSamples,
    reference: Trajectory,
    rows: Sequence[int],
    lengths: Series,
    last: float,
    gaps: Sequence[tuple[float, float]],
) -> AnyArray:
    """Errors after each length, (starts, lengths, 3), NaN where the reference or the samples do not reach."""
    begins = reference.time[np.asarray(rows, dtype=np.int64)]
    stops = np.full(len(rows), last)
    for first, to in gaps:
        stops = np.where(begins < to, np.minimum(stops, np.maximum(first, begins)), stops)
    wanted = begins[:, None] + lengths
    there = np.clip(np.searchsorted(reference.time, wanted), 1, len(reference) - 1)
    there -= wanted - reference.time[there - 1] < reference.time[there] - wanted
    # the reference has no rows for a while after missing samples
    near = np.abs(reference.time[there] - wanted) < 0.75 * float(np.median(np.diff(reference.time)))
    reached = near & (wanted <= stops[:, None] + 1e-6) & (reference.time[there] <= stops[:, None] + 1e-6)
    goals = np.where(reached, reference.time[there], np.nan)
    states = navigate_from_each(samples, reference.rows(np.asarray(rows)).packed, begins, goals)
    errors = np.full((*wanted.shape, 3), np.nan)
    free, seen = unpacked(goals[reached], states[reached]), reference.rows(there[reached])
    errors[reached] = position_differences(free.position, seen.position)
    return errors
