"""Inertial navigation, and its filter with satellite positions: what a calibration is worth in metres.

Frames: n the local level (north, east, down), e the Earth frame (ECEF), b the body frame of the IMU, i inertial
space. Latitude is geodetic, height above the ellipsoid of WGS 84. Errors are estimate less truth; of the attitude
the small rotation phi of ``C_nb_estimate = exp(-skew(phi)) C_nb``.
"""

from tumble.navigation.alignment import Alignment, align_coarse, align_in_motion, find_rest
from tumble.navigation.drive import Drive, prepare_drive, wide_setup
from tumble.navigation.filter import (
    FilterRun,
    FilterSetup,
    SensorState,
    SmoothedRun,
    TriadSpread,
    covariance_from_calibration,
    plan_filter,
    run_filter,
    smooth,
)
from tumble.navigation.gnss import GnssTrack, read_track
from tumble.navigation.mechanisation import navigate
from tumble.navigation.outages import OutageErrors, outages
from tumble.navigation.samples import InertialSamples
from tumble.navigation.time_alignment import TimeAlignment, estimate_time_offset
from tumble.navigation.trajectory import NavigationState, Trajectory, position_differences

__all__ = [
    "Alignment",
    "Drive",
    "FilterRun",
    "FilterSetup",
    "GnssTrack",
    "InertialSamples",
    "NavigationState",
    "OutageErrors",
    "SensorState",
    "SmoothedRun",
    "TimeAlignment",
    "Trajectory",
    "TriadSpread",
    "align_coarse",
    "align_in_motion",
    "covariance_from_calibration",
    "estimate_time_offset",
    "find_rest",
    "navigate",
    "outages",
    "plan_filter",
    "position_differences",
    "prepare_drive",
    "read_track",
    "run_filter",
    "smooth",
    "wide_setup",
]
