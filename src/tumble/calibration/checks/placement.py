"""What is said of poses that contradict one another: which do, and a placement that is not what was stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.calibration.equations.placement import PlacedFit
from tumble.calibration.verdict import two_digits
from tumble.segmentation import HoldMeans
from tumble.segmentation.rest_wander import disturbed_holds


def poses_apart(force: PlacedFit, names: Sequence[str]) -> list[str]:
    """Name the poses that alone contradict the others.

    Parameters
    ----------
    force : the fit.
    names : of its readings.
    """
    if not force.apart:
        return []
    away = two_digits(float(np.degrees(np.max(force.readings.sigma[list(force.apart)]))))
    which = " or that of ".join(names[k] for k in force.apart)
    sentence = (
        f"The pose of {which} is off by about {away}°: the others agree within the stated {_stated(force)}. The "
        "uncertainties count it there alone; place the unit anew in it for a better result."
    )
    return [sentence]


def beyond_statement(force: PlacedFit) -> list[str]:
    """Object to a placement that is not at all what the protocol states.

    Parameters
    ----------
    force : the fit.
    """
    if not force.is_beyond_statement:
        return []
    sentence = (
        f"The poses contradict one another by about {two_digits(float(np.degrees(force.added)))}°, where the protocol "
        f"states {_stated(force)}; {force.adjustment.redundancy} checks are too few to go by that. Level the "
        "plate, place the unit anew, or state how well it was placed (`uncertainty_deg`)."
    )
    return [sentence]


def moved_while_held(means: HoldMeans, holds: np.ndarray, names: Sequence[str]) -> list[str]:
    """Object to holds during which the unit was moved: their means are of two poses, and of the motion between.

    Parameters
    ----------
    means : of all holds.
    holds, names : those in known poses.
    """
    parts = means.parts
    if parts is None:
        return []
    found: set[int] = set()
    for signal, white in ((parts.force, parts.force_white), (parts.rate, parts.rate_white)):
        if signal is not None and np.all(white > 0.0):
            found |= set(disturbed_holds(parts, signal, white).tolist())
    which = [
        f"{name} (hold {hold + 1})" for hold, name in zip(holds.tolist(), names, strict=True) if hold in found
    ]
    if not which:
        return []
    sentence = (
        f"The unit moved while it was held in {', '.join(which)}: what it shows there is of two poses and of the "
        "motion between. Hold it again, and leave it alone meanwhile."
    )
    return [sentence]


def _stated(force: PlacedFit) -> str:
    return f"{np.degrees(float(np.sqrt(np.mean(force.stated**2)))):.2g}°"
