"""What a recording offers to an estimator: holds, the gyros between them, turning tables; and the poses believed.

A hold is at rest up to a sway; its specific force is seen in three parts, at the head, in the middle and
at the tail, so that turns join it at its edges. Between holds the gyros are integrated sample by sample.
A table's rotation offers more: means of the specific force over windows while it turns, and its angle.

Of a pose that sways within a hold the gyros see where its middle stands between its head and its tail: the swing. The
mean rate over a hold tells the bias and what the pose turns from head to tail, which nothing takes apart. The swing
does not depend on a bias that stays: the mean of the integral over the middle's samples, less the share of the whole
hold's turn that a steady rate would have brought there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from itertools import pairwise

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Square, Vector, Vectors, inverted, range_means
from tumble.attitude import skews
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns, window_directions
from tumble.calibration.equations.imu_unknowns import force_matrix, gyro_matrix
from tumble.estimation import Unknowns, covariance_about_the_mean, wander_basis
from tumble.recording import stamp_jitter
from tumble.records import dataclass
from tumble.segmentation import integral_variance, rounding_of_each, rounding_variance

# The share of a window that the other parts must leave for a middle of its own.
SMALLEST_MIDDLE = 0.05
# Cosines over a rotation in which a bias wanders, at least, a revolution, and at most; what is faster is as good
# as white. Gravity goes round once a revolution, which is two of them for its cosine; its sine takes many, and what
# they left out of it would seem free of wander.
FEWEST_MODES, MODES_A_REVOLUTION, MOST_MODES = 8, 6, 32


@dataclass(frozen=True)
class BelievedPoses:
    """Poses of holds, in the axes of the fixture that the unit was placed with.

    Attributes
    ----------
    hold : (poses,) index of the hold, ascending.
    up_f : (poses, 3) unit vector in the fixture's axes that points up.
    C_nf : (poses, 3, 3) nominal attitude; of unknown heading where `has_heading` is False.
    has_heading : (poses,) of bool.
    sigma : (poses,) rad about each axis.
    placed : hold -> the hold whose pose it is in still, for all that a believed pose is known of.
    """

    hold: np.ndarray
    up_f: Vectors
    C_nf: Matrices
    has_heading: np.ndarray
    sigma: Series
    placed: dict[int, int] = field(default_factory=dict[int, int])

    def of(self, first: int, last: int) -> np.ndarray:
        """Return the indices of the poses of holds `first` to `last` (half-open)."""
        return np.flatnonzero((self.hold >= first) & (self.hold < last))


@dataclass
class TableRotation:
    """A table's rotation from one hold to the next.

    Attributes
    ----------
    before : index of the hold before it; the hold after is the next one.
    windows : (windows, 2) sample ranges at the constant rate.
    centres : (windows,) the sample in whose frame each window's attitude is given.
    force, force_covariance : (windows, 3), (windows, 3, 3) raw means.
    rate : (windows, 3) raw means of the gyros.
    time : (windows,) s, of the centres, from the first window's start.
    offsets : (samples,) s of every sample from its window's centre.
    modes : (windows, modes) cosines over the rotation, in which biases wander besides their constant.
    mode_share : (modes,) variance of each mode's amplitude, per unit of ``ln f`` of the wander's density.
    seconds : s from the first window's start to the last one's end.
    rate_rounding : (3,) raw², by which the gyros are off all along, as their steps leave it.
    ramp_sampling : (2, 3) raw² s², variance of the gyros' integrals before the first window and after the last, by
        their steps and by stamps that jitter.
    angle, angle_sigma : rad that the table says it turned from rest to rest, with the gyros' own sign about
        their own axis; None if nobody read it.
    turn_rate, rate_sigma : rad/s against the Earth at which it is believed to turn over all windows; None if nobody
        says so.
    row : which of the matched spins it is; -1 for none.
    name : in words.
    """

    before: int
    windows: np.ndarray
    centres: np.ndarray
    force: Vectors
    force_covariance: Matrices
    rate: Vectors
    time: Series
    offsets: Series
    modes: AnyArray
    mode_share: Series
    seconds: float
    angle: float | None = None
    angle_sigma: float = 0.0
    turn_rate: float | None = None
    rate_sigma: float = 0.0
    row: int = -1
    name: str = ""
    rate_rounding: Vector = field(default_factory=lambda: np.zeros(3))
    ramp_sampling: Vectors = field(default_factory=lambda: np.zeros((2, 3)))


@dataclass
class Observed:
    """Everything that is observed, raw.

    Attributes
    ----------
    base : holds and turns as the hand-held procedure gathers them.
    parts : (holds, 3, 3) raw specific force at the head, in the middle and at the tail.
    parts_covariance : (holds, 9, 9) of them.
    length : (holds,) s from the first to the last sample of a hold.
    swings : where the gyros see each hold's middle between its head and its tail.
    force_density, rate_density : (3,) raw², by which biases wander per unit of ``ln f`` (1/f noise).
    span : s of the whole recording.
    sections : (sections, 2) half-open ranges of holds that usable turns join without a break.
    rotations : by the index of the hold before.
    poses : of holds, that are believed; None for none.
    wander_once : covariances of stretches of time by 1/f noise, once one of them has been asked for.
    steady : "force" or "rate" of a triad whose biases are taken for constant but within rotations.
    """

    base: HoldsAndTurns
    parts: AnyArray
    parts_covariance: AnyArray
    length: Series
    swings: Swings
    sections: np.ndarray
    force_density: Vector
    rate_density: Vector
    span: float
    rotations: dict[int, TableRotation] = field(default_factory=dict[int, TableRotation])
    poses: BelievedPoses | None = None
    wander_once: dict[bytes, AnyArray] = field(default_factory=dict[bytes, AnyArray])
    steady: str = ""

    @property
    def holds(self) -> int:
        """Number of holds."""
        return self.base.holds

    @property
    def turns(self) -> np.ndarray:
        """Holds after which a usable turn follows."""
        return np.flatnonzero(self.base.turn_start >= 0)

    @property
    def rate_wander(self) -> Matrices:
        """(holds, 3, 3) raw², of each hold's mean rate what white noise and rounding do not explain."""
        base = self.base
        white = base.rate_random_walk / (base.hold_samples[:, None] * base.step)
        if base.rate_rounding is not None:
            white = white + base.rate_rounding
        beyond = np.maximum(np.diagonal(base.rate_covariance, axis1=1, axis2=2) - white, 0.0)
        return beyond[:, :, None] * np.eye(3)

    def without_wander(self, kind: str) -> Observed:
        """Return the same as if biases of "force" or "rate" wandered by nothing from one hold or turn to the next."""
        base, none = self.base, np.zeros(3)
        if kind == "force":
            parts = self.parts_covariance - np.tile(np.diag(base.force_floor), (3, 3))
            return replace(self, base=replace(base, force_floor=none), parts_covariance=parts, steady=kind)
        covariance = base.rate_covariance - np.minimum(self.rate_wander, np.diag(base.rate_floor))
        return replace(self, base=replace(base, rate_floor=none, rate_covariance=covariance), steady=kind)


