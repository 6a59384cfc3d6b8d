"""Rotations both ways about one axis: their difference knows neither bias nor Earth rate (Zhang 2010, (15) to (18))."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.protocol import Protocol
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.segmentation.matching import Matching
from tumble.segmentation.rotations import Rotation
from tumble_papers.spin_groups import group_spins

# Axes nearer than this to one another are one: 3 degrees, as `SMALLEST_SINE` of the inter-triad angles.
SAME_AXIS = np.cos(np.radians(3.0))


@dataclass(slots=True)
class RotationPair:
    """All rotations of one placement about one axis.

    Attributes
    ----------
    axis_b : (3,) unit vector, as the protocol has it, or as the pose before it has up.
    forward, backward : counter-clockwise and clockwise about it.
    """

    axis_b: Vector
    forward: list[Rotation] = field(default_factory=list[Rotation])
    backward: list[Rotation] = field(default_factory=list[Rotation])

    @property
    def rotations(self) -> list[Rotation]:
        """All of them."""
        return [*self.forward, *self.backward]

    @property
    def shares(self) -> list[tuple[float, Rotation]]:
        """What each rotation's integral is multiplied with in (18): the mean forward less the mean backward."""
        sides = (1.0, self.forward), (-1.0, self.backward)
        return [(sign / len(side), rotation) for sign, side in sides for rotation in side]

    @property
    def angle(self) -> float:
        """Difference of the table's angles, rad, above zero."""
        return sum(abs(share * rotation.angle) for share, rotation in self.shares)

    @property
    def angle_sigma(self) -> float:
        """Its standard uncertainty, rad."""
        return float(np.sqrt(sum((share * rotation.angle_sigma) ** 2 for share, rotation in self.shares)))

    @property
    def covariance(self) -> Matrix:
        """(3, 3) of the difference of the integrals, raw²·s²."""
        return np.asarray(sum(share**2 * rotation.covariance for share, rotation in self.shares))

    def difference(self, means: HoldMeans) -> Vector:
        """Return (3,) raw·s, the mean integral forward less that backward (18).

        What the rests beside the rotations show is taken out of both. With ways that took the same time, as in the
        paper, that is nothing; with others it is the bias and the Earth rate along the axis.

        Parameters
        ----------
        means : of the holds.
        """
        assert means.angular_rate is not None
        holds = sorted({h for r in self.rotations for h in (r.before, r.after) if h is not None})
        rest = np.mean(means.angular_rate[holds] if holds else means.angular_rate, axis=0)
        return np.asarray(sum(share * (r.integral - r.seconds * rest) for share, r in self.shares))


def pair_rotations(
    rotations: Sequence[Rotation], matching: Matching, protocol: Protocol
) -> list[RotationPair]:
    """Return the axes that were turned about both ways.

    Parameters
    ----------
    rotations : in the order of `matching.spins`.
    matching, protocol : which of them belongs to which placement, and about which axis.
    """
    pairs: list[RotationPair] = []
    for group in group_spins(matching, protocol):
        mine: list[RotationPair] = []
        for row, step in zip(group.rows, group.spins, strict=True):
            axis = step.axis_b if step.axis_b is not None else (group.pose.up_b if group.pose else None)
            if axis is None:
                continue
            axis = np.asarray(axis / np.linalg.norm(axis), dtype=np.float64)
            # An axis may be named by its other end.
            pair = next((p for p in mine if abs(float(p.axis_b @ axis)) > SAME_AXIS), None)
            if pair is None:
                pair = RotationPair(axis)
                mine.append(pair)
            way = float(pair.axis_b @ axis) * step.rate
            (pair.forward if way > 0.0 else pair.backward).append(rotations[row])
        pairs += mine
    return [pair for pair in pairs if pair.forward and pair.backward]
