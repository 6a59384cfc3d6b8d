"""The adjustment of a thermal test, and the choice of its functions of temperature by what they leave out."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.checks.snooping import Kind, Outlier, balance
from tumble.calibration.thermal.conditions import LEAST_WIDTH, ThermalConditions
from tumble.calibration.thermal.evidence import Candidate
from tumble.calibration.thermal.layout import Layout, ThermalTerms
from tumble.calibration.thermal.points import ThermalPoints
from tumble.calibration.thermal.wander import Levels, WanderingConditions, find_levels
from tumble.counting import counted, part
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Adjustment, Prior, adjust
from tumble.records import dataclass
from tumble.sensor.thermal import TemperatureBasis

HIGHEST_ORDER = 5
# A twentieth more in the mean square is within its own scatter over some hundred rests, a tenth is not.
ALIKE, WORSE = 0.05, 0.1
# Temperatures nearer to one another than this are one soak.
SAME_SOAK = 3.0  # K
# Parts of a sweep that are left out one by one, and nodes of its interpolations.
BANDS, NODES = 8, 6
# Lag and width go in steps of at most so much, until nothing moves by more than this share of its sigma.
LARGEST_LAG_STEP, LARGEST_WIDTH_STEP = 30.0, 1.5  # s, K
SETTLED, MOST_STEPS = 0.02, 60
_FORCE, _RATE = slice(0, 3), slice(3, 6)


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the equations need beside the points: gravity, m/s²; the Earth rate, rad/s; lag, s, and width, K."""

    gravity: float
    earth: tuple[float, float, float]
    lag: float
    width: float


@dataclass(slots=True)
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
    def layout(self) -> Layout:
        """Where they are."""
        return self.conditions.layout


def fit_thermal(
    points: ThermalPoints,
    terms: ThermalTerms,
    where: Surroundings,
    *,
    robust: bool = True,
    levels: Levels | None = None,
) -> ThermalFit:
    """Adjust a thermal model.

    Parameters
    ----------
    points, terms, where : observations in near SI, unknowns, and what is known.
    robust : look for outlying points, and find by how much biases wander.
    levels : of that, where they are not to be found.

    Raises
    ------
    ObservabilityError
        If the points do not tell all unknowns.
    ConvergenceError
        If the adjustment does not settle.
    """
    conditions = ThermalConditions(points, terms, where.gravity, where.earth, where.lag, where.width)
    prior, values = conditions.prior(), [conditions.start()]
    # With weights that are too large lag and width would run away: they are free in the last adjustment only.
    held = conditions.prior(held=True)
    conditions.centre(values[0])
    rows = int(np.count_nonzero(conditions.active)) + prior.rank
    if rows < conditions.layout.size:
        raise ObservabilityError(
            f"{len(points)} rests cannot determine {conditions.layout.size} unknowns: record more "
            "poses or temperatures."
        )

    def solve(extra: dict[str, float], active: np.ndarray, *, once: bool) -> Adjustment:
        conditions.extra, conditions.active = extra, active
        adjustment = adjust(conditions, values[-1], prior=held, once=once)
        values.append(adjustment.parameters)
        return adjustment

    if levels is not None:
        return _wandering(conditions, values[-1], prior, levels)
    if not robust:
        adjustment = solve({"force": 0.0, "rate": 0.0}, conditions.active, once=False)
        return ThermalFit(conditions, adjustment, adjustment.cofactor, adjustment.sigma0, Levels())
    active = conditions.active.copy()
    alone = solve({"force": 0.0, "rate": 0.0}, active, once=False).sigma0
    kinds = [Kind("force", _FORCE)] if points.force is not None and active[:, _FORCE].any() else []
    kinds += [Kind("rate", _RATE)] if points.rate is not None else []
    balanced = balance(solve, kinds, active, extra={"force": 0.0, "rate": 0.0})
    conditions.active = active
    found = find_levels(conditions, balanced.adjustment.parameters, prior)
    fit = _wandering(conditions, balanced.adjustment.parameters, prior, found)
    return replace(fit, alone=alone, outliers=balanced.outliers)


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
    limited = [
        (conditions.layout.places[name].start, largest, least)
        for name, largest, least in (
            ("lag", LARGEST_LAG_STEP, -1.0),
            ("width", LARGEST_WIDTH_STEP, LEAST_WIDTH),
        )
        if conditions.layout.places[name].stop > conditions.layout.places[name].start
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
        if float(size.max()) < SETTLED:
            return adjustment
    raise ConvergenceError(f"Lag and width of the hysteresis did not settle within {MOST_STEPS} steps.")


def soaks_of(celsius: Series) -> Series:
    """Return the distinct temperatures (°C) of settled points, those within 3 K taken together."""
    ordered = np.sort(celsius)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > SAME_SOAK) + 1)
    return np.array([float(group.mean()) for group in groups if group.size])


