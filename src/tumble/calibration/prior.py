"""What is known before a recording, by an earlier calibration or a data sheet, and what the recording leaves untold.

Biases and scale factors change with every power cycle and with temperature; the angles between the sensing axes are
set by the assembly and stay (Hayal, chapter 6). An earlier calibration therefore gives its non-orthogonalities, with
their covariance, and nothing else.

A data sheet's one-sigma spreads are a prior of the nine unknowns of a triad: the stochastic constraint P of Shin and
El-Sheimy (Hayal 2010, after 3.38: N = A' C^-1 A + P). It lets few poses, or a gyro that hardly sees the Earth's rate,
tell what they can; the rest stays what the sheet says, and that is said. A maker who has calibrated many units knows
more than a sheet: their mean, and how they differ (`FleetSheet`).

What a recording does not tell follows from the normal matrix of all unknowns, made where the estimate starts. What it
leaves less certain than half of what a unit's name plate promises is not told by the motion: such unknowns keep the
name plate's value and uncertainty, so that what is told does not take their error on, and are named, with the pose or
the turn that would tell them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tumble.arrays import Matrix, Series, Square, Vector, inverted
from tumble.calibration.equations.imu_unknowns import FORCE_ALONE, LAYOUT, NAME_PLATE_SHARE, PLAIN, name_plate
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, SCALE
from tumble.errors import CalibrationFileError, UsageError
from tumble.estimation import Prior, Unknowns, find_weak_directions, invert_normal_matrix
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.sensor import lower_factor, matrix_from_shin, propagate, shin_from_matrix
from tumble.simulation import Grade, TriadGrade
from tumble.units import angular_rate_factor, specific_force_factor

# Of a prior's sigma: more than this left, and the recording has told next to nothing of the parameter.
UNTOLD_BEYOND = 0.9
# The estimate is off the sheet by more than this: one in 150,000 of its units.
LARGEST_NORMALISED = 4.5
NAMES = [
    *(f"bias {axis}" for axis in "xyz"),
    *(f"scale factor {axis}" for axis in "xyz"),
    *(f"non-orthogonality {angle}" for angle in ("yz", "zx", "zy")),
]


def sheet_prior(spread: TriadGrade, factor: float) -> Prior:
    """Return the prior of a triad's nine unknowns from its data sheet.

    Parameters
    ----------
    spread : one-sigma spreads, SI.
    factor : SI per raw unit.

    Notes
    -----
    An angle between two sensing axes has twice the variance of each axis' misalignment about one
    direction.
    """
    mean, sigma = np.zeros(9), np.empty(9)
    mean[SCALE] = 1.0 / factor
    sigma[BIAS] = spread.bias / factor
    sigma[SCALE] = spread.scale_factor / factor
    sigma[ANGLE] = np.sqrt(2.0) * spread.misalignment
    return Prior(mean, np.diag(sigma**-2))


@dataclass(frozen=True)
class TriadFleet:
    """How triads of a fleet differ.

    Attributes
    ----------
    unit : of raw numbers.
    mean, covariance : (9,), (9, 9) of a next unit's biases, scale factors and angles, raw.
    """

    unit: str
    mean: Series
    covariance: Square

    @staticmethod
    def of(unit: str, matrix: Matrix, bias: Vector, covariance: Square) -> TriadFleet:
        """Return it from a mean matrix and bias, and the covariance (12, 12) of the matrix, row by row, and the bias.

        Parameters
        ----------
        unit, matrix, bias, covariance : raw units; in whatever frame: what counts is how the axes lie to one another.
        """

        def unknowns(x: np.ndarray) -> np.ndarray:
            scale, angles = shin_from_matrix(lower_factor(x[:9].reshape(3, 3)))
            return np.concatenate([x[9:], scale, angles])

        mean, spread = propagate(unknowns, np.concatenate([matrix.ravel(), bias]), covariance)
        return TriadFleet(unit, np.real(mean), spread)


@dataclass(frozen=True)
class FleetSheet:
    """What a fleet's own calibrations say of its next unit; a triad that they know nothing of is None."""

    accelerometer: TriadFleet | None
    gyroscope: TriadFleet | None

    def prior(self, kind: str, unit: str) -> Prior | None:
        """Return the prior of a triad's nine unknowns; None where the fleet says nothing of it.

        Parameters
        ----------
        kind : "accelerometer" or "gyroscope".
        unit : of the recording's raw numbers.

        Raises
        ------
        UsageError
            If the fleet's raw unit cannot be told in the recording's.
        """
        fleet: TriadFleet | None = getattr(self, kind)
        if fleet is None:
            return None
        raw = np.ones(9)
        if fleet.unit != unit:
            factor_of = specific_force_factor if kind == "accelerometer" else angular_rate_factor
            here, there = factor_of(unit), factor_of(fleet.unit)
            if here is None or there is None:
                raise UsageError(
                    f"The fleet's {kind}s are in {fleet.unit} and the recording's in {unit}: a fleet serves "
                    "recordings in its own raw units."
                )
            raw[:6] = there / here
        mean, covariance = raw * fleet.mean, fleet.covariance * np.outer(raw, raw)
        return Prior(mean, invert_normal_matrix(covariance))


