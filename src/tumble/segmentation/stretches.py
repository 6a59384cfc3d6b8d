"""Stretches of rest while the search shapes them into holds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.segmentation.activity import CHI_1E5, Activity
from tumble.segmentation.blocks import Blocks

# A rougher block than this many times the hold's median (in variance) is a knock; the amplitude of
# hand tremor changes by a factor of three at most.
KNOCK = 25.0
SAME_POSE = np.radians(0.3)
LONGEST_KNOCK_SECONDS = 3.0


@dataclass(slots=True)
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
    excluded: list[tuple[int, int]] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Blocks at rest, without those excluded."""
        return self.stop - self.start - sum(b - a for a, b in self.excluded)


def find_runs(rest: np.ndarray) -> list[tuple[int, int]]:
    """Return the half-open index ranges in which `rest` is true."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], rest.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edge[::2], edge[1::2], strict=True)]


def _level(smooth: Vectors, first: int, last: int, margin: int) -> tuple[Vector, Vector]:
    if last - first > 3 * margin:
        first, last = first + margin, last - margin
    values = smooth[first:last]
    middle = np.median(values, axis=0)
    return middle, 1.4826 * np.median(np.abs(values - middle), axis=0)


def shape_stretch(blocks: Blocks, activity: Activity, first: int, last: int, open_ends: tuple[bool, bool]):
    """Describe the rest from block `first` up to `last` and move its ends inwards to where it settles.

    The limit at the ends is the stretch's own: 5.1 robust standard deviations of its own smoothed
    signal about its own median, so neither bias, g-sensitivity nor Earth rate enter.

    Parameters
    ----------
    first, last : blocks; the activity is below the threshold between them.
    open_ends : whether the rest is bounded by motion on the left and on the right.
    """
    stretch = Stretch(first, last, float(first), float(last), None, None, None, None)
    if blocks.angular_rate is not None:
        stretch.rate, stretch.rate_scatter = _level(
            blocks.angular_rate.smooth, first, last, blocks.half_width
        )
    if blocks.specific_force is not None:
        stretch.force, stretch.force_scatter = _level(
            blocks.specific_force.smooth, first, last, blocks.half_width
        )
    distance = _distance(blocks, stretch, activity)
    if open_ends[0]:
        stretch.start = first + _settling(distance, blocks.half_width)
    if open_ends[1]:
        stretch.stop = last - _settling(distance[::-1], blocks.half_width)
    return stretch


def _distance(blocks: Blocks, stretch: Stretch, activity: Activity) -> Series:
    """Distance of each block from the stretch's own level, in its own standard deviations."""
    triad, middle, scatter = blocks.angular_rate, stretch.rate, stretch.rate_scatter
    if triad is None:
        triad, middle, scatter = blocks.specific_force, stretch.force, stretch.force_scatter
    assert triad is not None and middle is not None and scatter is not None
    values = triad.smooth[stretch.first : stretch.last] - middle
    # three axes that share one floor: a quantised axis may not move at all during a hold
    floor = max(float(np.sqrt(np.mean(scatter**2))), 1e-12 * float(np.abs(middle).max()), 1e-300)
    return np.sqrt(np.sum((values / np.maximum(scatter, 0.5 * floor)) ** 2, axis=1))


def _settling(distance: Series, needed: int) -> float:
    """Blocks from the end to the first place where `needed` blocks in a row are within the limit."""
    count = distance.shape[0]
    limit = CHI_1E5
    while True:
        inside = distance < limit
        for k in range(min(count - needed + 1, max(count // 2, 1))):
            if inside[k : k + needed].all():
                if k == 0:
                    return 0.0
                # the limit is crossed between the centres of blocks k - 1 and k
                before, after = np.log(distance[k - 1]), np.log(max(distance[k], 1e-9))
                share = (np.log(limit) - after) / max(before - after, 1e-9)
                return k + 0.5 - float(np.clip(share, 0.0, 1.0))
        limit *= 1.5
        if limit > 1e6:
            return 0.0


def find_knocks(blocks: Blocks, stretch: Stretch) -> list[tuple[int, int]]:
    """Return the block ranges inside a stretch that are far rougher than the rest of it."""
    first, last = int(np.ceil(stretch.start)), int(stretch.stop)
    rough = np.zeros(max(last - first, 0), dtype=bool)
    for triad in (blocks.angular_rate, blocks.specific_force):
        if triad is None or rough.size == 0:
            continue
        total = triad.roughness[first:last].sum(axis=1)
        rough |= total > KNOCK * max(float(np.median(total)), 1e-300)
    spread = rough.copy()
    spread[1:] |= rough[:-1]
    spread[:-1] |= rough[1:]
    return [(first + a, first + b) for a, b in find_runs(spread)]


def pose_change(before: Stretch, after: Stretch, activity: Activity) -> tuple[float, float]:
    """Angle between the specific forces of two stretches and its standard uncertainty, rad.

    Zero with no accelerometer.
    """
    if before.force is None or after.force is None or activity.gravity is None:
        return 0.0, 0.0
    assert before.force_scatter is not None and after.force_scatter is not None
    angle = float(np.linalg.norm(after.force - before.force)) / activity.gravity
    variance = 0.0
    for part in (before, after):
        assert part.force_scatter is not None
        # smoothed blocks are correlated over some four blocks
        variance += float(np.sum(part.force_scatter**2)) * 6.0 / max(part.last - part.first, 6)
    return angle, float(np.sqrt(variance)) / activity.gravity


def net_turn(blocks: Blocks, before: Stretch, after: Stretch, activity: Activity) -> float:
    """Sum of the rate between two stretches without their mean bias, rad; zero without a gyro."""
    if blocks.angular_rate is None or activity.rate_scale is None:
        return 0.0
    assert before.rate is not None and after.rate is not None
    a, b = before.last - 1, after.first + 1
    values = blocks.angular_rate.smooth[a:b] - 0.5 * (before.rate + after.rate)
    return float(np.linalg.norm(values.sum(axis=0))) * blocks.seconds * activity.rate_scale


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
    angle, sigma = pose_change(before, after, activity)
    if angle > SAME_POSE + 4.0 * sigma:
        return False
    return net_turn(blocks, before, after, activity) < np.radians(1.0)


def _merge(before: Stretch, after: Stretch) -> Stretch:
    longer = before if before.length >= after.length else after
    hole = (int(np.floor(before.stop)), int(np.ceil(after.start)))
    return Stretch(
        before.first,
        after.last,
        before.start,
        after.stop,
        longer.rate,
        longer.rate_scatter,
        longer.force,
        longer.force_scatter,
        [*before.excluded, hole, *after.excluded],
    )
