"""The filter over a whole recording: where samples are missing it stops, and starts anew after them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Table, Vector, Vectors
from tumble.attitude.quaternions import matrix_from_angles
from tumble.earth import curvature_radii
from tumble.navigation.course import track_velocities
from tumble.navigation.filter.run import FilterRun, run_stretch
from tumble.navigation.filter.setup import FilterSetup
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import NavigationState, Trajectory, position_differences

# Missing samples are bridged by a straight line up to this, s; a vehicle turns a corner in more.
LONGEST_BRIDGED = 1.0
# A course tells the heading from this speed on, m/s: nobody reverses as fast.
_FAST = 3.0
# Beside what the filter knew: slip, slope, and a mounting found from a moving vehicle, rad.
_TILT, _HEADING = 0.05, 0.07
# Fixes that must have seen the vehicle move forward before its course can tell a heading.
_FEWEST = 5


def run_filter(
    samples: InertialSamples,
    track: GnssTrack,
    start: NavigationState,
    setup: FilterSetup,
    *,
    velocities: bool = False,
    positions: bool = True,
    instants: Series | None = None,
    keep_covariances: bool = False,
    reference: GnssTrack | None = None,
) -> FilterRun:
    """Run the error-state filter over a track.

    Where samples are missing for more than a second it stops, and starts anew at a fix after them: with the
    position and velocity of that fix, the tilt that it had, and the heading that course and mounting tell. What
    it knew of the sensors it keeps. Fixes and instants in between have no event. Shorter gaps are bridged by a
    straight line, with as much more uncertainty as rate and force usually change.

    Parameters
    ----------
    samples : of the IMU, corrected by what is known of it.
    track : on the IMU's clock (`GnssTrack.shifted`).
    start : where it begins, in truth to within `setup.navigation_covariance`.
    setup : states and noise.
    velocities, positions : whether the track's velocities and positions are taken.
    instants : (instants,) s at which the state is kept too, beside the fixes.
    keep_covariances : keep what smoothing and consistency tests need; 24 n² bytes an event.
    reference : track whose courses tell the heading after missing samples, denser than `track`; None for `track`.

    Raises
    ------
    RecordingError
        If samples and track do not overlap in time, the start lies outside the samples, or a fix's covariance is none.
    UsageError
        If the start is at a pole, where the local level has no north.
    """

    def run(
        part: InertialSamples, at: NavigationState, own: FilterSetup, known: Series
    ) -> tuple[FilterRun, Table]:
        return run_stretch(
            part,
            track,
            at,
            own,
            known,
            velocities=velocities,
            positions=positions,
            instants=instants,
            keep_covariances=keep_covariances,
        )

    unknown = np.zeros(len(setup.states))
    gaps = [gap for gap in samples.missing(LONGEST_BRIDGED) if gap[0] > start.time]
    if not gaps or not positions or not np.any((track.time > start.time) & (track.time <= gaps[0][0])):
        return run(samples, start, setup, unknown)[0]
    whole, covariance = run(samples.between(start.time, gaps[0][0]), start, setup, unknown)
    guide = track if reference is None else reference
    ends = [*(gap[0] for gap in gaps[1:]), float(samples.time[-1])]
    for (_, begin), end in zip(gaps, ends, strict=True):
        state = _state_after(whole.trajectory, setup.lever_arm_b, guide, begin, end)
        if state is None or not np.any((track.time > state.time) & (track.time <= end)):
            continue
        seconds = state.time - float(whole.time[-1])
        carried = np.exp(-np.array([own.decay for own in setup.states]) * seconds)
        sigmas = _sigmas_after(whole, guide, state)
        known = replace(
            setup, whole_covariance=_covariance_after(covariance, sigmas, carried, seconds, setup)
        )
        part, covariance = run(samples.between(state.time, end), state, known, carried * whole.sensors[-1])
        whole = _joined(whole, part, carried)
    return replace(whole, setup=setup)


def _state_after(
    before: Trajectory, lever_arm_b: Vector, guide: GnssTrack, begin: float, end: float
) -> NavigationState | None:
    """The state at the first fix after missing samples that determines it, or None where none does."""
    velocity = track_velocities(guide)
    speed = np.sqrt(np.nansum(velocity[:, :2] ** 2, axis=1))
    inside = np.flatnonzero((guide.time >= begin) & (guide.time < end) & _fits_neighbours(guide, velocity))
    C_nb = before.state(-1).C_nb
    forward_b = _forward(before, guide, velocity)
    for row in inside.tolist():
        if speed[row] > _FAST and forward_b is not None:
            ahead = C_nb @ forward_b
            turn = np.arctan2(velocity[row, 1], velocity[row, 0]) - np.arctan2(ahead[1], ahead[0])
            attitude = matrix_from_angles(np.array([0.0, 0.0, float(turn)])) @ C_nb
        elif _still_there(before, guide, row, float(speed[row])):
            attitude = C_nb
        else:
            continue
        arm_n = attitude @ lever_arm_b
        latitude, height = float(guide.latitude[row]), float(guide.height[row])
        meridian, across = (float(radius[0]) + height for radius in curvature_radii(np.array([latitude])))
        return NavigationState(
            float(guide.time[row]),
            latitude - float(arm_n[0]) / meridian,
            float(guide.longitude[row]) - float(arm_n[1]) / (across * float(np.cos(latitude))),
            height + float(arm_n[2]),
            velocity[row].copy(),
            attitude,
        )
    return None


def _forward(before: Trajectory, guide: GnssTrack, velocity: Vectors) -> Vector | None:
    """The direction in which the vehicle moves, in b, by the attitudes so far; None where it hardly moved."""
    rows = np.searchsorted(guide.time, before.time - 1e-6)
    rows = np.minimum(rows, len(guide) - 1)
    speed = np.hypot(velocity[rows, 0], velocity[rows, 1])
    moving = (np.abs(guide.time[rows] - before.time) < 1e-3) & (np.nan_to_num(speed) > _FAST)
    if np.count_nonzero(moving) < _FEWEST:
        return None
    # the last minute or so: there the filter has found the heading
    at = np.flatnonzero(moving)[-60:]
    course = velocity[rows[at]] * [1.0, 1.0, 0.0] / speed[at, None]
    seen = np.einsum("ijk,ij->ik", before.C_nb[at], course)
    mean = np.median(seen, axis=0)
    return mean / float(np.sqrt(mean @ mean))


def _still_there(before: Trajectory, guide: GnssTrack, row: int, speed: float) -> bool:
    """Whether the vehicle stood before the missing samples, and stands there now."""
    last = before.rows(np.array([-1]))
    apart = position_differences(last.position, guide.rows(slice(row, row + 1)).position)[0, :2]
    sigma = float(np.sqrt(np.trace(guide.position_covariance_n[row][:2, :2])))
    slow = max(speed, float(np.hypot(*last.velocity_n[0, :2]))) < 0.3
    return slow and float(np.hypot(*apart)) < 3.0 + 3.0 * sigma


def _fits_neighbours(guide: GnssTrack, velocity: Vectors) -> np.ndarray:
    """Fixes whose way to the next one is that of their velocity: no outlier."""
    good: np.ndarray = np.asarray(np.isfinite(velocity).all(axis=1))
    good[-1:] = False
    way = position_differences(guide.rows(slice(1, None)).position, guide.rows(slice(None, -1)).position)
    span = np.diff(guide.time)
    sigma = np.sqrt(np.einsum("ijj->i", guide.position_covariance_n))
    left = way - 0.5 * (velocity[1:] + velocity[:-1]) * span[:, None]
    good[:-1] &= np.sqrt(np.nansum(left**2, axis=1)) < 0.5 + span**2 + 3.0 * np.hypot(sigma[1:], sigma[:-1])
    return good


def _sigmas_after(before: FilterRun, guide: GnssTrack, state: NavigationState) -> Series:
    row = int(np.argmin(np.abs(guide.time - state.time)))
    speed = float(np.sqrt(state.velocity_n @ state.velocity_n))
    position = np.sqrt(np.diag(guide.position_covariance_n[row])) + 0.02 * speed
    stated = np.sqrt(np.diag(guide.velocity_covariance_n[row]))
    velocity = np.where(np.isfinite(stated), 2.0 * stated + 0.05, 0.5)
    attitude = np.hypot(before.sigmas[-1, 6:9], [_TILT, _TILT, _HEADING])
    return np.concatenate([position, velocity, attitude])


def _covariance_after(
    covariance: Table, sigmas: Series, carried: Series, seconds: float, setup: FilterSetup
) -> Table:
    """Of all states: navigation anew, sensors as they were with their own walks since."""
    after = np.zeros_like(covariance)
    after[:9, :9] = np.diag(sigmas**2)
    after[9:, 9:] = covariance[9:, 9:] * np.outer(carried, carried)
    for at, state in enumerate(setup.states):
        span = seconds if state.decay == 0.0 else (1.0 - carried[at] ** 2) / (2.0 * state.decay)
        after[9 + at, 9 + at] += state.drive * span
    return after


def _joined(before: FilterRun, after: FilterRun, carried: Series) -> FilterRun:
    """Two runs as one; between them nothing of position, velocity and attitude is carried over."""
    transitions = after.transitions.copy()
    if len(transitions):
        keep = np.concatenate([np.zeros(9), carried])
        transitions[0] = transitions[0] * keep[None, :]
    both = [np.concatenate(pair) for pair in zip(_columns(before), _columns(after), strict=True)]
    one = {
        name: np.concatenate([getattr(before, name), getattr(after, name)])
        for name in (
            *("sensors", "sigmas", "errors", "covariances", "predicted"),
            *("fixes", "innovations", "innovation_sigmas", "distances", "taken"),
        )
    }
    return replace(
        before,
        trajectory=Trajectory(*both),
        transitions=np.concatenate([before.transitions, transitions]),
        fix_events=np.concatenate([before.fix_events, after.fix_events + len(before.time)]),
        **one,
    )


def _columns(run: FilterRun) -> tuple[Series | Table, ...]:
    own = run.trajectory
    return own.time, *own.position, own.velocity_n, own.quaternion_nb
