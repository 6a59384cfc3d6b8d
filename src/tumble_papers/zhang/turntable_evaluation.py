"""What the method of Zhang et al. (2010) finds in simulated runs, and how far it is off, in the paper's units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.sensor.conventions.zhang import inter_triad_angles
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.zhang.inter_triad import (
    axis_from_rotation,
    axis_from_scatter,
    rotation_from_two_axes,
    scatter_in_p,
    triad_rotation,
    wahba_rotation,
)
from tumble_papers.zhang.separate_norms import (
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
)
from tumble_papers.zhang.turntable_simulation import GRAVITY, MICRO_G, Statistics, Unit

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


@dataclass(frozen=True, slots=True)
class Estimates:
    """What was found in many runs.

    Attributes
    ----------
    force_matrix, force_bias : (runs, 3, 3), (runs, 3) of the accelerometers, in p.
    rate_matrix, rate_bias : of the gyros, in o.
    rotations : choice of `CHOICES` -> (runs, 3, 3) R_p^o.
    """

    force_matrix: AnyArray
    force_bias: AnyArray
    rate_matrix: AnyArray
    rate_bias: AnyArray
    rotations: dict[str, AnyArray]

    def parameters(self, choice: str = CHOICES[0]) -> Table:
        """Return (runs, 21) all parameters in the paper's order; scales in counts, the rest SI."""
        return paper_parameters(
            self.force_matrix, self.force_bias, self.rate_matrix, self.rate_bias, self.rotations[choice]
        )


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
    return Estimates(
        force_matrix, force_bias, rate_matrix, rate_bias, dict(zip(CHOICES, rotations, strict=True))
    )


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


def paper_parameters(
    force_matrix: AnyArray,
    force_bias: AnyArray,
    rate_matrix: AnyArray,
    rate_bias: AnyArray,
    rotation: AnyArray,
) -> Table:
    """Return (runs, 21) parameters in the paper's order; scales in counts, the rest SI.

    Parameters
    ----------
    force_matrix, force_bias, rate_matrix, rate_bias, rotation : (runs, ...) as in `Estimates`.
    """
    angles = np.asarray(inter_triad_angles(rotation), dtype=np.float64)
    return np.concatenate(
        [triad_parameters(force_matrix, force_bias), triad_parameters(rate_matrix, rate_bias), angles], axis=1
    )


def unit_parameters(unit: Unit) -> Series:
    """Return (21,) the true parameters; scales in counts, the rest SI."""
    one = (unit.force_matrix, unit.force_bias, unit.rate_matrix, unit.rate_bias, unit.rotation)
    return paper_parameters(*(np.asarray(part, dtype=np.float64)[None] for part in one))[0]


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
