"""What a recording does not tell the joint estimator, from its information matrix, in words.

The normal matrix of all unknowns is made where the estimate starts; nothing is adjusted for it. What it leaves less
certain than half of what a unit's name plate promises is not told by the motion: such unknowns keep the name
plate's value and uncertainty, so that what is told does not take their error on, and are named, with the pose
or the turn that would tell them.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Square, inverted
from tumble.calibration.equations.imu_unknowns import LAYOUT, name_plate
from tumble.calibration.prior import StableKnowledge
from tumble.errors import ObservabilityError
from tumble.estimation import Prior, find_weak_directions
from tumble.estimation.unknowns import Unknowns
from tumble.estimation.weak_directions import WeakDirection
from tumble.records import dataclass

# An unknown is told if its sigma is below this share of the name plate's.
TOLD = 0.5
# More combinations than this are not read by anybody.
MOST_COMBINATIONS = 6


@dataclass(frozen=True, slots=True)
class Untold:
    """What the motion does not tell.

    Attributes
    ----------
    unknowns : indices that are not told.
    directions : combinations that are not told, in sizes of the name plate, worst first.
    sentences : the same in words, with what would tell each.
    """

    unknowns: np.ndarray
    directions: list[WeakDirection]
    sentences: list[str]


def find_untold(normal: Square, u: Unknowns) -> Untold | None:
    """Return what an information matrix leaves untold; None if everything is told.

    Parameters
    ----------
    normal : (free, free) information of the free unknowns, whatever is believed beforehand included.
    u : start values.
    """
    free = u.free
    sizes = name_plate(u)[free]
    scaled = normal * np.outer(sizes, sizes)
    posterior = np.diag(np.linalg.inv(scaled + np.eye(free.size)))
    # sigma² / (sigma² + size²) of what the motion alone determines
    without = posterior > TOLD**2 / (1.0 + TOLD**2)
    directions = find_weak_directions(normal, sizes, TOLD)
    if not np.any(without) and not directions:
        return None
    sentences = [_in_words(direction, free) for direction in directions[:MOST_COMBINATIONS]]
    if len(directions) > MOST_COMBINATIONS:
        sentences.append(
            f"Not determined: {len(directions) - MOST_COMBINATIONS} more combinations like these."
        )
    return Untold(free[without], directions, list(dict.fromkeys(sentences)))


def name_plate_prior(u: Unknowns) -> Prior:
    """Return what the name plate knows of the free unknowns, about their start values.

    Parameters
    ----------
    u : start values.
    """
    precision = np.zeros((u.values.size, u.values.size))
    precision[u.free, u.free] = 1.0 / name_plate(u)[u.free] ** 2
    return Prior(u.values.copy(), precision)


def angle_prior(u: Unknowns, knowledge: StableKnowledge | None) -> Prior | None:
    """Return what an earlier calibration knows of the accelerometers' angles as a prior; None without one.

    Parameters
    ----------
    u : all unknowns.
    knowledge : of the angles.
    """
    if knowledge is None:
        return None
    place, mean = u.layout["force.angle"], u.values.copy()
    precision = np.zeros((mean.size, mean.size))
    mean[place] = knowledge.angles
    precision[place, place] = inverted(knowledge.angle_covariance)
    return Prior(mean, precision)


def together(first: Prior | None, second: Prior | None) -> Prior | None:
    """Return two priors as one.

    Parameters
    ----------
    first, second : of the same unknowns, or None.

    Raises
    ------
    ObservabilityError
        If one knows of other unknowns than the other.
    """
    if first is None or second is None:
        return second if first is None else first
    if first.mean.size != second.mean.size:
        raise ObservabilityError("Two kinds of prior knowledge are of different unknowns.")
    precision = first.precision + second.precision
    right = first.precision @ first.mean + second.precision @ second.mean
    known = np.flatnonzero(np.diag(precision) > 0.0)
    mean = first.mean.copy()
    scale = 1.0 / np.sqrt(np.diag(precision)[known])
    own = precision[np.ix_(known, known)] * np.outer(scale, scale)
    mean[known] = scale * (np.linalg.pinv(own, hermitian=True) @ (scale * right[known]))
    return Prior(mean, precision)


def _in_words(direction: WeakDirection, free: np.ndarray) -> str:
    leading = direction.leading()
    indices = [int(free[i]) for i in leading]
    named = [LAYOUT.label(i) for i in indices[:4]]
    what = named[0] if len(named) == 1 else "a combination of " + ", ".join(named[:-1]) + " and " + named[-1]
    if len(indices) > 4:
        what += f" with {len(indices) - 4} more"
    mended = list(dict.fromkeys(LAYOUT.remedy(i) for i in indices))[:2]
    return f"Not determined by the motion: {what}. What would determine it: {'; or '.join(mended)}."
