"""Multi-position calibration by the Gauss-Helmert adjustment of norms (Shin and El-Sheimy; Hayal 2010).

Nothing is known of the poses but that the unit rests in each: the corrected specific force has the
norm of gravity, the corrected angular rate that of the Earth's rotation. Accelerometers and gyros
are adjusted apart. What the norms cannot see is the rotation between the triads.

A gyro shows its scale factors on the Earth rate only if a hold's mean rate is known to a small part
of it. The largest of the 9-, 6- and 3-parameter solutions that the noise allows is taken; where even
the bias cannot be told that way, the bias is the mean over the holds, with the Earth rate as noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Vectors, inverted
from tumble.attitude import skew
from tumble.calibration.canonical import Complex, describe_unknowns
from tumble.calibration.checks.scores import left_out_holds
from tumble.calibration.checks.snooping import Kind, Outlier, balance, wald_test
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.norm import NormConditions
from tumble.calibration.equations.placement_bias import G_SENSITIVITY_FALSE_ALARM
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
from tumble.calibration.evidence import Holds
from tumble.calibration.poses import require_poses
from tumble.calibration.prior import FleetSheet, StableKnowledge, about_sheet, prior_of_sheet
from tumble.calibration.procedure import Procedure
from tumble.calibration.session import Session
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.estimation import Adjustment, Prior, adjust
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.simulation import Grade
from tumble.units import angular_rate_factor, specific_force_factor

# Worse than this, a gyro's scale and angles from the Earth rate are worse than any data sheet's.
WORST_GYRO_SCALE = 0.01
# Prior of the rotation between the triads about each axis, where norms alone are there: 10 mrad.
ROTATION_SIGMA = 0.01
_NORM = slice(0, 1)
BIAS_ONLY = (
    "The gyro cannot see the Earth's rotation in these holds, so that its scale factors and misalignments are "
    "not given. Turn the unit between the holds about all axes, and the hand-held procedure gives them."
)


@dataclass(slots=True)
class TriadFit:
    """One triad's adjustment: all twelve unknowns, which were free, and their covariance (12, 12)."""

    unknowns: Series
    free: np.ndarray
    covariance: Square
    adjustment: Adjustment
    alone: float
    extra: float
    outliers: list[Outlier] = field(default_factory=list[Outlier])


def fit_norms(
    observed: Vectors,
    covariance: Matrices,
    reference: float | Series,
    start: Series,
    free: np.ndarray,
    *,
    prior: Prior | None = None,
    robust: bool = True,
    between: AnyArray | None = None,
) -> TriadFit:
    """Adjust a triad's unknowns `free` so that every hold's corrected norm is `reference`.

    Parameters
    ----------
    reference : SI; one for all holds, or (holds,).
    observed, covariance : (holds, 3), (holds, 3, 3) of the hold means, raw.
    start : (12,) start values; unknowns not in `free` keep them.
    free : indices into the twelve unknowns.
    prior : over the free unknowns.
    robust : look for outlying holds.
    between : (3, holds, holds) covariance of the means of different holds for each axis. The adjustment weighs
        holds as if they were independent, and the covariance of its result counts that they are not.

    Raises
    ------
    ObservabilityError
        If there are fewer holds than unknowns, or they do not tell them apart.
    ConvergenceError
        If it does not settle, or settles in the mirror root with a negative scale factor.
    """
    known = 0 if prior is None else prior.rank
    if observed.shape[0] + known < free.size:
        raise ObservabilityError(
            f"{observed.shape[0]} holds cannot determine {free.size} unknowns: record at least "
            f"{free.size + 1}."
        )
    values = [start]

    def solve(extra: dict[str, float], active: np.ndarray, *, once: bool) -> Adjustment:
        conditions = NormConditions(
            observed, covariance, reference, values[-1], free, active[:, 0], extra["norm"]
        )
        adjustment = adjust(conditions, values[-1][free], prior=prior, once=once)
        full = values[-1].copy()
        full[free] = adjustment.parameters
        if np.any(full[SCALE] <= 0):
            raise ConvergenceError(
                "The adjustment ended in a mirror root with a negative scale factor. Either the "
                "holds are too noisy for this many unknowns, or the columns are not what they are "
                "said to be."
            )
        values.append(full)
        return adjustment

    active = np.ones((observed.shape[0], 1), dtype=bool)
    alone = solve({"norm": 0.0}, active, once=False).sigma0
    spare = observed.shape[0] + known - free.size
    balanced = balance(solve, [Kind("norm", _NORM)], active, robust=robust and spare >= 4)
    adjustment, extra, outliers = balanced.adjustment, balanced.extra, balanced.outliers
    full = np.zeros((COUNT, COUNT))
    full[np.ix_(free, free)] = adjustment.cofactor
    if between is not None:
        conditions = NormConditions(observed, covariance, reference, values[-1], free)
        full[np.ix_(free, free)] += _of_alike_holds(conditions, adjustment, values[-1][free], between)
    return TriadFit(values[-1], free, full, adjustment, alone, extra["norm"], outliers)


