"""Calibration from a recording tumbled by hand: both triads from holds and the turns between them.

The accelerometers see gravity in each hold; over each turn the gyro carries gravity from one hold to
the next. One Gauss-Helmert adjustment of `turn_conditions` uses both, and each hold's mean rate for
the gyro's bias and g-sensitivity. Start values need no knowledge of scale, sign or axis order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Series, Square, Vector, Vectors, inverted
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.checks.bias_course import Rests, find_rate_courses, rate_course_words
from tumble.calibration.checks.scores import angle_off, score_turns
from tumble.calibration.checks.snooping import NEEDLESS, Kind, Outlier, balance, wald_test
from tumble.calibration.checks.triad_agreement import estimate_time_lag, refuse_contradicting_axes
from tumble.calibration.closed_forms.start_values import rough_gyro_matrix, rough_triad
from tumble.calibration.equations.causes import RATE_COURSE
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.imu_unknowns import term_unknowns
from tumble.calibration.equations.norm import NormConditions
from tumble.calibration.equations.triad_unknowns import BIAS, triad_from_unknowns
from tumble.calibration.equations.turn import (
    EARTH,
    FORCE,
    GYRO_BIAS,
    GYRO_MATRIX,
    NORM,
    RATE,
    TOTAL,
    TURN,
    ExtraVariances,
    HoldsAndTurns,
    TurnConditions,
)
from tumble.calibration.estimate import (
    Estimate,
    Figures,
    LeftOut,
    NamedValue,
    TermTest,
    coverage_factor,
    estimate_of,
)
from tumble.calibration.evidence import Budget, Holds, Turns
from tumble.calibration.poses import distinct_poses, require_poses
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedure import Procedure, Suits
from tumble.calibration.session import Session
from tumble.counting import about, counted
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.estimation import Adjustment, Prior, adjust
from tumble.estimation.gauss_helmert import Linearisation
from tumble.estimation.terms import keep_wanted
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, Timeline
from tumble.sensor import ImuModel, Triad
from tumble.units import angular_rate_factor, specific_force_factor

# Optional terms, tried together and dropped one by one: name -> unknowns.
OPTIONAL_TERMS = {name: term_unknowns(name) for name in ("g_sensitivity", "quadratic")}
# A term that is not there is kept in fewer than this share of recordings, all terms together.
TERM_FALSE_ALARM = 0.02
# With the time lag, which is tested apart because nothing else depends on it.
TERMS_TRIED = len(OPTIONAL_TERMS) + 1
LAG_LIMIT = TERM_FALSE_ALARM / TERMS_TRIED
SMALLEST_TURNS = 5
# Of what windows of the turns show, how much smaller the counts of a rad/s may be: steps that an adjustment bridges.
SIZES = 0.85 ** np.arange(8)

# Of an adjustment that is balanced, and of its terms: recordings by hand took 8 to 45, half of them 13 to 17.
USUAL_STEPS = 16

_FORCE_NINE = np.arange(0, 9)
_GYRO_TWELVE = np.arange(GYRO_MATRIX.start, GYRO_BIAS.stop)
_EARTH = np.arange(EARTH.start, EARTH.stop)


@dataclass(slots=True)
class _Solution:
    """An adjustment with its free unknowns and the noise that it was given."""

    adjustment: Adjustment
    values: Series
    free: np.ndarray
    extra: dict[str, float]
    turned: Series


def calibrate_hand_held(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    site: Site,
    *,
    prior: StableKnowledge | None = None,
    optional_terms: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Estimate:
    """Calibrate accelerometers and gyros from holds and turns.

    Parameters
    ----------
    recording, timeline, means : raw samples, what was found in them, and the holds' means.
    site : gravity; with a latitude, the Earth rate's part along gravity is known too.
    prior : what an earlier calibration knows of the terms that do not change.
    optional_terms : try g-sensitivity and quadratic terms, keep what the data want.
    progress : called with a sentence on what is being done.

    Raises
    ------
    ObservabilityError
        If poses or turns are too few or too alike.
    ConvergenceError
        If the adjustment does not settle.
    RecordingError
        If the turns contradict the order, signs or units of the columns.
    """
    say = progress or _silent
    data = gather(recording, timeline, means)
    if int(np.count_nonzero(data.turn_start >= 0)) < SMALLEST_TURNS:
        raise ObservabilityError(
            f"Only {int(np.count_nonzero(data.turn_start >= 0))} turns between holds can be used and the "
            f"gyro needs at least {SMALLEST_TURNS}: rest, turn, rest, turn, about all three axes."
        )
    say("start values")
    values = _start(recording, data, site.gravity, prior)
    refuse_contradicting_axes(recording, inverted(values[GYRO_MATRIX].reshape(3, 3)))

    say("adjustment")
    active = np.ones((data.holds, 6), dtype=bool)
    free = np.concatenate([_FORCE_NINE, _GYRO_TWELVE, _EARTH])
    with about(USUAL_STEPS):
        alone = _solve(
            data, site, prior, values, free, active.copy(), {"norm": 0.0, "rate": 0.0, "turn": 0.0}
        )
        solution, outliers = _balanced(data, site, prior, alone.values, free, active)
    tests: list[TermTest] = []
    if optional_terms:
        say("optional terms")
        with about(USUAL_STEPS):
            solution, tests, outliers = _with_terms(
                data, site, prior, solution, outliers, np.ones_like(active)
            )
    say("uncertainties and checks")
    if solution.free.size > free.size:
        # What the noise at rest leaves unexplained is a matter of the model that was kept.
        nothing = {"norm": 0.0, "rate": 0.0, "turn": 0.0}
        alone = _solve(data, site, prior, solution.values, solution.free, np.ones_like(active), nothing)
    estimate = _estimate(recording, data, site, alone, solution, outliers, tests)
    if optional_terms:
        add_time_lag(estimate, data)
    _, linear = _all_conditions(data, site, solution)
    matrix = solution.values[GYRO_MATRIX].reshape(3, 3)
    _state_courses(estimate, data, recording, -linear.misclosure[:, RATE] @ matrix.T)
    return estimate


def add_time_lag(estimate: Estimate, data: HoldsAndTurns) -> None:
    """Test whether the triads are sampled at the same instants; note a lag that is significant.

    Parameters
    ----------
    estimate : gets the test, and the lag as a parameter and a remark.
    data : holds and turns.
    """
    from scipy.special import stdtr

    found = estimate_time_lag(data, estimate.model)
    if found is None:
        return
    ratio = found.lag / max(found.sigma, 1e-12)
    probability = 2.0 * float(stdtr(found.turns - 1, -abs(ratio)))
    kept = probability < LAG_LIMIT
    estimate.terms.append(
        TermTest("time_lag", kept, ratio**2, 1, probability, LAG_LIMIT, f"{ratio:+.1f} sigma")
    )
    if not kept:
        return
    name = "lag of the accelerometer behind the gyro"
    estimate.parameters.append(NamedValue(name, found.lag, found.sigma, "s"))
    size = estimate.correlations.shape[0]
    correlations = np.eye(size + 1)
    correlations[:size, :size] = estimate.correlations
    estimate.correlations = correlations
    budget = estimate.shown(Budget)
    if budget is not None:
        _add_lag(budget, found.sigma, found.turns - 1)
    earlier = "earlier" if found.lag > 0 else "later"
    estimate.say(
        "remark",
        f"The accelerometer's samples belong to instants {abs(1e3 * found.lag):.1f} ms (± "
        f"{1e3 * found.sigma:.1f} ms) {earlier} than the gyro's. The estimate does not depend on it. "
        "`tumble apply --shift-lag` takes it out, or give it to your filter.",
    )


def _add_lag(budget: Budget, sigma: float, degrees: int) -> None:
    """Append the lag: the turns tell it, and nothing else of the budget does."""
    shares, told = budget.shares, budget.statement
    cause = "gyros while turning" if "gyros while turning" in shares else next(iter(shares))
    budget.shares = {name: np.append(part, sigma if name == cause else 0.0) for name, part in shares.items()}
    if told is not None:
        told.effective_degrees = np.append(told.effective_degrees, float(degrees))
        told.coverage_factors = np.append(told.coverage_factors, coverage_factor(degrees))
        told.model_choice = [
            replace(choice, change=np.append(choice.change, 0.0)) for choice in told.model_choice
        ]


def _state_courses(estimate: Estimate, data: HoldsAndTurns, recording: Recording, residual: Vectors) -> None:
    """Note how the gyros' biases jump or drift by raw residuals at rest, and widen their uncertainties."""
    assert estimate.model.gyroscope is not None
    variance = np.diagonal(data.rate_covariance, axis1=1, axis2=2)
    rests = Rests(recording.time[data.head[:, 0]], recording.time[data.tail[:, 1] - 1], variance)
    known = data.force_mean if estimate.model.g_sensitivity is not None else None
    courses = find_rate_courses(residual, rests, known)
    middle = 0.5 * (rests.start + rests.stop)
    for course in courses:
        away = np.average(course.departure(middle), axis=0, weights=1.0 / variance.sum(axis=1))
        for axis in np.flatnonzero(away).tolist():
            _count_departure(estimate, axis, abs(float(away[axis])))
    scale = np.linalg.norm(estimate.model.gyroscope.matrix, axis=1)
    for kind, words in rate_course_words(courses, rests, scale).items():
        estimate.say(kind, *words)


