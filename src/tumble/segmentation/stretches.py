"""Stretches of rest while the search shapes them into holds."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Vector, Vectors, median
from tumble.records import dataclass
from tumble.segmentation.activity import Activity
from tumble.segmentation.blocks import SMOOTHING_SECONDS, Blocks, TriadBlocks, find_runs

# Standard deviations within which a rest has settled: 5.09 is the chi-square quantile of three axes at
# 1e-5, and a scatter from some twenty blocks is known to 15 %.
SETTLED = 6.0
# A rougher block than this many times the hold's median (in variance) is a knock; the amplitude of
# hand tremor changes by a factor of three at most.
KNOCK = 25.0
SAME_POSE = float(np.radians(0.3))
LARGEST_NET_TURN = float(np.radians(1.0))
LONGEST_KNOCK_SECONDS = 3.0
# Share of the limit between rest and motion below which scatter is not looked at.
NO_MOTION = 1e-6
# How far beyond the threshold an end may lie: smoothing and the differences over it blur by 0.3 s.
OUTWARD_SECONDS = 0.6
# A knock just before a turn is the hand that grasps the unit: a piece of rest this short beyond it is
# given up with it, unless that would cost more than the second figure.
SHORTEST_PIECE_SECONDS = 0.5
LARGEST_LOSS_SECONDS = 0.8


@dataclass
class Stretch:
    """Blocks `first` up to `last` at rest; `start` and `stop` are the refined ends in blocks."""

    first: int
    last: int
    start: float
    stop: float
    rate: Vector | None
    rate_scatter: Vector | None
    force: Vector | None
    force_scatter: Vector | None
    excluded: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    @property
    def length(self) -> float:
        """Blocks at rest, without those excluded."""
        return self.stop - self.start - sum(b - a for a, b in self.excluded)


def _level(smooth: Vectors, first: int, last: int, margin: int) -> tuple[Vector, Vector]:
    """Median and robust standard deviation per axis between two blocks, without a margin at the ends."""
    if last - first > 3 * margin:
        first, last = first + margin, last - margin
    values = smooth[first:last]
    middle = median(values)
    return middle, 1.4826 * median(np.abs(values - middle))


def usual_scatter(blocks: Blocks, runs: list[tuple[int, int]]) -> Vector:
    """Return the median of the rests' scatter per axis, or that by rounding: what no rest is thought quieter than.

    The scatter of a short rest is known to a quarter only; too small a one would move its ends. Of coarse steps most
    blocks show one number, and the scatter is none.

    Parameters
    ----------
    blocks : of the whole recording.
    runs : the rests.
    """
    triad = blocks.angular_rate or blocks.specific_force
    if triad is None or not runs:
        return np.zeros(3)
    scatters = [_level(triad.smooth, first, last, blocks.half_width)[1] for first, last in runs]
    lengths = np.array([last - first for first, last in runs])
    # moments of a turn that look like rest are short and many: the longer half decides
    kept = np.array(scatters)[lengths >= np.median(lengths)]
    smoothed = max(SMOOTHING_SECONDS / blocks.seconds, 1.0) * blocks.size
    return np.maximum(median(kept), _least_steps(blocks, triad) / np.sqrt(12.0 * smoothed))


def shape_stretch(
    blocks: Blocks,
    first: int,
    last: int,
    *,
    lowest: int,
    highest: int,
    bounded: tuple[bool, bool],
    floor: Vector,
    farthest: float,
) -> Stretch:
    """Describe the rest from block `first` up to `last` and find its ends.

    The limit at the ends is the stretch's own: six robust standard deviations of its own smoothed
    signal about its own median, so neither bias, g-sensitivity nor Earth rate enter. A slow turn
    passes that limit late; because its rate begins as the square of time, the place where it is four
    times the limit shows how late.

    Parameters
    ----------
    blocks : of the whole recording.
    first, last : the activity is below the threshold between these blocks.
    lowest, highest : blocks that the ends may not pass: the neighbouring rests, a gap in the samples.
    bounded : whether motion bounds the rest on the left and on the right; else the recording does.
    floor : least scatter per axis of the gyro (of the accelerometer without one), raw units.
    farthest : raw units by which that triad may leave the stretch's level, whatever its scatter: a
        hand that settles is not yet at rest.
    """
    stretch = Stretch(first, last, float(first), float(last), None, None, None, None)
    margin = blocks.half_width
    if blocks.angular_rate is not None:
        stretch.rate, stretch.rate_scatter = _level(blocks.angular_rate.smooth, first, last, margin)
    if blocks.specific_force is not None:
        stretch.force, stretch.force_scatter = _level(blocks.specific_force.smooth, first, last, margin)
    reach = max(1, round(OUTWARD_SECONDS / blocks.seconds))
    lowest, highest = max(lowest, first - reach), min(highest, last + reach)
    distance = _distance(blocks, stretch, lowest, highest, floor, farthest)
    allowed = (last - first) // 2
    if bounded[0]:
        stretch.start = lowest + _settling(distance, first - lowest, allowed, margin)
    if bounded[1]:
        stretch.stop = highest - _settling(distance[::-1], highest - last, allowed, margin)
    return stretch


def _distance(
    blocks: Blocks, stretch: Stretch, first: int, last: int, floor: Vector, farthest: float
) -> Series:
    """Distance of each block from the stretch's own level, in its own standard deviations or more."""
    triad, middle, scatter = blocks.angular_rate, stretch.rate, stretch.rate_scatter
    if triad is None:
        triad, middle, scatter = blocks.specific_force, stretch.force, stretch.force_scatter
    if triad is None or middle is None or scatter is None:
        return np.zeros(last - first)
    values = triad.smooth[first:last] - middle
    scatter = np.maximum(scatter, floor)
    # a quantised axis may not move at all during a hold: the others stand in for it
    # without noise round-off must not decide: a millionth of the limit of motion is no motion
    least = max(float(np.sqrt(np.mean(scatter**2))), NO_MOTION * farthest)
    own = np.sqrt(np.sum((values / np.maximum(scatter, 0.5 * least)) ** 2, axis=1))
    return np.maximum(own, SETTLED / farthest * np.linalg.norm(values, axis=1))