def prior_of_sheet(sheet: Grade | FleetSheet, kind: str, unit: str) -> Prior | None:
    """Return the prior of a triad's nine unknowns, from a data sheet or from a fleet; None where it says nothing.

    Parameters
    ----------
    sheet : the one or the other.
    kind, unit : as for `FleetSheet.prior`.

    Raises
    ------
    UsageError
        If a data sheet is to speak of raw counts, or a fleet of other raw units than its own.
    """
    if isinstance(sheet, FleetSheet):
        return sheet.prior(kind, unit)
    factor = (specific_force_factor if kind == "accelerometer" else angular_rate_factor)(unit)
    if factor is None:
        raise UsageError(
            "A data sheet speaks of SI units, and the recording is in counts: declare its units with --units, "
            "or leave --prior out."
        )
    return sheet_prior(getattr(sheet, kind), factor)


def gyro_prior(nine: Prior, leaning: float) -> tuple[Series, Square]:
    """Return (12,), (12, 12) mean and precision of a gyro's matrix, row by row, and its bias in another triad's frame.

    Parameters
    ----------
    nine : of bias, scale factors and angles in the gyro's own frame.
    leaning : rad, one sigma of the rotation between the triads about each axis.
    """

    def entries(x: np.ndarray) -> np.ndarray:
        turned = np.eye(3) + np.array([[0.0, -x[11], x[10]], [x[11], 0.0, -x[9]], [-x[10], x[9], 0.0]])
        return np.concatenate([(matrix_from_shin(x[SCALE], x[ANGLE]) @ turned).ravel(), x[BIAS]])

    spread = np.diag(np.full(12, leaning**2))
    spread[:9, :9] = invert_normal_matrix(nine.precision)
    mean, covariance = propagate(entries, np.concatenate([nine.mean, np.zeros(3)]), spread)
    return np.real(mean), invert_normal_matrix(covariance)


def about_sheet(
    sheet: TriadSheet, values: Series, sigmas: Series, share: float = 0.0, *, alone: bool = False
) -> tuple[list[str], list[str]]:
    """Return what the recording left to the sheet, and what contradicts it, as sentences.

    Parameters
    ----------
    sheet : of the triad.
    values, sigmas : (9,) estimates, and their standard uncertainties.
    share : by which all scale factors may be wrong alike besides, as clock or gravity are.
    alone : they were made without the sheet, which otherwise is in them.
    """
    before = np.sqrt(np.diag(np.linalg.inv(sheet.nine.precision)))
    untold = ~np.bool_(alone) & (sigmas > UNTOLD_BEYOND * before)
    remarks, objections = list[str](), list[str]()
    if np.any(untold):
        remarks.append(
            f"Of the {sheet.name}s the recording determines next to nothing of "
            f"{', '.join(np.array(NAMES)[untold])}: the values and their uncertainties are the data sheet's."
        )
    # With the sheet in it an estimate differs from it with the variance that the data took away; else with both.
    variance = before**2 + np.where(alone, 1.0, -1.0) * sigmas**2
    variance[SCALE] += (share * values[SCALE]) ** 2
    off = np.abs(values - sheet.nine.mean) / np.sqrt(np.maximum(variance, (1e-6 * before) ** 2))
    worst = int(np.argmax(np.where(untold, 0.0, off)))
    if off[worst] > LARGEST_NORMALISED and not untold[worst]:
        objections.append(
            f"These numbers do not fit {sheet.whose}: the {sheet.name}'s {NAMES[worst]} is {off[worst]:.0f} of its "
            "standard deviations off. Name another kind with --prior, or none; or a unit or column is wrong."
        )
    return remarks, objections


