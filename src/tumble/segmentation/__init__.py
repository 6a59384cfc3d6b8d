"""Holds and turns: where the unit was at rest, where it moved, and what each hold tells.

`find_timeline` finds them, `observe_holds` averages them; `read_intervals` reads a user's own list.
"""

from tumble.segmentation.averages import MeanCovariance, mean_covariance
from tumble.segmentation.intervals import read_intervals
from tumble.segmentation.observations import HoldMeans, observe_holds
from tumble.segmentation.search import find_timeline
from tumble.segmentation.spin_means import SpinMeans, observe_spins
from tumble.segmentation.thermal_rests import find_thermal_timeline
from tumble.segmentation.timeline import Hold, NoiseFloor, Rejection, Timeline, Turn
from tumble.segmentation.turns import FoundSpin, find_spins

__all__ = [
    "FoundSpin",
    "Hold",
    "HoldMeans",
    "MeanCovariance",
    "NoiseFloor",
    "Rejection",
    "SpinMeans",
    "Timeline",
    "Turn",
    "find_spins",
    "find_thermal_timeline",
    "find_timeline",
    "mean_covariance",
    "observe_holds",
    "observe_spins",
    "read_intervals",
]
