"""What a drive shows of wrong units, swapped axes, clocks that count leap seconds otherwise, and missing samples."""

from __future__ import annotations

import numpy as np

from tumble.errors import RecordingError
from tumble.navigation.alignment import find_rest
from tumble.navigation.axis_agreement import course_rate_slope
from tumble.navigation.course import track_velocities
from tumble.navigation.gnss.time_scales import UNIX_TO_GPS, WEEK, date_of_seconds, leap_seconds
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.mechanisation import navigate
from tumble.navigation.samples import InertialSamples
from tumble.navigation.time_alignment import best_correlation, estimate_time_offset, spans_in_words
from tumble.navigation.trajectory import NavigationState

# A gyro's scale is off by no more in any unit that works: beyond, the unit is another.
_LARGEST_SLOPE = 1.3
# An axis that is named leaves less of the course unexplained than this share of what the vertical one does.
_CLEARLY = 0.25
# A mirror image that fits no better than this is none: gyros with wrong signs make one of 0.5.
_MIRRORED = 0.7
# Clocks may be apart by this beside the leap seconds, s.
_BESIDE = 1.5
# Local times are apart by quarters of an hour, s.
_ZONE = 900.0
# A clock that counts from its own start does not reach this (three years), s.
_DATED = 1e8


def refuse_wrong_scale(samples: InertialSamples, track: GnssTrack) -> None:
    """Refuse gyros whose rate is not the course's: the unit is another.

    Parameters
    ----------
    samples : as they are taken to be in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If the rates differ by more than any working gyro's scale.
    """
    slope = course_rate_slope(samples, track)
    if 1.0 / _LARGEST_SLOPE < slope < _LARGEST_SLOPE:
        return
    guess = ""
    for factor, words in (
        (np.degrees(1.0), "rad/s were read as deg/s"),
        (np.radians(1.0), "deg/s were read as rad/s"),
    ):
        if 1.0 / _LARGEST_SLOPE < slope / factor < _LARGEST_SLOPE:
            guess = f", as if {words}"
    vertical = int(np.argmax(np.abs(samples.specific_force_b.mean(axis=0))))
    for axis in range(3):
        level = np.zeros((len(samples), 3))
        level[:, axis] = 1.0
        turned = InertialSamples(samples.time, level, samples.angular_rate_ib_b, samples.means)
        if (
            not guess
            and axis != vertical
            and 1.0 / _LARGEST_SLOPE < course_rate_slope(turned, track, either=True) < _LARGEST_SLOPE
        ):
            raise RecordingError(
                f"The course goes with gyro {'xyz'[axis]}, but gravity lies along {'xyz'[vertical]}: axes of one triad "
                "are swapped. Check which column is which."
            )
    if not guess:
        raise RecordingError(
            f"The course turns {slope:.3g} times as fast as the gyros say, and rad/s taken for deg/s "
            "do not explain it. Signs or axes of the gyros are wrong, their unit is another, the "
            "clocks are apart, or the files do not belong together. Check the columns with `tumble "
            "inspect`."
        )
    raise RecordingError(
        f"The course turns {slope:.3g} times as fast as the gyros say{guess}: the unit of the angular rates is "
        "another. Say it with --units."
    )


# After the rest, what is compared.
_LOOKED_AT = 90.0  # s


