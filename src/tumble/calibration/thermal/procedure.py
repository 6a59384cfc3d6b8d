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

import numpy as np

from tumble.calibration.equations.triad_unknowns import BIAS, SCALE, rough_triad
from tumble.calibration.estimate import Estimate, TermTest, wald_test
from tumble.calibration.poses import describe_untold, distinct_poses
from tumble.calibration.thermal.conditions import LEAST_WIDTH, ThermalTerms, ThermalTest
from tumble.calibration.thermal.coverage import Coverage, find_coverage, require_time_base
from tumble.calibration.thermal.fit import (
    RATE_SECONDS,
    ThermalFit,
    changes_per_kelvin,
    choose_terms,
    fit_thermal,
    highest_order,
    soaks_of,
    try_fit,
    with_hysteresis_doubt,
    with_pull,
)
from tumble.calibration.thermal.model import ThermalOutcome, estimate_turned_matrix, thermal_solution
from tumble.calibration.thermal.points import ThermalPoints, find_points
from tumble.calibration.thermal.summary import thermal_estimate
from tumble.counting import about
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.protocol import Protocol
from tumble.recording import Recording
from tumble.segmentation import Timeline
from tumble.sensor import TemperatureBasis
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
    say: Callable[[str], None] = progress or (lambda _: None)
    say("temperatures")
    cautions = require_time_base(recording, protocol)
    everything, factors, poses, count = _in_near_si(find_points(recording, timeline), recording)
    coverage = find_coverage(everything, protocol, poses)
    coverage.cautions += cautions
    kept, swept = everything.only(coverage.keep), coverage.kind == "ramp"
    told = _told_by(kept, poses[coverage.keep], count)
    if told == 0:
        _require_changes(kept, recording)
    soaks = None if swept else soaks_of(kept.celsius)
    test = ThermalTest(
        kept, site.gravity, _earth(site, recording), FIRST_LAG if swept else 0.0, FIRST_WIDTH, soaks
    )
    # What is not modelled is taken for wander, against which every candidate would look good.
    terms = ThermalTerms(
        TemperatureBasis("polynomial", _reference(coverage), order=1),
        told,
        hysteresis=coverage.both_branches,
        g_sensitivity=told == 9 and kept.force is not None and kept.rate is not None,
    )
    if swept and coverage.both_branches:
        say("lag and hysteresis")
        test = _first_path(test, terms)
    say("functions of temperature")
    terms, candidates = choose_terms(test, terms)
    terms = _enriched(test, terms)
    if not (swept and coverage.both_branches):
        # How uncertain biases are per K/s: their slope over temperature times a minute or so.
        seconds = RATE_SECONDS if swept else UNSETTLED_SECONDS
        first, second = changes_per_kelvin(fit_thermal(test, terms, robust=False))
        terms = replace(terms, doubt=(seconds * first, seconds * second))
    say("adjusting")
    with about(USUAL_STEPS):
        fit, tests = _with_path(test, terms, swept=swept and coverage.both_branches)
    # What one branch cannot show is in the covariance; what a pose adds to the biases in that of the biases alone.
    loops = None
    if not coverage.both_branches:
        fit, loops = with_hysteresis_doubt(fit)
    pulled, pull = with_pull(fit)
    solution = thermal_solution(fit, pulled.covariance, factors, coverage)
    distinct = len(np.unique(poses[coverage.keep]))
    found = ThermalOutcome(
        *(recording, site, everything, factors, coverage, distinct, candidates),
        *(fit, tests, loops, pull, solution),
    )
    if told == 9 and fit.layout.has_rate:
        say("turns")
        found.turned = estimate_turned_matrix(recording, timeline, solution.model, fit, factors[1])
        found.solution = thermal_solution(fit, pulled.covariance, factors, coverage, found.turned)
    return thermal_estimate(found)


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
    force_factor, rate_factor = force_factor or 1.0, rate_factor or 1.0
    if points.rate is not None and points.rate_covariance is not None:
        spread = points.rate_covariance * rate_factor**2
        points = replace(points, rate=points.rate * rate_factor, rate_covariance=spread)
    return points, (force_factor, rate_factor), poses, told


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
            "No pose was kept while the temperature changed, and there are too few poses for the norm of gravity. "
            "Leave the unit at rest during the sweep, or hold nine poses at each temperature."
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
    vertical, level = EARTH_RATE * float(np.sin(site.latitude)), EARTH_RATE * float(np.cos(site.latitude))
    return vertical, level / np.sqrt(2.0), 0.0