def _count_departure(estimate: Estimate, axis: int, more: float) -> None:
    """Count in a gyro bias' uncertainty by how much, raw, it is off at the end."""
    name, label = f"gyroscope.bias[{axis}]", f"gyro bias {'xyz'[axis]}"
    places = [i for i, known in enumerate(estimate.names) if known == name]
    rows = [i for i, parameter in enumerate(estimate.parameters) if parameter.name == label]
    if not places or not rows:
        return
    place, row = places[0], rows[0]
    before = float(np.sqrt(estimate.covariance[place, place]))
    estimate.covariance[place, place] += more**2
    known = estimate.parameters[row]
    # In the parameter's own unit.
    added = more * known.standard_uncertainty / before
    sigma = float(np.hypot(known.standard_uncertainty, added))
    estimate.parameters[row] = replace(known, standard_uncertainty=sigma)
    estimate.correlations[row, :] *= known.standard_uncertainty / sigma
    estimate.correlations[:, row] *= known.standard_uncertainty / sigma
    estimate.correlations[row, row] = 1.0
    budget = estimate.shown(Budget)
    if budget is not None:
        share = budget.shares.setdefault(RATE_COURSE, np.zeros(len(estimate.parameters)))
        share[row] = np.hypot(share[row], added)


def _start(
    recording: Recording, data: HoldsAndTurns, gravity: float, prior: StableKnowledge | None
) -> Series:
    """Return start values of all unknowns: accelerometers from holds, gyro from windows of the turns."""
    values = np.zeros(TOTAL)
    force = rough_triad(data.force_mean, gravity)
    if prior is not None:
        force[6:9] = prior.angles
    factor = specific_force_factor(recording.specific_force_unit)
    require_poses(data.force_mean, force, has_prior=prior is not None, factor=factor)
    spread = (0.01 * gravity) ** 2
    if len(distinct_poses(data.force_mean - force[BIAS])) >= 9:
        conditions = NormConditions(
            data.force_mean, data.force_covariance, gravity, force, _FORCE_NINE, extra_variance=spread
        )
        force[:9] = adjust(conditions, force[:9]).parameters
    values[FORCE] = force
    bias = np.median(data.rate_mean, axis=0)
    usable = np.flatnonzero(data.turn_start >= 0)
    stretches = [(int(data.turn_start[k]), int(data.turn_stop[k])) for k in usable]
    try:
        triad = triad_from_unknowns(force)
        inverse, _ = rough_gyro_matrix(data.time, data.raw_rate, data.raw_force, triad, bias, stretches)
        values[GYRO_MATRIX] = _carries_best(recording, data, triad, inverse, bias).ravel()
    except (ValueError, np.linalg.LinAlgError) as error:
        raise ObservabilityError(
            f"The turns do not determine the gyro's axes ({error}): turn the unit about all three "
            "axes between holds."
        ) from error
    values[GYRO_BIAS] = bias
    return values


