"""A simulated unit of any grade in the hand of a simulated person who follows the guide, or a list, with flaws.

To try the guide without hardware, and for tests. Gravity is 9.80665 m/s², the Earth does not turn.
"""

from __future__ import annotations

import re
import time
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from tumble.arrays import Vector, Vectors
from tumble.attitude import matrix_from_rotation_vector, rotation_between
from tumble.capture.coach import Event
from tumble.capture.machine import Capture
from tumble.capture.source import Channels, Piece, Source, SourceOptions
from tumble.errors import UsageError
from tumble.recording import Samples
from tumble.records import dataclass
from tumble.simulation import Grade, convert_to_digital, find_grade, simulate_wander
from tumble.units import STANDARD_GRAVITY

# s of samples at once, of a session at most, and a person's turn by a right angle; rad by which a hand misses a pose.
CHUNK, LONGEST, QUARTER_TURN, MISSED = 0.1, 1800.0, 1.6, 0.08
# Hz and rad of a hand's tremor while the unit is held against something.
TREMOR, TREMOR_ANGLE = 9.0, 2e-5
# s that nobody says anything, after which a person turns on by himself.
IMPATIENT = 8.0


@dataclass(frozen=True)
class Flaws:
    """How often a person errs, as shares of the poses.

    Attributes
    ----------
    too_short : moves on at once.
    creeping : lets the unit turn slowly.
    unplugged : pulls the cable, for three seconds.
    """

    too_short: float = 0.0
    creeping: float = 0.0
    unplugged: float = 0.0