def _first_path(test: ThermalTest, terms: ThermalTerms) -> ThermalTest:
    """Return the test with lag and width, the best of a few, with a cubic: where the adjustment begins from."""
    cubic = replace(terms, basis=TemperatureBasis("polynomial", terms.basis.reference_celsius, order=3))

    def misfit(there: ThermalTest) -> float:
        fit = try_fit(there, cubic, robust=False)
        return np.inf if fit is None else fit.adjustment.square_sum

    test = min((replace(test, lag=lag) for lag in LAGS), key=misfit)
    if terms.hysteresis:
        test = min((replace(test, width=width) for width in WIDTHS), key=misfit)
    return test


def _with_path(test: ThermalTest, terms: ThermalTerms, *, swept: bool) -> tuple[ThermalFit, list[TermTest]]:
    """Adjust with what the way of the temperature determines: hysteresis, lag, rate, as far as the data want them."""
    fit = _adjusted(test, replace(terms, lag=swept, width=swept and terms.hysteresis))
    tests: list[TermTest] = []
    if terms.hysteresis:
        tests.append(_tested(fit, "hysteresis", ("h", "gh")))
        if not tests[-1].kept:
            terms = replace(terms, hysteresis=False)
            fit = _adjusted(test, replace(terms, lag=swept))
    if swept:
        # On one branch alone a dependence on the rate cannot be told from one on temperature.
        try:
            richer = _adjusted(test, replace(terms, lag=swept, width=terms.hysteresis, rate=True))
        except (ObservabilityError, ConvergenceError):
            return fit, tests
        # As a bend of the matrix: left out, it would be in the lag and the loop, and in none of their uncertainties.
        tests.append(_tested(richer, "rate of temperature", ("r", "gr"), limit=EASY_ALARM))
        if tests[-1].kept:
            fit = richer
    if fit.terms.g_sensitivity:
        tests.append(_tested(fit, "g_sensitivity", ("G",)))
        if not tests[-1].kept:
            fit = _adjusted(test, replace(fit.terms, g_sensitivity=False))
    return fit, tests


def _enriched(test: ThermalTest, terms: ThermalTerms) -> ThermalTerms:
    """Return the terms with functions that the whole recording shows, though few folds did not.

    Of a polynomial alone: one order more is taken while a Wald test wants it, and the matrix's already where it is
    likelier than not: a bend that is left out would be in all biases, and in none of their uncertainties.
    """
    if terms.basis.kind != "polynomial":
        return terms
    while (order := terms.basis.order + 1) <= highest_order(test.soaks):
        richer = replace(terms, basis=replace(terms.basis, order=order))
        fit = try_fit(test, richer)
        if fit is None or not _tested(fit, f"order {order}", ("b", "gb"), last=3).kept:
            break
        terms = richer
    while terms.poses and terms.matrix_functions < min(terms.basis.size, 2):
        richer = replace(terms, matrix_functions=terms.matrix_functions + 1)
        fit = try_fit(test, richer)
        if fit is None or not _tested(fit, "matrix", ("M",), EASY_ALARM, last=terms.entries).kept:
            break
        terms = richer
    return terms


def _adjusted(test: ThermalTest, terms: ThermalTerms) -> ThermalFit:
    """Adjust; without lag or width where these do not settle, or run against what they can be at least."""
    try:
        fit = fit_thermal(test, terms)
    except ConvergenceError:
        if not (terms.lag or terms.width):
            raise
        return fit_thermal(test, replace(terms, lag=False, width=False))
    if terms.lag and fit.values[fit.layout["lag"]][0] <= 0.0:
        terms, test = replace(terms, lag=False), replace(test, lag=0.0)
        fit = _adjusted(test, terms)
    if terms.width and fit.values[fit.layout["width"]][0] <= LEAST_WIDTH:
        fit = _adjusted(replace(test, width=LEAST_WIDTH), replace(terms, width=False))
    return fit


def _tested(
    fit: ThermalFit, name: str, kinds: Sequence[str], limit: float = FALSE_ALARM, last: int | None = None
) -> TermTest:
    """Test kinds of unknowns as a whole, or so many at the end of each."""
    at: list[int] = []
    for kind in kinds:
        place = fit.layout[kind]
        at += range(place.start, place.stop)[-last if last else None :]
    covariance = fit.adjustment.cofactor[np.ix_(at, at)]
    return wald_test(name, fit.values[at], covariance, max(fit.adjustment.redundancy, 1), limit)
