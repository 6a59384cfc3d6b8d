"""Several recordings of one unit in one adjustment: what is stable is common, biases are each recording's own.

A unit is one more level of the chain: its border are the stable unknowns and each recording's own ones, bias and
fixture, and a recording is a chain within it that knows its part of that border. Attitudes, Earth rates, variance
components and outliers of a recording stay its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.checks.observability import angle_prior, name_plate_prior
from tumble.calibration.checks.observability import together as both_priors
from tumble.calibration.equations.adjustment import NODE, JointAdjustment, balance_recording
from tumble.calibration.equations.imu_unknowns import LAYOUT, name_plate, terms_prior
from tumble.calibration.equations.pose_equations import mounting_prior
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Prior
from tumble.estimation.balance import Balanced, Outlier
from tumble.estimation.chain import Chain, Eliminated, Place, Spread, Stretch
from tumble.estimation.equations import Equations
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.estimation.settled import Settled
from tumble.estimation.solve import linearise, solve
from tumble.estimation.unknowns import Block, Layout, Unknowns
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.outcome.estimate import JointOutcome

OWN = LAYOUT.indices("force.bias", "gyro.bias", "fixture")
"""Unknowns of a recording alone: biases change when the unit is switched on, the fixture when it is placed."""
# Eigenvalues of an information matrix of unit diagonal below this are round-off of the others.
NOTHING = 1e-12


@dataclass(slots=True)
class TurnOn:
    """One recording of the unit, from when it was switched on.

    Attributes
    ----------
    name : of the recording, for words.
    outcome : of its own joint adjustment, without the others.
    task : its equations.
    solution : of the last step.
    scale : variance of unit weight of its residuals, 1 at least: what its observations weigh less.
    balanced : its variances and outliers with these unknowns; None before they were found.
    """

    name: str
    outcome: JointOutcome
    task: JointAdjustment
    solution: Settled
    scale: float = 1.0
    balanced: Balanced | None = None

    @staticmethod
    def of(name: str, outcome: JointOutcome) -> TurnOn:
        """Return a recording that was adjusted by itself; the outcome stays as it is."""
        solution = outcome.balanced.solution
        return TurnOn(name, outcome, outcome.task.copy(), solution, solution.unit_weight)

    @property
    def free(self) -> np.ndarray:
        """Indices of the unknowns that are adjusted."""
        return self.task.unknowns.free

    @property
    def values(self) -> Series:
        """Where all its unknowns are."""
        return self.task.unknowns.values

    @property
    def stable(self) -> np.ndarray:
        """Which of its unknowns the others share."""
        return np.setdiff1d(self.free, OWN)

    @property
    def own(self) -> np.ndarray:
        """Which of its unknowns are its own."""
        return np.intersect1d(self.free, OWN)

    @property
    def given(self) -> Prior | None:
        """What is believed of it without the others, and without any name plate."""
        u = self.task.unknowns
        mounting = None if self.task.data.poses is None else mounting_prior(u)
        levers, angles = terms_prior(u), angle_prior(u, self.outcome.knowledge)
        return both_priors(both_priors(mounting, levers), angles)

    @property
    def outliers(self) -> list[Outlier]:
        """What was left out of it, with its first unknowns and with these."""
        return [*self.outcome.balanced.outliers, *(self.balanced.outliers if self.balanced else [])]


@dataclass(frozen=True, slots=True)
class Told:
    """What a recording tells of the stable unknowns, everything of its own eliminated.

    Attributes
    ----------
    precision : (stable, stable) information; rows of unknowns that the recording does not have are zero.
    right : (stable,) precision times its own estimate.
    """

    precision: Square
    right: Series


class UnitStretch:
    """All recordings of a unit, each with its part of the border; its unknowns are no chain's own."""

    nodes, size, own = 0, NODE, 0

    def __init__(self, unit: UnitAdjustment) -> None:
        self.equations: list[Equations] = []
        self.within: list[tuple[Place, Stretch | Eliminated]] = []
        for part, place in zip(unit.parts, unit.places, strict=True):
            task = part.task
            chain = Chain.of(task.stretch(), task.state, part.free.size).eliminated()
            self.within.append((Place(at_border=place, weight=1.0 / part.scale), chain))

    def undetermined(self, node: int) -> str:
        """Say it of the whole: it has no nodes."""
        return "The unit is not determined by its recordings."

    def move(self, nodes: Table, own: Series) -> None:
        """Do nothing: recordings move themselves."""


