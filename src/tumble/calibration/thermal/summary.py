"""From a settled thermal adjustment to the estimate: what was seen, what it comes to, and every word about it."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    LeftOut,
    NamedValue,
    OverTemperature,
    correlation_matrix,
    coverage_factor,
)
from tumble.calibration.evidence import BiasCurve, Holds, ThermalCurves
from tumble.calibration.objections import say_of_temperatures
from tumble.calibration.outcome.description import describe
from tumble.calibration.thermal.conditions import ThermalTerms
from tumble.calibration.thermal.fit import LOOP_KELVINS, PULL_FACTOR, RATE_SECONDS, name_of
from tumble.calibration.thermal.model import ThermalOutcome, bias_curve
from tumble.calibration.thermal.wander import wander_variance
from tumble.parameters import thermal_family
from tumble.units import angular_rate_factor, specific_force_factor

CURVE = 41


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
        found.candidates,
        found.coverage.rejected,
        model.lag,
        model.hysteresis_width,
        found.poses,
    )


def thermal_estimate(found: ThermalOutcome) -> Estimate:
    """Return the estimate that the procedure hands over."""
    solution, evidence = found.solution, thermal_evidence(found)
    norms, sigmas = _norms(found)
    estimate = Estimate(
        "thermal",
        *_described(found),
        *_figures(found, evidence),
        left_out=_left_out(found),
        terms=[*found.tests],
        evidence=[Holds(norms, sigmas), evidence] if norms.size else [evidence],
        thermal=OverTemperature(solution.model, solution.covariance),
    )
    estimate.say("remark", *thermal_remarks(found, evidence), *found.coverage.remarks)
    estimate.say("caution", *found.coverage.cautions)
    say_of_temperatures(estimate, found, evidence)
    estimate.say("not determined", *not_determined_words(found))
    return estimate


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


def thermal_parameters(found: ThermalOutcome) -> list[NamedValue]:
    """Return the thermal coefficients with their standard uncertainties and units."""
    model = found.solution.model
    sigmas = np.sqrt(np.maximum(np.diag(found.solution.covariance), 0.0))
    named: list[NamedValue] = []
    for name, value, sigma in zip(model.names, model.vector(), sigmas, strict=True):
        if sigma > 0.0:
            words, unit = _words(name, found)
            named.append(NamedValue(words, float(value), float(sigma), unit))
    for name, words, value, unit in (
        ("lag", "lag of the sensors behind the thermometer", model.lag, "s"),
        ("width", "width of the hysteresis", model.hysteresis_width, "K"),
    ):
        if np.isfinite(sigma := found.sigma_of(name)):
            named.append(NamedValue(thermal_family("", words).named(""), value, sigma, unit))
    return named


def _words(name: str, found: ThermalOutcome) -> tuple[str, str]:
    """Return a coefficient's name in words, and its unit."""
    head, _, place = name.partition("[")
    of, _, what = head.rpartition(".")
    first, *axes = (int(part) for part in place.rstrip("]").split(","))
    triad, raw, true = "accelerometer", found.recording.specific_force_unit, "m/s^2"
    if not head.startswith(triad):
        triad, raw, true = "gyro", found.recording.angular_rate_unit, "rad/s"
    if what in ("rate", "hysteresis"):
        words, unit = ("bias by rate", f"{raw}/(K/s)") if what == "rate" else ("bias hysteresis", raw)
        axes = [first]
    else:
        basis = found.fit.terms.basis
        label, per = basis.labels[first], basis.units[first]
        kind, size = ("matrix", f"{raw}/({true})") if of.endswith("matrix") else ("bias", raw)
        words, unit = f"{kind} {'by' if per else 'at'} {label}", f"{size}/{per}" if per else size
    return thermal_family(triad, words).named("".join("xyz"[axis] for axis in axes)), unit


def not_determined_words(found: ThermalOutcome) -> list[str]:
    """Return what rests at these temperatures cannot tell, a sentence each."""
    terms, kind = found.fit.terms, found.coverage.kind
    with_rate = kind == "ramp" and not found.coverage.both_branches
    force, rate = found.fit.layout.has_force, found.recording.angular_rate is not None
    turned = 0 if found.turned is None else len(found.turned.matrices)
    rows = (
        (force and terms.poses == 0, _ONE_POSE),
        (force and terms.poses == 6, _FACES),
        (force and terms.poses == 9 and not terms.matrix_functions, _ONE_MATRIX),
        (rate and terms.poses == 0, _about_pull(found)),
        (rate and turned == 1, _FEW_TURNS),
        (rate and turned == 0, _NO_TURNS),
        (not found.coverage.both_branches, _about_loop(found)),
        (with_rate, _ONE_WAY),
        (kind == "soak" and not with_rate, _SETTLED),
        (kind == "ramp" and not with_rate and not terms.rate, _NO_RATE),
        (kind == "ramp" and not with_rate and not terms.lag, _NO_LAG),
    )
    return [text for untold, text in rows if untold]


