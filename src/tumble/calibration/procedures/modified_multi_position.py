"""Modified multi-position calibration on a single-axis table (Syed et al. 2007; Hayal 2010, 2.4.2.2).

The unit rests on a table in many poses that nobody needs to know, and is spun both ways in each. The
accelerometers are calibrated on the norm of gravity as in the multi-position test. The gyros are shown
the table's rate instead of the Earth's, ten thousand times stronger. Rough values come first, from
the holds and from the spins themselves, so that raw counts converge.

Syed's condition on a spin is the norm of the corrected rate; it cannot tell how the gyros stand
against the accelerometers. Here the whole vector is used (`table_conditions`): a table turns about the
vertical, which the accelerometers show. The solution by norms alone is made too and compared.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vectors, inverted
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.checks.scores import holds_evidence, left_out_holds
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.closed_forms.accelerometers import fit_accelerometers
from tumble.calibration.equations.placement import find_added_sigma, is_excessive
from tumble.calibration.equations.placement_bias import G_SENSITIVITY_FALSE_ALARM
from tumble.calibration.equations.spin import combined_mean, padded, spin_covariance
from tumble.calibration.equations.spin_groups import REVERSED, SpinGroup, group_spins
from tumble.calibration.equations.table import VERTICAL, TableConditions, TableReadings
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, COUNT, SCALE, triad_from_unknowns
from tumble.calibration.equations.turn import FORCE, G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX, TOTAL
from tumble.calibration.estimate import (
    Estimate,
    Figures,
    LeftOut,
    TermTest,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import Spins
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedure import Procedure
from tumble.calibration.procedures.multi_position import TriadFit, fit_norms
from tumble.calibration.session import Session
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Adjustment, Prior, adjust
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, SpinMeans
from tumble.segmentation.matching import Matching
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.gauge import lower_factor

# Of spins in either direction, so many at least: four poses that no plane holds tell a g-sensitivity.
FEWEST_EACH_WAY = 4
# Of a table's axis against the vertical; before it is known, a common one.
LARGEST_TILT, ROUGH_TILT = 0.03, 0.01
_NINE = np.arange(9)
_GYRO = np.arange(GYRO_MATRIX.start, GYRO_BIAS.stop)
_G = np.arange(G_SENSITIVITY.start, G_SENSITIVITY.stop)


@dataclass(slots=True)
class _Joint:
    """The adjustment of all placements, and the noise that it was given."""

    adjustment: Adjustment
    values: Series
    free: np.ndarray
    alone: float = float("nan")
    tilt: float = 0.0
    wander: float = 0.0
    tests: list[TermTest] = field(default_factory=list[TermTest])


@dataclass(slots=True)
class _Task:
    """What the steps of the procedure share."""

    recording: Recording
    means: HoldMeans
    site: Site
    groups: list[SpinGroup]
    readings: TableReadings
    force: TriadFit
    prior: StableKnowledge | None


def calibrate_modified_multi_position(
    recording: Recording,
    means: HoldMeans,
    spins: SpinMeans,
    matching: Matching,
    protocol: Protocol,
    site: Site,
    *,
    prior: StableKnowledge | None = None,
) -> Estimate:
    """Calibrate both triads from holds and spins in poses that are not known.

    Parameters
    ----------
    recording : for its units.
    means : of all holds; each spin's placement needs one, which shows where up is.
    spins : means over whole revolutions, in the order of `matching.spins`.
    matching, protocol : which spin has which rate.
    site : gravity; its latitude gives the Earth rate that the table adds to. Without one it is an unknown.
    prior : non-orthogonalities of the accelerometers from an earlier calibration.

    Returns
    -------
    estimate : in the frame ``accelerometer-x``, with the gyro's whole matrix.

    Raises
    ------
    ObservabilityError
        If poses or spins are too few or too alike, if the table turned one way only, or the other way
        than the protocol says.
    ConvergenceError
        If an adjustment fails.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError(
            "The recording has no accelerometer: the modified multi-position test needs one."
        )
    if spins.angular_rate is None or len(spins) == 0:
        raise ObservabilityError(
            "No spins with a gyro's readings were found: there is nothing to calibrate gyros by."
        )
    force = fit_accelerometers(recording, means, site, prior)
    groups = [g for g in group_spins(matching, protocol) if g.holds]
    readings = _gather(means, spins, groups, force)
    task = _Task(recording, means, site, groups, readings, force, prior)
    _require_both_ways(readings)
    joint, norms = _solve(task)
    return _estimate(task, spins, joint, norms)


