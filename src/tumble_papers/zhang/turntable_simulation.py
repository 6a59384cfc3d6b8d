"""The simulation of Zhang et al. (2010), section 5.1: a unit on a table, dwells and rotation pairs.

One run is one unit with the errors that are set: some attitudes at rest, and rotations about fixed
horizontal axes, each once in either direction. Every sample is drawn (`sampled=True`), or the same numbers
are drawn as what is evaluated of them: means, integrals and scatter matrices, by their exact distributions.

Chosen, because the paper does not print it: T is read exactly (sensing axes of unit length), the
inter-triad angles as a rotation vector; the latitude is Changsha's; the rotation axes point north. Each
attitude is reached from z up and x north by the shortest way. The table turns by what it is told plus its
error; what is read is what it is told. The perturbed acceleration is white, of its standard deviation in
every sample of a rotation; a lever arm adds a constant to a steady rotation.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector, Vectors
from tumble.counting import counted
from tumble.earth.site import EARTH_RATE
from tumble.sensor.conventions.zhang import inter_triad_rotation, matrix_from_zhang
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.published import zhang

GRAVITY = 9.8  # m/s²: 612.24 µg are 0.006 m/s²
MICRO_G = 1e-6 * GRAVITY
LATITUDE = np.radians(28.2)

# No. 1 to 18. The paper has the misalignments seen best in no. 2, 4, 6, 8, 10 and 12 to 18, which are then the
# twelve edges; the others are the faces. The nine, no. 1 to 7, 9 and 11, have three edges, one in each plane.
# What these leave out is singular only if the product of their signs is +1, as the paper's was.
_TOWARDS = np.array(
    [
        *([1, 0, 0], [1, 1, 0], [-1, 0, 0], [1, 0, 1], [0, 1, 0], [0, 1, 1]),
        *([0, -1, 0], [1, -1, 0], [0, 0, 1], [1, 0, -1], [0, 0, -1], [0, 1, -1]),
        *([-1, 1, 0], [-1, -1, 0], [-1, 0, 1], [-1, 0, -1], [0, -1, 1], [0, -1, -1]),
    ],
    dtype=float,
)
ORIENTATIONS = _TOWARDS / np.linalg.norm(_TOWARDS, axis=1, keepdims=True)
NINE: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 9, 11)
LEFT_OUT: tuple[int, ...] = (8, 10, 12, 13, 14, 15, 16, 17, 18)
# x, y, z and one edge in each plane.
AXES = ORIENTATIONS[[0, 4, 8, 1, 3, 5]]


@dataclass(frozen=True, slots=True)
class Unit:
    """The truth of a simulated unit; raw = matrix @ true + bias, true vectors in p.

    Attributes
    ----------
    force_matrix, force_bias : of the accelerometers, lower triangular; counts per m/s² and counts.
    rate_matrix, rate_bias : of the gyros, K T in their own frame o; counts per rad/s and counts.
    rotation : R_p^o.
    """

    force_matrix: Matrix
    force_bias: Vector
    rate_matrix: Matrix
    rate_bias: Vector
    rotation: Matrix


@dataclass(frozen=True)
class Setting:
    """What one study simulates.

    Attributes
    ----------
    unit : the truth.
    force_noise, rate_noise : white, m/s²/√Hz and rad/s/√Hz.
    up : (n, 3) unit vectors of p that point up in the attitudes at rest.
    axes : (m, 3) unit vectors of p about which it is turned, each once in either direction.
    dwell, duration : of an attitude and of a rotation, s.
    rate : of the rotations, rad/s.
    sampling : rate of samples, Hz.
    angle_error, placement : of a direction's angle, and of an attitude about each axis, rad.
    perturbation : standard deviation in each sample of a rotation, m/s².
    lever_arm : (3,) of the accelerometers from the axis of rotation, in p, m.
    latitude : rad.
    north : (n, 3) unit vectors of p that point north at rest; None for the shortest way from z up, x north.
    """

    unit: Unit
    force_noise: float
    rate_noise: float
    up: Vectors
    axes: Vectors
    dwell: float = 100.0
    duration: float = 180.0
    rate: float = np.radians(10.0)
    sampling: float = 100.0
    angle_error: float = 2.0 * ARCSECOND
    placement: float = 2.0 * ARCSECOND
    perturbation: float = 50.0 * MICRO_G
    lever_arm: tuple[float, float, float] = (0.05, 0.0, 0.0)
    latitude: float = float(LATITUDE)
    north: Vectors | None = None

    @property
    def angle(self) -> float:
        """What the table is told to turn, rad."""
        return self.rate * self.duration

    @cached_property
    def sigma(self) -> Series:
        """(6,) noise of a sample, counts: density times the root of the sampling rate."""
        unit, root = self.unit, np.sqrt(self.sampling)
        force = np.linalg.norm(unit.force_matrix, axis=1) * self.force_noise * root
        return np.concatenate([force, np.linalg.norm(unit.rate_matrix, axis=1) * self.rate_noise * root])

    @cached_property
    def sigma_turning(self) -> Series:
        """(6,) the same with the perturbed acceleration."""
        moved = np.linalg.norm(self.unit.force_matrix, axis=1) * self.perturbation
        return np.concatenate([np.hypot(self.sigma[:3], moved), self.sigma[3:]])


@dataclass(frozen=True, slots=True)
class Statistics:
    """What is evaluated of many runs; raw units.

    Attributes
    ----------
    force, rate : (runs, n, 3) means of the attitudes.
    rotation : (runs, m, 3) integral of the positive minus that of the negative direction, counts·s.
    angle : (m,) difference of the angles that were read, rad.
    scatter : (runs, m, 3, 3) of the accelerometers, about each direction's mean, mean of both directions.
    """

    force: AnyArray
    rate: AnyArray
    rotation: AnyArray
    angle: Series
    scatter: AnyArray


def table_unit() -> Unit:
    """Return the unit of table 2 ("parameters set"), T read exactly."""
    rows = {row["group"]: np.array(row["set"], dtype=float) for row in zhang()["tables"]["2"]["rows"]}
    return unit_from(rows)


def unit_from(rows: dict[str, Vector]) -> Unit:
    """Return the unit with the parameters of a table, in the paper's units.

    Parameters
    ----------
    rows : group -> its three numbers.
    """
    force_scale, rate_scale = rows["accelerometer scale"], rows["gyro scale"]
    return Unit(
        matrix_from_zhang(force_scale, ARCSECOND * rows["accelerometer misalignment"]),
        force_scale * MICRO_G * rows["accelerometer bias"],
        matrix_from_zhang(rate_scale, ARCSECOND * rows["gyro misalignment"]),
        rate_scale * DEGREE_PER_HOUR * rows["gyro bias"],
        inter_triad_rotation(ARCSECOND * rows["inter-triad"]),
    )


def table_setting(table: str, orientations: tuple[int, ...] = NINE) -> Setting:
    """Return what the paper's table 2, 3, 4 or 5 simulates.

    Parameters
    ----------
    table : "2", "3", "4" or "5"; the last has no rotations.
    orientations : numbers of `ORIENTATIONS`, from 1.
    """
    printed = zhang()["tables"][table]
    return Setting(
        table_unit(),
        MICRO_G * printed["accelerometer_noise_ug_rtHz"],
        DEGREE_PER_HOUR * printed.get("gyro_noise_deg_h_rtHz", 0.0),
        ORIENTATIONS[np.array(orientations) - 1],
        AXES[:0] if table == "5" else AXES,
    )


def simulate(
    setting: Setting,
    runs: int,
    rng: np.random.Generator,
    *,
    sampled: bool = True,
    threads: int | None = None,
    skew: AnyArray | None = None,
) -> Statistics:
    """Simulate a setting many times.

    Parameters
    ----------
    setting : what to simulate.
    runs : how many; the first of many are those of few.
    rng : source of all numbers. Every run has a stream of its own, so that the number of threads changes
        nothing.
    sampled : draw every sample; otherwise draw what is evaluated, by its distribution.
    threads : that draw at once; None for as many as the machine has.
    skew : (runs, n, 3) small rotations of the attitudes at rest beside the random ones, rad.

    Raises
    ------
    ValueError
        If what is evaluated is to be drawn of rotations that are no whole turns.
    """
    set_up, *streams = rng.spawn(runs + 1) if sampled else rng.spawn(2)
    dwells, rotations = len(setting.up), len(setting.axes)
    chance = set_up.standard_normal((runs, 3 * dwells + 2 * rotations))
    tilt = setting.placement * chance[:, : 3 * dwells].reshape(runs, dwells, 3)
    true = _dwell_readings(setting, tilt if skew is None else tilt + skew)
    errors = setting.angle_error * chance[:, 3 * dwells :].reshape(runs, rotations, 2)
    angles = np.array([1.0, -1.0]) * setting.angle + errors
    draw = _draw_samples if sampled else _draw_statistics
    means, integrals, scatter = draw(setting, true, angles, streams, threads)
    return Statistics(
        means[..., :3].copy(),
        means[..., 3:].copy(),
        integrals[:, :, 0] - integrals[:, :, 1],
        np.full(rotations, 2.0 * setting.angle),
        scatter.mean(axis=2),
    )


def norths(up: Vectors) -> Vectors:
    """Return (n, 3) the north in p of attitudes reached from z up and x north by the shortest way.

    Upside down is reached by half a turn about the north.
    """
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    # Half way between z and up; turning about it by a half turn and back is the shortest way.
    found = x - (up[:, :1] / np.maximum(1.0 + up[:, 2:], 1e-300)) * (up + z)
    return np.where(up[:, 2:] < -1.0 + 1e-12, x, found)


def _dwell_readings(setting: Setting, tilt: AnyArray) -> AnyArray:
    """Return (runs, n, 6) readings at rest without noise; `tilt` (runs, n, 3) small rotations."""
    unit = setting.unit
    north = norths(setting.up) if setting.north is None else setting.north
    up = setting.up + np.cross(setting.up, tilt)
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    north = north + np.cross(north, tilt)
    north -= np.sum(north * up, axis=-1, keepdims=True) * up
    north /= np.linalg.norm(north, axis=-1, keepdims=True)
    earth = EARTH_RATE * (np.cos(setting.latitude) * north + np.sin(setting.latitude) * up)
    gyros = unit.rate_matrix @ unit.rotation
    return np.concatenate(
        [GRAVITY * up @ unit.force_matrix.T + unit.force_bias, earth @ gyros.T + unit.rate_bias], axis=-1
    )


def _waves(setting: Setting, rates: Series) -> AnyArray:
    """Return (m, 2, 3, 6) constant, cosine and sine of the readings in the angle turned.

    Fixed directions turn the other way about the axis, which points north.
    """
    unit = setting.unit
    gyros = unit.rate_matrix @ unit.rotation
    waves = np.zeros((len(setting.axes), 2, 3, 6))
    for r, axis in enumerate(setting.axes):
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        up = across / np.linalg.norm(across)
        turned = -np.cross(axis, up)
        lever = np.array(setting.lever_arm) - axis * (axis @ np.array(setting.lever_arm))
        earth_up = EARTH_RATE * np.sin(setting.latitude)
        for d, rate in enumerate(rates):
            along = (EARTH_RATE * np.cos(setting.latitude) + rate) * axis
            force = np.stack([-(rate**2) * lever, GRAVITY * up, GRAVITY * turned])
            speed = np.stack([along, earth_up * up, earth_up * turned])
            waves[r, d] = np.concatenate([force @ unit.force_matrix.T, speed @ gyros.T], axis=1)
            waves[r, d, 0] += np.concatenate([unit.force_bias, unit.rate_bias])
    return waves


def _draw_samples(
    setting: Setting,
    true: AnyArray,
    angles: AnyArray,
    streams: list[np.random.Generator],
    threads: int | None,
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Draw every sample; return (runs, n, 6) means, (runs, m, 2, 3) integrals and (runs, m, 2, 3, 3) scatter."""
    from tumble_papers.zhang.kernels import play_dwells, play_rotations

    runs, rotations = len(true), len(setting.axes)
    dwell, turn = (round(seconds * setting.sampling) for seconds in (setting.dwell, setting.duration))
    means, integrals = np.empty_like(true), np.empty((runs, 2 * rotations, 3))
    scatter = np.empty((runs, 2 * rotations, 3, 3))
    waves = _waves(setting, np.array([setting.rate, -setting.rate])).reshape(-1, 3, 6)
    by_rate = _by_rate(setting).reshape(-1, 6)
    steps = angles.reshape(runs, -1) / turn
    # What the table turns more than it was told is a rate, too.
    off = (angles - np.array([1.0, -1.0]) * setting.angle).reshape(runs, -1) / setting.duration

    def play(run: int) -> None:
        play_dwells(streams[run], true[run], setting.sigma, dwell, means[run])
        wave = waves.copy()
        wave[:, 0] += off[run, :, None] * by_rate
        play_rotations(
            streams[run],
            wave,
            steps[run],
            setting.sigma_turning,
            turn,
            1.0 / setting.sampling,
            integrals[run],
            scatter[run],
        )

    pool = ThreadPoolExecutor(threads or os.cpu_count() or 1)
    try:
        list(counted(pool.map(play, range(runs)), runs))
    finally:  # who stops a long study does not wait for all of it
        pool.shutdown(cancel_futures=True)
    return means, integrals.reshape(runs, rotations, 2, 3), scatter.reshape(runs, rotations, 2, 3, 3)


