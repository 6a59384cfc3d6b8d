"""Inertial navigation, and its filter with satellite positions: what a calibration is worth in metres.

Frames: n the local level (north, east, down), e the Earth frame (ECEF), b the body frame of the IMU, i inertial
space. Latitude is geodetic, height above the ellipsoid of WGS 84. Errors are estimate less truth; of the attitude
the small rotation phi of ``C_nb_estimate = exp(-skew(phi)) C_nb``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
