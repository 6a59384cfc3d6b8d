"""Both methods of Zhang et al. (2010), section 5.2, on simulated units: the traditional one and the paper's.

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

import numpy as np

from tumble.arrays import AnyArray, Table, Vectors
from tumble.earth.site import EARTH_RATE
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.published import zhang
from tumble_papers.zhang.turntable_evaluation import Estimates, evaluate, paper_parameters
from tumble_papers.zhang.turntable_simulation import (
    AXES,
    GRAVITY,
    MICRO_G,
    NINE,
    ORIENTATIONS,
    Setting,
    Unit,
    simulate,
    unit_from,
)

AXIS_ERROR = 2.0 * ARCSECOND
POSITIONS = 48


@dataclass(frozen=True, slots=True)
class Laboratory:
    """What the traditional method found in many runs, in the table's frame t.

    Attributes
    ----------
    force_matrix, rate_matrix : (runs, 3, 3) raw = matrix @ true_t + bias.
    force_bias, rate_bias : (runs, 3) raw.
    """

    force_matrix: AnyArray
    force_bias: AnyArray
    rate_matrix: AnyArray
    rate_bias: AnyArray

    def parameters(self) -> Table:
        """Return (runs, 21) all parameters in the paper's order and frames; scales in counts, the rest SI."""
        lower = _lower_factor(self.force_matrix)
        C_pt = np.linalg.solve(lower, self.force_matrix)
        gyros = self.rate_matrix @ np.swapaxes(C_pt, -1, -2)
        rate_lower = _lower_factor(gyros)
        rotation = np.asarray(np.linalg.solve(rate_lower, gyros), dtype=np.float64)
        return paper_parameters(lower, self.force_bias, rate_lower, self.rate_bias, rotation)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Many units calibrated by both methods, then at rest in 48 positions.

    Attributes
    ----------
    unit : the truth.
    traditional, proposed : what either method found.
    force_errors, rate_errors : method -> (runs, 48) norm minus reference, SI.
    """

    unit: Unit
    traditional: Laboratory
    proposed: Estimates
    force_errors: dict[str, AnyArray]
    rate_errors: dict[str, AnyArray]


def paper_unit(method: str = "proposed") -> Unit:
    """Return the unit that a column of table 6 describes.

    Parameters
    ----------
    method : "proposed" or "traditional".
    """
    return unit_from(
        {row["group"]: np.array(row[method], dtype=float) for row in zhang()["tables"]["6"]["rows"]}
    )


def paper_setting() -> Setting:
    """Return section 5.2's calibration by the paper's method: nine attitudes and six rotation pairs."""
    printed = zhang()["tables"]["6"]
    return Setting(
        paper_unit(),
        MICRO_G * printed["accelerometer_noise_ug_rtHz"],
        DEGREE_PER_HOUR * printed["gyro_noise_deg_h_rtHz"],
        ORIENTATIONS[np.array(NINE) - 1],
        AXES,
    )


def compare(runs: int, rng: np.random.Generator) -> Comparison:
    """Calibrate simulated units by both methods and evaluate both at rest.

    Parameters
    ----------
    runs : how many.
    rng : source of all numbers.
    """
    setting = paper_setting()
    ours, theirs, rest = rng.spawn(3)
    proposed = evaluate(simulate(setting, runs, ours, sampled=False))
    traditional = calibrate_in_laboratory(setting, runs, theirs)
    spread = replace(setting, up=spread_directions(POSITIONS), axes=AXES[:0])
    still = simulate(spread, runs, rest, sampled=False)
    force, rate = (
        {name: _norms(*pair, raw) - reference for name, pair in (("traditional", one), ("proposed", other))}
        for raw, reference, one, other in (
            (
                still.force,
                GRAVITY,
                (traditional.force_matrix, traditional.force_bias),
                (proposed.force_matrix, proposed.force_bias),
            ),
            (
                still.rate,
                EARTH_RATE,
                (traditional.rate_matrix, traditional.rate_bias),
                (proposed.rate_matrix, proposed.rate_bias),
            ),
        )
    )
    return Comparison(setting.unit, traditional, proposed, force, rate)


def calibrate_in_laboratory(setting: Setting, runs: int, rng: np.random.Generator) -> Laboratory:
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
    return Laboratory(
        np.swapaxes(solution[:, :3], -1, -2).copy(), solution[:, 3].copy(), rate_matrix, rate_bias
    )


def _turned_about_three(
    setting: Setting, runs: int, table: np.random.Generator, rng: np.random.Generator
) -> AnyArray:
    """Return (runs, 3, 3) the gyros' matrix: its columns are the integrals over the angles that are read."""
    unit = setting.unit
    gyros = unit.rate_matrix @ unit.rotation
    off = AXIS_ERROR * table.standard_normal((runs, 3, 3))
    axes = np.eye(3) + off * (1.0 - np.eye(3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    angle = 2.0 * setting.angle + setting.angle_error * np.sqrt(2.0) * rng.standard_normal((runs, 3, 1))
    noise = setting.sigma[3:] * np.sqrt(2.0 * setting.duration / setting.sampling)
    integrals = angle * (axes @ gyros.T) + noise * rng.standard_normal((runs, 3, 3))
    return np.swapaxes(integrals, -1, -2) / (2.0 * setting.angle)


def twenty_four_positions() -> tuple[Vectors, Vectors]:
    """Return (24, 3) up and (24, 3) north: each axis up and down, the next to north, west, south and east."""
    ups: list[Vectors] = []
    norths: list[Vectors] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            up, following = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            # North of an attitude in which the following axis points north, west, south, east.
            west = np.cross(up, following)
            for north in (following, -west, -following, west):
                ups.append(up)
                norths.append(north)
    return np.array(ups), np.array(norths)


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