class SimulatedPerson:
    """Pieces of a source, made of what a listener hears.

    Parameters
    ----------
    grade : of the unit.
    seed : of the unit, its noise and the person.
    poses : up directions to go through, whatever is said; None follows the guide.
    hold : s that each pose of a list is held.
    flaws : of the person.
    speed : in multiples of real time; 0 is as fast as it goes.
    """

    def __init__(
        self,
        grade: Grade,
        seed: int,
        *,
        poses: Vectors | None = None,
        hold: float = 3.0,
        flaws: Flaws | None = None,
        speed: float = 0.0,
    ) -> None:
        self._rng = np.random.default_rng([seed, 21])
        self.model = grade.simulate_model(np.random.default_rng([seed, 7]))
        self._grade, self._poses, self._hold = grade, poses, hold
        self._flaws, self._speed = flaws or Flaws(), speed
        count = round(LONGEST * grade.rate)
        self._wander = [
            simulate_wander(triad.noise, count, grade.rate, self._rng)
            for triad in (grade.accelerometer, grade.gyroscope)
        ]
        self._attitude = rotation_between(np.array([0.0, 0.0, 1.0]), _unit(self._rng.standard_normal(3))).T
        self._at = 0
        self._next: Event | None = None
        self._move = False
        self._pieces: Generator[Piece, None, None] = self._live()
        self._begun = time.monotonic()

    def __iter__(self) -> Iterator[Piece]:
        return self

    def __next__(self) -> Piece:
        return next(self._pieces)

    def close(self) -> None:
        """Put the unit away."""
        self._pieces.close()

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        """Hear what the guide says, as a listener of a capture."""
        self.hear(events)

    def hear(self, events: Sequence[Event]) -> None:
        """Take what the guide says.

        Parameters
        ----------
        events : in order.
        """
        for event in events:
            if event.kind == "next_pose":
                self._next = event
            if event.kind == "hold_complete":
                self._move = True

    def _live(self) -> Generator[Piece, None, None]:
        yield Channels("m/s^2", "rad/s", self._grade.rate)
        yield from self._rest(3.0)
        number = 0
        while (self._poses is None or number < len(self._poses)) and self._at < (
            LONGEST - 60.0
        ) * self._grade.rate:
            self._move = False
            turn = self._to_next(number)
            yield from self._turn(turn)
            yield from self._held()
            number += 1

    def _to_next(self, number: int) -> Vector:
        """The rotation vector in the unit's axes that brings it to the next pose, missed a little."""
        missed = MISSED * self._rng.standard_normal(3)
        told = self._next
        if self._poses is not None:
            up = self._poses[number]
        elif told is not None and "turn_axis" in told.facts and number % 2:
            return np.asarray(told.facts["turn_axis"]) * float(told.facts["turn_angle"]) + missed
        elif told is not None and "up" in told.facts:
            up = np.asarray(told.facts["up"])
        else:
            up = _unit(self._rng.standard_normal(3))
        present = self._attitude.T @ [0.0, 0.0, 1.0]
        across = np.cross(up, present)
        angle = float(np.arctan2(np.linalg.norm(across), up @ present))
        if float(np.linalg.norm(across)) < 1e-6:
            across = np.cross(up, [0.3, -0.8, 0.52])
        return _unit(across) * angle + missed

    def _held(self) -> Iterator[Piece]:
        """Hold the pose: as long as a list asks, or until it is said to be enough."""
        chance = float(self._rng.uniform())
        flaws = self._flaws
        if chance < flaws.too_short:
            yield from self._rest(0.5)
        elif chance < flaws.too_short + flaws.creeping:
            yield from self._rest(3.0, np.radians(1.5) * _unit(self._rng.standard_normal(3)))
        elif chance < flaws.too_short + flaws.creeping + flaws.unplugged:
            yield from self._rest(2.0)
            self._at += round(3.0 * self._grade.rate)
            yield from self._rest(2.0)
        else:
            begun = self._at
            longest = IMPATIENT if self._poses is None else self._hold
            while not self._move and self._at - begun < longest * self._grade.rate:
                yield from self._rest(CHUNK)
            # Who is told, by a guide or by a clock, needs a moment.
            yield from self._rest(float(self._rng.uniform(0.2, 0.5)))

    def _rest(self, seconds: float, creep: Vector | None = None) -> Iterator[Piece]:
        count = max(1, round(seconds * self._grade.rate))
        instants = (self._at + np.arange(count)) / self._grade.rate
        direction = np.array([0.36, 0.48, -0.8])
        shake = TREMOR_ANGLE * 2.0 * np.pi * TREMOR * np.cos(2.0 * np.pi * TREMOR * instants)
        yield from self._sent(np.outer(shake, direction) + (0.0 if creep is None else creep))

    def _turn(self, vector: Vector) -> Iterator[Piece]:
        angle = float(np.linalg.norm(vector))
        count = round(max(0.6, QUARTER_TURN * angle / (0.5 * np.pi)) * self._grade.rate)
        share = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
        pace = np.asarray(share * self._grade.rate / share.sum(), dtype=np.float64)
        yield from self._sent(pace[:, None] * vector)

    def _sent(self, rates: Vectors) -> Iterator[Piece]:
        """Turn the unit, and yield what it sends."""
        rate = self._grade.rate
        step = max(1, round(CHUNK * rate))
        for start in range(0, len(rates), step):
            part = rates[start : start + step]
            up = np.empty_like(part)
            for k, omega in enumerate(part):
                half = matrix_from_rotation_vector(0.5 * omega / rate)
                self._attitude = self._attitude @ half
                up[k] = self._attitude[2]
                self._attitude = self._attitude @ half
            at = slice(self._at, self._at + len(part))
            raw = self.model.distort(STANDARD_GRAVITY * up, part)
            noisy: list[Vectors] = []
            for signal, triad, wander in zip(
                raw, (self._grade.accelerometer, self._grade.gyroscope), self._wander, strict=True
            ):
                white = triad.noise.random_walk * rate**0.5 * self._rng.standard_normal(signal.shape)
                noisy.append(convert_to_digital(signal + wander[at] + white, triad.noise))
            stamps = (self._at + np.arange(len(part))) / rate
            self._at += len(part)
            self._wait(float(stamps[-1]))
            yield Samples(stamps, noisy[0], noisy[1])

    def _wait(self, stamp: float) -> None:
        if self._speed > 0.0:
            time.sleep(max(0.0, self._begun + stamp / self._speed - time.monotonic()))


def _unit(vector: Vector) -> Vector:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


# A person as persons are.
USUAL = Flaws(too_short=0.05, creeping=0.05, unplugged=0.02)


def simulate(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a simulated unit sends; the iterator hears the guide, as a listener.

    Parameters
    ----------
    address : name of the grade, with ``@SEED`` behind it for another unit, and ``@SPEED`` behind that.
    options : nothing of them.

    Raises
    ------
    UsageError
        If there is no such grade, or what is behind it is no number.
    """
    found = re.fullmatch(r"([^@]*)(?:@(\d+))?(?:@(\d+\.?\d*))?", address)
    if found is None:
        raise UsageError(f"simulated:{address}: write simulated:GRADE@SEED@SPEED, the seed a whole number.")
    grade = find_grade(found[1] or "consumer-mems")
    return SimulatedPerson(grade, int(found[2] or 0), flaws=USUAL, speed=float(found[3] or 1.0))


SOURCE = Source(
    "simulated",
    "a simulated unit and person, @SEED@SPEED behind it",
    "simulated:consumer-mems",
    simulate,
)
