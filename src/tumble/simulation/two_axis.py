"""A two-axis fixture: its outer axis level, its inner axis on the outer one and carrying the unit.

The attitude that it gives the unit is, from the room to the unit's b,

    C_nb = L · R_z(azimuth + heading − 90°) · R_y(outer) · R_x(orthogonality) · R_z(inner) · exp(mounting ×)

with the angles as they really are: what was asked for, the zero error, and an error of execution at every
stop. L is the lean of the installation. A rotation of one axis is a rotation about a line that is fixed in b,
so that motions stay closed formulas. Both axes meet in one point, from which the lever arm counts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector
from tumble.attitude import matrix_from_rotation_vector, quaternion_from_matrix
from tumble.errors import UsageError
from tumble.protocol import (
    SAME_POSE,
    HoldStep,
    Protocol,
    TurnStep,
    refuse_contradicting_turns,
    sequence_steps,
)
from tumble.records import dataclass
from tumble.simulation.axis_angles import fixture_angles, unit
from tumble.simulation.fixtures import PlayedProtocol, TrueRotation
from tumble.simulation.motion import Motion
from tumble.simulation.spin_shapes import SpinShapes

_HALF_TURN, _QUARTER = np.pi, 0.5 * np.pi
# Between sequences, and where nothing else is said, the fixture turns so fast.
MOVING_RATE = 1.0  # rad/s
# Half a turn goes the positive way, whatever rounding says.
_TIE = 1e-9
# A turn takes some time even where it has no ramps and nowhere to go.
_SHORTEST = 0.01  # s
AXES = ("inner", "outer")
"""Of the fixture, in the order in which they move between sequences."""


@dataclass(frozen=True)
class FixtureErrors:
    """What is wrong with a two-axis fixture, and how it turns; without arguments nothing is wrong.

    Attributes
    ----------
    heading : rad, the outer axis points by so much clockwise of where the protocol has it.
    tilt : (2,) rad about north and east, by which the whole fixture leans.
    orthogonality : rad, by which the angle between outer and inner axis exceeds a right angle.
    inner_zero, outer_zero : rad, true angle less the displayed one.
    mounting : (3,) rad, rotation vector by which the unit lies on the inner axis, in the unit's axes.
    execution : rad, one sigma by which an axis stops beside where it is sent, each stop for itself.
    rate : rad/s of its rotations; None takes as long for each as the protocol says.
    ramp : s to come to the rate, and to stop.
    pause : s that it rests between rotations of one sequence, and between its axes' moves.

    """

    heading: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    orthogonality: float = 0.0
    inner_zero: float = 0.0
    outer_zero: float = 0.0
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)
    execution: float = 0.0
    rate: float | None = None
    ramp: float = 0.5
    pause: float = 1.0

    def drawn(self, rng: np.random.Generator) -> FixtureErrors:
        """Return one fixture of this quality: each error drawn with what stands here as its one sigma.

        The error of execution is one sigma anyway; it and the profile of rotations stay.

        Parameters
        ----------
        rng : source of all numbers.
        """
        made: dict[str, Any] = {}
        for name in ("heading", "tilt", "orthogonality", "inner_zero", "outer_zero", "mounting"):
            sigma = np.array(getattr(self, name))
            # No minus zero in a file.
            drawn = sigma * rng.standard_normal(sigma.shape) + 0.0
            made[name] = tuple(drawn.tolist()) if sigma.ndim else float(drawn)
        return replace(self, **made)

    def C_nb(self, inner: float, outer: float, azimuth: float = _QUARTER) -> Matrix:
        """Return (3, 3) the unit's attitude at angles of the fixture as displayed, without errors of execution.

        Parameters
        ----------
        inner, outer : rad.
        azimuth : rad, where the outer axis is meant to point, clockwise from north.
        """
        room = _turn(*self.tilt, 0.0) @ _turn(0.0, 0.0, azimuth + self.heading - _QUARTER)
        return room @ _turn(0.0, outer + self.outer_zero, 0.0) @ self._from_outer(inner)

    def _from_outer(self, inner: float) -> Matrix:
        """From the outer axis' frame, y along it, to b."""
        turned = _turn(self.orthogonality, 0.0, 0.0) @ _turn(0.0, 0.0, inner + self.inner_zero)
        return turned @ _turn(*self.mounting)

    def axis_b(self, axis: str, inner: float) -> Vector:
        """Return the unit vector in b about which the unit turns with an axis of the fixture.

        Parameters
        ----------
        axis : "inner" or "outer".
        inner : rad, where the inner axis stands, as displayed; of no matter to itself.
        """
        if axis == "inner":
            return _turn(*self.mounting)[2]
        return self._from_outer(inner)[1]


