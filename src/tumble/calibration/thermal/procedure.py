"""Thermal calibration: rests at many temperatures, soaked or swept, in one adjustment.

Holds at soaks are multi-position tests at several temperatures, a sweep at rest is one pose at all of them, and a
tumbled sweep is both; all are the same equations (`thermal_conditions`). What is a function of temperature is a
polynomial, straight lines between soaks, or a natural spline, as leaving soaks or bands of temperature out
decides; with it go the dependence on the rate, the hysteresis, and the lag of the sensors behind the
thermometer, as far as the way of the temperature tells them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.triad_unknowns import BIAS, SCALE
from tumble.calibration.estimate import Estimate, TermTest
from tumble.calibration.poses import describe_untold, distinct_poses
from tumble.calibration.thermal.conditions import LEAST_WIDTH
from tumble.calibration.thermal.coverage import Coverage, find_coverage, require_time_base
from tumble.calibration.thermal.doubt import (
    RATE_SECONDS,
    Doubts,
    changes_per_kelvin,
    pull_sigma,
    with_hysteresis_doubt,
    with_pull,
)
from tumble.calibration.thermal.fit import (
    Surroundings,
    ThermalFit,
    choose_terms,
    fit_thermal,
    highest_order,
    soaks_of,
)
from tumble.calibration.thermal.layout import ThermalTerms
from tumble.calibration.thermal.model import (
    ThermalSolution,
    thermal_solution,
    with_turned_matrix,
)
from tumble.calibration.thermal.points import ThermalPoints, find_points
from tumble.calibration.thermal.summary import thermal_estimate, thermal_evidence
from tumble.calibration.thermal.turns import TurnedMatrix, estimate_turned_matrix
from tumble.counting import about
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.protocol.steps import Protocol
from tumble.recording.recording import Recording
from tumble.segmentation import Timeline
from tumble.sensor.thermal import TemperatureBasis
from tumble.units import angular_rate_factor, specific_force_factor

# Where units are usually calibrated; the middle of the span where it is not in it.
USUAL_REFERENCE = 25.0  # °C
FIRST_LAG, FIRST_WIDTH = 30.0, 5.0  # s, K
LAGS, WIDTHS = (0.0, 15.0, 30.0, 60.0, 120.0, 240.0), (2.0, 5.0, 10.0)
FALSE_ALARM, EASY_ALARM = 0.01, 0.5
# Sensors may be so far behind a thermometer that still moves, or depend on the rate as much.
UNSETTLED_SECONDS = 60.0
# Of the last adjustments: two sweeps took 32 and 38.
USUAL_STEPS = 35


def calibrate_thermal(
    recording: Recording,
    timeline: Timeline,
    site: Site,
    *,
    protocol: Protocol | None = None,
    progress: Callable[[str], None] | None = None,
) -> Estimate:
    """Calibrate both triads as functions of temperature.

    Parameters
    ----------
    recording : with a temperature.
    timeline : its rests.
    site : gravity and Earth rate.
    protocol : soaks and ramps, where somebody said; tells a soak test from a sweep.
    progress : called with a sentence on what is being done.

    Raises
    ------
    ObservabilityError
        If stamps or thermometer cannot serve, or the rests tell nothing of temperature.
    ConvergenceError
        If the adjustment does not settle.
    """
    say = progress or _silent
    say("temperatures")
    cautions = require_time_base(recording, protocol)
    everything = find_points(recording, timeline)
    points, factors, poses, told = _in_near_si(everything, recording)
    coverage = find_coverage(points, protocol, poses)
    coverage.cautions += cautions
    kept = points.only(coverage.keep)
    told = _told_by(kept, poses[coverage.keep], told)
    if told == 0:
        _require_changes(kept, recording)
    soaks = soaks_of(kept.celsius) if coverage.kind == "soak" else None
    lag = FIRST_LAG if coverage.kind == "ramp" else 0.0
    where = Surroundings(site.gravity, _earth(site, recording), lag, FIRST_WIDTH)
    terms = ThermalTerms(TemperatureBasis("polynomial", _reference(coverage), order=1), told)
    # What is not modelled is taken for wander, against which every candidate would look good.
    coupled = told == 9 and kept.force is not None and kept.rate is not None
    terms = replace(terms, hysteresis=coverage.both_branches, g_sensitivity=coupled)
    if coverage.kind == "ramp" and coverage.both_branches:
        say("lag and hysteresis")
        where = _first_path(kept, terms, where)
    say("functions of temperature")
    terms, candidates = choose_terms(kept, terms, where, soaks)
    terms = _enriched(kept, terms, where, soaks)
    if coverage.kind == "soak" or not coverage.both_branches:
        terms = replace(terms, doubt=_doubt(kept, terms, where, coverage))
    say("adjusting")
    with about(USUAL_STEPS):
        fit, tests = _with_path(kept, terms, where, coverage)
    fit, doubts = _with_doubts(fit, where, coverage)
    lag, width = fit.conditions.lag_and_width(fit.values)
    solved = partial(
        thermal_solution,
        lag=lag,
        width=width,
        factors=factors,
        span=coverage.span,
        largest_rate=coverage.largest_rate,
    )
    solution = solved(fit.values, with_pull(fit, doubts.pull), fit.layout)
    turned = None
    if told == 9 and fit.layout.has_rate:
        say("turns")
        turned = _turned(recording, timeline, solution, fit, factors, site.gravity)
    if turned is not None:
        solution = solved(*with_turned_matrix(fit.values, fit.covariance, fit.layout, turned))
    evidence = thermal_evidence(everything, kept, fit, solution, coverage, factors, soaks, site)
    evidence.candidates = candidates
    evidence.poses = len(np.unique(poses[coverage.keep]))
    return thermal_estimate(recording, site, fit, solution, coverage, evidence, tests, kept, turned, doubts)


def _turned(
    recording: Recording,
    timeline: Timeline,
    solution: ThermalSolution,
    fit: ThermalFit,
    factors: tuple[float, float],
    gravity: float,
) -> TurnedMatrix | None:
    """The gyros' matrix by the turns between rests, where there are enough of them."""
    return estimate_turned_matrix(
        recording,
        timeline,
        solution.model,
        fit.values,
        fit.covariance,
        fit.layout,
        factors=factors,
        gravity=gravity,
        wander=fit.levels.single["rate"] + fit.levels.flicker["rate"],
    )


