"""Whether an IMU's samples and satellite positions are of one motion: one refusal where they are not."""

from __future__ import annotations

import numpy as np

from tumble.errors import RecordingError
from tumble.navigation.course import correlate, find_course_rate, rate_about_down, seen_by
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples

# Correlation of course and gyros about down from which on they are of one motion.
_AGREES = 0.8
# A gyro's scale is off by no more in any unit that works.
_LARGEST_SLOPE = 1.3
# Less motion, s, and fewer turns in all, rad, show nothing.
_SHORT, _FEW_TURNS = 20.0, 1.0


def refuse_other_motion(samples: InertialSamples, track: GnssTrack) -> float:
    """Refuse gyros that do not turn with a track's course; return how they correlate about down, 1 at best.

    Parameters
    ----------
    samples : taken to be in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If they do not turn together, or not as fast, or there is too little motion to see it.
    """
    times, course_rate, weights = find_course_rate(track)
    grid, yaw_rate = rate_about_down(samples)
    about = correlate(grid, yaw_rate, times, course_rate, weights)
    inside = seen_by(grid, yaw_rate, times) & (weights > 0.0)
    course = course_rate[inside] - (course_rate[inside].mean() if inside.any() else 0.0)
    if not about > _AGREES:
        seconds = float(inside.sum()) * track.interval
        turns = float(np.abs(course).sum()) * track.interval
        if seconds < _SHORT or turns < _FEW_TURNS:
            raise RecordingError(
                f"{seconds:.0f} s of motion with {np.degrees(turns):.0f} degrees of turns are too little to "
                "see whether gyros and course go together: take a longer part of the drive, with turns."
            )
        raise _other_motion(f"correlate at {about:.2f} of 1")
    seen = np.interp(times[inside], grid, yaw_rate)
    seen = seen - seen.mean()
    slope = float(seen @ course) / max(float(seen @ seen), 1e-300)
    if not 1.0 / _LARGEST_SLOPE < slope < _LARGEST_SLOPE:
        raise _other_motion(f"differ by a factor of {slope:.3g}")
    return float(about)


def _other_motion(how: str) -> RecordingError:
    return RecordingError(
        f"IMU and positions do not describe one motion: the gyros' rate about the vertical and the course's {how}. A "
        "unit, an axis or a sign of a column is another, or the clocks are apart: check the columns with `tumble "
        "inspect`."
    )
