"""Several recordings of one unit in one adjustment: what is stable is common, biases are each recording's own.

A unit is one more level of the chain: its border are the stable unknowns and each recording's own ones, bias and
fixture, and a recording is a chain within it that knows its part of that border. Attitudes, Earth rates, variance
components and outliers of a recording stay its own.

It begins with the recordings' own joint estimates. Optional terms are tried on all of them, and one that is not of the
unit, or leaves something of its own untold, is named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording
from tumble.calibration.equations.imu_unknowns import (
    FORCE_ALONE,
    LAYOUT,
    PLAIN,
    gyro_matrix,
    name_plate,
    term_unknowns,
    terms_prior,
)
from tumble.calibration.equations.pose_equations import mounting_prior
from tumble.calibration.equations.state import NODE
from tumble.calibration.estimate import TermTest
from tumble.calibration.optional_terms import ON_TABLES, TERM_LIMIT, offered_terms, term_test, unknowns_with
from tumble.calibration.outcome.settled import JointOutcome, recording_influences
from tumble.calibration.prior import TOLD, angle_prior, find_untold, name_plate_prior, together as both_priors
from tumble.calibration.terms import TERMS
from tumble.errors import ConvergenceError, ObservabilityError, TumbleError, UsageError
from tumble.estimation import (
    Balanced,
    Block,
    Chain,
    Eliminated,
    Equations,
    Layout,
    Outlier,
    Place,
    Prior,
    Settled,
    Spread,
    Stretch,
    Unknowns,
    invert_normal_matrix,
    linearise,
    settled_at,
    solve,
)
from tumble.records import dataclass

OWN = LAYOUT.indices("force.bias", "gyro.bias", "fixture")
"""Unknowns of a recording alone: biases change when the unit is switched on, the fixture when it is placed."""
# Eigenvalues of an information matrix of unit diagonal below this are round-off of the others.
NOTHING = 1e-12


@dataclass
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


@dataclass(frozen=True)
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
    sizes = np.outer(plates, plates)
    covariance = inverted(normal * sizes + 1e-6 * np.eye(len(normal))) * sizes
    return [invert_normal_matrix(covariance[np.ix_(place, place)]) for place in unit.places]


# Recordings whose stable parameters differ as chance does once in so many are no one unit's, if they differ by more
# than any unit's scale factors and angles change from one day to the next (a MEMS unit over 40 °C: 0.2 %, 2 mrad).
ANOTHER_UNIT, LARGEST_CHANGE = 1e-6, 3e-3


@dataclass
class SeveralOutcome:
    """A settled adjustment of several recordings of one unit.

    Attributes
    ----------
    solution : of all of them.
    terms : tests of the optional terms, on all recordings together.
    untried : optional terms with which nothing settles, or that all recordings together do not determine.
    own : (recordings, stable) what each recording determines by itself, and its covariance; an unknown that it does not
        tell is as uncertain as a name plate leaves it.
    """

    solution: UnitAdjustment
    terms: list[TermTest]
    untried: list[str]
    own: list[tuple[Series, Square]]

    @property
    def kept(self) -> frozenset[str]:
        """Names of the optional terms that are wanted."""
        return frozenset(test.name for test in self.terms if test.kept)


def find_strangers(
    names: Sequence[str], outcomes: Sequence[JointOutcome], *, optional_terms: bool = True
) -> dict[int, str]:
    """Return which recordings cannot be adjusted with the others, and why; at least two are left.

    One that contradicts the others by more than any unit changes (another unit, or biases that drifted with the poses),
    and one whose own unknowns are not determined whatever the others tell. The others are not refused with it.

    Parameters
    ----------
    names : of the recordings, for words.
    outcomes : of each one's own joint adjustment.
    optional_terms : as for `adjust_several`.

    Raises
    ------
    UsageError, ObservabilityError
        If fewer than two recordings would be left.
    """
    found: dict[int, str] = {}
    while True:
        at = [k for k in range(len(names)) if k not in found]
        parts = [TurnOn.of(names[k], outcomes[k]) for k in at]
        terms = _found(parts)
        # By what was recorded alone: a prior of another unit would make one of the recordings the stranger. Terms that
        # are left out go into scale factors and angles, by the way that each recording was turned.
        alone = [replace(part, outcome=replace(part.outcome, knowledge=None)) for part in parts]
        stranger = _stranger([with_free(part, _free(part, [*(terms | {"g_sensitivity"})])) for part in alone])
        if stranger is None:
            chosen = [*terms] if optional_terms else []
            stranger = _untold([with_free(part, _free(part, chosen)) for part in parts])
        if stranger is None:
            return found
        part, why, error = stranger
        if len(parts) < 3:
            raise error
        found[at[part]] = why


def adjust_several(
    names: Sequence[str], outcomes: Sequence[JointOutcome], *, optional_terms: bool = True
) -> SeveralOutcome:
    """Adjust several recordings of one unit together.

    Parameters
    ----------
    names : of the recordings, for words.
    outcomes : of each one's own joint adjustment.
    optional_terms : try g-sensitivity, quadratic terms and asymmetries on all recordings, keep what the data want.

    Raises
    ------
    ObservabilityError
        If all recordings together do not tell the unit.
    ConvergenceError
        If the adjustment does not settle.
    """
    parts = [TurnOn.of(name, outcome) for name, outcome in zip(names, outcomes, strict=True)]
    chosen, tests, untried = _wanted(parts, _found(parts)) if optional_terms else ([], [], [])
    adjusted = [with_free(part, _free(part, chosen)) for part in parts]
    solution = balance_several(solve_several(adjusted))
    return SeveralOutcome(solution, tests, untried, _estimates(solution))


def _found(parts: Sequence[TurnOn]) -> set[str]:
    """The optional terms that a recording by itself was adjusted with."""
    free = [part.outcome.task.unknowns.free for part in parts]
    return {name for name in TERMS if any(np.all(np.isin(term_unknowns(name), own)) for own in free)}


def _free(part: TurnOn, terms: Sequence[str]) -> np.ndarray:
    """The unknowns of a recording with these terms; without a gyro none of gyros."""
    has_gyro = part.outcome.has_gyro
    plain = [PLAIN if has_gyro else FORCE_ALONE]
    if part.task.data.poses is not None:
        plain.append(LAYOUT.indices("fixture"))
    return unknowns_with(np.concatenate(plain), [term for term in terms if _may_have(part, term)])


def _may_have(part: TurnOn, term: str) -> bool:
    """Whether a recording can have a term: gyros' ones a unit with gyros, a table's ones one on a table."""
    if term in ON_TABLES:
        return bool(part.task.data.rotations)
    return part.outcome.has_gyro or TERMS[term].shown_by != "gyro"


def _wanted(parts: list[TurnOn], found: set[str]) -> tuple[list[str], list[TermTest], list[str]]:
    """Try all terms at once on all recordings, drop the least significant until every one left is wanted.

    What only tables show is tried where a recording by itself has `found` it. Returned last is what was not tried.
    """
    has_gyro = any(part.outcome.has_gyro for part in parts)
    names = offered_terms(has_gyro=has_gyro) + [name for name in ON_TABLES if name in found]
    tests, untried = dict[str, TermTest](), list[str]()
    while names:
        trial = [with_free(part, _free(part, names)) for part in parts]
        try:
            solution = solve_several(trial)
        except (ObservabilityError, ConvergenceError):
            untried.append(max(names, key=lambda name: TERMS[name].gives_way))
            names.remove(untried[-1])
            tests.pop(untried[-1], None)
            continue
        shared = _shared_scatter(solution)
        tests.update({name: _test(name, solution, shared) for name in names})
        weakest = max(names, key=lambda name: tests[name].probability)
        if tests[weakest].kept:
            break
        names.remove(weakest)
    return names, list(tests.values()), untried


def _test(name: str, solution: UnitAdjustment, shared: Square) -> TermTest:
    """The less significant one: with and without what neighbouring holds share."""
    at = np.searchsorted(solution.stable, term_unknowns(name))
    own, here = np.ix_(at, at), solution.values[at]
    taken = [solution.settled.cofactor[own], solution.settled.cofactor[own] + shared[own]]
    tests = [term_test(name, here, matrix, solution.settled.redundancy, TERM_LIMIT) for matrix in taken]
    return max(tests, key=lambda test: test.probability)


def _shared_scatter(solution: UnitAdjustment) -> Square:
    """Return (stable, stable) by how much the covariance of what recordings have in common would differ.

    Each tells ``P_i x_i``, and together ``C Σ P_i x_i``: a change D_i of the covariance of x_i is ``C P_i D_i P_i C``
    of the whole.
    """
    size = solution.stable.size
    total = np.zeros((size, size))
    for part, told in zip(solution.parts, solution.told, strict=True):
        change = _scatter_of_one(part)
        place, at = np.searchsorted(solution.stable, part.stable), part.task.unknowns.places(part.stable)
        weights = told.precision[:, place]
        total += weights @ change[np.ix_(at, at)] @ weights.T
    covariance = solution.settled.cofactor[:size, :size]
    return covariance @ total @ covariance


def _scatter_of_one(part: TurnOn) -> Square:
    """Of a recording by itself; zeros where it does not tell its unknowns alone."""
    task = replace(part.task, prior=part.given)
    try:
        solution = settled_at(task)
    except ObservabilityError:
        return np.zeros((part.free.size, part.free.size))
    return part.scale * recording_influences(task, solution).shared


def _stranger(parts: Sequence[TurnOn]) -> tuple[int, str, TumbleError] | None:
    """Return the recording that is not of the others' unit, and why; None where all are of one."""
    unit = UnitAdjustment(parts)
    stable = unit.stable
    unit.told = [tell(part, stable) for part in parts]
    own = _estimates(unit)
    worst: tuple[float, int, int] | None = None
    for k, (estimate, covariance) in enumerate(own):
        mean, spread = _weighted([of for i, of in enumerate(own) if i != k])
        sizes = _sizes(parts[k], stable)
        # Only what is told well enough to be seen as another.
        told = np.sqrt(np.diag(covariance + spread)) / sizes < LARGEST_CHANGE / 3.0
        change = np.where(told, np.abs(estimate - mean) / sizes, 0.0)
        at = int(np.argmax(change))
        unlikely = _probability(estimate - mean, covariance + spread) < ANOTHER_UNIT
        if unlikely and change[at] > LARGEST_CHANGE and (worst is None or change[at] > worst[0]):
            worst = (float(change[at]), k, int(stable[at]))
    if worst is None:
        return None
    change, k, unknown = worst
    rest = [part.name for i, part in enumerate(parts) if i != k]
    others = f"{' and '.join(rest[:2])}{' …' if len(rest) > 2 else ''}"
    by = f"{LAYOUT.label(unknown)} differs by {100.0 * change:.2g} %, which no unit's does from one day to the next."
    refused = f"{parts[k].name} and {others} are not of one unit: {by} Calibrate each unit by itself."
    return k, f"{by} Is it another unit, or did its biases drift while it was recorded?", UsageError(refused)