def _settling(distance: Series, origin: int, allowed: int, needed: int) -> float:
    """Place of the end in blocks: where the distance last passes the limit on its way into the rest.

    Looked for inwards from `origin`, `allowed` blocks deep, until `needed` blocks in a row are within
    the limit, and from there outwards as long as they are.
    """
    limit = SETTLED
    while True:
        inside = distance < limit
        for k in range(origin, origin + max(allowed, 1)):
            if inside[k : k + needed].all():
                while k > 0 and inside[k - 1]:
                    k -= 1
                return float(k) if k == 0 else _beginning(distance, k, limit, 0.4 * allowed)
        limit *= 1.5
        if limit > 1e9:
            return float(origin)


def _beginning(distance: Series, k: int, limit: float, most: float) -> float:
    """Where the motion begins that passes the limit between blocks k - 1 and k, `most` blocks before."""
    near = _crossing(distance, k, limit)
    j = k - 1
    while j > 0 and distance[j] < 4.0 * limit:
        j -= 1
    far = _crossing(distance, j + 1, 4.0 * limit) if distance[j] >= 4.0 * limit else float(j)
    # rate = c t²: it is at the limit at t, at four times the limit at 2 t
    return near + min(max(near - far, 0.0), most)


def _crossing(distance: Series, k: int, limit: float) -> float:
    """Where the distance passes the limit between the centres of blocks k - 1 and k."""
    before, after = np.log(max(distance[k - 1], 1e-9)), np.log(max(distance[k], 1e-9))
    share = (np.log(limit) - after) / max(before - after, 1e-9)
    return k + 0.5 - float(np.clip(share, 0.0, 1.0))


