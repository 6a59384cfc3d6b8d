"""The loosely coupled filter over one stretch of samples, aided by positions and velocities, and its smoother.

Smoothing: every state by all fixes, those before it and those after.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.errors import RecordingError, UsageError
from tumble.navigation.filter.setup import FilterSetup
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import HIGHEST_LATITUDE, NavigationState, Trajectory
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


def run_stretch(
    samples: InertialSamples,
    track: GnssTrack,
    start: NavigationState,
    setup: FilterSetup,
    sensors: Series,
    *,
    velocities: bool,
    positions: bool,
    instants: Series | None,
    keep_covariances: bool,
) -> tuple[FilterRun, Table]:
    """Run the error-state filter over samples of which none are missing for long.

    Parameters
    ----------
    samples, track, start, setup, velocities, positions, instants, keep_covariances : as for
        `tumble.navigation.run_filter`.
    sensors : (states,) estimates to begin with.

    Returns
    -------
    run : at each event.
    covariance : (n, n) after the last one.

    Raises
    ------
    RecordingError
        If samples and track do not overlap in time, the start lies outside the samples, or a fix's covariance is none.
    UsageError
        If the start is at a pole, where the local level has no north.
    """
    from tumble.navigation.filter.kernels import run

    part = _from_start(samples, start)
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


def _from_start(samples: InertialSamples, start: NavigationState) -> InertialSamples:
    if abs(start.latitude) > HIGHEST_LATITUDE:
        raise UsageError(
            f"At a latitude of {np.degrees(start.latitude):.3f} degrees the local level has no north to hold, and "
            "the filter works in it: there is no way to run it at a pole."
        )
    if not samples.time[0] <= start.time < samples.time[-1]:
        raise RecordingError(
            f"The start at {start.time:.3f} s is not inside the IMU's samples, which run from "
            f"{samples.time[0]:.3f} to {samples.time[-1]:.3f} s."
        )
    if start.time == samples.time[0]:
        return samples
    return samples.between(start.time, float(samples.time[-1]))


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