@dataclass(frozen=True)
class StableKnowledge:
    """Accelerometer angles yz, zx, zy (rad) with their covariance (3, 3)."""

    angles: Vector
    angle_covariance: Square


def stable_knowledge(matrix: np.ndarray, covariance: Square) -> StableKnowledge:
    """Return the angles of an accelerometer matrix with the covariance of its nine entries.

    Raises
    ------
    CalibrationFileError
        If the covariance determines nothing of the angles.
    """
    angles, spread = propagate(
        lambda x: shin_from_matrix(lower_factor(x.reshape(3, 3)))[1], matrix.ravel(), covariance
    )
    if not np.all(np.diag(spread) > 0):
        raise CalibrationFileError(
            "The calibration given as prior states no uncertainty for its non-orthogonalities, "
            "so that it cannot be weighed: give one that has a covariance of the accelerometer matrix."
        )
    return StableKnowledge(np.real(angles), spread)


# Chance of objecting to a prior that is the unit's own.
CONTRADICTION_FALSE_ALARM = 1e-3


def find_contradiction(prior: StableKnowledge, seen: Sequence[StableKnowledge]) -> str | None:
    """Return a sentence if what recordings of one unit tell together contradicts the prior (chi-square, 3 degrees)."""
    from scipy.special import chdtrc

    weights = [inverted(own.angle_covariance) for own in seen]
    own = inverted(np.sum(weights, axis=0))
    difference = own @ sum(w @ one.angles for w, one in zip(weights, seen, strict=True)) - prior.angles
    spread = own + prior.angle_covariance
    statistic = float(difference @ np.linalg.solve(spread, difference))
    if float(chdtrc(3.0, statistic)) >= CONTRADICTION_FALSE_ALARM:
        return None
    worst = float(np.max(np.abs(difference) / np.sqrt(np.diag(spread))))
    return (
        "The prior contradicts the recording: its non-orthogonalities differ from those of these "
        f"poses by up to {1e3 * np.max(np.abs(difference)):.2g} mrad, {worst:.0f} standard "
        f"uncertainties. It is another unit's, or this unit has been dropped: calibrate without --prior."
    )


# An unknown is told if its sigma is below this share of the name plate's.
TOLD = 0.5
# More combinations than this are not read by anybody.
MOST_COMBINATIONS = 6


@dataclass(frozen=True)
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
    """What a sheet knows of a triad: its name, what unit it is of, where its unknowns are, what is known."""

    name: str
    whose: str
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
    whose = "a unit of this fleet" if isinstance(sheet, FleetSheet) else f"the kind {sheet.name}"
    force = prior_of_sheet(sheet, "accelerometer", recording.specific_force_unit)
    if force is not None:
        made.append(TriadSheet("accelerometer", whose, FORCE_ALONE, force, force))
    rate = prior_of_sheet(sheet, "gyroscope", recording.angular_rate_unit)
    if rate is not None:
        place = LAYOUT.indices("gyro.matrix", "gyro.bias")
        made.append(TriadSheet("gyro", whose, place, Prior(*gyro_prior(rate, NAME_PLATE_SHARE)), rate))
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
