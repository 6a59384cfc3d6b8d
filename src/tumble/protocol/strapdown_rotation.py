"""The rotation sequences of the strapdown rotation test (Savage 2018, table 1), on a two-axis fixture.

The fixture's outer axis is horizontal, its inner axis carries the unit along z; with both angles zero z
is down and y along the outer axis. Inner and outer angles are right-handed about the unit's z and y as
they then lie. Table 1 leaves out the start of row 6: x down, y along the outer axis, inner 0, outer -90.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import Vector

AXES = ("x", "y", "z")
_QUARTER = np.pi / 2.0


@dataclass(frozen=True, slots=True)
class RotationSequence:
    """One row of table 1.

    Attributes
    ----------
    name : "1" to "14", "1a" to "3a".
    down : the unit's axis that points down at the start.
    along_outer : the unit's axis along the fixture's outer axis at the start.
    inner, outer : rad, the fixture's angles at the start.
    rotations : (axis, angle) one after another: 0, 1, 2 for x, y, z of the unit, and rad, right-handed.
    """

    name: str
    down: str
    along_outer: str
    inner: float
    outer: float
    rotations: tuple[tuple[int, float], ...]

    def fixture_angles(self) -> list[tuple[float, float]]:
        """Return (inner, outer), rad, at the start and after each rotation.

        Raises
        ------
        ValueError
            If a rotation is about neither of the fixture's axes.
        """
        inner, outer = self.inner, self.outer
        angles = [(inner, outer)]
        for axis, angle in self.rotations:
            if axis == 2:
                inner += angle
            else:
                along = float((Rotation.from_rotvec([0.0, 0.0, inner]).apply(np.eye(3)[axis]))[1])
                if abs(abs(along) - 1.0) > 1e-9:
                    raise ValueError(
                        f"sequence {self.name}: the unit's {AXES[axis]} is not along an axis of the fixture"
                    )
                outer += round(along) * angle
            angles.append((inner, outer))
        return angles


def fixture_rotation(inner: float, outer: float) -> Rotation:
    """Return the unit's nominal attitude C_tb in the fixture's frame t: y its outer axis, z down.

    Parameters
    ----------
    inner, outer : rad.
    """
    return Rotation.from_rotvec([0.0, outer, 0.0]) * Rotation.from_rotvec([0.0, 0.0, inner])


def _row(name: str, down: str, along: str, inner: int, outer: int, text: str) -> RotationSequence:
    rotations = tuple(
        (AXES.index(word[-1]), int(word[:-1]) * np.pi / 180.0) for word in text.replace(",", " ").split()
    )
    return RotationSequence(name, down, along, inner * _QUARTER / 90, outer * _QUARTER / 90, rotations)


SEQUENCES: tuple[RotationSequence, ...] = (
    _row("1", "z", "y", 0, 0, "+360y"),
    _row("2", "z", "x", 90, 0, "+360x"),
    _row("3", "x", "y", 0, -90, "+360z"),
    _row("1a", "z", "y", 0, 0, "-360y"),
    _row("2a", "z", "x", 90, 0, "-360x"),
    _row("3a", "x", "y", 0, -90, "-360z"),
    _row("4", "z", "y", 0, 0, "+180y +180z +180y +180z"),
    _row("5", "z", "x", 90, 0, "+180x +180z +180x +180z"),
    _row("6", "x", "y", 0, -90, "+180y +90z +180x +90z +180y +90z +180x +90z"),
    _row("7", "y", "x", 90, 90, "+180x"),
    _row("8", "z", "x", 90, 0, "+180x"),
    _row("9", "x", "y", 0, -90, "+180z"),
    _row("10", "y", "x", 90, 90, "+180z"),
    _row("11", "z", "y", 0, 0, "+180y"),
    _row("12", "x", "y", 0, -90, "+180y"),
    _row("13", "z", "y", 0, 0, "+180z +180y"),
    _row("14", "z", "x", 90, 0, "+180z +180x"),
)
"""Table 1, in its order."""


def start_down(sequence: RotationSequence) -> Vector:
    """Return the unit vector down in the unit's axes at the start of a sequence.

    Parameters
    ----------
    sequence : a row.
    """
    return np.asarray(
        fixture_rotation(sequence.inner, sequence.outer).inv().apply([0.0, 0.0, 1.0]), dtype=np.float64
    )
