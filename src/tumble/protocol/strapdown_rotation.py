"""The rotation sequences of the strapdown rotation test (Savage 2018, table 1), on a two-axis fixture.

The fixture's outer axis is horizontal, its inner axis carries the unit along z; with both angles zero z
is down and y along the outer axis. Inner and outer angles are right-handed about the unit's z and y as
they then lie. Table 1 leaves out the start of row 6: x down, y along the outer axis, inner 0, outer -90.

In a protocol a sequence is a hold, one or more turns with axis and angle, and a hold: users may write
sequences of their own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tumble.arrays import Vector
from tumble.protocol.steps import HoldStep, Pose, Protocol, Step, TurnStep
from tumble.records import dataclass

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

AXES = ("x", "y", "z")
_QUARTER = np.pi / 2.0
# Averages are taken at rest, and turns made, as Savage's section 9 has them; a fixture's turn begins and ends gently.
HOLD, RATE, RAMP = 10.0, 1.0, 0.5  # s, rad/s, s
# From one sequence to the start of the next: both axes, one after the other.
MOVE = 8.0  # s
# What a fixture's attitude is known to: 0.1 degrees would be 1.7 mrad.
FIXTURE_SIGMA = 1e-3
# Digits of a file, and what a user's axis may be off that of a row, rad.
SAME_ROTATION = 1e-3
ROUNDING = 1e-9


@dataclass(frozen=True)
class RotationSequence:
    """One row of table 1.

    Attributes
    ----------
    name : "1" to "14", "1a" to "3a".
    inner, outer : rad, the fixture's angles at the start.
    rotations : (axis, angle) one after another: 0, 1, 2 for x, y, z of the unit, and rad, right-handed.
    """

    name: str
    inner: float
    outer: float
    rotations: tuple[tuple[int, float], ...]

    def fixture_angles(self) -> list[tuple[float, float]]:
        """Return (inner, outer), rad, at the start and after each rotation."""
        from scipy.spatial.transform import Rotation

        inner, outer = self.inner, self.outer
        angles = [(inner, outer)]
        for axis, angle in self.rotations:
            if axis == 2:
                inner += angle
            else:
                along = float((Rotation.from_rotvec([0.0, 0.0, inner]).apply(np.eye(3)[axis]))[1])
                outer += round(along) * angle
            angles.append((inner, outer))
        return angles


def fixture_rotation(inner: float, outer: float) -> Rotation:
    """Return the unit's nominal attitude C_tb in the fixture's frame t: y its outer axis, z down.

    Parameters
    ----------
    inner, outer : rad.
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec([0.0, outer, 0.0]) * Rotation.from_rotvec([0.0, 0.0, inner])


def _row(name: str, inner: int, outer: int, text: str) -> RotationSequence:
    rotations = tuple(
        (AXES.index(word[-1]), int(word[:-1]) * np.pi / 180.0) for word in text.replace(",", " ").split()
    )
    return RotationSequence(name, inner * _QUARTER / 90, outer * _QUARTER / 90, rotations)