def refuse_mirrored(samples: InertialSamples, track: GnssTrack) -> None:
    """Refuse accelerometers whose level axes are swapped, or one of them reversed.

    Freely navigated changes of velocity must be the track's, turned by one angle. With swapped axes they are the
    track's mirror image, which no heading mends.

    Parameters
    ----------
    samples : in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If the mirror image fits clearly better.
    """
    first, last = find_rest(samples, track)
    begin = max(first, float(samples.time[0]))
    still = samples.between(begin, max(last, begin + 0.5))
    force = still.specific_force_b.mean(axis=0)
    down = -force / np.sqrt(force @ force)
    row = int(np.argmin(np.abs(track.time - begin)))
    velocity = track_velocities(track)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = (track.time > last) & (np.nan_to_num(speed) > 1.0)
    if not moving.any():
        return
    onset = float(track.time[np.argmax(moving)])
    until = min(
        [gap[0] for gap in samples.missing() if gap[0] >= last], default=float(samples.time[-1]) - 1e-3
    )
    chosen = (track.time >= onset - 2.0) & (track.time <= min(onset + _LOOKED_AT, until))
    chosen &= np.isfinite(speed)
    if chosen.sum() < 10:
        return
    bias = still.angular_rate_ib_b.mean(axis=0)
    part = samples.between(last, float(track.time[chosen][-1]) + 1e-4)
    clean = InertialSamples(part.time, part.specific_force_b, part.angular_rate_ib_b - bias, part.means)
    state = NavigationState(
        float(part.time[0]),
        float(track.latitude[row]),
        float(track.longitude[row]),
        float(track.height[row]),
        np.zeros(3),
        _level_attitude(down),
    )
    run = navigate(clean, state)
    time = track.time[chosen]
    apart = max(1, round(1.0 / max(track.interval, 1e-3)))
    free = np.interp(time, run.time, run.velocity_n[:, 0]) + 1j * np.interp(
        time, run.time, run.velocity_n[:, 1]
    )
    seen = velocity[chosen, 0] + 1j * velocity[chosen, 1]
    usual = time[apart:] - time[:-apart] < 1.5 * apart * track.interval
    free, seen = (free[apart:] - free[:-apart])[usual], (seen[apart:] - seen[:-apart])[usual]
    # an error of the level is a constant acceleration in n
    free, seen = free - free.mean(), seen - seen.mean()
    norm = float(np.sqrt(np.sum(np.abs(free) ** 2) * np.sum(np.abs(seen) ** 2))) + 1e-300
    straight = float(np.abs(np.sum(np.conj(free) * seen))) / norm
    mirrored = float(np.abs(np.sum(free * seen))) / norm
    # the course turns against the gyros' heading in the mirror, so that it fits in straight stretches only
    if straight < 0.6 and mirrored > max(_MIRRORED, straight + 0.15):
        raise RecordingError(
            f"The accelerations are the course's mirror image (fit {mirrored:.2f}, as they are {straight:.2f}): "
            "two level axes of the accelerometers are swapped, or one is reversed. Check which column is which."
        )
    if straight < 0.4:
        raise RecordingError(
            f"The accelerations do not fit the course (fit {straight:.2f} of 1): an axis, a sign or the unit of "
            "accelerometers or gyros is another, or the clocks are apart. Check the columns with `tumble inspect`."
        )


def why_no_agreement(samples: InertialSamples, track: GnssTrack) -> str:
    """Return why gyros and course do not agree, where an axis that is not vertical does with the course; or "".

    An axis is named only where it fits clearly better than the vertical one does at any offset: turns leak into
    axes that are not quite level, and in little motion everything fits something.

    Parameters
    ----------
    samples : taken to be in SI.
    track : on its own clock.
    """
    down = -samples.specific_force_b.mean(axis=0)
    vertical = int(np.argmax(np.abs(down)))
    best, which = 0.8, -1
    for axis in range(3):
        for sign in (1.0, -1.0):
            if axis == vertical and sign == np.sign(down[vertical]):
                continue
            try:
                found = estimate_time_offset(_about(samples, axis, sign), track)
            except RecordingError:
                continue
            if found.correlation > best:
                best, which = found.correlation, axis
    if which < 0:
        return ""
    own = max(best_correlation(_about(samples, vertical, float(np.sign(down[vertical]))), track), 0.0)
    if 1.0 - best**2 > _CLEARLY * (1.0 - own**2):
        return ""
    if which == vertical:
        return (
            f"The gyros turn against the course (correlation {-best:.2f}): their signs, or those of the "
            "accelerometers, are reversed. Check the body axes; they must be right-handed for both triads."
        )
    return (
        f"The course goes with gyro {'xyz'[which]} (correlation {best:.2f}), but gravity lies along "
        f"{'xyz'[vertical]}: axes of one triad are swapped. Check which column is which."
    )