def _gather(means: HoldMeans, spins: SpinMeans, groups: list[SpinGroup], force: TriadFit) -> TableReadings:
    """Return the placements: one mean at rest each, of the holds that are no outliers, and the spins."""
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    assert spins.angular_rate is not None
    noise = spin_covariance(spins)
    triad = triad_from_unknowns(force.unknowns)
    bad = {outlier.group for outlier in force.outliers}
    kept: list[SpinGroup] = []
    rest: list[tuple[AnyArray, AnyArray]] = []
    for group in groups:
        good = [hold for hold in group.holds if hold not in bad]
        if good:
            kept.append(group)
            rest.append(combined_mean(means.specific_force[good], means.specific_force_covariance[good]))
    groups[:] = kept
    most = max([1, *(len(group.rows) for group in groups)])
    row = np.full((len(groups), most), -1)
    rate = np.zeros((len(groups), most))
    for k, group in enumerate(groups):
        row[k, : len(group.rows)] = group.rows
        up_b = triad.correct(rest[k][0][None])[0]
        rate[k, : len(group.rows)] = [group.rate_about(up_b, step) for step in group.spins]
    zero = [np.zeros(3)], [np.zeros((3, 3))]
    return TableReadings(
        force=np.array([mean for mean, _ in rest]).reshape(-1, 3),
        force_covariance=np.array([spread for _, spread in rest]).reshape(-1, 3, 3),
        rate=rate,
        shown=padded([[spins.angular_rate[r] for r in g.rows] or zero[0] for g in groups], most),
        shown_covariance=padded([[noise[r] for r in g.rows] or zero[1] for g in groups], most),
        row=row,
    )


def _require_both_ways(readings: TableReadings) -> None:
    rates = readings.rate[readings.row >= 0]
    ways = [int(np.count_nonzero(rates > 0)), int(np.count_nonzero(rates < 0))]
    if min(ways) >= FEWEST_EACH_WAY:
        return
    slowest = float(np.min(np.abs(rates))) if rates.size else 1.0
    earth = two_digits(1e6 * EARTH_RATE * np.sin(np.radians(40.0)) / slowest)
    raise ObservabilityError(
        f"{ways[0]} spins counter-clockwise and {ways[1]} clockwise were found, and {FEWEST_EACH_WAY} "
        "or more of each are needed. With one direction the gyros' g-sensitivity, the Earth rate and "
        "a wrong zero of the table look like scale factor errors. No residual shows it. The Earth "
        f"rate alone, at 40°, makes {earth} ppm. Spin both ways in every pose."
    )


def _solve(task: _Task) -> tuple[_Joint, TriadFit]:
    """Adjust: first roughly, for the noise and what is no noise; then for good, with the terms wanted."""
    values = _start(task)
    free = np.concatenate([_NINE, _GYRO, _G, [] if task.site.latitude is not None else [VERTICAL]]).astype(
        int
    )
    rough = _adjust(task, values, free, tilt=ROUGH_TILT)
    kept = _test_sensitivity(rough).kept
    if not kept:
        free = np.setdiff1d(free, _G)
        rough = _adjust(task, values, free, tilt=ROUGH_TILT)
    norms = _fit_norms(task, rough.values, without=kept)
    gone = np.isin(task.readings.row, [outlier.group for outlier in norms.outliers])
    task.readings.row[gone] = -1
    wander = float(np.sqrt(norms.extra))
    with_g = np.union1d(free, _G)
    joint = _with_tilt(task, rough.values, with_g, wander)
    test = _test_sensitivity(joint)
    if not test.kept:
        values = joint.values.copy()
        values[_G] = 0.0
        joint = _with_tilt(task, values, np.setdiff1d(free, _G), wander)
    joint.tests = [test]
    return joint, (_fit_norms(task, joint.values, without=False) if kept else norms)


