"""The rotation-rate test: a table turns the unit at known rates, both ways, about known axes.

Scale factor and bias of a gyro follow from its readings clockwise and counter-clockwise as those of an
accelerometer follow from up and down (Hayal 2010, section 2.4.1.2 with 2.5 and 2.6). Here all rates,
placements and rests enter one adjustment (`spin_conditions`), which gives the whole matrix in the
frame ``fixture`` if the axes span it, and asymmetry and a quadratic term if the data want them.

The bias comes in a second step from the placements' own: the Earth's rotation about the table's axis
is taken out (4.7e-5 rad/s at 40 degrees of latitude, the thesis' warning), and where the unit was
placed up and down enough the g-sensitivity is told from it. The accelerometers are not calibrated.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square
from tumble.calibration.canonical import FIXTURE_UNKNOWNS, DescribedTriad, describe_fixture_triad
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.equations.placement import LARGEST_PLACEMENT, find_added_sigma, is_excessive
from tumble.calibration.equations.placement_bias import PlacementBiases, fit_placement_biases
from tumble.calibration.equations.spin import (
    ASYMMETRY,
    BIASES,
    MATRIX,
    QUADRATIC,
    SpinConditions,
    SpinReadings,
)
from tumble.calibration.equations.spin_groups import REVERSED
from tumble.calibration.equations.spin_readings import (
    SpunPlacement,
    axis_words,
    contradicting_rates,
    find_placements,
    gather_spins,
    known_columns,
    require_rates,
)
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    NamedValue,
    Said,
    TermTest,
    correlation_matrix,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import Spins
from tumble.calibration.procedure import Procedure
from tumble.calibration.session import Session
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.estimation import Adjustment, adjust
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, SpinMeans
from tumble.segmentation.matching import Matching
from tumble.sensor import ImuModel
from tumble.units import angular_rate_factor

# Chance of keeping a term that is not there, each.
TERM_FALSE_ALARM = 0.01
_TERMS = {"asymmetry": ASYMMETRY, "quadratic": QUADRATIC}


@dataclass(slots=True)
class _Fit:
    """The adjustment of all spins, and what it was given."""

    adjustment: Adjustment
    values: Series
    free: np.ndarray
    alone: float
    placement: float
    wander: float
    tests: list[TermTest] = field(default_factory=list[TermTest])


def calibrate_rate_table(
    recording: Recording,
    means: HoldMeans,
    spins: SpinMeans,
    matching: Matching,
    protocol: Protocol,
    site: Site,
) -> Estimate:
    """Calibrate the gyros on the rates of a table.

    Parameters
    ----------
    recording : for its units.
    means : of the holds; those in a placement with spins give the bias at rest.
    spins : means over whole revolutions, in the order of `matching.spins`.
    matching, protocol : which spin has which rate about which axis of the unit, and how exactly.
    site : its latitude gives the Earth rate that the table adds to; without one it is an uncertainty.

    Returns
    -------
    estimate : in the frame ``fixture``; its model has no accelerometer.

    Raises
    ------
    ObservabilityError
        If there is no gyro, no spin, an axis that is not known, or an axis that was spun at one rate
        only, or if the table turned the other way than the protocol says.
    ConvergenceError
        If the adjustment fails.
    """
    if spins.angular_rate is None or spins.angular_rate_covariance is None or len(spins) == 0:
        raise ObservabilityError("No spins with a gyro's readings were found: there is nothing to calibrate.")
    placements = find_placements(recording, means, matching, protocol)
    readings = gather_spins(recording, means, spins, placements, site)
    require_rates(readings, placements)
    known = known_columns(placements)
    fit = _adjust(readings, _start(readings, known, recording), _free(readings, known), known)
    told, biases = _describe(recording, readings, placements, fit, known, site)
    return _estimate(recording, readings, placements, fit, told, biases, known, site)


def _start(readings: SpinReadings, known: np.ndarray, recording: Recording) -> Series:
    """Return rough values: least squares of each placement's readings about their mean."""
    values = np.zeros(BIASES + 3 * readings.placements)
    rates: list[AnyArray] = []
    shown: list[AnyArray] = []
    for c in range(readings.placements):
        use = readings.active[c]
        rates.append(readings.rate[c, use] - readings.rate[c, use].mean(axis=0))
        shown.append(readings.observed[c, use] - readings.observed[c, use].mean(axis=0))
    solution = np.linalg.lstsq(np.concatenate(rates), np.concatenate(shown), rcond=1e-9)[0]
    matrix = np.where(known, solution.T, 0.0)
    along = np.diag(matrix)[known]
    if np.all(along < 0) if along.size < 3 else np.linalg.det(matrix) < 0:
        raise ObservabilityError(REVERSED)
    factor = angular_rate_factor(recording.angular_rate_unit)
    nominal = 1.0 / factor if factor else float(np.mean(np.abs(along)))
    matrix[:, ~known] = nominal * np.eye(3)[:, ~known]
    values[MATRIX] = matrix.ravel()
    for c in range(readings.placements):
        use = readings.active[c]
        values[BIASES + 3 * c : BIASES + 3 * c + 3] = np.mean(
            readings.observed[c, use] - readings.rate[c, use] @ matrix.T, axis=0
        )
    return values