def _sizes(part: TurnOn, stable: np.ndarray) -> Series:
    """What an error of 1 of each unknown is: scale factors relative, angles in rad; terms do not count."""
    u = part.outcome.task.unknowns
    sizes = u.at(np.full(u.values.size, np.inf))
    sizes["force.scale"][:] = np.abs(u["force.scale"])
    sizes["force.angle"][:] = 1.0
    sizes["gyro.matrix"][:] = np.repeat(np.linalg.norm(gyro_matrix(u), axis=1), 3)
    return sizes.values[stable]


def _untold(parts: Sequence[TurnOn]) -> tuple[int, str, TumbleError] | None:
    """Return the recording of which all together leave something untold, and what."""
    for k, (part, told) in enumerate(zip(parts, all_told(parts), strict=True)):
        if (untold := find_untold(told, part.task.unknowns)) is not None:
            why = untold.sentences()[0]
            said = f"{part.name}, with all that the other recordings determine: {why}"
            return k, why, ObservabilityError(said)
    return None


def _estimates(unit: UnitAdjustment) -> list[tuple[Series, Square]]:
    """What each recording determines by itself, with its covariance, about where all are."""
    at, made = unit.values, list[tuple[Series, Square]]()
    for part, own in zip(unit.parts, unit.told, strict=True):
        plate = name_plate(part.task.unknowns)[unit.stable]
        sizes = np.where((plate > 0.0) & np.isfinite(plate), plate, 1.0)
        scaled = own.precision * np.outer(sizes, sizes) + np.eye(at.size) * NAME_PLATE_WEIGHT
        covariance = inverted(scaled) * np.outer(sizes, sizes)
        made.append((at + covariance @ (own.right - own.precision @ at), covariance))
    return made