def _of_alike_holds(
    conditions: NormConditions, adjustment: Adjustment, unknowns: Series, between: AnyArray
) -> Square:
    """What covariance between holds adds to that of the unknowns: M C M' with M that takes holds to unknowns."""
    conditions.active = adjustment.linearisation.active[:, 0]
    conditions.linearise(unknowns)
    whitened = adjustment.chain.solve(adjustment.linearisation.design)[:, 0, :]
    carried = adjustment.cofactor @ whitened.T
    return np.asarray(carried @ conditions.between_holds(between) @ carried.T)


@dataclass(slots=True)
class _GyroFit:
    """What the holds tell of the gyro: "full" or "bias", with words for the user."""

    kind: str
    values: Series
    covariance: Square
    remark: str
    sigma0: float
    outliers: list[Outlier] = field(default_factory=list[Outlier])
    test: TermTest | None = None
    remarks: list[str] = field(default_factory=list[str])
    objections: list[str] = field(default_factory=list[str])


def calibrate_multi_position(
    recording: Recording,
    means: HoldMeans,
    site: Site,
    *,
    prior: StableKnowledge | None = None,
    data_sheet: Grade | FleetSheet | None = None,
    unknowns: int = 9,
    progress: Callable[[str], None] | None = None,
) -> Estimate:
    """Calibrate the accelerometers on gravity and the gyros, as far as they see it, on the Earth rate.

    Parameters
    ----------
    recording : for its units.
    means : the holds' means and covariances.
    site : gravity.
    prior : non-orthogonalities of an earlier calibration; six poses then suffice.
    data_sheet : spreads of a grade, or a fleet's mean and spread, as a prior of all nine unknowns of both triads
        (P of Hayal 3.38); a grade's for raw numbers in a known unit. Six poses then suffice.
    unknowns : of a triad: 9 (bias, scale factor, non-orthogonality), 6 (without non-orthogonality) or
        3 (bias alone); what is not estimated is nominal, or the prior's.

    Raises
    ------
    UsageError
        If `unknowns` is another number, or 3 or a data sheet goes with raw counts, whose scale nobody has
        said.
    ObservabilityError
        If poses are too few or too alike; the message names the pose that would tell more.
    ConvergenceError
        If an adjustment fails.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: the multi-position test needs one.")
    say = progress or _silent
    say("accelerometers")
    start = rough_triad(means.specific_force, site.gravity)
    if prior is not None:
        start[ANGLE] = prior.angles
    factor = specific_force_factor(recording.specific_force_unit)
    _check_unknowns(unknowns, factor)
    if unknowns == 3 and factor is not None:
        start[SCALE] = 1.0 / factor
    known = prior is not None or data_sheet is not None
    require_poses(means.specific_force, start, has_prior=known, unknowns=unknowns, factor=factor)
    free = np.arange(unknowns)
    constraint = _constraint(prior, data_sheet, recording.specific_force_unit, unknowns)
    force = fit_norms(
        means.specific_force,
        means.specific_force_covariance,
        site.gravity,
        start,
        free,
        prior=constraint,
        between=means.specific_force_between,
    )
    say("gyros")
    specific_force_b = triad_from_unknowns(force.unknowns).correct(means.specific_force)
    gyro = _fit_gyro(recording, means, specific_force_b, site, unknowns, data_sheet)
    estimate = _estimate(recording, means, site, force, gyro)
    if data_sheet is not None and constraint is not None:
        said = about_sheet(
            "accelerometer", force.unknowns[:9], np.sqrt(np.diag(force.covariance)[:9]), constraint
        )
        estimate.say("remark", *said[0], *([] if gyro is None else gyro.remarks))
        estimate.say("objection", *said[1], *([] if gyro is None else gyro.objections))
    if unknowns < 9:
        kept = "non-orthogonalities" if unknowns == 6 else "scale factors and non-orthogonalities"
        of = "an earlier calibration's values" if prior is not None else "their nominal values"
        estimate.say(
            "not determined",
            f"The accelerometers' {kept} were not estimated ({unknowns} unknowns, as asked for): they have {of}, "
            "and no uncertainty is stated for them.",
        )
    return estimate


def _constraint(
    prior: StableKnowledge | None, data_sheet: Grade | FleetSheet | None, unit: str, unknowns: int
) -> Prior | None:
    """Return what is known of the accelerometers' nine unknowns beforehand."""
    if unknowns < 9:
        return None
    if data_sheet is not None:
        return prior_of_sheet(data_sheet, "accelerometer", unit, knowledge=prior)
    return None if prior is None else _angle_prior(prior, 9)


