from .gravity import (
    ECCENTRICITY_SQUARED as ECCENTRICITY_SQUARED,
    FLATTENING as FLATTENING,
    GRAVITY_AT_EQUATOR as GRAVITY_AT_EQUATOR,
    GRAVITY_RATIO as GRAVITY_RATIO,
    PLUMB_LINE_CURVATURE as PLUMB_LINE_CURVATURE,
    SEMI_MAJOR_AXIS as SEMI_MAJOR_AXIS,
    SOMIGLIANA_CONSTANT as SOMIGLIANA_CONSTANT,
    curvature_radii as curvature_radii,
    geodetic_position as geodetic_position,
    gravity_vectors_n as gravity_vectors_n,
    normal_gravity as normal_gravity,
    position_in_earth_frame as position_in_earth_frame,
    rotations_to_earth_frame as rotations_to_earth_frame,
)
from .magnetic_model import earth_field as earth_field
from .site import EARTH_RATE as EARTH_RATE, Site as Site
