"""Rotations both ways about one axis: their difference knows neither bias nor Earth rate (Zhang 2010, (15) to (18)).

The difference is free of them to the last digit only if both ways took the same time and went through
whole revolutions. What is left otherwise, with uneven ramps or a table that stopped early, is taken out:
the bias and the Earth rate along the axis last as long as the rotation, the Earth rate across it goes
round with the angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from tumble.arrays import Matrix, Vector, Vectors, inverted
from tumble.calibration.equations.spin_groups import group_spins
from tumble.errors import ObservabilityError
from tumble.protocol import Protocol, SpinStep
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.segmentation.matching import Matching
from tumble.segmentation.rotations import Rotation
from tumble.units import angular_rate_factor

# Axes nearer than this to one another are one: 3 degrees, as in `SMALLEST_SINE` of the inter-triad angles.
SAME_AXIS = np.cos(np.radians(3.0))
NEEDED = 6
# The two ways about an axis show the same gyro: beyond 1 % one of the angles is wrong. Against the nominal unit
# no gyro is off by a fifth.
UNLIKE, LARGEST_SCALE = 0.01, 1.2
# rad/s that a gyro's g-sensitivity and a wandering bias may differ by from the mean of all rests.
WANDERING = np.radians(0.6)


@dataclass(slots=True)
class RotationPair:
    """All rotations of one placement about one axis.

    Attributes
    ----------
    name : for people.
    axis_b : (3,) unit vector, as the protocol has it, or as the pose before it has up.
    forward, backward : counter-clockwise and clockwise about it; their `angle` has the sign of the protocol's
        own axis, which may be the opposite one.
    """

    name: str
    axis_b: Vector
    forward: list[Rotation] = field(default_factory=list[Rotation])
    backward: list[Rotation] = field(default_factory=list[Rotation])

    @property
    def rotations(self) -> list[Rotation]:
        """All of them, in order of time."""
        return sorted([*self.forward, *self.backward], key=lambda rotation: rotation.start)

    @property
    def balance(self) -> float:
        """How many times as long forward took as backward: so many times backward leaves no bias in the difference."""
        forward, backward = (
            float(np.mean([r.seconds for r in side])) for side in (self.forward, self.backward)
        )
        return forward / backward

    @property
    def shares(self) -> list[tuple[float, Rotation]]:
        """What each rotation's integral is multiplied with in the difference: forward less backward, balanced."""
        return [
            (sign / len(side), rotation)
            for side, sign in ((self.forward, 1.0), (self.backward, -self.balance))
            for rotation in side
        ]

    @property
    def angle(self) -> float:
        """Difference of the table's angles, rad, above zero."""
        return sum(abs(share) * abs(rotation.angle) for share, rotation in self.shares)

    @property
    def angle_sigma(self) -> float:
        """Its standard uncertainty, rad."""
        return float(np.sqrt(sum((share * rotation.angle_sigma) ** 2 for share, rotation in self.shares)))

    @property
    def covariance(self) -> Matrix:
        """(3, 3) of the difference of the integrals, raw²·s²."""
        return np.asarray(sum(share**2 * rotation.covariance for share, rotation in self.shares))

    def difference(self, parts: dict[int, Vector]) -> Vector:
        """Return the mean integral forward minus that backward, less what `parts` says of each.

        What a gyro shows all the time in this placement, such as a g-sensitivity, goes out of it.

        Parameters
        ----------
        parts : by `Rotation.row`, raw·s.
        """
        return np.asarray(sum(share * (r.integral - parts[r.row]) for share, r in self.shares))


