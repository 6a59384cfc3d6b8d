"""What a recording does not tell the joint estimator, from its information matrix, in words.

The normal matrix of all unknowns is made where the estimate starts; nothing is adjusted for it. What it leaves less
certain than half of what a unit's name plate promises is not told by the motion: such unknowns keep the name
plate's value and uncertainty, so that what is told does not take their error on, and are named, with the pose
or the turn that would tell them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tumble.arrays import Square, inverted
from tumble.calibration.equations.imu_unknowns import FORCE_ALONE, LAYOUT, NAME_PLATE_SHARE, PLAIN, name_plate
from tumble.calibration.prior import FleetSheet, StableKnowledge, gyro_prior, prior_of_sheet
from tumble.estimation import Prior, find_weak_directions
from tumble.estimation.unknowns import Unknowns
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.simulation import Grade
from tumble.units import angular_rate_factor, specific_force_factor

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
    leading : indices of what each combination that is not told is made of, in sizes of the name plate, worst first.
    """

    unknowns: np.ndarray
    leading: list[list[int]]

    def sentences(self, among: np.ndarray | None = None) -> list[str]:
        """Return in words what is not told, with what would tell each.

        Parameters
        ----------
        among : indices of unknowns that each combination has to have one of; None for all.
        """
        found = [own for own in self.leading if among is None or np.any(np.isin(own, among))]
        said = [_in_words(own) for own in found[:MOST_COMBINATIONS]]
        if len(found) > MOST_COMBINATIONS:
            said.append(f"Not determined: {len(found) - MOST_COMBINATIONS} more combinations like these.")
        return list(dict.fromkeys(said))


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
    return Untold(free[without], [[int(free[i]) for i in one.leading()] for one in directions])


def name_plate_prior(u: Unknowns, recording: Recording) -> Prior:
    """Return what the name plate knows of the free unknowns: nominal ones, of counts as they start.

    Parameters
    ----------
    u : start values.
    recording : its units.
    """
    precision, mean = np.zeros((u.values.size, u.values.size)), u.copy()
    at = np.intersect1d(u.free, PLAIN)
    precision[at, at] = 1.0 / name_plate(u)[at] ** 2
    force = specific_force_factor(recording.specific_force_unit)
    rate = angular_rate_factor(recording.angular_rate_unit)
    if force is not None:
        mean["force.bias"][:], mean["force.scale"][:], mean["force.angle"][:] = 0.0, 1.0 / force, 0.0
    if rate is not None:
        mean["gyro.bias"][:], mean["gyro.matrix"][:] = 0.0, np.eye(3).ravel() / rate
    return Prior(mean.values, precision)


class TriadSheet(NamedTuple):
    """What a sheet knows of a triad: its name, where its unknowns are, what is known of them, and of its own nine."""

    name: str
    place: np.ndarray
    prior: Prior
    nine: Prior


def triad_sheets(sheet: Grade | FleetSheet | None, recording: Recording) -> list[TriadSheet]:
    """Return what a sheet knows of each triad.

    Parameters
    ----------
    sheet, recording : what is known of the kind of unit, None for nothing, and the recording's units.

    Raises
    ------
    UsageError
        If a data sheet is to speak of raw counts, or a fleet of other raw units than its own.
    """
    made: list[TriadSheet] = []
    if sheet is None:
        return made
    force = prior_of_sheet(sheet, "accelerometer", recording.specific_force_unit)
    if force is not None:
        made.append(TriadSheet("accelerometer", FORCE_ALONE, force, force))
    rate = prior_of_sheet(sheet, "gyroscope", recording.angular_rate_unit)
    if rate is not None:
        place = LAYOUT.indices("gyro.matrix", "gyro.bias")
        made.append(TriadSheet("gyro", place, Prior(*gyro_prior(rate, NAME_PLATE_SHARE)), rate))
    return made


def sheets_prior(u: Unknowns, sheets: Sequence[TriadSheet]) -> Prior | None:
    """Return what data sheets know of the free unknowns; None where they know nothing.

    Parameters
    ----------
    u, sheets : start values, and what is known of triads.
    """
    precision, mean = np.zeros((u.values.size, u.values.size)), u.values.copy()
    own = [one for one in sheets if np.all(np.isin(one.place, u.free))]
    for one in own:
        mean[one.place], precision[np.ix_(one.place, one.place)] = one.prior.mean, one.prior.precision
    return Prior(mean, precision) if own else None


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
    """
    if first is None or second is None:
        return second if first is None else first
    precision = first.precision + second.precision
    right = first.precision @ first.mean + second.precision @ second.mean
    known = np.flatnonzero(np.diag(precision) > 0.0)
    mean = first.mean.copy()
    scale = 1.0 / np.sqrt(np.diag(precision)[known])
    own = precision[np.ix_(known, known)] * np.outer(scale, scale)
    mean[known] = scale * (np.linalg.pinv(own, hermitian=True) @ (scale * right[known]))
    return Prior(mean, precision)


def _in_words(indices: list[int]) -> str:
    named = [LAYOUT.label(i) for i in indices[:4]]
    what = named[0] if len(named) == 1 else "a combination of " + ", ".join(named[:-1]) + " and " + named[-1]
    if len(indices) > 4:
        what += f" with {len(indices) - 4} more"
    mended = list(dict.fromkeys(LAYOUT.remedy(i) for i in indices))[:2]
    return f"Not determined by the motion: {what}. What would determine it: {'; or '.join(mended)}."
