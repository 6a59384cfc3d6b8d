"""What a variance that residuals ask for may be at most: beyond it no unit of any grade explains them, and no table.

An adjustment raises a variance until its residuals are as large as they should be, whatever made them so. What a unit
does by itself has a limit, which data sheets tell: the in-run stability of the worst of them, and what such a unit's
bias does within the few degrees by which a room warms while one records.
"""

from __future__ import annotations

import numpy as np

from tumble.calibration.estimate import Estimate

# Start of a component's name: its ceiling, a factor to the unit shown, that unit, what to do. Phones' accelerometers
# wander by 0.3 mg and drift by 0.5 mg/K, their gyros by 0.01 °/s and by 0.03 (°/s)/K: 2 mg and 0.2 °/s are three to
# five kelvin. A table is levelled to 0.1° with a bubble.
_CEILINGS = (
    (
        "accelerometer bias",
        0.02,
        1e3,
        "mm/s²",
        "look for holds in which the unit moved, and for a wrong range or unit",
    ),
    (
        "gyro bias",
        np.radians(0.2),
        np.degrees(1.0),
        "°/s",
        "look for holds or turns that went wrong, and for lost samples",
    ),
    (
        "table's axis against the vertical",
        np.radians(0.3),
        np.degrees(1.0),
        "°",
        "level the table, and fasten the unit",
    ),
)


def beyond_ceilings(estimate: Estimate) -> list[str]:
    """Object to variance components that nothing explains that a unit or a levelled table does.

    Parameters
    ----------
    estimate : with the components that were found.
    """
    against: list[str] = []
    for name, value in estimate.variance_components.items():
        for start, ceiling, factor, unit, remedy in _CEILINGS:
            if name.startswith(start) and value > ceiling:
                against.append(
                    f"The residuals ask for more than any unit or table does: {name.partition(',')[0]} of "
                    f"{factor * value:.2g} {unit}, where {factor * ceiling:.2g} {unit} is the most "
                    f"that one has{_worst_hold(estimate)}: {remedy}."
                )
    return against


def _worst_hold(estimate: Estimate) -> str:
    """Return which hold misses gravity most."""
    norms = estimate.holds.norms
    if not norms.size or not np.any(np.isfinite(norms)):
        return ""
    return f" (hold {int(np.nanargmax(np.abs(norms))) + 1} misses gravity most)"
