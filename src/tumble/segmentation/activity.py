"""How much the unit moves at each moment, on a scale that the recording itself provides.

The search must not ask for units, biases or noise: it finds them here, roughly, from the quietest
tenth of the recording and from what the two triads tell of each other in motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.segmentation.blocks import Blocks, TriadBlocks

# Slower than any turn made on purpose (10 deg/s = 0.17 rad/s), faster than hand tremor after
# smoothing (0.003 rad/s) with a MEMS gyro's g-sensitive bias (0.02 rad/s) on top.
SLOWEST_LIMIT = 0.02
FASTEST_LIMIT = 0.06
# sqrt of the chi-square quantile for 3 degrees of freedom at 1e-5: the share of resting blocks above.
CHI_1E5 = 5.09
# A typical turn by hand, used only where nothing in the recording tells the gyro's scale.
TYPICAL_TURN_RATE = 1.0


@dataclass(frozen=True, slots=True)
class Activity:
    """Motion per block as an approximate angular rate in rad/s, and what it was made with.

    Attributes
    ----------
    rate : (blocks,) the larger of the gyro's rate without bias and a third of the rate at which the
        specific force's direction moves; without a gyro the latter in full.
    threshold : rest below, motion above, rad/s.
    rate_bias : (3,) raw output of the gyro at rest, roughly; None without a gyro.
    rate_scale : rad/s per raw unit of the gyro, roughly; None without a gyro.
    gravity : raw units per g of the accelerometer, roughly; None without an accelerometer.
    force_bias : (3,) raw output of the accelerometer at zero input, roughly; None without one.
    """

    rate: Series
    threshold: float
    rate_bias: Vector | None
    rate_scale: float | None
    gravity: float | None
    force_bias: Vector | None


def find_activity(blocks: Blocks) -> Activity:
    """Find how much the unit moves in each block and the limit between rest and motion.

    The gyro's scale is the one that turns the specific force's direction as fast as the
    accelerometer sees it turn; it need be right within a factor of two only.

    Parameters
    ----------
    blocks : of the whole recording.
    """
    quiet = _quietest(blocks)
    force, rate = blocks.specific_force, blocks.angular_rate
    gravity = force_bias = rate_bias = scale = None
    apparent: Series | None = None
    if force is not None:
        noise = float(np.median(_change_sizes(force, _lag(blocks))[quiet]))
        force_bias, gravity = _sphere(force.smooth[quiet], noise)
        span = _lag(blocks) * 2 * blocks.seconds
        apparent = _change_sizes(force, _lag(blocks)) / (gravity * span)
    if rate is None:
        assert apparent is not None
        activity = apparent
        spread = float(np.median(activity[quiet]))
    else:
        rate_bias = np.median(rate.smooth[quiet], axis=0)
        size = _distances(rate, rate_bias)
        scale = _rate_scale(blocks, size, quiet, rate_bias, force_bias, apparent)
        size *= scale
        spread = scale * float(np.linalg.norm(_scatter(rate.smooth[quiet]))) / np.sqrt(3.0)
        activity = size if apparent is None else np.maximum(size, apparent / 3.0, out=size)
    threshold = _threshold(activity, CHI_1E5 * spread)
    return Activity(activity, threshold, rate_bias, scale, gravity, force_bias)


def _lag(blocks: Blocks) -> int:
    return blocks.half_width


def _change_sizes(triad: TriadBlocks, lag: int) -> np.ndarray:
    """Length of the change over `lag` blocks to either side."""
    from tumble.segmentation.kernels import change_sizes

    sizes = np.empty(triad.smooth.shape[0])
    change_sizes(triad.smooth, lag, sizes)
    return sizes


def _distances(triad: TriadBlocks, level: Vector) -> np.ndarray:
    """Distance of each block from a level, an axis at a time to spare memory."""
    total = np.zeros(triad.smooth.shape[0])
    for axis in range(3):
        total += (triad.smooth[:, axis] - level[axis]) ** 2
    return np.sqrt(total, out=total)


def _scatter(values: Vectors) -> Vector:
    """Robust standard deviation per axis (from the median absolute deviation)."""
    return 1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0)


def _quietest(blocks: Blocks) -> np.ndarray:
    """Indices of the tenth of the blocks around which the signals change least."""
    total = np.zeros(len(blocks))
    for triad in (blocks.specific_force, blocks.angular_rate):
        if triad is None:
            continue
        change = _change_sizes(triad, _lag(blocks))
        usual = float(np.median(change)) or float(np.mean(change)) or 1.0
        np.maximum(total, change / usual, out=total)
    # a quiet moment inside a turn is short: its surroundings give it away
    reach = blocks.half_width
    padded = np.pad(total, reach, mode="edge")
    worst = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    wanted = min(len(blocks), max(20, len(blocks) // 10))
    return np.sort(np.argpartition(worst, wanted - 1)[:wanted])


def _sphere(force: Vectors, noise: float) -> tuple[Vector, float]:
    """Centre and radius of the sphere on which the specific force at rest lies, raw units.

    One pose alone shows a sphere of noise: then the centre is taken as zero.
    """
    force = force[:: max(1, force.shape[0] // 2000)]
    middle = np.median(force, axis=0)
    centred = force - middle
    usual = float(np.median(np.linalg.norm(force, axis=1))) or 1.0
    reach = float(np.linalg.norm(centred)) / len(centred) ** 0.5 or usual
    unit = centred / reach
    table = np.column_stack([2.0 * unit, np.ones(len(unit))])
    singular = np.sqrt(np.linalg.eigvalsh(table.T @ table).clip(0.0))
    if reach > 20.0 * noise and len(unit) >= 4 and singular[0] > 0.15 * singular[-1]:
        solution: np.ndarray = np.linalg.pinv(table) @ np.sum(unit**2, axis=1)
        radius = float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)))
        if 0.5 < radius < 3.0:
            return middle + reach * solution[:3], radius * reach
    return np.zeros(3), usual


def _rate_scale(
    blocks: Blocks,
    size: Series,
    quiet: np.ndarray,
    rate_bias: Vector,
    force_bias: Vector | None,
    apparent: Series | None,
) -> float:
    """Rad/s per raw unit of the gyro, from how fast the specific force turns while the gyro turns."""
    rate, force = blocks.angular_rate, blocks.specific_force
    assert rate is not None
    moving = size > max(12.0 * float(np.median(size[quiet])), float(np.quantile(size, 0.8)))
    if force is not None and apparent is not None and force_bias is not None:
        direction = force.smooth[moving] - force_bias
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        across = np.linalg.norm(np.cross(rate.smooth[moving] - rate_bias, direction), axis=1)
        telling = across > 0.5 * size[moving]
        if np.count_nonzero(telling) >= 10:
            return float(np.median(apparent[moving][telling] / across[telling]))
    if np.count_nonzero(moving) >= 3:
        return TYPICAL_TURN_RATE / float(np.quantile(size[moving], 0.75))
    # nothing moves: any scale that keeps the whole recording at rest
    return 0.2 * SLOWEST_LIMIT / (float(np.max(size)) or 1.0)


def _threshold(activity: Series, floor: float) -> float:
    """The emptiest place of the activity's histogram between the slowest and the fastest limit."""
    low, high = max(SLOWEST_LIMIT, floor), FASTEST_LIMIT
    if low >= high:
        return low
    edges = np.geomspace(low, high, 9)
    counts, _ = np.histogram(activity, edges)
    emptiest = np.flatnonzero(counts == counts.min())
    chosen = emptiest[emptiest.size // 2]
    return float(np.sqrt(edges[chosen] * edges[chosen + 1]))


def noise_per_sample(triad: TriadBlocks, rest: np.ndarray) -> Vector:
    """Standard deviation of one sample per axis over the resting blocks, raw units.

    It comes from successive differences, so slow tremor and drift hardly enter.

    Parameters
    ----------
    triad : of the whole recording.
    rest : (blocks,) true where the unit rests.
    """
    chosen = triad.roughness[rest] if np.any(rest) else triad.roughness
    return np.sqrt(np.median(chosen, axis=0).astype(float))
