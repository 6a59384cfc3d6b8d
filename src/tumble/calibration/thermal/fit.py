"""The adjustment of a thermal test, and the choice of its functions of temperature by what they leave out.

What a thermal test cannot show is a part of its uncertainties: hysteresis, what the rate does, g-sensitivity. Where
temperatures were come to from one side only, a loop of the biases looks like a function of temperature, and so
does what the rate of temperature does while the unit settles. Neither can be estimated; both are believed to be within
what such units show, in kelvins (or seconds) of the change with temperature that this unit shows itself. The estimate
stays what it is, and its covariance grows by what it would be wrong by (consider covariance, Schmidt 1966). In too few
poses a g-sensitivity of the gyros looks like a bias; it goes the same way.

The noise seen inside rests is not all. For each kind of condition a variance is added until its residuals are as large
as they should be. Before gross errors are gone the robust median of the residuals sets it, so that an outlier cannot
hide by inflating the noise; afterwards their mean square does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Protocol

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.evidence import Candidate
from tumble.calibration.thermal.conditions import (
    LEAST_WIDTH,
    ThermalConditions,
    ThermalLayout,
    ThermalTerms,
    ThermalTest,
)
from tumble.calibration.thermal.points import ThermalPoints
from tumble.calibration.thermal.wander import TRIADS, Levels, WanderingConditions, find_levels
from tumble.counting import counted, part
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import (
    CHANCE,
    ROUNDS,
    SETTLED,
    Adjustment,
    Conditions,
    Outlier,
    Prior,
    Screen,
    adjust,
    gross_errors,
    noise_ratio,
    snoop_groups,
)
from tumble.records import dataclass
from tumble.sensor import TemperatureBasis

HIGHEST_ORDER = 5
# A twentieth more in the mean square is within its own scatter over some hundred rests, a tenth is not.
ALIKE, WORSE = 0.05, 0.1
# Temperatures nearer to one another than this are one soak.
SAME_SOAK = 3.0  # K
# Parts of a sweep that are left out one by one, and nodes of its interpolations.
BANDS, NODES = 8, 6
# Lag and width go in steps of at most so much, until nothing moves by more than this share of its sigma.
LARGEST_LAG_STEP, LARGEST_WIDTH_STEP = 30.0, 1.5  # s, K
NOTHING_MOVES, MOST_STEPS = 0.02, 60
REFUSED = (ObservabilityError, ConvergenceError)


@dataclass
class ThermalFit:
    """A settled adjustment.

    Attributes
    ----------
    conditions : the equations, with the unknowns' layout.
    adjustment : the last one, its rows made independent where `levels` say that biases wander.
    covariance : of all unknowns, with what neighbouring points have in common.
    alone : standard deviation of unit weight with the noise inside the points alone.
    levels : by how much biases wander.
    outliers : points that were left out.
    """

    conditions: ThermalConditions
    adjustment: Adjustment
    covariance: Square
    alone: float
    levels: Levels
    outliers: list[Outlier] = field(default_factory=list[Outlier])

    @property
    def values(self) -> Series:
        """The unknowns."""
        return self.adjustment.parameters

    @property
    def layout(self) -> ThermalLayout:
        """Where they are."""
        return self.conditions.layout

    @property
    def terms(self) -> ThermalTerms:
        """Which there are."""
        return self.conditions.terms


def fit_thermal(
    test: ThermalTest, terms: ThermalTerms, *, robust: bool = True, levels: Levels | None = None
) -> ThermalFit:
    """Adjust a thermal model.

    Parameters
    ----------
    test, terms : observations in near SI with what is known, and the unknowns.
    robust : look for outlying points, and find by how much biases wander.
    levels : of that, where they are not to be found.

    Raises
    ------
    ObservabilityError
        If the points do not tell all unknowns.
    ConvergenceError
        If the adjustment does not settle.
    """
    conditions = ThermalConditions(test, terms)
    prior, start = conditions.prior(), conditions.start()
    # With weights that are too large lag and width would run away: they are free in the last adjustment only.
    held = conditions.prior(held=True)
    if int(np.count_nonzero(conditions.active)) + prior.rank < conditions.layout.size:
        raise ObservabilityError(
            f"{len(test.points)} rests cannot determine {conditions.layout.size} unknowns: record more "
            "poses or temperatures."
        )
    if levels is not None:
        return _wandering(conditions, start, prior, levels)
    if not robust:
        adjustment = adjust(conditions, start, prior=held)
        return ThermalFit(conditions, adjustment, adjustment.cofactor, adjustment.sigma0, Levels())
    kinds = {name: columns for name, columns in TRIADS.items() if conditions.active[:, columns].any()}
    adjustment, outliers, alone = balanced(conditions, start, kinds, prior=held)
    found = find_levels(conditions, adjustment.parameters, prior)
    fit = _wandering(conditions, adjustment.parameters, prior, found)
    return replace(fit, alone=alone, outliers=outliers)


def try_fit(test: ThermalTest, terms: ThermalTerms, *, robust: bool = True) -> ThermalFit | None:
    """Return what `fit_thermal` does; None where the points do not tell it, or it does not settle."""
    try:
        return fit_thermal(test, terms, robust=robust)
    except REFUSED:
        return None


def _wandering(conditions: ThermalConditions, start: Series, prior: Prior, levels: Levels) -> ThermalFit:
    """Adjust with biases that wander by known levels."""
    whitened = WanderingConditions(conditions, levels)
    if conditions.terms.lag or conditions.terms.width:
        adjustment = _settled(whitened, start, prior)
    else:
        adjustment = adjust(whitened, start, prior=prior)
    return ThermalFit(conditions, adjustment, adjustment.cofactor, adjustment.sigma0, levels)


def _settled(whitened: WanderingConditions, start: Series, prior: Prior) -> Adjustment:
    """Adjust with lag and width free, in steps that their lines are good for, centred anew before each."""
    conditions, values = whitened.inner, start.copy()
    limits = (("lag", LARGEST_LAG_STEP, -1.0), ("width", LARGEST_WIDTH_STEP, LEAST_WIDTH))
    limited = [
        (conditions.layout[name].start, largest, least)
        for name, largest, least in limits
        if conditions.layout.has(name)
    ]
    for _ in range(MOST_STEPS):
        conditions.centre(values)
        adjustment = adjust(whitened, values, prior=prior, once=True)
        step = adjustment.parameters - values
        share = min([1.0, *(largest / max(abs(step[at]), 1e-12) for at, largest, _ in limited)])
        moved = values + share * step
        for at, _, least in limited:
            moved[at] = max(moved[at], least)
        size = np.abs(moved - values) / np.sqrt(np.diag(adjustment.cofactor))
        values = moved
        if float(size.max()) < NOTHING_MOVES:
            return adjustment
    raise ConvergenceError(f"Lag and width of the hysteresis did not settle within {MOST_STEPS} steps.")


def soaks_of(celsius: Series) -> Series:
    """Return the distinct temperatures (°C) of settled points, those within 3 K taken together."""
    ordered = np.sort(celsius)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > SAME_SOAK) + 1)
    return np.array([float(group.mean()) for group in groups if group.size])


def _folds_of(test: ThermalTest) -> list[np.ndarray]:
    """Return masks of points to leave out together: a soak, or a band of temperature on all branches.

    Never single points, whose neighbours would tell everything; and none at the ends of the span, where a
    prediction would be an extrapolation, which nobody is allowed anyway.
    """
    celsius = test.points.celsius
    if test.soaks is not None:
        nearest = np.argmin(np.abs(celsius[:, None] - test.soaks[None]), axis=1)
        return [nearest == k for k in range(1, len(test.soaks) - 1)]
    low, high = float(celsius.min()), float(celsius.max())
    band = np.clip(((celsius - low) / max(high - low, 1e-9) * BANDS).astype(int), 0, BANDS - 1)
    return [mask for k in range(1, BANDS - 1) if np.any(mask := band == k)]


def highest_order(soaks: Series | None) -> int:
    """Return the highest order of a polynomial that soaks, or the bands of a sweep (None), can be asked for."""
    return max(min(HIGHEST_ORDER, (len(soaks) if soaks is not None else BANDS) - 2), 1)


def _bases_of(test: ThermalTest, reference: float) -> list[TemperatureBasis]:
    """Return the bases that a test can tell, the simplest first."""
    celsius = test.points.celsius
    ends = float(celsius.min()), float(celsius.max())
    nodes = np.linspace(*ends, NODES) if test.soaks is None else test.soaks
    orders = range(1, highest_order(test.soaks) + 1)
    found = [TemperatureBasis("polynomial", reference, order=k) for k in orders]
    kinds = (("linear", 3), ("spline", 4))
    return found + [TemperatureBasis(kind, reference, nodes) for kind, least in kinds if len(nodes) >= least]


def choose_terms(test: ThermalTest, terms: ThermalTerms) -> tuple[ThermalTerms, list[Candidate]]:
    """Choose the functions of temperature by what they predict of soaks, or bands of a sweep, that are left out.

    First the basis is chosen with an accelerometer matrix that changes along a straight line, then how many
    functions the matrix has. Of two that predict alike (within one standard error over the folds), the one
    with fewer unknowns is taken.

    Parameters
    ----------
    test, terms : as for `fit_thermal`; the basis of `terms` is the one to begin with.

    Raises
    ------
    ObservabilityError
        If not even a straight line in temperature can be told.
    """
    folds, bases = _folds_of(test), _bases_of(test, terms.basis.reference_celsius)
    levels = _least_levels(test, terms, bases)
    tried: list[tuple[Candidate, ThermalTerms]] = []
    with part(0.15, 0.7):
        for basis in counted(bases, len(bases)):
            matrix = 0 if terms.poses == 0 else (1 if basis.kind == "polynomial" else basis.size)
            offered = replace(terms, basis=basis, matrix_functions=matrix)
            tried += _tried(name_of(basis), test, offered, folds, levels)
    if not folds or not tried:
        chosen = replace(terms, basis=bases[0], matrix_functions=min(1, terms.poses))
        told = try_fit(test, chosen, robust=False) is not None
        return chosen if told else replace(chosen, matrix_functions=0), []
    chosen = _simplest(tried)
    more: list[tuple[Candidate, ThermalTerms]] = []
    if terms.poses and chosen.basis.kind == "polynomial":
        counts = range(min(chosen.basis.size, 2) + 1)
        with part(0.7, 0.9):
            for count in counted(counts, len(counts)):
                name = f"{name_of(chosen.basis)}, accelerometer matrix of order {count}"
                more += _tried(name, test, replace(chosen, matrix_functions=count), folds, levels)
    chosen = _simplest(more) if more else chosen
    return chosen, [replace(made, chosen=offered is chosen) for made, offered in (*tried, *more)]


def _least_levels(test: ThermalTest, terms: ThermalTerms, bases: list[TemperatureBasis]) -> Levels:
    """Return by how much biases wander under the richest polynomial that the points tell.

    Under a poorer one it would hold what that leaves out, and every candidate would look good against it.
    """
    for basis in reversed([basis for basis in bases if basis.kind == "polynomial"]):
        for matrix in (min(2, basis.size), 0) if terms.poses else (0,):
            if fit := try_fit(test, replace(terms, basis=basis, matrix_functions=matrix)):
                return fit.levels
    raise ObservabilityError(
        "The rests do not determine even a straight line in temperature: record more temperatures, "
        "or more poses at each."
    )


def name_of(basis: TemperatureBasis) -> str:
    """Return what a basis is, in words."""
    if basis.kind == "polynomial":
        return f"polynomial of order {basis.order}"
    return "linear interpolation" if basis.kind == "linear" else "natural spline"


def _tried(
    name: str, test: ThermalTest, terms: ThermalTerms, folds: list[np.ndarray], levels: Levels
) -> list[tuple[Candidate, ThermalTerms]]:
    """Return a candidate with its score; nothing where the points cannot tell it."""
    scores: list[float] = []
    try:
        unknowns = fit_thermal(test, terms, levels=levels).layout.shared
        for fold in folds:
            trained = _without_node(terms, float(test.points.celsius[fold].mean()), test.soaks is not None)
            fit = fit_thermal(replace(test, points=test.points.only(~fold)), trained, levels=levels)
            scores.append(_predicted_misfit(fit, test.points.only(fold)))
    except (*REFUSED, ValueError, np.linalg.LinAlgError):
        return []
    spread = float(np.std(scores, ddof=1) / np.sqrt(len(scores))) if len(scores) > 1 else np.inf
    score = float(np.mean(scores)) if scores else np.nan
    return [(Candidate(name, unknowns, score, spread, tuple(scores)), terms)]


def _without_node(terms: ThermalTerms, celsius: float, from_soaks: bool) -> ThermalTerms:
    """Return the terms without the node of a soak that is left out: nothing would tell its value."""
    basis = terms.basis
    if basis.kind == "polynomial" or not from_soaks:
        return terms
    kept = np.delete(basis.nodes, int(np.argmin(np.abs(basis.nodes - celsius))))
    # A basis of too few nodes is a ValueError.
    less = TemperatureBasis(basis.kind, basis.reference_celsius, kept)
    return replace(terms, basis=less, matrix_functions=less.size if terms.matrix_functions else 0)


def _simplest(tried: list[tuple[Candidate, ThermalTerms]]) -> ThermalTerms:
    """Return the terms with the fewest unknowns that predict as well as the best, to one standard error."""
    best = min(tried, key=lambda pair: pair[0].score)[0]

    def as_good(candidate: Candidate) -> bool:
        # Folds differ more than candidates do: what counts is the difference in the same folds.
        worse = np.array(candidate.folds) - np.array(best.folds)
        slack = float(np.std(worse, ddof=1) / np.sqrt(worse.size)) if worse.size > 1 else 0.0
        # Two or three folds hardly tell their own scatter, which may come out as nothing or as much.
        return float(worse.mean()) <= min(max(slack, ALIKE * best.score), WORSE * best.score)

    good = [pair for pair in tried if as_good(pair[0])]
    return min(good, key=lambda pair: pair[0].unknowns)[1]


def _predicted_misfit(fit: ThermalFit, left: ThermalPoints) -> float:
    """Return the mean square, in sigmas, of what a fit predicts wrongly of points that it has not seen."""
    trained = fit.conditions
    lag, width = trained.lag_and_width(fit.values)
    test = ThermalConditions(replace(trained.test, points=left, lag=lag, width=width), trained.terms)
    # Placements that the fit knows keep what it knows of them; the others are judged by their norms alone.
    test.layout, test.own, test.several = trained.layout, trained.own_of(left.placement), trained.several
    test.directions, test.tangents = trained.directions, trained.tangents
    test.active = test.rows()
    linear = WanderingConditions(test, fit.levels).linearise(fit.values)
    used = linear.active
    return float(np.mean(linear.misclosure[used] ** 2)) if np.any(used) else 0.0


# One sigma of half a loop: as much as this many kelvins change the bias. The simulator's grades assume half of it.
LOOP_KELVINS = 2.0
# The state before the first sample is anywhere from -1 to 1.
START_STATE = 1.0 / np.sqrt(3.0)
# One sigma of what the rate does, in seconds of the change with temperature: lag beside 30 s, and the rate itself.
RATE_SECONDS = 85.0
# One sigma of a g-sensitivity in 1 g, in what the bias is unsteady by; the simulator's grades have 3 to 20.
PULL_FACTOR = 25.0


def changes_per_kelvin(fit: ThermalFit) -> tuple[float, float]:
    """Return the root mean square over axes and rests of the biases' slopes, (m/s²)/K and (rad/s)/K."""
    slopes = fit.terms.basis.derivatives(fit.conditions.points.celsius)
    found = [0.0, 0.0]
    for k, name in enumerate(("b", "gb")):
        if fit.layout.has(name):
            found[k] = float(np.sqrt(np.mean((slopes @ fit.values[fit.layout[name]].reshape(-1, 3)) ** 2)))
    return found[0], found[1]


