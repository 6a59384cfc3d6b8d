"""The loosely coupled error-state filter, its smoother, and tests of its consistency."""

from tumble.navigation.filter.run import FilterRun, SmoothedRun, smooth
from tumble.navigation.filter.sensor_states import (
    SensorState,
    TriadSpread,
    covariance_from_calibration,
    sensor_states,
)
from tumble.navigation.filter.setup import FilterSetup, plan_filter
from tumble.navigation.filter.stretches import run_filter

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
