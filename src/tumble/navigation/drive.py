"""A drive that is ready to be filtered: one clock, a start at rest, and an attitude there."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Vector
from tumble.errors import RecordingError
from tumble.navigation.alignment import Alignment, align_in_motion, find_rest
from tumble.navigation.filter import FilterRun, FilterSetup, plan_filter, run_filter
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples
from tumble.navigation.time_alignment import (
    TimeAlignment,
    correlate,
    estimate_time_offset,
    find_course_rate,
    rate_about_down,
    seen_by,
)
from tumble.navigation.trajectory import NavigationState
from tumble.noise import NoiseModel
from tumble.records import dataclass

# Steps, s, at which the filter's innovations are compared to find the offset between the clocks, in turns.
_REACHES = (0.15, 0.05, 0.03)
# The same with a filter of the unit's own noise.
_FINE = (0.05, 0.02)
# s of a drive that tell the offset to the coarser steps.
_ENOUGH = 200.0
# How often each is tried until the least lies between its steps; and how many of the course's standard uncertainties
# the filter may move the offset.
_TRIALS, _FURTHEST = 3, 4.0
# What innovations tell wrong beside their scatter, s (simulated drives).
_SYSTEMATIC = 0.005
# A metre of lever arm, in s of the offset that the innovations find (simulated drives).
_UNKNOWN_ARM = 0.02
# What an outlier may add to their sum.
_MOST = 30.0
# By how much a float or single solution is trusted less than it says.
_FLOAT = 3.0
# Seconds of the first rest that tell the level.
_REST = 10.0


@dataclass(frozen=True)
class Drive:
    """An IMU's samples and a track on one clock, with a start.

    Attributes
    ----------
    samples : of the IMU.
    track : on the IMU's clock.
    start : at the beginning of the first rest; its position is the antenna's.
    alignment : of the attitude there.
    clock : by how much the track was shifted, and how well that is known.
    """

    samples: InertialSamples
    track: GnssTrack
    start: NavigationState
    alignment: Alignment
    clock: TimeAlignment

    def setup(self, setup: FilterSetup) -> FilterSetup:
        """Return a filter's setup with the covariance of this start."""
        row = int(np.argmin(np.abs(self.track.time - self.start.time)))
        position = np.sqrt(np.diag(self.track.position_covariance_n[row]))
        return setup.with_start(position, 0.05, self.alignment.sigmas)

    def begin(self, setup: FilterSetup) -> NavigationState:
        """Return the start of a filter: positions are the antenna's, and a filter navigates the IMU."""
        return self.start.beside(-setup.lever_arm_b)

    def with_samples(self, samples: InertialSamples) -> Drive:
        """Return the drive with the samples corrected otherwise, aligned anew at the same rest.

        Parameters
        ----------
        samples : of the same recording.

        Raises
        ------
        RecordingError
            If their specific force at rest is not gravity's within 5 %.
        """
        start, alignment = _aligned(samples, self.track)
        return replace(self, samples=samples, start=start, alignment=alignment)

    def run(
        self,
        setup: FilterSetup,
        *,
        interval: float | None = None,
        instants: Series | None = None,
        velocities: bool = False,
        keep_covariances: bool = False,
        without: tuple[tuple[float, float], ...] = (),
    ) -> FilterRun:
        """Run a filter over the drive.

        Parameters
        ----------
        setup : of the filter; its start is that of the drive.
        interval : s between the fixes taken; None for all.
        instants : s at which the state is kept beside the fixes.
        velocities : whether the track's velocities are taken too.
        keep_covariances : for smoothing.
        without : stretches (from, to) s of which no fix is taken.

        Raises
        ------
        RecordingError
            If nothing of the track is left to aid with.
        """
        track = self.track if interval is None else self.track.thinned(interval)[0]
        for begin, end in without:
            track = track.rows((track.time <= begin) | (track.time > end))
        return run_filter(
            self.samples,
            track,
            self.begin(setup),
            self.setup(setup),
            velocities=velocities,
            instants=instants,
            keep_covariances=keep_covariances,
            reference=self.track,
        )