def _start(task: _Task) -> Series:
    """Return start values: the gyros by least squares on the rates about the vertical as it is seen."""
    readings = task.readings
    values = np.zeros(TOTAL)
    values[FORCE] = task.force.unknowns
    if task.site.latitude is not None:
        values[VERTICAL] = EARTH_RATE * np.sin(task.site.latitude)
    up = triad_from_unknowns(task.force.unknowns).correct(readings.force)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    used = readings.row >= 0
    turned = ((readings.rate + values[VERTICAL])[:, :, None] * up[:, None, :])[used]
    size = float(np.max(np.abs(turned)))
    design = np.column_stack([turned / size, np.ones(turned.shape[0])])
    solution, _, rank, _ = np.linalg.lstsq(design, readings.shown[used], rcond=1e-3)
    if rank < 4:
        raise ObservabilityError(
            "The spins do not separate the gyros' axes: spin the unit with each of its axes upright, "
            "and both ways."
        )
    matrix = solution[:3].T / size
    if np.linalg.det(matrix) <= 0:
        raise ObservabilityError(REVERSED)
    values[GYRO_MATRIX], values[GYRO_BIAS] = matrix.ravel(), solution[3]
    return values


def _prior(task: _Task, free: np.ndarray) -> Prior | None:
    mean, precision = np.zeros(free.size), np.zeros((free.size, free.size))
    if task.prior is not None:
        at = np.searchsorted(free, np.arange(ANGLE.start, ANGLE.stop))
        mean[at] = task.prior.angles
        precision[np.ix_(at, at)] = inverted(task.prior.angle_covariance)
    if VERTICAL in free:
        at = np.searchsorted(free, [VERTICAL])
        precision[at, at] = 3.0 / EARTH_RATE**2
    return Prior(mean, precision) if np.any(precision) else None


def _adjust(
    task: _Task,
    values: Series,
    free: np.ndarray,
    *,
    tilt: float,
    wander: float = 0.0,
    norm: float | None = None,
) -> _Joint:
    conditions = TableConditions(
        task.readings,
        task.site.gravity,
        values,
        free,
        norm=task.force.extra if norm is None else norm,
        wander=wander,
        tilt=tilt,
    )
    adjustment = adjust(conditions, values[free], prior=_prior(task, free))
    full = conditions.full(adjustment.parameters)
    if np.linalg.det(full[GYRO_MATRIX].reshape(3, 3)) <= 0 or np.any(full[SCALE] <= 0):
        raise ConvergenceError("The adjustment ended in a mirror root: a scale factor came out negative.")
    return _Joint(adjustment, full, free, tilt=tilt, wander=wander)


def _with_tilt(task: _Task, values: Series, free: np.ndarray, wander: float) -> _Joint:
    """Adjust, with a tilt of the table's axis from placement to placement where the spins show one."""
    alone = _adjust(task, values, free, tilt=0.0, norm=0.0).adjustment.sigma0
    joint = _adjust(task, values, free, tilt=0.0, wander=wander)
    # A tilt moves a placement's spins in two components, less the rotation that is estimated from them.
    spun = int(np.count_nonzero(np.any(task.readings.row >= 0, axis=1)))
    loosest = _adjust(task, joint.values, free, tilt=LARGEST_TILT, wander=wander).adjustment.square_sum
    outer = 2 * spun - 3
    if outer > 0 and is_excessive(joint.adjustment.square_sum - loosest, outer):

        def excess(tilt: float) -> float:
            return _adjust(task, joint.values, free, tilt=tilt, wander=wander).adjustment.square_sum - loosest

        tilt = find_added_sigma(excess, outer, 1e-8, LARGEST_TILT)
        joint = _adjust(task, joint.values, free, tilt=tilt, wander=wander)
    joint.alone = alone
    return joint


def _test_sensitivity(joint: _Joint) -> TermTest:
    at = np.searchsorted(joint.free, _G)
    adjustment = joint.adjustment
    spread = adjustment.cofactor[np.ix_(at, at)] * max(1.0, adjustment.sigma0**2)
    return wald_test(
        "g_sensitivity", adjustment.parameters[at], spread, adjustment.redundancy, G_SENSITIVITY_FALSE_ALARM
    )


def _fit_norms(task: _Task, values: Series, *, without: bool) -> TriadFit:
    """Return Syed's solution: the norm of each spin's corrected rate is the table's and the Earth's."""
    readings = task.readings
    used = readings.row >= 0
    order = np.argsort(readings.row[used])
    shown = readings.shown.copy()
    if without:
        true = triad_from_unknowns(values[FORCE]).correct(readings.force)
        shown -= (true @ values[G_SENSITIVITY].reshape(3, 3).T)[:, None, :]
    start = np.zeros(COUNT)
    scale, angles = shin_from_matrix(lower_factor(values[GYRO_MATRIX].reshape(3, 3)))
    start[BIAS], start[SCALE], start[ANGLE] = values[GYRO_BIAS], np.real(scale), np.real(angles)
    reference = np.abs(readings.rate + values[VERTICAL])[used][order]
    fit = fit_norms(shown[used][order], readings.shown_covariance[used][order], reference, start, _NINE)
    rows = np.sort(readings.row[used])
    # Outliers by the number of the spin.
    fit.outliers = [type(o)(o.kind, int(rows[o.group]), o.normalised) for o in fit.outliers]
    return fit


