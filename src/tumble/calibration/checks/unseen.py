"""What nothing in a recording can see, and all scale factors follow: clock, rate of a table, gravity.

Gyros whose scale factors come from angles are as wrong as the clock that their rates were added up by; those that come
from a table's rates are as wrong as the table. No residual shows either. The joint estimator has both among its
unknowns, held by what is believed of them, for where both are in a recording the one checks the other. Every other
estimate gets what it depends on afterwards, here: one error that all its gyros share.

    raw rate = M rate + b:  times too long by a share e  =>  M (1 + e),  b - e M (Earth rate seen at rest)

Accelerometers, non-orthogonalities and terms of raw numbers (asymmetry, g-sensitivity) stay as they are. Accelerometers
are as wrong as the gravity that they were compared with, which is in every covariance from the start
(`outcome.description`) and is said here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, Vector
from tumble.calibration.equations.causes import GRAVITY, SAMPLE_RATE, TABLE_RATE
from tumble.calibration.estimate import Estimate, Unseen, correlation_matrix
from tumble.calibration.evidence import Budget, coverage_factors
from tumble.calibration.free_inertial import places_of
from tumble.protocol import SpinStep

if TYPE_CHECKING:
    from tumble.earth import Site
    from tumble.protocol import Protocol
    from tumble.recording import Clock, Recording
    from tumble.segmentation import HoldMeans, Timeline

# From this share of a scale factor's standard uncertainty on its use depends on what cannot be seen; below the
# second it does not count.
DECIDES, COUNTS = 0.5, 0.05
_WHOSE = {SAMPLE_RATE: "the clock's", TABLE_RATE: "the table's", GRAVITY: "gravity's"}


def _unseen_clock(clock: Clock) -> Unseen:
    """Return what is not known of a recording's clock."""
    # The example is this recording's own rate, with a crystal's 100 ppm.
    mend = f"give it, as --rate {clock.rate:.4g}±{clock.rate * 1e-4:.1g}"
    if clock.kind == "board":
        mend = f"say --rate crystal where a crystal times the board, else {mend}"
    elif clock.kind == "nominal" and not clock.counted:
        mend += ", or record the times of a clock"
    nominal = clock.rate if clock.kind == "nominal" else None
    return Unseen(SAMPLE_RATE, clock.sigma, clock.words, mend, nominal)


def unseen_table(protocol: Protocol) -> Unseen | None:
    """Return what is not known of a table's rates; None of a protocol without a table.

    Parameters
    ----------
    protocol : what was to be done.
    """
    spins = [step for step in protocol.steps if isinstance(step, SpinStep)]
    if not spins:
        return None
    because = "as the protocol states"
    if any(step.sigma is None for step in spins):
        because = "the protocol does not say how far the table is off, and this is assumed"
    return Unseen(
        TABLE_RATE,
        max(step.rate_sigma for step in spins),
        because,
        "say in the protocol what the table keeps (`uncertainty_ppm`)",
    )


def state_unseen(
    estimate: Estimate, recording: Recording, means: HoldMeans, protocol: Protocol | None
) -> None:
    """Put what nothing sees into an estimate: covariance, figures and words.

    Parameters
    ----------
    estimate : of one recording, and of no other clock.
    recording, means, protocol : what was recorded, its holds, and what was to be done, where somebody says.
    """
    clock, budget = recording.clock, estimate.shown(Budget)
    if estimate.procedure != "joint":
        return state_unseen_clock(clock, estimate, rest_rate(estimate, means))
    within = {SAMPLE_RATE: clock.sigma * _scale_slope(estimate)} if budget is None else budget.shares
    # Where the recording itself determines the clock, or checks the table, little is left of what was believed.
    table = None if protocol is None else unseen_table(protocol)
    for one in (_unseen_clock(clock), table):
        if one is not None and one.source in within and one.sigma > 0.0:
            _say(estimate, one, within[one.source])
    return None


def state_gravity(site: Site, estimate: Estimate) -> None:
    """Say what gravity makes all accelerometer scale factors uncertain by.

    Parameters
    ----------
    site : of the recording, the least known one of several.
    estimate : is told.
    """
    because = f"{site.gravity:.6g} m/s² is {site.source}"
    one = Unseen(GRAVITY, site.gravity_sigma / site.gravity, because, site.mend)
    _say(estimate, one, _scale_slope(estimate, triad="accelerometer") * one.sigma)


def state_rounding(estimate: Estimate, recording: Recording, means: HoldMeans, timeline: Timeline) -> None:
    """Say where a converter's steps, and not noise, decide what the means of holds are worth.

    Parameters
    ----------
    estimate, recording, means, timeline : of one recording.
    """
    from tumble.segmentation import carries_remainder, step_at_rests

    rests = [hold.stretches() for hold in timeline.holds]
    for name, channel in (("accelerometer", "specific_force"), ("gyro", "angular_rate")):
        signal, unit = getattr(recording, channel), getattr(recording, f"{channel}_unit")
        rounding, covariance = (getattr(means, f"{channel}_{what}") for what in ("rounding", "covariance"))
        if signal is None or rounding is None or covariance is None or not np.any(rounding):
            continue
        share = np.median(rounding / np.diagonal(covariance, axis1=1, axis2=2), axis=0)
        step, pulses = step_at_rests(signal, rests), carries_remainder(signal, rests)
        if np.any(pulses & (step > 0.0)):
            estimate.say(
                "remark",
                f"The {name}'s output are pulses of {float(np.max(step[pulses])):.2g} {unit}: what is left of a step "
                "is in the next sample, so that means lose nothing.",
            )
        elif np.max(share) > DECIDES:
            estimate.say(
                "remark",
                f"The {name}'s output goes in steps of {float(np.max(step)):.2g} {unit}, coarser than its noise: a "
                "mean at rest is off by up to half a step, however long the hold. It is in the uncertainties. A "
                "smaller measuring range, a wider filter or more decimals in the file make it less.",
            )


