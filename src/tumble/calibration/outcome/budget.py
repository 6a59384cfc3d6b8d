"""The joint estimate's uncertainty after the GUM: a budget by sources, degrees of freedom, reliability.

Propagation of distributions for the joint estimate (JCGM 101): drawn errors, carried to the parameters.

Errors of each source are drawn with its share of the covariance: of normal distributions, or of Student's with
the source's own degrees of freedom where its size was estimated (JCGM 101, 6.4.9); gravity that was assumed is
rectangular (6.4.2), and acts as it does, not to first order. The parameters are the exact functions of the
drawn unknowns. For the way from observations to unknowns, which that takes as linear, observations of a few runs
are drawn anew from the solution and adjusted in full.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, inverted
from tumble.attitude import matrices_from_rotation_vectors
from tumble.calibration.equations import causes
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.causes import SOURCES
from tumble.calibration.equations.hold_equations import Force, Rate, Swing
from tumble.calibration.equations.imu_unknowns import force_matrix, gyro_matrix, term_unknowns
from tumble.calibration.equations.turn_equations import Turn
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import (
    Budget,
    Detectable,
    DrawnDistributions,
    GlobalTest,
    ModelChoice,
    UncertaintyStatement,
    chi_square_probability,
    coverage_factors,
    effective_degrees,
)
from tumble.calibration.outcome.description import gravity_slope, named_function
from tumble.calibration.outcome.settled import JointOutcome, outcome_influences
from tumble.calibration.terms import TERMS
from tumble.counting import counted
from tumble.errors import ConvergenceError, UsageError
from tumble.estimation import (
    ALPHA,
    POWER,
    PRIOR,
    Influences,
    Tests,
    solve,
    undetected,
)
from tumble.recording import mean_celsius
from tumble.records import dataclass
from tumble.sensor import Function, jacobian

# A source that adds less than this to the variance of every parameter is not shown.
SHOWN = 1e-4
# A hold's samples are cut into eight batches at least, whose scatter is the noise at rest.
DEGREES_OF_A_HOLD = 7.0
# A term is near its limit if its probability is within this factor of it, and below the last.
NEAR, LARGEST_PROBABILITY = 100.0, 0.5


@dataclass(frozen=True)
class NamedParameters:
    """The estimate's parameters as a function of the unknowns, at the solution.

    Attributes
    ----------
    function : of all unknowns.
    values : the solution.
    slope : (parameters, free) derivatives by the free unknowns.
    """

    function: Function
    values: Series
    slope: Table

    @staticmethod
    def of(outcome: JointOutcome, names: list[str]) -> NamedParameters:
        """Return those of a settled outcome, in the recording's units.

        Parameters
        ----------
        outcome : the solution.
        names : of the estimate's parameters: not every one that a function gives is told, and named.
        """
        recording = outcome.recording
        units = recording.specific_force_unit, recording.angular_rate_unit
        gyro = "full" if outcome.has_gyro else "none"
        labels, function = named_function(outcome.kept, gyro, outcome.frame, units)
        at = {name: row for row, (name, _) in enumerate(labels)}
        rows = [at[name] for name in names]
        values = outcome.values
        slope = jacobian(function, values)[rows][:, outcome.task.unknowns.free]
        return NamedParameters(lambda x: function(x)[rows], values, slope)

    def at(self, unknowns: Series) -> Series:
        """Return the parameters at other unknowns."""
        return np.real(self.function(unknowns.astype(complex)))


def state_uncertainty(estimate: Estimate, outcome: JointOutcome, influences: Influences) -> None:
    """Add the budget and the statement of uncertainty to an estimate's evidence.

    Parameters
    ----------
    estimate : of the outcome.
    outcome : the settled solution with its noise.
    influences : of the same solution.
    """
    named = NamedParameters.of(outcome, [p.name for p in estimate.parameters])
    scale = residual_scale(estimate)
    everything = budget_of(influences, named, outcome, scale)
    total = sum((part**2 for part in everything.values()), np.zeros(len(named.slope)))
    shares = {
        source: part
        for source, part in everything.items()
        if np.any(part**2 > SHOWN * np.maximum(total, 1e-300))
    }
    degrees = source_degrees(outcome)
    effective = effective_degrees(everything, degrees)
    if scale > 1.0:
        # The whole was enlarged by what the residuals show, which is known as well as they are many.
        effective = 1.0 / (1.0 / effective + 1.0 / max(estimate.degrees_of_freedom, 1))
    statement = UncertaintyStatement(
        effective_degrees=effective,
        coverage_factors=coverage_factors(effective),
        source_degrees={source: degrees.get(source, float("inf")) for source in shares},
        test=_global_test(estimate, outcome),
        detectable=_detectable(influences, named, estimate, outcome, scale),
        alpha=ALPHA,
        power=POWER,
        model_choice=_model_choice(influences, named, outcome),
        not_included=_not_included(outcome),
        outcome=outcome,
    )
    estimate.show(Budget(shares, statement))


def budget_of(
    influences: Influences, named: NamedParameters, outcome: JointOutcome, scale: float = 1.0
) -> dict[str, Series]:
    """Return source -> (parameters,) standard uncertainties whose squares add up to the whole.

    Parameters
    ----------
    influences, named, outcome : of one solution.
    scale : factor on all standard uncertainties but gravity's, where residuals are larger than stated.
    """
    made = {
        source: scale * np.sqrt(np.maximum(np.einsum("pa,ab,pb->p", named.slope, share, named.slope), 0.0))
        for source, share in influences.shares(causes.SOURCES).items()
    }
    moved = gravity_slope(outcome.values, outcome.site)[outcome.task.unknowns.free]
    made[causes.GRAVITY] = np.abs(named.slope @ moved) * outcome.site.gravity_sigma
    for source, slope in _seen_by_nothing(outcome).items():
        made[source] = scale * np.abs(named.slope @ slope)
        made[PRIOR] = np.sqrt(np.maximum(made[PRIOR] ** 2 - made[source] ** 2, 0.0))
    return made


def _seen_by_nothing(outcome: JointOutcome) -> dict[str, Series]:
    """Source -> (free,) by how much one sigma of what is believed of clock and table moves the unknowns."""
    task = outcome.task
    made: dict[str, Series] = {}
    for source, name in ((causes.SAMPLE_RATE, "clock"), (causes.TABLE_RATE, "table_rate")):
        if task.unknowns.is_free(name) and task.prior is not None:
            (at,), (place,) = task.unknowns.places([name]), task.unknowns.layout.indices(name)
            made[source] = outcome.balanced.solution.cofactor[:, at] * np.sqrt(
                task.prior.precision[place, place]
            )
    return made


def source_degrees(outcome: JointOutcome) -> dict[str, float]:
    """Return source -> degrees of freedom with which its size is known; what was given has none named.

    Parameters
    ----------
    outcome : the solution with the tests of its residuals.

    Notes
    -----
    Noise at rest is pooled from the batches of all holds. A variance component s² that was found as the excess
    over another variance, v in all, from residuals with r degrees of freedom has ``r (s² / v)²`` of its own.
    """
    data, noise, tests = outcome.data, outcome.task.noise, outcome.balanced.tests
    pooled = DEGREES_OF_A_HOLD * data.holds
    made: dict[str, float] = dict.fromkeys(
        (causes.FORCE_REST, causes.FORCE_TURNING, causes.RATE_REST, causes.RATE_TURNING), pooled
    )
    unknowns = outcome.task.unknowns
    floor = _in_si(data.base.force_floor, force_matrix(unknowns))
    made[causes.FORCE_WANDER] = _of_wander(floor, noise["force"], tests.get("force"), data.holds)
    floor = _in_si(data.base.rate_floor, gyro_matrix(unknowns))
    made[causes.RATE_WANDER] = _of_wander(floor, noise["rate"], tests.get("rate"), data.holds)
    made[causes.TURNS] = _of_component(noise["turn"], tests.get("turn"))
    placed = tests.get("tilt", tests.get("pose"))
    if noise["placement"] > 0.0:
        made[causes.PLACEMENT] = _of_component(noise["placement"], placed)
    made[causes.SWAY] = _of_component(noise["sway"], tests.get("rest"))
    windows = sum(len(spin.windows) for spin in data.rotations.values())
    if windows:
        made[causes.AXIS] = 2.0 * windows
    return made


def _in_si(floor: Vector, matrix: Matrix) -> float:
    lengths: Series = np.sum(matrix**2, axis=1)
    return float(np.mean(floor / lengths))


def _of_component(variance: float, tests: Tests | None) -> float:
    if tests is None or variance <= 0.0:
        return float("inf")
    checked = tests.degrees > 0
    if not np.any(checked):
        return 1.0
    whole = float(checked.sum() / np.sum(1.0 / tests.variance[checked]))
    redundancy = float(tests.redundancy.sum())
    return max(redundancy * min(variance / whole, 1.0) ** 2, 0.5)


def _of_wander(floor: float, extra: float, tests: Tests | None, holds: int) -> float:
    """Of the floor that holds show within, one degree a hold, and of what they show against each other."""
    total = floor + extra
    if total <= 0.0:
        return float("inf")
    spread = floor**2 / max(holds, 1) + extra**2 / _of_component(extra, tests)
    return total**2 / spread if spread > 0.0 else float("inf")


def residual_scale(estimate: Estimate) -> float:
    """Return the factor on standard uncertainties of residuals that are larger than stated.

    Parameters
    ----------
    estimate : with the square root of its variance of unit weight.
    """
    sigma0 = estimate.sigma0_final
    return max(1.0, sigma0) if np.isfinite(sigma0) else 1.0


def _global_test(estimate: Estimate, outcome: JointOutcome) -> GlobalTest | None:
    degrees = estimate.degrees_of_freedom
    if degrees <= 0 or not np.isfinite(estimate.sigma0_final):
        return None
    noise = outcome.task.noise
    sizes = (noise["force"], noise["rate"], noise["turn"], noise["sway"] - 1e-12)
    components = sum(size > 0.0 for size in (*sizes, noise["placement"]))
    components += sum(factor > 1.1 for factor in noise.factors.get("windows", {}).values())
    statistic = estimate.sigma0_final**2 * degrees
    alone = chi_square_probability(estimate.sigma0**2 * degrees, degrees)
    return GlobalTest(statistic, degrees, chi_square_probability(statistic, degrees), alone, components)


def _detectable(
    influences: Influences,
    named: NamedParameters,
    estimate: Estimate,
    outcome: JointOutcome,
    scale: float,
) -> list[Detectable]:
    sigma = np.array([p.standard_uncertainty for p in estimate.parameters])
    made: list[Detectable] = []
    for influence in influences.each:
        raw = None if influence.equations is None else influence.equations.directions(outcome.task)
        if raw is None or influence.taken is None:
            continue
        inverse = np.asarray(np.linalg.inv(influence.root), dtype=np.float64)
        for t in np.flatnonzero(influence.active):
            left = np.eye(influence.taken.shape[1]) - influence.taken[t]
            gain = named.slope @ influence.gain[t]
            found = undetected(left, inverse[t] @ raw, scale * gain, sigma)
            of_whole = raw.T @ inverse[t].T
            # Of a hold's three parts only what they have in common is an error of the hold.
            mean = inverted(of_whole @ of_whole.T) @ of_whole
            redundancy = float(np.trace(mean @ left @ of_whole.T))
            where = influence.kind, int(influence.place[t]), raw.shape[1]
            made.append(Detectable(*where, redundancy, scale * found.size, found.parameter, found.effect))
    return sorted(made, key=lambda d: (d.kind, d.index))


def _model_choice(influences: Influences, named: NamedParameters, outcome: JointOutcome) -> list[ModelChoice]:
    made: list[ModelChoice] = []
    for test in outcome.terms:
        if not test.limit / NEAR < test.probability < min(NEAR * test.limit, LARGEST_PROBABILITY):
            continue
        if test.name not in TERMS or TERMS[test.name].in_part:
            continue
        place = term_unknowns(test.name)
        other = _without(influences.covariance, outcome, place) if test.kept else _with(outcome, place)
        change = named.at(other) - named.at(outcome.values)
        made.append(ModelChoice(test.name, test.kept, test.probability, test.limit, change))
    return made


def _without(covariance: AnyArray, outcome: JointOutcome, place: np.ndarray) -> Series:
    """Return the unknowns with those at `place` forced to zero."""
    u, values = outcome.task.unknowns, outcome.values.copy()
    at = u.places(place)
    pull = covariance[:, at] @ inverted(covariance[np.ix_(at, at)])
    values[u.free] -= pull @ values[place]
    return values


def _with(outcome: JointOutcome, place: np.ndarray) -> Series:
    """Return the unknowns after one step in which those at `place` are free too."""
    task = outcome.task.copy()
    task.unknowns = task.unknowns.with_free(np.union1d(task.unknowns.free, place))
    solve(task, once=True)
    return task.unknowns.values


def _not_included(outcome: JointOutcome) -> list[str]:
    said: list[str] = []
    celsius = outcome.recording.temperature
    if celsius is None or mean_celsius(celsius) is None:
        said.append(
            "Temperature: the recording has no temperature. The parameters hold at whatever it was; what it did to the "
            "biases while recording is in the wander, what it did to scale factors is not in the uncertainties."
        )
    else:
        low, high = float(np.nanmin(celsius)), float(np.nanmax(celsius))
        said.append(
            f"Temperature: it went from {low:.1f} to {high:.1f} °C while recording. What that did to "
            "the biases is in their wander. What it did to scale factors and angles is not in the "
            "uncertainties: at another temperature they do not hold."
        )
    if outcome.data.poses is None:
        said.append("Placement: no pose was believed, so that none can be wrong.")
    if not outcome.site.gravity_sigma:
        said.append(
            "Reference gravity was given as exact: a wrong one would make all accelerometer scale factors wrong alike."
        )
    said.append(
        "Turn-on to turn-on: biases hold for this recording. Only several recordings show how far "
        "they move when the unit is switched on again."
    )
    return said


# Full adjustments of observations drawn anew: as many as these seconds allow, and no more than so many.
SECONDS, READJUSTED = 20.0, 200
COVERAGE = 0.95
BLOCKS = 10


def draw_distributions(
    estimate: Estimate,
    runs: int,
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> None:
    """Draw the parameters' distributions, and note in the estimate's statement whether the GUM's intervals hold.

    Parameters
    ----------
    estimate : with a statement of uncertainty that has an outcome; its `drawn` is set, and a remark added.
    runs : draws, a thousand at least.
    rng : random numbers.
    progress : called with a sentence on how far it is.

    Raises
    ------
    UsageError
        If the estimate has no budget of uncertainty.
    """
    budget = estimate.shown(Budget)
    told = None if budget is None else budget.statement
    outcome = None if told is None else told.outcome
    if told is None or not isinstance(outcome, JointOutcome):
        raise UsageError(
            "--monte-carlo is for the joint estimator's parameters of both triads, and this estimate "
            f"({estimate.procedure}) has no budget of uncertainty to draw from: leave it out, or take --procedure "
            "joint."
        )
    named = NamedParameters.of(outcome, [p.name for p in estimate.parameters])
    progress("distributions")
    unknowns = _draw_unknowns(outcome, runs, rng, residual_scale(estimate))
    drawn = np.array([named.at(one) for one in counted(unknowns, runs)])
    low, high = shortest_intervals(drawn, COVERAGE)
    values = np.array([p.value for p in estimate.parameters])
    sigma = np.array([p.standard_uncertainty for p in estimate.parameters])
    expanded = coverage_factors(told.effective_degrees) * sigma
    tolerance = numerical_tolerance(sigma)
    off = np.maximum(np.abs(values - expanded - low), np.abs(values + expanded - high))
    again, why_none = _readjusted(outcome, rng, progress)
    told.drawn = DrawnDistributions(
        runs=runs,
        intervals=np.column_stack([low, high]),
        off=off,
        spread=_spread_of_ends(drawn),
        tolerance=tolerance,
        readjusted=len(again),
        readjusted_ratio=_spread_ratio(again, outcome, named),
        why_not_readjusted=why_none,
    )
    estimate.say("remark", told.drawn.words())


def _draw_unknowns(outcome: JointOutcome, runs: int, rng: np.random.Generator, scale: float = 1.0) -> Table:
    """Return (runs, unknowns) draws about the solution."""
    shares = outcome_influences(outcome).shares(SOURCES)
    degrees = source_degrees(outcome)
    free = outcome.task.unknowns.free
    off = np.zeros((runs, free.size))
    for source, share in shares.items():
        part = rng.standard_normal((runs, free.size)) @ _root(share).T
        known = degrees.get(source, np.inf)
        if np.isfinite(known):
            part *= np.sqrt(known / rng.chisquare(known, runs))[:, None]
        off += scale * part
    drawn = np.tile(outcome.values, (runs, 1))
    drawn[:, free] += off
    gravity = _draw_gravity(outcome, runs, rng)
    at = free[np.flatnonzero(gravity_slope(outcome.values, outcome.site)[free])]
    drawn[:, at] *= (outcome.site.gravity / gravity)[:, None]
    return drawn


def _draw_gravity(outcome: JointOutcome, runs: int, rng: np.random.Generator) -> Series:
    """Return (runs,) m/s²: rectangular where gravity was assumed or rounded, else normal."""
    site = outcome.site
    if site.is_evenly_spread:
        half = np.sqrt(3.0) * site.gravity_sigma
        return rng.uniform(site.gravity - half, site.gravity + half, runs)
    return rng.normal(site.gravity, site.gravity_sigma, runs)


def _root(share: Square) -> Square:
    values, vectors = np.linalg.eigh(0.5 * (share + share.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.float64)


def shortest_intervals(drawn: Table, coverage: float) -> tuple[Series, Series]:
    """Return the ends (parameters,) of the shortest interval that holds a share of the draws (JCGM 101, 5.3.4).

    Parameters
    ----------
    drawn : (runs, parameters).
    coverage : share of the draws.
    """
    ordered = np.sort(drawn, axis=0)
    inside = min(round(coverage * len(ordered)), len(ordered) - 1)
    widths = ordered[inside:] - ordered[: len(ordered) - inside]
    first = np.argmin(widths, axis=0)
    columns = np.arange(drawn.shape[1], dtype=np.intp)
    return ordered[first, columns], ordered[first + inside, columns]


def _spread_of_ends(drawn: Table) -> Series:
    """Standard deviation by chance of the ends of the shortest intervals, the larger of both."""
    ends = np.array([shortest_intervals(block, COVERAGE) for block in np.array_split(drawn, BLOCKS)])
    return np.asarray(ends.std(axis=0, ddof=1).max(axis=0) / np.sqrt(BLOCKS), dtype=np.float64)


def numerical_tolerance(sigma: Series) -> Series:
    """Return half a unit of the one significant digit of each standard uncertainty (JCGM 101, 7.9.2).

    Parameters
    ----------
    sigma : (parameters,), zero where nothing is uncertain.
    """
    positive = np.where(sigma > 0.0, sigma, 1.0)
    # One digit of 9.6 is 10: the digit's place is that of the rounded number.
    place = np.floor(np.log10(positive))
    place = np.where(np.round(positive / 10.0**place) >= 10.0, place + 1.0, place)
    return np.where(sigma > 0.0, 0.5 * 10.0**place, 0.0)


def _readjusted(
    outcome: JointOutcome, rng: np.random.Generator, progress: Callable[[str], None]
) -> tuple[Table, str]:
    """Unknowns (adjustments, unknowns) of observations drawn anew, and why there are no more."""
    size = outcome.values.size
    if outcome.data.rotations or outcome.data.poses is not None:
        return np.zeros((0, size)), ("a table's rotations and believed poses are not drawn anew")
    made: list[Series] = []
    start = time.perf_counter()
    while len(made) < READJUSTED and time.perf_counter() - start < SECONDS:
        task = redrawn(outcome.task, rng)
        try:
            solve(task)
        except ConvergenceError:
            return np.array(made).reshape(-1, size), "an adjustment did not settle"
        made.append(task.unknowns.values)
        if len(made) % 20 == 0:
            progress(f"distributions: {len(made)} full adjustments")
    return np.array(made).reshape(-1, size), ""


def redrawn(settled: JointAdjustment, rng: np.random.Generator) -> JointAdjustment:
    """Return an adjustment with observations of holds and turns drawn anew about where everything is, as the truth.

    Parameters
    ----------
    settled : without a table's rotations and believed poses.
    rng : random numbers.
    """
    base = settled.data.base
    base = replace(base, rate_mean=base.rate_mean.copy(), raw_rate=base.raw_rate.copy())
    swings = replace(settled.data.swings, value=settled.data.swings.value.copy())
    task = settled.copy()
    data = task.data = replace(settled.data, base=base, parts=settled.data.parts.copy(), swings=swings)
    observed = {"force": data.parts.reshape(data.holds, 9), "rate": base.rate_mean, "swing": swings.value}
    for section in task.sections:
        sigma = np.sqrt(task.noise.of_each("sway", section.holds))[:, None]
        sway = sigma * rng.standard_normal((2, len(section.C_wb), 3))
        C = section.C_wb.copy()
        C[:, 1] = C[:, 0] @ matrices_from_rotation_vectors(sway[0])
        C[:, 2] = C[:, 1] @ matrices_from_rotation_vectors(sway[1])
        true = replace(section, C_wb=C)
        for of_kind in (Force, Rate, Swing):
            (linear,) = of_kind(true).linearise(task)
            observed[of_kind.kind][section.holds] += linear.residual - _errors(linear.covariance, rng)
        k = section.holds[:-1]
        errors: AnyArray | None = None
        for _ in range(3 if k.size else 0):
            (linear,) = Turn(true, k).linearise(task)
            errors = _errors(linear.covariance, rng) if errors is None else errors
            assert linear.by_bias is not None
            for turn, by_bias, missed in zip(k, linear.by_bias, errors - linear.residual, strict=True):
                # What a bias would take away, samples that show more add.
                base.raw_rate[base.turn_start[turn] : base.turn_stop[turn]] += inverted(-by_bias) @ missed
    if task.prior is not None:
        mean = _drawn_mean(task.prior.precision, task.unknowns.values, rng)
        task.prior = replace(task.prior, mean=mean)
    return task


def _errors(covariance: AnyArray, rng: np.random.Generator) -> AnyArray:
    root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    return np.einsum("tab,tb->ta", root, rng.standard_normal(root.shape[:2]))


def _drawn_mean(precision: Square, unknowns: Series, rng: np.random.Generator) -> Series:
    values, vectors = np.linalg.eigh(precision)
    known = values > 1e-12 * max(float(values.max()), 1e-300)
    sigma = np.where(known, 1.0 / np.sqrt(np.where(known, values, 1.0)), 0.0)
    return unknowns + vectors @ (sigma * rng.standard_normal(unknowns.size))


def _spread_ratio(unknowns: Table, outcome: JointOutcome, named: NamedParameters) -> Series:
    """Root mean square of the full adjustments' errors over the first order's sigma, per parameter."""
    if not len(unknowns):
        return np.zeros(0)
    influences = outcome_influences(outcome)
    linear = np.einsum("pa,ab,pb->p", named.slope, influences.covariance, named.slope)
    centre = named.at(outcome.values)
    off = np.array([named.at(drawn) - centre for drawn in unknowns])
    return np.sqrt(np.mean(off**2, axis=0) / np.maximum(linear, 1e-300))
