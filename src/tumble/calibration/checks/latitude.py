"""Whether the gyros at rest show the Earth's rotation of another latitude than the stated one.

At rest the specific force is g along the vertical, so that a vertical rate w of the Earth which nobody knows of looks
like a g-sensitivity: of gyros with the matrix M it is ``M w / g``. That is one number where a sensor's own
g-sensitivity has nine.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Square, inverted
from tumble.calibration.estimate import Estimate
from tumble.earth import EARTH_RATE, Site

# By so many of its standard uncertainties the one number is not zero, and so likely chance makes the axes differ.
# What is across is smaller: with the vertical part of the Earth's rotation the horizontal one is wrong, too.
CERTAIN, CHANCE = 5.0, 0.001
# A latitude has a sine; beyond this the rate is not the Earth's.
LARGEST_SINE = 1.02
_NAMES = [f"gyroscope.g_sensitivity[{i},{j}]" for i in range(3) for j in range(3)]


def find_other_latitude(estimate: Estimate, site: Site) -> str | None:
    """Return an objection to a g-sensitivity that is another latitude's Earth rate; None where it is none.

    Parameters
    ----------
    estimate, site : with a g-sensitivity, and a latitude, or there is nothing to ask.
    """
    found, gyroscope = estimate.model.g_sensitivity, estimate.model.gyroscope
    if site.latitude is None or found is None or gyroscope is None or not set(_NAMES) <= set(estimate.names):
        return None
    at = [estimate.names.index(name) for name in _NAMES]
    return latitude_shown(
        found, gyroscope.matrix, estimate.covariance[np.ix_(at, at)], site.latitude, site.gravity
    )


def latitude_shown(
    found: Matrix, matrix: Matrix, covariance: Square, latitude: float, gravity: float
) -> str | None:
    """Return `find_other_latitude` of numbers.

    Parameters
    ----------
    found, matrix : (3, 3) raw per m/s² and raw per rad/s, g-sensitivity and gyros.
    covariance : (9, 9) of the g-sensitivity's entries, row by row.
    latitude, gravity : rad, m/s².
    """
    from scipy.special import chdtrc

    inverse = inverted(matrix)
    turned = np.kron(inverse, np.eye(3))
    seen = gravity * (inverse @ found).ravel()
    weight = inverted((gravity**2 * turned @ covariance @ turned.T)[::4, ::4])
    along, across = seen[::4], np.delete(seen, [0, 4, 8])
    precision = float(np.sum(weight))
    upward = float(np.sum(weight @ along)) / precision
    left = float(along @ weight @ along) - upward**2 * precision
    sine = np.sin(latitude) + upward / EARTH_RATE
    is_one = abs(upward) * precision**0.5 > CERTAIN and float(chdtrc(2, max(left, 0.0))) > CHANCE
    is_one = is_one and float(np.sqrt(np.mean(across**2))) < abs(upward)
    if not is_one or abs(sine) > LARGEST_SINE:
        return None
    shown = np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))
    return (
        f"The gyros at rest show {upward:+.2g} ± {precision**-0.5:.1g} rad/s more of the Earth's rotation upwards than "
        f"the latitude {np.degrees(latitude):.1f}° gives, as at {shown:.1f}°. It stands in the g-sensitivity, "
        "which is the same on all axes. Check the latitude (--site), and with it gravity."
    )
