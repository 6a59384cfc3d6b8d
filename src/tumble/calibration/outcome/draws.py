"""Propagation of distributions for the joint estimate (JCGM 101): drawn errors, carried to the parameters.

Errors of each source are drawn with its share of the covariance: of normal distributions, or of Student's with
the source's own degrees of freedom where its size was estimated (JCGM 101, 6.4.9); gravity that was assumed is
rectangular (6.4.2), and acts as it does, not to first order. The parameters are the exact functions of the
drawn unknowns. For the way from observations to unknowns, which that takes as linear, observations of a few runs
are drawn anew from the solution and adjusted in full.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, inverted
from tumble.attitude.rotations import matrices_from_rotation_vectors
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.causes import SOURCES
from tumble.calibration.equations.hold_equations import Force, Rate, Swing
from tumble.calibration.equations.turn_equations import Turn
from tumble.calibration.evidence import Budget, DrawnDistributions, coverage_factors
from tumble.calibration.outcome.budget import (
    NamedParameters,
    outcome_influences,
    residual_scale,
    source_degrees,
)
from tumble.calibration.outcome.description import gravity_slope
from tumble.counting import counted
from tumble.errors import ConvergenceError, UsageError
from tumble.estimation.solve import solve

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.outcome.estimate import JointOutcome

# Full adjustments of observations drawn anew: as many as these seconds allow, and no more than so many.
SECONDS, READJUSTED = 20.0, 200
COVERAGE = 0.95
BLOCKS = 10


def draw_distributions(
    estimate: Estimate,
    runs: int,
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> None:
    """Draw the parameters' distributions, and note in the estimate's statement whether the GUM's intervals hold.

    Parameters
    ----------
    estimate : with a statement of uncertainty that has an outcome; its `drawn` is set, and a remark added.
    runs : draws, a thousand at least.
    rng : random numbers.
    progress : called with a sentence on how far it is.

    Raises
    ------
    UsageError
        If the estimate has no budget of uncertainty.
    """
    from tumble.calibration.outcome.estimate import JointOutcome

    budget = estimate.shown(Budget)
    told = None if budget is None else budget.statement
    outcome = None if told is None else told.outcome
    if told is None or not isinstance(outcome, JointOutcome):
        raise UsageError(
            "--monte-carlo is for the joint estimator's parameters of both triads, and this estimate "
            f"({estimate.procedure}) has no budget of uncertainty to draw from: leave it out, or take --procedure "
            "joint."
        )
    named = NamedParameters.of(outcome, [p.name for p in estimate.parameters])
    progress("distributions")
    unknowns = _draw_unknowns(outcome, runs, rng, residual_scale(estimate))
    drawn = np.array([named.at(one) for one in counted(unknowns, runs)])
    low, high = shortest_intervals(drawn, COVERAGE)
    values = np.array([p.value for p in estimate.parameters])
    sigma = np.array([p.standard_uncertainty for p in estimate.parameters])
    expanded = coverage_factors(told.effective_degrees) * sigma
    tolerance = numerical_tolerance(sigma)
    off = np.maximum(np.abs(values - expanded - low), np.abs(values + expanded - high))
    again, why_none = _readjusted(outcome, rng, progress)
    told.drawn = DrawnDistributions(
        runs=runs,
        intervals=np.column_stack([low, high]),
        off=off,
        spread=_spread_of_ends(drawn),
        tolerance=tolerance,
        readjusted=len(again),
        readjusted_ratio=_spread_ratio(again, outcome, named),
        why_not_readjusted=why_none,
    )
    estimate.say("remark", told.drawn.words())


def _draw_unknowns(outcome: JointOutcome, runs: int, rng: np.random.Generator, scale: float = 1.0) -> Table:
    """Return (runs, unknowns) draws about the solution."""
    shares = outcome_influences(outcome).shares(SOURCES)
    degrees = source_degrees(outcome)
    free = outcome.task.unknowns.free
    off = np.zeros((runs, free.size))
    for source, share in shares.items():
        part = rng.standard_normal((runs, free.size)) @ _root(share).T
        known = degrees.get(source, np.inf)
        if np.isfinite(known):
            part *= np.sqrt(known / rng.chisquare(known, runs))[:, None]
        off += scale * part
    drawn = np.tile(outcome.values, (runs, 1))
    drawn[:, free] += off
    gravity = _draw_gravity(outcome, runs, rng)
    at = free[np.flatnonzero(gravity_slope(outcome.values, outcome.site)[free])]
    drawn[:, at] *= (outcome.site.gravity / gravity)[:, None]
    return drawn


def _draw_gravity(outcome: JointOutcome, runs: int, rng: np.random.Generator) -> Series:
    """Return (runs,) m/s²: rectangular where gravity was assumed or rounded, else normal."""
    site = outcome.site
    if site.is_evenly_spread:
        half = np.sqrt(3.0) * site.gravity_sigma
        return rng.uniform(site.gravity - half, site.gravity + half, runs)
    return rng.normal(site.gravity, site.gravity_sigma, runs)


def _root(share: Square) -> Square:
    values, vectors = np.linalg.eigh(0.5 * (share + share.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.float64)


def shortest_intervals(drawn: Table, coverage: float) -> tuple[Series, Series]:
    """Return the ends (parameters,) of the shortest interval that holds a share of the draws (JCGM 101, 5.3.4).

    Parameters
    ----------
    drawn : (runs, parameters).
    coverage : share of the draws.
    """
    ordered = np.sort(drawn, axis=0)
    inside = min(round(coverage * len(ordered)), len(ordered) - 1)
    widths = ordered[inside:] - ordered[: len(ordered) - inside]
    first = np.argmin(widths, axis=0)
    columns = np.arange(drawn.shape[1], dtype=np.intp)
    return ordered[first, columns], ordered[first + inside, columns]


def _spread_of_ends(drawn: Table) -> Series:
    """Standard deviation by chance of the ends of the shortest intervals, the larger of both."""
    ends = np.array([shortest_intervals(block, COVERAGE) for block in np.array_split(drawn, BLOCKS)])
    return np.asarray(ends.std(axis=0, ddof=1).max(axis=0) / np.sqrt(BLOCKS), dtype=np.float64)


def numerical_tolerance(sigma: Series) -> Series:
    """Return half a unit of the one significant digit of each standard uncertainty (JCGM 101, 7.9.2).

    Parameters
    ----------
    sigma : (parameters,), zero where nothing is uncertain.
    """
    positive = np.where(sigma > 0.0, sigma, 1.0)
    # One digit of 9.6 is 10: the digit's place is that of the rounded number.
    place = np.floor(np.log10(positive))
    place = np.where(np.round(positive / 10.0**place) >= 10.0, place + 1.0, place)
    return np.where(sigma > 0.0, 0.5 * 10.0**place, 0.0)


def _readjusted(
    outcome: JointOutcome, rng: np.random.Generator, progress: Callable[[str], None]
) -> tuple[Table, str]:
    """Unknowns (adjustments, unknowns) of observations drawn anew, and why there are no more."""
    size = outcome.values.size
    if outcome.data.rotations or outcome.data.poses is not None:
        return np.zeros((0, size)), ("a table's rotations and believed poses are not drawn anew")
    made: list[Series] = []
    start = time.perf_counter()
    while len(made) < READJUSTED and time.perf_counter() - start < SECONDS:
        task = redrawn(outcome.task, rng)
        try:
            solve(task)
        except ConvergenceError:
            return np.array(made).reshape(-1, size), "an adjustment did not settle"
        made.append(task.unknowns.values)
        if len(made) % 20 == 0:
            progress(f"distributions: {len(made)} full adjustments")
    return np.array(made).reshape(-1, size), ""


def redrawn(settled: JointAdjustment, rng: np.random.Generator) -> JointAdjustment:
    """Return an adjustment with observations of holds and turns drawn anew about where everything is, as the truth.

    Parameters
    ----------
    settled : without a table's rotations and believed poses.
    rng : random numbers.
    """
    base = settled.data.base
    base = replace(base, rate_mean=base.rate_mean.copy(), raw_rate=base.raw_rate.copy())
    swings = replace(settled.data.swings, value=settled.data.swings.value.copy())
    task = settled.copy()
    data = task.data = replace(settled.data, base=base, parts=settled.data.parts.copy(), swings=swings)
    observed = {"force": data.parts.reshape(data.holds, 9), "rate": base.rate_mean, "swing": swings.value}
    for section in task.sections:
        sigma = np.sqrt(task.noise.of_each("sway", section.holds))[:, None]
        sway = sigma * rng.standard_normal((2, len(section.C_wb), 3))
        C = section.C_wb.copy()
        C[:, 1] = C[:, 0] @ matrices_from_rotation_vectors(sway[0])
        C[:, 2] = C[:, 1] @ matrices_from_rotation_vectors(sway[1])
        true = replace(section, C_wb=C)
        for of_kind in (Force, Rate, Swing):
            (linear,) = of_kind(true).linearise(task)
            observed[of_kind.kind][section.holds] += linear.residual - _errors(linear.covariance, rng)
        k = section.holds[:-1]
        errors: AnyArray | None = None
        for _ in range(3 if k.size else 0):
            (linear,) = Turn(true, k).linearise(task)
            errors = _errors(linear.covariance, rng) if errors is None else errors
            assert linear.by_bias is not None
            for turn, by_bias, missed in zip(k, linear.by_bias, errors - linear.residual, strict=True):
                # What a bias would take away, samples that show more add.
                base.raw_rate[base.turn_start[turn] : base.turn_stop[turn]] += inverted(-by_bias) @ missed
    if task.prior is not None:
        mean = _drawn_mean(task.prior.precision, task.unknowns.values, rng)
        task.prior = replace(task.prior, mean=mean)
    return task


def _errors(covariance: AnyArray, rng: np.random.Generator) -> AnyArray:
    root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    return np.einsum("tab,tb->ta", root, rng.standard_normal(root.shape[:2]))


def _drawn_mean(precision: Square, unknowns: Series, rng: np.random.Generator) -> Series:
    values, vectors = np.linalg.eigh(precision)
    known = values > 1e-12 * max(float(values.max()), 1e-300)
    sigma = np.where(known, 1.0 / np.sqrt(np.where(known, values, 1.0)), 0.0)
    return unknowns + vectors @ (sigma * rng.standard_normal(unknowns.size))


def _spread_ratio(unknowns: Table, outcome: JointOutcome, named: NamedParameters) -> Series:
    """Root mean square of the full adjustments' errors over the first order's sigma, per parameter."""
    if not len(unknowns):
        return np.zeros(0)
    influences = outcome_influences(outcome)
    linear = np.einsum("pa,ab,pb->p", named.slope, influences.covariance, named.slope)
    centre = named.at(outcome.values)
    off = np.array([named.at(drawn) - centre for drawn in unknowns])
    return np.sqrt(np.mean(off**2, axis=0) / np.maximum(linear, 1e-300))