def _reference(norm: float, covariance: Matrices, start: Series) -> Series:
    """Return each hold's reference, the root of K² + 2σ²: for accelerometers the second is below 0.1 ppm.

    Of E|y|² = K² + 3σ² the adjustment takes the part along y out of the observations by itself; what
    remains across it makes every norm too large.
    """
    noise = np.einsum("kaa,a->k", covariance, start[SCALE] ** -2) / 3.0
    return np.sqrt(norm**2 + 2.0 * noise)


def _check_unknowns(unknowns: int, factor: float | None) -> None:
    if unknowns not in (3, 6, 9):
        raise UsageError(
            f"unknowns={unknowns}: it is 9 (bias, scale factor, non-orthogonality), 6 or 3 a triad."
        )
    if unknowns == 3 and factor is None:
        raise UsageError("unknowns=3 takes the scale factors as known, and those of raw counts are not.")


def _angle_prior(prior: StableKnowledge, size: int) -> Prior:
    mean, precision = np.zeros(size), np.zeros((size, size))
    mean[ANGLE] = prior.angles
    precision[ANGLE, ANGLE] = inverted(prior.angle_covariance)
    return Prior(mean, precision)


def _fit_gyro(
    recording: Recording,
    means: HoldMeans,
    specific_force_b: Vectors,
    site: Site,
    unknowns: int,
    data_sheet: Grade | FleetSheet | None,
) -> _GyroFit | None:
    """Take the largest solution on the Earth rate that the noise allows."""
    if means.angular_rate is None or means.angular_rate_covariance is None:
        return None
    factor = angular_rate_factor(recording.angular_rate_unit)
    observed, covariance = means.angular_rate, means.angular_rate_covariance
    for count in (9, 6, 3) if factor else ():
        if count > unknowns:
            continue
        start = np.zeros(COUNT)
        start[SCALE] = 1.0 / float(factor or 1.0)
        start[BIAS] = np.mean(observed, axis=0)
        sheet = None
        if data_sheet is not None and count == 9:
            sheet = prior_of_sheet(data_sheet, "gyroscope", recording.angular_rate_unit)
        # With a prior of everything the Earth's rate may tell as little as it does.
        if not _earth_rate_tells(observed, covariance, start, 3 if sheet is not None else count):
            continue
        reference = _reference(EARTH_RATE, covariance, start)
        try:
            fit = fit_norms(
                observed,
                covariance,
                reference,
                start,
                np.arange(count),
                prior=sheet,
                between=means.angular_rate_between,
            )
        except (ObservabilityError, ConvergenceError):
            continue
        if count > 3 and not _good_enough(fit):
            continue
        return _by_earth_rate(fit, count, sheet)
    return _mean_bias(observed, covariance, factor, specific_force_b, site)


def _by_earth_rate(fit: TriadFit, count: int, sheet: Prior | None) -> _GyroFit:
    """The fit of 9, 6 or 3 unknowns as what it says of the gyro."""
    values, full = np.zeros(TOTAL), np.zeros((TOTAL, TOTAL))
    values[GYRO_MATRIX] = triad_from_unknowns(fit.unknowns).matrix.ravel()
    values[GYRO_BIAS] = fit.unknowns[BIAS]
    full[12:24, 12:24] = _matrix_and_bias_covariance(fit)
    full[GYRO_MATRIX, GYRO_MATRIX] += _rotation_covariance(values[GYRO_MATRIX].reshape(3, 3))
    seen = {9: "bias, scale factors and non-orthogonalities", 6: "bias and scale factors", 3: "bias"}[count]
    remarks, objections = list[str](), list[str]()
    if sheet is not None:
        sigmas = np.sqrt(np.diag(fit.covariance)[:9])
        remarks, objections = about_sheet("gyro", fit.unknowns[:9], sigmas, sheet)
    return _GyroFit(
        "full" if count > 3 else "bias",
        values,
        full,
        f"The gyro sees the Earth's rotation well enough for {seen} ({count}-parameter solution).",
        fit.alone,
        fit.outliers,
        remarks=remarks,
        objections=objections,
    )