def state_unseen_clock(clock: Clock, estimate: Estimate, at_rest: Vector | None = None) -> None:
    """Put the clock into an estimate whose gyro scale factors all come from turns.

    Parameters
    ----------
    clock : of all its recordings.
    estimate : of one or more recordings.
    at_rest : as for `add_common_scale`.
    """
    one = _unseen_clock(clock)
    add_common_scale(estimate, one.sigma, at_rest)
    if one.sigma > 0.0:
        _say(estimate, one, _scale_slope(estimate) * one.sigma)


def rest_rate(estimate: Estimate, means: HoldMeans) -> Vector:
    """Return (3,) raw, what the gyros show at rest beyond their bias on average: the Earth's rotation.

    Parameters
    ----------
    estimate, means : of one recording.
    """
    rates, gyro = means.angular_rate, estimate.model.gyroscope
    if rates is None or gyro is None or not len(rates):
        return np.zeros(3)
    seen = rates - gyro.bias
    force, sensitivity = means.specific_force, estimate.model.g_sensitivity
    if force is not None and sensitivity is not None and estimate.model.accelerometer is not None:
        seen = seen - estimate.model.accelerometer.correct(force) @ sensitivity.T
    return np.asarray(seen.mean(axis=0), dtype=np.float64)


def add_common_scale(estimate: Estimate, sigma: float, at_rest: Vector | None = None) -> None:
    """Let all gyro scale factors be wrong by one share besides: a rank of its own in both covariances.

    Parameters
    ----------
    estimate : changed.
    sigma : standard uncertainty of that share.
    at_rest : (3,) raw, of the Earth's rotation in what gyros show at rest, on average; None for none of it.
    """
    gyro, places = estimate.model.gyroscope, places_of(tuple(estimate.names))
    columns, i, j = places["gyroscope.matrix"]
    if gyro is None or sigma <= 0.0 or not columns.size:
        return
    slope = np.zeros(len(estimate.names))
    off = np.zeros(3) if at_rest is None else at_rest
    slope[columns] = gyro.matrix[i, j]
    columns, i, _ = places["gyroscope.bias"]
    slope[columns] = -off[i]
    estimate.covariance = estimate.covariance + sigma**2 * np.outer(slope, slope)
    _add_to_parameters(estimate, sigma * _scale_slope(estimate, off))


def _add_to_parameters(estimate: Estimate, added: Series) -> None:
    before = np.array([p.standard_uncertainty for p in estimate.parameters])
    spread = estimate.correlations * np.outer(before, before) + np.outer(added, added)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    estimate.parameters = [
        replace(p, standard_uncertainty=float(sigma))
        for p, sigma in zip(estimate.parameters, sigmas, strict=True)
    ]
    estimate.correlations = correlation_matrix(spread)
    budget = estimate.shown(Budget)
    if budget is not None and budget.shares:
        grown = np.divide(sigmas, before, out=np.ones(sigmas.size), where=before > 0.0)
        estimate.show(_with_source(budget, np.abs(added), grown))


def _with_source(budget: Budget, share: Series, grown: Series) -> Budget:
    """Return a budget with what the clock adds, which is known as well as it is stated (Welch and Satterthwaite)."""
    shares, told = {**budget.shares, SAMPLE_RATE: share}, budget.statement
    if told is None:
        return replace(budget, shares=shares)
    degrees = told.effective_degrees * grown**4
    statement = replace(
        told,
        effective_degrees=degrees,
        coverage_factors=coverage_factors(degrees),
        source_degrees={**told.source_degrees, SAMPLE_RATE: float("inf")},
    )
    return replace(budget, shares=shares, statement=statement)


def _scale_slope(estimate: Estimate, at_rest: Vector | None = None, triad: str = "gyro") -> Series:
    """Return (parameters,) by how much each moves per share of all scale factors of a triad, in its own unit."""
    slope, scale = np.zeros(len(estimate.parameters)), f"{triad} scale factor"
    for at, parameter in enumerate(estimate.parameters):
        if parameter.name.startswith(scale):
            slope[at] = parameter.value + (1.0 if parameter.name.startswith(f"{scale} error") else 0.0)
        elif at_rest is not None and parameter.name in _BIASES:
            slope[at] = -at_rest[_BIASES.index(parameter.name)]
    return slope


_BIASES = [f"gyro bias {axis}" for axis in "xyz"]


def _say(estimate: Estimate, one: Unseen, share: Series) -> None:
    """Say what a triad's scale factors stand or fall with: first of all where it decides what they are worth."""
    triad = "accelerometer" if one.source == GRAVITY else "gyro"
    at = [k for k, p in enumerate(estimate.parameters) if p.name.startswith(f"{triad} scale factor")]
    sigmas = np.array([estimate.parameters[k].standard_uncertainty for k in at])
    part = float(np.max(np.abs(share[at]) / np.maximum(sigmas, 1e-300), initial=0.0))
    if part < COUNTS:
        return
    size = f"{100.0 * one.sigma:.2g} %" if one.sigma >= 1e-3 else f"{1e6 * one.sigma:.3g} ppm"
    said = f"All {triad} scale factors share {_WHOSE[one.source]} uncertainty, {size} (one sigma), "
    said += f"which no residual shows: {one.because}"
    if part > DECIDES and one.mend:
        estimate.say("caution", f"{said}. If you know it better, {one.mend}.")
    else:
        estimate.say("remark", f"{said}.")
    estimate.unseen.append(one)