def with_hysteresis_doubt(fit: ThermalFit) -> tuple[ThermalFit, tuple[float, float]]:
    """Return a fit without hysteresis whose covariance has in it what one could have done.

    Parameters
    ----------
    fit : of temperatures that were come to from one side.

    Returns
    -------
    fit : with a larger covariance.
    loops : m/s² and rad/s, one sigma of half a loop as it was believed.
    """
    first, second = changes_per_kelvin(fit)
    loops, old = (LOOP_KELVINS * first, LOOP_KELVINS * second), fit.conditions
    lag, width = old.lag_and_width(fit.values)
    more = ThermalConditions(replace(old.test, lag=lag, width=width), replace(fit.terms, hysteresis=True))
    values, more.active = np.zeros(more.layout.size), old.active
    for name in (block.name for block in fit.layout.blocks.blocks if block.labels):
        values[more.layout[name]] = fit.values[fit.layout[name]]
    gain = fit.adjustment.cofactor @ fit.adjustment.linearisation.design.reshape(-1, fit.layout.size).T
    covariance, state = fit.covariance.copy(), np.abs(old.functions(fit.values)[:, -1])
    for column, share in ((state, 1.0), (1.0 - state, START_STATE)):
        more.middle[:, -1] = column
        rows = WanderingConditions(more, fit.levels).linearise(values).design.reshape(-1, more.layout.size)
        for name, loop in zip(("h", "gh"), loops, strict=True):
            moved = share * loop * gain @ rows[:, more.layout[name]]
            covariance += moved @ moved.T
    return replace(fit, covariance=covariance), loops


