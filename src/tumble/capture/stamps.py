"""One clock that only goes forward, whatever the unit's clock does."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tumble.recording import Samples
from tumble.sample_rates import CRYSTAL

# s that a clock may step ahead or back before it is said: longer silences of a live unit are told by the silence.
LARGEST_STEP = 1.0
# s after the last sample at which a clock that began anew goes on.
AFTER_A_JUMP = 1.0
# Batches of samples that show how a clock runs beside another.
ENOUGH = 20


class ForwardClock:
    """Makes stamps increase: repeated ones are left out, a clock that begins anew or leaps is carried on.

    Parameters
    ----------
    last : stamp of the last sample before, where a capture is resumed.
    leaps : whether a leap ahead is a fault of the clock; not of a file that is replayed, whose gaps are its own.
    """

    def __init__(self, last: float | None = None, *, leaps: bool = True) -> None:
        self._last = last
        self._offset = 0.0
        self._fresh = last is not None
        self._leaps = leaps

    def carry_on(self, samples: Samples, waited: float = 0.0) -> tuple[Samples, list[tuple[float, float]]]:
        """Return the samples with stamps that increase, and each jump of the unit's clock as (before, after), s.

        Parameters
        ----------
        samples : as the unit stamps them.
        waited : s that passed on the host's clock since the samples before: a leap of that size is none.
        """
        time = samples.time + self._offset
        jumps: list[tuple[float, float]] = []
        if self._fresh and self._last is not None and len(time):
            # A resumed capture: where the unit's clock stands does not matter.
            self._move(time, 0, self._last + AFTER_A_JUMP)
            self._fresh = False
        for place in self._breaks(time, waited):
            before = self._last if place == 0 else float(time[place - 1])
            assert before is not None
            jumps.append((before, float(time[place])))
            self._move(time, place, before + AFTER_A_JUMP)
        last = -np.inf if self._last is None else self._last
        ahead = time > np.maximum.accumulate(np.concatenate([[last], time]))[:-1]
        if not ahead.all():
            samples, time = samples.cut(ahead), time[ahead]
        if len(time):
            self._last = float(time[-1])
        return samples.at(time), jumps

    def _breaks(self, time: np.ndarray, waited: float) -> list[int]:
        steps = np.diff(time, prepend=time[:1] if self._last is None else self._last)
        allowed = np.full(len(time), LARGEST_STEP)
        allowed[:1] += waited
        wrong = steps < -LARGEST_STEP
        if self._leaps:
            wrong |= steps > allowed
        return np.flatnonzero(wrong).tolist()

    def _move(self, time: np.ndarray, place: int, to: float) -> None:
        shift = to - float(time[place])
        time[place:] += shift
        self._offset += shift


def kept_beside(pairs: Sequence[tuple[float, float]]) -> float:
    """Return what a unit's clock is good to beside the host's, one sigma as a share.

    Parameters
    ----------
    pairs : (arrival by the host's clock, stamp of the unit), s, of `ENOUGH` batches or more over a session.
    """
    arrived, stamps = (np.array(pairs, dtype=np.float64) - pairs[0]).T
    centred = arrived - arrived.mean()
    slope = float(centred @ stamps / (centred @ centred))
    late = float(np.std(stamps - slope * arrived))
    # What the unit's clock is off is not taken out of its stamps, and the host's is a crystal itself.
    return math.hypot(slope - 1.0, math.sqrt(2.0) * late / float(arrived[-1]), CRYSTAL)


class ArrivalClock:
    """Stamps for units that send none: the rate that the samples come at, held to the host's clock.

    Parameters
    ----------
    rate : Hz as stated, or None.
    """

    # Share of the lateness that is followed with each batch, and s beyond which samples are missing.
    _FOLLOWED, _LOST = 0.02, 0.25

    def __init__(self, rate: float | None = None) -> None:
        self._step = None if rate is None else 1.0 / float(rate)
        self._begin: float | None = None
        self._last = 0.0
        self._count = 0

    def stamp(self, count: int, arrived: float) -> np.ndarray:
        """Return the stamps of samples that arrived together, (count,) s.

        Parameters
        ----------
        count : how many, one at least.
        arrived : s on the host's clock.
        """
        if self._begin is None:
            self._begin, self._last = arrived, arrived
            self._count = count
            step = self._step or 1e-3
            return arrived + step * np.arange(1 - count, 1)
        step = self._step or max((arrived - self._begin) / max(self._count, 1), 1e-5)
        self._count += count
        times = self._last + step * np.arange(1, count + 1)
        late = arrived - float(times[-1])
        if late < -self._LOST and self._step is not None:
            # More came at once than the time that has passed: out of a pipe or a buffer, whose rate was said.
            pass
        elif late > self._LOST or late < -self._LOST:
            # Samples are missing, or the rate is another: the host's clock decides.
            times = np.maximum(
                arrived + step * np.arange(1 - count, 1), self._last + 1e-6 * np.arange(1, count + 1)
            )
        else:
            times = times + max(self._FOLLOWED * late, -0.5 * step)
        self._last = float(times[-1])
        return times