def _earth_rate_tells(observed: Vectors, covariance: Matrices, start: Series, count: int) -> bool:
    """Tell from the noise of the means whether a solution with `count` unknowns is worth trying."""
    in_si = np.sqrt(np.einsum("kaa->k", covariance) / 3.0) / float(start[SCALE][0])
    noise = float(np.median(in_si)) / EARTH_RATE
    # Scale and angles come out at about 1 to 2 times the noise of one hold over the root of holds / 9.
    share = noise / np.sqrt(max(observed.shape[0] / 9.0, 1.0))
    return bool(share < (1.0 / 3.0 if count == 3 else WORST_GYRO_SCALE))


def _good_enough(fit: TriadFit) -> bool:
    sigma = np.sqrt(np.diag(fit.covariance))
    relative = sigma[SCALE] / fit.unknowns[SCALE]
    angles = sigma[ANGLE]
    return bool(np.all(relative < WORST_GYRO_SCALE) and np.all(angles < WORST_GYRO_SCALE))


def _rotation_covariance(matrix: Matrix) -> Square:
    """Return (9, 9): what the rotation between the triads, which norms do not tell, adds to the matrix' entries."""
    moves = np.stack([(matrix @ skew(axis)).ravel() for axis in np.eye(3)], axis=1)
    return ROTATION_SIGMA**2 * (moves @ moves.T)


def _matrix_and_bias_covariance(fit: TriadFit) -> Square:
    """Return (12, 12): covariance of the nine matrix entries and the bias."""
    from tumble.sensor.conventions.shin import matrix_from_shin
    from tumble.sensor.propagation import propagate

    def entries(x: Complex) -> Complex:
        return np.concatenate([matrix_from_shin(x[SCALE], x[ANGLE]).ravel(), x[BIAS]])

    return propagate(entries, fit.unknowns, fit.covariance)[1]


def _mean_bias(
    observed: Vectors, covariance: Matrices, factor: float | None, specific_force_b: Vectors, site: Site
) -> _GyroFit:
    """Return bias, and g-sensitivity if the holds show one; their scatter and the Earth rate count.

    The holds' mean rates are regressed on one and the specific force; the scatter about the fit, with
    the noise of the means as its least value, gives the variance. The Earth rate's vertical part looks
    like a g-sensitivity equal on all axes: a latitude takes it out, without one it counts as noise.
    """
    holds = observed.shape[0]
    nominal = 1.0 / factor if factor else 1.0
    noise = np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0)
    earth = (EARTH_RATE * nominal) ** 2 / 3.0 if factor else 0.0
    values, full = np.zeros(TOTAL), np.zeros((TOTAL, TOTAL))
    values[GYRO_MATRIX] = (nominal * np.eye(3)).ravel()

    design = np.column_stack([np.ones(holds), specific_force_b])
    test = None
    if holds >= 8 and np.linalg.matrix_rank(design, tol=1.0) == 4:
        cofactor = inverted(design.T @ design)
        vertical, vertical_sigma = _vertical_earth_rate(site, nominal if factor else 0.0)
        solution = cofactor @ design.T @ (observed - vertical * specific_force_b)
        residual = observed - vertical * specific_force_b - design @ solution
        variance = np.maximum(np.sum(residual**2, axis=0) / (holds - 4), noise + earth)
        spread = np.zeros((12, 12))
        for axis in range(3):
            at = [axis, *range(3 + 3 * axis, 6 + 3 * axis)]
            spread[np.ix_(at, at)] = variance[axis] * cofactor
        slopes = solution[1:].T.ravel()
        if factor is None:
            # Counts do not tell how large the Earth's part is: all that is equal on the axes may be its.
            vertical_sigma = abs(float(np.mean(slopes[[0, 4, 8]])))
        equal = np.eye(3).ravel() * vertical_sigma
        spread[3:, 3:] += np.outer(equal, equal)
        test = wald_test("g_sensitivity", slopes, spread[3:, 3:], 3 * (holds - 4), G_SENSITIVITY_FALSE_ALARM)
        if test.kept:
            values[GYRO_BIAS], values[G_SENSITIVITY] = solution[0], slopes
            # Bias and g-sensitivity stand one after the other among the unknowns.
            full[GYRO_BIAS.start : G_SENSITIVITY.stop, GYRO_BIAS.start : G_SENSITIVITY.stop] = spread
            return _GyroFit("bias", values, full, BIAS_ONLY, float("nan"), test=test)
    values[GYRO_BIAS] = observed.mean(axis=0)
    scatter = np.var(observed, axis=0, ddof=1) if holds > 3 else np.zeros(3)
    full[GYRO_BIAS, GYRO_BIAS] = np.diag(np.maximum(noise + earth, scatter) / holds)
    return _GyroFit("bias", values, full, BIAS_ONLY, float("nan"), test=test)


