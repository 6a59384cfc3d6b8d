"""The loosely coupled error-state filter, its smoother, and tests of its consistency."""

from tumble.navigation.filter.run import FilterRun, SmoothedRun, run_filter, smooth
from tumble.navigation.filter.setup import (
    FilterSetup,
    SensorState,
    TriadSpread,
    covariance_from_calibration,
    plan_filter,
    sensor_states,
)

__all__ = [
    "FilterRun",
    "FilterSetup",
    "SensorState",
    "SmoothedRun",
    "TriadSpread",
    "covariance_from_calibration",
    "plan_filter",
    "run_filter",
    "sensor_states",
    "smooth",
]