# So little that it takes nothing from what a recording determines, and keeps finite what it does not.
NAME_PLATE_WEIGHT = 1e-4


def tells(covariance: Square, part: TurnOn, stable: np.ndarray) -> np.ndarray:
    """Return which of the stable unknowns a recording determines by itself, (stable,) of bool.

    Parameters
    ----------
    covariance : of its own estimate.
    part, stable : the recording, and the indices.
    """
    plate = name_plate(part.task.unknowns)[stable]
    return np.isin(stable, part.stable) & (np.sqrt(np.diag(covariance)) < TOLD * plate)


def _weighted(estimates: Sequence[tuple[Series, Square]]) -> tuple[Series, Square]:
    precisions = [inverted(covariance) for _, covariance in estimates]
    covariance = inverted(sum(precisions[1:], precisions[0]))
    right = [p @ value for p, (value, _) in zip(precisions, estimates, strict=True)]
    return covariance @ sum(right[1:], right[0]), covariance


def _probability(difference: Series, covariance: Square) -> float:
    from scipy.special import chdtrc

    scale = 1.0 / np.sqrt(np.diag(covariance))
    scaled = scale * difference
    squares = scaled @ np.linalg.solve(covariance * np.outer(scale, scale), scaled)
    return float(chdtrc(difference.size, squares))


