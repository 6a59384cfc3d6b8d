"""The rate of a track's course and of the gyros about the vertical, both averaged over a second: what both saw."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.errors import RecordingError
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples

# A course is noise below a speed, m/s: of so many standard uncertainties of the velocity, between these.
_CERTAIN, _SLOWEST, _FAST_ENOUGH = 8.0, 0.4, 1.5
# s between the points of the grid.
STEP = 0.05
# Motion that is compared is averaged over this, s, on both sides.
WINDOW = 1.0
# Fewer times than this make no correlation.
FEWEST = 10
_FEWEST_VELOCITIES = 10


def find_down(samples: InertialSamples) -> Vector:
    """Down in b: against the mean specific force, as a vehicle that stays upright has it."""
    mean = np.mean(samples.specific_force_b[1:], axis=0)
    return -mean / float(np.sqrt(mean @ mean))


def rate_about_down(samples: InertialSamples) -> tuple[Series, Series]:
    """The gyros' rate about down, averaged, on its grid."""
    return averaged(samples, samples.angular_rate_ib_b @ find_down(samples))


def averaged(samples: InertialSamples, signal: Series) -> tuple[Series, Series]:
    """A signal's running mean over the window, on an even grid; NaN where samples are missing in it."""
    time = samples.time
    total = np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]) * np.diff(time))])
    grid = np.arange(time[0] + 0.5 * WINDOW, time[-1] - 0.5 * WINDOW, STEP)
    ends = (np.interp(grid + half, time, total) for half in (0.5 * WINDOW, -0.5 * WINDOW))
    last, first = ends
    mean = (last - first) / WINDOW
    for begin, end in samples.missing():
        mean[(grid + 0.5 * WINDOW > begin) & (grid - 0.5 * WINDOW < end)] = np.nan
    return grid, mean


def find_course_rate(track: GnssTrack) -> tuple[Series, Series, Series]:
    """Return middle (s), rate of the course (rad/s) and weight of each stretch of about a window of a track.

    Parameters
    ----------
    track : with velocities, or positions close enough to make them.

    Raises
    ------
    RecordingError
        If the track does not move fast enough to have a course.
    """
    velocity = track_velocities(track)
    good = np.isfinite(velocity).all(axis=1)
    time, velocity = track.time[good], velocity[good]
    speed, slowest = np.hypot(velocity[:, 0], velocity[:, 1]), slowest_course(track)
    if np.count_nonzero(speed > slowest) < 10:
        raise RecordingError(
            f"The track {track.name} moves faster than {slowest:.2g} m/s at {np.count_nonzero(speed > slowest)} "
            "fixes only, and a course as uncertain as its velocities takes speed: the clocks cannot be compared by it."
        )
    steps = max(1, round(WINDOW / max(track.interval, 1e-3)))
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    span = time[steps:] - time[:-steps]
    turn = np.remainder(course[steps:] - course[:-steps] + np.pi, 2.0 * np.pi) - np.pi
    windows = np.lib.stride_tricks.sliding_window_view(speed, min(steps + 1, len(speed)))
    least = windows.min(axis=1)[: len(span)]
    weights = ((least > slowest) & (span < 1.5 * max(WINDOW, track.interval))).astype(float)
    return 0.5 * (time[steps:] + time[:-steps]), turn / span, weights


def slowest_course(track: GnssTrack) -> float:
    """Return the speed, m/s, from which on a track's course is known to an eighth of a radian; 1.5 at most.

    Positions are off together from fix to fix, so that differences of uncertain ones are better than they say.

    Parameters
    ----------
    track : with the covariances of its velocities, or of its positions where it has none.
    """
    covariance = track.velocity_covariance_n
    if track.has_velocity.sum() <= _FEWEST_VELOCITIES:
        covariance = track.position_covariance_n / (2.0 * max(track.interval, 1e-3) ** 2)
    variance = 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])
    told = variance[np.isfinite(variance)]
    if not told.size:
        return _FAST_ENOUGH
    return float(np.clip(_CERTAIN * np.sqrt(np.median(told)), _SLOWEST, _FAST_ENOUGH))


def track_velocities(track: GnssTrack) -> Vectors:
    """Velocities of the track, or differences of its positions where it has none."""
    if track.has_velocity.sum() > _FEWEST_VELOCITIES:
        return track.velocity_n
    from tumble.navigation.trajectory import position_differences

    moved = position_differences(track.rows(slice(2, None)).position, track.rows(slice(None, -2)).position)
    velocity = np.full((len(track), 3), np.nan)
    velocity[1:-1] = moved / (track.time[2:] - track.time[:-2])[:, None]
    return velocity


def seen_by(grid: Series, values: Series, times: Series) -> np.ndarray:
    """Which times lie on a grid where its values are known."""
    inside = (times >= grid[0]) & (times <= grid[-1])
    return np.asarray(inside & np.isfinite(np.interp(times, grid, values)))


def correlate(grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series) -> float:
    """The cosine between course rate and gyros' rate, with or without their means, whichever is larger."""
    inside = seen_by(grid, yaw_rate, times) & (weights > 0.0)
    if np.count_nonzero(inside) < FEWEST:
        return float("nan")
    rate = np.interp(times[inside], grid, yaw_rate)
    course = course_rate[inside]
    # less their means too: a gyro's bias would drown the turns of a unit that is not calibrated
    found = [_cosine(rate, course), _cosine(rate - rate.mean(), course - course.mean())]
    return max(found, key=abs)


def _cosine(one: Series, other: Series) -> float:
    return float((one @ other) / np.sqrt((one @ one) * (other @ other) + 1e-30))