def _in_near_si(
    points: ThermalPoints, recording: Recording
) -> tuple[ThermalPoints, tuple[float, float], np.ndarray, int]:
    """Return the points divided by nominal scale factors, these factors, each point's pose, and what poses may tell."""
    force_factor = specific_force_factor(recording.specific_force_unit)
    rate_factor = angular_rate_factor(recording.angular_rate_unit)
    told, poses = 0, np.zeros(len(points), dtype=int)
    if points.force is not None and points.force_covariance is not None:
        rough = None
        if force_factor is None:
            rough = rough_triad(points.force, 9.80665)
            force_factor = 1.0 / float(np.mean(rough[SCALE]))
        force = points.force * force_factor
        directions = force - (0.0 if rough is None else rough[BIAS] * force_factor)
        chosen = distinct_poses(directions)
        units = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        poses = np.argmax(units @ units[chosen].T, axis=1)
        told = len(chosen)
        points = replace(points, force=force, force_covariance=points.force_covariance * force_factor**2)
    if points.rate is not None and points.rate_covariance is not None:
        factor = rate_factor or 1.0
        points = replace(
            points, rate=points.rate * factor, rate_covariance=points.rate_covariance * factor**2
        )
    return points, (force_factor or 1.0, rate_factor or 1.0), poses, told