def _carries_best(
    recording: Recording, data: HoldsAndTurns, triad: Triad, inverse: Matrix, bias: Vector
) -> Matrix:
    """Return the rough gyro matrix, or the one that the columns' names and unit promise if that carries gravity better.

    A unit that swings round a wrist shows the rough one its accelerations as motion of gravity: counts seem too few.
    """
    factor = angular_rate_factor(recording.angular_rate_unit)
    sizes = np.sqrt(3.0) / np.linalg.norm(inverse) * SIZES if factor is None else np.array([1.0 / factor])
    matrices = [inverted(inverse), *(size * np.eye(3) for size in sizes)]
    models = [ImuModel(triad, Triad(matrix, bias)) for matrix in matrices]
    off = [np.nanmedian(score_turns(model, data).angle) for model in counted(models, len(models))]
    return matrices[int(np.argmin(off))]


def _prior(
    data: HoldsAndTurns, site: Site, values: Series, free: np.ndarray, prior: StableKnowledge | None
) -> Prior:
    """Return what is known beforehand: the Earth rate, as far as the site determines it, and the unit.

    In a hold the Earth rate's vertical part looks like a g-sensitivity of the gyros, equal on all
    axes; a latitude tells the two apart.
    """
    mean, precision = np.zeros(free.size), np.zeros((free.size, free.size))
    at = np.searchsorted(free, _EARTH)
    if site.latitude is None:
        precision[np.ix_(at, at)] = np.eye(3) * 3.0 / EARTH_RATE**2
    else:
        # Up in the first hold's body frame, where the three unknowns are given.
        up = triad_from_unknowns(values[FORCE]).correct(data.force_mean[:1])[0]
        vertical = np.outer(up, up) / (up @ up)
        # 1e-3: the first pose's direction is known to a milliradian or so.
        precision[np.ix_(at, at)] = vertical / (1e-3 * EARTH_RATE) ** 2
        horizontal = EARTH_RATE * max(np.cos(site.latitude), 1e-3)
        precision[np.ix_(at, at)] += (np.eye(3) - vertical) * 2.0 / horizontal**2
        mean[at] = EARTH_RATE * np.sin(site.latitude) * up / np.linalg.norm(up)
    if prior is not None:
        where = np.searchsorted(free, np.arange(6, 9))
        mean[where] = prior.angles
        precision[np.ix_(where, where)] += inverted(prior.angle_covariance)
    return Prior(mean, precision)