def leave_out_knocks(blocks: Blocks, stretches: list[Stretch], activity: Activity) -> None:
    """Exclude the blocks inside stretches that are far rougher than the rest of each, and than coarse steps make them.

    Parameters
    ----------
    blocks, activity : of the whole recording.
    stretches : rests with their ends.
    """
    limit = NO_MOTION * activity.threshold
    scales = (activity.gravity or 1.0, 1.0 / (activity.rate_scale or 1.0))
    triads = [
        (triad, (limit * scale) ** 2, 0.5 * float(np.sum(_least_steps(blocks, triad) ** 2)))
        for triad, scale in zip((blocks.specific_force, blocks.angular_rate), scales, strict=True)
        if triad is not None
    ]
    for stretch in stretches:
        first, last = int(np.ceil(stretch.start)), int(stretch.stop)
        rough = np.zeros(max(last - first, 0), dtype=bool)
        for triad, nothing, steps in triads if rough.size else []:
            total = triad.roughness[first:last].sum(axis=1, dtype=float)
            usual = max(float(np.sort(total)[total.size // 2]), nothing)
            # Each sample another number than the last by one step is noise that other blocks do not show.
            rough |= total > max(KNOCK * usual, steps)
        spread = rough.copy()
        spread[1:] |= rough[:-1]
        spread[:-1] |= rough[1:]
        stretch.excluded = [(first + a, first + b) for a, b in find_runs(spread)]


def _least_steps(blocks: Blocks, triad: TriadBlocks) -> Vector:
    """(3,) the least change from sample to sample of each axis, raw: of an output in steps, one step."""
    least = [np.min(axis, where=axis > 0.0, initial=np.inf) for axis in triad.roughness.T]
    changed = np.array(least, dtype=np.float64)
    return np.sqrt(2.0 * blocks.size * np.where(np.isfinite(changed), changed, 0.0))


def _pose_change(before: Stretch, after: Stretch, activity: Activity) -> tuple[float, float]:
    """Angle between the specific forces of two stretches and its standard uncertainty, rad.

    Zero with no accelerometer.
    """
    if before.force is None or after.force is None or activity.gravity is None:
        return 0.0, 0.0
    angle = float(np.linalg.norm(after.force - before.force)) / activity.gravity
    variance = 0.0
    for part in (before, after):
        if part.force_scatter is not None:
            # smoothed blocks are correlated over some four blocks
            variance += float(np.sum(part.force_scatter**2)) * 6.0 / max(part.last - part.first, 6)
    return angle, float(np.sqrt(variance)) / activity.gravity


def _net_turn(blocks: Blocks, before: Stretch, after: Stretch, activity: Activity) -> float:
    """Sum of the rate between two stretches without their mean bias, rad; zero without a gyro."""
    if (
        blocks.angular_rate is None
        or activity.rate_scale is None
        or before.rate is None
        or after.rate is None
    ):
        return 0.0
    a, b = before.last - 1, after.first + 1
    values = blocks.angular_rate.smooth[a:b] - 0.5 * (before.rate + after.rate)
    return float(np.linalg.norm(values.sum(axis=0))) * blocks.seconds * (activity.rate_scale or 0.0)


def join_stretches(
    blocks: Blocks, activity: Activity, stretches: list[Stretch], walls: np.ndarray
) -> list[Stretch]:
    """Join neighbours that have the same pose and no net turn between; what lies between is excluded.

    Parameters
    ----------
    stretches : in order.
    walls : blocks at which samples are missing; nothing is joined across them.
    """
    joined: list[Stretch] = []
    for stretch in stretches:
        if joined and _same_hold(blocks, activity, joined[-1], stretch, walls):
            joined[-1] = _merge(joined[-1], stretch)
        else:
            joined.append(stretch)
    return joined


def _same_hold(
    blocks: Blocks, activity: Activity, before: Stretch, after: Stretch, walls: np.ndarray
) -> bool:
    if (after.first - before.last) * blocks.seconds > LONGEST_KNOCK_SECONDS:
        return False
    if np.any((walls >= before.last) & (walls < after.first)):
        return False
    angle, sigma = _pose_change(before, after, activity)
    if angle > SAME_POSE + 4.0 * sigma:
        return False
    return _net_turn(blocks, before, after, activity) < LARGEST_NET_TURN


def _merge(before: Stretch, after: Stretch) -> Stretch:
    longer = before if before.length >= after.length else after
    hole = (int(np.floor(before.stop)), int(np.ceil(after.start)))
    return replace(
        longer,
        first=before.first,
        last=after.last,
        start=before.start,
        stop=after.stop,
        excluded=[*before.excluded, hole, *after.excluded],
    )