def prepare_drive(samples: InertialSamples, track: GnssTrack, *, setup: FilterSetup | None = None) -> Drive:
    """Return a drive with both clocks brought together, checked to be of one motion, and aligned.

    The offset of the clocks is found from the course first; then the attitude at the first rest, and the offset
    at which the filter's innovations are least, in turns. (A filter with the offset among its states is
    biased by tens of milliseconds where it trusts the IMU little: the velocity that multiplies the offset is
    itself an estimate.)

    Parameters
    ----------
    samples : in SI.
    track : on its own clock.
    setup : of the filter that finds the offset; None for one that fits units of any grade.

    Raises
    ------
    RecordingError
        If both did not see the same motion, or there is no rest to align at.
    """
    track = track.weakened({2: _FLOAT, 5: _FLOAT})
    clock = estimate_time_offset(samples, track)
    moved_track = track.shifted(clock.offset)
    refuse_other_motion(samples, moved_track)
    drive = Drive(samples, moved_track, *_aligned(samples, moved_track), clock)
    own = setup or wide_setup()
    known = bool(own.lever_arm_b.any())
    moved = sharpen_clock(drive, own, arm_known=known, reaches=_REACHES)
    if moved is drive:
        return replace(drive, clock=replace(clock, note="; the filter's innovations determine it no better"))
    return moved


def sharpen_clock(
    drive: Drive,
    setup: FilterSetup,
    *,
    arm_known: bool = True,
    reaches: tuple[float, ...] = _FINE,
) -> Drive:
    """Return the drive with the offset of its clocks at which a filter's innovations are least.

    The better the filter knows the unit's noise, the better it tells the offset. Where it tells none, or one that is
    four standard uncertainties away, the drive is returned as it is.

    Parameters
    ----------
    drive : with an offset that was found.
    setup : of the filter.
    arm_known : whether the setup's lever arm is; else the uncertainty has a metre of it.
    reaches : s, steps at which innovations are compared, in turns.
    """
    quiet: Drive = replace(drive, samples=_less_rest_rate(drive.samples, drive.track))
    track, total, told, sigma = drive.track, 0.0, True, drive.clock.sigma
    for reach in reaches:
        for _ in range(_TRIALS):
            until = _ENOUGH if reach != reaches[-1] else np.inf
            step, sigma, told = _least_innovations(quiet, setup, reach, until)
            total += step
            start, alignment = _aligned(drive.samples, track.shifted(total))
            quiet = replace(quiet, track=track.shifted(total), start=start, alignment=alignment)
            if told:
                break
    if not told or abs(total) > _FURTHEST * drive.clock.sigma:
        return drive
    note = f"; the filter then moved it by {total + drive.clock.moved:.3f} s"
    sigma = float(np.hypot(sigma, _SYSTEMATIC))
    if not arm_known:
        sigma = float(np.hypot(sigma, _UNKNOWN_ARM))
        note += ", to 0.02 s for each metre of lever arm that was not given"
    clock = replace(
        drive.clock,
        offset=drive.clock.offset + total,
        sigma=sigma,
        moved=drive.clock.moved + total,
        note=note,
    )
    return replace(quiet, samples=drive.samples, clock=clock)


def wide_setup(lever_arm_b: Vector | None = None) -> FilterSetup:
    """Return a setup for a unit of which nothing is known: errors and noise of a poor consumer grade on a car.

    Parameters
    ----------
    lever_arm_b : (3,) m, from the IMU to the antenna; None for zero.
    """
    from tumble.navigation.filter.setup import TriadSpread

    return plan_filter(
        NoiseModel(random_walk=0.05, rate_random_walk=1e-3),
        NoiseModel(random_walk=0.002, rate_random_walk=1e-5),
        accelerometer=TriadSpread(bias=0.2, scale_factor=0.01, non_orthogonality=0.01),
        gyroscope=TriadSpread(bias=0.01, scale_factor=0.01, misalignment=0.01),
        lever_arm_b=lever_arm_b,
    )


def _less_rest_rate(samples: InertialSamples, track: GnssTrack) -> InertialSamples:
    """Samples less the gyros' mean in the first rest: an uncalibrated bias would blur the clock."""
    first, last = find_rest(samples, track)
    still = samples.between(max(first, float(samples.time[0])), last)
    return replace(
        samples, angular_rate_ib_b=samples.angular_rate_ib_b - still.angular_rate_ib_b.mean(axis=0)
    )


