"""What chains are made of: windows in a rotation, rotations in a section of holds, sections in a recording."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Series, Table
from tumble.attitude import matrices_from_rotation_vectors, matrix_from_rotation_vector, tangent_basis
from tumble.calibration.equations.adjustment import HEAD, NODE, TAIL, JointAdjustment, Section
from tumble.calibration.equations.hold_equations import Force, Rate, Rest, Swing
from tumble.calibration.equations.pose_equations import pose_equations
from tumble.calibration.equations.reference_equations import EarthRate, Heading, Loose
from tumble.calibration.equations.rotation_equations import (
    Angle,
    Axis,
    Layout,
    Links,
    Own,
    TableRate,
    Windows,
)
from tumble.calibration.equations.turn_equations import Turn
from tumble.estimation import Eliminated, Equations, Place, Stretch


class RotationStretch:
    """The windows of a table's rotation, between the tail of one hold and the head of the next."""

    size = 3

    def __init__(self, task: JointAdjustment, section: Section, k: int) -> None:
        self.task, self.section, self.k = task, section, k
        self.rotation, self.moving = task.data.rotations[k], task.rotations[k]
        self.layout = Layout.of(self.rotation)
        self.nodes, self.own = len(self.rotation.windows), self.layout.own
        kinds = (Windows, Links, Axis, Angle, TableRate, Own)
        self.equations: list[Equations] = [of_kind(self) for of_kind in kinds]
        self.within: list[tuple[Place, Stretch | Eliminated]] = []

    @property
    def joined(self) -> Place:
        """Where it stands in its section."""
        return Place(self.k - self.section.first, TAIL, HEAD)

    def edges(self) -> tuple[Matrix, Matrix]:
        """Return the attitudes at the tail of the hold before and at the head of the hold after."""
        node = self.k - self.section.first
        return self.section.C_wb[node, 2], self.section.C_wb[node + 1, 0]

    def undetermined(self, node: int) -> str:
        """Say which rotation a window is of."""
        base, k = self.task.data.base, self.k
        span = _seconds(base.time, float(base.tail[k, 1]), float(base.head[k + 1, 0]))
        return _undetermined(f"in the rotation after hold {k + 1} ({span})")

    def move(self, nodes: Table, own: Series) -> None:
        """Move the windows' attitudes and the rotation's own unknowns."""
        moving, axis = self.moving, self.layout.axis
        moving.C_wb = matrices_from_rotation_vectors(nodes) @ moving.C_wb
        leaning = own[axis]
        moving.axis_b, moving.axis_w = (
            _leaned(moving.axis_b, leaning[:2]),
            _leaned(moving.axis_w, leaning[2:]),
        )
        moving.own = moving.own + own
        moving.own[axis] = 0.0
        if moving.anchor is not None:
            moving.anchor = matrix_from_rotation_vector(own[self.layout.anchor]) @ moving.anchor
            moving.own[self.layout.anchor] = 0.0


def _leaned(axis: Series, by: Series) -> Series:
    moved = axis + tangent_basis(axis) @ by
    return np.asarray(moved / np.linalg.norm(moved), dtype=np.float64)


def _seconds(time: Series, start: float, stop: float) -> str:
    first, last = (time[[int(start), int(stop) - 1]] - time[0]).tolist()
    return f"{first:.1f} to {last:.1f} s"


def _undetermined(where: str) -> str:
    return (
        f"What was recorded does not determine the unit's attitude {where}. Hold the unit still in each pose and keep "
        "the gyro within its range, and record again."
    )


class SectionStretch:
    """An unbroken run of holds, with an Earth rate of its own.

    Parameters
    ----------
    task, section : whose.
    of_motion : with what is known of the motion itself: that holds rest, the site's Earth rate, a heading. Of several
        units that move together it counts once.
    """

    size, own = NODE, 3

    def __init__(self, task: JointAdjustment, section: Section, *, of_motion: bool = True) -> None:
        self.task, self.section, self.of_motion = task, section, of_motion
        self.nodes = section.last - section.first
        self.equations: list[Equations] = self._observed()
        self.within: list[tuple[Place, Stretch | Eliminated]] = self._rotations()

    def _observed(self) -> list[Equations]:
        """What holds, hand turns and poses show, and what fixes the frame."""
        task, section = self.task, self.section
        made: list[Equations] = [Force(section), Rate(section), Swing(section)]
        if self.of_motion:
            made.append(Rest(section))
        turns = [k for k in section.holds[:-1].tolist() if k not in task.data.rotations]
        if turns:
            made.append(Turn(section, np.array(turns)))
        if task.data.poses is not None:
            made += pose_equations(task.data.poses, section)
        return made + self._references() if self.of_motion else made

    def _references(self) -> list[Equations]:
        made: list[Equations] = [] if self.task.sees_heading(self.section) else [Heading()]
        gone = ~self.task.taking_part["force"][self.section.holds]
        if np.any(gone):
            made.append(Loose(self.section, gone))
        return [*made, EarthRate(self.section)]

    def _rotations(self) -> list[tuple[Place, Stretch | Eliminated]]:
        """A table's."""
        made: list[tuple[Place, Stretch | Eliminated]] = []
        for k in self.section.holds[:-1].tolist():
            if k in self.task.data.rotations:
                rotation = RotationStretch(self.task, self.section, k)
                made.append((rotation.joined, rotation))
        return made

    def undetermined(self, node: int) -> str:
        """Say which hold a node is."""
        base, k = self.task.data.base, int(self.section.holds[node])
        span = _seconds(base.time, float(base.head[k, 0]), float(base.tail[k, 1]))
        return _undetermined(f"in hold {k + 1} ({span})")

    def move(self, nodes: Table, own: Series) -> None:
        """Turn the attitudes, and move the Earth rate."""
        turned = matrices_from_rotation_vectors(nodes.reshape(-1, 3)) @ self.section.C_wb.reshape(-1, 3, 3)
        self.section.C_wb = turned.reshape(self.section.C_wb.shape)
        self.section.earth_w = self.section.earth_w + own


class RecordingStretch:
    """All sections of a recording; its unknowns are shared and no chain's own."""

    nodes, size, own = 0, NODE, 0

    def __init__(self, task: JointAdjustment) -> None:
        self.within: list[tuple[Place, Stretch | Eliminated]] = []
        for section in task.sections:
            self.within.append((Place(), SectionStretch(task, section)))
        self.equations: list[Equations] = []

    def undetermined(self, node: int) -> str:
        """Say it of the whole: it has no nodes."""
        return _undetermined("in the recording")

    def move(self, nodes: Table, own: Series) -> None:
        """Do nothing: sections move themselves."""
