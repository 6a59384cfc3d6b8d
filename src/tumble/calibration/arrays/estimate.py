"""The adjustment of an array as an estimate of each unit, with mountings and what the common poses are worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.attitude.rotations import rotation_vector_from_matrix
from tumble.calibration.arrays.adjustment import ArraySolution
from tumble.calibration.arrays.slips import Slip, find_slips
from tumble.calibration.checks.scores import hold_norm_errors, score_turns
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import Beside, Estimate, coverage_factor
from tumble.calibration.evidence import Budget, Holds, Turns
from tumble.calibration.outcome.budget import wander_factors
from tumble.calibration.outcome.description import describe
from tumble.calibration.terms.lever_arms import lever_arms_of
from tumble.earth import Site
from tumble.records import dataclass

# Units that are said to have moved against one another though they did not.
FALSE_ALARM = 1e-3
# Attitudes that disagree by twice what the units' own residuals explain are no models' alone.
MOST_UNLIKE = 4.0
# Standard uncertainties that shrink by less than this share are hardly worth another unit.
WORTH_IT = 0.05
GROUPS = (
    "accelerometer bias",
    "accelerometer scale factor",
    "accelerometer non-orthogonality",
    "gyro bias",
    "gyro scale factor",
    "gyro non-orthogonality",
    "rotation between the triads",
    "g-sensitivity",
)


@dataclass(frozen=True, slots=True)
class MountedUnit:
    """One unit of an array.

    Attributes
    ----------
    name : of its recording.
    C_1b : (3, 3) from its axes to the first unit's.
    rotation, sigma : (3,) rad, the same as a rotation vector, and standard uncertainties of small rotations about the
        first unit's axes; zeros of the first unit itself.
    gain : group of parameters -> standard uncertainty with the array over that of the unit alone, geometric mean.
    """

    name: str
    C_1b: Matrix
    rotation: Vector
    sigma: Vector
    gain: dict[str, float]


@dataclass(frozen=True, slots=True)
class ArrayEstimate:
    """What an array's common poses make of its units.

    Attributes
    ----------
    estimates : of each unit.
    units : how each sits against the first, and what it gains.
    chi_square, degrees, probability : of what common poses add to the residuals of units that are fixed to one another.
    slips : units that turned against the first one.
    """

    estimates: list[Estimate]
    units: list[MountedUnit]
    chi_square: float
    degrees: int
    probability: float
    slips: list[Slip] = field(default_factory=list[Slip])

    @property
    def is_rigid(self) -> bool:
        """Whether chance, or what the units' models leave, explains by how much their attitudes disagree."""
        return not self.slips and (not self.is_unlike or self.chi_square <= MOST_UNLIKE * self.degrees)

    @property
    def is_unlike(self) -> bool:
        """Whether the units' attitudes disagree by more than their own residuals explain."""
        return self.probability < FALSE_ALARM


def array_estimate(solution: ArraySolution, alone: Sequence[Estimate], site: Site) -> ArrayEstimate:
    """Return the adjustment as estimates.

    Parameters
    ----------
    solution : settled.
    alone : what each unit's recording made by itself.
    site : gravity.
    """
    from scipy.special import chdtrc

    squares, degrees = _added(solution)
    probability = float(chdtrc(degrees, squares)) if degrees > 0 else 1.0
    estimates = [_estimate(solution, k, own, site) for k, own in enumerate(alone)]
    units = [
        MountedUnit(unit.name, unit.C_1b, *_mounting(solution, k), _gains(estimates[k], alone[k]))
        for k, unit in enumerate(solution.units)
    ]
    made = ArrayEstimate(estimates, units, squares, degrees, probability, find_slips(solution))
    for estimate, unit in zip(estimates, units, strict=True):
        estimate.say("remark", _of_gain(len(units), unit))
        if not made.is_rigid:
            estimate.say("objection", _loose(made))
        elif made.is_unlike:
            estimate.say("caution", _unlike(made))
    return made


def _loose(array: ArrayEstimate) -> str:
    """What is said of units that are not fixed to one another."""
    first = array.units[0].name
    turned = " ".join(
        f"{slip.name} turned by {np.degrees(slip.angle):.2g}° against {first} before hold {slip.hold + 1}."
        for slip in array.slips
    )
    return (
        "The units did not keep their places against one another, or their clocks differ. "
        f"{turned}{' ' * bool(turned)}Common poses add {array.chi_square:.0f} to the sum of squares, {array.degrees} "
        "are expected. Fix them, or calibrate each by itself."
    )


