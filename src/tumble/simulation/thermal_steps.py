"""A protocol with soaks and ramps as one of holds and turns alone: what hands do while a chamber works."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray
from tumble.attitude import twenty_six_directions
from tumble.protocol import HoldStep, Pose, Protocol, RampStep, SoakStep, Step, TurnStep
from tumble.records import dataclass

# Poses that a tumbled unit goes through: faces and edges of a cube, put down by hand.
TUMBLED, BY_HAND, TURN = 18, np.radians(5.0), 3.0


@dataclass
class PlainSteps:
    """Holds, turns and spins that a protocol with soaks and ramps comes to.

    Attributes
    ----------
    protocol : without soaks and ramps; those at rest have made the hold beside them longer.
    places : for each step of the given protocol (index, s after that one's start, index, s after this one's
        start) of where it begins and ends.
    owners : for each plain step the index of the given one; None for a hold of a tumbled ramp.
    """

    protocol: Protocol
    places: list[tuple[int, float, int, float]] = field(default_factory=list[tuple[int, float, int, float]])
    owners: list[int | None] = field(default_factory=list[int | None])

    def edges(self, plain: AnyArray) -> AnyArray:
        """Return (steps, 2) s of the given protocol's steps from those of the plain ones."""
        return np.array(
            [
                [plain[a, 0] + begun, plain[b, 1] if np.isinf(ended) else plain[b, 0] + ended]
                for a, begun, b, ended in self.places
            ]
        )


def has_chamber(protocol: Protocol) -> bool:
    """Return whether a protocol has a soak or a ramp."""
    return any(isinstance(step, SoakStep | RampStep) for step in protocol.steps)


def without_chamber(protocol: Protocol) -> PlainSteps:
    """Return what is done to the unit while the surroundings change their temperature.

    Parameters
    ----------
    protocol : with soaks and ramps. A soak, and a ramp at rest, prolongs the hold before it; without one it
        is a rest anyhow, which takes the pose of the hold that follows.
    """
    steps: list[Step] = []
    plain = PlainSteps(protocol)
    waiting = False
    tumbled = 0

    def add(step: Step, owner: int | None) -> None:
        steps.append(step)
        plain.owners.append(owner)

    for number, step in enumerate(protocol.steps):
        last = steps[-1] if steps else None
        rests = isinstance(step, SoakStep) or (isinstance(step, RampStep) and not step.tumbled)
        if isinstance(last, HoldStep) and (rests or (waiting and isinstance(step, HoldStep))):
            begun = last.duration
            pose = step.pose if isinstance(step, HoldStep) else last.pose
            steps[-1] = replace(last, duration=begun + step.duration, pose=pose)
            plain.places.append((len(steps) - 1, begun, len(steps) - 1, begun + step.duration))
            if isinstance(step, HoldStep):
                plain.owners[-1], waiting = number, False
        elif rests:
            add(HoldStep(step.duration, None, step.name), number)
            plain.places.append((len(steps) - 1, 0.0, len(steps) - 1, step.duration))
            waiting = True
        elif isinstance(step, RampStep):
            first = len(steps)
            count = max(round(step.duration / step.tumbled), 1)
            each = step.duration / count
            for _ in range(count):
                pose = Pose(twenty_six_directions()[tumbled % TUMBLED], None, BY_HAND)
                add(TurnStep(min(TURN, 0.5 * each)), number)
                add(HoldStep(each - min(TURN, 0.5 * each), pose, step.name), None)
                tumbled += 1
            plain.places.append((first, 0.0, len(steps) - 1, steps[-1].duration))
            waiting = False
        else:
            add(step, number)
            # Of a hold its own seconds, though a soak may make it longer; of all else where it ends.
            ended = step.duration if isinstance(step, HoldStep) else np.inf
            plain.places.append((len(steps) - 1, 0.0, len(steps) - 1, ended))
            waiting = False
    plain.protocol = replace(protocol, steps=tuple(steps))
    return plain
