"""Which level axes are swapped or reversed: the filter is run with each such error undone, and fits best with one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import ConvergenceError, RecordingError
from tumble.navigation.drive import prepare_drive
from tumble.navigation.filter import FilterSetup
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples

# An error is named if with it undone the positions fit this many times better than now, and than with any other.
_BETTER, _THAN_OTHERS = 2.0, 1.3
# What a position counts at most: an outlier is none the worse for its size.
_MOST = 30.0
# s of the drive that are tried.
_LONGEST = 180.0


def swapped_axes(samples: InertialSamples, track: GnssTrack, setup: FilterSetup) -> str:
    """Return which level axes are swapped or reversed, in a sentence, or "" where the drive does not tell.

    On a flat road the level gyros see little: their axes are determined by how the body rolls and pitches, if it does.

    Parameters
    ----------
    samples : uncalibrated, less the gyros' mean at rest, so that an error of axes leaves no bias.
    track : on the IMU's clock.
    setup : of the filter, wide enough for an uncalibrated unit.
    """
    stop = min(float(samples.time[-1]), max(float(samples.time[0]), float(track.time[0])) + _LONGEST)
    samples = samples.between(float(samples.time[0]), stop)
    track = track.rows(track.time < stop)
    now = _misfit(samples, track, setup)
    found = sorted(
        (_misfit(_undone(samples, force, rate), track, setup), text) for text, force, rate in _errors(samples)
    )
    (best, words), (second, _) = found[:2]
    if now < _BETTER * best or second < _THAN_OTHERS * best:
        return ""
    return f"With {words} they fit {now / best:.0f} times better: check which column is which, and the signs."


def _errors(samples: InertialSamples) -> list[tuple[str, Matrix, Matrix]]:
    """What may be wrong with level axes, in words, and what undoes it for specific force and angular rate."""
    vertical = int(np.argmax(np.abs(samples.specific_force_b.mean(axis=0))))
    one, two = (axis for axis in range(3) if axis != vertical)
    a, b = "xyz"[one], "xyz"[two]
    same = np.eye(3)
    swap = np.eye(3)[[two if axis == one else one if axis == two else axis for axis in range(3)]]
    first, second = (np.diag([-1.0 if axis == at else 1.0 for axis in range(3)]) for at in (one, two))
    return [
        (f"gyros {a} and {b} swapped", same, swap),
        (f"gyro {a} reversed", same, first),
        (f"gyro {b} reversed", same, second),
        (f"gyros {a} and {b} both reversed", same, first @ second),
        (f"gyro {b} as {a} and {a} reversed as {b}", same, second @ swap),
        (f"gyro {b} reversed as {a} and {a} as {b}", same, first @ swap),
        (f"accelerometers {a} and {b} swapped", swap, same),
        (f"accelerometer {a} reversed", first, same),
        (f"accelerometer {b} reversed", second, same),
        # up to the mounting the same as one of them reversed in both
        (f"axes {a} and {b} of both triads swapped (or one of them reversed in both)", swap, swap),
    ]


def _undone(samples: InertialSamples, force: Matrix, rate: Matrix) -> InertialSamples:
    return replace(
        samples,
        specific_force_b=np.ascontiguousarray(samples.specific_force_b @ force.T),
        angular_rate_ib_b=np.ascontiguousarray(samples.angular_rate_ib_b @ rate.T),
    )


def _misfit(samples: InertialSamples, track: GnssTrack, setup: FilterSetup) -> float:
    """The mean squared innovation, normalised; the most where the drive cannot even be prepared."""
    try:
        run = prepare_drive(samples, track, offset=0.0).run(setup, interval=1.0)
    except (RecordingError, ConvergenceError):
        return _MOST
    return float(np.nanmean(np.minimum(run.distances[:, 0], _MOST)))