def _unlike(array: ArrayEstimate) -> str:
    """What is said of units that stay where they are and see a little more apart than they should."""
    return (
        f"The units' attitudes disagree by {np.sqrt(array.chi_square / array.degrees):.2g} times what their own "
        f"residuals explain, and no unit turned against the others. Common poses add {array.chi_square:.0f} to the sum "
        f"of squares, {array.degrees} are expected. It is what the units' models leave in each pose, and the stated "
        "uncertainties count it."
    )


def _scale(solution: ArraySolution) -> float:
    """Variance of unit weight, 1 at least: of everything, or of what common poses add if that is more than chance."""
    from scipy.special import chdtrc

    whole = max(1.0, solution.square_sum / solution.redundancy) if solution.redundancy > 0 else 1.0
    squares, degrees = _added(solution)
    unlike = degrees > 0 and float(chdtrc(degrees, squares)) < FALSE_ALARM
    return max(whole, squares / degrees) if unlike else whole


def _added(solution: ArraySolution) -> tuple[float, int]:
    """Square sum and degrees of freedom that common poses add to those of the units by themselves."""
    squares = max(solution.square_sum - solution.alone_sum, 0.0)
    return squares, solution.redundancy - solution.alone_redundancy


def _estimate(solution: ArraySolution, index: int, alone: Estimate, site: Site) -> Estimate:
    unit = solution.units[index]
    outcome, u = unit.outcome, unit.task.unknowns
    place = solution.place(index)
    # What the unit alone says of biases that wander holds of it among others.
    factors = wander_factors(outcome.task)
    own = np.outer(factors, factors) * solution.covariance[place, place]
    values, covariance = u.values, u.expanded(_scale(solution) * own)
    described = describe(
        *(values, covariance, site, outcome.recording),
        terms=outcome.kept,
        gyro="full",
        all_told=True,
    )
    base = outcome.data.base
    sigma0 = (
        float(np.sqrt(solution.square_sum / solution.redundancy)) if solution.redundancy > 0 else float("nan")
    )
    return replace(
        alone,
        model=described.model,
        names=described.names,
        covariance=described.covariance,
        parameters=described.parameters,
        correlations=described.correlations,
        sigma0_final=sigma0,
        degrees_of_freedom=solution.redundancy,
        coverage_factor=coverage_factor(solution.redundancy),
        terms=list(alone.terms),
        said=list(alone.said),
        evidence=[
            *(one for one in alone.evidence if not isinstance(one, Holds | Turns | Budget | Beside)),
            replace(alone.holds, norms=hold_norm_errors(described.model, base.force_mean, site.gravity)),
            replace(alone.turns, angles=score_turns(described.model, base).angle),
        ],
        lever_arms=lever_arms_of(values[LAYOUT["lever_arms"]], outcome.kept, np.eye(3)),
    )


def _mounting(solution: ArraySolution, index: int) -> tuple[Vector, Vector]:
    if index == 0:
        return np.zeros(3), np.zeros(3)
    place = solution.mounting_place(index)
    sigma = np.sqrt(_scale(solution) * np.diag(solution.covariance)[place])
    return rotation_vector_from_matrix(solution.units[index].C_1b), sigma


def _gains(estimate: Estimate, alone: Estimate) -> dict[str, float]:
    before = {p.name: p.standard_uncertainty for p in alone.parameters}
    made: dict[str, float] = {}
    for group in GROUPS:
        ratios = [
            p.standard_uncertainty / before[p.name]
            for p in estimate.parameters
            if p.name.startswith(group) and before.get(p.name, 0.0) > 0.0
        ]
        if ratios:
            made[group] = float(np.exp(np.mean(np.log(ratios))))
    return made


def _of_gain(count: int, unit: MountedUnit) -> str:
    """What the common poses are worth to a unit, in a sentence."""
    best = min(unit.gain, key=lambda group: unit.gain[group])
    mean = float(np.exp(np.mean(np.log(list(unit.gain.values())))))
    others = "other unit" if count == 2 else f"{count - 1} other units"
    told = f"Adjusted with the {others} of the array, whose poses are its own but for a rotation"
    if mean > 1.0 - WORTH_IT:
        return (
            f"{told}: hardly anything is gained, standard uncertainties are {mean:.2f} times (geometric mean over the "
            "groups) those of the unit alone."
        )
    return (
        f"{told}: standard uncertainties are {mean:.2f} times (geometric mean over the groups) those of the unit "
        f"alone, of {best} {unit.gain[best]:.2f} times."
    )