class UnitAdjustment:
    """Several recordings, adjusted or to be adjusted: a task for `tumble.estimation.solve`.

    Attributes
    ----------
    parts : the recordings; moved.
    stable : indices of the unknowns that are common.
    places : of each recording's free unknowns, where they stand among the unit's.
    unknowns : the stable ones, and then each recording's own.
    prior : what is believed of the recordings without one another, as they weigh.
    told, settled : what each recording tells, and the solution of all, once there is one.
    """

    told: list[Told]
    settled: Settled

    def __init__(self, parts: Sequence[TurnOn]) -> None:
        self.parts, self.places = list(parts), list[np.ndarray]()
        self.stable = np.unique(np.concatenate([part.stable for part in self.parts]))
        size = self.stable.size
        for part in self.parts:
            own = np.isin(part.free, OWN)
            place = np.searchsorted(self.stable, part.free)
            place[own] = size + np.arange(part.own.size)
            size += part.own.size
            self.places.append(place)
        values = np.zeros(size)
        for part, place in zip(reversed(self.parts), reversed(self.places), strict=True):
            values[place] = part.values[part.free]
        layout = Layout((Block("unit", ("",) * size, ("",) * size),))
        self.unknowns = Unknowns(layout, values, np.arange(size))
        self._share()
        self.prior = self._believed()

    @property
    def values(self) -> Series:
        """Where the stable unknowns are."""
        return self.unknowns.values[: self.stable.size]

    def _share(self) -> None:
        """Let the recordings have the unit's unknowns."""
        for part, place in zip(self.parts, self.places, strict=True):
            values = part.values.copy()
            values[part.free] = self.unknowns.values[place]
            part.task.unknowns = part.task.unknowns.at(values)

    @property
    def state(self) -> UnitAdjustment:
        """The unit; each recording's equations are asked at its own."""
        return self

    def _believed(self) -> Prior | None:
        """What is believed of the recordings without one another, as they weigh."""
        total, size = None, self.unknowns.values.size
        for part, place in zip(self.parts, self.places, strict=True):
            if (given := part.given) is not None:
                mean, precision = self.unknowns.values.copy(), np.zeros((size, size))
                mean[place] = given.mean[part.free]
                precision[np.ix_(place, place)] = given.precision[np.ix_(part.free, part.free)] / part.scale
                total = both_priors(total, Prior(mean, precision))
        return total

    def stretch(self) -> UnitStretch:
        """Return everything that was observed."""
        return UnitStretch(self)

    def stepped(self, chain: Eliminated, cofactor: Square) -> bool:
        """Let the recordings follow, and note what a step has changed of what is believed."""
        self._share()
        self.prior, changed = self._believed(), False
        for part, spread in zip(self.parts, Spread(chain, cofactor).within(), strict=True):
            changed = part.task.stepped(spread.chain, spread.outside) or changed
        return changed

    def snapshot(self) -> Callable[[], None]:
        """Return a function that puts everything back where it is now."""
        here, backs = (self.unknowns, self.prior), [part.task.snapshot() for part in self.parts]

        def back() -> None:
            self.unknowns, self.prior = here
            for of_part in backs:
                of_part()

        return back


def solve_several(parts: Sequence[TurnOn]) -> UnitAdjustment:
    """Adjust all recordings together, with their variances as they are.

    Parameters
    ----------
    parts : the recordings; moved.

    Raises
    ------
    ObservabilityError
        If unknowns are not determined by all recordings together.
    ConvergenceError
        If it does not settle.
    """
    unit = UnitAdjustment(parts)
    settled = solve(unit)
    redundancy = -len(settled.cofactor)
    unit.told = [tell(part, unit.stable) for part in unit.parts]
    precision, right = sum(told.precision for told in unit.told), sum(told.right for told in unit.told)
    spreads = Spread(settled.chain, settled.cofactor).within()
    for part, spread, own in zip(unit.parts, spreads, unit.told, strict=True):
        chain, given = spread.chain, part.given
        others = Told(precision - own.precision, right - own.right)
        part.task.prior = _with_others(part, unit.stable, others)
        redundancy += chain.chain.checks + (0 if given is None else given.rank)
        left = chain.chain.checks - part.free.size + part.task.prior.rank
        sums = chain.chain.square_sum, left, settled.iterations
        part.solution = Settled(part.task, part.task.unknowns, chain, spread.outside, *sums)
        if part.balanced is not None:
            part.balanced.solution, part.balanced.tests = part.solution, part.solution.tests()
    unit.settled = replace(settled, redundancy=redundancy)
    return unit