def _free(readings: SpinReadings, known: np.ndarray) -> np.ndarray:
    columns = [3 * i + j for i in range(3) for j in range(3) if known[j]]
    return np.array([*columns, *range(BIASES, BIASES + 3 * readings.placements)])


def _adjust(readings: SpinReadings, start: Series, base: np.ndarray, known: np.ndarray) -> _Fit:
    """Adjust with the terms that the rates can tell, and drop them one by one until every one is wanted."""
    names = _possible_terms(readings, known)
    tests: dict[str, TermTest] = {}
    while names:
        free = np.sort(np.concatenate([base, *(np.arange(*_TERMS[n].indices(99)) for n in names)]))
        fit = _balanced(readings, start, free, len(names))
        if fit.adjustment.redundancy < 3:
            names.pop()
            continue
        for name in names:
            at = np.searchsorted(free, np.arange(*_TERMS[name].indices(99)))
            spread = fit.adjustment.cofactor[np.ix_(at, at)]
            freedom = fit.adjustment.redundancy
            tests[name] = wald_test(name, fit.adjustment.parameters[at], spread, freedom, TERM_FALSE_ALARM)
        weakest = max(names, key=lambda name: tests[name].probability)
        if tests[weakest].kept:
            break
        names.remove(weakest)
    else:
        fit = _balanced(readings, start, base, 0)
    fit.tests = list(tests.values())
    return fit


def _possible_terms(readings: SpinReadings, known: np.ndarray) -> list[str]:
    """Return the terms that the rates tell: both directions of all axes, and sizes of the rate enough."""
    if not np.all(known):
        return []
    fewest, both = 9, np.zeros((3, 2), dtype=bool)
    for c in range(readings.placements):
        rate = readings.rate[c][readings.active[c]]
        face = int(np.argmax(np.max(np.abs(rate), axis=0)))
        along = rate[:, face]
        both[face] |= [bool(np.any(along > 0)), bool(np.any(along < 0))]
        sizes = {round(float(size), 3) for size in np.abs(along) / np.max(np.abs(along))}
        fewest = min(fewest, len(sizes))
    if not np.all(both) or fewest < 2:
        return []
    return ["asymmetry", "quadratic"] if fewest >= 3 else ["asymmetry"]


def _balanced(readings: SpinReadings, start: Series, free: np.ndarray, terms: int) -> _Fit:
    """Adjust; add wander from spin to spin, then misplacement, where the residuals show them."""
    values = [start]

    def once(placement: float) -> float:
        conditions = SpinConditions(readings, values[-1], free, placement, wander)
        return adjust(conditions, values[-1][free]).square_sum - square_sum

    def solve(placement: float, wander: float) -> Adjustment:
        # What the conditions take from the values before is off by the square of an angle after two.
        found: list[Adjustment] = []
        for _ in range(3):
            conditions = SpinConditions(readings, values[-1], free, placement, wander)
            found.append(adjust(conditions, values[-1][free]))
            values.append(conditions.full(found[-1].parameters))
        return found[-1]

    largest = float(np.max(np.abs(readings.rate)))
    alone = solve(0.0, 0.0).sigma0
    placement = wander = 0.0
    matrix: Matrix = values[-1][MATRIX].reshape(3, 3)
    square_sum, inner = readings.inner_square_sum(matrix, terms, 0.0)
    if is_excessive(square_sum, inner):
        wander = find_added_sigma(
            lambda added: readings.inner_square_sum(matrix, terms, added)[0],
            inner,
            1e-9 * largest,
            0.1 * largest,
        )
        square_sum = readings.inner_square_sum(matrix, terms, wander)[0]
    adjustment = solve(0.0, wander)
    # What is between placements: the rest is as large as it is, and says nothing of them.
    outer = adjustment.redundancy - inner
    if is_excessive(adjustment.square_sum - square_sum, outer):
        placement = find_added_sigma(once, outer, 1e-9, LARGEST_PLACEMENT)
        adjustment = solve(placement, wander)
    return _Fit(adjustment, values[-1], free, alone, placement, wander)


