"""From a settled thermal adjustment to the estimate: what was seen, what it comes to, and every word about it."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Series, Table, Vectors
from tumble.calibration.checks.snooping import Kind, balance
from tumble.calibration.equations.norm import NormConditions
from tumble.calibration.equations.triad_unknowns import BIAS, SCALE
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    LeftOut,
    OverTemperature,
    correlation_matrix,
    coverage_factor,
    said_of,
)
from tumble.calibration.evidence import Holds
from tumble.calibration.outcome.description import describe
from tumble.calibration.start_values import rough_triad
from tumble.calibration.thermal.evidence import BiasCurve, SeparateBias, ThermalCurves
from tumble.calibration.thermal.fit import REFUSED, name_of
from tumble.calibration.thermal.model import ThermalOutcome, bias_curve
from tumble.calibration.thermal.wander import wander_variance
from tumble.calibration.thermal.words import not_determined_words, thermal_parameters, thermal_remarks
from tumble.estimation import Adjustment, adjust

CURVE = 41
# A model that more rests than this contradict does not describe them; as many of one branch are more than chance.
LARGEST_SHARE_CONTRADICTING, FEWEST_OF_BRANCH = 0.1, 4


def thermal_evidence(found: ThermalOutcome) -> ThermalCurves:
    """Return what an adjustment was made of, for those who look at it."""
    fit, kept, factors, path = found.fit, found.points, found.factors, found.everything.path
    conditions, layout, model = fit.conditions, fit.layout, found.solution.model
    functions, linear = conditions.functions(fit.values), conditions.linearise(fit.values)
    left = np.where(linear.active, linear.misclosure, np.nan)
    variance = np.diagonal(linear.covariance, axis1=1, axis2=2)
    # What a rest is off by has its own noise in it, and the wander that neighbours have in common.
    expected = np.sqrt(variance + wander_variance(conditions, fit.levels))
    grid = np.linspace(*found.coverage.span, CURVE)
    curves: dict[str, BiasCurve] = {}
    force, rate, rate_sigma = (np.full((len(kept), 3), np.nan) for _ in range(3))
    if layout.has_force:
        curves["accelerometer"] = bias_curve(fit, fit.covariance, "", factors[0], grid)
        shown = conditions.biases(fit.values, functions, "") + left[:, :3]
        force[conditions.own >= 0] = shown[conditions.own >= 0] / factors[0]
    if layout.has_rate:
        curves["gyroscope"] = bias_curve(fit, fit.covariance, "g", factors[1], grid)
        rate = (conditions.biases(fit.values, functions, "g") + left[:, 3:]) / factors[1]
        rate_sigma = np.sqrt(variance[:, 3:]) / factors[1]
    step = max(1, path.time.size // 2000)
    return ThermalCurves(
        found.coverage.kind,
        name_of(fit.terms.basis),
        kept.start,
        kept.stop,
        kept.path.means(kept.path.followed(model.lag, model.hysteresis_width)[0][:, None])[:, 0],
        functions[:, -2],
        functions[:, -1],
        force,
        rate,
        rate_sigma,
        left / expected,
        curves,
        path.time[::step],
        path.recorded[::step],
        _separate(found) if fit.terms.poses == 9 else [],
        found.candidates,
        found.coverage.rejected,
        model.lag,
        found.sigma_of("lag"),
        model.hysteresis_width,
        found.sigma_of("width"),
        found.poses,
    )


def _separate(found: ThermalOutcome) -> list[SeparateBias]:
    """Return the multi-position test of each soak alone, beside the one adjustment of all."""
    fit, test, points, factor = found.fit, found.fit.conditions.test, found.points, found.factors[0]
    if test.soaks is None or points.force is None or points.force_covariance is None:
        return []
    nearest = np.argmin(np.abs(points.celsius[:, None] - test.soaks[None]), axis=1)
    wander = (fit.levels.single["force"] + fit.levels.flicker["force"]) * np.eye(3)
    separate: list[SeparateBias] = []
    for k, celsius in enumerate(test.soaks.tolist()):
        here = nearest == k
        try:
            alone = _norms_alone(points.force[here], points.force_covariance[here] + wander, test.gravity)
        except REFUSED:
            continue
        if np.all(alone.parameters[SCALE] > 0.0):
            # Both with rests that are independent of one another: a soak alone could not know better.
            joint = bias_curve(fit, fit.adjustment.cofactor, "", factor, np.array([celsius]))
            bias, sigma = alone.parameters[BIAS] / factor, np.sqrt(np.diag(alone.cofactor)[BIAS]) / factor
            separate.append(SeparateBias(celsius, bias, sigma, joint.sigma[0]))
    return separate


def _norms_alone(force: Vectors, covariance: Matrices, gravity: float) -> Adjustment:
    """Adjust a triad's nine unknowns to the norm of gravity."""
    start = rough_triad(force, gravity)
    values, everything = [start], np.arange(9)

    def solve(extra: dict[str, float], active: np.ndarray, once: bool) -> Adjustment:
        conditions = NormConditions(
            force, covariance, gravity, values[-1], everything, active[:, 0], extra["norm"]
        )
        adjustment = adjust(conditions, values[-1][:9], once=once)
        values.append(np.concatenate([adjustment.parameters, start[9:]]))
        return adjustment

    active = np.ones((len(force), 1), dtype=bool)
    return balance(solve, [Kind("norm", slice(0, 1))], active, robust=False).adjustment