_ONE_POSE = (
    "The accelerometers' biases, scale factors and non-orthogonalities at the reference temperature, and how scale "
    "factors and non-orthogonalities change with temperature. From so few poses they cannot be separated from a bias, "
    "because gravity on an axis that does not move is a constant. The stated change of a bias with temperature is what "
    "that axis shows in the pose of the test. It includes the change of its scale factor times its share of gravity. "
    "Hold nine poses or more at several temperatures (thermal-soak), or tumble the unit during the sweep."
)
_FACES = (
    "The accelerometers' non-orthogonalities: faces alone do not determine them, and they have their nominal values. "
    "Hold edges, too."
)
_ONE_MATRIX = (
    "The accelerometers' scale factors and non-orthogonalities are one for all temperatures: a change of theirs did "
    "not predict what was left out any better."
)
_FEW_TURNS = (
    "How the gyros' scale factors and misalignments change with temperature: there are too few turns for it; the "
    "matrix is one for all temperatures."
)
_NO_TURNS = (
    "The gyros' scale factors, misalignments and their change with temperature: rests show the Earth's rotation only. "
    "Nine turns by hand or more between poses at each of several temperatures determine them, recorded with 20 samples "
    "a turn or more. The matrix is the nominal one, without a stated uncertainty."
)
_ONE_WAY = (
    "Lag between the sensors and the thermometer, and the biases' dependence on the rate of temperature: while the "
    "temperature goes one way they look like a dependence on it. A lag of 30 s is taken, and what "
    f"{RATE_SECONDS:.0f} s of lag or the like would do is in the standard uncertainties. Sweep there and back "
    "(thermal-ramp) to determine them."
)
_SETTLED = (
    "Lag between the sensors and the thermometer, and the biases' dependence on the rate of temperature: only settled "
    "temperatures were used. A sweep (thermal-ramp) determines them."
)
_NO_RATE = "A dependence of the biases on the rate of temperature beside the lag: the recording does not determine it."
_NO_LAG = (
    "Lag between the sensors and the thermometer: the sweep does not separate it from what else it does, and none is "
    "in the model."
)


def _orders(terms: ThermalTerms, order: int) -> str:
    return "as the biases do" if terms.basis.kind != "polynomial" else f"to the order {order}"


def _about_loop(found: ThermalOutcome) -> str:
    """Return what one branch leaves open, with what was added for it."""
    of, loops = found.recording, found.loops or (0.0, 0.0)
    parts: list[str] = []
    if of.specific_force is not None and specific_force_factor(of.specific_force_unit) is not None:
        parts.append(f"± {1e3 * loops[0]:.2g} mm/s²")
    if of.angular_rate is not None and angular_rate_factor(of.angular_rate_unit) is not None:
        parts.append(f"± {np.degrees(loops[1]):.2g} °/s")
    added = " and ".join(parts) or "as much"
    return (
        "Hysteresis: the temperatures were come to from one side only, and a single branch cannot show it. "
        f"{added[0].upper() + added[1:]} (what {LOOP_KELVINS:g} K of temperature do in this unit) was believed of half "
        "the loop, and is in the standard uncertainties of the biases."
    )


def _about_pull(found: ThermalOutcome) -> str:
    """Return what poses too few to tell a g-sensitivity leave in the gyros' biases."""
    pull, across = found.pull, found.fit.conditions.test.earth[1]
    unit = found.recording.angular_rate_unit
    in_si = angular_rate_factor(unit) is not None
    size = f"± {np.degrees(pull):.2g} °/s" if in_si else f"± {pull:.2g} {unit}"
    earth = (
        f"the part of the Earth rate across the vertical, whose heading is not known (± {np.degrees(across):.2g} °/s)"
        if across > 0.0
        else "the Earth rate, which cannot be taken off numbers in counts (up to 0.0042 °/s)"
    )
    return (
        "The gyros' biases apart from what the pose of the test adds to them: a g-sensitivity, believed to be "
        f"{PULL_FACTOR:g} times what they are unsteady by ({size}), and {earth}. Both are in the standard "
        "uncertainties of the biases, and not in those of their changes with temperature."
    )


def thermal_remarks(found: ThermalOutcome, evidence: ThermalCurves) -> list[str]:
    """Return how the model was made, a sentence each."""
    (low, high), soaked = found.coverage.span, found.coverage.kind == "soak"
    terms, turned, what = found.fit.terms, found.turned, "soaks" if soaked else "a sweep"
    poses = "one pose" if found.poses == 1 else f"{found.poses} poses"
    rests = f"{len(found.points)} stretches of rest, each within a kelvin or so, in {poses}"
    between = f"from {what} between {low:.1f} and {high:.1f} °C ({rests})."
    remarks = [
        f"Biases are interpolated linearly between {terms.basis.nodes.size} temperatures, {between}"
        if terms.basis.kind == "linear"
        else f"Biases are a {name_of(terms.basis)} in the sensors' temperature about "
        f"{terms.basis.reference_celsius:g} °C, {between}"
    ]
    if found.candidates:
        left = "soaks" if soaked else "bands of temperature"
        remarks.append(
            f"The functions were chosen among {len(found.candidates)} by what each predicts of {left} that were "
            "left out; of those that predict alike the one with the fewest unknowns."
        )
    if terms.poses and terms.matrix_functions:
        orders = _orders(terms, terms.matrix_functions)
        remarks.append(f"The accelerometers' matrix changes with temperature {orders}.")
    if turned is not None:
        bends, orders = len(turned.matrices) - 1, "one for all temperatures"
        orders = f"changing with temperature {_orders(terms, bends)}" if bends else orders
        remarks.append(
            f"The gyros' matrix is from {turned.turns} turns between the rests, {orders}: their scale factors, "
            "non-orthogonalities and the rotation between the triads."
        )
    if np.isfinite(sigma := found.sigma_of("lag")):
        remarks.append(
            f"The sensors are {evidence.lag:.0f} ± {sigma:.0f} s behind the thermometer (before the "
            "recording 60 ± 60 s were believed)."
        )
    for name, kind, unit in (("accelerometers", "force", "m/s²"), ("gyros", "rate", "rad/s")):
        if (flicker := found.fit.levels.flicker[kind]) > 0.0:
            remarks.append(
                f"The biases of the {name} wander beside what temperature does. A flicker floor of "
                f"the Allan deviation of {np.sqrt(flicker):.2g} {unit} was found from the rests. "
                "Neighbours were taken to have it in common."
            )
    return remarks
