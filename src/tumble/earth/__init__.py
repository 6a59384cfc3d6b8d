"""The Earth as an IMU sees it: its figure, gravity, and its rotation at a site."""

from tumble.earth.gravity import (
    curvature_radii,
    geodetic_position,
    gravity_vectors_n,
    normal_gravity,
    position_in_earth_frame,
    rotations_to_earth_frame,
)
from tumble.earth.site import EARTH_RATE, STANDARD_GRAVITY, Site

__all__ = [
    "EARTH_RATE",
    "STANDARD_GRAVITY",
    "Site",
    "curvature_radii",
    "geodetic_position",
    "gravity_vectors_n",
    "normal_gravity",
    "position_in_earth_frame",
    "rotations_to_earth_frame",
]