def thermal_estimate(found: ThermalOutcome) -> Estimate:
    """Return the estimate that the procedure hands over."""
    solution, evidence = found.solution, thermal_evidence(found)
    norms, sigmas = _norms(found)
    return Estimate(
        "thermal",
        *_described(found),
        *_figures(found, evidence),
        left_out=_left_out(found),
        terms=[*found.tests],
        said=said_of(
            remarks=[*thermal_remarks(found, evidence), *found.coverage.remarks],
            cautions=found.coverage.cautions,
            objections=[*_on_untested(evidence), *_on_left_out(found)],
            not_determined=not_determined_words(found),
        ),
        evidence=[Holds(norms, sigmas), evidence] if norms.size else [evidence],
        thermal=OverTemperature(solution.model, solution.model.names, solution.covariance),
    )


def _described(found: ThermalOutcome) -> Described:
    """Return the unit at the reference, and the thermal parameters beside it."""
    solution, layout, terms = found.solution, found.fit.layout, found.fit.terms
    gyro = "none" if not layout.has_rate else ("bias" if found.turned is None else "full")
    optional = frozenset({"g_sensitivity"}) if terms.g_sensitivity else frozenset[str]()
    unknowns, spread = solution.unknowns, solution.unknowns_covariance
    made = describe(
        *(unknowns, spread, found.site, found.recording), terms=optional, gyro=gyro, all_told=True
    )
    # Of the accelerometers nothing is known at the reference but what the sheet says: not named.
    hidden = {0: "accelerometer", 6: "accelerometer non-orthogonality", 9: "nothing"}[terms.poses]
    at = [i for i, name in enumerate(made.names) if not name.startswith(hidden)]
    shown = [i for i, known in enumerate(made.parameters) if not known.name.startswith(hidden)]
    own = thermal_parameters(found)
    return Described(
        made.model,
        [made.names[i] for i in at],
        made.covariance[np.ix_(at, at)],
        [*(made.parameters[i] for i in shown), *own],
        _padded(made.correlations[np.ix_(shown, shown)], len(own), solution.covariance),
    )


def _figures(found: ThermalOutcome, evidence: ThermalCurves) -> Figures:
    fit, seen = found.fit, np.abs(evidence.residuals[np.isfinite(evidence.residuals)])
    # How much biases wander was found from these rests, too.
    degrees = min(fit.levels.freedom.values())
    floor, levels = ", flicker floor of the Allan deviation", fit.levels
    components = {
        f"{triad} bias{what}, {unit}": float(np.sqrt(level[kind]))
        for what, level in ((" from rest to rest", levels.single), (floor, levels.flicker))
        for triad, kind, unit in (("accelerometer", "force", "m/s²"), ("gyro", "rate", "rad/s"))
    }
    return Figures(
        fit.alone,
        fit.adjustment.sigma0,
        fit.adjustment.redundancy,
        coverage_factor(max(int(degrees), 3)) if np.isfinite(degrees) else 1.96,
        float(seen.max(initial=0.0)),
        components,
    )


def _left_out(found: ThermalOutcome) -> list[LeftOut]:
    made: list[LeftOut] = []
    for o in found.fit.outliers:
        start, stop = found.points.start[o.group], found.points.stop[o.group]
        what = "specific force" if o.kind == "force" else "angular rate"
        off = f"its {what} is {o.normalised:.1f} times off what the others show"
        said = f"between {start:.0f} and {stop:.0f} s {off}"
        made.append(LeftOut("hold", int(found.points.hold[o.group]), said))
    return made


def _on_untested(evidence: ThermalCurves) -> list[str]:
    """Object to functions of temperature that predicted nothing that was left out."""
    if evidence.candidates:
        return []
    left = "soak" if evidence.kind == "soak" else "band of temperature"
    said = (
        f"Without one {left} the other rests do not determine the functions of temperature. So nothing shows whether a "
        f"{evidence.basis} is enough. Record more temperatures, or more poses at each, and let each temperature settle."
    )
    return [said]


def _on_left_out(found: ThermalOutcome) -> list[str]:
    """Object to a model that so many rests contradict, or most rests of one branch."""
    kept, gone = found.points, np.zeros(len(found.points), dtype=bool)
    gone[[o.group for o in found.fit.outliers]] = True
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


def _padded(correlations: Table, count: int, covariance: Table) -> Table:
    """Return the correlations with those of the thermal parameters beside them, of which `count` are listed."""
    first = correlations.shape[0]
    whole = np.eye(first + count)
    whole[:first, :first] = correlations
    listed = np.flatnonzero(np.diag(covariance) > 0.0)
    inner = correlation_matrix(covariance)[np.ix_(listed, listed)]
    whole[first : first + listed.size, first : first + listed.size] = inner
    return whole


def _norms(found: ThermalOutcome) -> tuple[Series, Series]:
    """Return what each rest's corrected specific force differs from gravity by, and its expected size, m/s²."""
    kept, fit, conditions = found.points, found.fit, found.fit.conditions
    if kept.force is None or kept.force_covariance is None or not fit.terms.poses:
        return np.zeros(0), np.zeros(0)
    functions = conditions.functions(fit.values)
    raw = kept.force - conditions.biases(fit.values, functions, "")
    matrices = fit.layout.matrices(fit.values, functions)
    corrected = np.linalg.solve(matrices, raw[:, :, None])[:, :, 0]
    length = np.linalg.norm(corrected, axis=1)
    unit = corrected / length[:, None]
    spread = kept.force_covariance + (fit.levels.single["force"] + fit.levels.flicker["force"]) * np.eye(3)
    return length - conditions.gravity, np.sqrt(np.einsum("na,nab,nb->n", unit, spread, unit))