def _solve(
    data: HoldsAndTurns,
    site: Site,
    prior: StableKnowledge | None,
    values: Series,
    free: np.ndarray,
    active: np.ndarray,
    extra: dict[str, float],
    *,
    once: bool = False,
) -> _Solution:
    variances = ExtraVariances(extra["norm"], extra["rate"], extra["turn"])
    conditions = TurnConditions(data, site.gravity, values, free, active, variances)
    known = _prior(data, site, values, free, prior)
    # A thousandth of a sigma: the step itself is still taken, and the next would be a millionth.
    adjustment = adjust(conditions, values[free], prior=known, tolerance=1e-3, once=once)
    return _Solution(adjustment, conditions.full(adjustment.parameters), free, dict(extra), conditions.turned)


def _balanced(
    data: HoldsAndTurns,
    site: Site,
    prior: StableKnowledge | None,
    values: Series,
    free: np.ndarray,
    active: np.ndarray,
) -> tuple[_Solution, list[Outlier]]:
    """Adjust with variance components, gross errors left out (`active` changes)."""
    latest: list[_Solution] = []

    def solve(extra: dict[str, float], active: np.ndarray, *, once: bool) -> Adjustment:
        start = latest[-1].values if latest else values
        latest.append(_solve(data, site, prior, start, free, active, extra, once=once))
        return latest[-1].adjustment

    # The last call is the one whose adjustment is returned, so that the latest solution goes with it.
    kinds = [Kind("rate", RATE), Kind("turn", TURN), Kind("norm", NORM)]
    outliers = balance(solve, kinds, active).outliers
    return latest[-1], outliers


