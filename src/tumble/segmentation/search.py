"""Finding holds and turns in a recording that nobody has described.

A *hold* is a stretch in which the attitude stays. The search looks at block means smoothed over
0.15 s, which keep the slow beginning of a turn and lose hand tremor and motor vibration; takes bias,
noise and scale from the recording itself (`activity`); refines each end against the hold's own
scatter; and then asks physics: a pose that creeps is no hold, and two rests with the same specific
force and no net turn between them are one hold with a knock in it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from tumble.border import border
from tumble.errors import SegmentationError
from tumble.files import lines_of, number_of, read_text, reading
from tumble.recording import Recording
from tumble.segmentation.activity import Activity, find_activity, noise_per_sample
from tumble.segmentation.blocks import Blocks, cut_blocks, find_runs
from tumble.segmentation.creep import LARGEST_CREEP, find_turning, keep_still_part
from tumble.segmentation.stretches import (
    LARGEST_LOSS_SECONDS,
    SHORTEST_PIECE_SECONDS,
    Stretch,
    join_stretches,
    leave_out_knocks,
    shape_stretch,
    usual_scatter,
)
from tumble.segmentation.timeline import Hold, NoiseFloor, Rejection, Timeline
from tumble.segmentation.turns import LONGEST_HARMLESS_GAP, find_turns

MINIMUM_HOLD = 0.7
# Rests shorter than this are moments of a turn and not worth a word.
SHORTEST_MENTIONED = 0.3
FARTHEST_TILT = np.radians(2.0)
# Samples of a hold that knocks leave: of fewer no mean has an uncertainty.
FEWEST_SAMPLES = 8
STATISTIC = "angular rate without bias, smoothed over 0.15 s, in approximate rad/s"


@border
def find_timeline(
    recording: Recording,
    *,
    minimum_hold: float = MINIMUM_HOLD,
    intervals: Sequence[tuple[float, float]] | None = None,
) -> Timeline:
    """Find where the unit was held still and where it was turned.

    Nothing is to be tuned: noise, bias and scale are found in the recording, in whatever units it
    has. See the module's text for how, and ``docs/segmentation.md`` for how well.

    Parameters
    ----------
    recording : with an accelerometer, a gyro, or both; raw units.
    minimum_hold : seconds at rest that make a hold.
    intervals : (start, stop) of the holds in seconds on the recording's clock; they replace the
        search.

    Raises
    ------
    SegmentationError
        If the recording is too short or has neither triad, if no hold is found, or if `intervals`
        overlap or reach outside the recording.
    """
    blocks = _blocks_of(recording)
    activity = find_activity(blocks)
    if intervals is not None:
        holds, rejections = holds_of_intervals(recording, intervals), []
    else:
        walls = _walls(recording, blocks)
        holds, rejections = search_blocks(
            blocks, activity, walls, samples=len(recording), minimum_hold=minimum_hold
        )
    if not holds:
        raise SegmentationError(_nothing_found(rejections, minimum_hold))
    turns = find_turns(recording, holds, activity)
    return Timeline(
        tuple(holds),
        tuple(turns),
        tuple(
            sorted([*rejections, *_outside(recording, holds, intervals is not None)], key=lambda r: r.start)
        ),
        _noise_floor(recording, holds, activity),
    )


def _blocks_of(recording: Recording) -> Blocks:
    if recording.specific_force is None and recording.angular_rate is None:
        raise SegmentationError(
            "The recording has neither accelerometer nor gyro: there is nothing to search."
        )
    blocks = cut_blocks(recording)
    if len(blocks) < 20:
        # A mistaken unit of time makes minutes out of hours.
        doubts = "".join(f" {remark.text}" for remark in recording.remarks if remark.kind == "doubtful")
        raise SegmentationError(
            f"The recording has {len(recording)} samples ({recording.duration:.2f} s); "
            f"finding holds takes at least one second.{doubts}"
        )
    return blocks


def _walls(recording: Recording, blocks: Blocks) -> np.ndarray:
    """Blocks that begin after, or contain, a gap long enough for a turn to hide in."""
    long = [i for i in recording.gaps if recording.time[i] - recording.time[i - 1] > LONGEST_HARMLESS_GAP]
    return np.minimum(np.asarray(long, dtype=int) // blocks.size, len(blocks) - 1)


def search_blocks(
    blocks: Blocks,
    activity: Activity,
    walls: np.ndarray,
    *,
    samples: int,
    minimum_hold: float = MINIMUM_HOLD,
) -> tuple[list[Hold], list[Rejection]]:
    """Return the holds in blocks, and the rests that are none, each with its reason.

    Parameters
    ----------
    blocks, activity : a whole recording, or as much of one as there is so far.
    walls : blocks that no hold goes across.
    samples : how many samples there are, those after the last whole block included.
    minimum_hold : seconds at rest that make a hold.
    """
    stretches = join_stretches(blocks, activity, _rests(blocks, activity, walls), walls)
    holds: list[Hold] = []
    rejections: list[Rejection] = []
    long: list[Stretch] = []
    for stretch in stretches:
        stretch, creep = keep_still_part(blocks, activity, stretch)
        seconds = stretch.length * blocks.seconds
        if seconds < minimum_hold:
            reason = f"at rest for only {seconds:.1f} s, shorter than {minimum_hold:.2g} s"
        elif creep:
            reason = f"creeps by {np.degrees(creep):.1f}° in {seconds:.1f} s"
        else:
            long.append(stretch)
            continue
        if seconds >= SHORTEST_MENTIONED:
            rejections.append(_rejection(blocks, stretch, samples, reason))
    for stretch, turned in zip(long, find_turning(blocks, activity, long), strict=True):
        if turned > LARGEST_CREEP:
            reason = f"turns by {np.degrees(turned):.1f}° in {stretch.length * blocks.seconds:.1f} s"
            rejections.append(_rejection(blocks, stretch, samples, reason))
        else:
            hold = _hold(blocks, stretch, samples)
            if sum(last - first for first, last in hold.stretches()) < FEWEST_SAMPLES:
                reason = "shakes all along: next to nothing of it is at rest"
                rejections.append(Rejection(hold.start, max(hold.stop, hold.start), reason))
            else:
                holds.append(hold)
    return holds, rejections


def _rests(blocks: Blocks, activity: Activity, walls: np.ndarray) -> list[Stretch]:
    """Every run of resting blocks with its ends found and its knocks marked."""
    rest = activity.rate < activity.threshold
    rest[walls] = False
    runs = [(a, b) for a, b in find_runs(rest) if b - a >= max(blocks.half_width, 2)]
    barriers = np.unique(np.concatenate([[0, len(blocks)], walls, walls + 1, *[list(r) for r in runs]]))
    floor = usual_scatter(blocks, runs)
    stretches: list[Stretch] = []
    for first, last in runs:
        lowest = barriers[np.searchsorted(barriers, first) - 1] if first > 0 else 0
        highest = barriers[np.searchsorted(barriers, last) + 1] if last < len(blocks) else last
        at_wall = bool(np.isin(first - 1, walls)), bool(np.isin(last, walls))
        stretch = shape_stretch(
            blocks,
            first,
            last,
            lowest=first if at_wall[0] else int(lowest),
            highest=last if at_wall[1] else int(highest),
            bounded=(first > 0, last < len(blocks)),
            floor=floor,
            farthest=_farthest(activity),
        )
        stretches.append(stretch)
    _part(stretches, activity)
    leave_out_knocks(blocks, stretches, activity)
    return stretches


def _part(stretches: list[Stretch], activity: Activity) -> None:
    """Draw back the ends of neighbours that both claim the ground between, to the liveliest block of it."""
    for before, after in pairwise(stretches):
        if before.stop > after.start:
            peak = before.last + int(np.argmax(activity.rate[before.last : after.first]))
            before.stop, after.start = min(before.stop, float(peak)), max(after.start, peak + 1.0)


def _farthest(activity: Activity) -> float:
    """Raw units by which the gyro, or without one the specific force, may leave a rest's level."""
    if activity.rate_scale is not None:
        return activity.threshold / activity.rate_scale
    return FARTHEST_TILT * (activity.gravity or 1.0)


