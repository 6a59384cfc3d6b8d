"""Adjustment of condition equations: Gauss-Helmert, variance components, reliability.

This room knows no IMU.
"""

from tumble.estimation.gauss_helmert import Adjustment, Conditions, Linearisation, Prior, adjust
from tumble.estimation.reliability import WeakDirection, find_weak_directions, snoop_groups

__all__ = [
    "Adjustment",
    "Conditions",
    "Linearisation",
    "Prior",
    "WeakDirection",
    "adjust",
    "find_weak_directions",
    "snoop_groups",
]
