"""What navigation loses without satellites: outages cut out of a drive many times, and free drift from known starts."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.errors import ConvergenceError, RecordingError
from tumble.navigation.drive import Drive
from tumble.navigation.filter import FilterRun, FilterSetup, run_filter
from tumble.navigation.filter.run import LONGEST_BRIDGED, unpacked
from tumble.navigation.mechanisation import navigate_from_each
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import Trajectory, position_differences
from tumble.records import dataclass

# s that a filter takes after missing samples until its attitude is as good as before.
_AFTER_MISSING = 30.0


@dataclass(frozen=True)
class OutageErrors:
    """Errors of position at the ends of outages of one length.

    Attributes
    ----------
    duration : s without a fix.
    starts : (outages,) s, when the last fix was.
    errors_n : (outages, 3) m, navigated less reference, north, east, down.
    """

    duration: float
    starts: Series
    errors_n: Vectors

    @property
    def horizontal(self) -> Series:
        """(outages,) m."""
        return np.hypot(self.errors_n[:, 0], self.errors_n[:, 1])

    def clear_of(self, stretches: Sequence[tuple[float, float]]) -> OutageErrors:
        """Return the outages that touch none of some stretches (from, to) s, such as those of missing samples."""
        keep = np.ones(len(self.starts), dtype=bool)
        for first, last in stretches:
            keep &= (self.starts >= last) | (self.starts + self.duration <= first)
        return OutageErrors(self.duration, self.starts[keep], self.errors_n[keep])

    def rms(self) -> Vectors:
        """Return (3,) m: root mean square north, east, down."""
        return np.sqrt(np.mean(self.errors_n**2, axis=0))


def outages(
    drive: Drive,
    setup: FilterSetup,
    durations: Sequence[float] = (2.0, 10.0, 30.0, 60.0),
    *,
    interval: float = 1.0,
    every: float = 1.0,
    settle: float = 120.0,
    repeated: bool = False,
    before: FilterRun | None = None,
) -> list[OutageErrors]:
    """Return position errors at the ends of outages, against the fixes that were not taken.

    Outages that touch missing samples of the IMU are left out. After more than a second of them the filter starts
    anew: it has all fixes for half a minute then, and no outage begins in it.

    Parameters
    ----------
    drive : with the reference track.
    setup : of the filter that runs up to each outage.
    durations : s.
    interval : s between the fixes that aid.
    every : s between the starts of sliding outages.
    settle : s after the start before the first outage.
    repeated : False for sliding outages: each one by itself, the filter having had all fixes before it. True for
        gaps: the filter loses all fixes but one at the end of each gap, again and again.
    before : the run of this filter with all of these fixes, where it is there already.

    Raises
    ------
    RecordingError
        If the drive is too short for an outage of one of the lengths.
    ConvergenceError
        If the filter is lost, so that its states are no numbers any more.
    """
    first = drive.start.time + settle
    last = min(float(drive.samples.time[-1]), float(drive.track.time[-1]))
    for duration in durations:
        if first + duration > last:
            raise RecordingError(
                f"The drive has {max(last - first, 0.0):.0f} s after {settle:.0f} s to settle, which is too short for "
                f"outages of {duration:g} s: leave them out, or settle for a shorter time."
            )
    missing = drive.samples.missing()
    if repeated:

        def gaps(duration: float) -> OutageErrors:
            return _gaps(drive, setup, duration, interval, first).clear_of(missing)

        # the compiled filter lets other threads run
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(gaps, durations))
    run = drive.run(setup, interval=interval) if before is None else before
    _refuse_lost(run)
    at = run.time[run.fix_events]
    settled = at >= first
    for begin, end in _settling(drive):
        settled &= (at < begin) | (at >= end)
    chosen = _spaced(run.time, run.fix_events[settled].tolist(), every)
    return [one.clear_of(missing) for one in _slide(drive, run, chosen, durations, last)]


def _slide(
    drive: Drive, run: FilterRun, chosen: Sequence[int], durations: Sequence[float], last: float
) -> list[OutageErrors]:
    """Navigate freely from each event and give the error at each length of outage that has a good fix there."""
    rows, track = np.asarray(chosen, dtype=np.int64), drive.track
    begins, lengths = run.time[rows], np.sort(np.asarray(durations, dtype=float))
    wanted = begins[:, None] + lengths
    fixes = _nearest(track.time, wanted)
    good = np.abs(track.time[fixes] - wanted) <= 0.5 * track.interval + 1e-6
    good &= (track.time[fixes] <= last) & (track.quality[fixes] == np.min(track.quality))
    goals = np.where(good, track.time[fixes], np.nan)
    parameters = _by_sensors(run.setup, run.sensors[rows])
    states = navigate_from_each(drive.samples, run.trajectory.rows(rows).packed, begins, goals, parameters)
    found: list[OutageErrors] = []
    for duration in durations:
        at = int(np.searchsorted(lengths, duration))
        use = good[:, at]
        there, seen = unpacked(goals[use, at], states[use, at]), track.rows(fixes[use, at])
        errors = position_differences(there.points(parameters[use, 33:36]), seen.position)
        errors += there.velocity_n * parameters[use, 36:]
        found.append(OutageErrors(duration, begins[use], errors))
    return found


def _gaps(drive: Drive, setup: FilterSetup, duration: float, interval: float, first: float) -> OutageErrors:
    """Errors before each of the fixes that are left, one at the end of each gap: the filter's innovations."""
    aid = drive.track.thinned(interval)[0]
    kept, next_one = np.ones(len(aid), dtype=bool), -np.inf
    anew = _settling(drive)
    for row in np.flatnonzero(aid.time > first):
        if any(begin <= aid.time[row] < end for begin, end in anew):
            next_one = -np.inf
            continue
        if next_one == -np.inf:
            next_one = aid.time[row]
        kept[row] = aid.time[row] >= next_one - 1e-6
        if kept[row]:
            next_one = aid.time[row] + duration
    track = aid.rows(kept)
    run = run_filter(drive.samples, track, drive.begin(setup), drive.setup(setup), reference=drive.track)
    _refuse_lost(run)
    time = track.time[run.fixes]
    after = (time > first) & (np.concatenate([[0.0], np.diff(time)]) > 0.9 * duration)
    after &= track.quality[run.fixes] == np.min(track.quality)
    return OutageErrors(duration, time[after] - duration, run.innovations[after, :3])


