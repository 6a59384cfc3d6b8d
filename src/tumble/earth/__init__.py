"""The Earth as an IMU at rest sees it: gravity and the Earth's rotation at a site."""

from tumble.earth.gravity import normal_gravity
from tumble.earth.site import EARTH_RATE, STANDARD_GRAVITY, Site

__all__ = ["EARTH_RATE", "STANDARD_GRAVITY", "Site", "normal_gravity"]