def _about(samples: InertialSamples, axis: int, sign: float) -> InertialSamples:
    """The samples as if down were along an axis of the body."""
    level = np.zeros((len(samples), 3))
    level[:, axis] = -sign
    return InertialSamples(samples.time, level, samples.angular_rate_ib_b, samples.means)


def about_clocks(offset: float, sigma: float, track: GnssTrack, samples: InertialSamples) -> str:
    """Return a sentence on clocks that are apart, with both time spans and what the offset looks like, or "".

    Parameters
    ----------
    offset, sigma : s to add to the track's times, and its standard uncertainty.
    track : on its own clock, before the offset.
    samples : on the IMU's clock.
    """
    dated = [float(time[0]) > _DATED for time in (samples.time, track.time)]
    if abs(offset) < 1.0 or dated[0] != dated[1]:
        # a clock that counts from its own start may be apart by anything
        return ""
    why = _why_apart(offset, sigma, float(track.time[0])) if dated[0] else ""
    looks = f": {why}" if why else ""
    return f"{spans_in_words(samples, track)}; the clocks are {abs(offset):.2f} s apart{looks}."


def _why_apart(offset: float, sigma: float, at: float) -> str:
    """What an offset between absolute clocks looks like; `at` is the track's GPS time."""
    leap, when = leap_seconds(at), date_of_seconds(at)[:16]
    allowed = min(max(_BESIDE, 4.0 * sigma), 0.4 * leap)
    seconds = f"the {leap} leap seconds between GPS time and UTC at {when}"
    if abs(offset - UNIX_TO_GPS) < allowed:
        return f"the IMU's clock counts seconds since 1970 in GPS time, {leap} leap seconds ahead of UTC at {when}"
    if abs(offset - UNIX_TO_GPS + leap) < allowed:
        return "the IMU's clock counts seconds since 1970 (UTC), and the positions have GPS time"
    weeks = round(offset / WEEK)
    beside = offset - weeks * WEEK
    words = [
        f"{abs(weeks)} whole week{'s' if abs(weeks) != 1 else ''}, as of a clock that begins its weeks anew"
    ]
    words = words if weeks else []
    hours = round(beside / _ZONE) * _ZONE / 3600.0
    for away in (0.0, hours):
        left = beside - 3600.0 * away
        if abs(abs(left) - leap) > allowed and abs(left) > allowed:
            continue
        if away:
            words.append(
                f"{abs(away):g} h, as of local time (the IMU's clock is {'ahead' if away > 0.0 else 'behind'})"
            )
        if abs(left) > allowed:
            which = "the IMU's" if left < 0.0 else "the satellite positions'"
            words.append(seconds if away else f"{seconds} ({which} clock is UTC)")
        return "that is " + ", and ".join(words) if words else ""
    return (
        "that is neither leap seconds, nor a time zone, nor whole weeks, so one of the clocks was not set; make sure "
        "that the files are of one drive"
    )


def refuse_no_overlap(samples: InertialSamples, track: GnssTrack, offset: float) -> None:
    """Refuse files of which, with a given offset, less than ten seconds overlap.

    Parameters
    ----------
    samples : on the IMU's clock.
    track : on its own clock.
    offset : s to add to the track's times.

    Raises
    ------
    RecordingError
        If they overlap by less.
    """
    first, last = float(track.time[0]) + offset, float(track.time[-1]) + offset
    overlap = min(last, float(samples.time[-1])) - max(first, float(samples.time[0]))
    if overlap < 10.0:
        spans = spans_in_words(samples, track, offset)
        raise RecordingError(
            f"IMU and GNSS do not overlap in time with --gnss-time {offset:g}: {spans[:1].lower()}{spans[1:]}. "
            "Leave --gnss-time out to have the offset found, or check that the files belong together."
        )


def _level_attitude(down: np.ndarray) -> np.ndarray:
    """C_nb with its first level axis anywhere."""
    helper = np.eye(3)[int(np.argmin(np.abs(down)))]
    north = helper - down * float(down @ helper)
    north /= np.sqrt(north @ north)
    return np.vstack([north, np.cross(down, north), down])
