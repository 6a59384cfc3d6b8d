"""Where a body lies at the start: levelling, heading by the Earth's rotation, and heading from motion.

Errors are ``phi`` of ``C_nb_estimate = exp(-skew(phi)) C_nb``. At rest the specific force is minus gravity and the
rate the Earth's; errors ``df``, ``dw`` of the two, in n, make

``phi_east = -df_north / g``, ``phi_north = df_east / g`` and, by gyrocompassing,
``phi_down = dw_east / (Omega cos(latitude)) - phi_north tan(latitude)``.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Series, Table, Vector
from tumble.attitude import angles_from_matrices, matrix_from_angles
from tumble.earth import EARTH_RATE, normal_gravity
from tumble.errors import ObservabilityError, RecordingError
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.mechanisation import navigate
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import NavigationState
from tumble.records import dataclass

# A heading by gyrocompassing is refused beyond this standard uncertainty.
WORST_HEADING = float(np.radians(5.0))
# s of motion after a rest that tell a heading.
_MOTION = 10.0
# s of motion whose velocities are compared; rad, how well a rest determines the level: accelerometer bias over gravity.
_COMPARED, _TILT = 60.0, 0.02


@dataclass(frozen=True)
class Alignment:
    """An attitude found at rest or from motion, and how well.

    Attributes
    ----------
    C_nb : (3, 3).
    covariance : (3, 3) rad² of phi in n.
    method : in words.
    """

    C_nb: Matrix
    covariance: Matrix
    method: str

    @property
    def roll_pitch_yaw(self) -> Vector:
        """(3,) rad."""
        return angles_from_matrices(self.C_nb[None])[0]

    @property
    def sigmas(self) -> Vector:
        """(3,) rad, one standard deviation of phi about north, east and down (the heading)."""
        return np.sqrt(np.diag(self.covariance))

    def __str__(self) -> str:
        """One sentence for the user."""
        roll, pitch, yaw = np.degrees(self.roll_pitch_yaw)
        tilt, heading = np.degrees([np.hypot(*self.sigmas[:2]) / np.sqrt(2.0), self.sigmas[2]])
        return (
            f"Roll {roll:.3f}, pitch {pitch:.3f} degrees (standard uncertainty {tilt:.2g}), heading {yaw % 360.0:.3f} "
            f"degrees ({heading:.2g}), by {self.method}."
        )


def align_coarse(
    samples: InertialSamples,
    latitude: float,
    *,
    accelerometer_sigma: float,
    gyroscope_sigma: float,
) -> Alignment:
    """Return the attitude of a body at rest by levelling and gyrocompassing.

    Parameters
    ----------
    samples : at rest all along (`InertialSamples.between`).
    latitude : of the place, rad; at sea level.
    accelerometer_sigma, gyroscope_sigma : m/s², rad/s, one sigma an axis of the mean: the bias that is left, and
        the noise of the mean.

    Raises
    ------
    RecordingError
        If the specific force is not gravity's within 5 %: no rest, wrong units, or far from calibrated.
    ObservabilityError
        If the gyros cannot tell the heading better than 5 degrees.
    """
    rows = slice(1, None) if samples.means else slice(None)
    force = samples.specific_force_b[rows].mean(axis=0)
    gravity = normal_gravity(latitude)
    _refuse_no_rest(force, gravity, samples.time[0])
    down = -force / np.sqrt(force @ force)
    rate = samples.angular_rate_ib_b[rows].mean(axis=0)
    level_rate = EARTH_RATE * np.cos(latitude)
    sigma = np.hypot(gyroscope_sigma / level_rate, np.tan(latitude) * accelerometer_sigma / gravity)
    if sigma > WORST_HEADING:
        raise ObservabilityError(
            f"The gyros cannot determine the heading: a standard uncertainty of {gyroscope_sigma:.2g} "
            f"rad/s is {min(np.degrees(sigma), 180.0):.0f} degrees of heading at a latitude of "
            f"{np.degrees(latitude):.1f} degrees. Align in motion with satellite positions."
        )
    east = np.cross(down, rate)
    east /= np.sqrt(east @ east)
    C_nb = np.vstack([np.cross(east, down), east, down])
    jacobian = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) / gravity
    jacobian[2] = -np.tan(latitude) * jacobian[0]
    covariance = accelerometer_sigma**2 * (jacobian @ jacobian.T)
    covariance[2, 2] += (gyroscope_sigma / level_rate) ** 2
    return Alignment(C_nb, covariance, "levelling and gyrocompassing")


def align_in_motion(
    samples: InertialSamples,
    track: GnssTrack,
    start: float,
    rest: float,
) -> Alignment:
    """Return the attitude at `start` from a short rest there and the drive after it; no mounting is assumed.

    The rest gives the level and the gyros' bias. The samples are then navigated freely with a heading of zero:
    by how much their changes of velocity are turned against the track's is the heading.

    Parameters
    ----------
    samples : in SI.
    track : on the IMU's clock, with velocities or positions close enough to make them.
    start : s, when the rest begins.
    rest : s of it.

    Raises
    ------
    RecordingError
        If there is no rest, or the track's velocity does not change by a metre a second after it.
    """
    from tumble.navigation.time_alignment import slowest_course, track_velocities

    still = samples.between(start, start + rest)
    row = int(np.argmin(np.abs(track.time - start)))
    position = (float(track.latitude[row]), float(track.longitude[row]), float(track.height[row]))
    force = still.specific_force_b.mean(axis=0)
    _refuse_no_rest(force, normal_gravity(position[0], position[2]), start)
    down = -force / np.sqrt(force @ force)
    velocity = track_velocities(track)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead = (track.time > start + rest) & np.isfinite(speed)
    moving = ahead & (speed > min(1.0, slowest_course(track)))
    if not moving.any():
        raise RecordingError(
            f"The track {track.name} does not move after {start:.1f} s: nothing determines the heading."
        )
    begin = float(track.time[np.argmax(moving)])
    # whole seconds from one fix to another: round-off of the stamps decides nothing
    chosen = ahead & (track.time > begin - 3.0 - 1e-6) & (track.time < begin + _COMPARED + 1e-6)
    chosen &= track.time < _next_missing(samples, start)
    time = track.time[chosen]
    bias = still.angular_rate_ib_b.mean(axis=0)
    part = samples.between(start, float(time[-1]) + 1e-6)
    level = NavigationState(start, *position, np.zeros(3), _levelled(down))
    run = navigate(
        InertialSamples(part.time, part.specific_force_b, part.angular_rate_ib_b - bias, part.means), level
    )
    turn, sigma = _turn_between(_steps(run.time, run.velocity_n, time), _steps(time, velocity[chosen], time))
    covariance = np.diag([_TILT**2, _TILT**2, sigma**2])
    return Alignment(
        _turned_about_down(_levelled(down), turn), covariance, "levelling, and the heading from motion"
    )


_SHORTEST_REST = 2.0  # s


def find_rest(samples: InertialSamples, track: GnssTrack) -> tuple[float, float]:
    """Return start and stop (s) of the first rest of a track that lies in the samples and is followed by motion.

    Rests after which samples are missing before ten seconds of motion are taken only where there is no other.

    Parameters
    ----------
    samples : in SI.
    track : on the IMU's clock.

    Raises
    ------
    RecordingError
        If there is no such rest.
    """
    from tumble.navigation.time_alignment import slowest_course, track_velocities

    velocity = track_velocities(track)
    # as slow as its own noise, of which four sigmas are allowed
    noise = (
        np.sqrt(np.nanmedian(np.einsum("ijj->ij", track.velocity_covariance_n)))
        if track.has_velocity.any()
        else 0.0
    )
    slow = np.sqrt(np.nansum(velocity**2, axis=1)) < max(0.1, 4.0 * float(noise))
    slow &= (
        np.isfinite(velocity).all(axis=1) & (track.time >= samples.time[0]) & (track.time < samples.time[-1])
    )
    for begin, end in samples.missing():
        slow &= (track.time < begin - 0.5) | (track.time > end + 0.5)
    edges = np.diff(np.concatenate([[0], slow.astype(int), [0]]))
    found: list[tuple[float, float]] = []
    moving = np.nan_to_num(np.hypot(velocity[:, 0], velocity[:, 1])) > min(1.0, slowest_course(track))
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True):
        if track.time[last] - track.time[first] < _SHORTEST_REST:
            continue
        found.append((float(track.time[first]), float(track.time[last])))
        onset = track.time[last:][moving[last:]]
        if len(onset) and onset[0] + _MOTION <= _next_missing(samples, found[-1][0]):
            return found[-1]
    if found:
        return found[0]
    raise RecordingError(
        f"The track {track.name} has no rest of {_SHORTEST_REST:g} s inside the IMU's samples to align at: give "
        "the attitude."
    )


def _next_missing(samples: InertialSamples, after: float) -> float:
    """When the first samples are missing, or all end."""
    return min([begin for begin, _ in samples.missing() if begin >= after], default=float(samples.time[-1]))


def _refuse_no_rest(force: Vector, gravity: float, at: float) -> None:
    norm = float(np.sqrt(force @ force))
    if abs(norm - gravity) > 0.05 * gravity:
        raise RecordingError(
            f"At {at:.1f} s the mean specific force is {norm:.3f} m/s², and gravity there is "
            f"{gravity:.3f}. The body does not rest, the unit of the accelerometers is another, or "
            "they are far from calibrated."
        )


def _levelled(down: Vector) -> Matrix:
    """C_nb with the body's x axis to the north (its y axis, where x is within 5 degrees of the vertical)."""
    forward = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < 0.996 else np.array([0.0, 1.0, 0.0])
    north = forward - down * float(down @ forward)
    north /= np.sqrt(north @ north)
    return np.vstack([north, np.cross(down, north), down])


