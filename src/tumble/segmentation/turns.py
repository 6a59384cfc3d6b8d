"""Turns: the motion from one hold to the next, and whether the angular rate can be trusted there."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector, Vectors, extremes
from tumble.recording.recording import Recording
from tumble.segmentation.activity import Activity, noise_per_sample
from tumble.segmentation.blocks import find_runs
from tumble.segmentation.timeline import Hold, Turn

AXES = "xyz"
SATURATED_RUN = 3
# Nothing is integrated across a longer gap: the rate within it is not seen.
LONGEST_GAP = 0.1  # s


def find_turns(recording: Recording, holds: list[Hold], activity: Activity) -> list[Turn]:
    """Return the turns between consecutive holds; one that cannot be integrated says why.

    Parameters
    ----------
    recording, holds : the samples and the holds in them, in order.
    activity : of the same recording; the gyro's bias and scale tell full scale from rest.
    """
    limits = _full_scale(recording.angular_rate, activity)
    noise = None
    if recording.gaps and recording.angular_rate is not None:
        noise = noise_per_sample(recording.angular_rate, holds)
    turns: list[Turn] = []
    for number in range(len(holds) - 1):
        start, stop = holds[number].stop, holds[number + 1].start
        reason = _reason_against(recording, start, stop, limits, noise)
        turns.append(Turn(number, number + 1, start, stop, not reason, reason))
    return turns


def _full_scale(rate: Vectors | None, activity: Activity) -> tuple[np.ndarray, np.ndarray] | None:
    """The extreme values per axis (lowest, highest) where they are far from rest, else infinite."""
    if rate is None or activity.rate_bias is None or activity.rate_scale is None:
        return None
    low, high = extremes(rate)
    fast = 0.5 / activity.rate_scale
    low = np.where(activity.rate_bias - low > fast, low, -np.inf)
    high = np.where(high - activity.rate_bias > fast, high, np.inf)
    return low, high


def _reason_against(
    recording: Recording,
    start: int,
    stop: int,
    limits: tuple[np.ndarray, np.ndarray] | None,
    noise: Vector | None,
) -> str:
    gaps = np.array([gap for gap in recording.gaps if start <= gap <= stop and gap > 0], dtype=int)
    if gaps.size and not _is_bridged(recording, gaps, stop - start, noise):
        steps = recording.time[gaps] - recording.time[gaps - 1] - 1.0 / recording.rate
        return f"{steps.sum():.2g} s of samples are missing in it"
    if recording.angular_rate is None or limits is None:
        return "there is no gyro" if recording.angular_rate is None else ""
    piece = recording.angular_rate[start:stop]
    for axis in range(3):
        at_limit = (piece[:, axis] <= limits[0][axis]) | (piece[:, axis] >= limits[1][axis])
        run = max((last - first for first, last in find_runs(at_limit)), default=0)
        if run >= SATURATED_RUN:
            return f"the gyro's {AXES[axis]} axis is at its extreme value for {run} samples: saturated"
    return ""


def _is_bridged(recording: Recording, gaps: np.ndarray, samples: int, noise: Vector | None) -> bool:
    """Whether straight lines across the gaps are off by less than the turn's noise: h²/12 times the slope's change."""
    rate, time = recording.angular_rate, recording.time
    if rate is None or noise is None or gaps.min() < 2 or gaps.max() > len(time) - 2:
        return False
    before = (rate[gaps - 1] - rate[gaps - 2]) / (time[gaps - 1] - time[gaps - 2])[:, None]
    after = (rate[gaps + 1] - rate[gaps]) / (time[gaps + 1] - time[gaps])[:, None]
    step = time[gaps] - time[gaps - 1]
    missed = float(np.sum(step**2 / 12.0 * np.linalg.norm(after - before, axis=1)))
    own = float(np.linalg.norm(noise)) * samples**0.5 / recording.rate
    return float(step.max()) <= LONGEST_GAP and missed < own


# A value that a share of this size of a spin's samples has, and twice the share that any value has in the
# holds, is the end of scale: noise spreads over more codes than that.
CLIPPED_SHARE = 0.05


def find_saturated_axis(recording: Recording, holds: tuple[Hold, ...], start: int, stop: int) -> int | None:
    """Return the axis of the gyro that is clipped at a constant rate, or None.

    A run at the extreme value proves nothing there, because the fastest spin of a quantised gyro is at
    the recording's extreme value all along. What betrays clipping is that noise has gone: far more
    samples than any code has at rest are at the extreme.

    Parameters
    ----------
    recording, holds : raw samples, and the holds found in them.
    start, stop : samples of constant rate.
    """
    rate = recording.angular_rate
    if rate is None:
        return None
    lowest, highest = extremes(rate)
    for axis in range(3):
        piece = rate[start:stop, axis]
        same = 1e-9 * (highest[axis] - lowest[axis])
        clipped = max(np.sum(piece <= lowest[axis] + same), np.sum(piece >= highest[axis] - same))
        if clipped <= SATURATED_RUN or clipped <= CLIPPED_SHARE * len(piece):
            continue
        if clipped > 2.0 * _largest_share(rate[:, axis], holds, same) * len(piece):
            return axis
    return None


def _largest_share(values: np.ndarray, holds: tuple[Hold, ...], same: float) -> float:
    """Median over the holds of the share of samples that have the most frequent value."""
    shares: list[float] = []
    for hold in holds:
        piece = np.sort(values[hold.start : hold.stop])
        if len(piece) > 1:
            edges = np.flatnonzero(np.concatenate([[True], np.diff(piece) > same, [True]]))
            shares.append(float(np.diff(edges).max()) / len(piece))
    return float(np.median(shares)) if shares else 1.0
