"""From a settled thermal adjustment to the estimate: what was seen, what it comes to, and every word about it."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.triad_unknowns import BIAS
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    LeftOut,
    OverTemperature,
    TermTest,
    correlation_matrix,
    coverage_factor,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import Holds
from tumble.calibration.procedures.multi_position import fit_norms
from tumble.calibration.thermal.coverage import Coverage
from tumble.calibration.thermal.doubt import Doubts
from tumble.calibration.thermal.evidence import BiasCurve, SeparateBias, ThermalCurves
from tumble.calibration.thermal.fit import ThermalFit, name_of
from tumble.calibration.thermal.model import ThermalSolution, bias_curve
from tumble.calibration.thermal.points import ThermalPoints
from tumble.calibration.thermal.turns import TurnedMatrix
from tumble.calibration.thermal.wander import Levels, wander_variance
from tumble.calibration.thermal.words import not_determined_words, thermal_parameters, thermal_remarks
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.recording.recording import Recording

CURVE = 41
# A model that more rests than this contradict does not describe them; as many of one branch are more than chance.
LARGEST_SHARE_CONTRADICTING, FEWEST_OF_BRANCH = 0.1, 4


def thermal_evidence(
    everything: ThermalPoints,
    kept: ThermalPoints,
    fit: ThermalFit,
    solution: ThermalSolution,
    coverage: Coverage,
    factors: tuple[float, float],
    soaks: Series | None,
    site: Site,
) -> ThermalCurves:
    """Return what an adjustment was made of, for those who look at it.

    Parameters
    ----------
    everything, kept : points, near SI: all of them, and those that took part.
    fit, solution : the adjustment, and the model in raw units.
    coverage, soaks : what of temperature was covered; °C of the soaks, None for a sweep.
    factors : near SI per raw unit, of the accelerometers and of the gyros.
    site : for the test of each soak alone.
    """
    conditions, layout = fit.conditions, fit.layout
    functions = conditions.functions(fit.values)
    size = layout.terms.basis.size
    celsius = kept.path.means(kept.path.followed(*conditions.lag_and_width(fit.values))[0][:, None])[:, 0]
    nothing = np.full((len(kept), 3), np.nan)
    force, rate, rate_sigma = (nothing.copy() for _ in range(3))
    linear = conditions.linearise(fit.values)
    left = np.where(linear.active, linear.misclosure, np.nan)
    variance = np.diagonal(linear.covariance, axis1=1, axis2=2)
    # What a rest is off by has its own noise in it, and the wander that neighbours have in common.
    expected = np.sqrt(variance + wander_variance(conditions, fit.levels))
    grid = np.linspace(*coverage.span, CURVE)
    curves: dict[str, BiasCurve] = {}
    if layout.has_force and kept.force_covariance is not None:
        curves["accelerometer"] = bias_curve("force", fit.values, fit.covariance, layout, factors[0], grid)
        here = conditions.own >= 0
        shown = conditions.biases(fit.values, functions, "force") + left[:, :3]
        force[here] = shown[here] / factors[0]
    if layout.has_rate:
        curves["gyroscope"] = bias_curve("rate", fit.values, fit.covariance, layout, factors[1], grid)
        rate = (conditions.biases(fit.values, functions, "rate") + left[:, 3:]) / factors[1]
        rate_sigma = np.sqrt(variance[:, 3:]) / factors[1]
    step = max(1, everything.path.time.size // 2000)
    return ThermalCurves(
        coverage.kind,
        name_of(layout.terms.basis),
        kept.start,
        kept.stop,
        celsius,
        functions[:, size],
        functions[:, size + 1],
        force,
        rate,
        rate_sigma,
        left / expected,
        curves,
        everything.path.time[::step],
        everything.path.recorded[::step],
        _separate(kept, fit, factors, soaks, site) if layout.terms.poses == 9 else [],
        rejected=coverage.rejected,
        lag=solution.model.lag,
        lag_sigma=solution.lag_sigma,
        width=solution.model.hysteresis_width,
        width_sigma=solution.width_sigma,
    )


def _separate(
    kept: ThermalPoints, fit: ThermalFit, factors: tuple[float, float], soaks: Series | None, site: Site
) -> list[SeparateBias]:
    """Return the multi-position test of each soak alone, beside the one adjustment of all."""
    if soaks is None or kept.force is None or kept.force_covariance is None:
        return []
    nearest = np.argmin(np.abs(kept.celsius[:, None] - soaks[None]), axis=1)
    found: list[SeparateBias] = []
    for k, celsius in enumerate(soaks.tolist()):
        here = nearest == k
        try:
            alone = fit_norms(
                kept.force[here],
                kept.force_covariance[here]
                + (fit.levels.single["force"] + fit.levels.flicker["force"]) * np.eye(3),
                site.gravity,
                rough_triad(kept.force[here], site.gravity),
                np.arange(9),
                robust=False,
            )
        except (ObservabilityError, ConvergenceError):
            continue
        # Both with rests that are independent of one another: a soak alone could not know better.
        joint = bias_curve(
            "force", fit.values, fit.adjustment.cofactor, fit.layout, factors[0], np.array([celsius])
        )
        sigma = np.sqrt(np.diag(alone.covariance)[BIAS]) / factors[0]
        found.append(SeparateBias(celsius, alone.unknowns[BIAS] / factors[0], sigma, joint.sigma[0]))
    return found


def thermal_estimate(
    recording: Recording,
    site: Site,
    fit: ThermalFit,
    solution: ThermalSolution,
    coverage: Coverage,
    evidence: ThermalCurves,
    tests: list[TermTest],
    kept: ThermalPoints,
    turned: TurnedMatrix | None,
    doubts: Doubts,
) -> Estimate:
    """Return the estimate that the procedure hands over.

    Parameters
    ----------
    recording, site : what was recorded, and where.
    fit, solution, coverage, evidence, kept : of the adjustment.
    tests : of optional terms.
    turned : the gyros' matrix from turns; None without one.
    doubts : what is in the uncertainties because the recording cannot show it.
    """
    terms, layout = fit.layout.terms, fit.layout
    gyro = "none" if not layout.has_rate else ("bias" if turned is None else "full")
    optional = frozenset({"g_sensitivity"}) if terms.g_sensitivity else frozenset[str]()
    described = describe_unknowns(
        solution.unknowns, solution.unknowns_covariance, site, recording, terms=optional, gyro=gyro
    )
    names, parameters = described.names, described.parameters
    covariance, correlations = described.covariance, described.correlations
    if not terms.poses:
        # Of the accelerometers nothing is known at the reference but what the sheet says: not named.
        at = [i for i, name in enumerate(names) if not name.startswith("accelerometer")]
        names, covariance = [names[i] for i in at], covariance[np.ix_(at, at)]
        shown = [i for i, p in enumerate(parameters) if not p.name.startswith("accelerometer")]
        parameters, correlations = [parameters[i] for i in shown], correlations[np.ix_(shown, shown)]
    elif terms.poses == 6:
        zero = [i for i, p in enumerate(parameters) if "accelerometer non-orthogonality" in p.name]
        shown = [i for i in range(len(parameters)) if i not in zero]
        parameters, correlations = [parameters[i] for i in shown], correlations[np.ix_(shown, shown)]
    own = thermal_parameters(solution, terms, recording, evidence)
    parameters = [*parameters, *own]
    correlations = _padded(correlations, len(own), solution)
    norms, sigmas = _norms(fit, kept)
    return estimate_of(
        "thermal",
        Described(described.model, names, covariance, parameters, correlations),
        _figures(fit, evidence),
        left_out=_left_out(fit, kept),
        terms=tests,
        said=said_of(
            remarks=[*thermal_remarks(fit, solution, coverage, evidence, turned), *coverage.remarks],
            cautions=coverage.cautions,
            objections=[*_on_untested(evidence), *_on_left_out(fit, kept)],
            not_determined=not_determined_words(terms, layout, coverage, recording, turned, doubts),
        ),
        evidence=[Holds(norms, sigmas), evidence] if norms.size else [evidence],
        thermal=OverTemperature(solution.model, solution.names, solution.covariance),
    )


def _figures(fit: ThermalFit, evidence: ThermalCurves) -> Figures:
    largest = float(np.nanmax(np.abs(evidence.residuals))) if np.any(np.isfinite(evidence.residuals)) else 0.0
    return Figures(
        fit.alone,
        fit.adjustment.sigma0,
        fit.adjustment.redundancy,
        _factor(fit.levels),
        largest,
        {
            "accelerometer bias from rest to rest, m/s²": float(np.sqrt(fit.levels.single["force"])),
            "gyro bias from rest to rest, rad/s": float(np.sqrt(fit.levels.single["rate"])),
            "accelerometer bias, flicker floor of the Allan deviation, m/s²": float(
                np.sqrt(fit.levels.flicker["force"])
            ),
            "gyro bias, flicker floor of the Allan deviation, rad/s": float(
                np.sqrt(fit.levels.flicker["rate"])
            ),
        },
    )


def _left_out(fit: ThermalFit, kept: ThermalPoints) -> list[LeftOut]:
    return [
        LeftOut(
            "hold",
            int(kept.hold[o.group]),
            f"between {kept.start[o.group]:.0f} and {kept.stop[o.group]:.0f} s its "
            f"{'specific force' if o.kind == 'force' else 'angular rate'} is {o.normalised:.1f} times off what "
            "the others show",
        )
        for o in fit.outliers
    ]


def _on_untested(evidence: ThermalCurves) -> list[str]:
    """Object to functions of temperature that predicted nothing that was left out."""
    if evidence.candidates:
        return []
    left = "soak" if evidence.kind == "soak" else "band of temperature"
    said = (
        f"Without one {left} the other rests do not determine the functions of temperature. "
        f"So nothing shows whether a {evidence.basis} is enough. "
        "Record more temperatures, or more poses at each, and let each temperature settle."
    )
    return [said]


def _on_left_out(fit: ThermalFit, kept: ThermalPoints) -> list[str]:
    """Object to a model that so many rests contradict, or most rests of one branch."""
    gone = np.zeros(len(kept), dtype=bool)
    gone[[o.group for o in fit.outliers]] = True
    said: list[str] = []
    count = int(np.count_nonzero(gone))
    if count > LARGEST_SHARE_CONTRADICTING * len(kept):
        said.append(
            f"{count} of {len(kept)} rests contradict the model and were left out: the functions of temperature do not "
            "describe what this unit does. Sweep slower, or so that each temperature settles."
        )
    for branch, name in ((kept.hysteresis > 0.0, "heating"), (kept.hysteresis < 0.0, "cooling")):
        of_branch, left = int(np.count_nonzero(branch)), int(np.count_nonzero(branch & gone))
        if left >= FEWEST_OF_BRANCH and 2 * left > of_branch:
            said.append(
                f"{left} of {of_branch} rests while {name} were left out: what is left describes one branch alone."
            )
    return said


def _factor(levels: Levels) -> float:
    """Return the coverage factor for 95 %: how much biases wander was found from these rests, too."""
    degrees = min(levels.freedom.values())
    return coverage_factor(max(int(degrees), 3)) if np.isfinite(degrees) else 1.96


def _padded(correlations: AnyArray, count: int, solution: ThermalSolution) -> AnyArray:
    """Return the correlations with those of the thermal parameters beside them, of which `count` are listed."""
    first = correlations.shape[0]
    whole = np.eye(first + count)
    whole[:first, :first] = correlations
    listed = np.flatnonzero(np.diag(solution.covariance) > 0.0)
    inner = correlation_matrix(solution.covariance)[np.ix_(listed, listed)]
    whole[first : first + listed.size, first : first + listed.size] = inner
    return whole


def _norms(fit: ThermalFit, kept: ThermalPoints) -> tuple[Series, Series]:
    """Return what each rest's corrected specific force differs from gravity by, and its expected size, m/s²."""
    if kept.force is None or kept.force_covariance is None or not fit.layout.terms.poses:
        return np.zeros(0), np.zeros(0)
    conditions = fit.conditions
    functions = conditions.functions(fit.values)
    matrices = conditions.matrices(fit.values, functions)
    raw = kept.force - conditions.biases(fit.values, functions, "force")
    corrected: Vectors = np.asarray(np.linalg.solve(matrices, raw[:, :, None])[:, :, 0], dtype=np.float64)
    length = np.linalg.norm(corrected, axis=1)
    unit = corrected / length[:, None]
    spread = kept.force_covariance + (fit.levels.single["force"] + fit.levels.flicker["force"]) * np.eye(3)
    return length - conditions.gravity, np.sqrt(np.einsum("na,nab,nb->n", unit, spread, unit))
