"""How an IMU's clock stands to that of satellite positions: found from the motion that both saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Vector, Vectors, inverted
from tumble.errors import RecordingError
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples

# Below this speed a course is noise.
_SLOWEST = 1.5
_STEP = 0.05
# A course leads the body's heading by the time in which the vehicle covers the way from the axle that does not
# steer to the antenna; of that way nothing is known but its size, m.
_ANTENNA_TO_AXLE = 1.5
# Motion that is compared is averaged over this, s, on both sides.
_WINDOW = 1.0
# Fewer times than this make no correlation; more stretches than this (two days) are not transformed at once.
_FEWEST, _MOST_STRETCHES = 10, 1 << 22
# Clocks that were meant to be one are apart by less, s: leap seconds and delays.
_SYNCHRONISED = 30.0
# Least correlation at any other offset, where a few turns fit by chance; of more motion than this, s, less will do.
_LEAST, _LEAST_LONG, _LONG = 0.95, 0.85, 300.0
# s by which stamps overlap where they are compared as they are.
_LEAST_OVERLAP = 20.0


@dataclass(frozen=True, slots=True)
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
    moved : s, by how much a filter moved the offset that the course tells.
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


@dataclass(frozen=True, slots=True)
class AxisAgreement:
    """How the course's rate goes with each axis of the IMU, at the offset found.

    Attributes
    ----------
    correlations : (3,) with the gyro about each body axis.
    about_vertical : with the gyros' rate about down, as the accelerometers have it; near +1 when all is well.
    down_b : (3,) unit vector of down in the body, from the mean specific force.
    problem : what is wrong in a sentence, or "".
    """

    correlations: Vector
    about_vertical: float
    down_b: Vector
    problem: str


def estimate_time_offset(
    samples: InertialSamples, track: GnssTrack, *, around: float | None = None, reach: float | None = None
) -> TimeAlignment:
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
    around, reach : s; search only offsets within `reach` of `around`. None for all that let both overlap by
        half of the shorter one.

    Raises
    ------
    RecordingError
        If the track does not move fast enough to have a course, or nothing correlates.
    """
    grid, yaw_rate = _yaw_rate(samples)
    times, course_rate, weights = _course_rate(track)
    lags = _lags(grid, times, around, reach)
    curve = _correlation_curve(grid, yaw_rate, times, course_rate, weights, lags)
    best, second = _best_lag(curve, lags)
    # an offset that the stamps themselves nearly have is no chance
    near, other = _best_lag(np.where(np.abs(lags) < _SYNCHRONISED, curve, np.nan), lags)
    if near >= 0 and curve[near] > 0.8 and _alike(float(curve[best]), float(curve[near])):
        best, second = near, other
    seconds = float(np.count_nonzero(weights)) * track.interval
    free = around is None and best != near
    least = _LEAST_LONG if seconds > _LONG else _LEAST
    if best < 0 or curve[best] < (least if free else 0.5) or (free and _alike(float(curve[best]), second)):
        raise RecordingError(
            "IMU and GNSS do not seem to have seen the same motion: at no offset between their clocks does the "
            f"course's rate fit the gyros alone (correlation {curve[best] if best >= 0 else 0.0:.2f} at best, "
            f"{second:.2f} at others). {spans_in_words(samples, track)}: check that the files belong together, the "
            "units of the gyros, and that the vehicle turned; or give the offset."
        )
    offset, sigma = _refined(grid, yaw_rate, times, course_rate, weights, float(lags[best]))
    at_best = _correlation(grid, yaw_rate, times + offset, course_rate, weights)
    speed: Series = np.sqrt(np.nansum(track_velocities(track)[:, :2] ** 2, axis=1))
    lead = _ANTENNA_TO_AXLE / float(np.mean(speed[speed > _SLOWEST]))
    return TimeAlignment(offset, float(np.hypot(sigma, lead)), float(at_best), second, seconds)


def spans_in_words(samples: InertialSamples, track: GnssTrack, offset: float = 0.0) -> str:
    """Return where both begin and end, in words, and whether they overlap as they are stamped.

    Parameters
    ----------
    samples, track : on their own clocks.
    offset : s that is added to the track's times.
    """
    first, last = float(track.time[0]) + offset, float(track.time[-1]) + offset
    begin, end = float(samples.time[0]), float(samples.time[-1])
    both = f"The IMU's samples run from {begin:.1f} to {end:.1f} s and the fixes from {first:.1f} to {last:.1f} s"
    apart = max(first - end, begin - last)
    return f"{both}, {apart:.0f} s apart" if apart > 0.0 else both