def _describe(
    recording: Recording,
    readings: SpinReadings,
    placements: list[SpunPlacement],
    fit: _Fit,
    known: np.ndarray,
    site: Site,
) -> tuple[DescribedTriad, PlacementBiases]:
    """Return the gyro with its covariance: matrix and terms from the spins, the bias from the placements."""
    size = fit.values.size
    covariance = np.zeros((size, size))
    covariance[np.ix_(fit.free, fit.free)] = fit.adjustment.cofactor + _second_order(readings, fit)
    matrix = fit.values[MATRIX].reshape(3, 3)
    biases = fit_placement_biases(
        fit.values[BIASES:].reshape(-1, 3),
        covariance[BIASES:, BIASES:],
        axes=np.array([p.axis for p in placements]),
        upward=np.array([p.upward for p in placements]),
        matrix=matrix,
        sigma=np.hypot(readings.sigma, fit.placement),
        site=site,
    )
    unknowns, spread = np.zeros(FIXTURE_UNKNOWNS), np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS))
    unknowns[:9], unknowns[9:12], unknowns[12:] = fit.values[MATRIX], biases.bias, fit.values[9:15]
    ours = np.array([*range(9), *range(12, 18)])
    spread[np.ix_(ours, ours)] = covariance[:BIASES, :BIASES]
    crossed = covariance[:BIASES, BIASES:] @ biases.weights.T
    spread[np.ix_(ours, np.arange(9, 12))] = crossed
    spread[np.ix_(np.arange(9, 12), ours)] = crossed.T
    spread[9:12, 9:12] = biases.covariance
    # One table turned all of this: what its rates are off by has moved all scale factors alike.
    slope = np.zeros(FIXTURE_UNKNOWNS)
    slope[:9] = np.where(np.tile(known, 3), unknowns[:9], 0.0)
    spread += np.outer(slope, slope) * float(np.max(readings.share)) ** 2
    told = describe_fixture_triad(
        "gyroscope",
        unknowns,
        spread,
        known=np.tile(known, (3, 1)),
        unit=recording.angular_rate_unit,
        factor=angular_rate_factor(recording.angular_rate_unit),
        terms=frozenset(test.name for test in fit.tests if test.kept),
    )
    return told, biases


def _second_order(readings: SpinReadings, fit: _Fit) -> Square:
    """Return what the mean shift by second-order tilts adds to the free unknowns' second moments."""
    conditions = SpinConditions(readings, fit.values, fit.free, fit.placement, fit.wander)
    adjustment = fit.adjustment
    weighted = adjustment.chain.solve(conditions.mean_shift(fit.values)[:, :, None])[:, :, 0]
    moved: AnyArray = adjustment.cofactor @ np.einsum("gsp,gs->p", adjustment.linearisation.design, weighted)
    return np.outer(moved, moved)


def _estimate(
    recording: Recording,
    readings: SpinReadings,
    placements: list[SpunPlacement],
    fit: _Fit,
    told: DescribedTriad,
    biases: PlacementBiases,
    known: np.ndarray,
    site: Site,
) -> Estimate:
    rates, residuals, sigmas, names = _spin_residuals(readings, placements, fit, told, biases)
    extra, spread = _sensitivity_values(recording, biases)
    count = len(told.parameters)
    correlations = np.eye(count + len(extra))
    correlations[:count, :count] = correlation_matrix(told.spread)
    correlations[count:, count:] = correlation_matrix(spread)
    adjustment = fit.adjustment
    normalised = residuals / sigmas
    components = {
        "gyro bias from spin to spin, rad/s": fit.wander,
        "placement of the unit beyond what the protocol states, rad": fit.placement,
    }
    figures = Figures.of(
        adjustment, fit.alone, components, tested=[], estimated=fit.wander + fit.placement > 0
    )
    estimate = estimate_of(
        "rate-table",
        Described(
            ImuModel(None, told.triad),
            told.names,
            told.covariance,
            [*told.parameters, *extra],
            correlations,
        ),
        replace(figures, largest_normalised=float(np.max(np.abs(normalised))) if normalised.size else 0.0),
        terms=[*fit.tests, *([] if biases.test is None else [biases.test])],
        evidence=[Spins(rates, residuals, sigmas, tuple(names))],
        frame="fixture",
    )
    _tell(estimate, recording, readings, placements, fit, biases, known, site)
    return estimate


