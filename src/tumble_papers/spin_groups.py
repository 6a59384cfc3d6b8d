"""Which holds and spins of a protocol belong to one placement of the unit on the table.

The unit is placed, the table turns it, stops and turns it again; then it is placed otherwise. What
is wrong with a placement is the same in all its spins.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import field

import numpy as np

from tumble.arrays import Vector
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.records import dataclass
from tumble.segmentation.matching import Matching


@dataclass(slots=True)
class SpinGroup:
    """One placement on the table.

    Attributes
    ----------
    name : of its first hold, or of its first spin.
    pose : what the protocol knows of it, from the first hold that says.
    holds : indices of the holds found.
    rows : indices into the spins found, as `SpinMeans` has them.
    spins : the steps of those.
    """

    name: str = ""
    pose: Pose | None = None
    holds: list[int] = field(default_factory=list[int])
    rows: list[int] = field(default_factory=list[int])
    spins: list[SpinStep] = field(default_factory=list[SpinStep])


def group_spins(matching: Matching, protocol: Protocol) -> list[SpinGroup]:
    """Return the placements of a protocol with the holds and spins that were found.

    A new one begins with a turn, with a hold that follows a hold, and with a hold in a pose that the spin
    before it does not lead to.
    Placements of which nothing was found are left out.
    """
    holds: dict[int, list[int]] = defaultdict(list)
    rows: dict[int, list[int]] = defaultdict(list)
    # A step that was done twice is there twice.
    for matched in matching.holds:
        holds[matched.step].append(matched.hold)
    for row, spin in enumerate(matching.spins):
        rows[spin.step].append(row)
    groups = [SpinGroup()]
    before = None
    for index, step in enumerate(protocol.steps):
        if _begins(step, before, groups[-1]):
            groups.append(SpinGroup())
        group = groups[-1]
        if isinstance(step, HoldStep):
            group.pose = group.pose or step.pose
            group.holds += holds[index]
        if isinstance(step, SpinStep):
            group.rows += rows[index]
            group.spins += [step] * len(rows[index])
        group.name = group.name or step.name
        before = step
    return [group for group in groups if group.holds or group.rows]


def _begins(step: object, before: object, group: SpinGroup) -> bool:
    if isinstance(step, TurnStep):
        return True
    if not isinstance(step, HoldStep) or before is None:
        return False
    if isinstance(before, HoldStep):
        return True
    return _another_pose(group.pose, step.pose, before.axis_b if isinstance(before, SpinStep) else None)


def _another_pose(one: Pose | None, other: Pose | None, axis_b: Vector | None) -> bool:
    """Return whether a hold is in another pose than the spins about an axis before it make of the first one."""
    if one is None or other is None:
        return False
    apart = one.up_b - other.up_b
    # Written twice, or to two digits after the table stopped within a revolution: what is less than the poses are
    # uncertain by is no other pose. A milliradian: the same to the digit. Up stays where it was along the table's axis.
    same = max(1e-3, float(np.hypot(one.sigma, other.sigma)))
    return bool(np.max(np.abs(apart if axis_b is None else apart @ axis_b / np.linalg.norm(axis_b))) > same)
