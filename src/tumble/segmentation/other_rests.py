"""Rests that were taken for motion, because the gyros show another level in them than in the holds."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector, median
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.activity import change_sizes_of, find_activity
from tumble.segmentation.blocks import Blocks, TriadBlocks, cut_blocks, find_runs
from tumble.segmentation.creep import in_other_poses_too
from tumble.segmentation.rounding import step_at_rests
from tumble.segmentation.timeline import Timeline

SHORTEST = 1.0
"""s; what is shorter is a moment of a turn."""

# Four conditions have to come together, for which there is no common statistic. Of 1,400 right recordings by hand and
# in many poses (other hand's simulator, six grades and random ones with coarse steps, twelve poses) none had such a
# rest: fewer than 0.22 % have one, at 95 % confidence.
# As steady as all but one in a hundred blocks of the holds, twice over: a hand is not always as steady.
USUAL, LEEWAY = 0.99, 2.0
# A level differs from that of every hold by so many of their robust standard deviations, or by this share of the limit
# between rest and motion.
LEVEL_SIGMAS, OTHER_LEVEL = 8.0, 0.25
# Over a stretch gravity stays within so much, as in a hold.
STILL = float(np.radians(0.5))


@dataclass(frozen=True, slots=True)
class OtherRests:
    """Stretches in which gravity stands still while the gyros show one rate, in poses in which no axis can be one.

    Attributes
    ----------
    spans : (start, stop) samples of each.
    rate : rad/s, roughly, by which the gyros' level is off the holds'.
    """

    spans: list[tuple[int, int]]
    rate: float


def find_other_rests(recording: Recording, timeline: Timeline) -> OtherRests | None:
    """Return the rests that are no holds, for the gyros' level in them is that of no hold; None without any.

    Fewer than 0.22 % of right recordings have one (none of 1,400 simulated by another hand).

    Parameters
    ----------
    recording, timeline : raw samples, and the holds that were found in them.
    """
    blocks = cut_blocks(recording)
    force, rate = blocks.specific_force, blocks.angular_rate
    inside = _inside_holds(blocks, timeline)
    if force is None or rate is None or not inside.any():
        return None
    steady = ~inside & _steady(blocks, force, inside) & _steady(blocks, rate, inside)
    runs = [(a, b) for a, b in find_runs(steady) if (b - a) * blocks.seconds >= SHORTEST]
    if not runs:
        return None
    activity = find_activity(blocks)
    assert activity.rate_scale is not None
    assert activity.gravity is not None
    assert activity.force_bias is not None
    levels = np.array([median(rate.smooth[a:b]) for a, b in find_runs(inside)])
    scatter = 1.4826 * float(np.linalg.norm(median(np.abs(levels - median(levels)))))
    assert recording.angular_rate is not None
    # Levels of a gyro whose steps are coarser than its noise agree to the last digit, or differ by a step.
    step = step_at_rests(recording.angular_rate, [hold.stretches() for hold in timeline.holds])
    scatter = max(scatter, float(np.linalg.norm(step)) / np.sqrt(12.0))
    least = min(LEVEL_SIGMAS * scatter, OTHER_LEVEL * activity.threshold / activity.rate_scale)
    spans: list[tuple[int, int]] = []
    rates: list[Vector] = []
    poses: list[Vector] = []
    for first, last in runs:
        away, third = median(rate.smooth[first:last]) - levels, (last - first) // 3
        nearest = away[np.argmin(np.linalg.norm(away, axis=1))]
        moved = median(force.smooth[last - third : last]) - median(force.smooth[first : first + third])
        if np.linalg.norm(nearest) > least and np.linalg.norm(moved) < STILL * activity.gravity:
            spans.append((first * blocks.size, last * blocks.size))
            rates.append(nearest)
            poses.append(median(force.smooth[first:last]) - activity.force_bias)
    other = (
        np.flatnonzero(in_other_poses_too(np.array(rates), np.array(poses)))
        if spans
        else np.zeros(0, dtype=int)
    )
    if not other.size:
        return None
    sizes = np.linalg.norm(np.array(rates)[other], axis=1)
    return OtherRests([spans[k] for k in other], activity.rate_scale * float(np.median(sizes)))


def _inside_holds(blocks: Blocks, timeline: Timeline) -> np.ndarray:
    """Which blocks lie in a hold as a whole."""
    inside = np.zeros(len(blocks), dtype=bool)
    for hold in timeline.holds:
        first = -(-hold.start // blocks.size)
        inside[first : max(hold.stop // blocks.size, first + 1)] = True
    return inside


def _steady(blocks: Blocks, triad: TriadBlocks, inside: np.ndarray) -> np.ndarray:
    """Which blocks change as little as those of holds."""
    change = change_sizes_of(triad, blocks.half_width)
    return change <= LEEWAY * float(np.quantile(change[inside], USUAL))