def _estimate(task: _Task, spins: SpinMeans, joint: _Joint, norms: TriadFit) -> Estimate:
    adjustment = joint.adjustment
    covariance = np.zeros((TOTAL, TOTAL))
    covariance[np.ix_(joint.free, joint.free)] = max(1.0, adjustment.sigma0) ** 2 * adjustment.cofactor
    covariance += _table_rate(task, joint)
    terms = frozenset({"g_sensitivity"}) if joint.tests[0].kept else frozenset[str]()
    described = describe_unknowns(
        joint.values, covariance, task.site, task.recording, terms=terms, gyro="full"
    )
    assert task.means.specific_force is not None
    assert task.means.specific_force_covariance is not None
    holds = holds_evidence(
        triad_from_unknowns(joint.values[FORCE]),
        task.means.specific_force,
        task.means.specific_force_covariance,
        task.site.gravity,
        task.force.extra,
    )
    residuals, sigmas = _spin_residuals(task, spins, joint)
    components = {
        "accelerometer bias from hold to hold, m/s²": float(np.sqrt(task.force.extra)),
        "gyro bias from spin to spin, rad/s": joint.wander,
        "table's axis against the vertical, rad": joint.tilt,
    }
    every = slice(0, adjustment.residual.shape[1])
    return estimate_of(
        "modified-multi-position",
        described,
        Figures.of(adjustment, joint.alone, components, tested=[every]),
        left_out=_left_out(task, norms, holds.norms),
        terms=joint.tests,
        said=said_of(remarks=_remarks(task, joint, norms), not_determined=_not_determined(task)),
        evidence=[
            holds,
            Spins(_spin_rates(task, len(spins)), residuals, sigmas, _spin_names(task, len(spins))),
        ],
    )


def _table_rate(task: _Task, joint: _Joint) -> Square:
    """Return what the table's own uncertainty adds: one table, all gyro scale factors alike."""
    slope = np.zeros(TOTAL)
    slope[GYRO_MATRIX] = joint.values[GYRO_MATRIX]
    share = max((step.rate_sigma for group in task.groups for step in group.spins), default=0.0)
    return np.outer(slope, slope) * share**2


def _spin_residuals(task: _Task, spins: SpinMeans, joint: _Joint) -> tuple[Vectors, Vectors]:
    """Return what the corrected gyros show beyond the table's and the Earth's rate about the seen vertical."""
    readings, values = task.readings, joint.values
    true = triad_from_unknowns(values[FORCE]).correct(readings.force)
    up = true / np.linalg.norm(true, axis=1, keepdims=True)
    inverse = inverted(values[GYRO_MATRIX].reshape(3, 3))
    conditions = TableConditions(
        readings,
        task.site.gravity,
        values,
        joint.free,
        norm=task.force.extra,
        wander=joint.wander,
        tilt=joint.tilt,
    )
    variance = np.diagonal(conditions.linearise(values[joint.free]).covariance, axis1=1, axis2=2)
    residuals, sigmas = np.full((len(spins), 3), np.nan), np.full((len(spins), 3), np.nan)
    for k, s in np.argwhere(readings.row >= 0).tolist():
        at = int(readings.row[k, s])
        beside = values[GYRO_BIAS] + values[G_SENSITIVITY].reshape(3, 3) @ true[k]
        total = readings.rate[k, s] + values[VERTICAL]
        residuals[at] = inverse @ (readings.shown[k, s] - beside) - total * up[k]
        sigmas[at] = np.sqrt(variance[k, 1 + 3 * s : 4 + 3 * s])
    return residuals, sigmas


def _spin_rates(task: _Task, count: int) -> Series:
    rates = np.zeros(count)
    for k, group in enumerate(task.groups):
        rates[group.rows] = task.readings.rate[k, : len(group.rows)]
    return rates