def pair_rotations(
    rotations: Sequence[Rotation], matching: Matching, protocol: Protocol, *, needed: int = NEEDED
) -> tuple[list[RotationPair], list[str]]:
    """Return the pairs, and sentences on rotations that have no counterpart.

    Parameters
    ----------
    rotations : in the order of `matching.spins`.
    matching, protocol : which of them belongs to which placement, and about which axis.
    needed : how many axes: six where the angles alone are believed, three where the axes are too.

    Raises
    ------
    ObservabilityError
        If fewer axes were turned about both ways; the message names those that lack one.
    """
    pairs: list[RotationPair] = []
    for group in group_spins(matching, protocol):
        mine: list[RotationPair] = []
        for row, step in zip(group.rows, group.spins, strict=True):
            axis = step.axis_b if step.axis_b is not None else (group.pose.up_b if group.pose else None)
            if axis is not None:
                _add(mine, rotations[row], step, np.asarray(axis, dtype=float) / np.linalg.norm(axis))
        pairs += mine
    whole = [pair for pair in pairs if pair.forward and pair.backward]
    alone = [pair for pair in pairs if not (pair.forward and pair.backward)]
    words = [_lonely(pair) for pair in alone]
    if len(whole) < needed:
        raise ObservabilityError(_too_few(protocol, whole, words, needed))
    return whole, words


def refuse_unlike_angles(recording: Recording, pairs: Sequence[RotationPair], means: HoldMeans) -> None:
    """Refuse angles of the protocol that the gyros contradict: a table that stopped early, a display misread.

    Parameters
    ----------
    recording : for its unit.
    pairs : the rotations.
    means : of the holds: their mean stands for bias and Earth rate.

    Raises
    ------
    ObservabilityError
        If the two ways round do not fit one another, or the nominal unit: the message names the steps.
    """
    parts = EarthParts(pairs, means).parts()
    factor = angular_rate_factor(recording.angular_rate_unit)
    for pair in pairs:
        shown = [float(np.linalg.norm(r.integral - parts[r.row])) / abs(r.angle) for r in pair.rotations]
        middle = 1.0 / factor if factor else float(np.median(shown))
        slow = max(r.seconds / abs(r.angle) for r in pair.rotations)
        slack = UNLIKE + WANDERING * slow
        if max(shown) / min(shown) < 1.0 + slack and all(
            1.0 / LARGEST_SCALE < value / middle < LARGEST_SCALE for value in shown
        ):
            continue
        # The one that is further from what a sensor of this unit shows, or from the other.
        worst = pair.rotations[int(np.argmax(np.abs(np.log(np.array(shown) / middle))))]
        ratio = shown[pair.rotations.index(worst)] / (
            middle if factor else min(shown, key=lambda v: abs(np.log(v / middle)))
        )
        raise ObservabilityError(
            f"Step {worst.step + 1}, about {pair.name}: the protocol says that the table turned "
            f"{np.degrees(worst.angle):.6g}°, and the gyros turned about {np.degrees(worst.angle) * ratio:.4g}°. The "
            "table stopped early, or the display was misread: put the angle that it did turn into the protocol "
            "(`angle_deg`)."
        )


def _add(pairs: list[RotationPair], rotation: Rotation, step: SpinStep, axis: Vector) -> None:
    """Put a rotation to the others about its axis, which may be named by its other end."""
    for pair in pairs:
        along = float(pair.axis_b @ axis)
        if abs(along) > SAME_AXIS:
            (pair.forward if along * step.rate > 0.0 else pair.backward).append(rotation)
            return
    pair = RotationPair(_axis_words(axis), axis)
    (pair.forward if step.rate > 0.0 else pair.backward).append(rotation)
    pairs.append(pair)


def _axis_words(axis: Vector) -> str:
    """Return an axis as a user knows it.

    Examples
    --------
    >>> _axis_words(np.array([0.0, -1.0, 0.0]))
    '-y'
    >>> _axis_words(np.array([0.6, 0.8, 0.0]))
    '(0.6, 0.8, 0)'
    """
    face = int(np.argmax(np.abs(axis)))
    if abs(axis[face]) > 1.0 - 1e-6:
        return f"{'-' if axis[face] < 0 else ''}{'xyz'[face]}"
    return "(" + ", ".join(f"{value:.3g}" for value in np.where(np.abs(axis) < 1e-9, 0.0, axis)) + ")"