def _settling(drive: Drive) -> list[tuple[float, float]]:
    """Stretches of missing samples that the filter starts anew after, each with the time that it takes to settle."""
    return [(begin, end + _AFTER_MISSING) for begin, end in drive.samples.missing(LONGEST_BRIDGED)]


def _refuse_lost(run: FilterRun) -> None:
    lost = ~(np.isfinite(run.sensors).all(axis=1) & np.isfinite(run.trajectory.velocity_n).all(axis=1))
    if lost.any():
        raise ConvergenceError(
            f"The filter is lost {run.time[lost.argmax()]:.0f} s into the drive: its states are no numbers any more. "
            "Sensor errors at its start are off by far more than the standard deviations that it was given for them."
        )


def _spaced(time: Series, rows: Sequence[int], every: float) -> list[int]:
    """Return the first of some rows and those after it that are so far apart, s."""
    kept: list[int] = []
    for row in rows:
        if not kept or time[row] - time[kept[-1]] >= every - 1e-6:
            kept.append(row)
    return kept


def _nearest(time: Series, wanted: Table) -> np.ndarray:
    """Return the rows whose instants are next to those wanted."""
    there = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    return there - (wanted - time[there - 1] < time[there] - wanted)


def _by_sensors(setup: FilterSetup, estimates: Table) -> Table:
    """What estimates of the sensor states make of the samples' parameters, lever arm and offset last, (events, 37)."""
    from tumble.navigation.filter.kernels import gather_sensors

    parameters, places, nominal = np.empty((len(estimates), 37)), setup.places, setup.nominal
    for sensor, own in zip(estimates, parameters, strict=True):
        gather_sensors(sensor, places, nominal, own)
    return parameters


@dataclass(frozen=True)
class FreeDrift:
    """Errors of position of free navigation from known starts.

    Attributes
    ----------
    seconds : (lengths,) s since the start.
    starts : (starts,) s.
    errors_n : (starts, lengths, 3) m in north, east, down; NaN where the drive ends before, or samples are missing.
    """

    seconds: Series
    starts: Series
    errors_n: AnyArray

    def horizontal_squares(self, length: int) -> Series:
        """Return (starts,) m², squared horizontal errors after one of the lengths, NaN where there is none."""
        return np.asarray(np.sum(self.errors_n[:, length, :2] ** 2, axis=1))

    def block(self, length: int) -> int:
        """Return how many neighbouring starts err together after one of the lengths."""
        if len(self.starts) < 2:
            return 1
        apart = float(np.median(np.diff(self.starts)))
        return max(1, round(2.0 * float(self.seconds[length]) / apart))