def _turn(x: float, y: float, z: float) -> Matrix:
    """The rotation by the vector (x, y, z) rad."""
    return matrix_from_rotation_vector(np.array([x, y, z]))


def play_sequences(
    protocol: Protocol,
    rng: np.random.Generator,
    errors: FixtureErrors,
    *,
    heading: float | Series | None = None,
    lever_arm_b: AnyArray | None = None,
) -> PlayedProtocol:
    """Return the motion of a unit on a two-axis fixture through the sequences of a protocol.

    A named turn is made by the axis along which the unit's axis then lies, by the angle asked for with
    errors of execution; a sequence's end is where its rotations lead. To a hold that a turn without an axis
    leads to, the inner axis moves first, then the outer, each the shorter way round.

    Parameters
    ----------
    protocol : holds and turns. The azimuth of the outer axis is that of its poses.
    rng : source of the errors of execution, and of an azimuth that no pose determines.
    errors : of the fixture.
    heading : rad, the azimuth of the outer axis where no pose determines it; None draws it.
    lever_arm_b : (3,) m, from where the axes meet to the unit, or (3, 3) with a row for each accelerometer.

    Raises
    ------
    ProtocolError
        If a turn does not lead to the pose of the next hold.
    UsageError
        If the protocol has no sequence, or asks for what a two-axis fixture cannot do.
    """
    if not sequence_steps(protocol):
        raise UsageError(
            f"The protocol {protocol.name} has no sequence of rotations (a hold, turns with axis and angle, a hold): "
            "a two-axis fixture has nothing to do."
        )
    refuse_contradicting_turns(protocol)
    angles = fixture_angles(protocol)
    azimuth = angles.azimuth
    if azimuth is None:
        azimuth = float(rng.uniform(0.0, 2.0 * np.pi) if heading is None else np.ravel(heading)[0])
    stops = angles.stops
    player = _Player(protocol, errors, azimuth, rng, next(stop for stop in stops if np.isfinite(stop[0])))
    for number, step in enumerate(protocol.steps):
        if isinstance(step, HoldStep):
            player.hold(number, step, stops[number])
        elif isinstance(step, TurnStep) and step.axis_b is not None and step.angle is not None:
            player.turn(number, step, np.subtract(stops[number], stops[number - 1]))
    return player.finish(np.zeros(3) if lever_arm_b is None else lever_arm_b)


@dataclass
class _Move:
    """A rotation of one axis, 0 the inner and 1 the outer: its step, rotation vector in b, s, s."""

    step: int | None
    axis: int
    angle: float
    axis_b: Vector
    duration: float
    ramp: float