SEQUENCES: tuple[RotationSequence, ...] = (
    _row("1", 0, 0, "+360y"),
    _row("2", 90, 0, "+360x"),
    _row("3", 0, -90, "+360z"),
    _row("1a", 0, 0, "-360y"),
    _row("2a", 90, 0, "-360x"),
    _row("3a", 0, -90, "-360z"),
    _row("4", 0, 0, "+180y +180z +180y +180z"),
    _row("5", 90, 0, "+180x +180z +180x +180z"),
    _row("6", 0, -90, "+180y +90z +180x +90z +180y +90z +180x +90z"),
    _row("7", 90, 90, "+180x"),
    _row("8", 90, 0, "+180x"),
    _row("9", 0, -90, "+180z"),
    _row("10", 90, 90, "+180z"),
    _row("11", 0, 0, "+180y"),
    _row("12", 0, -90, "+180y"),
    _row("13", 0, 0, "+180z +180y"),
    _row("14", 90, 0, "+180z +180x"),
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


class SequenceSteps(NamedTuple):
    """Where a sequence stands in a protocol.

    Attributes
    ----------
    name : that of the row of table 1 that it is; for any other one that of its first hold.
    start : index of the step of the hold before it.
    turns : indices of its rotations, in order.
    end : index of the hold after it.
    """

    name: str
    start: int
    turns: tuple[int, ...]
    end: int


def strapdown_rotation_steps() -> tuple[Step, ...]:
    """Return all sequences of table 1 as the steps of a protocol: a turn anyhow between them, the outer axis east."""
    steps: list[Step] = []
    for row in SEQUENCES:
        if steps:
            steps.append(TurnStep(MOVE))
        angles = row.fixture_angles()
        poses = [_pose(fixture_rotation(*angles[k])) for k in (0, -1)]
        steps.append(HoldStep(HOLD, poses[0], f"{row.name} start"))
        for axis, angle in row.rotations:
            name = f"{row.name}: {np.degrees(angle):+.0f} {AXES[axis]}"
            duration = abs(angle) / RATE + RAMP  # a ramp turns half of what the same time at the rate does
            steps.append(TurnStep(duration, np.eye(3)[axis], angle, FIXTURE_SIGMA, name))
        steps.append(HoldStep(HOLD, poses[1], f"{row.name} end"))
    return tuple(steps)


def _pose(rotation_nb: Rotation) -> Pose:
    """The pose of an attitude on the fixture, without rounding errors in what is up."""
    pose = Pose.from_matrix(rotation_nb.as_matrix())
    heading = pose.heading or 0.0
    quarters = round(heading / _QUARTER)
    if abs(heading - quarters * _QUARTER) < ROUNDING:
        heading = (quarters if quarters > -2 else 2) * _QUARTER
    return Pose(np.round(pose.up_b) + 0.0, heading, FIXTURE_SIGMA)


def sequence_steps(protocol: Protocol) -> list[SequenceSteps]:
    """Return the sequences of a protocol in their order: each a hold, turns with axis and angle, a hold.

    A sequence is a row of table 1 if the same axis is down at its start and its rotations are the same;
    where its outer axis points does not matter. A hold may end one sequence and start the next.

    Parameters
    ----------
    protocol : of any procedure.
    """
    steps = protocol.steps
    found: list[SequenceSteps] = []
    for start, first in enumerate(steps):
        if not isinstance(first, HoldStep):
            continue
        end = start + 1
        while end < len(steps) and _is_rotation(steps[end]):
            end += 1
        if end > start + 1 and end < len(steps) and isinstance(steps[end], HoldStep):
            turns = tuple(range(start + 1, end))
            name = _row_name(first, [steps[turn] for turn in turns]) or _own_name(first, start)
            found.append(SequenceSteps(name, start, turns, end))
    return found


def _is_rotation(step: Step) -> bool:
    return isinstance(step, TurnStep) and step.axis_b is not None and step.angle is not None


def _row_name(start: HoldStep, turns: list[Step]) -> str | None:
    """The row of table 1 that has this start and these rotations."""
    if start.pose is None:
        return None
    down_b = -start.pose.up_b / np.linalg.norm(start.pose.up_b)
    vectors = [
        step.angle * step.axis_b / np.linalg.norm(step.axis_b)
        for step in turns
        if isinstance(step, TurnStep) and step.axis_b is not None and step.angle is not None
    ]
    for row in SEQUENCES:
        wanted = [angle * np.eye(3)[axis] for axis, angle in row.rotations]
        if len(wanted) == len(vectors) and np.linalg.norm(down_b - start_down(row)) < SAME_ROTATION:
            off = np.linalg.norm(np.array(wanted) - np.array(vectors), axis=1)
            if np.all(off <= SAME_ROTATION * np.linalg.norm(wanted, axis=1)):
                return row.name
    return None


def _own_name(start: HoldStep, number: int) -> str:
    """A name that is no row's, because it would be taken for it."""
    name = start.name or f"step {number + 1}"
    return f"own {name}" if any(name == row.name for row in SEQUENCES) else name
