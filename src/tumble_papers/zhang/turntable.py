"""The simulation of Zhang et al. (2010), sections 5.1 and 5.2: a unit on a table, and what both methods find.

One run is one unit with the errors that are set: some attitudes at rest, and rotations about fixed
horizontal axes, each once in either direction. Every sample is drawn (`sampled=True`), or the same numbers
are drawn as what is evaluated of them: means, integrals and scatter matrices, by their exact distributions.

Chosen, because the paper does not print it: T is read exactly (sensing axes of unit length), the
inter-triad angles as a rotation vector; the latitude is Changsha's; the rotation axes point north. Each
attitude is reached from z up and x north by the shortest way. The table turns by what it is told plus its
error; what is read is what it is told. The perturbed acceleration is white, of its standard deviation in
every sample of a rotation; a lever arm adds a constant to a steady rotation.

The traditional method believes the table: 24 positions, each axis of the platform up and down with the
next to the north, west, south and east, give the accelerometers' matrix and both biases; rotations about
three axes give the gyros' matrix. All by plain least squares in the table's axes, then turned into the
paper's frames.

The paper's recordings are not public. The unit has the parameters that its own method found (table 6).
The table has its 2″ three times, which is an assumption: at random in each attitude about each axis and in
each angle; systematically in the axis that is vertical in a group of eight positions; and, apart from that,
in each axis of rotation. Means and integrals are drawn by their distributions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vector, Vectors
from tumble.counting import counted
from tumble.earth import EARTH_RATE
from tumble.sensor import ImuModel, Triad, inter_triad_angles, inter_triad_rotation, matrix_from_zhang
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.study import in_threads, zhang
from tumble_papers.zhang.closed_forms import (
    axis_from_rotation,
    axis_from_scatter,
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
    rotation_from_two_axes,
    scatter_in_p,
    triad_rotation,
    wahba_rotation,
)
from tumble_papers.zhang.pose_sets import GRAVITY, NINE, chatfield_orientations

MICRO_G = 1e-6 * GRAVITY  # 612.24 µg are 0.006 m/s²
LATITUDE = np.radians(28.2)
ORIENTATIONS = chatfield_orientations()
# x, y, z and one edge in each plane.
AXES = ORIENTATIONS[[0, 4, 8, 1, 3, 5]]


@dataclass(frozen=True)
class Unit:
    """A unit, or many of them along the first axis; raw = matrix @ true + bias, true vectors in p.

    Attributes
    ----------
    force_matrix, force_bias : of the accelerometers, lower triangular; counts per m/s² and counts.
    rate_matrix, rate_bias : of the gyros, K T in their own frame o; counts per rad/s and counts.
    rotation : R_p^o.
    """

    force_matrix: AnyArray
    force_bias: AnyArray
    rate_matrix: AnyArray
    rate_bias: AnyArray
    rotation: AnyArray

    @property
    def gyros(self) -> AnyArray:
        """(..., 3, 3) of the gyros in p."""
        return self.rate_matrix @ self.rotation

    @property
    def model(self) -> ImuModel:
        """One unit as a model, in p."""
        return ImuModel(Triad(self.force_matrix, self.force_bias), Triad(self.gyros, self.rate_bias))

    def each(self) -> list[Unit]:
        """Return many units one by one."""
        parts = self.force_matrix, self.force_bias, self.rate_matrix, self.rate_bias, self.rotation
        return [Unit(*part) for part in zip(*parts, strict=True)]

    def parameters(self) -> AnyArray:
        """Return (..., 21) parameters in the paper's order; scales in counts, the rest SI."""
        triads = (self.force_matrix, self.force_bias), (self.rate_matrix, self.rate_bias)
        angles = np.asarray(inter_triad_angles(self.rotation), dtype=np.float64)
        return np.concatenate([*(triad_parameters(*triad) for triad in triads), angles], axis=-1)


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


@dataclass(frozen=True)
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