def _with_terms(
    data: HoldsAndTurns,
    site: Site,
    prior: StableKnowledge | None,
    base: _Solution,
    base_outliers: list[Outlier],
    everything: np.ndarray,
) -> tuple[_Solution, list[TermTest], list[Outlier]]:
    """Try all optional terms at once, drop the least significant until every one left is wanted.

    Each term's estimates are tested against zero with their own covariance (Wald's test as F), at
    the noise level of the fit that contains them.
    """
    names = [
        name for name, unknowns in OPTIONAL_TERMS.items() if base.adjustment.redundancy > 3 * unknowns.size
    ]
    limit = TERM_FALSE_ALARM / TERMS_TRIED
    tests: dict[str, TermTest] = {}
    if names and not base_outliers:
        names = _not_needless(data, site, prior, base, everything, names, tests)
        tests = {name: replace(test, kept=False, limit=limit) for name, test in tests.items()}
    while names:
        free = np.sort(np.concatenate([base.free, *(OPTIONAL_TERMS[name] for name in names)]))
        try:
            solution, outliers = _balanced(data, site, prior, base.values, free, everything.copy())
        except ObservabilityError:
            names.pop()
            continue
        for name in names:
            tests[name] = _test_term(solution, name, limit)
        weakest = max(names, key=lambda name: tests[name].probability)
        if tests[weakest].kept:
            return solution, list(tests.values()), outliers
        names.remove(weakest)
    return base, list(tests.values()), base_outliers


def _not_needless(
    data: HoldsAndTurns,
    site: Site,
    prior: StableKnowledge | None,
    base: _Solution,
    everything: np.ndarray,
    names: list[str],
    tests: dict[str, TermTest],
) -> list[str]:
    """The terms that one step from the adjustment without any does not show to be needless; see `NEEDLESS`."""
    free = np.sort(np.concatenate([base.free, *(OPTIONAL_TERMS[name] for name in names)]))
    try:
        once = _solve(data, site, prior, base.values, free, everything, base.extra, once=True).adjustment
    except ObservabilityError:
        return names

    def test(name: str, values: Series, blocks: list[Square]) -> tuple[float, bool]:
        tests[name] = wald_test(name, values, blocks[0], once.redundancy, NEEDLESS)
        return tests[name].probability, tests[name].kept

    places = {name: np.searchsorted(free, OPTIONAL_TERMS[name]) for name in names}
    return keep_wanted(once.parameters, [once.cofactor], places, test)


def _test_term(solution: _Solution, name: str, limit: float) -> TermTest:
    at = np.searchsorted(solution.free, OPTIONAL_TERMS[name])
    adjustment = solution.adjustment
    covariance = adjustment.cofactor[np.ix_(at, at)]
    return wald_test(name, adjustment.parameters[at], covariance, adjustment.redundancy, limit)


