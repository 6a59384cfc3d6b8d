"""What hands and a table make of a protocol: poses with placement errors, turns and spins between them.

The protocol says where the unit is meant to be; the fixture puts it there with an error that stays until
it is placed anew. A turn or a spin about a named axis goes about the axis of the table or of the box,
which does not move with that error: in the unit's own b it is off by it. So a misplaced unit shows its
gyros a rate that is not along the nominal axis, in every spin of that placement alike.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector
from tumble.attitude import (
    matrices_from_quaternions,
    matrix_from_rotation_vector,
    matrix_from_turn,
    quaternion_from_matrix,
    rotation_angle,
    rotation_vector_from_matrix,
    twenty_six_directions,
)
from tumble.errors import ProtocolError, UsageError
from tumble.protocol import (
    SAME_POSE,
    UP_N,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    Step,
    TurnStep,
    nearest_heading,
    refuse_contradicting_turns,
    refuse_contradiction,
)
from tumble.records import dataclass
from tumble.simulation.axis_angles import unit, where
from tumble.simulation.motion import Detours, Motion
from tumble.simulation.spin_shapes import directions_of, wobble_rotation
from tumble.simulation.table import Drive, Table, TableErrors
from tumble.simulation.thermal_steps import PlainSteps, has_chamber, without_chamber

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


# rad, the least angle by which gravity's direction in b moves from one pose of a hand to the next.
SMALLEST = 0.5


def poses_26(heading: float = 0.0) -> Rotation:
    """Return 26 attitudes in which b's up direction is a face, an edge or a corner of a cube.

    Parameters
    ----------
    heading : rad, turns all of them about the vertical; it decides what the gyros see of the Earth
        rate's horizontal part.
    """
    from scipy.spatial.transform import Rotation

    up_n = np.array([0.0, 0.0, -1.0])
    turned = Rotation.from_rotvec([0.0, 0.0, heading])
    return Rotation.concatenate(
        [turned * _turning_to(direction, up_n) for direction in twenty_six_directions()]
    )


def _turning_to(vector: np.ndarray, target: np.ndarray) -> Rotation:
    """The shortest rotation that brings one unit vector onto another."""
    from scipy.spatial.transform import Rotation

    axis = np.cross(vector, target)
    sine, cosine = float(np.linalg.norm(axis)), float(vector @ target)
    if sine < 1e-12:
        # opposite or equal: any horizontal axis will do
        return Rotation.from_rotvec([np.pi if cosine < 0.0 else 0.0, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))


def simulate_hand_pose(rng: np.random.Generator, after: Rotation | None = None) -> Rotation:
    """Draw an attitude as a hand takes it: anyhow, but clearly different from the one before.

    Parameters
    ----------
    rng : source of the attitude.
    after : attitude before, if there is one.
    """
    from scipy.spatial.transform import Rotation

    up_n = np.array([0.0, 0.0, -1.0])
    while True:
        # Any attitude as likely as any other.
        pose = Rotation.from_quat(rng.standard_normal(4))
        if after is None:
            return pose
        cosine = float(pose.inv().apply(up_n) @ after.inv().apply(up_n))
        if np.arccos(np.clip(cosine, -1.0, 1.0)) >= SMALLEST:
            return pose


# A turn that the protocol leaves out takes this long; before a turn or spin that no hold precedes the
# unit rests so long.
HAND_TURN, TABLE_REST = 3.0, 1.0  # s
# A hand's turn: one sigma of its duration as a share, and of its largest excursion from the shortest way
# as a share of the turn's angle about each axis.
HAND_PACE, HAND_DETOUR = 0.1, 0.03


@dataclass(frozen=True)
class TrueSpin:
    """A spin as it was.

    Attributes
    ----------
    step : index of the protocol's step, from 0.
    start, stop : s, the part at the constant rate.
    rate : rad/s against the Earth about the axis, with the table's error.
    axis_b : (3,) unit vector, the table's axis in b, with the placement's error.
    axis_n : (3,) the same in north, east, down.
    angle : rad, what was turned from rest to rest, ramps included, with the sign of the rate.
    shown : rad, what the table's display says of it.
    ramps : s, up to the rate and down from it.
    """

    step: int
    start: float
    stop: float
    rate: float
    axis_b: Vector
    axis_n: Vector
    angle: float = np.nan
    shown: float = np.nan
    ramps: tuple[float, float] = (np.nan, np.nan)


@dataclass(frozen=True)
class TrueRotation:
    """A rotation of one axis of a two-axis fixture as it was.

    Attributes
    ----------
    step : index of the protocol's step, from 0; None for one that no step asked for. A turn without an
        axis may be two rotations.
    axis : "inner" or "outer".
    start, stop : s, from rest to rest, ramps included.
    angle : rad that the axis turned, right-handed, with errors of execution.
    axis_b : (3,) unit vector in b about which the unit turned.
    """

    step: int | None
    axis: str
    start: float
    stop: float
    angle: float
    axis_b: Vector


@dataclass(frozen=True)
class PlayedProtocol:
    """The motion that a protocol became.

    Attributes
    ----------
    motion : holds, turns and spins one after another.
    step_edges : (steps, 2) s, when each step began and ended; a spin without its ramps.
    hold_steps : for each hold of the motion the index of its step; None for a rest that no step asks for.
    spins : each spin's true rate, axis and angle, in order.
    steps : the protocol's, with what the table's display showed: the angle of each spin that states one,
        or of all where the table's errors were given, and the pose where a table stopped early.
    rotations : those of a two-axis fixture, in order; none where there was none.
    """

    motion: Motion
    step_edges: AnyArray
    hold_steps: tuple[int | None, ...]
    spins: tuple[TrueSpin, ...]
    steps: tuple[Step, ...] = ()
    rotations: tuple[TrueRotation, ...] = ()


def play_protocol(
    protocol: Protocol,
    rng: np.random.Generator,
    *,
    placement: bool = True,
    heading: float | Series | None = None,
    lever_arm_b: AnyArray | None = None,
    table: TableErrors | None = None,
) -> PlayedProtocol:
    """Return a motion that follows the protocol as well as its uncertainties say.

    A hold with a pose is put there with an error of its standard uncertainty about each axis; one
    without a pose is put anyhow. A turn that is named with axis and angle is made with an error of its
    uncertainty; it ends in the pose that the next hold names where that is the better known. Any other
    turn is made by hand: the shortest way, a little off it, in a little more or less time. A spin that
    states its angle turns by it, with an error of its uncertainty, as long as that takes at its rate. After
    a spin the unit stays as it was mounted; the table goes back if the next hold says so.

    Parameters
    ----------
    protocol : what to do. Its file names and time intervals are not heeded.
    rng : source of errors and of unknown headings and poses.
    placement : make errors of placement, angle, rate and hand; False plays the nominal motion, and a
        heading that is not known is then zero. A pose of which nothing is known is drawn all the same.
    heading : rad, of every pose whose heading is not known, or one for each step; None draws them.
    lever_arm_b : (3,) m, from the centre of turns to the unit, or (3, 3) with a row for each accelerometer.
    table : what is wrong with the table; None for nothing but the protocol's own uncertainties.

    Raises
    ------
    ProtocolError
        If a step cannot be: a duration that is not positive, an axis of no direction, a turn that does not
        lead to the pose of the next hold, or an angle of a spin that its ramps exceed or that contradicts
        its rate.
    UsageError
        If the table is to stop a spin early that there is not.
    """
    for number, step in enumerate(protocol.steps):
        _check(number, step)
    refuse_contradicting_turns(protocol)
    if has_chamber(protocol):
        plain = without_chamber(protocol)
        played = play_protocol(
            plain.protocol,
            rng,
            placement=placement,
            heading=heading,
            lever_arm_b=lever_arm_b,
            table=table,
        )
        return _with_chamber(protocol, plain, played)
    spins = sum(isinstance(step, SpinStep) for step in protocol.steps)
    for stopped, _ in () if table is None else table.stops_early:
        if not 0 <= stopped < spins:
            raise UsageError(
                f"The table is to stop spin {stopped + 1} early, and the protocol's last one is number {spins}."
                if spins
                else "The table is to stop a spin early, and the protocol has no spin."
            )
    fixture = _Fixture(protocol, rng, placement, heading, table)
    for number, step in enumerate(protocol.steps):
        if isinstance(step, HoldStep):
            fixture.hold(number, step)
        elif isinstance(step, TurnStep):
            fixture.turn(number, step)
        elif isinstance(step, SpinStep):
            fixture.spin(number, step)
    return fixture.finish(np.zeros(3) if lever_arm_b is None else lever_arm_b)


def _with_chamber(protocol: Protocol, plain: PlainSteps, played: PlayedProtocol) -> PlayedProtocol:
    """Return what was played with the steps of the protocol that has soaks and ramps."""
    steps = list(protocol.steps)
    for step, owner in zip(played.steps, plain.owners, strict=True):
        if isinstance(step, SpinStep) and owner is not None:
            steps[owner] = step
    return replace(
        played,
        step_edges=plain.edges(played.step_edges),
        hold_steps=tuple(None if k is None else plain.owners[k] for k in played.hold_steps),
        spins=tuple(replace(spin, step=plain.owners[spin.step] or 0) for spin in played.spins),
        steps=tuple(steps),
    )


@dataclass
class _Move:
    """A turn or spin: s, rotation vector in b, its step, how a table drives it, its axis, a hand's swing in b."""

    duration: float
    vector_b: Vector
    step: int | None = None
    drive: Drive | None = None
    axis_b: Vector = field(default_factory=lambda: np.zeros(3))
    swing: Vector = field(default_factory=lambda: np.zeros(3))


