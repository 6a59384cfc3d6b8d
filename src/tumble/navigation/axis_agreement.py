"""How a track's course goes with each axis of the IMU: swapped and reversed axes, and gyros of another unit."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector
from tumble.errors import RecordingError
from tumble.navigation.course import (
    averaged,
    correlate,
    find_course_rate,
    find_down,
    rate_about_down,
    seen_by,
)
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples
from tumble.records import dataclass

# Correlation of course and gyros about down from which on axes are right.
_AGREES = 0.8
# Less motion, s, and fewer turns in all, rad, tell nothing of axes.
_SHORT, _FEW_TURNS = 20.0, 1.0


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
    times, course_rate, weights = find_course_rate(track)
    down = find_down(samples)
    signals = [*samples.angular_rate_ib_b.T, samples.angular_rate_ib_b @ down]
    found: list[float] = []
    for signal in signals:
        grid, rate = averaged(samples, signal)
        found.append(correlate(grid, rate, times, course_rate, weights))
    correlations, about = np.array(found[:3]), float(found[3])
    problem = ""
    if not about > _AGREES:
        seen = course_rate[seen_by(*rate_about_down(samples), times) & (weights > 0.0)]
        problem = _too_little(seen, track.interval) or _axis_problem(correlations, about, down)
    return AxisAgreement(correlations, about, down, problem)


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
    times, course_rate, weights = find_course_rate(track)
    grid, yaw_rate = rate_about_down(samples)
    inside = seen_by(grid, yaw_rate, times) & (weights > 0.0)
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


def _too_little(course_rate: Series, interval: float) -> str:
    """Why the motion shows nothing of axes, or ""; in little of it anything goes with the course by chance."""
    seconds = len(course_rate) * interval
    turns = float(np.abs(course_rate - course_rate.mean()).sum()) * interval if len(course_rate) else 0.0
    if seconds >= _SHORT and turns >= _FEW_TURNS:
        return ""
    return (
        f"{seconds:.0f} s of motion with {np.degrees(turns):.0f} degrees of turns are too little to "
        "see whether gyros and course go together: take a longer part of the drive, with turns."
    )


def _axis_problem(correlations: Vector, about: float, down: Vector) -> str:
    axis = int(np.argmax(np.abs(correlations)))
    vertical = int(np.argmax(np.abs(down)))
    best, seen = "xyz"[axis], correlations[axis]
    if abs(seen) > max(_AGREES, abs(about) + 0.01) and axis != vertical:
        return (
            f"The course goes with gyro {best} (correlation {seen:.2f}), but gravity lies along {'xyz'[vertical]}: "
            "axes of one triad are swapped. Check which column is which."
        )
    if about < -_AGREES:
        return (
            f"The gyros turn against the course (correlation {about:.2f}): their signs, or those of the "
            "accelerometers, are reversed. Check the body axes; they must be right-handed for both triads."
        )
    return (
        f"No gyro axis goes with the course (best is {best} with a correlation of {seen:.2f}). The "
        "clocks are apart, the positions scatter too much for a course, or the files do not belong "
        "together."
    )