def _folds_of(points: ThermalPoints, soaks: Series | None) -> list[np.ndarray]:
    """Return masks of points to leave out together: a soak, or a band of temperature on all branches.

    Never single points, whose neighbours would tell everything; and none at the ends of the span, where a
    prediction would be an extrapolation, which nobody is allowed anyway.
    """
    if soaks is not None:
        nearest = np.argmin(np.abs(points.celsius[:, None] - soaks[None]), axis=1)
        return [nearest == k for k in range(1, len(soaks) - 1)]
    low, high = float(points.celsius.min()), float(points.celsius.max())
    band = np.clip(((points.celsius - low) / max(high - low, 1e-9) * BANDS).astype(int), 0, BANDS - 1)
    return [mask for k in range(1, BANDS - 1) if np.any(mask := band == k)]


def highest_order(soaks: Series | None) -> int:
    """Return the highest order of a polynomial that soaks, or the bands of a sweep (None), can be asked for."""
    return max(min(HIGHEST_ORDER, (len(soaks) if soaks is not None else BANDS) - 2), 1)


def _bases_of(
    points: ThermalPoints, soaks: Series | None, reference: float
) -> list[tuple[str, TemperatureBasis]]:
    """Return the bases that a test can tell, the simplest first."""
    low, high = float(points.celsius.min()), float(points.celsius.max())
    nodes = soaks if soaks is not None else np.linspace(low, high, NODES)
    found = [
        (f"polynomial of order {k}", TemperatureBasis("polynomial", reference, order=k))
        for k in range(1, highest_order(soaks) + 1)
    ]
    if len(nodes) >= 3:
        found.append(("linear interpolation", TemperatureBasis("linear", reference, nodes)))
    if len(nodes) >= 4:
        found.append(("natural spline", TemperatureBasis("spline", reference, nodes)))
    return found


def choose_terms(
    points: ThermalPoints, terms: ThermalTerms, where: Surroundings, soaks: Series | None
) -> tuple[ThermalTerms, list[Candidate]]:
    """Choose the functions of temperature by what they predict of soaks, or bands of a sweep, that are left out.

    First the basis is chosen with an accelerometer matrix that changes along a straight line, then how many
    functions the matrix has. Of two that predict alike (within one standard error over the folds), the one
    with fewer unknowns is taken.

    Parameters
    ----------
    points, terms, where : as for `fit_thermal`; the basis of `terms` is the one to begin with.
    soaks : °C of the soaks; None for a sweep.

    Raises
    ------
    ObservabilityError
        If not even a straight line in temperature can be told.
    """
    reference = terms.basis.reference_celsius
    folds = _folds_of(points, soaks)
    bases = _bases_of(points, soaks, reference)
    simple = replace(terms, basis=bases[0][1], matrix_functions=0)
    levels = _least_levels(points, terms, where, [basis for _, basis in bases])
    tried: list[tuple[Candidate, ThermalTerms]] = []
    with part(0.15, 0.7):
        for name, basis in counted(bases, len(bases)):
            matrix = 0 if terms.poses == 0 else (1 if basis.kind == "polynomial" else basis.size)
            offered = replace(terms, basis=basis, matrix_functions=matrix)
            tried += _tried(name, points, offered, where, folds, soaks, levels)
    if not folds or not tried:
        chosen = replace(simple, matrix_functions=min(1, terms.poses))
        return _possible(points, chosen, where), []
    best = _simplest(tried)
    more: list[tuple[Candidate, ThermalTerms]] = []
    if terms.poses and best.basis.kind == "polynomial":
        counts = range(min(best.basis.size, 2) + 1)
        with part(0.7, 0.9):
            for count in counted(counts, len(counts)):
                name = f"{name_of(best.basis)}, accelerometer matrix of order {count}"
                offered = replace(best, matrix_functions=count)
                more += _tried(name, points, offered, where, folds, soaks, levels)
    chosen = _simplest(more) if more else best
    words = [candidate for candidate, _ in (*tried, *more)]
    pairs = [*tried, *more]
    named = [
        replace(candidate, chosen=offered is chosen or (not more and offered is best))
        for candidate, (_, offered) in zip(words, pairs, strict=True)
    ]
    return chosen, named


