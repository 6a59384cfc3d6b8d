"""One unit from several recordings: from their own joint estimates to the common one, with optional terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, inverted
from tumble.calibration.checks.observability import TOLD, find_untold
from tumble.calibration.equations.imu_unknowns import (
    FORCE_ALONE,
    LAYOUT,
    PLAIN,
    gyro_matrix,
    name_plate,
    term_unknowns,
)
from tumble.calibration.estimate import TermTest
from tumble.calibration.optional_terms import (
    ON_TABLES,
    TERM_LIMIT,
    offered_terms,
    term_test,
    unknowns_with,
)
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.calibration.recording_influences import recording_influences
from tumble.calibration.terms import TERMS
from tumble.calibration.turn_ons.adjustment import (
    TurnOn,
    UnitAdjustment,
    all_told,
    balance_several,
    solve_several,
    tell,
    with_free,
)
from tumble.errors import ConvergenceError, ObservabilityError, TumbleError, UsageError
from tumble.estimation.solve import settled_at
from tumble.records import dataclass

# Recordings whose stable parameters differ as chance does once in so many are no one unit's, if they differ by more
# than any unit's scale factors and angles change from one day to the next (a MEMS unit over 40 °C: 0.2 %, 2 mrad).
ANOTHER_UNIT, LARGEST_CHANGE = 1e-6, 3e-3


@dataclass(slots=True)
class SeveralOutcome:
    """A settled adjustment of several recordings of one unit.

    Attributes
    ----------
    solution : of all of them.
    terms : tests of the optional terms, on all recordings together.
    own : (recordings, stable) what each recording determines by itself, and its covariance; an unknown that it does not
        tell is as uncertain as a name plate leaves it.
    """

    solution: UnitAdjustment
    terms: list[TermTest]
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
    chosen, tests = _wanted(parts, _found(parts)) if optional_terms else ([], [])
    adjusted = [with_free(part, _free(part, chosen)) for part in parts]
    solution = balance_several(solve_several(adjusted))
    return SeveralOutcome(solution, tests, _estimates(solution))


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


def _wanted(parts: list[TurnOn], found: set[str]) -> tuple[list[str], list[TermTest]]:
    """Try all terms at once on all recordings, drop the least significant until every one left is wanted.

    What only tables show is tried where a recording by itself has `found` it.
    """
    has_gyro = any(part.outcome.has_gyro for part in parts)
    names = offered_terms(has_gyro=has_gyro) + [name for name in ON_TABLES if name in found]
    tests: dict[str, TermTest] = {}
    while names:
        trial = [with_free(part, _free(part, names)) for part in parts]
        try:
            solution = solve_several(trial)
        except (ObservabilityError, ConvergenceError):
            names.pop()
            continue
        shared = _shared_scatter(solution)
        tests.update({name: _test(name, solution, shared) for name in names})
        weakest = max(names, key=lambda name: tests[name].probability)
        if tests[weakest].kept:
            break
        names.remove(weakest)
    return names, list(tests.values())


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
            return (
                k,
                why,
                ObservabilityError(f"{part.name}, with all that the other recordings determine: {why}"),
            )
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
    squares = float(
        (scale * difference) @ np.linalg.solve(covariance * np.outer(scale, scale), scale * difference)
    )
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
    return replace(
        part.outcome,
        task=part.task,
        balanced=balanced,
        terms=outcome.terms,
        untold=None,
        frame="accelerometer-x",
    )
