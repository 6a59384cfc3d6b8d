"""The loosely coupled filter, aided by positions and velocities, and its smoother.

Where samples are missing it stops, and starts anew after them. Smoothing: every state by all fixes, those before it
and those after.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vector, Vectors
from tumble.attitude import matrix_from_angles
from tumble.errors import RecordingError, UsageError
from tumble.navigation.filter.setup import FilterSetup
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.mechanisation import samples_from
from tumble.navigation.samples import InertialSamples
from tumble.navigation.time_alignment import track_velocities
from tumble.navigation.trajectory import NavigationState, Trajectory, position_differences
from tumble.records import dataclass


@dataclass(frozen=True)
class SmoothedRun:
    """A filter's run, smoothed.

    Attributes
    ----------
    trajectory : at the filter's events.
    sensors : (events, states).
    sigmas : (events, 9 + states) one standard deviation.
    covariances : (events, n, n).
    setup : of the filter.
    """

    trajectory: Trajectory
    sensors: Table
    sigmas: Table
    covariances: AnyArray
    setup: FilterSetup


def smooth(run: FilterRun) -> SmoothedRun:
    """Return the Rauch-Tung-Striebel smoother's result for a filter's run.

    The filter takes its errors out at every fix, so that they are zero after it: what the future says of them
    is carried back and taken out of each event's state once.

    Parameters
    ----------
    run : with `keep_covariances`.

    Raises
    ------
    UsageError
        If the run kept no covariances.
    """
    from tumble.navigation.filter.kernels import apply_errors

    events = len(run.trajectory)
    if len(run.covariances) != events:
        raise UsageError(
            "This run kept no covariances to smooth with: run the filter with keep_covariances=True."
        )
    navs, sensors = run.trajectory.packed, run.sensors.copy()
    covariances = run.covariances.copy()
    error = np.zeros(covariances.shape[1])
    for i in range(events - 2, -1, -1):
        gain = _smoothing_gain(run.covariances[i], run.transitions[i + 1], run.predicted[i + 1])
        error = gain @ (run.errors[i + 1] + error)
        spread = gain @ (covariances[i + 1] - run.predicted[i + 1]) @ gain.T
        covariances[i] += 0.5 * (spread + spread.T)
        apply_errors(navs[i], sensors[i], error)
    sigmas = np.sqrt(np.maximum(np.einsum("ijj->ij", covariances), 0.0))
    return SmoothedRun(unpacked(run.time, navs), sensors, sigmas, covariances, run.setup)


def _smoothing_gain(covariance: AnyArray, transition: AnyArray, predicted: AnyArray) -> AnyArray:
    """P Phi' inverse(P_predicted), with states scaled to one sigma; those without variance are left alone."""
    scale = np.sqrt(np.diag(predicted))
    scale = np.where(scale > 0.0, scale, 1.0)
    normal = predicted / np.outer(scale, scale)
    normal[np.diag_indices_from(normal)] += np.where(np.diag(predicted) > 0.0, 1e-14, 1.0)
    solved = np.linalg.solve(normal, (transition @ covariance) / scale[:, None])
    return (solved / scale[:, None]).T


# Between samples further apart than this many usual intervals the motion is unknown.
_GAP = 3.5


@dataclass(frozen=True)
class FilterRun:
    """What a filter found, at each fix and at each instant that was asked for.

    Attributes
    ----------
    trajectory : after each event.
    sensors : (events, states) estimates of the sensor states.
    sigmas : (events, 9 + states) one standard deviation of every state.
    errors : (events, 9 + states) what was taken out of the states there.
    covariances, predicted, transitions : (events, n, n) after, before, and since the event before; or of no
        rows, when they were not to be kept.
    fixes : (fixes,) index of each fix used in the track that was given.
    fix_events : (fixes,) its event.
    innovations, innovation_sigmas : (fixes, 6) position (m) and velocity (m/s) in n, predicted less observed; NaN
        where not used.
    distances : (fixes, 2) squared normalised innovations of position and velocity, each chi-square of three.
    taken : (fixes, 2) whether they passed the gate.
    setup : with which it ran.
    """

    trajectory: Trajectory
    sensors: Table
    sigmas: Table
    errors: Table
    covariances: AnyArray
    predicted: AnyArray
    transitions: AnyArray
    fixes: np.ndarray
    fix_events: np.ndarray
    innovations: Table
    innovation_sigmas: Table
    distances: Table
    taken: np.ndarray
    setup: FilterSetup

    @property
    def time(self) -> Series:
        """(events,) s."""
        return self.trajectory.time

    @property
    def refused(self) -> np.ndarray:
        """Index in the track of each fix of which position or velocity did not pass the gate."""
        seen = np.isfinite(self.distances)
        return self.fixes[(seen & ~self.taken).any(axis=1)]

    def sensor(self, name: str) -> tuple[float, float]:
        """Return the last estimate of a sensor state and its standard deviation.

        Raises
        ------
        UsageError
            If no state has that name.
        """
        names = [state.name for state in self.setup.states]
        if name not in names:
            raise UsageError(f"The filter has no state {name!r}; it has {', '.join(names)}.")
        at = names.index(name)
        return float(self.sensors[-1, at]), float(self.sigmas[-1, 9 + at])