def free_drift(
    samples: InertialSamples,
    reference: Trajectory,
    seconds: Sequence[float],
    *,
    every: float = 5.0,
    gaps: Sequence[tuple[float, float]] = (),
) -> FreeDrift:
    """Return how free navigation departs from a reference that it starts from again and again.

    Position, velocity and attitude are the reference's at each start. Nothing of the sensors' errors is taken out
    of the samples beside what was before: what grows is what those errors do.

    Parameters
    ----------
    samples : in SI, corrected or not.
    reference : such as a smoothed filter's, denser than the lengths.
    seconds : s, the lengths.
    every : s between starts.
    gaps : stretches (from, to) s without samples, which no free navigation may cross.

    Raises
    ------
    RecordingError
        If the reference is too short for the shortest length.
    """
    lengths = np.sort(np.asarray(seconds, dtype=float))
    last = min(float(reference.time[-1]), float(samples.time[-1]))
    rows = _spaced(reference.time, np.flatnonzero(reference.time + lengths[0] <= last).tolist(), every)
    if not rows:
        raise RecordingError(
            f"The drive's reference lasts {last - float(reference.time[0]):.0f} s, which is too short for "
            f"{lengths[0]:g} s of free navigation."
        )
    errors = _errors(samples, reference, rows, lengths, last, gaps)
    return FreeDrift(lengths, reference.time[rows].copy(), errors)


def _errors(
    samples: InertialSamples,
    reference: Trajectory,
    rows: Sequence[int],
    lengths: Series,
    last: float,
    gaps: Sequence[tuple[float, float]],
) -> AnyArray:
    """Errors after each length, (starts, lengths, 3), NaN where the reference or the samples do not reach."""
    begins = reference.time[np.asarray(rows, dtype=np.int64)]
    stops = np.full(len(rows), last)
    for first, to in gaps:
        stops = np.where(begins < to, np.minimum(stops, np.maximum(first, begins)), stops)
    wanted = begins[:, None] + lengths
    there = _nearest(reference.time, wanted)
    # the reference has no rows for a while after missing samples
    near = np.abs(reference.time[there] - wanted) < 0.75 * float(np.median(np.diff(reference.time)))
    reached = near & (wanted <= stops[:, None] + 1e-6) & (reference.time[there] <= stops[:, None] + 1e-6)
    goals = np.where(reached, reference.time[there], np.nan)
    states = navigate_from_each(samples, reference.rows(np.asarray(rows)).packed, begins, goals)
    errors = np.full((*wanted.shape, 3), np.nan)
    free, seen = unpacked(goals[reached], states[reached]), reference.rows(there[reached])
    errors[reached] = position_differences(free.position, seen.position)
    return errors


@dataclass(frozen=True)
class Statistic:
    """A number with its standard uncertainty; NaN where there are too few errors to tell it.

    Attributes
    ----------
    value, standard_uncertainty : in one unit.
    """

    value: float
    standard_uncertainty: float

    def times(self, factor: float) -> Statistic:
        """Return the number in a unit so many times smaller."""
        return Statistic(factor * self.value, factor * self.standard_uncertainty)


_RESAMPLES = 1000


def _drawn_blocks(count: int, block: int, rng: np.random.Generator) -> np.ndarray | None:
    """Return (resamples, count) indices of blocks drawn with replacement, or None where one block is all."""
    if count <= block or count < 2:
        return None
    blocks = -(-count // block)
    starts = rng.integers(0, count - block + 1, (_RESAMPLES, blocks))
    return (starts[:, :, None] + np.arange(block)).reshape(_RESAMPLES, -1)[:, :count]


def rms_of(squares: Series, block: int, rng: np.random.Generator) -> Statistic:
    """Return the root of the mean of squared errors.

    Parameters
    ----------
    squares : (errors,) in time order.
    block : errors that go together.
    rng : source of all numbers.
    """
    return ratio_of(squares, np.ones(squares.size), block, rng)


def ratio_of(squares: Series, reference: Series, block: int, rng: np.random.Generator) -> Statistic:
    """Return the ratio of two root mean squares of errors at the same instants, drawn in pairs.

    What both have in common, such as a stretch that is hard to navigate, cancels.

    Parameters
    ----------
    squares, reference : (errors,) of both, in time order.
    block : errors that go together.
    rng : source of all numbers.
    """
    if not squares.size or not reference.mean() > 0.0:
        return Statistic(float("nan"), float("nan"))
    value = float(np.sqrt(squares.mean() / reference.mean()))
    rows = _drawn_blocks(squares.size, block, rng)
    if rows is None:
        return Statistic(value, float("nan"))
    spread = np.sqrt(squares[rows].mean(axis=1) / np.maximum(reference[rows].mean(axis=1), 1e-300))
    return Statistic(value, float(np.std(spread, ddof=1)))
