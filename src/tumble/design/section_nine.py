"""Savage's own reckoning of accuracy, one sequence and one error at a time (2018, section 9, (16), table 2)."""

from __future__ import annotations

import numpy as np

from tumble.design.strapdown_effects import PULSE
from tumble.earth import EARTH_RATE
from tumble.units import STANDARD_GRAVITY


def earth_angle(angle: float, seconds: float) -> float:
    """Return rad: the attitude error that the Earth rate makes of a start that is off by an angle (9.3).

    Parameters
    ----------
    angle : rad, across the Earth's axis.
    seconds : s over which it adds up.
    """
    return angle * EARTH_RATE * seconds


def walk_angle(random_walk: float, seconds: float) -> float:
    """Return rad: the rms attitude error of a gyro's random walk (9.1).

    Parameters
    ----------
    random_walk : rad/√s.
    seconds : s over which it adds up.
    """
    return float(random_walk * np.sqrt(seconds))


def pulse_angle(pulse: float) -> float:
    """Return rad: the rms of the difference of what a pulse leaves over at start and end, 0.41 of it (9.1).

    Parameters
    ----------
    pulse : rad.
    """
    return float(np.sqrt(2.0) * PULSE * pulse)


def single_sequence_sigma(angle: float) -> dict[str, float]:
    """Return what an attitude error at the end of one sequence makes of the parameter that it is for (16), table 2.

    Parameters
    ----------
    angle : rad.

    Returns
    -------
    sigma : by "scale factor" (κ of one direction of turning), "orthogonality" (υ), "alignment" (µ + υ/2, rad)
        and "bias" (λ, m/s² at standard gravity).
    """
    return {
        "scale factor": angle / (2.0 * np.pi),
        "orthogonality": angle / 4.0,
        "alignment": angle / 2.0,
        "bias": STANDARD_GRAVITY * angle / 2.0,
    }