def observe(
    base: HoldsAndTurns,
    u: Unknowns,
    rotations: list[TableRotation] | None = None,
    parts: AnyArray | None = None,
) -> Observed:
    """Return the data of holds and turns, with a table's rotations.

    Parameters
    ----------
    base : gathered holds and turns.
    u : what is believed of the sensors: within the windows at a hold's edges the gyros turn each
        sample to the edge, so that tremor is followed.
    rotations : of a table, each in place of the turn between its two holds.
    parts : (holds, 3, 3) as `Observed` has them, where they are known already.
    """
    first, last = base.head[:, 0], base.tail[:, 1] - 1
    span = float(base.time[last[-1]] - base.time[first[0]])
    octaves = wander_logarithm(base, span)
    count = _parts_counts(base)
    return Observed(
        base=base,
        parts=_parts(base, count, u) if parts is None else parts,
        parts_covariance=_parts_covariance(base, count, base.force_floor / octaves),
        length=base.time[last] - base.time[first],
        swings=hold_swings(base, base.rate_floor / octaves),
        sections=_sections(base),
        force_density=base.force_floor / octaves,
        rate_density=base.rate_floor / octaves,
        span=span,
        rotations={rotation.before: rotation for rotation in rotations or []},
    )


def _sections(base: HoldsAndTurns) -> np.ndarray:
    broken = np.flatnonzero(base.turn_start[:-1] < 0) + 1 if base.holds else np.zeros(0, dtype=int)
    edges = np.concatenate([[0], broken, [base.holds]])
    return np.column_stack([edges[:-1], edges[1:]])


