"""The timeline of a recording: where the unit was held, where it was turned, what was left out."""

from __future__ import annotations

from tumble.arrays import Vector
from tumble.records import dataclass


@dataclass(frozen=True)
class Hold:
    """A stretch at rest: samples `start` up to `stop` without those in `excluded`.

    `excluded` are half-open index ranges inside the hold (a knock, a few bad samples); the pose
    before and after them is the same.
    """

    start: int
    stop: int
    excluded: tuple[tuple[int, int], ...] = ()

    def stretches(self) -> list[tuple[int, int]]:
        """Return the half-open index ranges that belong to the hold, in order."""
        ranges: list[tuple[int, int]] = []
        start = self.start
        for first, last in self.excluded:
            if first > start:
                ranges.append((start, first))
            start = last
        if self.stop > start:
            ranges.append((start, self.stop))
        return ranges


@dataclass(frozen=True)
class Turn:
    """The motion from hold number `before` to hold number `after`: samples `start` up to `stop`.

    `usable` is False where the angular rate cannot be integrated across it (a gap in the samples,
    a saturated gyro); `reason` then says why.
    """

    before: int
    after: int
    start: int
    stop: int
    usable: bool = True
    reason: str = ""


@dataclass(frozen=True)
class Rejection:
    """A stretch that is neither hold nor turn, with the reason as a phrase for the user."""

    start: int
    stop: int
    reason: str


@dataclass(frozen=True)
class NoiseFloor:
    """Per-sample standard deviations at rest, raw units, and what separates rest from motion.

    `threshold` is the rest/motion limit on the statistic that `statistic` names in words.
    """

    specific_force: Vector
    angular_rate: Vector
    threshold: float
    statistic: str


@dataclass(frozen=True)
class Timeline:
    """Holds and turns of one recording, in time order, with every rejected stretch."""

    holds: tuple[Hold, ...]
    turns: tuple[Turn, ...]
    rejections: tuple[Rejection, ...]
    noise_floor: NoiseFloor

    def __repr__(self) -> str:
        left_out = f", {len(self.rejections)} stretches left out" if self.rejections else ""
        return f"<Timeline: {len(self.holds)} holds, {len(self.turns)} turns{left_out}>"
