"""The joint estimate's uncertainty after the GUM: a budget by sources, degrees of freedom, reliability.

It adds up what each observation of a recording does to its unknowns, biases that wander among them, which holds have in
common.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, inverted
from tumble.calibration.checks.bias_course import with_courses
from tumble.calibration.equations import causes
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.hold_equations import Rate
from tumble.calibration.equations.imu_unknowns import force_matrix, gyro_matrix, raw_force, term_unknowns
from tumble.calibration.equations.observed import wander_logarithm
from tumble.calibration.evidence import (
    Budget,
    Detectable,
    GlobalTest,
    ModelChoice,
    UncertaintyStatement,
    chi_square_probability,
    coverage_factors,
    effective_degrees,
)
from tumble.calibration.outcome.description import gravity_slope, named_function
from tumble.calibration.terms import TERMS
from tumble.estimation.equations import Tests
from tumble.estimation.influence import PRIOR, Influences, influences_of
from tumble.estimation.reliability import ALPHA, POWER, undetected
from tumble.estimation.solve import Settled, settled_at, solve
from tumble.recording.temperature import mean_celsius
from tumble.records import dataclass
from tumble.segmentation.rest_wander import RestParts, find_density
from tumble.sensor.propagation import Function, jacobian

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.outcome.estimate import JointOutcome

# Of which density is found: more show nothing more.
MOST_HOLDS = 60


def recording_influences(task: JointAdjustment, settled: Settled | None = None) -> Influences:
    """Return what each observation of a recording does to its unknowns at the solution.

    Parameters
    ----------
    task : settled.
    settled : its solution; None linearises once more.

    Raises
    ------
    ObservabilityError
        If shared unknowns are not determined.
    """
    data, u, between = task.data, task.unknowns, _between(task)
    octaves, wanders = wander_logarithm(data.base, data.span), dict[str, tuple[Vector, float]]()
    for source, floor, variance, matrix in (
        (causes.FORCE_WANDER, data.force_density, task.noise["force"], force_matrix(u)),
        (causes.RATE_WANDER, data.rate_density, task.noise["rate"], gyro_matrix(u)),
    ):
        # What holds scatter by beyond their noise is wander as far as their parts show one, and may be a bump's.
        added = variance * np.sum(matrix**2, axis=1) / octaves
        told = floor + np.minimum(added, between.get(source, 0.0))
        wanders[source] = floor + added, float(np.sum(told) / max(float(np.sum(floor + added)), 1e-300))
    span = float(data.base.time[0]), float(data.base.time[-1])
    return influences_of(*(settled or settled_at(task), task.prior, wanders, span), between, data.wander_once)


def _between(task: JointAdjustment) -> dict[str, Vector]:
    """Source -> (3,) raw² per unit of ``ln f``: the densities by which biases wander, as all rests show them.

    Rests of one face lie near each other in time and share most of it: they scatter less among themselves than the
    faces do.
    """
    parts = task.data.base.parts
    # Holds that are too short to be cut into parts show no wander.
    if parts is None or parts.force is None:
        return {}
    made = {causes.FORCE_WANDER: _force_density(task, parts)}
    if parts.rate is not None:
        made[causes.RATE_WANDER] = _rate_density(task, parts)
    return made


def _holds(task: JointAdjustment, parts: RestParts, kind: str) -> np.ndarray:
    holds = np.intersect1d(np.flatnonzero(task.taking_part[kind]), parts.hold)
    return holds[:: max(1, -(-holds.size // MOST_HOLDS))]


def _rate_density(task: JointAdjustment, parts: RestParts) -> Vector:
    data, u = task.data, task.unknowns
    assert parts.rate is not None
    holds = _holds(task, parts, "rate")
    shown, up_b = np.zeros((data.holds, 3)), np.zeros((data.holds, 3))
    for section in task.sections:
        (linear,) = Rate(section).linearise(task)
        shown[section.holds] = linear.residual + data.base.rate_mean[section.holds]
        up_b[section.holds] = section.C_wb[:, 1, 2]
    columns = [np.ones(data.holds), *(up_b.T if u.is_free("gyro.g_sensitivity") else ())]
    design, signal = np.column_stack(columns)[holds], parts.rate - shown[parts.hold]
    return find_density(parts, signal, parts.rate_white, holds=holds, design=design)


def _force_density(task: JointAdjustment, parts: RestParts) -> Vector:
    """By the poses where most are believed; else by gravity's size, which is known of every hold.

    A unit that stays on its table from hold to spin is placed once: that one hold of seven shows nothing of a wander.
    Two holds show along gravity as much of one wander as their directions up have in common.
    """
    data, u, poses = task.data, task.unknowns, task.data.poses
    if poses is not None and data.holds < 2 * poses.hold.size <= 2 * MOST_HOLDS:
        at = np.isin(poses.hold, np.flatnonzero(task.taking_part["force"]))
        holds, up_b, sigma = poses.hold[at], poses.up_f[at], poses.sigma[at, None]
        moved = float(np.max(np.linalg.norm(data.base.force_mean[holds], axis=1))) * sigma
        spread = moved**2 * (np.maximum(1.0 - up_b**2, 0.0) + 2.0 * sigma**2)
        design = np.column_stack([np.ones(len(holds)), up_b])
        return find_density(parts, parts.force, parts.force_white, holds=holds, design=design, spread=spread)
    assert parts.force is not None
    up_b = -np.concatenate([section.C_wb[:, 1, 2] for section in task.sections])
    shown = raw_force(u, task.site.gravity * up_b)
    # What is seen along gravity, m/s², of a raw number: the others' part in it is a tilt's.
    along = np.einsum("ni,nij->nj", up_b, inverted(shown.by_true))
    columns = u.columns({name: along[:, None] @ block for name, block in shown.by_blocks.items()}, 0)[:, 0]
    holds, scale = _holds(task, parts, "force"), np.sum(force_matrix(u) ** 2, axis=1)
    signal = np.einsum("nj,nj->n", along[parts.hold], parts.force - shown.value[parts.hold])
    density = find_density(
        parts,
        signal[:, None],
        np.mean(parts.force_white / scale, keepdims=True),
        holds=holds,
        design=columns[holds],
        alike=up_b[holds] @ up_b[holds].T,
    )
    return density[0] * scale


# A source that adds less than this to the variance of every parameter is not shown.
SHOWN = 1e-4
# A hold's samples are cut into eight batches at least, whose scatter is the noise at rest.
DEGREES_OF_A_HOLD = 7.0
# A term is near its limit if its probability is within this factor of it, and below the last.
NEAR, LARGEST_PROBABILITY = 100.0, 0.5


@dataclass(frozen=True, slots=True)
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


def outcome_influences(outcome: JointOutcome) -> Influences:
    """Return those of a settled outcome, courses of its biases among them.

    Parameters
    ----------
    outcome : whose courses are known.
    """
    return with_courses(recording_influences(outcome.task), outcome.courses)


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