def balance_several(unit: UnitAdjustment) -> UnitAdjustment:
    """Find variances and outliers anew of recordings whose unknowns are no longer those of their own adjustment.

    Each by itself, so that a recording that contradicts the others is not made to agree by larger variances; with its
    name plate only where it does not tell the unit alone. Where it does not settle, the variances stay those of its
    own adjustment.

    Parameters
    ----------
    unit : settled; its parts are moved.

    Raises
    ------
    ObservabilityError, ConvergenceError
        From the adjustment of all.
    """
    for part in unit.parts:
        alone, as_settled = part.outcome.untold is None, part.task.copy()
        part.balanced = replace(part.outcome.balanced, outliers=[])
        if alone and np.array_equal(part.free, part.outcome.task.unknowns.free):
            continue
        plate = None if alone else name_plate_prior(part.task.unknowns, part.outcome.recording)
        part.task.prior = both_priors(part.given, plate)
        try:
            part.balanced = balance_recording(part.task)
        except (ObservabilityError, ConvergenceError):
            part.task = as_settled
            continue
        part.scale = part.balanced.solution.unit_weight
    return solve_several(unit.parts)


def _with_others(part: TurnOn, stable: np.ndarray, others: Told) -> Prior:
    """What is believed of a settled recording, and what the others tell of its unknowns whatever the rest is."""
    place, here, at = np.searchsorted(stable, part.stable), part.values, part.stable
    rest = np.setdiff1d(np.flatnonzero(np.diag(others.precision) > 0.0), place)
    told, right = others.precision[np.ix_(place, place)], others.right[place]
    if rest.size:
        across = others.precision[np.ix_(place, rest)]
        across = across @ invert_normal_matrix(others.precision[np.ix_(rest, rest)])
        told = told - across @ others.precision[np.ix_(rest, place)]
        right = right - across @ others.right[rest]
    given = part.given or Prior(np.zeros(here.size), np.zeros((here.size, here.size)))
    precision, pull = given.precision.copy(), given.precision @ (given.mean - here)
    # The recording's own equations are as they were observed; the others' are weighed against them.
    precision[np.ix_(at, at)] += part.scale * told
    pull[at] += part.scale * (right - told @ here[at])
    size = np.sqrt(np.diag(precision))
    scale = np.divide(1.0, size, out=np.zeros(size.size), where=size > 0.0)
    scaled = np.linalg.pinv(precision * np.outer(scale, scale), rcond=NOTHING, hermitian=True)
    return Prior(here + scale * (scaled @ (scale * pull)), precision)


def tell(part: TurnOn, stable: np.ndarray) -> Told:
    """Return what a recording tells of the stable unknowns at its state.

    Parameters
    ----------
    part : the recording.
    stable : indices of the unknowns that all share.

    Raises
    ------
    ObservabilityError
        If its own unknowns are not determined even with the others known.
    """
    _, normal, gradient = linearise(replace(part.task, prior=part.given))
    normal, gradient = normal / part.scale, gradient / part.scale
    at, own = np.isin(part.free, part.stable), np.isin(part.free, part.own)
    across = normal[np.ix_(at, own)] @ invert_normal_matrix(normal[np.ix_(own, own)])
    reduced = normal[np.ix_(at, at)] - across @ normal[np.ix_(own, at)]
    place = np.searchsorted(stable, part.stable)
    precision, right = np.zeros((stable.size, stable.size)), np.zeros(stable.size)
    precision[np.ix_(place, place)] = 0.5 * (reduced + reduced.T)
    right[place] = reduced @ part.values[part.stable] - (gradient[at] - across @ gradient[own])
    return Told(precision, right)


def with_free(part: TurnOn, free: np.ndarray) -> TurnOn:
    """Return a copy of a recording's adjustment with other free unknowns, the others zero.

    Parameters
    ----------
    part : stays as it is.
    free : indices of the unknowns to adjust.
    """
    made = replace(part, task=part.task.copy(free))
    made.task.prior = made.given
    return made


def all_told(parts: Sequence[TurnOn]) -> list[Square]:
    """Return what all recordings determine of the free unknowns of each.

    Parameters
    ----------
    parts : the recordings.

    Raises
    ------
    ObservabilityError
        If something of a recording is not determined, whatever its unknowns are.
    """
    unit = UnitAdjustment(parts)
    _, normal, _ = linearise(unit)
    plates = np.ones(len(normal))
    for part, place in zip(unit.parts, unit.places, strict=True):
        plates[place] = name_plate(part.task.unknowns)[part.free]
    # What nothing determines is known to a thousand times its name plate, so that what is left can be told.
    covariance = inverted(normal * np.outer(plates, plates) + 1e-6 * np.eye(len(normal))) * np.outer(
        plates, plates
    )
    return [invert_normal_matrix(covariance[np.ix_(place, place)]) for place in unit.places]
