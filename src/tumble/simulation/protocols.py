"""A protocol played: poses with placement errors, turns and spins between them, and the recording of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Vector
from tumble.earth.site import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.recording.recording import Recording
from tumble.sensor.imu import ImuModel
from tumble.simulation.grades import Grade
from tumble.simulation.motion import Motion
from tumble.simulation.poses import simulate_hand_poses
from tumble.simulation.recordings import Truth, simulate_recording
from tumble.simulation.sampling import Imperfections

# A turn that the protocol leaves out takes this long by hand; between two spins the table rests so long.
HAND_TURN, TABLE_REST = 3.0, 1.0  # s
UP_N = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, slots=True)
class PlayedProtocol:
    """The motion that a protocol became.

    Attributes
    ----------
    motion : holds, turns and spins one after another.
    step_edges : (steps, 2) s, when each step began and ended; a spin without its ramps.
    """

    motion: Motion
    step_edges: AnyArray


def play_protocol(
    protocol: Protocol,
    rng: np.random.Generator,
    *,
    placement: bool = True,
    heading: float | None = None,
    lever_arm_b: Vector | None = None,
) -> PlayedProtocol:
    """Return a motion that follows the protocol as well as its uncertainties say.

    A hold with a pose is put there with an error of its standard uncertainty about each axis; one
    without a pose is put anyhow. After a spin the unit stays as it was mounted, turned by the spin. A
    turn that is named with its angle is made with that angle's error, and decides the next pose.

    Parameters
    ----------
    protocol : what to do.
    rng : source of errors and of unknown headings and poses.
    placement : make placement, angle and rate errors; False plays the nominal motion.
    heading : rad, of every pose whose heading is not known; None draws one for each.
    lever_arm_b : (3,) m, from the centre of turns to the unit.
    """
    player = _Player(rng, placement, heading)
    for number, step in enumerate(protocol.steps):
        player.play(number, step)
    return player.finish(len(protocol.steps), lever_arm_b)


class _Player:
    """Strings steps together: every turn or spin lies between two holds."""

    def __init__(self, rng: np.random.Generator, placement: bool, heading: float | None) -> None:
        self.rng, self.placement, self.heading = rng, placement, heading
        self.rotation: Rotation | None = None
        self.first: Rotation | None = None
        self.holds: list[float] = []
        self.turns: list[tuple[float, Vector, float]] = []  # duration, rotation vector in b, ramp
        self.waiting: TurnStep | None = None
        self.places: dict[int, tuple[str, int]] = {}
        self.ramps: dict[int, float] = {}

    def play(self, number: int, step: HoldStep | TurnStep | SpinStep) -> None:
        if isinstance(step, TurnStep):
            self._turn(number, step)
        elif isinstance(step, SpinStep):
            self._spin(number, step)
        else:
            self._hold(number, step)

    def _turn(self, number: int, step: TurnStep) -> None:
        self._be_somewhere()
        if len(self.turns) == len(self.holds):
            self.holds.append(TABLE_REST)
        self.places[number] = ("turn", len(self.turns))
        if step.axis_b is None or step.angle is None:
            self.waiting = step
            return
        angle = step.angle + self._error(step.sigma)
        self._move(step.duration, angle * step.axis_b, 0.0)

    def _spin(self, number: int, step: SpinStep) -> None:
        rotation = self._be_somewhere()
        if len(self.turns) == len(self.holds):
            self.holds.append(TABLE_REST)
        axis_b = rotation.inv().apply(UP_N) if step.axis_b is None else step.axis_b
        rate = step.rate * (1.0 + self._error(step.sigma))
        self.places[number] = ("turn", len(self.turns))
        self.ramps[number] = step.ramp
        self._move(step.duration + 2.0 * step.ramp, rate * (step.duration + step.ramp) * axis_b, step.ramp)

    def _hold(self, number: int, step: HoldStep) -> None:
        if self.rotation is None:
            self.rotation = self.first = self._placed(step.pose)
        elif len(self.turns) < len(self.holds):
            # Nothing was moved since the last hold, or only a turn without an angle was announced.
            duration = HAND_TURN if self.waiting is None else self.waiting.duration
            target = self._placed(step.pose)
            self._move(duration, (self.rotation.inv() * target).as_rotvec(), 0.0)
        self.waiting = None
        self.places[number] = ("hold", len(self.holds))
        self.holds.append(step.duration)

    def _be_somewhere(self) -> Rotation:
        if self.rotation is None:
            self.rotation = self.first = self._placed(None)
            self.holds.append(TABLE_REST)
        return self.rotation

    def _move(self, duration: float, vector_b: Vector, ramp: float) -> None:
        assert self.rotation is not None
        self.turns.append((duration, vector_b, ramp))
        self.rotation = self.rotation * Rotation.from_rotvec(vector_b)

    def _placed(self, pose: Pose | None) -> Rotation:
        if pose is None:
            return simulate_hand_poses(self.rng, 1)[0]
        heading = self.rng.uniform(0.0, 2.0 * np.pi) if self.heading is None else self.heading
        nominal = pose.rotation_nb(heading)
        if not self.placement or pose.sigma == 0.0:
            return nominal
        return nominal * Rotation.from_rotvec(self.rng.normal(0.0, pose.sigma, 3))

    def _error(self, sigma: float) -> float:
        return float(self.rng.normal(0.0, sigma)) if self.placement and sigma > 0.0 else 0.0

    def finish(self, steps: int, lever_arm_b: Vector | None) -> PlayedProtocol:
        self._be_somewhere()
        if len(self.holds) == len(self.turns):
            self.holds.append(TABLE_REST)
        assert self.first is not None
        motion = Motion(
            first_rotation_nb=self.first,
            hold_duration=np.array(self.holds),
            turn_duration=np.array([turn[0] for turn in self.turns]),
            turn_vector_b=np.array([turn[1] for turn in self.turns]).reshape(-1, 3),
            creep_vector_b=np.zeros((len(self.holds), 3)),
            lever_arm_b=np.zeros(3) if lever_arm_b is None else lever_arm_b,
            turn_ramp=np.array([turn[2] for turn in self.turns]),
        )
        holds = motion.hold_edges
        edges = np.full((steps, 2), np.nan)
        for number, (kind, index) in self.places.items():
            if kind == "hold":
                edges[number] = holds[index]
            elif index < len(self.turns):
                ramp = self.ramps.get(number, 0.0)
                edges[number] = holds[index, 1] + ramp, holds[index + 1, 0] - ramp
        return PlayedProtocol(motion, edges)


def simulate_protocol(
    protocol: Protocol,
    rate: float,
    rng: np.random.Generator,
    *,
    site: Site,
    grade: Grade | None = None,
    model: ImuModel | None = None,
    noise: bool = True,
    imperfections: Imperfections | None = None,
    placement: bool = True,
    heading: float | None = None,
    units: str = "SI",
) -> tuple[Recording, Truth]:
    """Record a protocol with a simulated unit.

    Parameters
    ----------
    protocol : what to do.
    rate : Hz.
    rng : source of all numbers; the same state gives the same recording bit for bit.
    site : gravity and Earth rate.
    grade : noise, converter and the spread of errors; None for a unit without noise.
    model : the sensor's errors; None draws them from the grade (or is exact, without a grade).
    noise : False leaves noise and converter away, and keeps the grade's errors.
    imperfections : what the recording chain does.
    placement, heading : as for `play_protocol`.
    units : "SI", or "counts": the model's raw numbers times the grade's counts per SI unit.
    """
    played = play_protocol(protocol, rng, placement=placement, heading=heading)
    if model is None and grade is not None:
        model = grade.simulate_model(rng)
    quiet = None if grade is None or not noise else grade
    if units == "counts":
        model, quiet = _in_counts(model or ImuModel.ideal(), grade, quiet)
    recording, truth = simulate_recording(
        played.motion,
        rate,
        rng,
        site=site,
        grade=quiet,
        distort=None if model is None else model.distort,
        imperfections=imperfections,
    )
    if units == "counts":
        recording = replace(recording, specific_force_unit="counts", angular_rate_unit="counts")
    return recording, replace(truth, model=model or ImuModel.ideal(), step_edges=played.step_edges)


def _in_counts(model: ImuModel, grade: Grade | None, quiet: Grade | None) -> tuple[ImuModel, Grade | None]:
    """Return model and noise with raw numbers in counts."""
    force, rate = (1000.0, 10000.0) if grade is None else grade.counts_per_si
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    scaled = ImuModel(
        model.accelerometer.in_raw_unit(force),
        model.gyroscope.in_raw_unit(rate),
        None if model.g_sensitivity is None else rate * model.g_sensitivity,
    )
    return scaled, None if quiet is None else quiet.in_counts()
