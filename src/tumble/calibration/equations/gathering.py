"""Gathering what holds and turns offer into the arrays that the adjustment works on."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Vector, Vectors, inverted
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import force_matrix
from tumble.errors import ObservabilityError
from tumble.estimation import Unknowns
from tumble.recording import Recording, stamp_jitter
from tumble.segmentation import (
    Hold,
    HoldMeans,
    Timeline,
    integral_variance,
    mean_covariance,
    rounding_of_each,
    step_at_rests,
)

# A turn joins a hold over its last or first two seconds: long enough to average the accelerometer's
# noise below the gyro's, short enough that a creeping pose does not matter.
EDGE_WINDOW = 2.0
# Shares of the largest sample below which a sample is not believed, noise or none, and a mean along gravity: it
# tells so much of accelerometers that what terms show beside it drowns in round-off.
SAMPLE_DIGITS, MEAN_DIGITS = 1e-7, 3e-7
# s, of the pieces of rests of which a spectrum is taken. Its octaves from the third line on, 1 to 5 Hz, lie above a
# hand's sway and below its tremor, and below the corner of a filter, past which a sensor's own noise is missing.
PIECE, OCTAVES = 2.6, (3, 6)

Rests = list[list[tuple[int, int]]]


def gather(
    recording: Recording, timeline: Timeline, means: HoldMeans, by_hand: Unknowns | None = None
) -> HoldsAndTurns:
    """Return holds and turns of a recording with both triads.

    Parameters
    ----------
    recording, timeline, means : what was recorded.
    by_hand : what is believed of sensors that a hand turned: that it trembles and sways is taken out of the noise.

    Raises
    ------
    ObservabilityError
        If the recording lacks a triad.
    """
    force, rate = recording.specific_force, recording.angular_rate
    spread, rate_spread = means.specific_force_covariance, means.angular_rate_covariance
    if force is None or rate is None or spread is None or rate_spread is None:
        raise ObservabilityError("Turns need both triads.")
    assert means.specific_force is not None
    assert means.angular_rate is not None
    head, tail = _edge_windows(timeline.holds, means, recording.rate)
    turn_start, turn_stop = _turn_ranges(timeline, head, tail)
    rests = [hold.stretches() for hold in timeline.holds]
    rounding = means.specific_force_rounding, means.angular_rate_rounding
    left, rate_left = (np.zeros((len(means), 3)) if one is None else one for one in rounding)
    force_sigma = _least(timeline.noise_floor.specific_force, force, rests)
    rate_sigma, seen = _least(timeline.noise_floor.angular_rate, rate, rests), rate_spread
    if by_hand is not None:
        rate_sigma = _least(_quiet(rate_sigma, rate, rests, recording.rate), rate, rests)
        spread = _along_gravity(force, means.specific_force, spread, left, rests, by_hand)
        rate_spread = _by_white_noise(rate_spread, rate_left, rate_sigma, means.count[:, None])
    return HoldsAndTurns(
        time=recording.time,
        raw_force=force,
        raw_rate=rate,
        force_mean=means.specific_force,
        force_covariance=spread,
        rate_mean=means.angular_rate,
        rate_covariance=rate_spread,
        hold_samples=means.count,
        head=head,
        tail=tail,
        turn_start=turn_start,
        turn_stop=turn_stop,
        force_sample_variance=force_sigma**2,
        rate_random_walk=rate_sigma**2 / recording.rate,
        force_floor=_floor(spread, force_sigma, means, left),
        rate_floor=_floor(seen, rate_sigma, means, rate_left),
        turn_sampling=_sampling(recording, rate, means.angular_rate, rests, (turn_start, turn_stop)),
        rate_rounding=means.angular_rate_rounding,
        parts=means.parts,
    )


def _by_white_noise(whole: Matrices, left: Vectors, sigma: Vector, count: np.ndarray) -> Matrices:
    """Covariances (holds, 3, 3) of gyros' means: what is beyond white noise may be a hand's that sways.

    Over a hold next to nothing of a sway is left, and how biases wander from hold to hold the residuals say.
    """
    variance = count * (np.diagonal(whole, axis1=1, axis2=2) - left)
    # A hold that scatters far more than the others was bumped, and does not end where it began.
    bumped = np.maximum(variance - 2.0 * np.median(variance, axis=0), 0.0)
    return ((sigma**2 + bumped) / count + left)[:, :, None] * np.eye(3)


def _along_gravity(
    signal: Vectors, mean: Vectors, whole: Matrices, left: Vectors, rests: Rests, u: Unknowns
) -> Matrices:
    """Covariances (holds, 3, 3) of accelerometers' means, as what is seen along gravity scatters within holds.

    A pose that sways moves what is seen across gravity, and the adjustment knows how each pose sways. What rounding
    leaves stays.
    """
    inverse, along = inverted(force_matrix(u)), np.zeros_like(signal)
    up, rounding = (mean - u["force.bias"]) @ inverse.T @ inverse, left[:, :, None] * np.eye(3)
    for own, (a, b) in [(own, piece) for own, rest in zip(up, rests, strict=True) for piece in rest]:
        along[a:b] = (signal[a:b] @ own)[:, None]
    digits = np.full_like(mean, (MEAN_DIGITS * along.max()) ** 2)
    seen = mean_covariance(along, rests, rounding=digits).covariance[:, 0, 0]
    usual = np.einsum("ni,nii->n", up**2, whole - rounding)
    return rounding + min(float(np.median(seen / np.maximum(usual, 1e-300))), 1.0) * (whole - rounding)


def _quiet(sigma: Vector, signal: Vectors, rests: Rests, rate: float) -> Vector:
    """Return a sample's sigma by the quieter octave of the spectrum at rest between a hand's sway and its tremor."""
    pieces = [piece for rest in rests for piece in rest]
    size = 2 ** int(np.log2(np.clip(np.median(np.diff(pieces)), 1.0, max(PIECE * rate, 1.0))))
    window, starts = np.hanning(size)[:, None], [k for a, b in pieces for k in range(a, b - size + 1, size)]
    power = np.zeros((size // 2 + 1, 3))
    for k in starts:
        cut = signal[k : k + size]
        power += np.abs(np.fft.rfft(window * (cut - cut.mean(axis=0)), axis=0)) ** 2
    power /= max(len(starts), 1) * max(float(np.sum(window**2)), 1e-300)
    octaves = [power[k : 2 * k].mean(axis=0) for k in OCTAVES if 8 * k <= size + 8]
    own = np.maximum(sigma, 1e-150) ** 2
    least = min(octaves, key=lambda one: float(np.sum(one / own)), default=own)
    return np.sqrt(np.where(least > 0.0, least, own))


def _least(sigma: Vector, signal: Vectors, rests: Rests) -> Vector:
    """Return a sample's sigma, or what rounding and its digits leave uncertain where there is no noise at all."""
    digits = SAMPLE_DIGITS * max(float(signal.max()), -float(signal.min()))
    return np.maximum(sigma, np.maximum(step_at_rests(signal, rests) / np.sqrt(12.0), digits))


def _sampling(
    recording: Recording, rate: Vectors, mean: Vectors, rests: Rests, turns: tuple[np.ndarray, np.ndarray]
) -> Vectors:
    """Return (holds, 3) raw² s², variance of turns' integrals by stamps that jitter, and by values that are rounded."""
    left = rounding_of_each(rate, rests, mean).mean(axis=0) / recording.rate**2
    return integral_variance(rate, np.column_stack(turns), left, stamp_jitter(recording.time))


def _floor(covariance: Matrices, sigma: Vector, means: HoldMeans, left: Vectors) -> Vector:
    """Return the variance of a hold's mean beyond white noise and rounding, the median over the holds."""
    variance = np.diagonal(covariance, axis1=1, axis2=2) - left
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