def _least_levels(
    points: ThermalPoints, terms: ThermalTerms, where: Surroundings, bases: list[TemperatureBasis]
) -> Levels:
    """Return by how much biases wander under the richest polynomial that the points tell.

    Under a poorer one it would hold what that leaves out, and every candidate would look good against it.
    """
    for basis in reversed([basis for basis in bases if basis.kind == "polynomial"]):
        for matrix in (min(2, basis.size), 0) if terms.poses else (0,):
            try:
                rich = fit_thermal(points, replace(terms, basis=basis, matrix_functions=matrix), where)
            except (ObservabilityError, ConvergenceError):
                continue
            return rich.levels
    raise ObservabilityError(
        "The rests do not determine even a straight line in temperature: record more temperatures, "
        "or more poses at each."
    )


def _possible(points: ThermalPoints, terms: ThermalTerms, where: Surroundings) -> ThermalTerms:
    """Return the terms, without a change of the matrix where the points do not tell one."""
    try:
        fit_thermal(points, terms, where, robust=False)
    except (ObservabilityError, ConvergenceError):
        return replace(terms, matrix_functions=0)
    return terms


def name_of(basis: TemperatureBasis) -> str:
    """Return what a basis is, in words."""
    if basis.kind == "polynomial":
        return f"polynomial of order {basis.order}"
    return "linear interpolation" if basis.kind == "linear" else "natural spline"


def _tried(
    name: str,
    points: ThermalPoints,
    terms: ThermalTerms,
    where: Surroundings,
    folds: list[np.ndarray],
    soaks: Series | None,
    levels: Levels,
) -> list[tuple[Candidate, ThermalTerms]]:
    """Return a candidate with its score; nothing where the points cannot tell it."""
    scores: list[float] = []
    try:
        whole = ThermalConditions(points, terms, where.gravity, where.earth, where.lag, where.width)
        fit_thermal(points, terms, where, levels=levels)
        for fold in folds:
            trained = _without_node(terms, float(points.celsius[fold].mean()), soaks is not None)
            fit = fit_thermal(points.only(~fold), trained, where, levels=levels)
            scores.append(_predicted_misfit(fit, points.only(fold)))
    except (ObservabilityError, ConvergenceError, ValueError, np.linalg.LinAlgError):
        return []
    spread = float(np.std(scores, ddof=1) / np.sqrt(len(scores))) if len(scores) > 1 else np.inf
    score = float(np.mean(scores)) if scores else np.nan
    return [(Candidate(name, whole.layout.shared, score, spread, tuple(scores)), terms)]


def _without_node(terms: ThermalTerms, celsius: float, from_soaks: bool) -> ThermalTerms:
    """Return the terms without the node of a soak that is left out: nothing would tell its value."""
    basis = terms.basis
    if basis.kind == "polynomial" or not from_soaks:
        return terms
    kept = np.delete(basis.nodes, int(np.argmin(np.abs(basis.nodes - celsius))))
    if len(kept) < (2 if basis.kind == "linear" else 3):
        raise ValueError("too few nodes")
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
    test = ThermalConditions(left, trained.terms, trained.gravity, trained.earth, lag, width)
    test.layout = trained.layout
    # Placements that the fit knows keep what it knows of them; the others are judged by their norms alone.
    several = np.unique(trained.points.placement[trained.own >= 0])
    known = np.isin(left.placement, several)
    test.own = np.where(known, np.searchsorted(several, left.placement), -1)
    test.directions, test.tangents = trained.directions, trained.tangents
    test.active = test.rows()
    linear = WanderingConditions(test, fit.levels).linearise(fit.values)
    used = linear.active
    return float(np.mean(linear.misclosure[used] ** 2)) if np.any(used) else 0.0
