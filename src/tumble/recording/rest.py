"""What a recording shows at a first look: quiet stretches by a simple rule, poses, channels that stick.

This is the reader's own rough estimate; holds for a calibration come from `tumble.segmentation`.
A block of a quarter of a second is quiet if no axis scatters more than four times its noise floor,
the floor being the 5th percentile of the axis's own scatter over all blocks; neighbouring quiet blocks
whose means agree within three floors form a stretch.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table, Vector, Vectors
from tumble.records import dataclass

_BLOCK_SECONDS = 0.25
_LEAST_BLOCK = 10
_SCATTER_LIMIT = 4.0
_STEP_LIMIT = 3.0
_FLOOR_QUANTILE = 0.05
_PIECE = 16_384  # samples of one piece of a long recording that is judged by samples of it

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class QuietStretches:
    """Stretches in which the unit seems at rest.

    Attributes
    ----------
    starts, stops : (stretches,) half-open index ranges.
    means : (stretches, channels) means over each stretch, raw units.
    floor : (channels,) noise floors, raw units, one standard deviation of a sample.
    """

    starts: Indices
    stops: Indices
    means: Table
    floor: AnyArray

    def __len__(self) -> int:
        return int(self.starts.size)

    def at_least(self, samples: float) -> QuietStretches:
        """Return the stretches of at least so many samples."""
        keep = (self.stops - self.starts) >= samples
        return QuietStretches(self.starts[keep], self.stops[keep], self.means[keep], self.floor)


def smallest_step(values: AnyArray) -> float:
    """Return the smallest difference between distinct values: the quantisation step (0 if constant)."""
    distinct = np.unique(values[:_PIECE])
    if distinct.size < 2:
        return 0.0
    steps = np.diff(distinct)
    # Differences that are only rounding in the last digit of a double are no steps.
    real = steps[steps > 1e-9 * max(abs(distinct[0]), abs(distinct[-1]))]
    return float(real.min()) if real.size else 0.0


def find_quiet_stretches(signals: Table, rate: float) -> QuietStretches:
    """Return the stretches in which no channel scatters much more than its own noise floor.

    Parameters
    ----------
    signals : (samples, channels) any mixture of triads, raw units.
    rate : samples a second.
    """
    size = max(_LEAST_BLOCK, round(_BLOCK_SECONDS * rate))
    count = signals.shape[0] // size
    channels = signals.shape[1]
    none = np.zeros(0, np.intp)
    if count == 0:
        return QuietStretches(none, none, np.zeros((0, channels)), np.zeros((channels,), dtype=np.float64))
    means, scatter = block_statistics(signals, size)
    floors = [_floor(signals[:, i], scatter[:, i]) for i in range(channels)]
    floor = np.asarray(floors, dtype=np.float64)
    quiet = np.all(scatter <= _SCATTER_LIMIT * floor, axis=1)
    joined = np.all(np.abs(np.diff(means, axis=0)) <= _STEP_LIMIT * floor, axis=1)
    first = quiet & ~np.concatenate([[False], quiet[:-1] & joined])
    last = quiet & ~np.concatenate([quiet[1:] & joined, [False]])
    starts, stops = np.flatnonzero(first), np.flatnonzero(last) + 1
    long = stops - starts >= 2
    starts, stops = starts[long], stops[long]
    sums = np.concatenate([np.zeros((1, channels)), np.cumsum(means, axis=0)])
    level = (
        (sums[stops] - sums[starts]) / (stops - starts)[:, None] if starts.size else np.zeros((0, channels))
    )
    return QuietStretches(starts * size, stops * size, level, floor)


def block_statistics(signals: Table, size: int) -> tuple[AnyArray, AnyArray]:
    """Return mean and standard deviation of consecutive blocks of `size` samples, per channel."""
    count = signals.shape[0] // size
    # blocks last, so that numpy adds along them side by side
    blocks = signals[: count * size].reshape(count, size, signals.shape[1]).transpose(1, 2, 0).copy()
    means = blocks.mean(axis=0)
    blocks -= means
    scatter = np.sqrt(np.square(blocks, out=blocks).sum(axis=0) / max(size - 1, 1))
    return means.T, scatter.T


def _floor(channel: AnyArray, scatter: AnyArray) -> float:
    """Noise floor of a channel; rounding to a step adds step/sqrt(12) that a short block may not show."""
    alive = scatter[scatter > 0.0]
    low = float(np.quantile(alive, _FLOOR_QUANTILE)) if alive.size else 0.0
    return max(low, smallest_step(channel) / np.sqrt(12.0))


def sample_pieces(count: int, limit: int = 12 * _PIECE) -> list[slice]:
    """Return the slices of a recording that judge it: everything, or a dozen pieces spread evenly."""
    if count <= limit:
        return [slice(0, count)]
    pieces = limit // _PIECE
    starts = np.linspace(0, count - _PIECE, pieces).astype(int)
    return [slice(int(s), int(s) + _PIECE) for s in starts]


def one_a_direction(vectors: Vectors) -> Vectors:
    """Return one vector of each direction, which differ by more than 15 degrees (greedy, in order); zeros have none."""
    lengths = np.linalg.norm(vectors, axis=1)
    left, kept, limit = np.flatnonzero(lengths > 0.0), list[int](), float(np.cos(np.pi / 12.0))
    units = vectors[left] / lengths[left, None]
    while left.size:
        kept.append(int(left[0]))
        apart = units @ units[0] < limit
        left, units = left[apart], units[apart]
    return vectors[kept]


def fit_sphere(points: Vectors, fewest: int = 5, spread: float = 0.1) -> tuple[Vector, float] | None:
    """Return centre and radius of the sphere through points (least squares), or None if undetermined.

    The means of an accelerometer at rest lie on a sphere around its bias; the fit needs four points at least that
    are well spread: the least singular value of its equations is so large a share of the largest.
    """
    if points.shape[0] < fewest:
        return None
    middle = points.mean(axis=0)
    size = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    if size == 0.0:
        return None
    q = (points - middle) / size
    design = np.column_stack([2.0 * q, np.ones(len(q))])
    singular = np.linalg.svd(design, compute_uv=False)
    if singular[-1] < spread * singular[0]:
        return None
    solution = np.linalg.pinv(design) @ (q**2).sum(axis=1)
    centre: Vector = solution[:3]
    square = float(solution[3] + centre @ centre)
    return (middle + size * centre, size * float(np.sqrt(square))) if square > 0.0 else None


_LEAST_RUN = 3
# Of the way from the middle to the extreme: what goes back so far comes to the limit anew.
_LEFT = 0.05


@dataclass(frozen=True)
class Saturation:
    """A channel that sticks at its extreme: `samples` at `value`, the longest run and where it begins."""

    channel: str
    value: float
    samples: int
    longest_run: int
    index: int


def find_saturation(channel: Series, name: str, floor: float | None = None) -> list[Saturation]:
    """Return where a channel sticks at its largest or smallest value.

    A sensor at its limit repeats one value, run after run, and has more samples there than in the
    whole twentieth of its range next to it; noise around a level does not.

    Parameters
    ----------
    channel, name : (samples,) raw, and what it is called.
    floor : noise per sample, raw units; None where it is to be found if it matters.
    """
    found: list[Saturation] = []
    for value in (float(channel.max()), float(channel.min())):
        at = np.flatnonzero(channel == value)
        # Where a run begins, and one past the last: most channels have none, and nothing more is to be looked at.
        edges = np.concatenate([[0], np.flatnonzero(np.diff(at) > 1) + 1, [at.size]])
        longest = int(np.argmax(np.diff(edges)))
        run = int(edges[longest + 1] - edges[longest])
        if at.size <= _LEAST_RUN or run < _LEAST_RUN:
            continue
        floor = _noise_of(channel) if floor is None else floor
        reach = abs(value - float(np.median(channel)))
        if reach <= 20.0 * floor or reach == 0.0:
            continue
        near = np.abs(channel - value) < _LEFT * reach
        if at.size > np.count_nonzero(near) - at.size:
            found.append(Saturation(name, value, at.size, run, int(at[edges[longest]])))
    return found


def _noise_of(channel: Series) -> float:
    """Return the noise per sample, robustly, from successive differences."""
    if channel.size < 2:
        return 0.0
    steps = np.diff(channel)
    return float(np.median(np.abs(steps, out=steps), overwrite_input=True)) / 0.954


def limits_reached(values: Vectors) -> list[Saturation]:
    """Return at which limits a triad sticks, each reached anew after others: a coarse one at rest repeats, too.

    Parameters
    ----------
    values : (samples, 3) raw.
    """
    found: list[Saturation] = []
    for name, channel in zip("xyz", values.T, strict=True):
        for one in find_saturation(channel, name):
            reach = _LEFT * abs(one.value - float(np.median(channel)))
            off = np.abs(channel - one.value)
            # Where a step of the converter is as large, the next number is no other one.
            fine = bool(np.any((off > 0.0) & (off <= reach)))
            if fine and np.unique(np.cumsum(off > reach)[off == 0.0]).size > 1:
                found.append(one)
    return found