def with_pull(fit: ThermalFit) -> tuple[ThermalFit, float]:
    """Return a fit with what a g-sensitivity that the poses do not tell is in the gyros' biases, and its sigma, rad/s.

    Parameters
    ----------
    fit : of any poses; of nine nothing is added.
    """
    points = fit.conditions.points
    if fit.terms.poses == 9 or points.rate_covariance is None or points.force is None:
        return fit, 0.0
    noise = float(np.mean(np.diagonal(points.rate_covariance, axis1=1, axis2=2)))
    sigma = PULL_FACTOR * float(np.sqrt(fit.levels.flicker["rate"] + fit.levels.single["rate"] + noise))
    covariance, at = fit.covariance.copy(), fit.layout["gb0"]
    covariance[at, at] += sigma**2 * np.eye(3)
    return replace(fit, covariance=covariance), sigma


_PASSES = 12


class Weighed(Conditions, Protocol):
    """Conditions with variances beyond their noise, and rows that may take no part."""

    extra: dict[str, float]
    active: np.ndarray


Solve = Callable[[dict[str, float], bool], Adjustment]
"""Adjusts with extra variances by kind (SI²).

With the last true a single step from the latest solution is enough: little has changed since.
"""


def balanced(
    conditions: Weighed, start: Series, kinds: Mapping[str, slice], prior: Prior | None = None
) -> tuple[Adjustment, list[Outlier], float]:
    """Adjust with variance added where residuals ask for it, and without what is no noise.

    Parameters
    ----------
    conditions : outliers are switched off in `active`.
    start, prior : of the unknowns.
    kinds : the kinds of conditions that may need more variance, and their columns in a group.

    Returns
    -------
    adjustment, outliers : the last one, and what was left out.
    alone : sigma0 with the conditions' own noise alone.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    values = [start]

    def solve(extra: dict[str, float], once: bool) -> Adjustment:
        conditions.extra = {**none, **extra}
        adjustment = adjust(conditions, values[-1], prior=prior, once=once)
        values.append(adjustment.parameters)
        return adjustment

    none, variances = dict.fromkeys(conditions.extra, 0.0), dict.fromkeys(kinds, 0.0)
    adjustment = solve(none, False)
    alone, outliers = adjustment.sigma0, list[Outlier]()
    for _ in range(_PASSES):
        adjustment, variances = _settle(solve, kinds, adjustment, variances, robust=True)
        tests = {kind: snoop_groups(adjustment, columns) for kind, columns in kinds.items()}
        found = gross_errors([Screen(kind) for kind in kinds], tests, outliers)
        if not found:
            break
        for outlier in found:
            conditions.active[outlier.group, kinds[outlier.kind]] = False
        outliers += found
        adjustment = solve(variances, True)
    adjustment, variances = _settle(solve, kinds, adjustment, variances, robust=False)
    for kind in kinds:
        # A component that chance explains is no component: taking every excess for real, and no
        # deficit, would make the uncertainties too wide on average.
        if variances[kind] > 0.0:
            without = {**variances, kind: 0.0}
            if _explained_by_chance(solve(without, True), kinds[kind]):
                variances = without
    return solve(variances, False), outliers, alone


def _settle(
    solve: Solve,
    kinds: Mapping[str, slice],
    adjustment: Adjustment,
    extra: dict[str, float],
    *,
    robust: bool,
) -> tuple[Adjustment, dict[str, float]]:
    """Move the extra variances until each kind's residuals are as large as its variance says."""
    for _ in range(ROUNDS):
        before = extra
        for kind, columns in kinds.items():
            tests = snoop_groups(adjustment, columns)
            if not np.any(tests.degrees):
                continue
            # What the weight is worth: the harmonic mean of the conditions' variances.
            diagonal = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, columns]
            used = diagonal[adjustment.linearisation.active[:, columns]]
            total = float(used.size / np.sum(1.0 / used))
            wanted = max(0.0, extra[kind] + (noise_ratio(tests, robust=robust) - 1.0) * total)
            if abs(wanted - extra[kind]) > SETTLED * total:
                extra = {**extra, kind: wanted}
        if extra is before:
            break
        adjustment = solve(extra, True)
    return adjustment, extra


def _explained_by_chance(adjustment: Adjustment, columns: slice) -> bool:
    """Return whether the residuals of a kind are no larger than noise makes them in 97.5 % of cases."""
    from scipy.special import chdtrc

    tests = snoop_groups(adjustment, columns)
    redundancy = float(tests.redundancy.sum())
    statistic = noise_ratio(tests, robust=False) * redundancy if np.any(tests.degrees) else 0.0
    return redundancy < 1.0 or float(chdtrc(redundancy, statistic)) > CHANCE
