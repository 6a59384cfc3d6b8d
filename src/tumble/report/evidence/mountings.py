"""How the units of an array sit against one another, and what their common poses gain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.report.page import Block, Sentences, Table
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.calibration.arrays.estimate import ArrayEstimate, MountedUnit

_FIRST = "the first: its axes are the array's"


def mountings(array: ArrayEstimate) -> list[Block]:
    """Return the units' mountings and gains as tables, and whether they kept their places.

    Parameters
    ----------
    array : of two units or more.
    """
    first, *others = array.units
    mounted = [[first.name, _FIRST, "", ""], *map(_mounting, others)]
    groups = list(dict.fromkeys(group for unit in array.units for group in unit.gain))
    gains = [
        [group, *(f"{unit.gain[group]:.2f}" if group in unit.gain else "" for unit in array.units)]
        for group in groups
    ]
    words = "fixed to one another" if array.is_rigid else "NOT fixed to one another"
    rigid = (
        f"The units were {words}: common poses add {array.chi_square:.0f} to the sum of squares, {array.degrees} are "
        f"expected (probability {array.probability:.2g})."
    )
    return [
        Table(("mounting / deg", "about x", "about y", "about z"), mounted),
        Table(("uncertainty / that of the unit alone", *(unit.name for unit in array.units)), gains),
        Sentences([rigid], "paragraphs"),
    ]


def _mounting(unit: MountedUnit) -> list[str]:
    angles = zip(unit.rotation.tolist(), unit.sigma.tolist(), strict=True)
    return [
        unit.name,
        *(with_uncertainty(math.degrees(value), math.degrees(sigma)) for value, sigma in angles),
    ]