def _told_by(points: ThermalPoints, poses: np.ndarray, count: int) -> int:
    """Return how many unknowns of the accelerometers the poses tell: 9, 6 or 0."""
    if points.force is None or count < 6:
        return 0
    first = np.unique(poses, return_index=True)[1]
    units = points.force[first] / np.linalg.norm(points.force[first], axis=1, keepdims=True)
    for unknowns in (9, 6):
        if len(units) >= unknowns and not describe_untold(units, unknowns):
            return unknowns
    return 0


def _require_changes(points: ThermalPoints, recording: Recording) -> None:
    """Refuse counts and single rests where no pose determines scale factors."""
    if points.force is None:
        return
    if specific_force_factor(recording.specific_force_unit) is None:
        raise ObservabilityError(
            "The recording is in counts, and there are too few poses to determine what a count is. "
            "Declare its units with --units, or tumble the unit through nine poses or more."
        )
    if np.unique(points.placement, return_counts=True)[1].max() < 2 and points.rate is None:
        raise ObservabilityError(
            "No pose was kept while the temperature changed, and there are too few poses for the "
            "norm of gravity. Leave the unit at rest during the sweep, or hold nine poses at each "
            "temperature."
        )


def _reference(coverage: Coverage) -> float:
    low, high = coverage.span
    return USUAL_REFERENCE if low <= USUAL_REFERENCE <= high else float(round(0.5 * (low + high)))


def _earth(site: Site, recording: Recording) -> tuple[float, float, float]:
    """Return the Earth rate's vertical part, a sigma of each part across, and one of what no latitude determines."""
    if angular_rate_factor(recording.angular_rate_unit) is None:
        return 0.0, 0.0, 0.0
    if site.latitude is None:
        return 0.0, EARTH_RATE / np.sqrt(3.0), EARTH_RATE / np.sqrt(3.0)
    return (
        EARTH_RATE * float(np.sin(site.latitude)),
        EARTH_RATE * float(np.cos(site.latitude)) / np.sqrt(2.0),
        0.0,
    )


def _first_path(points: ThermalPoints, terms: ThermalTerms, where: Surroundings) -> Surroundings:
    """Return lag and width, the best of a few, with a cubic: where the adjustment begins from."""
    cubic = replace(terms, basis=TemperatureBasis("polynomial", terms.basis.reference_celsius, order=3))

    def misfit(there: Surroundings) -> float:
        try:
            return fit_thermal(points, cubic, there, robust=False).adjustment.square_sum
        except (ObservabilityError, ConvergenceError):
            return np.inf

    where = min((replace(where, lag=lag) for lag in LAGS), key=misfit)
    if terms.hysteresis:
        where = min((replace(where, width=width) for width in WIDTHS), key=misfit)
    return where


def _doubt(
    points: ThermalPoints, terms: ThermalTerms, where: Surroundings, coverage: Coverage
) -> tuple[float, float]:
    """Return how uncertain the biases are per K/s: their slope over temperature times a minute or so."""
    seconds = UNSETTLED_SECONDS if coverage.kind == "soak" else RATE_SECONDS
    first, second = changes_per_kelvin(fit_thermal(points, terms, where, robust=False))
    return seconds * first, seconds * second


def _with_doubts(fit: ThermalFit, where: Surroundings, coverage: Coverage) -> tuple[ThermalFit, Doubts]:
    """Return the fit with what one branch cannot show in its covariance, and what that was."""
    loops = None
    if not coverage.both_branches:
        fit, loops = with_hysteresis_doubt(fit)
    rate = coverage.kind == "ramp" and not coverage.both_branches
    return fit, Doubts(loops, rate, pull_sigma(fit), where.earth[1])


