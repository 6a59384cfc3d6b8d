"""How a calibrated unit lies on its mount, from gravity in two attitudes of the mount (Savage 2018, section 10).

The mount rests level, then pitched by 90° about its y axis until x is up. With C_MB = exp(γ ×), the rotation from
the unit's axes b to the mount's M, and z down:

    level      γy = ax / g,   γx = -ay / g
    pitched    γz = -ay / g

which is the first order in γ. The exact solution takes both directions of gravity (TRIAD): the level one is kept as
it is, of the other only what is across it counts, so that the pitch need not be 90° to the last digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Square, Table, Vector, inverted
from tumble.attitude import analytic_rotation_vector, angle_between
from tumble.calibration.free_inertial import triad_errors
from tumble.errors import ObservabilityError
from tumble.records import dataclass
from tumble.sensor import Triad, propagate

Complex = npt.NDArray[Any]
# A unit whose axes are farther from the mount's is mounted another way, or stood otherwise, rad.
LARGEST_MISALIGNMENT = np.radians(15.0)
AXES = ("x", "y", "z")
LEVEL, PITCHED = "level", "pitched"


@dataclass(frozen=True)
class MountAlignment:
    """The rotation from a unit's axes b to its mount's M, and how well it is known.

    Attributes
    ----------
    C_MB : (3, 3) exact: ``v_M = C_MB @ v_B``.
    angles : (3,) rad, the rotation vector γ of it.
    covariance : (3, 3) rad², of the angles.
    off_right_angle : rad, how far the two directions of gravity are from 90° apart: what the pitch was off by.
    z_down : whether the unit's z, and with it the mount's, is down when level.
    """

    C_MB: Matrix
    angles: Vector
    covariance: Square
    off_right_angle: float
    z_down: bool

    @property
    def sigmas(self) -> Vector:
        """(3,) rad, standard uncertainty of the angles."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=np.float64)


def align_to_mount(level: Vector, pitched: Vector, covariance: Square) -> MountAlignment:
    """Return how a unit lies on its mount, from its corrected specific force in two attitudes of the mount.

    Parameters
    ----------
    level, pitched : (3,) m/s², means with the mount level, and pitched by 90° about y, x up.
    covariance : (6, 6) (m/s²)², of both, level first.

    Raises
    ------
    ObservabilityError
        If the directions are not those of a mount level, and pitched with x up: swapped, the same, reversed.
    """
    check_poses(level, pitched)
    both = np.concatenate([level, pitched])
    angles, spread = propagate(lambda of: analytic_rotation_vector(_triad_rotation(of)), both, covariance)
    return MountAlignment(
        C_MB=np.real(_triad_rotation(both)),
        angles=angles,
        covariance=spread,
        off_right_angle=float(angle_between(level, pitched) - 0.5 * np.pi),
        z_down=bool(level[2] < 0.0),
    )


def _triad_rotation(both: Complex) -> Complex:
    """C_MB whose z is exactly along the level gravity and whose x is nearest to the pitched one, analytic."""
    level, pitched = both[:3], both[3:]
    z = (level if np.real(level[2]) > 0.0 else -level) / np.sqrt(level @ level)
    x = pitched - z * (z @ pitched)
    x = x / np.sqrt(x @ x)
    return np.array([x, np.cross(z, x), z])


def check_poses(level: Vector, pitched: Vector, names: tuple[str, str] = (LEVEL, PITCHED)) -> None:
    """Refuse directions of gravity that are not those of a mount level, and pitched with x up.

    Parameters
    ----------
    level, pitched : (3,) m/s², corrected.
    names : of the recordings, for the sentences.

    Raises
    ------
    ObservabilityError
        If they are swapped, alike, or of another pose.
    """
    (axis, sign, off), (other_axis, other_sign, other_off) = _nearest(level), _nearest(pitched)
    if axis == 0 and other_axis == 2:
        raise ObservabilityError(
            f"The recordings are swapped: {names[0]} has x {_up(sign)}, {names[1]} has z {_up(other_sign)}; "
            "give the level one first."
        )
    if axis == other_axis and sign == other_sign:
        raise ObservabilityError(
            f"Both recordings are of the same pose, {AXES[axis]} {_up(sign)}: {names[1]} must be made with the mount "
            "pitched by 90° about y, x up."
        )
    if axis != 2:
        raise ObservabilityError(
            f"With the mount level the unit's z axis has to be down (or up), but {names[0]} has "
            f"{AXES[axis]} {_up(sign)}. The unit is mounted another way, or the columns are in "
            "another order (--columns)."
        )
    if other_axis == 0 and other_sign < 0:
        raise ObservabilityError(
            f"{names[1]} has x down: pitch the mount by 90° the other way, so that x is up."
        )
    if other_axis != 0:
        raise ObservabilityError(
            f"With the mount pitched by 90° about y the unit's x axis has to be up, but {names[1]} "
            f"has {AXES[other_axis]} {_up(other_sign)}. The mount was turned about another axis, or "
            "the unit is mounted another way."
        )
    for name, farthest in ((names[0], off), (names[1], other_off)):
        if farthest > LARGEST_MISALIGNMENT:
            raise ObservabilityError(
                f"In {name} the unit's axis is {np.degrees(farthest):.0f}° from the vertical. Up to "
                f"{np.degrees(LARGEST_MISALIGNMENT):.0f}° are taken for a misalignment. Either the "
                "unit is mounted at an angle, or the mount was not level."
            )


def _nearest(force: Vector) -> tuple[int, int, float]:
    """Which axis is nearest to the vertical, up (1) or down (-1), and how far it is off, rad."""
    up = force / np.linalg.norm(force)
    axis = int(np.argmax(np.abs(up)))
    return axis, int(np.sign(up[axis])), float(np.arccos(min(1.0, abs(up[axis]))))


def _up(sign: int) -> str:
    return "up" if sign > 0 else "down"


def mean_covariances(
    triad: Triad,
    forces: Sequence[Vector],
    spreads: Sequence[Matrix],
    names: Sequence[str],
    covariance: Table,
    wander: float,
) -> Table:
    """Return (3n, 3n) (m/s²)²: the covariance of corrected means, with the calibration's own, which they share.

    Parameters
    ----------
    triad : that corrected them.
    forces : of n means, (3,) corrected, m/s².
    spreads : of each, (3, 3) raw, the covariance of its mean.
    names, covariance : of the calibration, `covariance_parameters` and its matrix.
    wander : m/s², how far the biases move from one hold to another.
    """
    inverse = inverted(triad.matrix)
    count = len(forces)
    total = np.zeros((3 * count, 3 * count))
    effect: Table = np.zeros((3 * count, len(names)))
    for k, (force, spread) in enumerate(zip(forces, spreads, strict=True)):
        rows = slice(3 * k, 3 * k + 3)
        total[rows, rows] = inverse @ spread @ inverse.T + wander**2 * np.eye(3)
        effect[rows] = triad_errors("accelerometer", triad, names, force)
    return np.asarray(total + effect @ covariance @ effect.T, dtype=np.float64)