def _by_rate(setting: Setting) -> AnyArray:
    """Return (m, 2, 6) what a rate about the axis adds to the readings; the lever arm's part is left out."""
    gyros = setting.axes @ (setting.unit.rate_matrix @ setting.unit.rotation).T
    both = np.concatenate([np.zeros_like(gyros), gyros], axis=1)
    return np.repeat(both[:, None], 2, axis=1)


def _draw_statistics(
    setting: Setting,
    true: AnyArray,
    angles: AnyArray,
    streams: list[np.random.Generator],
    threads: int | None,
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Draw what is evaluated by its distribution.

    Means and integrals are normal. A scatter about the mean is that of two vectors, the sums of the samples
    with the cosine and with the sine (normalised; orthogonal over whole turns), plus a Wishart matrix of all
    the rest, of three samples less.
    """
    (rng,) = streams
    if len(setting.axes) and abs(np.sin(0.5 * setting.angle)) > 1e-9:
        raise ValueError("the statistics of a rotation are known for whole turns: draw the samples")
    runs, rotations = len(true), len(setting.axes)
    dwell, turn = (round(seconds * setting.sampling) for seconds in (setting.dwell, setting.duration))
    means = true + setting.sigma / np.sqrt(dwell) * rng.standard_normal(true.shape)
    sigma = setting.sigma_turning
    waves = _waves(setting, np.array([setting.rate, -setting.rate]))
    off = (angles - np.array([1.0, -1.0]) * setting.angle) / setting.duration
    shape = (runs, rotations, 2)
    noise = sigma[3:] * np.sqrt(setting.duration / setting.sampling) * rng.standard_normal((*shape, 3))
    steady = waves[:, :, 0, 3:] + off[..., None] * _by_rate(setting)[..., 3:]
    integrals = setting.duration * steady + noise
    # The mean of cos² over whole turns is a half.
    seen = np.sqrt(0.5 * turn) * waves[:, :, 1:, :3] + sigma[:3] * rng.standard_normal((*shape, 2, 3))
    scatter = np.einsum("...ki,...kj->...ij", seen, seen)
    factor = np.zeros((*shape, 3, 3))
    for i in range(3):
        factor[..., i, i] = np.sqrt(rng.chisquare(turn - 3 - i, shape))
        for j in range(i):
            factor[..., i, j] = rng.standard_normal(shape)
    factor *= sigma[:3, None]
    return means, integrals, (scatter + factor @ np.swapaxes(factor, -1, -2)) / turn
