"""Where the recording was made: gravity and Earth rate there, and how well they are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tumble.arrays import Vector
from tumble.border import border
from tumble.earth.gravity import normal_gravity
from tumble.errors import SiteError
from tumble.records import dataclass
from tumble.sample_rates import rounding, stated_number
from tumble.units import STANDARD_GRAVITY

EARTH_RATE = 7.292115e-5  # rad/s, WGS 84 (NGA.STND.0036, table 3.1)

# Normal gravity runs from 9.780 at the equator to 9.832 m/s² at the poles; an unknown site is
# given the middle and an even spread over that range, as the GUM (4.3.7) does with limits.
_ANY_PLACE = (9.832 - 9.780) / math.sqrt(12.0)
# Real gravity differs from normal gravity by 30 mGal rms where the land is flat. What stands above the land around it
# pulls besides, 2 pi G rho = 0.1119 mGal a metre (Hofmann-Wellenhof and Moritz, Physical Geodesy, 2006, 3.4); of a
# place's height that is about half, the other half is balanced below (isostasy): 95 mGal at 1,600 m, 116 at 2,000 m.
_FLAT, _TERRAIN = 3e-4, 0.5 * 1.119e-6  # m/s², 1/s²
# Half of mankind lives below 200 m, and nearly all of it below 2,500 m (Cohen and Small, PNAS 95, 1998, 14009): sea
# level is 0.7 sigma off this, 1,600 m 1.6 and 2,500 m 2.9. Gravity falls by 3.086e-6 m/s² a metre in free air.
# The highest town, La Rinconada, is 5,100 m up.
_HEIGHT, _HEIGHT_SIGMA, _HIGHEST_HOME, _FREE_AIR = 500.0, 700.0, 5100.0, 3.086e-6
# Standard gravity, also of four decimals, m/s²; sigmas by which rounded digits may differ from the latitude's gravity.
_LIKE_STANDARD, _APART = 6e-5, 2.0
# The largest disturbances on land are some 300 to 400 mGal (EGM2008); 500 is none.
_LARGEST_DISTURBANCE = 5e-3  # m/s²


# Where gravity came from, and how to say it better.
_NORMAL = "normal gravity of WGS 84 at the latitude and height given"
_NO_HEIGHT = "normal gravity of WGS 84 at the latitude given, 500 ± 700 m high because no height was given"
_SAID, _ROUNDED = "given", "given, good to half of its last digit"
_ASSUMED = "assumed: standard gravity, because no site was given"
_STANDARD = "standard gravity, a unit's definition that no place has to all digits"
_GIVE = "give --gravity in m/s², as 9.81 or 9.80788±0.00002, or --site LATITUDE[,HEIGHT]."
_BETTER = {
    _NO_HEIGHT: "give the height too, as --site LATITUDE,HEIGHT in degrees and metres",
    _ASSUMED: "give --site LATITUDE,HEIGHT in degrees and metres",
    _STANDARD: "give that of your place, or --site LATITUDE,HEIGHT in degrees and metres",
    **dict.fromkeys((_SAID, _ROUNDED), "say so, as --gravity 9.80788±0.00002"),
}


@dataclass(frozen=True)
class Site:
    """A place on the Earth.

    Attributes
    ----------
    gravity : magnitude, m/s².
    gravity_sigma : its standard uncertainty, m/s².
    latitude : geodetic, rad, or None if only gravity is known.
    height : metres above the ellipsoid, or None if nobody says.
    source : where gravity came from, in words.
    """

    gravity: float
    gravity_sigma: float
    latitude: float | None = None
    height: float | None = None
    source: str = _SAID

    @staticmethod
    @border
    def from_latitude(latitude: float, height: float | None = None) -> Site:
        """Return the site at geodetic `latitude` (rad) and `height` (m), with normal gravity.

        Without a height it is 500 ± 700 m, which covers where people live, and gravity is known to 0.002 m/s². With
        one it is known to 0.0003 m/s² where the land is flat, 0.001 m/s² in mountains.

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
        at, doubt, words = (_HEIGHT, _HEIGHT_SIGMA, _NO_HEIGHT) if height is None else (height, 0.0, _NORMAL)
        if not -500.0 <= at <= 10_000.0:
            raise SiteError(f"The height {at:g} m is not on the Earth's surface (-500 to 10000 m).")
        sigma = math.hypot(_FLAT, _TERRAIN * at, _FREE_AIR * doubt)
        return Site(normal_gravity(latitude, at), sigma, latitude, height, words)

    @staticmethod
    @border
    def from_gravity(gravity: float | str, sigma: float | None = None) -> Site:
        """Return a site of which only gravity is known, in m/s², as a number or as a text such as 9.80788±0.00002.

        Without `sigma`, its standard uncertainty, gravity is good to half of its last digit, evenly spread: 9.81 is
        9.81 ± 0.0029, and standard gravity, 9.80665, is as good as none. A number has the digits of its shortest
        decimal text. Exact is what has a sigma of 0. No `sigma` is above what all places differ from the value by:
        ± 0.015 from 9.807, ± 0.028 from 9.83.

        Raises
        ------
        SiteError
            If it is outside 9.75 to 9.85 m/s², which no place on the Earth's surface is, or the text no number.
        """
        try:
            value, sigma = stated_number(gravity) if isinstance(gravity, str) else (gravity, sigma)
        except ValueError:
            raise SiteError(f"Gravity of {gravity!r} is no number, nor one ± another: {_GIVE}") from None
        if not 9.75 <= value <= 9.85:
            raise SiteError(
                f"Gravity of {gravity} m/s² is nowhere on the Earth's surface (9.76 to 9.84): {_GIVE}"
            )
        if sigma is None and abs(value - STANDARD_GRAVITY) < _LIKE_STANDARD:
            return Site(value, _ANY_PLACE, source=_STANDARD)
        known, source = (rounding(gravity), _ROUNDED) if sigma is None else (sigma, _SAID)
        return Site(value, min(known, math.hypot(_ANY_PLACE, value - STANDARD_GRAVITY)), source=source)

    def with_gravity(self, given: Site) -> Site:
        """Return this place with the gravity of `given`; with its own where that is known better than to given digits.

        Raises
        ------
        SiteError
            If no place has it, or if it is not that of the latitude and height, where these are known.
        """
        if self.latitude is None:
            return given
        heights = (0.0, _HIGHEST_HOME) if self.height is None else (self.height, self.height)
        most, least = (normal_gravity(self.latitude, height) for height in heights)
        # Rounded digits are off by root three of their sigma at most.
        slack = _LARGEST_DISTURBANCE + math.sqrt(3.0) * given.gravity_sigma
        if not least - slack <= given.gravity <= most + slack:
            raise SiteError(
                f"Gravity of {given.gravity:g} m/s² contradicts the latitude {math.degrees(self.latitude):g}° and the "
                f"height, where it is {least:.4f} to {most:.4f} m/s²: give the one that you trust."
            )
        off, sigmas = abs(given.gravity - self.gravity), (self.gravity_sigma, given.gravity_sigma)
        if given.is_evenly_spread and sigmas[0] < sigmas[1] and off < _APART * math.hypot(*sigmas):
            return self
        return replace(given, latitude=self.latitude, height=self.height)

    @staticmethod
    def unknown() -> Site:
        """Return the site of a user who did not say: standard gravity, ±0.015 m/s²."""
        return Site(STANDARD_GRAVITY, _ANY_PLACE, source=_ASSUMED)

    @property
    def mend(self) -> str:
        """What to say to have gravity known better, as a clause; empty where only a survey would tell."""
        return _BETTER.get(self.source, "")

    @property
    def is_evenly_spread(self) -> bool:
        """Whether gravity is as likely anywhere within limits: that of no known place, or a rounded one."""
        return self.source in (_ASSUMED, _STANDARD, _ROUNDED)

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