def _turned_about_down(C_nb: Matrix, angle: float) -> Matrix:
    return matrix_from_angles(np.array([0.0, 0.0, angle])) @ C_nb


def _steps(time: Series, velocity: Table, instants: Series) -> np.ndarray:
    """Changes of the horizontal velocity over a second or the usual interval, as complex numbers."""
    north, east = (np.interp(instants, time, velocity[:, axis]) for axis in (0, 1))
    usual = float(np.median(np.diff(instants)))
    apart = max(1, round(1.0 / usual))
    whole = north + 1j * east
    change = whole[apart:] - whole[:-apart]
    # where fixes are missing the span is longer, and what drifts weighs more in it
    return change[instants[apart:] - instants[:-apart] < 1.5 * apart * usual]


def _turn_between(free: np.ndarray, seen: np.ndarray) -> tuple[float, float]:
    """By how much the changes seen are turned against the free ones, with a standard uncertainty."""
    strength = float(np.sum(np.abs(free) ** 2))
    if strength < 1.0 or float(np.sum(np.abs(seen) ** 2)) < 1.0:
        raise RecordingError(
            "The velocity changes by less than a metre a second after the rest: that gives no heading."
        )
    # an error of the level is a constant acceleration in n: both are compared about their means
    free, seen = free - free.mean(), seen - seen.mean()
    turn = float(np.angle(np.sum(np.conj(free) * seen)))
    strength = float(np.sum(np.abs(free) ** 2))
    left = seen - np.exp(1j * turn) * free
    # neighbouring steps overlap and drift together: five of them count as one
    variance = 5.0 * float(np.sum(np.abs(left) ** 2)) / (2.0 * len(left) * strength)
    return turn, float(np.sqrt(variance) + np.radians(0.5))