def wander_logarithm(base: HoldsAndTurns, span: float) -> float:
    """Return ``ln(T / n)`` of a typical hold: the floor of its mean is so many times the wander's density.

    Parameters
    ----------
    base, span : holds, and s of the whole recording.
    """
    return max(float(np.log(span / (float(np.median(base.hold_samples)) * base.step))), 0.1)


def _parts_counts(base: HoldsAndTurns) -> AnyArray:
    """(holds, 3) samples of head, middle and tail."""
    head, tail = _counts(base.head), _counts(base.tail)
    return np.stack([head, base.hold_samples - head - tail, tail], axis=1)


def _parts(base: HoldsAndTurns, count: AnyArray, u: Unknowns) -> AnyArray:
    """Cut each hold's mean into head, middle and tail."""
    head, tail = range_means(base.raw_force, base.head), range_means(base.raw_force, base.tail)
    n = base.hold_samples.astype(float)
    empty = count[:, 1] < SMALLEST_MIDDLE * n
    rest = n[:, None] * base.force_mean - count[:, :1] * head - count[:, 2:] * tail
    middle = np.where(empty[:, None], base.force_mean, rest / np.maximum(count[:, 1:2], 1.0))
    matrix, bias = force_matrix(u), u["force.bias"]
    turned = window_directions(base, matrix, bias, inverted(gyro_matrix(u)))
    edges = [
        mean + (seen - (mean - bias) @ inverted(matrix).T) @ matrix.T
        for mean, seen in zip((head, tail), turned, strict=True)
    ]
    return np.stack([edges[0], middle, edges[1]], axis=1)


def _parts_covariance(base: HoldsAndTurns, count: AnyArray, density: Vector) -> AnyArray:
    """(holds, 9, 9) of head, middle and tail; a middle of nothing gets no weight."""
    n = base.hold_samples.astype(float)
    empty = count[:, 1] < SMALLEST_MIDDLE * n
    floor = np.diag(base.force_floor)
    variance = np.diagonal(base.force_covariance, axis1=1, axis2=2)
    least = np.minimum(variance, base.force_sample_variance / n[:, None])
    white = np.maximum(variance - base.force_floor, least)
    covariance = np.zeros((base.holds, 3, 3, 3, 3))
    for part in range(3):
        # a share of the samples has the white variance of the whole times what it lacks of it
        weight = np.where(empty, 1e-6, count[:, 1] / n) if part == 1 else count[:, part] / n
        covariance[:, part, :, part, :] = (white / weight[:, None])[:, :, None] * np.eye(3)
    covariance += floor[None, None, :, None, :]
    # What wanders within a hold moves its parts against one another and leaves its mean alone.
    alike: dict[tuple[float, ...], Square] = {}
    for k, samples in enumerate(count.tolist()):
        own = tuple(samples)
        if own not in alike:
            alike[own] = _wander_of_parts(count[k], has_middle=not empty[k])
        covariance[k] += alike[own][:, None, :, None] * np.diag(density)[None, :, None, :]
    return covariance.reshape(-1, 9, 9)


def _wander_of_parts(samples: Series, *, has_middle: bool) -> Square:
    """Return (3, 3) covariance of head, middle and tail about their hold's mean, per density of 1/f noise."""
    edges = np.concatenate([[0.0], np.cumsum(samples)])
    there = np.array([True, has_middle, True])
    made = np.zeros((3, 3))
    made[np.ix_(there, there)] = covariance_about_the_mean(
        edges[:-1][there], edges[1:][there], (0.0, float(edges[-1]))
    )
    return made


def _counts(windows: np.ndarray) -> Series:
    return (windows[:, 1] - windows[:, 0]).astype(float)


