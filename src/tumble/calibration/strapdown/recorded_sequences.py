"""Rotation sequences cut from a recording, each checked against what the protocol says was turned.

Between the hold at a sequence's start and the one at its end the gyros say what was turned, one axis after
the other. A sequence that was turned another way, about another axis or in another order is left out with
the reason; the errors that it was made for are then told by others, or not at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tumble.arrays import Matrix, Vector, Vectors
from tumble.earth import Site
from tumble.protocol import Pose, Protocol, TurnStep
from tumble.protocol.steps import HoldStep
from tumble.protocol.strapdown_rotation import AXES, SequenceSteps, sequence_steps
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Hold, Timeline
from tumble.segmentation.matching import Matching

# s of each measurement at rest, as the paper has it; a shorter hold gives a shorter one.
MEASURE = 10.0
# s without samples that may be put in between their neighbours, or one sample: where a rotation begins or ends, 25°/s²
# makes 10 µrad of them.
BRIDGED = 0.01
# An axis of a rotation within this of a body axis is it.
_ALONG = 0.999
# Of a sequence's fastest rate, what counts as turning; and the least angle that is a rotation, rad.
TURNING, SMALLEST_ROTATION = 0.2, np.radians(20.0)
# The angle turned about an axis may be off by this share of it and this much, rad: scale factors of counts, play.
ANGLE_SHARE, ANGLE_SLACK = 0.05, np.radians(10.0)


@dataclass(slots=True)
class RecordedSequence:
    """One sequence of a recording.

    Attributes
    ----------
    name : as table 1 has it, or the protocol.
    rotations : (axis, angle) as the protocol says.
    down_start : (3,) nominal unit vector down in b at the start.
    earth_rate_start : (3,) rad/s in b at the start, as far as it is known.
    unknown_rate : rad/s, of the Earth rate that is not known there.
    sigma : rad, of the start's attitude.
    time_step : s between samples.
    force, rate : (samples, 3) raw, from the start of the first measurement to the end of the last.
    start, end : sample ranges of the two measurements.
    """

    name: str
    rotations: list[tuple[int, float]]
    down_start: Vector
    earth_rate_start: Vector
    unknown_rate: float
    sigma: float
    time_step: float
    force: Vectors
    rate: Vectors
    start: tuple[int, int]
    end: tuple[int, int]

    @property
    def seconds(self) -> float:
        """From the first sample to the last."""
        return self.time_step * len(self.rate)

    @property
    def vector(self) -> Vector:
        """(3,) rad, the sum of the rotations about each body axis: what the rates add up to."""
        total = np.zeros(3)
        for axis, angle in self.rotations:
            total[axis] += angle
        return total

    def turned(self, bias: Vector) -> Vector:
        """Return (3,) raw·s, what the rates add up to without a bias.

        Parameters
        ----------
        bias : (3,) raw.
        """
        return np.asarray(self.time_step * np.sum(self.rate - bias, axis=0), dtype=np.float64)


def cut_sequences(
    protocol: Protocol, recording: Recording, timeline: Timeline, matching: Matching, site: Site
) -> tuple[list[RecordedSequence], list[str]]:
    """Return the sequences that were found whole, and sentences on those that were not.

    Parameters
    ----------
    protocol, recording, timeline, matching : what was to be done, and what was found of it.
    site : its latitude gives the Earth rate.
    """
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    found: dict[int, list[int]] = {}
    for matched in matching.holds:
        found.setdefault(matched.step, []).append(matched.hold)
    sequences: list[RecordedSequence] = []
    words: list[str] = []
    for steps in sequence_steps(protocol):
        rotations = _rotations(protocol, steps)
        first = protocol.steps[steps.start]
        assert isinstance(first, HoldStep)
        if isinstance(rotations, str):
            words.append(f"Sequence {steps.name} {rotations}.")
            continue
        if first.pose is None:
            words.append(f"Sequence {steps.name} starts in a pose that the protocol does not give.")
            continue
        pairs = _pairs(found.get(steps.start, []), found.get(steps.end, []))
        if not pairs:
            words.append(f"Sequence {steps.name} was not found: {_missing(steps, found)}.")
        for before, after in pairs:
            cut = _cut(recording, timeline.holds[before], timeline.holds[after])
            if isinstance(cut, str):
                words.append(f"Sequence {steps.name} was left out: {cut}.")
                continue
            earth, unknown = _earth_rate(first.pose, site)
            sequences.append(
                RecordedSequence(
                    steps.name,
                    rotations,
                    np.asarray(-first.pose.up_b / np.linalg.norm(first.pose.up_b), dtype=np.float64),
                    earth,
                    unknown,
                    first.pose.sigma,
                    1.0 / recording.rate,
                    cut.force,
                    cut.rate,
                    cut.start,
                    cut.end,
                )
            )
    return sequences, words


def _rotations(protocol: Protocol, steps: SequenceSteps) -> list[tuple[int, float]] | str:
    """The rotations of a sequence about body axes, or why they are none."""
    rotations: list[tuple[int, float]] = []
    for number in steps.turns:
        turn = protocol.steps[number]
        assert isinstance(turn, TurnStep)
        assert turn.axis_b is not None
        assert turn.angle is not None
        unit = turn.axis_b / np.linalg.norm(turn.axis_b)
        axis = int(np.argmax(np.abs(unit)))
        if abs(unit[axis]) < _ALONG:
            return f"turns about an axis (step {number + 1}) that is none of the unit's x, y, z, which the model needs"
        rotations.append((axis, float(np.sign(unit[axis])) * turn.angle))
    return rotations


def _pairs(starts: Sequence[int], ends: Sequence[int]) -> list[tuple[int, int]]:
    """Each start with the next end after it: a sequence that was repeated is there twice."""
    pairs: list[tuple[int, int]] = []
    for start in sorted(starts):
        later = [end for end in sorted(ends) if end > start]
        following = [other for other in sorted(starts) if other > start]
        if later and not (following and following[0] < later[0]):
            pairs.append((start, later[0]))
    return pairs


def _missing(steps: SequenceSteps, found: dict[int, list[int]]) -> str:
    lacking = [
        words for words, step in (("its start", steps.start), ("its end", steps.end)) if not found.get(step)
    ]
    if not lacking:
        return "its end comes before its start"
    verb = "is" if len(lacking) == 1 else "are"
    return f"{' and '.join(lacking)} (steps {steps.start + 1} to {steps.end + 1}) {verb} missing"


class _Cut(NamedTuple):
    """Samples (n, 3) raw of a sequence, and the ranges of its measurements at both ends."""

    force: Vectors
    rate: Vectors
    start: tuple[int, int]
    end: tuple[int, int]


def _cut(recording: Recording, before: Hold, after: Hold) -> _Cut | str:
    """The samples of a sequence and of its measurements within them, or why there are none.

    Samples that are missing singly are put in between their neighbours: the steps of a sequence are counted.
    """
    last, first = before.stretches()[-1], after.stretches()[0]
    count = round(MEASURE * recording.rate)
    begin, stop = max(last[0], last[1] - count), min(first[1], first[0] + count)
    time = recording.time[begin:stop]
    missing = np.maximum(np.round(np.diff(time) * recording.rate).astype(int) - 1, 0)
    most = int(missing[last[1] - begin - 1 : first[0] - begin].max(initial=0))
    if most > max(1, round(BRIDGED * recording.rate)):
        return f"{most} samples are missing one after another while it turned, and by how much meanwhile is not known"
    # Where a sample stands once those that are missing are put in.
    place = np.arange(time.size) + np.concatenate([[0], np.cumsum(missing)])
    whole = int(place[-1]) + 1

    def filled(values: Vectors) -> Vectors:
        made = np.zeros((whole, 3))
        for axis in range(3):
            made[:, axis] = np.interp(np.arange(whole), place, values[begin:stop, axis])
        return made

    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    ends = (0, int(place[last[1] - begin - 1]) + 1), (int(place[first[0] - begin]), whole)
    return _Cut(filled(recording.specific_force), filled(recording.angular_rate), *ends)


def _earth_rate(pose: Pose, site: Site) -> tuple[Vector, float]:
    """The Earth rate in b at the start of a sequence, and how much of it is not known."""
    from tumble.earth import EARTH_RATE

    up = pose.up_b / np.linalg.norm(pose.up_b)
    if site.latitude is None:
        return np.zeros(3), EARTH_RATE
    if pose.heading is None:
        vertical = EARTH_RATE * float(np.sin(site.latitude))
        return np.asarray(vertical * up, dtype=np.float64), EARTH_RATE * float(np.cos(site.latitude))
    return np.asarray(pose.rotation_nb().inv().apply(site.earth_rate_n), dtype=np.float64), 0.0


def check_rotations(
    sequences: list[RecordedSequence], inverse: Matrix, bias: Vector
) -> tuple[list[RecordedSequence], list[str]]:
    """Return the sequences that were turned as the protocol says, and sentences on the others.

    Parameters
    ----------
    sequences : as they were cut.
    inverse : (3, 3) rough rad/s per raw unit of the gyros.
    bias : (3,) rough, raw.
    """
    kept: list[RecordedSequence] = []
    words: list[str] = []
    for sequence in sequences:
        shown = _shown(sequence, inverse, bias)
        wanted = [(axis, angle) for axis, angle in sequence.rotations]
        if _alike(shown, wanted):
            kept.append(sequence)
        else:
            words.append(
                f"Sequence {sequence.name} was left out: the protocol has {_listed(wanted)}, and the gyros saw "
                f"{_listed(shown)}."
            )
    return kept, words


def _shown(sequence: RecordedSequence, inverse: Matrix, bias: Vector) -> list[tuple[int, float]]:
    """The rotations that the gyros saw: runs about one axis, one way."""
    rate = (sequence.rate - bias) @ inverse.T
    size = np.max(np.abs(rate), axis=1)
    axis = np.argmax(np.abs(rate), axis=1)
    way = np.sign(rate[np.arange(len(rate)), axis]).astype(int)
    turning = size > TURNING * np.quantile(size, 0.98)
    found: list[tuple[int, int, float]] = []
    for k in range(3):
        for sign in (1, -1):
            here = turning & (axis == k) & (way == sign)
            edges: list[int] = np.flatnonzero(np.diff(np.concatenate([[0], here.astype(int), [0]]))).tolist()
            for first, last in zip(edges[::2], edges[1::2], strict=True):
                found.append((first, k, float(sequence.time_step * np.sum(rate[first:last, k]))))
    return _joined(found)


def _joined(pieces: list[tuple[int, int, float]]) -> list[tuple[int, float]]:
    """Pieces in order of time, those of one axis and way one after another as one, without slivers."""
    joined: list[tuple[int, float]] = []
    for _, axis, angle in sorted(pieces):
        if abs(angle) < 0.2 * SMALLEST_ROTATION:
            continue
        if joined and joined[-1][0] == axis and joined[-1][1] * angle > 0.0:
            joined[-1] = (axis, joined[-1][1] + angle)
        else:
            joined.append((axis, angle))
    return [piece for piece in joined if abs(piece[1]) > SMALLEST_ROTATION]


def _alike(shown: list[tuple[int, float]], wanted: list[tuple[int, float]]) -> bool:
    merged: list[tuple[int, float]] = []
    for axis, angle in wanted:
        if merged and merged[-1][0] == axis and merged[-1][1] * angle > 0.0:
            merged[-1] = (axis, merged[-1][1] + angle)
        else:
            merged.append((axis, angle))
    return len(shown) == len(merged) and all(
        one[0] == other[0] and abs(one[1] - other[1]) < ANGLE_SLACK + ANGLE_SHARE * abs(other[1])
        for one, other in zip(shown, merged, strict=True)
    )


def _listed(rotations: list[tuple[int, float]]) -> str:
    """Return rotations as table 1 writes them.

    Examples
    --------
    >>> _listed([(1, np.pi), (2, -np.pi / 2)])
    '+180° y, -90° z'
    """
    words = [f"{round(float(np.degrees(angle))):+d}° {AXES[axis]}" for axis, angle in rotations]
    return ", ".join(words) or "no rotation"