def _vertical_earth_rate(site: Site, nominal: float) -> tuple[float, float]:
    """Return the raw rate per specific force that the Earth's vertical part gives, and its sigma."""
    if site.latitude is None:
        return 0.0, nominal * EARTH_RATE / np.sqrt(3.0) / site.gravity
    return nominal * EARTH_RATE * float(np.sin(site.latitude)) / site.gravity, 0.0


def _estimate(
    recording: Recording, means: HoldMeans, site: Site, force: TriadFit, gyro: _GyroFit | None
) -> Estimate:
    values, covariance = np.zeros(TOTAL), np.zeros((TOTAL, TOTAL))
    if gyro is not None:
        values, covariance = gyro.values.copy(), gyro.covariance.copy()
    values[FORCE] = force.unknowns
    covariance[FORCE, FORCE] = force.covariance
    kind = "none" if gyro is None else gyro.kind
    test = None if gyro is None else gyro.test
    terms = frozenset({"g_sensitivity"}) if test is not None and test.kept else frozenset[str]()
    described = describe_unknowns(values, covariance, site, recording, terms=terms, gyro=kind)
    adjustment = force.adjustment
    assert means.specific_force is not None
    corrected = triad_from_unknowns(force.unknowns).correct(means.specific_force)
    norms = np.linalg.norm(corrected, axis=1) - site.gravity
    variance = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, 0]
    components = {"accelerometer bias from hold to hold, m/s²": float(np.sqrt(force.extra))}
    return estimate_of(
        "multi-position",
        described,
        Figures.of(adjustment, force.alone, components, tested=[_NORM], estimated=force.extra > 0),
        left_out=_left_out(force, gyro, norms),
        terms=[] if test is None else [test],
        said=said_of(remarks=[] if gyro is None else [gyro.remark], not_determined=_not_determined(kind)),
        evidence=[Holds(norms, np.sqrt(variance))],
    )


def _left_out(force: TriadFit, gyro: _GyroFit | None, norms: Series) -> list[LeftOut]:
    left = left_out_holds(force.outliers, norms)
    if gyro is not None:
        left += [
            LeftOut("hold", o.group, f"its angular rate is {o.normalised:.1f} times off what the others show")
            for o in gyro.outliers
        ]
    return left


def _not_determined(kind: str) -> list[str]:
    sentences = {
        "none": "The recording has no gyro.",
        "bias": "The gyro's scale factors and misalignments are not determined by holds alone; "
        "where its unit is known its matrix is the nominal one (identity), without a stated uncertainty.",
        "full": "The rotation between the triads is not determined by norms; it is taken as zero, "
        "with a prior standard uncertainty of 10 mrad.",
    }
    return [sentences[kind]]


def _silent(_: str) -> None:
    """Tell nobody."""


def _run(session: Session) -> Estimate:
    options = session.options
    return calibrate_multi_position(
        session.recording,
        session.means,
        session.site,
        prior=session.prior,
        data_sheet=options.data_sheet,
        unknowns=options.unknowns or 9,
        progress=session.say,
    )


PROCEDURE = Procedure(
    "multi-position",
    _run,
    "accelerometer-x",
    "nothing, and a gyro without turns",
    "nine or more poses (six with an earlier calibration); turns do not matter",
    "accelerometers in full; of the gyros what the Earth's rotation determines: for most units bias "
    "and g-sensitivity only",
    "multi-position.md",
    takes=frozenset({"prior", "data_sheet", "unknowns"}),
    joint_believes=False,
    counts_between_holds=True,
)