def _estimate(
    recording: Recording,
    data: HoldsAndTurns,
    site: Site,
    alone: _Solution,
    solution: _Solution,
    outliers: list[Outlier],
    tests: list[TermTest],
) -> Estimate:
    """Put the outcome together, with gravity's own uncertainty in the covariance."""
    terms = frozenset(test.name for test in tests if test.kept)
    covariance = np.zeros((TOTAL, TOTAL))
    scale = max(1.0, solution.adjustment.sigma0) ** 2
    covariance[np.ix_(solution.free, solution.free)] = scale * solution.adjustment.cofactor
    described = describe_unknowns(solution.values, covariance, site, recording, terms=terms, gyro="full")
    conditions, linear = _all_conditions(data, site, solution)
    norms = linear.misclosure[:, 0].copy()
    # The yardstick of `tumble verify`, so that both can be compared.
    angles = score_turns(described.model, data).angle
    variances = np.diagonal(linear.covariance, axis1=1, axis2=2)
    turn_sigmas = np.where(data.turn_start >= 0, np.sqrt(variances[:, TURN].sum(axis=1)), np.nan)
    components = {
        "accelerometer bias from hold to hold, m/s²": float(np.sqrt(solution.extra["norm"])),
        "gyro bias from hold to hold, rad/s": float(np.sqrt(solution.extra["rate"])),
        "direction after a turn, rad": float(np.sqrt(solution.extra["turn"])),
    }
    return estimate_of(
        "hand-held",
        described,
        Figures.of(solution.adjustment, alone.adjustment.sigma0, components, tested=[NORM, RATE, TURN]),
        left_out=[_left_out(outlier, norms, angles) for outlier in outliers],
        terms=tests,
        evidence=[
            Holds(norms, np.sqrt(variances[:, 0])),
            Turns(angles, turn_sigmas, conditions.turned.copy()),
        ],
    )


def _all_conditions(
    data: HoldsAndTurns, site: Site, solution: _Solution
) -> tuple[TurnConditions, Linearisation]:
    """Return all conditions at the solution, those that were left out, too."""
    conditions = TurnConditions(
        data,
        site.gravity,
        solution.values,
        solution.free,
        np.ones((data.holds, 6), dtype=bool),
        ExtraVariances(solution.extra["norm"], solution.extra["rate"], solution.extra["turn"]),
    )
    return conditions, conditions.linearise(solution.values[solution.free])


def _left_out(outlier: Outlier, norms: Series, angles: Series) -> LeftOut:
    k, times = outlier.group, f"{outlier.normalised:.1f} times what the others show"
    if outlier.kind == "norm":
        return LeftOut(
            "hold", k, f"its specific force is off gravity by {1e3 * norms[k]:+.1f} mm/s², {times}"
        )
    if outlier.kind == "rate":
        return LeftOut("hold", k, f"the gyro's output at rest is off by {times}: did it really rest?")
    return LeftOut("turn", k, f"gravity carried by the gyro ends {angle_off(angles[k])}, {times}")


def _silent(_: str) -> None:
    """Tell nobody."""


def _run(session: Session) -> Estimate:
    return calibrate_hand_held(
        session.recording,
        session.timeline,
        session.means,
        session.site,
        prior=session.prior,
        optional_terms=session.options.optional_terms,
        progress=session.say,
    )


def _suits(session: Session) -> Suits:
    recording, timeline = session.recording, session.timeline
    if recording.specific_force is None or recording.angular_rate is None:
        return Suits(False, "the recording has one triad only")
    turns = sum(turn.usable for turn in timeline.turns)
    if turns < SMALLEST_TURNS:
        return Suits(
            False,
            f"{turns} turns between holds can be used, and the hand-held procedure needs {SMALLEST_TURNS}",
        )
    return Suits(True, f"{len(timeline.holds)} holds and {turns} turns suffice")


PROCEDURE = Procedure(
    "hand-held",
    _run,
    "accelerometer-x",
    "nothing but hands",
    "both triads, nine or more poses, five or more turns between them that can be integrated",
    "everything: both triads in full, the rotation between them, g-sensitivity of the gyros if the data want it",
    "hand-held.md",
    takes=frozenset({"prior"}),
    suits=_suits,
    otherwise="multi-position",
    # Too few poses are too few for others, too; only what the gyro lacks leaves another way open.
    failed="the turns do not determine the gyro",
    joint_believes=False,
    gyros_from="turns",
)
