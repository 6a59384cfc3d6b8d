"""The Earth at a place: gravity by Somigliana's formula on the ellipsoid of WGS 84, and its rotation."""

import numpy as np

EARTH_RATE = 7.292115e-5
"""Angular velocity of the Earth, rad/s (WGS 84)."""


def normal_gravity(latitude: float, height: float) -> float:
    """Return normal gravity in m/s².

    Of second order in the height (NIMA TR8350.2, 4-3); latitude in rad.
    """
    equator, k, e2 = 9.7803253359, 0.00193185265241, 0.00669437999014
    a, f, m = 6378137.0, 1 / 298.257223563, 0.00344978650684
    s2 = np.sin(latitude) ** 2
    surface = equator * (1 + k * s2) / np.sqrt(1 - e2 * s2)
    return float(surface * (1 - 2 / a * (1 + f + m - 2 * f * s2) * height + 3 * height**2 / a**2))


def earth_rate(latitude: float) -> np.ndarray:
    """Return the Earth's rotation along north, east and down, rad/s."""
    return EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
