"""How an IMU's clock stands to that of satellite positions: found from the motion that both saw.

The rate of a track's course is compared with that of the gyros about the vertical, both averaged over a second.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector, Vectors, inverted
from tumble.errors import RecordingError
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples
from tumble.records import dataclass

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


# A course leads the body's heading by the time in which the vehicle covers the way from the axle that does not
# steer to the antenna; of that way nothing is known but its size, m.
_ANTENNA_TO_AXLE = 1.5
# More stretches than this (two days) are not transformed at once.
_MOST_STRETCHES = 1 << 22
# Clocks that were meant to be one are apart by less, s: leap seconds and delays.
_SYNCHRONISED = 30.0
# Least correlation at any other offset, by the motion seen there up to so many seconds: in less, turns of another
# drive fit by chance, at 0.99 in 42 s and 0.96 in 80 s, where those of the same one fit at 0.998.
_LEAST = ((60.0, 0.995), (120.0, 0.98), (300.0, 0.95), (np.inf, 0.85))
# And of motion with many turns: by chance, to this probability, one that has as many independent parts.
_CHANCE = 5e-5
# s of motion that may be too little whatever it is of.
_SHORT = 120.0
# s by which least squares may move what the correlation found.
_FURTHEST = 5.0
# s by which stamps overlap where they are compared as they are.
_LEAST_OVERLAP = 20.0


@dataclass(frozen=True)
class TimeAlignment:
    """The offset between two clocks.

    Attributes
    ----------
    offset : s, to be added to the track's times to have them on the IMU's clock.
    sigma : its standard uncertainty, s.
    correlation : of the course's rate with the gyros' rate about the vertical, at that offset; 1 at best.
    second_best : highest correlation further than five seconds from it; near the first, the offset is a guess.
    seconds : of motion that both saw and that was compared.
    note : what else was done, appended to the sentence.
    moved : s, by how much a filter moved the offset that the course determines.
    """

    offset: float
    sigma: float
    correlation: float
    second_best: float
    seconds: float
    note: str = ""
    moved: float = 0.0

    def __str__(self) -> str:
        """One sentence for the user."""
        return (
            f"GNSS times {self.offset:+.3f} s are the IMU's (standard uncertainty {self.sigma:.3f} s), found from "
            f"{self.seconds:.0f} s of motion: course rate and gyro correlate at {self.correlation:.3f}{self.note}."
        )


def estimate_time_offset(samples: InertialSamples, track: GnssTrack) -> TimeAlignment:
    """Return the offset between the clocks of an IMU and of satellite positions.

    The rate of the course is compared with the gyros' rate about the vertical, which the accelerometers
    tell, both averaged over a second; no mounting angle is needed. The sharpest correlation over all offsets
    is found first, then its place by least squares. The course of an antenna ahead of the rear axle leads the
    heading, by 0.1 s for each metre at 10 m/s: that is in the uncertainty, and only the filter's
    innovations (`prepare_drive`) take it out.

    Parameters
    ----------
    samples : in SI.
    track : with velocities, or positions close enough to make them.

    Raises
    ------
    RecordingError
        If the track does not move fast enough to have a course, or nothing correlates.
    """
    grid, yaw_rate = rate_about_down(samples)
    times, course_rate, weights = find_course_rate(track)
    lags = _lags(grid, times)
    curve = _correlation_curve(grid, yaw_rate, times, course_rate, weights, lags)
    best, second = _best_lag(curve, lags)
    # an offset that the stamps themselves nearly have is no chance
    near, other = _best_lag(np.where(np.abs(lags) < _SYNCHRONISED, curve, np.nan), lags)
    if near >= 0 and curve[near] > 0.8 and _alike(float(curve[best]), float(curve[near])):
        best, second = near, other
    inside = seen_by(grid, yaw_rate, times + lags[max(best, 0)]) & (weights > 0.0)
    seconds = float(np.count_nonzero(inside)) * track.interval
    free = best != near
    least = next(value for until, value in _LEAST if seconds <= until)
    least = min(least, _least_by_chance(course_rate[inside]))
    if best < 0 or curve[best] < (least if free else 0.5) or (free and _alike(float(curve[best]), second)):
        raise _no_match(samples, track, weights, float(curve[best]) if best >= 0 else 0.0, second)
    offset, sigma = _refined(grid, yaw_rate, times, course_rate, weights, float(lags[best]))
    if not np.isfinite(sigma):
        raise _no_match(samples, track, weights, float(curve[best]), second)
    at_best = correlate(grid, yaw_rate, times + offset, course_rate, weights)
    speed: Series = np.sqrt(np.nansum(track_velocities(track)[:, :2] ** 2, axis=1))
    lead = _ANTENNA_TO_AXLE / float(np.mean(speed[speed > slowest_course(track)]))
    return TimeAlignment(offset, float(np.hypot(sigma, lead)), float(at_best), second, seconds)


def _least_by_chance(course_rate: Series) -> float:
    """The correlation that a motion with as many independent parts of its spectrum has with another one by chance."""
    if len(course_rate) <= 2:
        return float(np.sqrt(1.0 - _CHANCE**2))
    power = np.abs(np.fft.rfft(course_rate - course_rate.mean())[1:]) ** 2
    parts = float(np.sum(power) ** 2 / (np.sum(power**2) + 1e-300))
    return float(np.sqrt(1.0 - _CHANCE ** (2.0 / max(parts, 1.0))))


def _no_match(
    samples: InertialSamples, track: GnssTrack, weights: Series, best: float, second: float
) -> RecordingError:
    """What is wrong where no offset fits: too little motion for any, or another drive."""
    moved = float(np.count_nonzero(weights)) * track.interval
    spans = spans_in_words(samples, track)
    if moved < _SHORT:
        return RecordingError(
            f"{moved:.0f} s of motion are too little to find the offset between the clocks. Course "
            f"and gyros correlate at {best:.2f} at best and at {second:.2f} at other offsets, as they "
            f"may by chance. {spans}: take a longer part of the drive, with turns. Check "
            "that the files belong together."
        )
    return RecordingError(
        "IMU and GNSS do not seem to have seen the same motion. At no offset between their clocks "
        f"does the course's rate fit the gyros alone (correlation {best:.2f} at best, {second:.2f} at "
        f"others). {spans}: check that the files belong together, the units of the gyros, and that "
        "the vehicle turned."
    )


def spans_in_words(samples: InertialSamples, track: GnssTrack) -> str:
    """Return where both begin and end, in words, and whether they overlap as they are stamped.

    Parameters
    ----------
    samples, track : on their own clocks.
    """
    first, last = float(track.time[0]), float(track.time[-1])
    begin, end = float(samples.time[0]), float(samples.time[-1])
    both = f"The IMU's samples run from {begin:.1f} to {end:.1f} s and the fixes from {first:.1f} to {last:.1f} s"
    apart = max(first - end, begin - last)
    return f"{both}, {apart:.0f} s apart" if apart > 0.0 else both


def _lags(grid: Series, times: Series) -> Series:
    """Offsets that let both overlap by half of the shorter one."""
    half = 0.5 * min(grid[-1] - grid[0], times[-1] - times[0])
    first, last = grid[0] + half - times[-1], grid[-1] - half - times[0]
    # as they are stamped, they may overlap by less
    widest = grid[0] + _LEAST_OVERLAP - times[-1], grid[-1] - _LEAST_OVERLAP - times[0]
    if widest[0] < 0.0 < widest[1]:
        first = min(first, max(-_SYNCHRONISED, float(widest[0])))
        last = max(last, min(_SYNCHRONISED, float(widest[1])))
    return np.arange(first, last + STEP, STEP)


def _correlation_curve(
    grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series, lags: Series
) -> Series:
    """`_correlation` at every lag; NaN where fewer than ten times fall on the grid.

    Lags are as far apart as the grid's points, so that each time moves from one stretch of the grid to the next and
    stays at the same share of it: every sum over the times is a correlation of two series, made by Fourier transforms.
    """
    seen = weights > 0.0
    at = (times[seen] + lags[0] - grid[0]) / STEP
    stretch = np.floor(at).astype(np.int64)
    share, course = at - stretch, course_rate[seen]
    if not len(at) or np.ptp(stretch) + len(grid) > _MOST_STRETCHES:
        return np.array([correlate(grid, yaw_rate, times + lag, course_rate, weights) for lag in lags])
    sums = _SumsOverTimes(stretch, len(grid) - 1, len(lags))
    known = np.isfinite(yaw_rate[:-1]) & np.isfinite(yaw_rate[1:])
    one = known.astype(np.float64)
    first, last = np.where(known, yaw_rate[:-1], 0.0), np.where(known, yaw_rate[1:], 0.0)
    count = np.round(sums.of((one, np.ones(len(at)))))
    rate = sums.of((first, 1.0 - share), (last, share))
    turn, turn_square = sums.of((one, course)), sums.of((one, course**2))
    both = sums.of((first, course * (1.0 - share)), (last, course * share))
    square = sums.of(
        (first**2, (1.0 - share) ** 2), (first * last, 2.0 * share * (1.0 - share)), (last**2, share**2)
    )
    number = np.maximum(count, 1.0)
    plain = both / np.sqrt(np.maximum(square * turn_square, 0.0) + 1e-30)
    left = (square - rate**2 / number) * (turn_square - turn**2 / number)
    centred = (both - rate * turn / number) / np.sqrt(np.maximum(left, 0.0) + 1e-30)
    found = np.where(np.abs(centred) > np.abs(plain), centred, plain)
    return np.asarray(np.where(count >= FEWEST, found, np.nan))


def _best_lag(curve: Series, lags: Series) -> tuple[int, float]:
    """The index of the highest correlation, or -1, and the highest one further than five seconds from it."""
    if not np.isfinite(curve).any():
        return -1, 0.0
    best = int(np.nanargmax(curve))
    apart = curve[np.abs(lags - lags[best]) > 5.0]
    return best, float(np.nanmax(apart)) if np.isfinite(apart).any() else 0.0


def _alike(best: float, other: float) -> bool:
    """Whether two correlations leave about as much unexplained: then neither is found by more than chance."""
    return 1.0 - best**2 > 0.5 * (1.0 - other**2)


class _SumsOverTimes:
    """Sums over times of a grid's stretches, each times a factor of the time, at every lag."""

    def __init__(self, stretch: np.ndarray, stretches: int, lags: int) -> None:
        self._lowest = int(stretch.min())
        self._place = stretch - self._lowest
        self._size = int(self._place.max()) + 1 + stretches
        self._length = 1 << (self._size - 1).bit_length()
        shift = self._lowest + np.arange(lags)
        self._known = (shift > -self._size + stretches) & (shift < stretches)
        self._shift = shift % self._length

    def of(self, *products: tuple[Series, Series]) -> Series:
        """Return (lags,) the sum of the products of the stretches' values and the times' factors."""
        total = np.zeros(self._length // 2 + 1, dtype=np.complex128)
        for values, factors in products:
            train = np.bincount(self._place, factors, self._size)
            total += np.fft.rfft(values, self._length) * np.conj(np.fft.rfft(train, self._length))
        return np.asarray(np.where(self._known, np.fft.irfft(total, self._length)[self._shift], 0.0))


def _refined(
    grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series, start: float
) -> tuple[float, float]:
    """Offset and its standard uncertainty by least squares, with a constant bias of the gyro beside it.

    The uncertainty is infinite where it does not stay near its start.

    Stretches overlap and their residuals go together: they count as one a window, not as many as there are.
    """
    slope = np.gradient(yaw_rate, STEP)
    offset, sigma = start, np.inf
    for _ in range(20):
        at = times + offset
        inside = seen_by(grid, slope, at) & (weights > 0.0)
        if np.count_nonzero(inside) < FEWEST or abs(offset - start) > _FURTHEST:
            return start, np.inf
        design = np.column_stack([np.interp(at[inside], grid, slope), np.ones(inside.sum())])
        left = course_rate[inside] - np.interp(at[inside], grid, yaw_rate)
        # a turn on the spot or a course that flips is no motion of a vehicle
        spread = 1.4826 * np.median(np.abs(left - np.median(left))) + 1e-12
        trusted = np.minimum(1.0, 3.0 * spread / np.maximum(np.abs(left), 1e-12))
        normal = (design * trusted[:, None]).T @ design
        cofactor = inverted(np.asarray(normal, dtype=np.float64))
        step = float((cofactor @ (design.T @ (trusted * left)))[0])
        offset += step
        variance = float((trusted * left**2).sum() / max(trusted.sum() - 2.0, 1.0))
        overlap = max(1.0, WINDOW / max(float(np.median(np.diff(times))), 1e-3))
        sigma = float(np.sqrt(variance * overlap * cofactor[0, 0]))
        if abs(step) < 1e-5:
            break
    return offset, sigma