def disagreement(
    own: Sequence[tuple[Series, Square]], precisions: Sequence[Square], value: Series, weight: float
) -> tuple[float, int, float]:
    """Return chi-square, degrees of freedom and probability of all differences between recordings.

    Parameters
    ----------
    own : (unknowns,), (unknowns, unknowns) each one's estimate and covariance, finite where it determines nothing.
    precisions : (unknowns, unknowns) what each determines, singular where it determines nothing.
    value, weight : (unknowns,) of all of them, and the variance of unit weight.

    Notes
    -----
    A recording has as many degrees of freedom as it determines directions: the trace of covariance times precision.
    """
    from scipy.special import chdtrc

    squares, told = 0.0, 0.0
    for (estimate, covariance), precision in zip(own, precisions, strict=True):
        squares += float((estimate - value) @ precision @ (estimate - value)) / weight
        told += float(np.sum(covariance * precision))
    degrees = round(told) - value.size
    return squares, max(degrees, 0), float(chdtrc(degrees, squares)) if degrees > 0 else 1.0


def settled_outcome(outcome: SeveralOutcome, index: int) -> JointOutcome:
    """Return a recording's outcome at the common solution.

    Parameters
    ----------
    outcome : of all.
    index : of the recording.
    """
    part = outcome.solution.parts[index]
    assert part.balanced is not None
    balanced = replace(part.balanced, outliers=part.outliers)
    settled = replace(part.outcome, task=part.task, balanced=balanced, courses={}, untried=[])
    return replace(settled, terms=outcome.terms, untold=None, frame="accelerometer-x")
