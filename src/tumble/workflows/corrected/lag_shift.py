"""Specific force put to the instants of the gyro's samples, where a calibration found a lag between the triads.

A sample of the accelerometer with the stamp t is of the instant t - lag, so that what belongs to the gyro's sample
there is the specific force with the stamp t + lag. It is interpolated between two samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.document import Calibration
from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording
from tumble.recording.samples import MagneticField, joined_fields

LAG = "lag of the accelerometer behind the gyro"
"""The name of the parameter in a calibration."""
_GAP = 2.5  # median steps between two samples, above which nothing is interpolated between them
_LONGEST = 1.0  # s
NEEDS_BOTH = (
    "--shift-lag puts the accelerometer on the gyro's clock: it takes a recording and a calibration of both."
)


def lag_of(calibration: Calibration) -> float:
    """Return the lag that a calibration found, in seconds.

    Raises
    ------
    UsageError
        If it found none.
    """
    found = [p.value for p in calibration.parameters if p.name == LAG]
    if not found:
        raise UsageError(
            "The calibration states no lag between the triads (it found none that differs from zero): leave "
            "--shift-lag out."
        )
    if abs(found[0]) > _LONGEST:
        raise UsageError(
            f"The calibration states a lag of {found[0]:.3g} s between the triads, which no unit has."
        )
    return found[0]


class ForceShift:
    """Specific force on its way to other instants, block after block.

    Attributes
    ----------
    lag : s, of the accelerometer behind the gyro.
    kept : number of samples so far at an end or a gap, which keep the specific force of the sample nearest in time.
    """

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self.kept = 0
        self._time: Series = np.empty(0, np.float64)
        self._force: Vectors = np.empty((0, 3), np.float64)
        self._answered = 0
        self._step: float | None = None

    def add(self, time: Series, force: Vectors) -> Vectors:
        """Take in the next samples; return the specific force that belongs to those that can be answered by now.

        Parameters
        ----------
        time, force : (n,) s and (n, 3).

        Raises
        ------
        RecordingError
            If stamps do not grow.
        """
        self._time = np.concatenate([self._time, time])
        self._force = np.concatenate([self._force, force])
        if self._time.size > 1 and bool(np.any(np.diff(self._time) <= 0.0)):
            raise RecordingError(
                "The stamps repeat or step back, and --shift-lag interpolates between them: cut the recording there, "
                "or leave --shift-lag out."
            )
        if self._time.size < 2:
            return np.empty((0, 3))
        wanted = self._time[self._answered :] + self.lag
        return self._answer(int(np.searchsorted(wanted, float(self._time[-1]), side="right")))

    def rest(self) -> Vectors:
        """Return the specific force that belongs to the samples that wait: at the end the last one."""
        return self._answer(self._time.size - self._answered)

    def _answer(self, count: int) -> Vectors:
        time, force = self._time, self._force
        at = time[self._answered : self._answered + count] + self.lag
        if not count or time.size < 2:
            self.kept += count
            answer = force[self._answered : self._answered + count]
        else:
            steps: Series = np.diff(time)
            self._step = self._step or float(np.median(steps))
            left = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
            width = time[left + 1] - time[left]
            share = np.clip((at - time[left]) / width, 0.0, 1.0)
            outside = (at < time[0]) | (at > time[-1])
            apart = outside | ((width > _GAP * self._step) & (share > 0.0) & (share < 1.0))
            self.kept += int(apart.sum())
            share = np.where(apart, np.round(share), share)[:, None]
            answer = force[left] + share * (force[left + 1] - force[left])
        self._answered += count
        # What lies before the next instant is not asked for any more.
        next_one = float(time[min(self._answered, time.size - 1)]) + min(self.lag, 0.0)
        first = int(np.searchsorted(time, next_one, side="right")) - 1
        first = max(min(first, self._answered), 0)
        self._time, self._force, self._answered = time[first:], force[first:], self._answered - first
        return answer

    def remarks(self) -> list[str]:
        """Say what was done."""
        way = "later" if self.lag > 0.0 else "earlier"
        words = "by which the calibration found that it lags behind the angular rate; stamps are the gyro's"
        told = [f"The specific force is taken {abs(1e3 * self.lag):.3g} ms {way}, {words}."]
        if self.kept:
            told.append(
                f"{self.kept} sample(s) at an end or a gap keep the specific force of the sample nearest in time."
            )
        return told


def shifted(blocks: Iterable[Recording], shift: ForceShift) -> Iterator[Recording]:
    """Yield corrected blocks with their specific force shifted.

    Parameters
    ----------
    blocks : with both triads.
    shift : for one recording.

    Raises
    ------
    UsageError
        If a triad is missing.
    """
    held: Recording | None = None
    for block in blocks:
        if block.specific_force is None or block.angular_rate is None:
            raise UsageError(NEEDS_BOTH)
        held = block if held is None else _joined(held, block)
        force = shift.add(block.time, block.specific_force)
        if len(force):
            yield replace(held.between(0, len(force)), specific_force=force)
        held = held.between(len(force), len(held)) if len(force) < len(held) else None
    if held is not None:
        yield replace(held, specific_force=shift.rest())


def _joined(first: Recording, second: Recording) -> Recording:
    """Return two consecutive blocks as one."""
    joined = {
        f.name: np.concatenate([getattr(first, f.name), getattr(second, f.name)])
        for f in fields(Recording)
        if isinstance(getattr(first, f.name), np.ndarray)
    }
    magnetic: list[MagneticField | None] = [
        m for m in (first.magnetic_field, second.magnetic_field) if m is not None
    ]
    return replace(first, gaps=(), magnetic_field=joined_fields(magnetic), **joined)
