"""Rotation sequences cut from a recording: rest, rotations about the unit's own axes, rest."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector, Vectors
from tumble.calibration.session import Session
from tumble.errors import ObservabilityError
from tumble.protocol.steps import HoldStep, Protocol, TurnStep
from tumble.protocol.strapdown_rotation import SequenceSteps, sequence_steps
from tumble.records import dataclass

# s of each measurement at rest, as the paper has it; a shorter hold gives a shorter one.
MEASURE = 10.0


@dataclass(frozen=True, slots=True)
class RecordedSequence:
    """One sequence of a recording.

    Attributes
    ----------
    name : as table 1 has it, or the protocol.
    rotations : (axis, angle in rad) as the protocol says.
    down_start : (3,) nominal unit vector down in b at the start.
    earth_rate_start : (3,) rad/s in b at the start.
    time_step : s between samples.
    force, rate : (samples, 3) raw, from the start of the first measurement to the end of the last.
    start, end : sample ranges of the two measurements.
    """

    name: str
    rotations: list[tuple[int, float]]
    down_start: Vector
    earth_rate_start: Vector
    time_step: float
    force: Vectors
    rate: Vectors
    start: tuple[int, int]
    end: tuple[int, int]


def cut_sequences(session: Session) -> dict[str, RecordedSequence]:
    """Return the sequences of a protocol that were found whole, by name; of one that was repeated the last.

    Parameters
    ----------
    session : with a protocol whose starts have headings, and a latitude.

    Raises
    ------
    ObservabilityError
        If the Earth rate is not known, or samples are missing in a sequence.
    """
    protocol, matching = session.matched
    found = {matched.step: matched.hold for matched in matching.holds}
    return {
        steps.name: _cut(session, protocol, steps, found[steps.start], found[steps.end])
        for steps in sequence_steps(protocol)
        if found.get(steps.start, np.inf) < found.get(steps.end, -1)
    }


def _cut(
    session: Session, protocol: Protocol, steps: SequenceSteps, before: int, after: int
) -> RecordedSequence:
    recording, holds, first = session.recording, session.timeline.holds, protocol.steps[steps.start]
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    assert isinstance(first, HoldStep)
    pose = first.pose
    if session.site.latitude is None or pose is None or pose.heading is None:
        raise ObservabilityError(
            f"Sequence {steps.name}: the Earth rate is taken out of the gyros (2), which asks for a latitude (--site) "
            "and for the pose of the start with its heading (`heading_deg`)."
        )
    count = round(MEASURE * recording.rate)
    last, start = holds[before].stretches()[-1], holds[after].stretches()[0]
    begin, stop = max(last[0], last[1] - count), min(start[1], start[0] + count)
    time = recording.time[begin:stop]
    if round((time[-1] - time[0]) * recording.rate) != time.size - 1:
        raise ObservabilityError(
            f"Samples are missing in sequence {steps.name}: its attitude cannot be computed."
        )
    return RecordedSequence(
        steps.name,
        [_rotation(protocol, step) for step in steps.turns],
        np.asarray(-pose.up_b / np.linalg.norm(pose.up_b), dtype=np.float64),
        np.asarray(pose.rotation_nb().inv().apply(session.site.earth_rate_n), dtype=np.float64),
        1.0 / recording.rate,
        np.asarray(recording.specific_force[begin:stop], dtype=np.float64),
        np.asarray(recording.angular_rate[begin:stop], dtype=np.float64),
        (0, last[1] - begin),
        (start[0] - begin, stop - begin),
    )


def _rotation(protocol: Protocol, number: int) -> tuple[int, float]:
    """The body axis of a turn and the angle about it."""
    turn = protocol.steps[number]
    assert isinstance(turn, TurnStep)
    assert turn.axis_b is not None
    assert turn.angle is not None
    axis = int(np.argmax(np.abs(turn.axis_b)))
    return axis, float(np.sign(turn.axis_b[axis])) * turn.angle
