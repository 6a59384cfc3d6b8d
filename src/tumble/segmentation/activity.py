"""How much the unit moves at each moment, on a scale that the recording itself provides.

The search must not ask for units, biases or noise: it finds them here, roughly, from the quietest
tenth of the recording and from what the two triads tell of each other in motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Vector, Vectors, median
from tumble.recording import fit_sphere
from tumble.records import dataclass
from tumble.segmentation.blocks import Blocks, TriadBlocks, find_runs
from tumble.segmentation.timeline import Hold

# Slower than any turn made on purpose (10 deg/s = 0.17 rad/s), faster than hand tremor after
# smoothing (0.003 rad/s) with a MEMS gyro's g-sensitive bias (0.02 rad/s) on top.
SLOWEST_LIMIT = 0.02
FASTEST_LIMIT = 0.06
# sqrt of the chi-square quantile for 3 degrees of freedom at 1e-5: the share of resting blocks above.
CHI_1E5 = 5.09
# Two levels of the gyro are one if they differ by less than this share of the fastest motion, ...
SAME_LEVEL = 0.02
# ... and a level is visited if it stays for this long.
SHORTEST_VISIT_SECONDS = 0.5
# Of the levels that are visited so many are held against all others, by multiples of the golden ratio.
MOST_TRIED = 400
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
# A knock spoils a piece of a hold of so many samples.
PIECE_SAMPLES = 100
# A typical turn by hand, used only where nothing in the recording determines the gyro's scale.
TYPICAL_TURN_RATE = 1.0


@dataclass(frozen=True)
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
    unrest = _unrest(blocks)
    quiet, slowest = _among_rests(blocks, unrest, _quietest(unrest))
    force, rate = blocks.specific_force, blocks.angular_rate
    gravity = force_bias = rate_bias = scale = None
    centred = False
    if force is not None:
        noise = float(np.median(change_sizes_of(force, blocks.half_width)[quiet]))
        force_bias, gravity, centred = _sphere(force.smooth[quiet], noise)
        centred = centred or blocks.force_factor is not None
    if rate is not None:
        rate_bias = median(rate.smooth[quiet])
        size, telling = _distances(rate, rate_bias), _apparent(blocks, gravity) if centred else None
        scale = _rate_scale(blocks, size, quiet, rate_bias, force_bias, telling, slowest)
    activity = _rates(blocks, gravity, rate_bias, scale)
    if rate is None or scale is None:
        spread = float(np.median(activity[quiet]))
    else:
        spread = scale * float(np.linalg.norm(_scatter(rate.smooth[quiet]))) / np.sqrt(3.0)
    threshold = _threshold(activity, CHI_1E5 * spread)
    return Activity(activity, threshold, rate_bias, scale, gravity, force_bias)


def follow_activity(blocks: Blocks, known: Activity) -> Activity:
    """Return how much the unit moves in further blocks of a recording whose scale is known.

    Parameters
    ----------
    blocks : of the same unit.
    known : what was found in other blocks of it; bias, scales and threshold are taken from there.
    """
    return replace(known, rate=_rates(blocks, known.gravity, known.rate_bias, known.rate_scale))


def _rates(blocks: Blocks, gravity: float | None, bias: Vector | None, scale: float | None) -> Series:
    """Motion per block, rad/s: see `Activity.rate`."""
    apparent, rate = _apparent(blocks, gravity), blocks.angular_rate
    if rate is None or bias is None or scale is None:
        return apparent
    size = scale * _distances(rate, bias)
    return np.maximum(size, apparent / 3.0)


def _apparent(blocks: Blocks, gravity: float | None) -> Series:
    """Rad/s by which the direction of the specific force moves; zero without an accelerometer."""
    if blocks.specific_force is None or gravity is None:
        return np.zeros(len(blocks))
    span = blocks.half_width * 2 * blocks.seconds
    return change_sizes_of(blocks.specific_force, blocks.half_width) / (gravity * span)


def change_sizes_of(triad: TriadBlocks, lag: int) -> np.ndarray:
    """Return the length of the change over `lag` blocks to either side, (blocks,) raw units.

    Parameters
    ----------
    triad, lag : its blocks, and how many of them.
    """
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
    return 1.4826 * median(np.abs(values - median(values)))


def _unrest(blocks: Blocks) -> Series:
    """How much the signals change around each block, in multiples of their usual change."""
    total = np.zeros(len(blocks))
    for triad in (blocks.specific_force, blocks.angular_rate):
        if triad is None:
            continue
        change = change_sizes_of(triad, blocks.half_width)
        usual = float(np.median(change)) or float(np.mean(change)) or 1.0
        np.maximum(total, change / usual, out=total)
    # a quiet moment inside a turn is short: its surroundings give it away
    reach = blocks.half_width
    padded = np.pad(total, reach, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)


def _quietest(unrest: Series) -> np.ndarray:
    """Indices of the tenth of the blocks around which the signals change least, or more that are alike."""
    wanted = min(len(unrest), max(20, len(unrest) // 10))
    return np.flatnonzero(unrest <= np.partition(unrest, wanted - 1)[wanted - 1])


def _among_rests(blocks: Blocks, unrest: Series, quiet: np.ndarray) -> tuple[np.ndarray, float | None]:
    """The quiet blocks that are at rest, and the slowest rate of a table in raw units, None without one.

    A constant rate about the vertical changes as little as no rate. But between two spins the table
    stands still: of all the gyro's steady levels, rest is the one that is come back to most often.
    """
    if blocks.angular_rate is None:
        return quiet, None
    rate = blocks.angular_rate
    away = _distances(rate, median(rate.smooth[quiet]))
    rough = median(rate.roughness[quiet]).astype(float)  # kept in 32 bits, which have no such squares
    noise = float(np.linalg.norm(rough) ** 0.5) / blocks.size**0.5
    apart = max(SAME_LEVEL * float(np.quantile(away, 0.99)), 10.0 * noise)
    limit = max(4.0 * float(np.median(unrest[quiet])), 1e-9 * float(unrest.max()))
    shortest = round(SHORTEST_VISIT_SECONDS / blocks.seconds)
    runs = [run for run in find_runs(unrest <= limit) if run[1] - run[0] >= shortest]
    levels = np.array([median(rate.smooth[a:b]) for a, b in runs]).reshape(-1, 3)
    chosen, rest = _most_visited(levels, apart)
    if rest.all():
        return quiet, None
    slowest = float(np.linalg.norm(levels[~rest] - levels[chosen], axis=1).min())
    astray = np.count_nonzero(_distances(rate, levels[chosen])[quiet] > apart)
    if astray >= 0.05 * len(quiet):
        quiet = np.concatenate([np.arange(a, b) for (a, b), same in zip(runs, rest, strict=True) if same])
    return quiet, slowest


def _most_visited(levels: Vectors, apart: float) -> tuple[int, np.ndarray]:
    """Which of the levels is visited most often, and which are the same as it."""
    if len(levels) == 0:
        return 0, np.ones(0, dtype=bool)
    # a visit may be torn by noise: a run at the level of the one before it is no new visit
    new = np.ones(len(levels), dtype=bool)
    new[1:] = np.linalg.norm(np.diff(levels, axis=0), axis=1) > apart
    # some of thousands stand for all: not each second one, for spins and rests take turns
    tried = np.flatnonzero(np.arange(len(levels)) * GOLDEN % 1.0 <= MOST_TRIED / len(levels))
    near = np.linalg.norm(levels[tried, None] - levels, axis=2) <= apart
    # of levels visited alike the middle one: spins go both ways from rest
    outside = np.linalg.norm(levels[tried] - median(levels[new]), axis=1)
    best = int(np.lexsort((outside, -(near @ new.astype(float))))[0])
    return int(tried[best]), near[best]


def _sphere(force: Vectors, noise: float) -> tuple[Vector, float, bool]:
    """Centre and radius of the sphere on which the specific force at rest lies, raw units.

    One pose alone shows a sphere of noise: then the centre is taken as zero, and the last is False.
    """
    force = force[:: max(1, force.shape[0] // 2000)]
    usual = float(np.median(np.linalg.norm(force, axis=1))) or 1.0
    reach = float(np.linalg.norm(force - median(force))) / len(force) ** 0.5 or usual
    sphere = fit_sphere(force, 4, 0.15) if reach > 20.0 * noise else None
    if sphere is not None and 0.5 < sphere[1] / reach < 3.0:
        return *sphere, True
    return np.zeros(3), usual, False


def _rate_scale(
    blocks: Blocks,
    size: Series,
    quiet: np.ndarray,
    rate_bias: Vector,
    force_bias: Vector | None,
    apparent: Series | None,
    slowest: float | None,
) -> float:
    """Rad/s per raw unit of the gyro, from how fast the specific force turns while the gyro turns.

    Where gravity stays upright in the unit the declared unit is believed, and for counts a typical turn;
    but the slowest steady rate of a table is a motion, whatever the scale.
    """
    rate, force = blocks.angular_rate, blocks.specific_force
    assert rate is not None
    # without noise the scatter at rest is round-off: a thousandth of the fastest is rest then too
    least = max(12.0 * float(np.median(size[quiet])), 1e-3 * float(size.max()))
    moving = (size > least) & (size >= float(np.quantile(size, 0.8)))
    if force is not None and apparent is not None and force_bias is not None:
        direction = force.smooth[moving] - force_bias
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        across = np.linalg.norm(np.cross(rate.smooth[moving] - rate_bias, direction), axis=1)
        telling = across > 0.5 * size[moving]
        if np.count_nonzero(telling) >= 10:
            shown = float(np.median(apparent[moving][telling] / across[telling]))
            declared = blocks.rate_factor
            if declared is None or slowest is None or 0.5 < shown / declared < 2.0:
                return shown
            # On a table with the gyro's columns exchanged gravity seems not to follow the gyro: the steady
            # rates that are motion in the declared unit decide.
            return declared if declared * slowest > FASTEST_LIMIT else shown
    if np.count_nonzero(moving) >= 3 and blocks.rate_factor is None:
        typical = TYPICAL_TURN_RATE / float(np.quantile(size[moving], 0.75))
        return typical if slowest is None else max(typical, 2.0 * FASTEST_LIMIT / slowest)
    if np.count_nonzero(moving) >= 3 and blocks.rate_factor is not None:
        return blocks.rate_factor
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


def noise_per_sample(signal: Vectors, holds: Sequence[Hold]) -> Vector:
    """Standard deviation of one sample per axis at rest, raw units.

    It comes from successive differences, so slow tremor and drift hardly enter, and is the median of pieces of the
    holds, so that a knock does not.

    Parameters
    ----------
    signal : (samples, 3).
    holds : one at least.
    """
    pieces: list[Vectors] = []
    for start, stop in (stretch for hold in holds for stretch in hold.stretches()):
        squares = 0.5 * np.diff(signal[start:stop], axis=0) ** 2
        edges = np.arange(0, max(len(squares) - PIECE_SAMPLES // 2, 1), PIECE_SAMPLES)
        if len(squares):
            pieces.append(np.add.reduceat(squares, edges) / np.diff(edges, append=len(squares))[:, None])
    if not pieces:
        return np.full(3, np.nan)
    # half the mean square of n successive differences is as sure as a variance of 2 n / 3 degrees of freedom
    freedom = 2.0 * PIECE_SAMPLES / 3.0
    median_of_mean = (1.0 - 2.0 / (9.0 * freedom)) ** 3
    return np.sqrt(median(np.concatenate(pieces)) / median_of_mean)