class _Player:
    """A fixture in use: where it is sent, where it stands, and what was done."""

    def __init__(
        self,
        protocol: Protocol,
        errors: FixtureErrors,
        azimuth: float,
        rng: np.random.Generator,
        start: tuple[float, float],
    ) -> None:
        self.protocol, self.errors, self.rng = protocol, errors, rng
        self.sent = np.array(start)
        self.off = np.array([self._stop_error(), self._stop_error()])
        inner, outer = self.sent + self.off
        self.first = errors.C_nb(float(inner), float(outer), azimuth)
        self.holds: list[tuple[float, int | None]] = []
        self.moves: list[_Move] = []

    def hold(self, number: int, step: HoldStep, stop: tuple[float, float]) -> None:
        before = self.protocol.steps[number - 1] if number else step
        if self.holds and (not isinstance(before, TurnStep) or before.axis_b is None):
            self._bring(None if isinstance(before, HoldStep) else number - 1, before.duration, stop)
        self.holds.append((step.duration, number))

    def turn(self, number: int, step: TurnStep, asked: Series) -> None:
        assert step.axis_b is not None
        axis = 0 if abs(unit(step.axis_b)[2]) > 1.0 - SAME_POSE else 1
        self._rotate(number, axis, float(asked[axis]), step.duration if self.errors.rate is None else None)

    def _bring(self, number: int | None, duration: float, stop: tuple[float, float]) -> None:
        """Move both axes, one after the other, the shorter way; where nothing moves time passes all the same."""
        way = _HALF_TURN - np.mod(_HALF_TURN + self.sent - np.array(stop) + _TIE, 2.0 * np.pi) + _TIE
        moved = False
        for axis in (0, 1):
            if abs(way[axis]) > 10.0 * _TIE:
                self._rotate(number, axis, float(way[axis]), None)
                moved = True
        if not moved:
            self.moves.append(_Move(number, 0, 0.0, np.array([0.0, 0.0, 1.0]), duration, 0.0))

    def _rotate(self, number: int | None, axis: int, asked: float, duration: float | None) -> None:
        if len(self.moves) == len(self.holds):
            self.holds.append((self.errors.pause, None))
        inner = float(self.sent[0] + self.off[0])
        error = self._stop_error()
        angle, self.off[axis] = asked + error - self.off[axis], error
        self.sent[axis] += asked
        ramp = self.errors.ramp
        if duration is None:
            # A ramp turns half of what the same time at the rate does; a small angle is ramps alone.
            duration = max(abs(asked) / (self.errors.rate or MOVING_RATE), ramp, _SHORTEST) + ramp
        axis_b = self.errors.axis_b(AXES[axis], inner)
        self.moves.append(_Move(number, axis, float(angle), axis_b, duration, min(ramp, 0.5 * duration)))

    def _stop_error(self) -> float:
        return float(self.rng.normal(0.0, self.errors.execution)) if self.errors.execution > 0.0 else 0.0

    def finish(self, lever_arm_b: AnyArray) -> PlayedProtocol:
        if len(self.moves) == len(self.holds):
            self.holds.append((self.errors.pause, None))
        motion = Motion(
            first_quaternion_nb=quaternion_from_matrix(self.first),
            hold_duration=np.array([duration for duration, _ in self.holds]),
            turn_duration=np.array([move.duration for move in self.moves]),
            turn_vector_b=np.array([move.angle * move.axis_b for move in self.moves]).reshape(-1, 3),
            lever_arm_b=lever_arm_b,
            spin_shapes=SpinShapes.even(np.array([move.ramp for move in self.moves])),
        )
        holds = motion.hold_edges
        edges = np.full((len(self.protocol.steps), 2), np.nan)
        for (_, number), interval in zip(self.holds, holds, strict=True):
            if number is not None:
                edges[number] = interval
        rotations: list[TrueRotation] = []
        for k, move in enumerate(self.moves):
            start, stop = float(holds[k, 1]), float(holds[k + 1, 0])
            if move.step is not None:
                edges[move.step] = np.fmin(edges[move.step, 0], start), stop
            rotations.append(TrueRotation(move.step, AXES[move.axis], start, stop, move.angle, move.axis_b))
        steps = tuple(number for _, number in self.holds)
        return PlayedProtocol(motion, edges, steps, (), self.protocol.steps, tuple(rotations))