def check_axes(samples: InertialSamples, track: GnssTrack) -> AxisAgreement:
    """Compare a track's course with each axis of the IMU, to find swapped or reversed axes.

    Parameters
    ----------
    samples : in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If the track does not move fast enough to have a course.
    """
    times, course_rate, weights = _course_rate(track)
    down = _down_b(samples)
    signals = [*samples.angular_rate_ib_b.T, samples.angular_rate_ib_b @ down]
    found: list[float] = []
    for signal in signals:
        grid, rate = _averaged(samples, signal)
        found.append(_correlation(grid, rate, times, course_rate, weights))
    correlations, about = np.array(found[:3]), float(found[3])
    return AxisAgreement(correlations, about, down, _axis_problem(correlations, about, down))


def course_rate_slope(samples: InertialSamples, track: GnssTrack, *, either: bool = False) -> float:
    """Return by how much the course turns faster than the gyros say about the vertical: 1 with the right unit.

    Parameters
    ----------
    samples : taken to be in SI.
    track : on the IMU's clock.
    either : whether the gyros may also turn against the course.

    Raises
    ------
    RecordingError
        If the track does not move fast enough to have a course, or the gyros do not turn at all.
    """
    times, course_rate, weights = _course_rate(track)
    grid, yaw_rate = _yaw_rate(samples)
    inside = _seen_by(grid, yaw_rate, times) & (weights > 0.0)
    seen = np.interp(times[inside], grid, yaw_rate)
    seen = seen - seen.mean()
    turned = course_rate[inside] - course_rate[inside].mean()
    strength, other = float(seen @ turned), float(seen @ seen)
    strength = abs(strength) if either else strength
    if not other > 0.0 or not strength > 0.0:
        raise RecordingError(
            "The gyros do not turn with the course at all: check that the files belong together."
        )
    return strength / other


def _axis_problem(correlations: Vector, about: float, down: Vector) -> str:
    if about > 0.8:
        return ""
    axis = int(np.argmax(np.abs(correlations)))
    vertical = int(np.argmax(np.abs(down)))
    best, seen = "xyz"[axis], correlations[axis]
    if abs(seen) > max(0.8, abs(about) + 0.01) and axis != vertical:
        return (
            f"The course goes with gyro {best} (correlation {seen:.2f}), but gravity lies along {'xyz'[vertical]}: "
            "axes of one triad are swapped. Check which column is which."
        )
    if about < -0.8:
        return (
            f"The gyros turn against the course (correlation {about:.2f}): their signs, or those of the "
            "accelerometers, are reversed. Check the body axes; they must be right-handed for both triads."
        )
    return (
        f"No gyro axis goes with the course (best is {best} with a correlation of {seen:.2f}): the clocks are apart, "
        "the positions scatter too much to have a course, or the files do not belong together."
    )


def _down_b(samples: InertialSamples) -> Vector:
    """Down in b: against the mean specific force, as a vehicle that stays upright has it."""
    mean = np.mean(samples.specific_force_b[1:], axis=0)
    return -mean / float(np.sqrt(mean @ mean))


def _yaw_rate(samples: InertialSamples) -> tuple[Series, Series]:
    return _averaged(samples, samples.angular_rate_ib_b @ _down_b(samples))


def _averaged(samples: InertialSamples, signal: Series) -> tuple[Series, Series]:
    """A signal's running mean over the window, on an even grid; NaN where samples are missing in it."""
    time = samples.time
    total = np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]) * np.diff(time))])
    grid = np.arange(time[0] + 0.5 * _WINDOW, time[-1] - 0.5 * _WINDOW, _STEP)
    ends = (np.interp(grid + half, time, total) for half in (0.5 * _WINDOW, -0.5 * _WINDOW))
    last, first = ends
    mean = (last - first) / _WINDOW
    for begin, end in samples.missing():
        mean[(grid + 0.5 * _WINDOW > begin) & (grid - 0.5 * _WINDOW < end)] = np.nan
    return grid, mean


def _course_rate(track: GnssTrack) -> tuple[Series, Series, Series]:
    """Middle, rate of the course and weight of each stretch of about a window of a track."""
    velocity = track_velocities(track)
    good = np.isfinite(velocity).all(axis=1)
    time, velocity = track.time[good], velocity[good]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    if np.count_nonzero(speed > _SLOWEST) < 10:
        raise RecordingError(
            f"The track {track.name} moves faster than {_SLOWEST:g} m/s at {np.count_nonzero(speed > _SLOWEST)} "
            "fixes only, and a course takes speed: the clocks cannot be compared by it."
        )
    steps = max(1, round(_WINDOW / max(track.interval, 1e-3)))
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    span = time[steps:] - time[:-steps]
    turn = np.remainder(course[steps:] - course[:-steps] + np.pi, 2.0 * np.pi) - np.pi
    slowest = np.array([speed[i : i + steps + 1].min() for i in range(len(span))])
    weights = ((slowest > _SLOWEST) & (span < 1.5 * max(_WINDOW, track.interval))).astype(float)
    return 0.5 * (time[steps:] + time[:-steps]), turn / span, weights


