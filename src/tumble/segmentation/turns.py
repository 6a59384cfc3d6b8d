"""Turns: the motion from one hold to the next, and whether the angular rate can be trusted there.

Spins: the stretches in which a table turns the unit at a constant rate.

A spin lies in the motion between two holds: the table brings the unit to a rate, keeps it, and stops
or goes on to the next rate. A plateau is told from the top of a turn by hand, whose rate is nowhere
constant, by three things: it is *long* against the ramps beside it, it does not *drift* and it does not
*bow*. Nothing is to be set; noise and bias come from the holds, and units do not matter.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector, Vectors, extremes, median
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.activity import Activity, find_activity, noise_per_sample
from tumble.segmentation.blocks import Blocks, cut_blocks, find_runs
from tumble.segmentation.timeline import Hold, Timeline, Turn

AXES = "xyz"
SATURATED_RUN = 3
# Nothing is integrated across a longer gap: the rate within it is not seen.
LONGEST_GAP = 0.1  # s


def find_turns(recording: Recording, holds: list[Hold], activity: Activity) -> list[Turn]:
    """Return the turns between consecutive holds; one that cannot be integrated says why.

    Parameters
    ----------
    recording, holds : the samples and the holds in them, in order.
    activity : of the same recording; the gyro's bias and scale tell full scale from rest.
    """
    limits = _full_scale(recording.angular_rate, activity)
    noise = None
    if recording.gaps and recording.angular_rate is not None:
        noise = noise_per_sample(recording.angular_rate, holds)
    turns: list[Turn] = []
    for number in range(len(holds) - 1):
        start, stop = holds[number].stop, holds[number + 1].start
        reason = _reason_against(recording, start, stop, limits, noise)
        turns.append(Turn(number, number + 1, start, stop, not reason, reason))
    return turns


def _full_scale(rate: Vectors | None, activity: Activity) -> tuple[np.ndarray, np.ndarray] | None:
    """The extreme values per axis (lowest, highest) where they are far from rest, else infinite."""
    if rate is None or activity.rate_bias is None or activity.rate_scale is None:
        return None
    low, high = extremes(rate)
    fast = 0.5 / activity.rate_scale
    low = np.where(activity.rate_bias - low > fast, low, -np.inf)
    high = np.where(high - activity.rate_bias > fast, high, np.inf)
    return low, high


def _reason_against(
    recording: Recording,
    start: int,
    stop: int,
    limits: tuple[np.ndarray, np.ndarray] | None,
    noise: Vector | None,
) -> str:
    gaps = np.array([gap for gap in recording.gaps if start <= gap <= stop and gap > 0], dtype=int)
    if gaps.size and not _is_bridged(recording, gaps, stop - start, noise):
        steps = recording.time[gaps] - recording.time[gaps - 1] - 1.0 / recording.rate
        return f"{steps.sum():.2g} s of samples are missing in it"
    if recording.angular_rate is None or limits is None:
        return "there is no gyro" if recording.angular_rate is None else ""
    piece = recording.angular_rate[start:stop]
    for axis in range(3):
        at_limit = (piece[:, axis] <= limits[0][axis]) | (piece[:, axis] >= limits[1][axis])
        run = max((last - first for first, last in find_runs(at_limit)), default=0)
        if run >= SATURATED_RUN:
            return f"the gyro's {AXES[axis]} axis is at its extreme value for {run} samples: saturated"
    return ""


def _is_bridged(recording: Recording, gaps: np.ndarray, samples: int, noise: Vector | None) -> bool:
    """Whether straight lines across the gaps are off by less than the turn's noise: h²/12 times the slope's change."""
    rate, time = recording.angular_rate, recording.time
    if rate is None or noise is None or gaps.min() < 2 or gaps.max() > len(time) - 2:
        return False
    before = (rate[gaps - 1] - rate[gaps - 2]) / (time[gaps - 1] - time[gaps - 2])[:, None]
    after = (rate[gaps + 1] - rate[gaps]) / (time[gaps + 1] - time[gaps])[:, None]
    step = time[gaps] - time[gaps - 1]
    missed = float(np.sum(step**2 / 12.0 * np.linalg.norm(after - before, axis=1)))
    own = float(np.linalg.norm(noise)) * samples**0.5 / recording.rate
    return float(step.max()) <= LONGEST_GAP and missed < own


# A value that a share of this size of a spin's samples has, and twice the share that any value has in the
# holds, is the end of scale: noise spreads over more codes than that.
CLIPPED_SHARE = 0.05


def find_saturated_axis(recording: Recording, holds: tuple[Hold, ...], start: int, stop: int) -> int | None:
    """Return the axis of the gyro that is clipped at a constant rate, or None.

    A run at the extreme value proves nothing there, because the fastest spin of a quantised gyro is at
    the recording's extreme value all along. What betrays clipping is that noise has gone: far more
    samples than any code has at rest are at the extreme.

    Parameters
    ----------
    recording, holds : raw samples, and the holds found in them.
    start, stop : samples of constant rate.
    """
    rate = recording.angular_rate
    if rate is None:
        return None
    lowest, highest = extremes(rate)
    for axis in range(3):
        piece = rate[start:stop, axis]
        same = 1e-9 * (highest[axis] - lowest[axis])
        clipped = max(np.sum(piece <= lowest[axis] + same), np.sum(piece >= highest[axis] - same))
        if clipped <= SATURATED_RUN or clipped <= CLIPPED_SHARE * len(piece):
            continue
        if clipped > 2.0 * _largest_share(rate[:, axis], holds, same) * len(piece):
            return axis
    return None


def _largest_share(values: np.ndarray, holds: tuple[Hold, ...], same: float) -> float:
    """Median over the holds of the share of samples that have the most frequent value."""
    shares: list[float] = []
    for hold in holds:
        piece = np.sort(values[hold.start : hold.stop])
        if len(piece) > 1:
            edges = np.flatnonzero(np.concatenate([[True], np.diff(piece) > same, [True]]))
            shares.append(float(np.diff(edges).max()) / len(piece))
    return float(np.median(shares)) if shares else 1.0


SHORTEST_SPIN_SECONDS = 0.8
# A gap in which a table can stop and start again: no spin goes across it.
LONGEST_HARMLESS_GAP = 0.25
# A rest that creeps is constant too, but turns by some degrees only (3 to 6 in the hand).
SMALLEST_ANGLE = np.radians(20.0)
# Half the time over which a rate must stay to be called steady.
STEADY_SECONDS = 0.25
# Share of the rate within which it is constant: a table's ripple is 0.1 %, and a gyro's g-sensitivity
# (0.002 rad/s per g) moves the rate of a spin about a horizontal axis by 1 % at 10 deg/s.
STEADY = 0.02
# Share of the rate by which the ends may differ from it, and at which drift or bow betray a turn.
SETTLED = 0.004
LARGEST_DRIFT = 0.006
NOISE_SIGMAS = 5.0
# Share of the rate by which a rate that follows without a stop must differ to be another one.
OTHER_RATE = 0.15
# The part of a minimum-jerk turn, v = 16 x² (1 - x)² of its top, within a share e of the top is
# 2 sqrt(1/4 - sqrt(1 - e) / 4): 10 % of its time at 2 %. A plateau must be longer by this factor.
SAFETY = 1.8
EDGE_SECONDS = 0.2
# The gyros' g-sensitivity is taken from so many holds or more, if it leaves less than this share of the
# scatter of their rates.
LEAST_HOLDS = 8
CLEARLY = 0.5


@dataclass(frozen=True)
class FoundSpin:
    """The constant-rate part of a motion: samples `start` up to `stop`, without its ramps.

    `turn` is the index of the timeline's turn that it lies in; None before the first hold and after the
    last. `usable` is False where the gyro is saturated, and `reason` says so.
    """

    start: int
    stop: int
    turn: int | None
    usable: bool = True
    reason: str = ""


def find_spins(recording: Recording, timeline: Timeline) -> list[FoundSpin]:
    """Find the stretches of constant rate between holds, in order.

    Parameters
    ----------
    recording, timeline : raw samples, any units, and the holds found in them. Without a gyro there are
        no spins to be seen.
    """
    if recording.angular_rate is None:
        return []
    search = SpinSearch.of(recording, timeline)
    edges = [0, *(i for hold in timeline.holds for i in (hold.start, hold.stop)), len(recording)]
    spins: list[FoundSpin] = []
    for number, (start, stop) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        turn = number - 1 if 0 < number < len(timeline.holds) else None
        for piece in _between_gaps(recording, start, stop):
            for first, last in search.plateaus(*piece):
                spins.append(judge_spin(recording, timeline, FoundSpin(first, last, turn)))
    return spins


def _between_gaps(recording: Recording, start: int, stop: int) -> list[tuple[int, int]]:
    """The pieces of a range between gaps in which the unit may have been stopped: recordings joined."""
    long = [
        gap
        for gap in recording.gaps
        if start < gap < stop and recording.time[gap] - recording.time[gap - 1] > LONGEST_HARMLESS_GAP
    ]
    return list(pairwise([start, *long, stop]))


def judge_spin(recording: Recording, timeline: Timeline, spin: FoundSpin) -> FoundSpin:
    """Return the spin, unusable where an axis of the gyro is at its end of scale.

    Parameters
    ----------
    recording, timeline : raw samples, and the holds found in them.
    spin : a stretch of constant rate.
    """
    axis = find_saturated_axis(recording, timeline.holds, spin.start, spin.stop)
    if axis is None:
        return spin
    return replace(
        spin, usable=False, reason=f"the gyro's {AXES[axis]} axis is at its extreme value: saturated"
    )


@dataclass(frozen=True)
class SpinSearch:
    """What the search for plateaus looks at.

    Attributes
    ----------
    blocks : of the whole recording.
    rate, speed : (blocks, 3) smoothed rate without bias and, where the holds show one, g-sensitivity, and its
        length, raw units.
    sigma : scatter of the rate at rest (length of the three axes' vector), raw units.
    scale : rad/s per raw unit, roughly.
    """

    blocks: Blocks
    rate: Vectors
    speed: Series
    sigma: float
    scale: float

    @staticmethod
    def of(recording: Recording, timeline: Timeline) -> SpinSearch:
        """Return the search of a recording that has a gyro; bias and noise come from the holds.

        Parameters
        ----------
        recording, timeline : raw samples, and the holds found in them.
        """
        blocks = cut_blocks(recording)
        assert blocks.angular_rate is not None
        smooth = blocks.angular_rate.smooth
        force = None if blocks.specific_force is None else blocks.specific_force.smooth
        levels: list[Vector] = []
        forces: list[Vector] = []
        scatters: list[Vector] = []
        for hold in timeline.holds:
            first = -(-hold.start // blocks.size)
            inside = slice(first, max(hold.stop // blocks.size, first + 1))
            values = smooth[inside]
            if len(values):
                levels.append(median(values))
                scatters.append(1.4826 * median(np.abs(values - levels[-1])))
                forces.append(np.zeros(3) if force is None else median(force[inside]))
        bias = median(np.array(levels)) if levels else np.zeros(3)
        sigma = float(np.linalg.norm(median(np.array(scatters)))) if scatters else 0.0
        rate = smooth - bias
        sensitivity = None if force is None else _g_sensitivity(np.array(levels), np.array(forces))
        if force is not None and sensitivity is not None:
            rate = smooth - np.mean(levels, axis=0) - (force - np.mean(forces, axis=0)) @ sensitivity
        scale = find_activity(blocks).rate_scale or 1.0
        return SpinSearch(blocks, rate, np.linalg.norm(rate, axis=1), sigma, scale)

    def plateaus(self, start: int, stop: int) -> list[tuple[int, int]]:
        """Return the sample ranges of constant rate within a range of samples, in order.

        Parameters
        ----------
        start, stop : samples; motion, or what is known to hold spins. Whether the timeline has holds in
            it is not heeded: the steadiest spin of a recording without any rest is taken for one.
        """
        size = self.blocks.size
        first, last = -(-start // size), stop // size
        if last - first < 3:
            return []
        rate, speed = self.rate[first:last], self.speed[first:last]
        lag = max(2, round(STEADY_SECONDS / self.blocks.seconds))
        index = np.arange(last - first)
        change = np.linalg.norm(
            rate[np.minimum(index + lag, last - first - 1)] - rate[np.maximum(index - lag, 0)], axis=1
        )
        # two smoothed blocks differ by sqrt(2) of one's scatter
        limit = np.maximum(1.5 * STEADY * speed, 1.5 * NOISE_SIGMAS * self.sigma)
        steady = (change < limit) & (speed > 2.0 * NOISE_SIGMAS * self.sigma)
        runs = [run for run in find_runs(steady) if run[1] - run[0] >= self._shortest // 2]
        found: list[tuple[int, int]] = []
        for run in runs:
            plateau = self._plateau(rate, run, runs)
            if plateau is None:
                continue
            begin, end = self._samples(plateau, first, last - first, (start, stop))
            if end - begin >= max(2.0, 0.5 * self._shortest * size) and (not found or begin >= found[-1][1]):
                found.append((begin, end))
        return found

    @property
    def _shortest(self) -> int:
        return max(4, round(SHORTEST_SPIN_SECONDS / self.blocks.seconds))

    def _plateau(
        self, rate: Vectors, run: tuple[int, int], runs: list[tuple[int, int]]
    ) -> tuple[float, float] | None:
        """The plateau in a steady run, in blocks; None if it is none."""
        level = median(rate[run[0] : run[1]])
        height = float(np.linalg.norm(level))
        away = np.linalg.norm(rate - level, axis=1)
        tolerance = max(STEADY * height, NOISE_SIGMAS * self.sigma)
        near = [r for r in find_runs(away < tolerance) if r[0] < run[1] and r[1] > run[0]]
        if not near or tolerance > 0.3 * height:
            return None
        a, b = max(near, key=lambda piece: piece[1] - piece[0])
        if b - a < self._shortest or height * self.scale * (b - a) * self.blocks.seconds < SMALLEST_ANGLE:
            return None
        others = [other for other in runs if other[1] <= a or other[0] >= b]
        if not _is_long(away, a, b, height, tolerance, others) or not self._is_flat(rate[a:b], height):
            return None
        settled = max(SETTLED * height, 0.8 * NOISE_SIGMAS * self.sigma)
        return (
            a + self._settling(away[:b][::-1], b - a, settled),
            b - self._settling(away[a:], b - a, settled),
        )

    def _is_flat(self, values: Vectors, height: float) -> bool:
        """Whether the rate is the same at both ends and in the middle of the plateau."""
        margin = min(self.blocks.half_width, len(values) // 6)
        values = values[margin : len(values) - margin]
        third = max(len(values) // 3, 1)
        left, middle, right = (np.mean(values[k * third : (k + 1) * third], axis=0) for k in range(3))
        drift = float(np.linalg.norm(right - left))
        bow = float(np.linalg.norm(middle - 0.5 * (left + right)))
        # smoothed blocks are correlated over some four
        noise = 4.0 * self.sigma * np.sqrt(2.0 * 4.0 / third)
        return bool(max(drift, bow) < LARGEST_DRIFT * height + noise)

    def _settling(self, away: Series, length: int, settled: float) -> float:
        """Blocks from the outer end of the plateau inwards until the ramp is over.

        `away` runs from inside outwards. A ramp that ends as the cube of time (minimum jerk) is at eight
        times the limit as long before the place where it is at the limit as it ends behind it.
        """
        quiet = self.blocks.half_width
        inwards = away[:length][::-1]
        inside = inwards < settled
        k = 0
        while k < length // 3 and not inside[k : k + quiet].all():
            k += 1
        outwards = away[length - k :]
        steep = outwards > 8.0 * settled
        reach = int(np.argmax(steep)) if steep.any() else 0
        return k + min(reach, length // 6)

    def _samples(
        self, plateau: tuple[float, float], first: int, count: int, samples: tuple[int, int]
    ) -> tuple[int, int]:
        """The plateau in samples, with a margin where motion bounds it."""
        size, margin = self.blocks.size, max(1.0, EDGE_SECONDS / self.blocks.seconds)
        begin, end = plateau
        return (
            int(np.ceil((first + begin + margin) * size)) if begin > 0 else samples[0],
            int((first + end - margin) * size) if end < count else samples[1],
        )


def _g_sensitivity(levels: AnyArray, forces: AnyArray) -> Matrix | None:
    """What the holds' rates show of the force, raw units, for `rate = force @ ...`; None where nothing clear.

    A cheap gyro's (0.1 deg/s per g) moves the rate of a slow spin about a level axis by several per cent.
    """
    if len(levels) < LEAST_HOLDS:
        return None
    away, centred = levels - levels.mean(axis=0), forces - forces.mean(axis=0)
    # Directions that the poses do not tell have none.
    inverse: Matrix = np.asarray(np.linalg.pinv(centred, rcond=0.1), dtype=np.float64)
    found = inverse @ away
    left = float(np.sum((away - centred @ found) ** 2)) / (len(levels) - 4)
    return found if left < CLEARLY**2 * float(np.sum(away**2)) / (len(levels) - 1) else None


def _is_long(
    away: Series, a: int, b: int, height: float, tolerance: float, others: list[tuple[int, int]]
) -> bool:
    """Whether the plateau is long against the ramps beside it, which end at rest or at another rate."""
    ended = away > 0.9 * height
    for first, last in others:
        # a piece of the same plateau, or of a turn's blunt top, that noise has cut off is no other rate
        if np.median(away[first:last]) > max(OTHER_RATE * height, 2.0 * tolerance):
            ended[first:last] = True
    left = int(np.flatnonzero(ended[:a])[-1]) + 1 if ended[:a].any() else 0
    right = b + int(np.argmax(ended[b:])) if ended[b:].any() else len(away)
    top = 2.0 * np.sqrt(0.25 - np.sqrt(1.0 - tolerance / height) / 4.0)
    if left == a and right == b:
        return True
    # above a tenth of its top a minimum-jerk turn has 0.827 of its length
    return bool(b - a > SAFETY * top / 0.827 * (right - left))