def _spin_residuals(
    readings: SpinReadings,
    placements: list[SpunPlacement],
    fit: _Fit,
    told: DescribedTriad,
    biases: PlacementBiases,
) -> tuple[Series, AnyArray, AnyArray, list[str]]:
    """Return reference rates, residuals of the corrected gyro, their sigmas and names, in the spins' order."""
    count = int(readings.spin.max()) + 1
    rates, residuals, sigmas = np.zeros(count), np.zeros((count, 3)), np.ones((count, 3))
    names = [""] * count
    conditions = SpinConditions(readings, fit.values, fit.free, fit.placement, fit.wander)
    variance = np.diagonal(conditions.linearise(fit.values[fit.free]).covariance, axis1=1, axis2=2)
    to_si = np.linalg.inv(told.triad.matrix)
    for c, placement in enumerate(placements):
        for row in np.flatnonzero(readings.spin[c] >= 0).tolist():
            at = int(readings.spin[c, row])
            shown = told.triad.own_input((readings.observed[c, row] - biases.beside[c])[None])[0]
            residuals[at] = to_si @ shown - readings.rate[c, row]
            sigmas[at] = np.sqrt((to_si**2) @ variance[c, 3 * row : 3 * row + 3])
            rates[at] = float(readings.rate[c, row] @ placement.axis)
            step = placement.group.spins[placement.group.rows.index(at)]
            names[at] = step.name or f"{np.degrees(rates[at]):+.4g}°/s about {axis_words(placement.axis)}"
    return rates, residuals, sigmas, names


def _sensitivity_values(recording: Recording, biases: PlacementBiases) -> tuple[list[NamedValue], Square]:
    """Return the g-sensitivities that were found, by name, with their covariance."""
    if biases.g_sensitivity is None or biases.g_sensitivity_covariance is None:
        return [], np.zeros((0, 0))
    unit = f"{recording.angular_rate_unit}/(m/s²)"
    sigma = np.sqrt(np.diag(biases.g_sensitivity_covariance))
    pairs = [(i, j) for i in range(3) for j in range(3)]
    return [
        NamedValue(
            f"g-sensitivity of gyro {'xyz'[i]} to force {'xyz'[j]}",
            float(biases.g_sensitivity[i, j]),
            float(sigma[3 * i + j]),
            unit,
        )
        for i, j in pairs
    ], biases.g_sensitivity_covariance


def _tell(
    estimate: Estimate,
    recording: Recording,
    readings: SpinReadings,
    placements: list[SpunPlacement],
    fit: _Fit,
    biases: PlacementBiases,
    known: np.ndarray,
    site: Site,
) -> None:
    """Say in words what the test saw, what it cannot see, and what would have been better."""
    say: list[str] = []
    missing = ["The accelerometers are not calibrated by a rate table."]
    against: list[str] = []
    if not np.all(known):
        columns = " and ".join("xyz"[j] for j in range(3) if not known[j])
        missing.append(
            f"The unit was not spun about {columns}: those columns of the gyro's matrix are nominal (of counts, the "
            "mean of the other scale factors), without a stated uncertainty."
        )
        if angular_rate_factor(recording.angular_rate_unit) is None:
            against.append(
                f"The scale factors of raw counts are not known about {columns}: spin the unit about them too."
            )
    for axis in _one_way_axes(readings, known):
        against.append(
            f"About {axis} the unit was spun one way only: a scale factor that differs between the "
            "ways (asymmetry) cannot be separated from the bias. Spin it the other way too."
        )
    guessed = [p.group.name or axis_words(p.axis) for p in placements if p.guessed]
    if guessed:
        say.append(
            f"The protocol does not say which axis was up in {len(guessed)} placements; the accelerometers do."
        )
    if site.latitude is None:
        missing.append(_EARTH_UNKNOWN)
    else:
        say.append(_about_earth(site.latitude, float(np.min(np.abs(estimate.spins.rates)))))
    axes = np.zeros_like(estimate.spins.residuals)
    for c, placement in enumerate(placements):
        axes[readings.spin[c][readings.spin[c] >= 0]] = placement.axis
    of_recording = [Said("objection", text, of_recording=True) for text in against]
    against = contradicting_rates(estimate.spins.rates, np.sum(estimate.spins.residuals * axes, axis=1))
    missing += biases.not_determined
    say += biases.remarks
    say.append(_linearity(readings, fit))
    if fit.placement > 0.0:
        used = float(np.degrees(np.hypot(np.sqrt(np.mean(readings.sigma**2)), fit.placement)))
        say.append(
            f"The placements contradict one another: the table's axis was off the unit's by about {two_digits(used)}°, "
            "and the stated uncertainties are made with that."
        )
    sigma = float(np.hypot(np.sqrt(np.mean(readings.sigma**2)), fit.placement))
    say.append(_about_tilt(sigma))
    estimate.said = of_recording + said_of(remarks=say, objections=against, not_determined=missing)