class _Fixture:
    """Strings steps together: every turn or spin lies between two holds."""

    def __init__(
        self,
        protocol: Protocol,
        rng: np.random.Generator,
        placement: bool,
        heading: float | Series | None,
        table: TableErrors | None,
    ) -> None:
        self.protocol, self.steps, self.rng, self.placement = protocol, protocol.steps, rng, placement
        self.table, self.halted, self.read = Table(table, rng, placement), False, list(protocol.steps)
        self.heading = 0.0 if heading is None and not placement else heading
        # Where the unit is, and where it is meant to be.
        self.actual: Matrix | None = None
        self.nominal = np.eye(3)
        self.first = np.eye(3)
        # The table's axes, as they are meant and as they are in b, since the unit was last placed.
        self.axes: list[tuple[Vector, Vector]] = []
        # One sigma of the named turns since the unit was last put into a pose that is known.
        self.doubt = 0.0
        self.holds: list[tuple[float, int | None]] = []
        self.moves: list[_Move] = []
        self.waiting: int | None = None

    def hold(self, number: int, step: HoldStep) -> None:
        if self.actual is None:
            self._put(number, step.pose)
        elif self.waiting is not None or len(self.moves) < len(self.holds):
            self._carry(number, step.pose)
        elif step.pose is not None:
            if self.moves[-1].drive is None:
                self._agree(number, step.pose)
            elif self.halted:
                self._stay(number, step, step.pose)
            else:
                self._return(number, step.pose)
        self.holds.append((step.duration, number))

    def turn(self, number: int, step: TurnStep) -> None:
        self._settle(None)
        if step.axis_b is None or step.angle is None:
            self.waiting = number
            return
        vector = step.angle * unit(step.axis_b)
        angle = step.angle + self._error(step.sigma)
        self.doubt = float(np.hypot(self.doubt, step.sigma))
        self.axes.clear()
        self._move(_Move(step.duration, angle * self._in_b(unit(step.axis_b)), step=number), vector)

    def spin(self, number: int, step: SpinStep) -> None:
        # A table that nothing is said of stands level.
        self._settle(None if step.axis_b is None else Pose(unit(step.axis_b)))
        # A simulated table of which nobody says how it turns is exact.
        rate = step.rate * (1.0 + self._error(step.sigma or 0.0))
        axis, axis_b = self._spin_axes(step)
        drive = self.table.drive(step, rate, where(number, step))
        self.halted |= drive.halted
        if step.angle is not None or self.table.is_given:
            sigma = self.table.shown_sigma(step)
            self.read[number] = replace(step, angle=drive.shown, angle_sigma=sigma)
        meant = step.rate * (step.duration + step.ramp)
        meant = meant if step.angle is None and not drive.halted else drive.shown
        self._move(_Move(drive.duration, drive.angle * axis_b, number, drive, axis_b), meant * axis)

    def _settle(self, pose: Pose | None) -> None:
        """Bring the unit to rest: somewhere if it is nowhere yet, or where a turn in waiting goes."""
        if self.actual is None:
            self._put(None, pose)
        elif self.waiting is not None:
            self._carry(None, pose)
        if len(self.moves) == len(self.holds):
            self.holds.append((TABLE_REST, None))

    def _put(self, number: int | None, pose: Pose | None) -> None:
        """Place the unit anew."""
        self.nominal = self._nominal(number, pose)
        self.actual = self._misplaced(pose)
        self.doubt, self.halted = 0.0, False
        self.table.zero()
        self.axes.clear()
        if not self.holds:
            self.first = self.actual

    def _misplaced(self, pose: Pose | None) -> Matrix:
        if pose is None or not self.placement or pose.sigma == 0.0:
            return self.nominal
        return self.nominal @ matrix_from_rotation_vector(self.rng.normal(0.0, pose.sigma, 3))

    def _carry(self, number: int | None, pose: Pose | None) -> None:
        """Turn by hand, the shortest way, to where the unit is placed next."""
        before, step = self.actual, None if self.waiting is None else self.steps[self.waiting]
        assert before is not None
        self._put(number, pose)
        assert self.actual is not None
        move = _Move(
            HAND_TURN if step is None else step.duration,
            rotation_vector_from_matrix(before.T @ self.actual),
            step=self.waiting,
        )
        if self.placement:
            angle = float(np.linalg.norm(move.vector_b))
            move.swing = self.rng.normal(0.0, HAND_DETOUR * angle, 3)
            move.duration *= 1.0 + HAND_PACE * float(np.clip(self.rng.normal(), -3.0, 3.0))
        self.moves.append(move)
        self.waiting = None

    def _move(self, move: _Move, nominal_vector: Vector) -> None:
        assert self.actual is not None
        self.moves.append(move)
        self.actual = self.actual @ self._moved(move)
        self.nominal = self.nominal @ matrix_from_rotation_vector(nominal_vector)

    def _moved(self, move: _Move) -> Matrix:
        moved = matrix_from_rotation_vector(move.vector_b)
        if move.drive is None or not self.table.errors.wobble:
            return moved
        axis, angle = directions_of(move.vector_b[None])
        wobble_b = self.table.wobble_b(move.drive, move.axis_b)
        return moved @ wobble_rotation(axis, angle, wobble_b[None])[0].as_matrix()

    def _in_b(self, axis: Vector) -> Vector:
        """The nominal axis as it lies in the misplaced unit."""
        assert self.actual is not None
        return self.actual.T @ (self.nominal @ axis)

    def _spin_axes(self, step: SpinStep) -> tuple[Vector, Vector]:
        """A spin's axis where it is meant to be in b, and where it is."""
        axis = UP_N @ self.nominal if step.axis_b is None else unit(step.axis_b)
        assert self.actual is not None
        for known, axis_b in self.axes:
            # While it wobbles the unit's attitude does not tell the axis, but it stays where it was.
            if self.table.errors.wobble > 0.0 and np.linalg.norm(known - axis) < SAME_POSE:
                return axis, axis_b
        axis_b = self.actual.T @ (self.table.lean @ (self.nominal @ axis))
        self.axes.append((axis, axis_b))
        return axis, axis_b

    def _stay(self, number: int, step: HoldStep, pose: Pose) -> None:
        """Leave the unit where a table has stopped early, and read its pose off the display."""
        there = Pose.from_matrix(self.nominal, pose.sigma)
        if rotation_angle(self.nominal.T @ pose.C_nb(nearest_heading(pose, self.nominal))) > SAME_POSE:
            heading = None if pose.heading is None else there.heading
            self.read[number] = replace(step, pose=replace(there, heading=heading))

    def _agree(self, number: int, pose: Pose) -> None:
        """Let a named turn end in the pose of the hold that follows, if that is known better."""
        assert self.actual is not None
        wanted = pose.C_nb(nearest_heading(pose, self.nominal))
        refuse_contradiction(self.protocol, number, [], self.nominal, wanted, self.doubt, pose.sigma)
        if self.placement and self.doubt < pose.sigma:
            return
        self.nominal = pose.C_nb(nearest_heading(pose, self.actual))
        target = self._misplaced(pose)
        move = self.moves[-1]
        before = self.actual @ matrix_from_rotation_vector(-move.vector_b)
        move.vector_b = _nearest_turn(rotation_vector_from_matrix(before.T @ target), move.vector_b)
        self.actual = before @ matrix_from_rotation_vector(move.vector_b)
        self.doubt = 0.0

    def _return(self, number: int, pose: Pose) -> None:
        """After a spin, turn the table on to where the next hold is, or place the unit anew."""
        move = self.moves[-1]
        assert move.step is not None
        step = self.steps[move.step]
        assert isinstance(step, SpinStep)
        axis, axis_b = self._spin_axes(step)
        angle = _angle_to(self.nominal, pose, axis)
        if angle is None:
            self.holds.append((TABLE_REST, None))
            self._carry(number, pose)
        elif abs(angle) > SAME_POSE:
            self.holds.append((TABLE_REST, None))
            self._move(_Move(HAND_TURN, angle * axis_b), angle * axis)

    def _nominal(self, number: int | None, pose: Pose | None) -> Matrix:
        """The attitude that is meant, in full: what is not known is known by a later hold, or drawn."""
        if pose is not None and pose.heading is not None:
            return pose.C_nb()
        told = None if number is None else self._told_later(number, headed=True)
        if pose is not None:
            return pose.C_nb(self._heading(number) if told is None else nearest_heading(pose, told))
        if told is None and number is not None:
            told = self._told_later(number, headed=False)
        if told is not None:
            return told
        from scipy.spatial.transform import Rotation

        after = None if self.actual is None else Rotation.from_matrix(self.actual)
        return simulate_hand_pose(self.rng, after).as_matrix()

    def _told_later(self, number: int, headed: bool) -> Matrix | None:
        """The attitude in which named turns from this hold lead to a later one whose pose is known."""
        turned, before = np.eye(3), self.steps[number]
        for later, step in enumerate(self.steps[number + 1 :], number + 1):
            if isinstance(step, TurnStep) and step.axis_b is not None and step.angle is not None:
                turned = turned @ matrix_from_turn(step.axis_b, step.angle)
            elif not isinstance(step, HoldStep) or isinstance(before, HoldStep):
                return None
            elif step.pose is not None and (step.pose.heading is not None or not headed):
                return step.pose.C_nb(0.0 if headed else self._heading(later)) @ turned.T
            before = step
        return None

    def _heading(self, number: int | None) -> float:
        if self.heading is None:
            return float(self.rng.uniform(0.0, 2.0 * np.pi))
        if isinstance(self.heading, np.ndarray):
            return 0.0 if number is None else float(self.heading[number])
        return self.heading

    def _error(self, sigma: float) -> float:
        return float(self.rng.normal(0.0, sigma)) if self.placement and sigma > 0.0 else 0.0

    def finish(self, lever_arm_b: AnyArray) -> PlayedProtocol:
        self._settle(None)
        motion = Motion(
            first_quaternion_nb=quaternion_from_matrix(self.first),
            hold_duration=np.array([duration for duration, _ in self.holds]),
            turn_duration=np.array([move.duration for move in self.moves]),
            turn_vector_b=np.array([move.vector_b for move in self.moves]).reshape(-1, 3),
            lever_arm_b=lever_arm_b,
            spin_shapes=self.table.shapes(
                [move.drive for move in self.moves],
                np.array([move.axis_b for move in self.moves]).reshape(-1, 3),
            ),
        )
        holds = motion.hold_edges
        by_hand = [k for k, move in enumerate(self.moves) if np.any(move.swing)]
        if by_hand:
            moves = [self.moves[k] for k in by_hand]
            detours = Detours(
                holds[by_hand, 1],
                np.array([move.duration for move in moves]),
                np.array([move.swing for move in moves]),
            )
            motion = replace(motion, detours=detours)
        edges = np.full((len(self.steps), 2), np.nan)
        for (_, number), interval in zip(self.holds, holds, strict=True):
            if number is not None:
                edges[number] = interval
        for k, move in enumerate(self.moves):
            if move.step is not None:
                up, down = (0.0, 0.0) if move.drive is None else (move.drive.ramp_up, move.drive.ramp_down)
                edges[move.step] = holds[k, 1] + up, holds[k + 1, 0] - down
        steps = tuple(number for _, number in self.holds)
        spins = tuple(self._true_spins(motion, edges))
        return PlayedProtocol(motion, edges, steps, spins, tuple(self.read))

    def _true_spins(self, motion: Motion, edges: AnyArray) -> list[TrueSpin]:
        spins: list[TrueSpin] = []
        C_nb = matrices_from_quaternions(motion.hold_quaternions_nb)
        for k, move in enumerate(self.moves):
            drive = move.drive
            if drive is None or move.step is None:
                continue
            start, stop = (float(edge) for edge in edges[move.step])
            spins.append(
                TrueSpin(
                    move.step,
                    start,
                    stop,
                    drive.angle / (move.duration - 0.5 * (drive.ramp_up + drive.ramp_down)),
                    move.axis_b,
                    C_nb[k] @ move.axis_b,
                    drive.angle,
                    drive.shown,
                    (drive.ramp_up, drive.ramp_down),
                )
            )
        return spins