def _with_path(
    points: ThermalPoints, terms: ThermalTerms, where: Surroundings, coverage: Coverage
) -> tuple[ThermalFit, list[TermTest]]:
    """Adjust with what the way of the temperature determines: hysteresis, lag, rate, as far as the data want them."""
    swept = coverage.kind == "ramp" and coverage.both_branches
    terms = replace(terms, lag=swept, width=swept and terms.hysteresis)
    fit = _adjusted(points, terms, where)
    tests: list[TermTest] = []
    if terms.hysteresis:
        test = _tested(fit, "hysteresis", ("h", "gh"))
        tests.append(test)
        if not test.kept:
            terms = replace(terms, hysteresis=False, width=False)
            fit = _adjusted(points, terms, where)
    if swept:
        # On one branch alone a dependence on the rate cannot be told from one on temperature.
        try:
            richer = _adjusted(points, replace(terms, rate=True), where)
        except (ObservabilityError, ConvergenceError):
            return fit, tests
        # As a bend of the matrix: left out, it would be in the lag and the loop, and in none of their uncertainties.
        test = _tested(richer, "rate of temperature", ("r", "gr"), limit=EASY_ALARM)
        tests.append(test)
        if test.kept:
            fit = richer
    if fit.layout.terms.g_sensitivity:
        test = _tested(fit, "g_sensitivity", ("G",))
        tests.append(test)
        if not test.kept:
            fit = _adjusted(points, replace(fit.layout.terms, g_sensitivity=False), where)
    return fit, tests


def _enriched(
    points: ThermalPoints, terms: ThermalTerms, where: Surroundings, soaks: Series | None
) -> ThermalTerms:
    """Return the terms with functions that the whole recording shows, though few folds did not.

    Of a polynomial alone: one order more is taken while a Wald test wants it, and the matrix's already where it is
    likelier than not: a bend that is left out would be in all biases, and in none of their uncertainties.
    """
    highest = highest_order(soaks)
    while terms.basis.kind == "polynomial" and terms.basis.order < highest:
        order = terms.basis.order + 1
        richer = replace(terms, basis=replace(terms.basis, order=order))
        try:
            fit = fit_thermal(points, richer, where)
        except (ObservabilityError, ConvergenceError):
            break
        last = [(kind, 3) for kind in ("b", "gb") if kind in fit.layout.places]
        if not _tested(fit, f"order {order}", (), last).kept:
            break
        terms = richer
    while (
        terms.poses and terms.basis.kind == "polynomial" and terms.matrix_functions < min(terms.basis.size, 2)
    ):
        richer = replace(terms, matrix_functions=terms.matrix_functions + 1)
        try:
            fit = fit_thermal(points, richer, where)
        except (ObservabilityError, ConvergenceError):
            break
        if not _tested(fit, "matrix", (), [("M", fit.layout.entries)], EASY_ALARM).kept:
            break
        terms = richer
    return terms


def _adjusted(points: ThermalPoints, terms: ThermalTerms, where: Surroundings) -> ThermalFit:
    """Adjust; without lag or width where these do not settle, or run against what they can be at least."""
    try:
        fit = fit_thermal(points, terms, where)
    except ConvergenceError:
        if not (terms.lag or terms.width):
            raise
        return fit_thermal(points, replace(terms, lag=False, width=False), where)
    if terms.lag and fit.values[fit.layout.places["lag"]][0] <= 0.0:
        terms, where = replace(terms, lag=False), replace(where, lag=0.0)
        fit = _adjusted(points, terms, where)
    if terms.width and fit.values[fit.layout.places["width"]][0] <= LEAST_WIDTH:
        fit = _adjusted(points, replace(terms, width=False), replace(where, width=LEAST_WIDTH))
    return fit


def _tested(
    fit: ThermalFit,
    name: str,
    kinds: tuple[str, ...],
    last: Sequence[tuple[str, int]] = (),
    limit: float = FALSE_ALARM,
) -> TermTest:
    """Test kinds of unknowns as a whole, and of others so many at their ends."""
    at: list[int] = []
    for kind, count in last:
        stop = fit.layout.places[kind].stop
        at += range(stop - count, stop)
    for kind in kinds:
        if kind in fit.layout.places:
            place = fit.layout.places[kind]
            at += range(place.start, place.stop)
    covariance: Square = fit.adjustment.cofactor[np.ix_(at, at)]
    return wald_test(name, fit.values[at], covariance, max(fit.adjustment.redundancy, 1), limit)


def _silent(_: str) -> None:
    """Tell nobody."""