def _spin_names(task: _Task, count: int) -> tuple[str, ...]:
    names = ["a spin of which the pose was not found"] * count
    for group in task.groups:
        for row, step in zip(group.rows, group.spins, strict=True):
            names[row] = step.name or f"{np.degrees(step.rate):+.4g}°/s, {group.name or 'no name'}"
    return tuple(names)


def _left_out(task: _Task, norms: TriadFit, hold_norms: Series) -> list[LeftOut]:
    holds = left_out_holds(task.force.outliers, hold_norms)
    spun = [
        LeftOut(
            "spin", o.group, f"its rate is off the table's by {o.normalised:.1f} times what the others show"
        )
        for o in norms.outliers
    ]
    return holds + spun


def _not_determined(task: _Task) -> list[str]:
    plumb = (
        "The table's axis is taken as plumb: by the angle that it leans against the vertical in all poses alike, the "
        "rotation between the triads may be off."
    )
    sentences = [plumb]
    if task.site.latitude is None:
        sentences.append(
            "No latitude was given: the Earth's rotation about the table's axis was an unknown with "
            "a prior standard uncertainty of 4.2e-5 rad/s. It looks like a g-sensitivity that is "
            "equal on all axes. Give --site LATITUDE."
        )
    return sentences


def _remarks(task: _Task, joint: _Joint, norms: TriadFit) -> list[str]:
    slowest = float(np.min(np.abs(task.readings.rate[task.readings.row >= 0])))
    vertical = float(joint.values[VERTICAL])
    ppm = two_digits(1e6 * abs(vertical) / slowest)
    remarks = [_against_syed(task, joint, norms)]
    if task.site.latitude is not None:
        remarks.append(
            f"The Earth's rotation about the table's axis was added to its rate: {vertical:.3g} rad/s, {ppm} ppm of "
            "the slowest spin. Left out, the two directions would contradict each other by twice that."
        )
    else:
        at = int(np.searchsorted(joint.free, VERTICAL))
        sigma = float(np.sqrt(joint.adjustment.cofactor[at, at]))
        remarks.append(
            f"The Earth's rotation about the table's axis came out of the spins as {vertical:.3g} ± {sigma:.1g} rad/s, "
            f"{ppm} ppm of the slowest."
        )
    if joint.tilt > 0.0:
        remarks.append(
            "The table's axis and the vertical that the accelerometers show at rest differ by about "
            f"{two_digits(1e3 * joint.tilt)} mrad from pose to pose: a table that leans, or a pose "
            "that creeps. Each misalignment between the triads is known that much worse, and the "
            "stated uncertainties include it."
        )
    return remarks


def _against_syed(task: _Task, joint: _Joint, norms: TriadFit) -> str:
    """Return how the solution by norms alone compares."""
    scale, angles = shin_from_matrix(lower_factor(joint.values[GYRO_MATRIX].reshape(3, 3)))
    ours = np.concatenate([joint.values[GYRO_BIAS], np.real(scale), np.real(angles)])
    difference = (norms.unknowns[:9] - ours) / np.sqrt(np.diag(norms.covariance)[:9])
    worst = int(np.argmax(np.abs(difference)))
    names = [f"{what} {axis}" for what in ("bias", "scale factor") for axis in "xyz"]
    names += [f"non-orthogonality {angle}" for angle in ("yz", "zx", "zy")]
    relative = two_digits(1e6 * float(np.max(np.abs(norms.unknowns[SCALE] / np.real(scale) - 1.0))))
    return (
        "By norms alone (Syed et al. 2007) the gyros' nine parameters differ from these by at most "
        f"{abs(difference[worst]):.1f} of their standard uncertainties ({names[worst]}), the scale "
        f"factors by at most {relative} ppm. The whole vectors also determine the rotation between "
        "the triads."
    )


def _run(session: Session) -> Estimate:
    protocol, matching = session.matched
    return calibrate_modified_multi_position(
        session.recording, session.means, session.spins, matching, protocol, session.site, prior=session.prior
    )


PROCEDURE = Procedure(
    "modified-multi-position",
    _run,
    "accelerometer-x",
    "a single-axis table and hands",
    "nine or more poses on the table, each spun both ways",
    "both triads in full, and the rotation between them",
    "modified-multi-position.md",
    takes=frozenset({"prior"}),
    example="modified-multi-position",
    remedy="spin faster or longer, both ways in more different poses",
    believes=True,
    free_turns=False,
    gyros_from="rates",
)
