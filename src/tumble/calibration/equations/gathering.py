"""Gathering what holds and turns offer into the arrays that the adjustment works on."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Vector, Vectors
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.errors import ObservabilityError
from tumble.recording.clock import stamp_jitter
from tumble.recording.recording import Recording
from tumble.segmentation import Hold, HoldMeans, NoiseFloor, Timeline
from tumble.segmentation.rounding import integral_variance, rounding_of_each, step_at_rests

# A turn joins a hold over its last or first two seconds: long enough to average the accelerometer's
# noise below the gyro's, short enough that a creeping pose does not matter.
EDGE_WINDOW = 2.0
# Share of the largest sample below which a sample is not believed, noise or none.
SAMPLE_DIGITS = 1e-7
# Chance that means at rest differ by less than right variances allow, on one axis.
SCATTER_CHANCE = 1e-3


def gather(recording: Recording, timeline: Timeline, means: HoldMeans) -> HoldsAndTurns:
    """Return holds and turns of a recording with both triads.

    Raises
    ------
    ObservabilityError
        If the recording lacks a triad.
    """
    if recording.specific_force is None or recording.angular_rate is None:
        missing = "accelerometer" if recording.specific_force is None else "gyro"
        raise ObservabilityError(f"The recording has no {missing}: turns need both triads.")
    if (
        means.specific_force is None
        or means.specific_force_covariance is None
        or means.angular_rate is None
        or means.angular_rate_covariance is None
    ):
        raise ObservabilityError("The holds' means lack a triad.")
    head, tail = _edge_windows(timeline.holds, means, recording.rate)
    turn_start, turn_stop = _turn_ranges(timeline, head, tail)
    rests = [hold.stretches() for hold in timeline.holds]
    floor = NoiseFloor(
        _least(timeline.noise_floor.specific_force, recording.specific_force, rests),
        _least(timeline.noise_floor.angular_rate, recording.angular_rate, rests),
        timeline.noise_floor.threshold,
        timeline.noise_floor.statistic,
    )
    rate_covariance = _within_scatter(means, floor.angular_rate)
    return HoldsAndTurns(
        time=recording.time,
        raw_force=recording.specific_force,
        raw_rate=recording.angular_rate,
        force_mean=means.specific_force,
        force_covariance=means.specific_force_covariance,
        rate_mean=means.angular_rate,
        rate_covariance=rate_covariance,
        hold_samples=means.count,
        head=head,
        tail=tail,
        turn_start=turn_start,
        turn_stop=turn_stop,
        force_sample_variance=floor.specific_force**2,
        rate_random_walk=floor.angular_rate**2 / recording.rate,
        force_floor=_floor(
            means.specific_force_covariance, floor.specific_force, means, means.specific_force_rounding
        ),
        rate_floor=_floor(rate_covariance, floor.angular_rate, means, means.angular_rate_rounding),
        turn_sampling=_sampling(recording, means, rests, np.column_stack([turn_start, turn_stop])),
        rate_rounding=means.angular_rate_rounding,
        parts=means.parts,
    )


def _within_scatter(means: HoldMeans, sigma: Vector) -> Matrices:
    """Covariances (holds, 3, 3) of gyros' means at rest, no larger than these differ by; see `SCATTER_CHANCE`.

    A hand that trembles turns to and fro: over a hold next to nothing of it is left, far less than its parts suggest.
    """
    from scipy.special import chdtri

    mean, covariance = means.angular_rate, means.angular_rate_covariance
    assert mean is not None
    assert covariance is not None
    freedom = len(mean) - 1
    if freedom < 1:
        return covariance
    scatter = np.sum((mean - mean.mean(axis=0)) ** 2, axis=0) / float(chdtri(freedom, 1.0 - SCATTER_CHANCE))
    rounding = (
        np.zeros(3) if means.angular_rate_rounding is None else means.angular_rate_rounding.mean(axis=0)
    )
    largest = np.maximum(scatter, sigma**2 / float(np.median(means.count))) + rounding
    usual = np.median(np.diagonal(covariance, axis1=1, axis2=2), axis=0)
    share = np.sqrt(np.minimum(largest / np.maximum(usual, 1e-300), 1.0))
    return share[:, None] * covariance * share


def _least(sigma: Vector, signal: Vectors, rests: list[list[tuple[int, int]]]) -> Vector:
    """Return a sample's sigma, or what rounding and its digits leave uncertain where there is no noise at all."""
    digits = SAMPLE_DIGITS * max(float(signal.max()), -float(signal.min()))
    return np.maximum(sigma, np.maximum(step_at_rests(signal, rests) / np.sqrt(12.0), digits))


def _sampling(
    recording: Recording, means: HoldMeans, rests: list[list[tuple[int, int]]], turns: np.ndarray
) -> Vectors:
    """Return (holds, 3) raw² s², variance of turns' integrals by stamps that jitter, and by values that are rounded."""
    rate = recording.angular_rate
    assert rate is not None
    assert means.angular_rate is not None
    left = rounding_of_each(rate, rests, means.angular_rate).mean(axis=0) / recording.rate**2
    return integral_variance(rate, turns, left, stamp_jitter(recording.time))


def _floor(covariance: Matrices, sigma: Vector, means: HoldMeans, rounding: Vectors | None) -> Vector:
    """Return the variance of a hold's mean beyond white noise and rounding, the median over the holds."""
    variance = np.diagonal(covariance, axis1=1, axis2=2) - (0.0 if rounding is None else rounding)
    white = sigma**2 / means.count[:, None]
    return np.median(np.maximum(variance - white, 0.0), axis=0)


def _edge_windows(holds: tuple[Hold, ...], means: HoldMeans, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (holds, 2) sample ranges at each hold's start and end that do not overlap."""
    head, tail = np.zeros((len(holds), 2), dtype=int), np.zeros((len(holds), 2), dtype=int)
    for k, hold in enumerate(holds):
        samples = max(1, round(min(EDGE_WINDOW, 0.5 * float(means.duration[k])) * rate))
        # A knock near the edge leaves a stub there: the window goes to the first stretch of some length.
        enough = min(samples, 0.3 * float(means.count[k]))
        stretches = [s for s in hold.stretches() if s[1] - s[0] >= enough] or hold.stretches()
        first, last = stretches[0], stretches[-1]
        head[k] = first[0], min(first[1], first[0] + samples)
        tail[k] = max(last[0], last[1] - samples), last[1]
    return head, tail


def _turn_ranges(timeline: Timeline, head: np.ndarray, tail: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    start, stop = -np.ones(len(timeline.holds), dtype=int), -np.ones(len(timeline.holds), dtype=int)
    for turn in timeline.turns:
        if turn.usable and turn.after == turn.before + 1:
            first, last = tail[turn.before, 1] - 1, head[turn.after, 0] + 1
            # Holds of a user's list may touch: then there is no turn between them.
            if last - first >= 2:
                start[turn.before], stop[turn.before] = first, last
    return start, stop