def table_rotation(
    base: HoldsAndTurns,
    before: int,
    start: int,
    stop: int,
    rate: Vector,
    *,
    angle: float | None,
    angle_sigma: float,
    largest_angle: float = 0.3,
    longest: float = 2.0,
    turn_rate: float | None = None,
    rate_sigma: float = 0.0,
    row: int = -1,
    name: str = "",
) -> TableRotation:
    """Cut a table's rotation into windows over which the specific force is averaged as it turns.

    Parameters
    ----------
    base : holds, samples, and the noise of a sample at rest.
    before : the hold before it.
    start, stop : half-open sample range at the constant rate.
    rate : (3,) rad/s, about what it turns with.
    angle, angle_sigma : rad, the table's own; None if nobody read it.
    largest_angle, longest : rad and s that a window may turn and last: a mean over 0.3 rad has lost 0.4 % of
        what turns, which the model follows exactly and its derivatives neglect.
    turn_rate, rate_sigma : rad/s, the table's own; None if nobody says.
    row, name : which spin it is.
    """
    time = base.time
    step = (time[stop - 1] - time[start]) / max(stop - 1 - start, 1)
    seconds = min(longest, largest_angle / max(float(np.linalg.norm(rate)), 1e-6))
    pieces = max(1, int(np.ceil((stop - start) * step / seconds)))
    edges = np.linspace(start, stop, pieces + 1).round().astype(int)
    windows = np.column_stack([edges[:-1], edges[1:]])
    windows = windows[windows[:, 1] > windows[:, 0]]
    count = windows[:, 1] - windows[:, 0]
    centres = (windows[:, 0] + windows[:, 1] - 1) // 2
    whole = float((stop - start) * step)
    middle = (0.5 * (windows[:, 0] + windows[:, 1]) - start) * step / whole
    modes, share = wander_basis(middle, _modes(base, len(windows), whole, float(np.linalg.norm(rate))))
    return TableRotation(
        before=before,
        windows=windows,
        centres=centres,
        force=range_means(base.raw_force, windows),
        force_covariance=np.diag(base.force_sample_variance)[None] / count[:, None, None],
        rate=range_means(base.raw_rate, windows),
        time=middle * whole,
        offsets=time[start:stop] - np.repeat(time[centres], count),
        modes=modes,
        mode_share=share,
        seconds=whole,
        angle=angle,
        angle_sigma=angle_sigma,
        turn_rate=turn_rate,
        rate_sigma=rate_sigma,
        row=row,
        name=name,
    )


def _modes(base: HoldsAndTurns, windows: int, seconds: float, rate: float) -> int:
    """Return how many cosines a wander needs; none where nothing wanders."""
    if not (np.any(base.force_floor > 0.0) or np.any(base.rate_floor > 0.0)):
        return 0
    return mode_count(windows, seconds * rate / (2.0 * np.pi))


def mode_count(windows: int, revolutions: float) -> int:
    """Return how many cosines stand for a wander over so many windows in which a table goes round so often."""
    return min(max(FEWEST_MODES, int(np.ceil(MODES_A_REVOLUTION * revolutions))), MOST_MODES, windows - 1)


def with_rounding(base: HoldsAndTurns, rotations: list[TableRotation]) -> HoldsAndTurns:
    """Return the rests with what rounding leaves where rotations show the same; put it into the rotations, too.

    Parameters
    ----------
    base, rotations : rests, and rotations between them.
    """
    if not rotations:
        return base
    rests = [[(int(a), int(b))] for a, b in zip(base.head[:, 0], base.tail[:, 1], strict=True)]
    # A table's rate is one number all along, as a rest is. What the gyros across show may be one number in all spins.
    whole = [[(int(one.windows[0, 0]), int(one.windows[-1, 1]))] for one in rotations]
    means = np.array([one.rate.mean(axis=0) for one in rotations])
    for rotation, left in zip(rotations, rounding_variance(base.raw_rate, whole, means), strict=True):
        rotation.rate_rounding = left
    still = rounding_of_each(base.raw_rate, rests, base.rate_mean).mean(axis=0)
    jitter = stamp_jitter(base.time)
    for one in rotations:
        inner = one.windows[0, 0], one.windows[-1, 1]
        ramps = np.array(
            [(base.tail[one.before, 1] - 1, inner[0]), (inner[1], base.head[one.before + 1, 0] + 1)]
        )
        # What is off alike at the rate is so on the way to it.
        left = np.maximum(still, one.rate_rounding) * base.step**2
        one.ramp_sampling = integral_variance(base.raw_rate, ramps, left, jitter)
    windows = [[(int(a), int(b))] for one in rotations for a, b in one.windows]
    force = np.concatenate([base.force_mean, *(one.force for one in rotations)])
    shown = rounding_variance(base.raw_force, [*rests, *windows], force)
    alone = rounding_variance(base.raw_force, rests, base.force_mean)
    ends = np.cumsum([base.holds, *(len(one.windows) for one in rotations)])
    for rotation, (first, last) in zip(rotations, pairwise(ends), strict=True):
        rotation.force_covariance = rotation.force_covariance + shown[first:last, :, None] * np.eye(3)
    more = (shown[: base.holds] - alone)[:, :, None] * np.eye(3)
    return replace(base, force_covariance=base.force_covariance + more)


