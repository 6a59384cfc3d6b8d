"""What a column of temperature holds: how much of it, from where to where, and whether it ever moves."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series

# A thermometer that is read at all shows another number within so long: its noise, or its last digit.
STILL_SECONDS = 60.0
# Gaps up to this are bridged without doubt; the unit's own time constant is minutes.
LONG_GAP = 60.0  # s
# No inertial sensor works beyond these, and most are specified up to 85 °C.
POSSIBLE_CELSIUS = (-100.0, 200.0)
# Numbers beyond are slips of the reading where they are so few; of a column in another scale they are many.
_FEW = 0.01


def without_slips(celsius: Series) -> tuple[Series, int]:
    """Return a column with NaN for the few numbers that no sensor's temperature can have, and how many these are.

    Parameters
    ----------
    celsius : (samples,) °C; one that is in another scale as a whole is returned as it is.
    """
    with np.errstate(invalid="ignore"):
        slips = (celsius < POSSIBLE_CELSIUS[0]) | (celsius > POSSIBLE_CELSIUS[1])
    count = int(np.count_nonzero(slips))
    if not 0 < count <= _FEW * np.count_nonzero(np.isfinite(celsius)):
        return celsius, 0
    return np.where(slips, np.nan, celsius), count


def mean_celsius(celsius: Series | None) -> float | None:
    """Return the mean of a column, None where it holds no number or no temperature that a sensor can have.

    Parameters
    ----------
    celsius : (samples,) °C, NaN where there is none; None without a column.
    """
    if celsius is None or not np.isfinite(celsius).any():
        return None
    mean = float(np.nanmean(celsius))
    return mean if POSSIBLE_CELSIUS[0] <= mean <= POSSIBLE_CELSIUS[1] else None


class TemperatureColumn:
    """Counts what is in a column of temperature, block by block.

    Attributes
    ----------
    samples, missing : how many there are, and how many of them hold no finite number.
    lowest, highest : °C among the others; NaN before there is one.
    longest : s without a number, at most.
    longest_from : s, where that begins.
    """

    def __init__(self) -> None:
        self.samples = self.missing = 0
        self.lowest = self.highest = float("nan")
        self.longest, self.longest_from = 0.0, 0.0
        self._begin = self._end = float("nan")
        self._known_until = float("nan")
        self._lacking = False

    def add(self, time: Series, celsius: Series) -> None:
        """Take the next block into account.

        Parameters
        ----------
        time, celsius : (samples,) s and °C, NaN where there is none.
        """
        if not time.size:
            return
        known = np.isfinite(celsius)
        if np.isnan(self._begin):
            self._begin = self._known_until = float(time[0])
        self._end = float(time[-1])
        self.samples += time.size
        self.missing += int(time.size - np.count_nonzero(known))
        index = np.flatnonzero(known)
        # Between neighbours in the file there is nothing to be missing, however far apart they are.
        apart = np.diff(index, prepend=-2 if self._lacking else -1) > 1
        at = np.concatenate([[self._known_until], time[index]])
        gaps = np.diff(at) * apart
        if gaps.size and float(gaps.max()) > self.longest:
            self.longest, self.longest_from = float(gaps.max()), float(at[int(np.argmax(gaps))])
        self._known_until = float(at[-1])
        self._lacking = not bool(known[-1])
        if known.any():
            self.lowest = float(np.fmin(self.lowest, celsius[known].min()))
            self.highest = float(np.fmax(self.highest, celsius[known].max()))

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return 0.0 if np.isnan(self._begin) else self._end - self._begin

    @property
    def longest_gap(self) -> tuple[float, float]:
        """Seconds of the longest stretch without a number, up to the end, and where it begins."""
        tail = self._end - self._known_until if self._lacking else 0.0
        return (tail, self._known_until) if tail > self.longest else (self.longest, self.longest_from)

    @property
    def is_constant(self) -> bool:
        """Whether it holds one number for longer than a thermometer that is read does."""
        return self.lowest == self.highest and self.duration > STILL_SECONDS

    def missing_words(self) -> str:
        """Return how much is missing, as the beginning of a sentence; empty where nothing is."""
        if not self.missing:
            return ""
        seconds, begin = self.longest_gap
        return (
            f"The temperature is missing (no number) in {self.missing} of {self.samples} samples, at the longest for "
            f"{seconds:.1f} s from {begin:.1f} s on"
        )
