"""Rotations: what the gyros add up to while a table goes from one rest to the next.

A rotation about a fixed axis adds up in b, however unevenly the table turns: the integral of the rate
is the axis times the angle, which the table's display tells. Its ramps do not matter, its rate need not
be known. Where nothing was read off, or there is no rest beside the spin, the mean at the constant rate
serves instead, and the rate has to be known.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.errors import SegmentationError
from tumble.protocol import Protocol, SpinStep
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.matching import Matching
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.spin_means import SpinMeans
from tumble.segmentation.timeline import Hold, Timeline
from tumble.segmentation.turns import LONGEST_GAP

# Into the rests beside a rotation: a hold's edge is found to 0.2 s.
INTO_REST = 0.4  # s


@dataclass(frozen=True)
class Rotation:
    """One spin of the table, from rest to rest or at its constant rate.

    Attributes
    ----------
    row : index into `Matching.spins`.
    step : index into the protocol's steps.
    integral : (3,) raw·s, of the angular rate; with the bias and the Earth rate in it.
    covariance : (3, 3) of it.
    seconds : s, how long it took.
    angle : rad, the table's, with the sign of the protocol's rate about the protocol's axis.
    angle_sigma : rad.
    before, after : the holds beside it; None where it is not from rest to rest.
    start, stop : the samples at the constant rate.
    why : why it is not from rest to rest, as a phrase; empty if it is.
    """

    row: int
    step: int
    integral: Vector
    covariance: Matrix
    seconds: float
    angle: float
    angle_sigma: float
    before: int | None
    after: int | None
    start: int
    stop: int
    why: str = ""

    @property
    def is_from_rest(self) -> bool:
        """Whether it is integrated from rest to rest."""
        return not self.why


def observe_rotations(
    protocol: Protocol,
    recording: Recording,
    timeline: Timeline,
    matching: Matching,
    means: HoldMeans,
    spins: SpinMeans,
) -> list[Rotation]:
    """Integrate every matched spin from the rest before it to the rest after it.

    Parameters
    ----------
    protocol, recording, timeline, matching : what was to be done, and what was found of it.
    means : of the holds.
    spins : of the spins, in the order of `matching.spins`.

    Raises
    ------
    SegmentationError
        If the recording has no gyro.

    Notes
    -----
    Zhang et al. 2010, (15) to (17): the integral, not the rate, is what the table's angle determines. The
    Earth rate's part goes out of the difference of two directions only if both took the same time and
    turned through whole revolutions; a calibration knows the attitude and takes it out of any.
    """
    if recording.angular_rate is None or spins.angular_rate is None or means.angular_rate is None:
        raise SegmentationError("The recording has no gyro: rotations have nothing to add up.")
    observer = _Observer(protocol, recording, timeline, matching, means, spins)
    return [observer.rotation(row) for row in range(len(matching.spins))]


@dataclass(frozen=True)
class _Observer:
    """What was to be done and what was found, for one spin after the other."""

    protocol: Protocol
    recording: Recording
    timeline: Timeline
    matching: Matching
    means: HoldMeans
    spins: SpinMeans

    def rotation(self, row: int) -> Rotation:
        spin = self.matching.spins[row]
        step = self.protocol.steps[spin.step]
        assert isinstance(step, SpinStep)
        if step.angle is None:
            return self._at_constant_rate(row, step, "no angle was read off the table")
        holds = self.timeline.holds
        beside = _rests(holds, spin.start, spin.stop, self.matching, row)
        if beside is None:
            return self._at_constant_rate(row, step, "no rest beside it was found")
        start, stop = _edges(holds, beside, self.recording.rate)
        if _has_gap(self.recording, start, stop):
            return self._at_constant_rate(row, step, f"samples are missing for more than {LONGEST_GAP:g} s")
        return self._from_rest(row, step.angle, step.angle_sigma, beside, (start, stop))

    def _from_rest(
        self, row: int, angle: float, angle_sigma: float, beside: tuple[int, int], samples: tuple[int, int]
    ) -> Rotation:
        cut = slice(samples[0], samples[1] + 1)
        assert self.recording.angular_rate is not None
        time, rate = self.recording.time[cut], np.asarray(self.recording.angular_rate[cut], dtype=np.float64)
        dt = np.diff(time)
        summed = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt[:, None], axis=0)
        spin, seconds = self.matching.spins[row], float(time[-1] - time[0])
        return Rotation(
            row=row,
            step=spin.step,
            integral=summed[-1].copy(),
            covariance=self._density(row, beside) * seconds,
            seconds=seconds,
            angle=angle,
            angle_sigma=angle_sigma,
            before=beside[0],
            after=beside[1],
            start=spin.start,
            stop=spin.stop,
        )

    def _density(self, row: int, beside: tuple[int, int]) -> Matrix:
        """Variance of an integral per second: at the constant rate or at rest, whichever is the larger."""
        assert self.spins.angular_rate_covariance is not None
        assert self.means.angular_rate_covariance is not None
        density = self.spins.angular_rate_covariance[row] * float(self.spins.duration[row])
        for hold in beside:
            at_rest = self.means.angular_rate_covariance[hold] * float(self.means.duration[hold])
            density = np.maximum(density, at_rest)
        return np.asarray(density, dtype=np.float64)

    def _at_constant_rate(self, row: int, step: SpinStep, why: str) -> Rotation:
        """The mean at the constant rate, over the time that was averaged: the harmonics are out of it."""
        assert self.spins.angular_rate is not None
        assert self.spins.angular_rate_covariance is not None
        spin, seconds = self.matching.spins[row], float(self.spins.duration[row])
        return Rotation(
            row=row,
            step=spin.step,
            integral=np.asarray(self.spins.angular_rate[row] * seconds, dtype=np.float64),
            covariance=np.asarray(self.spins.angular_rate_covariance[row] * seconds**2, dtype=np.float64),
            seconds=seconds,
            angle=step.rate * seconds,
            angle_sigma=abs(step.rate) * seconds * step.rate_sigma,
            before=None,
            after=None,
            start=spin.start,
            stop=spin.stop,
            why=why,
        )


def _rests(
    holds: tuple[Hold, ...], start: int, stop: int, matching: Matching, row: int
) -> tuple[int, int] | None:
    """The last hold before a spin and the first after it, if no other spin lies between."""
    before = [k for k, hold in enumerate(holds) if hold.stop <= start]
    after = [k for k, hold in enumerate(holds) if hold.start >= stop]
    if not before or not after:
        return None
    left, right = before[-1], after[0]
    inside = [
        k
        for k, spin in enumerate(matching.spins)
        if k != row and spin.start >= holds[left].stop and spin.stop <= holds[right].start
    ]
    return None if inside else (left, right)


def _edges(holds: tuple[Hold, ...], beside: tuple[int, int], rate: float) -> tuple[int, int]:
    """Samples from a little within the one rest to a little within the other."""
    left, right = holds[beside[0]], holds[beside[1]]
    into = round(INTO_REST * rate)
    last = left.stretches()[-1]
    first = right.stretches()[0]
    return last[1] - 1 - min(into, (last[1] - last[0]) // 4), first[0] + min(into, (first[1] - first[0]) // 4)


def _has_gap(recording: Recording, start: int, stop: int) -> bool:
    steps = np.diff(recording.time[start : stop + 1])
    return bool(np.any(steps > max(LONGEST_GAP, 1.5 / recording.rate)))
