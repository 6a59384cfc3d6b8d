"""The clock that a recording's time is from: what kind it is, and how far its rate may be off.

Nothing in a recording shows a clock that runs fast: all angles that gyros add up over time, and with them all gyro
scale factors, are wrong by as much. So what is known of the clock is stated, as a standard uncertainty of its rate:

- *contradicted*: what was stated and the stamps exclude one another; the difference is counted.
- *stated*: whoever recorded says the rate with its uncertainty (``--rate 100±0.1``).
- *trusted*: whoever recorded says how good the clock of the stamps is (``--rate crystal``, ``--rate ±50ppm``), or the
  kind of file is of units whose crystal times samples and stamps alike.
- *nominal*: no stamps, or stamps that are perfectly regular, which one clock wrote and counted alike. What the sensor
  did is what its data sheet allows: usually 1 % to either side, and any value as likely as any other.
- *device* and *host*: stamps that jitter were read from a clock other than the sensor's own. Where the kind of file
  says so (an autopilot, a phone, a bag of ROS), or seconds since 1970 or of GNSS, that clock is a crystal, known to
  some ten parts in a million; how unevenly the stamps lie adds what it may do to the whole length of the recording.
- *board*: stamps that jitter, of nobody knows what. Crystals look the same as ceramic resonators, which are off by
  0.5 % and with temperature and age by 1 %, and as the oscillator inside a microcontroller, trimmed to 1 or 2 %. So
  what data sheets allow a sensor is allowed a board.
- *exact*: a simulation's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import Series
from tumble.records import dataclass
from tumble.sample_rates import CRYSTAL, SampleRate

Kind = Literal["exact", "stated", "trusted", "nominal", "device", "host", "board", "contradicted"]
Known: TypeAlias = "Kind | float | None"

NOMINAL_TOLERANCE = 0.01
"""Share by which data sheets of MEMS units let the output data rate be off: 1 % is the usual one."""
NOMINAL = float(NOMINAL_TOLERANCE / np.sqrt(3.0))
"""One sigma of what may be anywhere within it: a limit without a distribution is rectangular (GUM 4.3.7)."""
# Seconds since 1970 from 2001 to 2100: nothing but a computer counts so far.
_UNIX = (1e9, 4.1e9)
# Of a step: stamps that are regular to this are so beyond what any two clocks agree to.
_REGULAR = 1e-6
# Of a step: digits coarser than this hide the jitter of a clock; then only a round rate shows that none was read.
_COARSE = 1e-3
_ROUND = 3
# So many steps' length has samples missing in it, whatever the stamps jitter by.
_MISSING = 2.5
# So many stamps show how they are written.
_ENOUGH = 20_000
_PIECE = 65_536
# A stated rate is compared with what stamps say to so many of its sigmas, and to this share.
AGREES, AGREES_AT_LEAST = 4.0, 1e-4
# Sigmas of both beyond which neither is believed to more than the two differ by.
CONTRADICTS = 2.0


@dataclass(frozen=True, slots=True)
class Clock:
    """What is known of the rate of a recording's clock.

    Attributes
    ----------
    kind : what the stamps are.
    rate : samples a second, Hz, by this clock.
    sigma : standard uncertainty of the clock's rate, as a share.
    counted : there are stamps, but one that counts samples would write the same.
    """

    kind: Kind
    rate: float
    sigma: float
    counted: bool = False

    @property
    def words(self) -> str:
        """Where the rate is from, as a clause."""
        return {
            "exact": "the samples' times are exact",
            "stated": f"the sample rate is {self.rate:.6g} Hz as stated",
            "nominal": f"{'the stamps count samples at a' if self.counted else 'the sample rate is a'} nominal "
            f"{self.rate:.6g} Hz, ± {100.0 * NOMINAL_TOLERANCE:g} % by data sheets",
            "device": f"the stamps are of a device's crystal ({self.rate:.6g} Hz by it)",
            "host": f"the stamps are of a computer's clock ({self.rate:.6g} Hz by it)",
            "trusted": f"the clock of the stamps ({self.rate:.6g} Hz by it) is as good as it is said to be",
            "contradicted": f"the stamps ({self.rate:.6g} Hz by them) contradict the rate that was stated",
            "board": f"the stamps ({self.rate:.6g} Hz by them) are of a clock that nobody knows, a crystal or an "
            f"oscillator within ± {100.0 * NOMINAL_TOLERANCE:g} %",
        }[self.kind]


def exact_clock(rate: float) -> Clock:
    """Return the clock of samples whose times are true, as a simulation's are.

    Parameters
    ----------
    rate : Hz.
    """
    return Clock("exact", rate, 0.0)


def clock_without_stamps(rate: float) -> Clock:
    """Return the clock of samples that only a rate determines the times of.

    Parameters
    ----------
    rate : Hz, as it was stated.
    """
    stated = rate.relative if isinstance(rate, SampleRate) else None
    return Clock("nominal", float(rate), NOMINAL) if stated is None else Clock("stated", float(rate), stated)


def clock_of_stamps(time: Series, stated: float | None = None, known: Known = None) -> Clock:
    """Return the clock that stamps are from, by how they lie.

    Parameters
    ----------
    time : (samples,) s, strictly increasing, as the file has it.
    stated : Hz, as somebody says besides; it counts where its uncertainty is said too.
    known : "device" or "host", where the file's kind says who read the stamps off a clock; or one sigma of the rate of
        what times stamps and samples, as a share.
    """
    rate, jitter, regular = _as_they_lie(time)
    stated_to = stated.relative if isinstance(stated, SampleRate) else None
    if regular and not isinstance(known, float):
        own = Clock("nominal", rate, NOMINAL, counted=time.size > 2)
    else:
        own = clock_read_off(rate, jitter, float(time[0]), known)
    if stated_to is None and own.kind in ("nominal", "board"):
        stated_to = NOMINAL
    if stated is None or stated_to is None:
        return own
    # What the stamps are off the stated rate is not taken out of them.
    off = abs(own.rate / float(stated) - 1.0)
    if off > CONTRADICTS * np.hypot(own.sigma, stated_to):
        return replace(own, kind="contradicted", sigma=float(np.hypot(own.sigma, off)))
    sigma = float(np.hypot(stated_to, off))
    return own if own.sigma <= sigma else replace(own, kind="stated", sigma=sigma)


def clock_read_off(rate: float, jitter: float, start: float, known: Known) -> Clock:
    """Return the clock that stamps were read from, other than what counts the samples.

    Parameters
    ----------
    rate : by the stamps, Hz.
    jitter : what the stamps' unevenness may do to the rate, as a share.
    start : s, the first stamp.
    known : as for `clock_of_stamps`.
    """
    if isinstance(known, float | int):
        return Clock("trusted", rate, float(np.hypot(known, jitter)))
    kind = "host" if _UNIX[0] < start < _UNIX[1] else known or "board"
    return Clock(kind, rate, NOMINAL if kind == "board" else min(float(np.hypot(CRYSTAL, jitter)), NOMINAL))


def stamp_jitter(time: Series) -> float:
    """Return by how much single stamps are off the samples' own instants, s, one standard deviation.

    A stamp that is late makes the step before it long and the one after it short: neighbouring steps are alike by minus
    the variance of a stamp. Steps that are as irregular as the samples themselves are not alike at all.

    Parameters
    ----------
    time : (samples,) s, increasing.
    """
    if time.size < 2:
        return 0.0
    usual = float(np.median(np.diff(time)[:: max(1, time.size // _ENOUGH)]))
    count, sums = 0, np.zeros(3)
    # A piece at a time: the stamps of hours are as many as any signal's samples.
    for start in range(0, time.size - 2, _PIECE):
        off = np.diff(time[start : start + _PIECE + 2]) - usual
        both = (off[1:] < (_MISSING - 1.0) * usual) & (off[:-1] < (_MISSING - 1.0) * usual)
        first, second = off[:-1][both], off[1:][both]
        count += first.size
        sums += first.sum(), second.sum(), first @ second
    if count < 2:
        return 0.0
    alike = sums[2] / count - sums[0] * sums[1] / count**2
    return max(-float(alike), 0.0) ** 0.5


def _as_they_lie(time: Series) -> tuple[float, float, bool]:
    """Return the rate by stamps, Hz, what their jitter may do to it as a share, and whether they merely count."""
    some = time[:_ENOUGH]
    steps = np.diff(some)
    if steps.size < 2:
        return 1.0 / float(steps[0]) if steps.size else 1.0, 0.0, True
    step, elapsed = float(np.median(steps)), some - some[0]
    pitch, off = _line(_counted(np.maximum(np.round(steps / step), 1.0)), elapsed)
    if _is_regular(some, pitch, float(np.max(np.abs(off)))):
        return 1.0 / pitch, 0.0, True
    # Stamps that jitter by half a step count no samples; a longer step has some missing.
    pitch, off = _line(_counted(np.where(steps > _MISSING * step, np.round(steps / step), 1.0)), elapsed)
    return 1.0 / pitch, float(np.sqrt(2.0 * np.mean(off**2)) / (time[-1] - time[0])), False


def _counted(samples: Series) -> Series:
    return np.concatenate([[0.0], np.cumsum(samples)])


def _line(count: Series, elapsed: Series) -> tuple[float, Series]:
    """Return the slope of the straight line through stamps, and what is left of them."""
    centred = count - count.mean()
    pitch = float(centred @ elapsed / (centred @ centred))
    return pitch, elapsed - elapsed.mean() - pitch * centred


def _is_regular(time: Series, pitch: float, off: float) -> bool:
    """Whether stamps lie as one that counts would write them, as far as their digits tell."""
    digit = _last_digit(time)
    if off > max(0.75 * digit, _REGULAR * pitch, 4.0 * np.spacing(float(np.max(np.abs(time))))):
        return False
    if digit <= _COARSE * pitch:
        return True
    # To the digits' own exactness the rate, or the step, is a number of few digits.
    exact = digit / float(time[-1] - time[0])
    return any(abs(float(f"{value:.{_ROUND - 1}e}") / value - 1.0) < exact for value in (pitch, 1.0 / pitch))


def _last_digit(time: Series) -> float:
    """Return the unit of the last decimal place that stamps are written with, s; 0 where they have all digits."""
    few = time[:200]
    for places in range(10):
        scaled = few * 10.0**places
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-5 * max(1.0, 10.0 ** (places - 6)):
            return 10.0**-places
    return 0.0
