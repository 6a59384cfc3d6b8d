"""Where the joint estimator's further unknowns stand, behind the 33 that every adjustment has.

A state is as wide as its vector of unknowns: 33, or `WIDE` where a fixture is believed or terms are tried
that few recordings tell.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration.joint.unknowns import FORCE_ASYMMETRY, RATE_ASYMMETRY, RATE_QUADRATIC, SHARED

FIXTURE = slice(33, 36)
"""Rotation vector (rad) of C_bf, from the fixture's axes to the sensors' frame b."""
LEVER_ARMS = slice(42, 51)
"""Of each accelerometer, m in b, sensor by sensor. The point that they count from has the x of accelerometer x, the
y of accelerometer y and the z of accelerometer z, so that each one's place along its own axis stays zero."""
TIME_LAG = slice(51, 52)
"""By how much the accelerometers lag behind the gyros, s."""
# Quadratic terms of the gyros, per raw unit, stand behind it: `RATE_QUADRATIC`.
WIDE = 55


def widened(unknowns: Series) -> Series:
    """Return a copy of the unknowns with all that there may be; what was not there is zero."""
    made = np.zeros(max(WIDE, unknowns.size))
    made[: unknowns.size] = unknowns
    return made


def part_of(unknowns: Series, place: slice) -> Series:
    """Return a part of the unknowns, zeros where the vector is too short to have it."""
    if unknowns.size >= place.stop:
        return np.asarray(unknowns[place], dtype=np.float64)
    return np.zeros(int(place.stop) - int(place.start))


def is_wide(unknowns: Series) -> bool:
    """Whether there is more than the 33."""
    return unknowns.size > SHARED


__all__ = [
    "FIXTURE",
    "FORCE_ASYMMETRY",
    "LEVER_ARMS",
    "RATE_ASYMMETRY",
    "RATE_QUADRATIC",
    "TIME_LAG",
    "WIDE",
    "is_wide",
    "part_of",
    "widened",
]
