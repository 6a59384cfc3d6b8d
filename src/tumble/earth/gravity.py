"""The WGS 84 ellipsoid: normal gravity, radii of curvature, and positions in the Earth frame.

Frames: e the Earth frame (ECEF: z to the north pole, x to the Greenwich meridian), n the local level
(north, east, down) at a point. Latitude is geodetic, height above the ellipsoid.
"""

from __future__ import annotations

import math

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vectors

# WGS 84 defining and derived constants: NGA.STND.0036_1.0.0 (2014), tables 3.1, 3.2, 3.5, 3.6.
SEMI_MAJOR_AXIS = 6378137.0  # m, defining
FLATTENING = 1.0 / 298.257223563  # 1, defining
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)  # 1
GRAVITY_AT_EQUATOR = 9.7803253359  # m/s², gamma_e
SOMIGLIANA_CONSTANT = 1.931852652458e-3  # k = b gamma_p / (a gamma_e) - 1
GRAVITY_RATIO = 3.449786506841e-3  # m = omega² a² b / GM
# The plumb line's curvature: normal gravity above the ellipsoid leans to the equator, 1/s².
PLUMB_LINE_CURVATURE = 8.08e-9


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Return the magnitude of normal gravity in m/s² at geodetic `latitude` and ellipsoidal `height`.

    The real field differs from it by the gravity disturbance: up to 0.5 mm/s² (50 ppm) in most
    places, 2 mm/s² in high mountains. Gravity of a local survey is better when there is one.

    Parameters
    ----------
    latitude : geodetic latitude, rad.
    height : metres above the ellipsoid; the series is good to 1e-6 m/s² (0.1 ppm) up to 10 km.

    Notes
    -----
    Somigliana's closed formula on the ellipsoid (NGA.STND.0036 eq. 4-1) and its Taylor series in
    height to the second order (eq. 4-3).

    Examples
    --------
    >>> round(normal_gravity(0.0), 6)
    9.780325
    """
    return float(_magnitude(math.sin(latitude) ** 2, height))


def gravity_vectors_n(latitude: AnyArray, height: AnyArray) -> AnyArray:
    """Return (..., 3) normal gravity in m/s² in north, east, down.

    The down component is `normal_gravity`; the north component, zero on the ellipsoid, is the plumb line's
    curvature, 13 µm/s² at 1600 m and 45° (Groves, Principles of GNSS, Inertial, and Multisensor Integrated
    Navigation Systems, 2nd edition, eq. 2.140).

    Parameters
    ----------
    latitude : geodetic, rad, of any shape.
    height : m above the ellipsoid, of the same shape.
    """
    latitude, height = np.asarray(latitude, dtype=float), np.asarray(height, dtype=float)
    down = np.asarray(_magnitude(np.sin(latitude) ** 2, height))
    north = -PLUMB_LINE_CURVATURE * height * np.sin(2.0 * latitude)
    return np.stack([north, np.zeros_like(north), down], axis=-1)


def _magnitude(square: AnyArray | float, height: AnyArray | float) -> AnyArray | float:
    """Normal gravity by the squared sine of the latitude."""
    surface = (
        GRAVITY_AT_EQUATOR
        * (1.0 + SOMIGLIANA_CONSTANT * square)
        / np.sqrt(1.0 - ECCENTRICITY_SQUARED * square)
    )
    first = 2.0 / SEMI_MAJOR_AXIS * (1.0 + FLATTENING + GRAVITY_RATIO - 2.0 * FLATTENING * square)
    return surface * (1.0 - first * height + 3.0 / SEMI_MAJOR_AXIS**2 * height**2)


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
