"""Where the recording was made: gravity and Earth rate there, and how well they are known."""

from __future__ import annotations

import math

import numpy as np

from tumble.arrays import Vector
from tumble.border import border
from tumble.earth.gravity import normal_gravity
from tumble.errors import SiteError
from tumble.records import dataclass
from tumble.units import STANDARD_GRAVITY

EARTH_RATE = 7.292115e-5  # rad/s, WGS 84 (NGA.STND.0036, table 3.1)

# Normal gravity runs from 9.780 at the equator to 9.832 m/s² at the poles; an unknown site is
# given the middle and an even spread over that range, as the GUM (4.3.7) does with limits.
_UNKNOWN_SITE_SIGMA = (9.832 - 9.780) / math.sqrt(12.0)
_NORMAL_GRAVITY_SIGMA = 3e-4  # m/s²: rms gravity disturbance of the Earth, about 30 mGal
# The largest disturbances on land are some 300 to 400 mGal (EGM2008); 500 is none.
_LARGEST_DISTURBANCE = 5e-3  # m/s²


@dataclass(frozen=True, slots=True)
class Site:
    """A place on the Earth.

    Attributes
    ----------
    gravity : magnitude, m/s².
    gravity_sigma : its standard uncertainty, m/s².
    latitude : geodetic, rad, or None if only gravity is known.
    height : metres above the ellipsoid.
    source : where gravity came from, in words.
    """

    gravity: float
    gravity_sigma: float
    latitude: float | None = None
    height: float = 0.0
    source: str = "given"

    @staticmethod
    @border
    def from_latitude(latitude: float, height: float = 0.0) -> Site:
        """Return the site at geodetic `latitude` (rad) and `height` (m), with normal gravity.

        Raises
        ------
        SiteError
            If the latitude is beyond the poles or the height outside -500 to 10,000 m.
        """
        if not abs(latitude) <= math.pi / 2:
            raise SiteError(
                f"The latitude {math.degrees(latitude):g} degrees is beyond the poles: "
                "give --site LATITUDE[,HEIGHT] with a latitude from -90 to 90."
            )
        if not -500.0 <= height <= 10_000.0:
            raise SiteError(f"The height {height:g} m is not on the Earth's surface (-500 to 10000 m).")
        return Site(
            gravity=normal_gravity(latitude, height),
            gravity_sigma=_NORMAL_GRAVITY_SIGMA,
            latitude=latitude,
            height=height,
            source="normal gravity of WGS 84 at the latitude and height given",
        )

    @staticmethod
    @border
    def from_gravity(gravity: float) -> Site:
        """Return a site of which only gravity is known, in m/s².

        Raises
        ------
        SiteError
            If it is outside 9.75 to 9.85 m/s², which no place on the Earth's surface is.
        """
        if not 9.75 <= gravity <= 9.85:
            raise SiteError(
                f"Gravity of {gravity:g} m/s² is found nowhere on the Earth's surface (9.76 to 9.84): "
                "give --gravity in m/s², or --site LATITUDE[,HEIGHT]."
            )
        return Site(gravity=gravity, gravity_sigma=0.0, source="given as an exact value")

    def with_gravity(self, gravity: float) -> Site:
        """Return this place with a gravity that was given, in m/s².

        Raises
        ------
        SiteError
            If no place has it, or if it is not that of the latitude and height, where these are known.
        """
        given = Site.from_gravity(gravity)
        if self.latitude is None:
            return given
        normal = normal_gravity(self.latitude, self.height)
        if abs(gravity - normal) > _LARGEST_DISTURBANCE:
            raise SiteError(
                f"Gravity of {gravity:g} m/s² contradicts the latitude {math.degrees(self.latitude):g}° and the height "
                f"{self.height:g} m, where it is {normal:.4f} m/s²: give the one that you trust."
            )
        return Site(gravity, 0.0, self.latitude, self.height, given.source)

    @staticmethod
    def unknown() -> Site:
        """Return the site of a user who did not say: standard gravity, ±0.015 m/s²."""
        return Site(
            gravity=STANDARD_GRAVITY,
            gravity_sigma=_UNKNOWN_SITE_SIGMA,
            source="assumed: standard gravity, because no site was given",
        )

    @property
    def earth_rate_n(self) -> Vector:
        """Earth rate in north, east, down, rad/s (Hayal 4.2 with both signs mended).

        Raises
        ------
        SiteError
            If the latitude is not known.
        """
        if self.latitude is None:
            raise SiteError("The Earth rate's direction needs a latitude: give --site LATITUDE.")
        return EARTH_RATE * np.array([math.cos(self.latitude), 0.0, -math.sin(self.latitude)])
