"""Rests that are none: physics' last word on what looks like a hold, for it creeps, or like none, for its level."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector, Vectors, median
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.activity import Activity, change_sizes_of, find_activity
from tumble.segmentation.blocks import Blocks, TriadBlocks, cut_blocks, find_runs
from tumble.segmentation.rounding import step_at_rests
from tumble.segmentation.stretches import Stretch
from tumble.segmentation.timeline import Timeline

LARGEST_CREEP = np.radians(1.0)
# What a part of a creeping rest may creep at most to be kept in its place.
LARGEST_CREEP_OF_PART = np.radians(0.5)
# Sigmas by which a hold's mean rate must leave that of the other holds to be called a turning.
RATE_SIGMAS = 8.0
# rad/s that a g-sensitivity may move a gyro by at rest: four times a consumer unit's 0.3 °/s per g.
LARGEST_SENSITIVITY = float(np.radians(1.2))
# Two rates are one if they differ by less than this share of either; gravity then stands along one line, to this.
SAME_RATE, SAME_LINE = 0.25, float(np.radians(30.0))
# Of the line through the rests' rates over their poses, in rests: some pull towards no g-sensitivity.
RIDGE = 0.02


SHORTEST = 1.0  # s; what is shorter is a moment of a turn

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


def _find_creep(blocks: Blocks, activity: Activity, start: float, stop: float) -> tuple[float, float]:
    """Return the angle by which the specific force moves from end to end, and its uncertainty, rad.

    It is 3/2 of the change from the first third's median to the last third's, exact for a creep at a
    constant rate. A creep about the vertical does not move the specific force. Zero without an
    accelerometer.
    """
    if blocks.specific_force is None or activity.gravity is None:
        return 0.0, 0.0
    first = int(np.ceil(start))
    values = blocks.specific_force.smooth[first : max(int(stop), first + 3)]
    third = max(len(values) // 3, 1)
    moved = median(values[-third:]) - median(values[:third])
    # from differences over the smoothing's reach, into which the creep itself hardly enters
    step = values[blocks.half_width :] - values[: -blocks.half_width]
    scatter = 1.05 * median(np.abs(step)) if len(step) > 3 else np.zeros(3)
    # a median is 1.25 times as uncertain as a mean; smoothed blocks are correlated over some four
    sigma = 1.5 * 1.25 * float(np.linalg.norm(scatter)) * np.sqrt(2.0 * 4.3 / max(third, 4.3))
    return 1.5 * float(np.linalg.norm(moved)) / activity.gravity, sigma / activity.gravity


def keep_still_part(blocks: Blocks, activity: Activity, stretch: Stretch) -> tuple[Stretch, float]:
    """Return the stretch, or the longest still part of at least half of it, and the creep that is left.

    Parameters
    ----------
    blocks, activity : of the whole recording.
    stretch : a rest.
    """
    creep, sigma = _find_creep(blocks, activity, stretch.start, stretch.stop)
    if creep <= LARGEST_CREEP + 3.0 * sigma:
        return stretch, 0.0
    eighth = (stretch.stop - stretch.start) / 8.0
    for parts in (7, 6, 5, 4):
        for skipped in range(9 - parts):
            start = stretch.start + skipped * eighth
            stop = start + parts * eighth
            part, sigma = _find_creep(blocks, activity, start, stop)
            if part <= LARGEST_CREEP_OF_PART + 2.0 * sigma:
                stretch.start, stretch.stop = start, stop
                stretch.excluded = [(a, b) for a, b in stretch.excluded if b > start and a < stop]
                return stretch, 0.0
    return stretch, creep


def find_turning(blocks: Blocks, activity: Activity, stretches: list[Stretch]) -> np.ndarray:
    """Return the angle by which each rest turns against the gyro's usual output at rest, (rests,) rad.

    It sees a creep about the vertical, which the specific force does not. An angle is given only
    where the mean rate stands out from the other rests by eight of their robust standard deviations
    (bias drift, g-sensitivity and Earth rate included, since all of them spread it), and where no other rest shows the
    same in another pose; else zero.

    Parameters
    ----------
    blocks, activity : of the whole recording.
    stretches : all rests that are long enough for a hold.
    """
    angles = np.zeros(len(stretches))
    rates = [s.rate for s in stretches if s.rate is not None]
    if len(rates) < 8 or len(rates) != len(stretches) or activity.rate_scale is None:
        return angles
    table = np.array(rates)
    signed = table - _expected(table, stretches, activity.rate_scale)
    away = np.abs(signed)
    usual = 1.4826 * np.median(away, axis=0)
    own = np.array([s.rate_scatter for s in stretches if s.rate_scatter is not None])
    lengths = np.array([s.stop - s.start for s in stretches])
    noise = own * np.sqrt(6.0 / np.maximum(lengths, 6.0))[:, None]
    stands_out = np.any(away > RATE_SIGMAS * np.hypot(usual, noise), axis=1)
    turned = np.linalg.norm(away, axis=1) * activity.rate_scale * lengths * blocks.seconds
    forces = [s.force for s in stretches if s.force is not None]
    if activity.force_bias is not None and len(forces) == len(stretches):
        odd = np.flatnonzero(stands_out)
        stands_out[odd] = ~in_other_poses_too(signed[odd], np.array(forces)[odd] - activity.force_bias)
    return np.where(stands_out, turned, 0.0)


def in_other_poses_too(rates: Vectors, up: Vectors) -> np.ndarray:
    """Return (rests,) which show the rate of another one in which gravity stands along another line.

    Gravity stands still in a unit that turns at a constant rate only if it turns about the vertical, as on a table.
    Then the rate that the gyros show goes with gravity, whatever their scale factors and axes are. The same rate in two
    poses whose verticals are not one line is no rate, but a level: biases that jumped, or another unit.

    Parameters
    ----------
    rates : (rests, 3) raw, beyond what the gyros show at rest.
    up : (rests, 3) raw, specific force without bias.
    """
    sizes = np.linalg.norm(rates, axis=1)
    apart = np.linalg.norm(rates[:, None] - rates[None], axis=2)
    lines = up / np.linalg.norm(up, axis=1, keepdims=True)
    other_line = np.abs(lines @ lines.T) < np.cos(SAME_LINE)
    return np.any((apart < SAME_RATE * np.minimum(sizes[:, None], sizes)) & other_line, axis=1)


def _expected(table: Vectors, stretches: list[Stretch], rate_scale: float) -> Vectors:
    """What the other rests let a rest's rate expect: the median, or what their poses make of a g-sensitivity.

    A consumer gyro shows half a degree a second more with another face up, which is no creep. Each rest is held
    against a line through all others, and against their median: the nearer counts.
    """
    middle = np.broadcast_to(np.median(table, axis=0), table.shape)
    forces = [s.force for s in stretches if s.force is not None]
    if len(forces) != len(stretches):
        return middle
    force = np.array(forces) / np.median(np.linalg.norm(forces, axis=1))
    design = np.column_stack([np.ones(len(force)), force])
    # A ridge that keeps a pose of its own kind from being explained by itself alone.
    ridge = np.diag([0.0, *[RIDGE] * 3])
    # those that stand out themselves would bend the line
    near = np.linalg.norm(table - middle, axis=1) * rate_scale < LARGEST_SENSITIVITY
    own = design[:, :, None] * np.hstack([design, table])[:, None]
    straight = near[:, None, None] * own
    enough = np.count_nonzero(near) - near >= 6
    left, all_left = np.sum(straight, axis=0) - straight, np.sum(own, axis=0) - own
    others = np.asarray(np.where(enough[:, None, None], left, all_left), dtype=np.float64)
    line: Vectors = (design[:, None] @ np.linalg.solve(others[:, :, :4] + ridge, others[:, :, 4:]))[:, 0]
    plausible = np.linalg.norm(line - middle, axis=1) * rate_scale < LARGEST_SENSITIVITY
    nearer = np.linalg.norm(table - line, axis=1) < np.linalg.norm(table - middle, axis=1)
    return np.where(np.repeat(plausible & nearer, 3).reshape(-1, 3), line, middle)


@dataclass(frozen=True)
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