def _check(number: int, step: Step) -> None:
    here = where(number, step)
    if not 0.0 < step.duration < np.inf:
        raise ProtocolError(f"{here} lasts {step.duration:g} s: give it a duration above zero.")
    axis = step.axis_b if isinstance(step, TurnStep | SpinStep) else None
    if axis is not None and not 0.0 < float(np.linalg.norm(axis)) < np.inf:
        raise ProtocolError(f"{here} has an axis of no direction: give three numbers, not all zero.")
    if isinstance(step, SpinStep):
        if not 0.0 < abs(step.rate) < np.inf:
            raise ProtocolError(f"{here} spins at {step.rate:g} rad/s: give it a rate that is not zero.")
        if not 0.0 <= step.ramp < np.inf:
            raise ProtocolError(f"{here} has a ramp of {step.ramp:g} s: give zero or more.")
        if step.angle is not None and not 0.0 < step.angle * step.rate < np.inf:
            raise ProtocolError(
                f"{here} shows an angle of {np.degrees(step.angle):g} degrees against its rate: "
                "give both the same sign."
            )


def _nearest_turn(vector: Vector, named: Vector) -> Vector:
    """The rotation by as many whole turns more as make it like the named one.

    Where the named one is all but whole turns, no axis near its own leads to another rotation: then it
    is made whole, and the unit comes back to where it was.
    """
    angle, wanted = float(np.linalg.norm(vector)), float(np.linalg.norm(named))
    axis = vector / angle if angle > 1e-9 else named / wanted
    turns = np.round((float(axis @ named) - angle) / (2.0 * np.pi))
    nearest = vector + 2.0 * np.pi * turns * axis
    if np.linalg.norm(nearest - named) < 0.5:
        return nearest
    return named / wanted * 2.0 * np.pi * np.round(wanted / (2.0 * np.pi))


def _angle_to(nominal: Matrix, pose: Pose, axis: Vector) -> float | None:
    """The angle about an axis in b that leads to a pose; None if none does."""
    up_b, wanted = UP_N @ nominal, unit(pose.up_b)
    if abs(float(axis @ (up_b - wanted))) > SAME_POSE:
        return None
    across = up_b - (axis @ up_b) * axis
    angle = 0.0
    if np.linalg.norm(across) > SAME_POSE:
        # b turns by the angle, so that what stands still in n turns the other way in b.
        angle = -float(np.arctan2(axis @ np.cross(up_b, wanted), across @ wanted))
    elif pose.heading is not None:
        apart = rotation_vector_from_matrix(nominal.T @ pose.C_nb())
        angle = float(axis @ apart)
    there = nominal @ matrix_from_rotation_vector(angle * axis)
    left = rotation_angle(there.T @ pose.C_nb(nearest_heading(pose, there)))
    return angle if left < 3.0 * SAME_POSE else None