def _run_stretch(
    track: GnssTrack,
    samples: InertialSamples,
    start: NavigationState,
    setup: FilterSetup,
    sensors: Series,
    *,
    velocities: bool,
    positions: bool,
    instants: Series | None,
    keep_covariances: bool,
) -> tuple[FilterRun, Table]:
    """Run over samples of which none are missing for long, and return the covariance after the last event, too."""
    from tumble.navigation.filter.kernels import run

    part = samples_from(samples, start)
    inside = np.flatnonzero((track.time > start.time) & (track.time <= part.time[-1]))
    _refuse_no_overlap(samples, track, inside, start.time)
    _refuse_no_covariance(track, inside)
    event_time, event_fix = _events(track.time[inside], instants, start.time, float(part.time[-1]))
    fixes, events = len(inside), len(event_time)
    n = 9 + len(setup.states)
    navs, kept = np.empty((events, 10)), events if keep_covariances else 0
    at_events = np.zeros((events, n - 9)), np.empty((events, n)), np.zeros((events, n))
    whole, innovations = np.empty((3, kept, n, n)), np.full((2, fixes, 6), np.nan)
    distances = np.full((fixes, 2), np.nan)
    taken = np.zeros((fixes, 2), dtype=bool)
    covariance = setup.covariance
    run(
        np.ascontiguousarray(part.time),
        np.hstack([part.angular_rate_ib_b, part.specific_force_b]),
        part.means,
        max(1, round(setup.block / part.interval)),
        _GAP * part.interval,
        _unseen(part),
        start.packed,
        sensors.astype(float),
        covariance,
        setup.places,
        np.array([(state.decay, state.drive) for state in setup.states], dtype=float).reshape(-1, 2),
        np.concatenate([setup.angle_random_walk, setup.velocity_random_walk]).astype(float) ** 2,
        setup.nominal,
        event_time,
        event_fix,
        *_fixes(track.rows(inside), positions=positions, velocities=velocities),
        _gate(setup.gate),
        setup.patience,
        navs,
        *at_events,
        whole,
        innovations,
        distances,
        taken,
    )
    trajectory, events_of_fixes = unpacked(event_time, navs), np.flatnonzero(event_fix >= 0)
    of_states = *at_events, whole[0], whole[1], whole[2]
    of_fixes = inside, events_of_fixes, innovations[0], innovations[1], distances, taken
    found = FilterRun(trajectory, *of_states, *of_fixes, setup)
    return found, covariance


def _fixes(track: GnssTrack, *, positions: bool, velocities: bool) -> tuple[AnyArray, AnyArray, np.ndarray]:
    """Positions and velocities, their covariances, and which of both are used: two rows a fix."""
    both = np.column_stack(track.position), track.velocity_n
    covariances = track.position_covariance_n, track.velocity_covariance_n
    used = np.full(len(track), positions), track.has_velocity & velocities
    return np.stack(both, 1, dtype=float), np.stack(covariances, 1, dtype=float), np.column_stack(used)


def unpacked(time: Series, navs: Table) -> Trajectory:
    """Return the trajectory of packed local-level states, (instants, 10)."""
    position, velocity_n, quaternion = map(np.ascontiguousarray, np.split(navs, [3, 6], axis=1))
    return Trajectory(time, position[:, 0], position[:, 1], position[:, 2], velocity_n, quaternion)


def _refuse_no_overlap(samples: InertialSamples, track: GnssTrack, inside: np.ndarray, begin: float) -> None:
    if len(inside):
        return
    if not len(track):
        raise RecordingError(f"The track {track.name} has no fix.")
    raise RecordingError(
        f"IMU and GNSS do not overlap in time: the IMU's samples run from {begin:.3f} to {samples.time[-1]:.3f} s "
        f"and the fixes from {track.time[0]:.3f} to {track.time[-1]:.3f} s. Bring both onto one clock (estimate the "
        "time offset), or check that the files belong together."
    )


def _refuse_no_covariance(track: GnssTrack, inside: np.ndarray) -> None:
    try:
        np.linalg.cholesky(track.position_covariance_n[inside])
    except np.linalg.LinAlgError as error:
        raise RecordingError(
            f"The track {track.name} states a covariance of a position that cannot be one (not positive definite): "
            "give its standard deviations without correlations."
        ) from error


def _events(fixes: Series, instants: Series | None, start: float, stop: float) -> tuple[Series, np.ndarray]:
    """Times of all events in order, and the index of the fix at each, or -1."""
    asked = np.zeros(0) if instants is None else np.asarray(instants, dtype=float)
    asked = asked[(asked >= start) & (asked <= stop)]
    # an instant that is a fix's is that fix's
    near = np.searchsorted(fixes, asked - 1e-6)
    same = (near < len(fixes)) & (np.abs(fixes[np.minimum(near, len(fixes) - 1)] - asked) <= 1e-6)
    asked = asked[~same]
    time = np.concatenate([fixes, asked])
    index = np.concatenate([np.arange(len(fixes)), np.full(len(asked), -1)]).astype(np.int64)
    order = np.argsort(time, kind="stable")
    return np.ascontiguousarray(time[order]), np.ascontiguousarray(index[order])


def _gate(probability: float) -> float:
    """The limit that a chi-square of three exceeds with a probability; infinite for zero."""
    from scipy.special import chdtri

    return float(chdtri(3.0, probability)) if probability > 0.0 else float("inf")


def _unseen(samples: InertialSamples) -> Series:
    """What rate and force may do in a gap, (6,): the rms of rate and of force about its mean in the recording."""
    rate: Vectors = samples.angular_rate_ib_b
    return np.concatenate([np.sqrt(np.mean(rate**2, axis=0)), np.std(samples.specific_force_b, axis=0)])


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
    run = partial(
        _run_stretch,
        track,
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
        there = _covariance_after(covariance, sigmas, carried, seconds, setup)
        known = replace(setup, whole_covariance=there)
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
        time, latitude, longitude, height = (float(x[row]) for x in (guide.time, *guide.position))
        antenna = NavigationState(time, latitude, longitude, height, velocity[row].copy(), attitude)
        return antenna.beside(-lever_arm_b)
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