def mean_backward_rotation(
    rotations: Sequence[TableRotation], rate: Vectors, lag: float = 0.0
) -> tuple[Matrices, Matrices]:
    """Return (windows, 3, 3) the mean over each window of the rotation from its centre's frame to each sample's.

    The second is its derivative by the speed, s.

    Parameters
    ----------
    rotations : whose windows, one rotation after another.
    rate : (windows, 3) rad/s, corrected means of the gyros.
    lag : s by which samples are of an earlier instant than their stamps say.

    Notes
    -----
    The rate is constant over a window of a table's rotation: with the mean rate w of the window and t from the
    centre, the mean of ``exp(-[w] t)`` is a sum of cosines along w and a small odd rest.
    """
    speed = np.linalg.norm(rate, axis=1)
    count = np.concatenate([one.windows[:, 1] - one.windows[:, 0] for one in rotations])
    seconds = np.concatenate([one.offsets for one in rotations]) - lag
    phase = np.repeat(speed, count) * seconds
    starts = np.cumsum(count) - count
    sines, cosines = np.sin(phase), np.cos(phase)
    sine, cosine, slower, faster = (
        (np.add.reduceat(of, starts) / count)[:, None, None]
        for of in (sines, cosines, seconds * cosines, seconds * sines)
    )
    cross = skews(rate / np.maximum(speed, 1e-30)[:, None])
    twice = cross @ cross
    return np.eye(3) - sine * cross + (1.0 - cosine) * twice, faster * twice - slower * cross


# Cosines over a hold by which the bias's own wander counts: the swing sees the first few.
_MODES = 8


@dataclass(frozen=True)
class Swings:
    """The gyros' own account of each hold's middle.

    Attributes
    ----------
    value : (holds, 3) raw s.
    covariance : (holds, 3, 3) (raw s)².
    share : (holds,) of the hold's turn that a steady rate has brought by its middle.
    """

    value: Vectors
    covariance: AnyArray
    share: Series


def hold_swings(base: HoldsAndTurns, density: Vector) -> Swings:
    """Return the swing of every hold.

    Parameters
    ----------
    base : holds, samples and noise.
    density : (3,) raw², by which the gyros' biases wander per unit of ``ln f``.
    """
    value, (share, white, wander) = np.zeros((base.holds, 3)), np.zeros((3, base.holds))
    step = base.step
    amplitudes = wander_basis(np.zeros(1), _MODES)[1]
    alike: dict[tuple[int, ...], tuple[Series, float, float, float]] = {}
    for k in range(base.holds):
        first, last = int(base.head[k, 0]), int(base.tail[k, 1])
        own = last - first, *_middle(base, k)
        if own not in alike:
            weights = _later_share(*own)
            mean = float(weights.mean())
            kernel = (weights - mean) * step
            slow = float(np.sum(amplitudes * (step * _cosine_sums(*own)) ** 2))
            alike[own] = kernel, mean, float(kernel @ kernel) / step, slow
        kernel, share[k], white[k], wander[k] = alike[own]
        value[k] = kernel @ base.raw_rate[first:last]
    variance = white[:, None] * base.rate_random_walk + wander[:, None] * density
    return Swings(value, variance[:, :, None] * np.eye(3), share)


def _middle(base: HoldsAndTurns, k: int) -> tuple[int, int]:
    """Return from which sample of a hold to which its middle lies; one sample where head and tail leave none."""
    first, last = int(base.head[k, 0]), int(base.tail[k, 1])
    start, stop = int(base.head[k, 1]) - first, int(base.tail[k, 0]) - first
    return (start, stop) if stop > start else ((last - first) // 2, (last - first) // 2 + 1)


def _later_share(samples: int, start: int, stop: int) -> Series:
    """Return (samples,) the share of the middle's samples that come after each one."""
    return np.clip((stop - 0.5 - np.arange(samples)) / (stop - start), 0.0, 1.0)


def _cosine_sums(samples: int, start: int, stop: int) -> Series:
    """Return (modes,) the sums of `_later_share`, less its mean, times ``cos(n pi (i + 1/2) / samples)``.

    The share falls evenly over the middle, so that the sums are geometric; a constant has none.
    """
    turn = 0.5 * np.pi * np.arange(1, _MODES + 1) / samples
    apart = 2.0 * np.sin(turn * (stop + start)) * np.sin(turn * (stop - start))
    return np.cos(turn) * apart / (4.0 * np.sin(turn) ** 2 * (stop - start))