_EARTH_UNKNOWN = (
    "No latitude was given: the Earth's rotation about the table's axis, up to 7.3e-5 rad/s (4.7e-5 at 40°), "
    "is in the bias as an uncertainty, equal for all axes. Give --site LATITUDE."
)


def _about_earth(latitude: float, slowest: float) -> str:
    vertical = EARTH_RATE * float(np.sin(latitude))
    return (
        f"The Earth's rotation about the table's axis was taken out: {abs(vertical):.3g} rad/s, which left in "
        f"would be an error of the bias as large, {two_digits(1e6 * abs(vertical) / slowest)} ppm of the slowest "
        "spin."
    )


def _one_way_axes(readings: SpinReadings, known: np.ndarray) -> list[str]:
    along = readings.rate.reshape(-1, 3)
    largest = np.max(np.abs(along), axis=1, keepdims=True)
    main = np.where(np.abs(along) >= largest, along, 0.0)
    return [
        "xyz"[j]
        for j in range(3)
        if known[j] and np.any(main[:, j]) and not (np.any(main[:, j] > 0) and np.any(main[:, j] < 0))
    ]


def _linearity(readings: SpinReadings, fit: _Fit) -> str:
    """Return by what each gyro departs from a straight line, in ppm of the largest rate."""
    base = fit.free[(fit.free < ASYMMETRY.start) | (fit.free >= BIASES)]
    start = fit.values.copy()
    start[ASYMMETRY.start : BIASES] = 0.0
    straight = _balanced(readings, start, base, 0)
    matrix: Matrix = straight.values[MATRIX].reshape(3, 3)
    biases = straight.values[BIASES:].reshape(-1, 1, 3)
    off = readings.observed - readings.rate @ matrix.T - biases
    size = np.max(np.abs(readings.rate))
    spun = np.abs(readings.rate) >= np.max(np.abs(readings.rate), axis=2, keepdims=True)
    worst = [
        float(np.max(np.abs(off[..., i][spun[..., i] & (readings.spin >= 0)]), initial=0.0)) for i in range(3)
    ]
    ppm = [1e6 * w / (abs(matrix[i, i]) * size) for i, w in enumerate(worst)]
    shown = ", ".join(f"{axis} {two_digits(value)}" for axis, value in zip("xyz", ppm, strict=True) if value)
    largest = f"{np.degrees(size):.4g}°/s"
    return (
        f"Largest departure from a straight line, in ppm of the largest rate ({largest}): {shown or 'none'}."
    )


def _about_tilt(sigma: float) -> str:
    """Return what a table's axis that leans against the unit's own axis, unknown by how much, makes of the gyros."""

    def errors(angle: float) -> str:
        return f"{two_digits(1e3 * angle)} mrad and −{two_digits(1e6 * angle**2)} ppm"

    known = (
        f"The table's axis leans by {np.degrees(sigma):.2g}° (one sigma) against the unit's. "
        if sigma > 0
        else ""
    )
    here = (
        f"In each placement that makes misalignments and scale factors wrong by {errors(sigma)}. "
        if known
        else ""
    )
    return f"{known}{here}A lean of 1° makes {errors(np.radians(1.0))} (misalignment, scale factor)."


def _run(session: Session) -> Estimate:
    protocol, matching = session.matched
    return calibrate_rate_table(
        session.recording, session.means, session.spins, matching, protocol, session.site
    )


PROCEDURE = Procedure(
    "rate-table",
    _run,
    "fixture",
    "a rate table",
    "each axis up on the table, spun both ways at several rates",
    "gyro biases, scale factors, misalignments against the fixture, linearity and asymmetry; no accelerometers",
    "rate-table.md",
    example="rate-table",
    remedy="spin faster or longer, both ways about each axis",
    placement="The placement on the table limits the misalignments one to one. The modified multi-position "
    "procedure finds them from the same table without believing the placement, and calibrates the accelerometers too.",
    believes=True,
    gyros_from="rates",
)
