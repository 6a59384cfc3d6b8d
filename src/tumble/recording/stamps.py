"""Time stamps: their unit, wraps, duplicates, backward steps, gaps and rate, and the clock that they are from.

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

import itertools
from collections.abc import Callable
from dataclasses import field, replace
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.samples import Remark
from tumble.records import dataclass
from tumble.sample_rates import CRYSTAL, SampleRate
from tumble.units import time_factor

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


@dataclass(frozen=True)
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


_PLAUSIBLE_RATE = (5.0, 5000.0)  # Hz: slow loggers in seconds are many, rates above in milliseconds few
_USUAL_RATE = (5.0, 20_000.0)  # Hz
RATES = (1e-5, 1e8)
"""Hz: a sample a day, and more than any sensor gives; beyond them a number is no rate."""
_NEAR_EDGE = 3.0  # times the rate of an edge within which the neighbouring unit is named too
_GAP_FACTOR = 1.6  # of the median step: one missing sample doubles the step, jitter rarely reaches this
_WRAPS = (2.0**16, 2.0**24, 2.0**31, 2.0**32, 1e3, 6e4, 86_400.0, 86_400_000.0, 604_800.0, 604_800_000.0)
_MOST_DUPLICATES = 0.05
_BREAK = 2.0  # s that a clock which begins anew is taken to have been away
_SAME_STEP = 0.05
_LEAST_BURSTS = 100
# From which on steps between bursts are so many times those within, lost samples being few.
_BURST_FACTOR = 4.0
_LONGEST_BURST = 0.5  # s that samples wait to be sent; a logger that sleeps on purpose waits longer
# Of a sensor's own oscillator from its rate in the first block on, warming up: MEMS are trimmed to some per cent.
_LARGEST_DRIFT = 0.01
# Samples between two resets of a clock; before the first and after the last there may be fewer.
_LEAST_PART = 3


@dataclass(frozen=True)
class Stamps:
    """Stamps put in order.

    Attributes
    ----------
    time : (rows kept,) seconds, strictly increasing.
    keep : (rows,) which rows of the table are kept.
    gaps : indices into `time` before which samples are missing.
    rate : samples a second, from the stamps outside the gaps.
    unit : unit of the raw stamps.
    clock : that they are from.
    remarks : what was assumed and mended.
    """

    time: Series
    keep: npt.NDArray[np.bool_]
    gaps: tuple[int, ...]
    rate: float
    unit: str
    clock: Clock
    remarks: list[Remark] = field(default_factory=list[Remark])


def guess_time_unit(step: float) -> str:
    """Return the unit of time in which a median step gives the most plausible sampling rate.

    Rates from 5 Hz to 5 kHz are plausible; each unit covers three decades, so exactly one fits
    (at the very edge the one nearer to the middle, 158 Hz).

    Examples
    --------
    >>> guess_time_unit(0.01), guess_time_unit(10.0), guess_time_unit(1e7)
    ('s', 'ms', 'ns')
    """
    middle = np.log10(_PLAUSIBLE_RATE[0] * _PLAUSIBLE_RATE[1]) / 2.0
    return min(("s", "ms", "us", "ns"), key=lambda u: abs(-np.log10(step * time_factor(u)) - middle))


def seconds_of(stamps: Series, unit: str | None) -> Series:
    """Return stamps in seconds: of a unit, or of the one in which they are plausible."""
    return stamps * time_factor(unit or guess_time_unit(float(np.nanmedian(np.diff(stamps)))))


def find_gaps(time: Series, rate: float) -> tuple[int, ...]:
    """Return the indices before which at least one sample is missing.

    A step counts as a gap above 1.6 nominal steps, or above the median plus eight median absolute
    deviations where the stamps jitter more than that.
    """
    if time.size < 3:
        return ()
    steps = np.diff(time)
    middle = _median(steps)
    jitter = 1.4826 * _median(np.abs(steps - middle))
    limit = max(_GAP_FACTOR * max(middle, 0.8 / rate), middle + 8.0 * jitter)
    return tuple(int(i) + 1 for i in np.flatnonzero(steps > limit))


def _nominal_rate(steps: Series, duration: float) -> float:
    """Sampling rate: the number of steps outside gaps over the time they take."""
    long = steps[steps > _GAP_FACTOR * _median(steps)]
    return float((steps.size - long.size) / (duration - long.sum()))


def _median(values: Series) -> float:
    """Median, of a long series that of every so manieth value."""
    return float(np.median(values[:: max(1, values.size // 200_000)]))


@dataclass(frozen=True)
class Told:
    """What is known of a column of stamps, whatever stands in it.

    Attributes
    ----------
    name : the file's name, for messages.
    place : turns a row number into words.
    unit : declared unit, or None to choose by plausibility (or by `rate` if that is given).
    rate : declared sampling rate in Hz; must agree with the stamps within 5 %.
    parted : whether a clock that begins anew parts the recording instead, where the steps on both sides agree.
    known : of the clock, see `clock_of_stamps`.
    """

    name: str
    place: Callable[[int], str]
    unit: str | None
    rate: float | None
    parted: bool = False
    known: Known = None


@dataclass
class BlockState:
    """What is carried from block to block.

    Attributes
    ----------
    rows : rows of the file so far.
    last : the last stamp as it stands in the file.
    added : what wraps of the counter have added so far, in the file's unit.
    between, even : of samples that arrive in bursts, the step from burst to burst and the last sample's time, s.
    """

    rows: int = 0
    last: float = 0.0
    added: float = 0.0
    between: float | None = None
    even: float = 0.0


def order_stamps(raw: Series, told: Told, state: BlockState) -> Stamps:
    """Turn raw stamps into strictly increasing seconds.

    Counters that wrap (at 2^16, 2^24, 2^31, 2^32, or a week, day or minute) are carried on; rows with
    the stamp of the row before are left out; a step back of any other size is refused, because then
    the order of the samples is not known.

    Parameters
    ----------
    raw : (rows,) stamps as in the file, finite.
    told : what is known of them.
    state : made what the next block goes on from.

    Raises
    ------
    RecordingError
        If the stamps are constant, go back, repeat too often, or contradict the declared rate.
    """
    name, rate = told.name, told.rate
    state.last = float(raw[-1])
    raw, remarks = _straightened(raw, told)
    state.added = float(raw[-1]) - state.last
    steps = np.diff(raw)
    if raw.size < 2 or not np.any(steps):
        raise RecordingError(
            f"{name}: the time column never changes (it stays at {raw[0]:g}); leave it out with --columns "
            "and give --rate HZ."
        )
    keep = np.concatenate([[True], steps > 0.0])
    doubles = int(raw.size - keep.sum())
    if doubles > max(_MOST_DUPLICATES * raw.size, 2):
        raise RecordingError(
            f"{name}: {doubles} of {raw.size} stamps repeat the one before (first at "
            f"{told.place(int(np.argmin(keep)))}), so they are coarser than the sampling; leave the time column out "
            "with --columns and give --rate HZ."
        )
    if doubles:
        remarks.append(_say_doubles(keep, told))
        raw, steps = raw[keep], steps[steps > 0.0]
    evened = _even_out(raw, steps, told, state)
    if evened is not None:
        _check_rate(evened.rate, rate, name, evened.unit)
        return replace(evened, keep=keep, remarks=[*remarks, *evened.remarks])
    unit = _unit_of(_median(steps), told, remarks)
    factor = time_factor(unit)
    # Contiguous, for what is computed with it; a column may lie among others.
    time = np.ascontiguousarray(raw) if factor == 1.0 else raw * factor
    steps = steps if factor == 1.0 else steps * factor
    found = _nominal_rate(steps, float(time[-1] - time[0]))
    if not RATES[0] <= found <= RATES[1]:
        raise RecordingError(
            f"{name}: the stamps (in {unit}) give {found:.3g} Hz, which no sensor has{_in_usual(found, unit)}. State "
            "the unit of time with --units, or leave the time column out with --columns and give --rate HZ."
        )
    _check_rate(found, rate, name, unit)
    if not _USUAL_RATE[0] <= found <= _USUAL_RATE[1]:
        other = _in_usual(found, unit)
        text = f"A rate of {found:.3g} Hz is unusual for an IMU{other}; check the unit of time ({unit}, --units)."
        remarks.append(Remark("doubtful" if other and found > _USUAL_RATE[1] else "unchecked", text))
    gaps = find_gaps(time, found)
    return Stamps(time, keep, gaps, found, unit, clock_of_stamps(time, rate, told.known), remarks)


def continue_stamps(
    raw: Series, told: Told, state: BlockState
) -> tuple[Series, npt.NDArray[np.bool_], list[Remark]]:
    """Return the stamps of a block in s, carried on from the one before, which rows are kept, and what is said of it.

    Parameters
    ----------
    raw : (rows,) stamps as in the file, finite.
    told : what is known of them, unit and rate as decided on the first block.
    state : what is carried from block to block, and is carried on.

    Raises
    ------
    RecordingError
        If the stamps go back.
    """
    factor, step = time_factor(told.unit or "s"), 1.0 / (told.rate or 1.0)
    chain = np.concatenate([[state.last], raw])

    def place(row: int) -> str:
        return told.place(row - 1)

    straight, said = _straightened(chain, replace(told, place=place))
    steps = np.diff(straight)
    time, keep, missing = (straight[1:] + state.added) * factor, steps > 0.0, float(steps[0]) * factor - step
    state.last, state.added = float(raw[-1]), state.added + float(straight[-1] - chain[-1])
    said += [] if keep.all() else [_say_doubles(keep, told)]
    time = time[keep]
    if state.between is not None and time.size:
        # Laid evenly on from the sample before, towards where the stamps lie on average, for a clock drifts.
        gaps = np.flatnonzero(steps[keep] * factor > _BURST_FACTOR * state.between)
        for start, stop in itertools.pairwise(sorted({0, *gaps.tolist(), time.size})):
            even = step * np.arange(stop - start)
            average = float(np.mean(time[start:stop] - even))
            first = average if start in gaps else state.even + step
            drift = np.clip((average - first) / (step * even.size), -_LARGEST_DRIFT, _LARGEST_DRIFT)
            time[start:stop] = first + even * (1.0 + drift)
        missing, state.even = float(time[0]) - state.even - step, float(time[-1])
    if time.size and missing > (_GAP_FACTOR - 1.0) * step:
        text = f"Samples are missing for {missing:.3g} s before t = {time[0]:.6g} s."
        said.append(Remark("found", text))
    return time, keep, said


def _say_doubles(keep: npt.NDArray[np.bool_], told: Told) -> Remark:
    doubles, first = int(keep.size - keep.sum()), told.place(int(np.argmin(keep)))
    return Remark("mended", f"{told.name}: {doubles} row(s) with a repeated stamp left out (first: {first}).")


def _straightened(raw: Series, told: Told) -> tuple[Series, list[Remark]]:
    """Carry on a counter that wraps, and where that may part the recording a clock that begins anew."""
    raw, wraps = carry_on(raw)
    text = f"{told.name}: the time counter wraps {wraps} time(s) and is carried on."
    remarks = [Remark("mended", text)] if wraps else []
    if told.parted:
        raw, resets = _join_resets(raw, told)
        remarks += resets
    back = np.flatnonzero(raw[1:] < raw[:-1])
    if back.size:
        row, more = int(back[0]) + 1, f" (and {back.size - 1} more times)" if back.size > 1 else ""
        raise RecordingError(
            f"{told.name}, {told.place(row)}: time steps back from {raw[row - 1]:.10g} to {raw[row]:.10g}"
            f"{more}; the order of the samples is unknown. Split the file there, or leave the "
            "time column out with --columns and give --rate HZ."
        )
    return raw, remarks


def _even_out(raw: Series, steps: Series, told: Told, state: BlockState) -> Stamps | None:
    """Stamps of samples that arrive in bursts, laid evenly; None where they do not.

    Such stamps are of the arrival: within a burst they are as near as a computer reads, and between bursts far apart,
    while the count of samples grows evenly with time. After lost samples it does not.
    """
    within = _median(steps)
    long = steps > _BURST_FACTOR * within
    if np.count_nonzero(long) < _LEAST_BURSTS or steps[long].sum() < 0.5 * (raw[-1] - raw[0]):
        return None
    between = float(np.median(steps[long]))
    size = 1.0 + (steps.size - np.count_nonzero(long)) / np.count_nonzero(long)
    said: list[Remark] = []
    unit = _unit_of(between / size, told, said)
    factor = time_factor(unit)
    edges = [0, *(int(i) + 1 for i in np.flatnonzero(steps > _BURST_FACTOR * between)), raw.size]
    even, taken, samples = np.array(raw * factor), 0.0, 0
    for start, stop in itertools.pairwise(edges):
        index = np.arange(stop - start, dtype=np.float64)
        if index.size < 2.0 * size:
            return None
        slope, first = np.polyfit(index, even[start:stop], 1)
        line = first + slope * index
        if np.max(np.abs(even[start:stop] - line)) > 1.5 * factor * between:
            return None
        even[start:stop] = line
        taken, samples = taken + float(slope) * index.size, samples + index.size
    if factor * between > _LONGEST_BURST:
        return None
    found = samples / taken
    text = (
        f"{told.name}: the stamps come in bursts of about {size:.2g}, {factor * between:.3g} s apart: they are of the "
        f"arrival. The samples are taken as evenly spaced, at {found:.5g} Hz."
    )
    said.append(Remark("assumed", text))
    arrival = factor * between / float(even[-1] - even[0])
    state.between, state.even = factor * between, float(even[-1])
    clock = clock_read_off(found, arrival, float(even[0]), told.known)
    return Stamps(even, np.ones(raw.size, bool), tuple(edges[1:-1]), found, unit, clock, said)


def carry_on(raw: Series) -> tuple[Series, int]:
    """Add what a wrapping counter has lost; returns the stamps and the number of wraps."""
    if bool(np.all(raw[1:] >= raw[:-1])):
        return raw, 0
    steps = np.diff(raw)
    back = np.flatnonzero(steps < 0.0)
    if back.size > 0.01 * raw.size + 1:
        return raw, 0
    forward = steps[steps > 0.0]
    if not forward.size:
        return raw, 0
    step = _median(forward)
    for size in _WRAPS:
        # The counter must have stood just below its limit and begin again just above zero.
        before, after = raw[back], raw[back + 1]
        if np.all((before < size) & (before > size - 3.0 * step) & (after >= 0.0) & (after < 3.0 * step)):
            added = np.zeros(raw.size)
            added[back + 1] = size
            return raw + np.cumsum(added), int(back.size)
    return raw, 0


def _join_resets(raw: Series, told: Told) -> tuple[Series, list[Remark]]:
    """Let a clock that begins anew go on after a break of two seconds; returns the stamps, and what is said.

    Where the steps on the two sides of a step back do not agree, the stamps are left as they are.
    """
    steps = np.diff(raw)
    back = np.flatnonzero(steps < 0.0) if steps.size and steps.min() < 0.0 else np.zeros(0, np.intp)
    if not back.size:
        return raw, []
    step = _median(steps[steps > 0.0]) if np.any(steps > 0.0) else 0.0
    edges = [0, *(int(i) + 1 for i in back), raw.size]
    for start, stop in itertools.pairwise(edges):
        if stop - start < _LEAST_PART:
            if start > 0 and stop < raw.size:
                return raw, []
        elif abs(_median(np.diff(raw[start:stop])) - step) > _SAME_STEP * step:
            return raw, []
    unit = 1.0 / (told.rate * step) if told.rate else time_factor(told.unit or guess_time_unit(step))
    added = np.zeros(raw.size)
    added[back + 1] = _BREAK / unit - steps[back]
    several = f" and in {back.size - 1} more place(s)" if back.size > 1 else ""
    text = (
        f"{told.name}: the clock steps back at {told.place(int(back[0]) + 1)}{several}, with the same steps before and "
        f"after. It is taken as begun anew after a break of {_BREAK:g} s, and the recording as parted there."
    )
    return raw + np.cumsum(added), [Remark("mended", text)]


def _unit_of(step: float, told: Told, remarks: list[Remark]) -> str:
    rate = told.rate
    if told.unit is not None:
        return told.unit
    if rate is not None:
        return min(("s", "ms", "us", "ns"), key=lambda u: abs(np.log(step * time_factor(u) * rate)))
    guess = guess_time_unit(step)
    found = 1.0 / (step * time_factor(guess))
    text = f"{told.name}: stamps are taken as {guess} (steps of {step:.6g}, {found:.4g} Hz){_other_unit(guess, found)}."
    remarks.append(Remark("assumed", text))
    return guess


def _other_unit(guess: str, found: float) -> str:
    """Name the unit that is hardly less plausible, or nothing."""
    units = ("s", "ms", "us", "ns")
    place = units.index(guess)
    if found < _NEAR_EDGE * _PLAUSIBLE_RATE[0] and place < 3:
        other, rate = units[place + 1], 1000.0 * found
    elif found > _PLAUSIBLE_RATE[1] / _NEAR_EDGE and place > 0:
        other, rate = units[place - 1], found / 1000.0
    else:
        return ""
    return f"; in {other} they would be {rate:.4g} Hz: if so, say --units {other}"


def _in_usual(found: float, unit: str) -> str:
    """Name the unit of time in which the stamps would have a rate that IMUs have, or nothing."""
    for other in ("s", "ms", "us", "ns"):
        rate = found * time_factor(unit) / time_factor(other)
        if other != unit and _USUAL_RATE[0] <= rate <= _USUAL_RATE[1]:
            return f", and in {other} it would be {rate:.4g} Hz"
    return ""


def _check_rate(found: float, rate: float | None, name: str, unit: str) -> None:
    if rate is None:
        return
    stated = rate.relative if isinstance(rate, SampleRate) else None
    limit = 0.05 if stated is None else max(AGREES * stated, AGREES_AT_LEAST)
    if abs(np.log(found / rate)) > limit:
        declared = f"{float(rate):g}" if stated is None else f"{rate}"
        raise RecordingError(
            f"{name}: the stamps (in {unit}) give {found:.6g} Hz, but {declared} Hz was declared; leave one of the two "
            "out (a time column is skipped with --columns)."
        )