def track_velocities(track: GnssTrack) -> Vectors:
    """Velocities of the track, or differences of its positions where it has none."""
    if track.has_velocity.sum() > 10:
        return track.velocity_n
    from tumble.navigation.trajectory import position_differences

    def cut(rows: slice) -> tuple[Series, Series, Series]:
        return track.latitude[rows], track.longitude[rows], track.height[rows]

    moved = position_differences(cut(slice(2, None)), cut(slice(None, -2)))
    velocity = np.full((len(track), 3), np.nan)
    velocity[1:-1] = moved / (track.time[2:] - track.time[:-2])[:, None]
    return velocity


def _lags(grid: Series, times: Series, around: float | None, reach: float | None) -> Series:
    if around is not None:
        extent = 10.0 if reach is None else reach
        return np.arange(around - extent, around + extent + _STEP, _STEP)
    half = 0.5 * min(grid[-1] - grid[0], times[-1] - times[0])
    first, last = grid[0] + half - times[-1], grid[-1] - half - times[0]
    # as they are stamped, they may overlap by less
    widest = grid[0] + _LEAST_OVERLAP - times[-1], grid[-1] - _LEAST_OVERLAP - times[0]
    if widest[0] < 0.0 < widest[1]:
        first = min(first, max(-_SYNCHRONISED, float(widest[0])))
        last = max(last, min(_SYNCHRONISED, float(widest[1])))
    return np.arange(first, last + _STEP, _STEP)


def _correlation_curve(
    grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series, lags: Series
) -> Series:
    """`_correlation` at every lag; NaN where fewer than ten times fall on the grid.

    Lags are as far apart as the grid's points, so that each time moves from one stretch of the grid to the next and
    stays at the same share of it: every sum over the times is a correlation of two series, made by Fourier transforms.
    """
    seen = weights > 0.0
    at = (times[seen] + lags[0] - grid[0]) / _STEP
    stretch = np.floor(at).astype(np.int64)
    share, course = at - stretch, course_rate[seen]
    if not len(at) or np.ptp(stretch) + len(grid) > _MOST_STRETCHES:
        return np.array([_correlation(grid, yaw_rate, times + lag, course_rate, weights) for lag in lags])
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
    return np.asarray(np.where(count >= _FEWEST, found, np.nan))


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


def _seen_by(grid: Series, values: Series, times: Series) -> np.ndarray:
    """Which times lie on a grid where its values are known."""
    inside = (times >= grid[0]) & (times <= grid[-1])
    return np.asarray(inside & np.isfinite(np.interp(times, grid, values)))


def _correlation(
    grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series
) -> float:
    inside = _seen_by(grid, yaw_rate, times) & (weights > 0.0)
    if np.count_nonzero(inside) < _FEWEST:
        return float("nan")
    rate = np.interp(times[inside], grid, yaw_rate)
    course = course_rate[inside]
    # less their means too: a gyro's bias would drown the turns of a unit that is not calibrated
    found = [_cosine(rate, course), _cosine(rate - rate.mean(), course - course.mean())]
    return max(found, key=abs)


def _cosine(one: Series, other: Series) -> float:
    return float((one @ other) / np.sqrt((one @ one) * (other @ other) + 1e-30))


def _refined(
    grid: Series, yaw_rate: Series, times: Series, course_rate: Series, weights: Series, start: float
) -> tuple[float, float]:
    """Offset and its standard uncertainty by least squares, with a constant bias of the gyro beside it.

    Stretches overlap and their residuals go together: they count as one a window, not as many as there are.
    """
    slope = np.gradient(yaw_rate, _STEP)
    offset, sigma = start, np.inf
    for _ in range(20):
        at = times + offset
        inside = _seen_by(grid, slope, at) & (weights > 0.0)
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
        overlap = max(1.0, _WINDOW / max(float(np.median(np.diff(times))), 1e-3))
        sigma = float(np.sqrt(variance * overlap * cofactor[0, 0]))
        if abs(step) < 1e-5:
            break
    return offset, sigma


__all__ = [
    "AxisAgreement",
    "TimeAlignment",
    "check_axes",
    "course_rate_slope",
    "estimate_time_offset",
    "spans_in_words",
    "track_velocities",
]