def _least_innovations(
    drive: Drive, setup: FilterSetup, reach: float, until: float
) -> tuple[float, float, bool]:
    """The shift, s, at which the normalised innovations are least by a parabola, its sigma, and if there is one."""
    interval = max(1.0, drive.track.interval)
    wanted = drive.track.thinned(interval)[0]
    wanted = wanted.rows(wanted.time < drive.start.time + until)
    own = drive.setup(setup)

    def cost(shift: float) -> float:
        run = run_filter(
            drive.samples,
            wanted.shifted(shift),
            drive.begin(setup),
            own,
            reference=drive.track.shifted(shift),
        )
        return float(np.nansum(np.minimum(run.distances[:, 0], _MOST)))

    # the compiled filter lets other threads run
    with ThreadPoolExecutor(3) as pool:
        before, middle, after = pool.map(cost, (-reach, 0.0, reach))
    bend = before + after - 2.0 * middle
    if bend <= 0.0 or abs(before - after) > 2.0 * bend:
        # outside of the valley: towards its lower side
        return (reach if after < before else -reach), reach, False
    step = 0.5 * reach * (before - after) / bend
    # chi-square rises by one at one sigma; scaled where innovations are larger than the setup says
    scale = max(1.0, middle / (3.0 * max(len(wanted), 1)))
    return float(step), float(reach * np.sqrt(2.0 * scale / bend)), True


def _aligned(samples: InertialSamples, track: GnssTrack) -> tuple[NavigationState, Alignment]:
    first, last = find_rest(samples, track)
    # a receiver calls it a rest a moment late and early
    begin, stop = max(first + 0.25, float(samples.time[0])), last - 0.5
    alignment = align_in_motion(samples, track, begin, max(min(_REST, stop - begin), 0.5))
    still = (track.time >= begin) & (track.time <= stop)
    still[int(np.argmin(np.abs(track.time - begin)))] = True
    latitude, longitude, height = (float(np.median(column[still])) for column in track.position)
    at = (latitude, longitude, height)
    return NavigationState(begin, *at, np.zeros(3), alignment.C_nb), alignment


# Correlation of course and gyros about down from which on they are of one motion.
_AGREES = 0.8
# A gyro's scale is off by no more in any unit that works.
_LARGEST_SLOPE = 1.3
# Less motion, s, and fewer turns in all, rad, show nothing.
_SHORT, _FEW_TURNS = 20.0, 1.0


def refuse_other_motion(samples: InertialSamples, track: GnssTrack) -> float:
    """Refuse gyros that do not turn with a track's course; return how they correlate about down, 1 at best.

    Parameters
    ----------
    samples : taken to be in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If they do not turn together, or not as fast, or there is too little motion to see it.
    """
    times, course_rate, weights = find_course_rate(track)
    grid, yaw_rate = rate_about_down(samples)
    about = correlate(grid, yaw_rate, times, course_rate, weights)
    inside = seen_by(grid, yaw_rate, times) & (weights > 0.0)
    course = course_rate[inside] - (course_rate[inside].mean() if inside.any() else 0.0)
    if not about > _AGREES:
        seconds = float(inside.sum()) * track.interval
        turns = float(np.abs(course).sum()) * track.interval
        if seconds < _SHORT or turns < _FEW_TURNS:
            raise RecordingError(
                f"{seconds:.0f} s of motion with {np.degrees(turns):.0f} degrees of turns are too little to "
                "see whether gyros and course go together: take a longer part of the drive, with turns."
            )
        raise _other_motion(f"correlate at {about:.2f} of 1")
    seen = np.interp(times[inside], grid, yaw_rate)
    seen = seen - seen.mean()
    slope = float(seen @ course) / max(float(seen @ seen), 1e-300)
    if not 1.0 / _LARGEST_SLOPE < slope < _LARGEST_SLOPE:
        raise _other_motion(f"differ by a factor of {slope:.3g}")
    return float(about)


def _other_motion(how: str) -> RecordingError:
    return RecordingError(
        f"IMU and positions do not describe one motion: the gyros' rate about the vertical and the course's {how}. A "
        "unit, an axis or a sign of a column is another, or the clocks are apart: check the columns with `tumble "
        "inspect`."
    )