def unit_from(table: str, column: str) -> Unit:
    """Return the unit with the parameters that a column of a table prints, T read exactly.

    Parameters
    ----------
    table, column : "2" and "set", or "6" and "traditional" or "proposed".
    """
    printed = zhang()["tables"][table]["rows"]
    return unit_of({row["group"]: np.array(row[column], dtype=float) for row in printed})


def unit_of(rows: dict[str, Vector]) -> Unit:
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
    """Return what the paper's table 2, 3, 4 or 5 simulates, or what section 5.2 calibrated, of table 6.

    Parameters
    ----------
    table : "2" to "6"; the fifth has no rotations.
    orientations : numbers of `ORIENTATIONS`, from 1.
    """
    printed = zhang()["tables"][table]
    return Setting(
        unit_from("6", "proposed") if table == "6" else unit_from("2", "set"),
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
    waves, axes = _waves(setting), setting.axes @ setting.unit.gyros.T
    # What the table turns more than it was told is a rate, too; the lever arm's part is left out.
    waves = np.broadcast_to(waves, (runs, *waves.shape)).copy()
    waves[:, :, :, 0, 3:] += errors[..., None] / setting.duration * axes[:, None]
    if sampled:
        turned = np.array([1.0, -1.0]) * setting.angle + errors
        means, integrals, scatter = _draw_samples(setting, true, waves, turned, streams, threads)
    else:
        means, integrals, scatter = _draw_statistics(setting, true, waves, streams[0])
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
    gyros = unit.gyros
    return np.concatenate(
        [GRAVITY * up @ unit.force_matrix.T + unit.force_bias, earth @ gyros.T + unit.rate_bias], axis=-1
    )


def _waves(setting: Setting) -> AnyArray:
    """Return (m, 2, 3, 6) constant, cosine and sine of the readings in the angle turned.

    Fixed directions turn the other way about the axis, which points north.
    """
    unit = setting.unit
    gyros = unit.gyros
    waves = np.zeros((len(setting.axes), 2, 3, 6))
    for r, axis in enumerate(setting.axes):
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        up = across / np.linalg.norm(across)
        turned = -np.cross(axis, up)
        lever = np.array(setting.lever_arm) - axis * (axis @ np.array(setting.lever_arm))
        earth_up = EARTH_RATE * np.sin(setting.latitude)
        for d, rate in enumerate((setting.rate, -setting.rate)):
            along = (EARTH_RATE * np.cos(setting.latitude) + rate) * axis
            force = np.stack([-(rate**2) * lever, GRAVITY * up, GRAVITY * turned])
            speed = np.stack([along, earth_up * up, earth_up * turned])
            waves[r, d] = np.concatenate([force @ unit.force_matrix.T, speed @ gyros.T], axis=1)
            waves[r, d, 0] += np.concatenate([unit.force_bias, unit.rate_bias])
    return waves


def _draw_samples(
    setting: Setting,
    true: AnyArray,
    waves: AnyArray,
    turned: AnyArray,
    streams: list[np.random.Generator],
    threads: int | None,
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Draw every sample; return (runs, n, 6) means, (runs, m, 2, 3) integrals and (runs, m, 2, 3, 3) scatter."""
    dwell, turn = (round(seconds * setting.sampling) for seconds in (setting.dwell, setting.duration))
    means, sums, scatter = np.empty_like(true), waves[..., 0, 3:].copy(), np.empty((*turned.shape, 3, 3))
    half = (np.arange(turn) + 0.5) / turn

    def play(run: int) -> None:
        rng = streams[run]
        for k, reading in enumerate(true[run]):
            means[run, k] = (
                reading + setting.sigma * (np.ones(dwell) @ rng.standard_normal((dwell, 6))) / dwell
            )
        for at in np.ndindex(turned.shape[1:]):
            _, *wave = waves[run, *at]
            angle = turned[run, *at] * half
            # The constant is left out: about nearly the mean the scatter keeps its digits.
            shown = setting.sigma_turning * rng.standard_normal((turn, 6))
            shown += np.column_stack([np.cos(angle), np.sin(angle)]) @ np.array(wave)
            mean = np.ones(turn) @ shown / turn
            sums[run, *at] += mean[3:]
            scatter[run, *at] = (shown.T @ shown / turn - np.outer(mean, mean))[:3, :3]

    list(counted(in_threads(play, len(true), threads), len(true)))
    return means, setting.duration * sums, scatter


def _draw_statistics(
    setting: Setting, true: AnyArray, waves: AnyArray, rng: np.random.Generator
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Draw what is evaluated by its distribution.

    Means and integrals are normal. A scatter about the mean is that of two vectors, the sums of the samples
    with the cosine and with the sine (normalised; orthogonal over whole turns), plus a Wishart matrix of all
    the rest, of three samples less.
    """
    if len(setting.axes) and abs(np.sin(0.5 * setting.angle)) > 1e-9:
        raise ValueError("the statistics of a rotation are known for whole turns: draw the samples")
    dwell, turn = (round(seconds * setting.sampling) for seconds in (setting.dwell, setting.duration))
    means = true + setting.sigma / np.sqrt(dwell) * rng.standard_normal(true.shape)
    sigma = setting.sigma_turning
    shape = waves.shape[:3]
    noise = sigma[3:] * np.sqrt(setting.duration / setting.sampling) * rng.standard_normal((*shape, 3))
    integrals = setting.duration * waves[..., 0, 3:] + noise
    # The mean of cos² over whole turns is a half.
    seen = np.sqrt(0.5 * turn) * waves[..., 1:, :3] + sigma[:3] * rng.standard_normal((*shape, 2, 3))
    scatter = np.einsum("...ki,...kj->...ij", seen, seen)
    factor = np.zeros((*shape, 3, 3))
    for i in range(3):
        factor[..., i, i] = np.sqrt(rng.chisquare(turn - 3 - i, shape))
        for j in range(i):
            factor[..., i, j] = rng.standard_normal(shape)
    factor *= sigma[:3, None]
    return means, integrals, (scatter + factor @ np.swapaxes(factor, -1, -2)) / turn


GROUPS = (
    ("accelerometer scale", "ppm", ("k xa", "k ya", "k za")),
    ("accelerometer misalignment", "″", ("α yz", "α zy", "α zx")),
    ("accelerometer bias", "µg", ("b xa", "b ya", "b za")),
    ("gyro scale", "ppm", ("k xg", "k yg", "k zg")),
    ("gyro misalignment", "″", ("γ yz", "γ zy", "γ zx")),
    ("gyro bias", "°/h", ("b xg", "b yg", "b zg")),
    ("inter-triad", "″", ("θ x", "θ y", "θ z")),
)
"""The paper's groups of three parameters: name, unit, symbols."""

UNITS_SI = np.repeat([1e-6, ARCSECOND, MICRO_G, 1e-6, ARCSECOND, DEGREE_PER_HOUR, ARCSECOND], 3)
CHOICES = ("two axes, z then y", "two axes, x then y", "six axes (Wahba)", "(40) as printed, z and y")
"""How R_p^o is found from the axes: the first is the paper's, the next two are better choices."""


@dataclass(frozen=True)
class Estimates:
    """What was found in many runs: the units by the paper's choice, and (runs, 3, 3) R_p^o by each of `CHOICES`."""

    units: Unit
    rotations: dict[str, AnyArray]

    def parameters(self, choice: str = CHOICES[0]) -> Table:
        """Return (runs, 21) all parameters in the paper's order; scales in counts, the rest SI."""
        return replace(self.units, rotation=self.rotations[choice]).parameters()


def evaluate(statistics: Statistics) -> Estimates:
    """Apply the paper's closed forms to every run.

    Parameters
    ----------
    statistics : with six rotations or more, the first three about x, y and z.

    Raises
    ------
    ObservabilityError
        If attitudes or rotations do not tell all parameters.
    """
    force_matrix, force_bias = ellipsoid_from_norms(statistics.force, GRAVITY)
    rate_matrix = matrix_from_rotations(statistics.rotation, statistics.angle)
    rate_bias = bias_from_static_pairs(rate_matrix, statistics.rate)
    axes_o = axis_from_rotation(rate_matrix[:, None], statistics.rotation)
    axes_p = axis_from_scatter(scatter_in_p(force_matrix[:, None], statistics.scatter))
    # An axis of scatter has two ends; the triads are turned against each other by less than a right angle.
    axes_p = axes_p * np.sign(np.sum(axes_o * axes_p, axis=-1, keepdims=True))
    zy, xy = [2, 1], [0, 1]
    rotations = (
        triad_rotation(axes_o[:, zy], axes_p[:, zy]),
        triad_rotation(axes_o[:, xy], axes_p[:, xy]),
        wahba_rotation(axes_o, axes_p),
        rotation_from_two_axes(axes_o[:, zy], axes_p[:, zy]),
    )
    units = Unit(force_matrix, force_bias, rate_matrix, rate_bias, rotations[0])
    return Estimates(units, dict(zip(CHOICES, rotations, strict=True)))


def triad_parameters(matrix: AnyArray, bias: AnyArray) -> Table:
    """Return (..., 9) scales (counts), angles yz, zy, zx (rad, read exactly) and biases (SI) of a triad.

    Parameters
    ----------
    matrix, bias : (..., 3, 3) lower triangular, (..., 3); raw.
    """
    scale = np.linalg.norm(matrix, axis=-1)
    axes = matrix / scale[..., None]
    angles = np.arcsin(np.stack([axes[..., 1, 0], -axes[..., 2, 0], axes[..., 2, 1]], axis=-1))
    return np.concatenate([scale, angles, bias / scale], axis=-1)


def in_paper_units(parameters: AnyArray, truth: AnyArray) -> AnyArray:
    """Return (..., 21) or (..., 9) what parameters differ by from others, in ppm, ″, µg and °/h.

    Parameters
    ----------
    parameters, truth : as `unit_parameters` has them; nine are the accelerometers'.
    """
    scales = np.zeros(21, dtype=bool)
    scales[[0, 1, 2, 9, 10, 11]] = True
    count = parameters.shape[-1]
    difference = np.where(scales[:count], parameters / truth - 1.0, parameters - truth)
    return difference / UNITS_SI[:count]


AXIS_ERROR = 2.0 * ARCSECOND
POSITIONS = 48


@dataclass(frozen=True)
class Comparison:
    """Many units calibrated by both methods, then at rest in 48 positions.

    Attributes
    ----------
    unit : the truth.
    traditional, proposed : what either method found.
    force_errors, rate_errors : method -> (runs, 48) norm minus reference, SI.
    """

    unit: Unit
    traditional: Unit
    proposed: Unit
    force_errors: dict[str, AnyArray]
    rate_errors: dict[str, AnyArray]


def compare(runs: int, rng: np.random.Generator) -> Comparison:
    """Calibrate simulated units by both methods and evaluate both at rest.

    Parameters
    ----------
    runs : how many.
    rng : source of all numbers.
    """
    setting = table_setting("6")
    ours, theirs, rest = rng.spawn(3)
    proposed = evaluate(simulate(setting, runs, ours, sampled=False)).units
    traditional = calibrate_in_laboratory(setting, runs, theirs)
    spread = replace(setting, up=spread_directions(POSITIONS), axes=AXES[:0])
    still = simulate(spread, runs, rest, sampled=False)
    methods = {"traditional": traditional, "proposed": proposed}
    force = {n: _norms(u.force_matrix, u.force_bias, still.force) - GRAVITY for n, u in methods.items()}
    rate = {n: _norms(u.rate_matrix, u.rate_bias, still.rate) - EARTH_RATE for n, u in methods.items()}
    return Comparison(setting.unit, traditional, proposed, force, rate)


def calibrate_in_laboratory(setting: Setting, runs: int, rng: np.random.Generator) -> Unit:
    """Simulate and evaluate the traditional method: 24 positions and three rotation pairs.

    Parameters
    ----------
    setting : noise, times and errors; its attitudes and axes are not used.
    runs : how many.
    rng : source of all numbers.
    """
    table, rest, turning = rng.spawn(3)
    up, north = twenty_four_positions()
    # One small rotation for all eight positions with the same axis vertical.
    skew = AXIS_ERROR * np.repeat(table.standard_normal((runs, 3, 3)), 8, axis=1)
    still = simulate(
        replace(setting, up=up, north=north, axes=AXES[:0]), runs, rest, sampled=False, skew=skew
    )
    design = np.column_stack([GRAVITY * up, np.ones(len(up))])
    solution = np.linalg.pinv(design) @ still.force
    rate_matrix = _turned_about_three(setting, runs, table, turning)
    earth = EARTH_RATE * (np.cos(setting.latitude) * north + np.sin(setting.latitude) * up)
    rate_bias = np.mean(still.rate - earth @ np.swapaxes(rate_matrix, -1, -2), axis=1)
    # From the table's axes to the paper's frames.
    force_matrix = np.swapaxes(solution[:, :3], -1, -2)
    lower = _lower_factor(force_matrix)
    gyros = rate_matrix @ np.swapaxes(np.linalg.solve(lower, force_matrix), -1, -2)
    rate_lower = _lower_factor(gyros)
    rotation = np.asarray(np.linalg.solve(rate_lower, gyros), dtype=np.float64)
    return Unit(lower, solution[:, 3].copy(), rate_lower, rate_bias, rotation)


def _turned_about_three(
    setting: Setting, runs: int, table: np.random.Generator, rng: np.random.Generator
) -> AnyArray:
    """Return (runs, 3, 3) the gyros' matrix: its columns are the integrals over the angles that are read."""
    unit = setting.unit
    gyros = unit.gyros
    off = AXIS_ERROR * table.standard_normal((runs, 3, 3))
    axes = np.eye(3) + off * (1.0 - np.eye(3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    angle = 2.0 * setting.angle + setting.angle_error * np.sqrt(2.0) * rng.standard_normal((runs, 3, 1))
    noise = setting.sigma[3:] * np.sqrt(2.0 * setting.duration / setting.sampling)
    integrals = angle * (axes @ gyros.T) + noise * rng.standard_normal((runs, 3, 3))
    return np.swapaxes(integrals, -1, -2) / (2.0 * setting.angle)


def twenty_four_positions() -> tuple[Vectors, Vectors]:
    """Return (24, 3) up and (24, 3) north: each axis up and down, the next to north, west, south and east."""
    faces = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    following = np.roll(np.abs(faces), 1, axis=1)
    # North of an attitude in which the following axis points north, west, south, east.
    west = np.cross(faces, following)
    norths = np.stack([following, -west, -following, west], axis=1).reshape(-1, 3)
    return np.repeat(faces, 4, axis=0), norths


def spread_directions(count: int) -> Vectors:
    """Return (count, 3) directions evenly over the sphere, on a spiral (Fibonacci lattice).

    Parameters
    ----------
    count : how many.
    """
    number = np.arange(count) + 0.5
    z = 1.0 - 2.0 * number / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * number
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def _norms(matrix: AnyArray, bias: AnyArray, raw: AnyArray) -> AnyArray:
    """Return (runs, n) norms of the corrected vectors."""
    corrected = (raw - bias[:, None]) @ np.swapaxes(np.linalg.inv(matrix), -1, -2)
    return np.asarray(np.linalg.norm(corrected, axis=-1), dtype=np.float64)


def _lower_factor(matrix: AnyArray) -> AnyArray:
    return np.asarray(np.linalg.cholesky(matrix @ np.swapaxes(matrix, -1, -2)), dtype=np.float64)
