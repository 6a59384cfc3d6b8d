"""The WGS 84 ellipsoid: radii of curvature, and positions in the Earth frame.

Frames: e the Earth frame (ECEF: z to the north pole, x to the Greenwich meridian), n the local level
(north, east, down) at a point. Latitude is geodetic, height above the ellipsoid.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vectors
from tumble.earth.gravity import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS

_MINOR = SEMI_MAJOR_AXIS * float(np.sqrt(1.0 - ECCENTRICITY_SQUARED))
_SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)


def curvature_radii(latitude: AnyArray | float) -> tuple[AnyArray, AnyArray]:
    """Return the radii of curvature, m: in the meridian (R_M) and across it, in the prime vertical (R_N).

    Parameters
    ----------
    latitude : geodetic, rad, of any shape.
    """
    reduced = 1.0 - ECCENTRICITY_SQUARED * np.sin(np.asarray(latitude, dtype=float)) ** 2
    across = SEMI_MAJOR_AXIS / np.sqrt(reduced)
    return np.asarray(across * (1.0 - ECCENTRICITY_SQUARED) / reduced), np.asarray(across)


def position_in_earth_frame(latitude: Series, longitude: Series, height: Series) -> Vectors:
    """Return (points, 3) m in e of geodetic positions, rad and m."""
    across = curvature_radii(latitude)[1]
    cosine = np.cos(latitude)
    return np.column_stack(
        [
            (across + height) * cosine * np.cos(longitude),
            (across + height) * cosine * np.sin(longitude),
            (across * (1.0 - ECCENTRICITY_SQUARED) + height) * np.sin(latitude),
        ]
    )


def geodetic_position(position_e: Vectors) -> tuple[Series, Series, Series]:
    """Return latitude and longitude (rad) and height (m) of points in e.

    Bowring's formula (Survey Review 23 (1976) 323) with a second pass: good to round-off from 10 km below
    the ellipsoid to 10,000 km above. The height is exact at the poles too.

    Parameters
    ----------
    position_e : (points, 3) m.
    """
    x, y, z = position_e.T
    radius = np.hypot(x, y)
    tangent = z * SEMI_MAJOR_AXIS / np.maximum(radius * _MINOR, 1e-9)
    latitude = np.zeros_like(z)
    for _ in range(2):
        cosine = 1.0 / np.sqrt(1.0 + tangent**2)
        sine = tangent * cosine
        latitude = np.arctan2(
            z + _SECOND_ECCENTRICITY_SQUARED * _MINOR * sine**3,
            radius - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * cosine**3,
        )
        tangent = _MINOR / SEMI_MAJOR_AXIS * np.tan(latitude)
    s, c = np.sin(latitude), np.cos(latitude)
    height = radius * c + z * s - SEMI_MAJOR_AXIS * np.sqrt(1.0 - ECCENTRICITY_SQUARED * s**2)
    return latitude, np.arctan2(y, x), height


def rotations_to_earth_frame(latitude: Series, longitude: Series) -> Matrices:
    """Return (points, 3, 3) C_en, from north, east, down at each point to e."""
    s, c = np.sin(latitude), np.cos(latitude)
    sl, cl = np.sin(longitude), np.cos(longitude)
    rows = [[-s * cl, -sl, -c * cl], [-s * sl, cl, -c * sl], [c, np.zeros_like(s), -s]]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))


def rotation_to_earth_frame(latitude: float, longitude: float) -> Matrix:
    """Return C_en, from north, east, down at one point to e."""
    return rotations_to_earth_frame(np.array([latitude]), np.array([longitude]))[0]
