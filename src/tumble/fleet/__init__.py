"""Statistics of many units: what is common to them, which of them stand out, and how one of them changes.

It takes vectors of parameters with their covariances, as `unit_vector` makes them of calibrations, and knows no files.
"""

from tumble.fleet.outlying import Outlying, find_outlying, find_shared
from tumble.fleet.unit_vector import Units, UnitVector, stack, unit_vector

__all__ = [
    "Outlying",
    "UnitVector",
    "Units",
    "find_outlying",
    "find_shared",
    "stack",
    "unit_vector",
]