def _lonely(pair: RotationPair) -> str:
    """Say which way is missing."""
    found, lost = ("counter-clockwise", "clockwise") if pair.forward else ("clockwise", "counter-clockwise")
    return (
        f"the axis {pair.name} was turned about {found} only: its {lost} turn is missing, and without it bias and "
        "Earth rate do not go out"
    )


def _too_few(protocol: Protocol, whole: list[RotationPair], words: list[str], needed: int) -> str:
    names = ", ".join(pair.name for pair in whole) or "none"
    lonely = f" Of the others {'; '.join(words)}." if words else ""
    planned = {
        _axis_words(np.asarray(step.axis_b, dtype=float) / np.linalg.norm(step.axis_b))
        for step in protocol.steps
        if isinstance(step, SpinStep) and step.axis_b is not None
    }
    few = (
        f" The protocol {protocol.name} itself has {len(planned)} axes only." if len(planned) < needed else ""
    )
    wanted = (
        "for the gyros' six scale factors and misalignments: x, y, z and one axis between each two of them"
        if needed == NEEDED
        else "for the gyros' whole matrix: about x, y and z"
    )
    return (
        f"Rotations both ways were found about {len(whole)} axes ({names}), and {needed} are needed {wanted}."
        f"{lonely}{few}"
    )


class EarthParts:
    """What bias and Earth rate add to each rotation, raw·s.

    Parameters
    ----------
    pairs : the rotations.
    means : of the holds; those beside a rotation show the Earth rate before it.
    matrix, bias : (3, 3), (3,) of the gyros, raw; None to begin with, when the mean of the rests beside a pair
        stands for both.
    before : the parts as they were known so far; they show the axes better than the bare integrals.
    felt : (holds, 3) raw, what the gyros show at rest by their g-sensitivity; None for nothing.
    """

    def __init__(
        self,
        pairs: Sequence[RotationPair],
        means: HoldMeans,
        matrix: Matrix | None = None,
        bias: Vector | None = None,
        before: dict[int, Vector] | None = None,
        felt: Vectors | None = None,
    ) -> None:
        assert means.angular_rate is not None
        self.rate = means.angular_rate if felt is None else means.angular_rate - felt
        self.pairs, self.matrix, self.bias, self.before = pairs, matrix, bias, before

    def parts(self) -> dict[int, Vector]:
        """Return them by `Rotation.row`."""
        found: dict[int, Vector] = {}
        for pair in self.pairs:
            holds = sorted({h for r in pair.rotations for h in (r.before, r.after) if h is not None})
            rest = np.mean(self.rate[holds] if holds else self.rate, axis=0)
            for rotation in pair.rotations:
                found[rotation.row] = self._part(pair, rotation, np.asarray(rest, dtype=np.float64))
        return found

    def _part(self, pair: RotationPair, rotation: Rotation, rest: Vector) -> Vector:
        if self.matrix is None or self.bias is None or self.before is None:
            return rest * rotation.seconds
        inverse = inverted(self.matrix)
        axis = inverse @ (rotation.integral - self.before[rotation.row])
        axis = axis * np.sign(rotation.angle) / np.linalg.norm(axis)
        # The part along the axis is the same for the whole pair, so that its noise goes out of the difference.
        along = axis * float(axis @ (inverse @ (rest - self.bias)))
        before = rest if rotation.before is None else self.rate[rotation.before]
        earth = inverse @ (before - self.bias)
        across = earth - axis * float(axis @ earth)
        # What stands still turns by minus the angle in b.
        turned = rotation.cosine * across - rotation.sine * np.cross(axis, across)
        return np.asarray(
            self.bias * rotation.seconds + self.matrix @ (along * rotation.seconds + turned), dtype=np.float64
        )