def _rejection(blocks: Blocks, stretch: Stretch, samples: int, reason: str) -> Rejection:
    hold = _hold(blocks, stretch, samples)
    return Rejection(hold.start, hold.stop, reason)


def _hold(blocks: Blocks, stretch: Stretch, total: int) -> Hold:
    size, rate = blocks.size, blocks.size / blocks.seconds
    start = int(np.ceil(stretch.start * size))
    stop = total if stretch.last == len(blocks) == stretch.stop else min(int(stretch.stop * size), total)
    holes = [(max(a * size, start), min(b * size, stop)) for a, b in stretch.excluded]
    holes = _united([(a, b) for a, b in holes if b > a])
    shortest, most = SHORTEST_PIECE_SECONDS * rate, LARGEST_LOSS_SECONDS * rate
    while holes and holes[0][0] - start < shortest and holes[0][1] - start < most:
        start = holes.pop(0)[1]
    while holes and stop - holes[-1][1] < shortest and stop - holes[-1][0] < most:
        stop = holes.pop()[0]
    return Hold(start, stop, tuple(holes))


def _united(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    united: list[tuple[int, int]] = []
    for a, b in sorted(ranges):
        if united and a <= united[-1][1]:
            united[-1] = (united[-1][0], max(b, united[-1][1]))
        else:
            united.append((a, b))
    return united


def _outside(recording: Recording, holds: list[Hold], given: bool) -> list[Rejection]:
    """What lies before the first and after the last hold: motion, as far as the search knows."""
    what = "outside the given intervals" if given else "motion"
    rejections: list[Rejection] = []
    if holds[0].start > 0:
        rejections.append(Rejection(0, holds[0].start, f"{what}, before the first hold"))
    if holds[-1].stop < len(recording):
        rejections.append(Rejection(holds[-1].stop, len(recording), f"{what}, after the last hold"))
    return rejections


def _noise_floor(recording: Recording, holds: list[Hold], activity: Activity) -> NoiseFloor:
    force, rate = recording.specific_force, recording.angular_rate
    unknown = np.full(3, np.nan)
    return NoiseFloor(
        unknown if force is None else noise_per_sample(force, holds),
        unknown if rate is None else noise_per_sample(rate, holds),
        activity.threshold,
        STATISTIC
        if rate is not None
        else STATISTIC.replace("angular rate without bias", "turning of the specific force"),
    )


def _nothing_found(rejections: list[Rejection], minimum_hold: float) -> str:
    why = f": the unit is nowhere at rest for {minimum_hold:.1f} s"
    if rejections:
        reason = rejections[0].reason
        was = "was " if reason.startswith("at rest") else ""
        why = f"; the first candidate was left out because it {was}{reason}"
    return f"No hold was found{why}. Keep each pose for three seconds or more, or give the holds in an interval file."


def read_intervals(path: str | Path) -> list[tuple[float, float]]:
    """Read the holds' start and stop times from a text file, one hold a line.

    Columns are separated by spaces, tabs, commas or semicolons; empty lines and lines that begin
    with ``#`` are skipped, and so is one line of column names at the top.

    Parameters
    ----------
    path : of the file; seconds on the recording's own clock.

    Raises
    ------
    SegmentationError
        If the file cannot be read or is empty, or a line is not two numbers, stops before it starts,
        or overlaps or precedes the line before it; the message names the line.
    """
    with reading(Path(path), "a list of intervals", SegmentationError):
        lines = lines_of(read_text(Path(path)))
    intervals: list[tuple[float, float]] = []
    names_allowed = True
    for number, line in enumerate(lines, start=1):
        words = re.split(r"[,;\s]+", line.strip().strip(",;"))
        if words == [""] or words[0].startswith("#"):
            continue
        values = [value for value in map(_number, words) if value is not None]
        is_names = names_allowed and len(words) == 2 and not values
        names_allowed = False
        if is_names:
            continue
        where = f"{path}, line {number}"
        if not len(words) == len(values) == 2:
            raise SegmentationError(
                f"{where}: {line.strip()[:40]!r} is not two numbers, start and stop in seconds."
            )
        start, stop = values
        if stop <= start:
            raise SegmentationError(f"{where}: the interval ends at {stop:g} s, not after {start:g} s.")
        if intervals and start < intervals[-1][1]:
            raise SegmentationError(
                f"{where}: the interval starts at {start:g} s, before the one above it "
                f"stops ({intervals[-1][1]:g} s); put the holds in order and apart."
            )
        intervals.append((start, stop))
    if not intervals:
        raise SegmentationError(
            f"{path}: the interval file holds no intervals; write start and stop in seconds, one hold a line."
        )
    return intervals


def _number(word: str) -> float | None:
    try:
        return number_of(word)
    except ValueError:
        return None


def holds_of_intervals(recording: Recording, intervals: Sequence[tuple[float, float]]) -> list[Hold]:
    """Return the holds that the user's intervals name.

    Parameters
    ----------
    recording : whose clock the intervals are on.
    intervals : (start, stop) in seconds, in order.

    Raises
    ------
    SegmentationError
        If an interval is empty, overlaps the one before, reaches beyond the recording or has fewer
        than two samples.
    """
    if not intervals:
        raise SegmentationError(
            "No intervals were given; name at least one hold by its start and stop in seconds."
        )
    holds: list[Hold] = []
    first, last = float(recording.time[0]), float(recording.time[-1])
    # half a sample: stamps that were rounded on their way through a text file still fit
    slack = 0.5 / recording.rate
    stopped = -np.inf
    for number, (start, stop) in enumerate(intervals, start=1):
        told = f"Interval {number} ({start:g} to {stop:g} s)"
        if not start < stop:
            raise SegmentationError(f"{told} stops before it starts.")
        if start < stopped:
            raise SegmentationError(f"{told} overlaps the one before it, which stops at {stopped:g} s.")
        if start < first - slack or stop > last + 2 * slack + slack:
            raise SegmentationError(
                f"{told} reaches beyond the recording, which goes from {first:g} to {last:g} s."
            )
        a, b = (int(i) for i in np.searchsorted(recording.time, [start, stop]))
        if b - a < 2:
            raise SegmentationError(f"{told} holds {b - a} samples; a hold takes at least two.")
        holds.append(Hold(a, b))
        stopped = stop
    return holds
