"""Savage (2018) on a recording of rotation sequences: measurements (1), (2), inversion (13) or (14), play-back (8).

The unit rests, is turned about its own axes, and rests again. Its own gyros carry the attitude over the turns; what
their errors have made of it, gravity shows at the end. Each error comes from the component that a sequence was made
for. The recording, corrected by what was found, is then played back until nothing changes.

As in the notes on (1), (2) and section 9.4: down is gravity less the length of the acceleration, and what the gyros
show before each sequence beyond the Earth rate counts as their bias. The start is rough values from the nominal
attitudes and angles, so that counts are as good as SI. Where the sequences 1a to 3a are missing, (14) takes the place
of (13).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import block_diag

from tumble.arrays import AnyArray, Square, Table, Vector, Vectors, inverted
from tumble.attitude import skew
from tumble.calibration import Estimate, Estimator, Session
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Protocol, SequenceSteps, TurnStep, sequence_steps
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.sensor import ImuModel, SavageErrors, Triad
from tumble_papers.estimates import carried_estimate, means_of_both
from tumble_papers.savage.sequences import (
    WITHOUT_ASYMMETRY,
    SequenceMeasurement,
    SequenceModel,
    invert_measurements,
    measure_sequence,
    sequence_model,
)
from tumble_papers.savage.strapdown_simulation import composed

# s of each measurement at rest, as the paper has it; a shorter hold gives a shorter one.
MEASURE = 10.0


@dataclass(frozen=True)
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


# The second play-back changes the first by a hundredth in the paper; rough values of counts take one more.
PASSES = 4
NAME = "savage-inversion"


@dataclass(frozen=True)
class WhiteNoise:
    """What a second of white noise does: rad²/s of an angle, (m/s²)² of a mean over a second."""

    angle: float
    force: float

    @classmethod
    def of(cls, model: ImuModel, means: HoldMeans) -> WhiteNoise:
        """Return what the holds show.

        Parameters
        ----------
        model : both triads.
        means : of the holds.
        """

        def density(triad: Triad | None, covariance: AnyArray | None) -> float:
            assert triad is not None
            assert covariance is not None
            inverse = inverted(triad.matrix)
            variance = np.einsum("ij,kjl,il->k", inverse, covariance, inverse) / 3.0
            return float(np.median(variance * means.duration))

        return cls(
            density(model.gyroscope, means.angular_rate_covariance),
            density(model.accelerometer, means.specific_force_covariance),
        )


def calibrate_savage(session: Session) -> Estimate:
    """Calibrate both triads with their asymmetries, in the frame ``mean-gyro``.

    Parameters
    ----------
    session : a recording of table 1's sequences with its protocol.

    Raises
    ------
    ObservabilityError
        If a triad, a sequence or what tells the Earth rate is missing.
    """
    means_of_both(session)
    sequences, gravity = cut_sequences(session), session.site.gravity
    asymmetry = all(name in sequences for name in WITHOUT_ASYMMETRY)
    # Refuses sequences that are missing.
    invert_measurements({name: np.zeros(5) for name in sequences}, gravity, asymmetry=asymmetry)
    models = {name: nominal_model(sequence, gravity) for name, sequence in sequences.items()}
    model = rough_model(list(sequences.values()), list(models.values()), gravity)
    for _ in range(PASSES):
        measured = {name: _measure(sequence, model, gravity) for name, sequence in sequences.items()}
        vectors = {name: one.vector for name, one in measured.items()}
        errors = invert_measurements(vectors, gravity, asymmetry=asymmetry)  # (13), (14)
        bias = np.asarray(np.mean([one.gyro_bias for one in measured.values()], axis=0), dtype=np.float64)
        model = composed(model, SavageErrors.from_vector(errors, bias))  # (7), (8)
    noise = WhiteNoise.of(model, session.means)
    white = noise.angle / sum(s.time_step * (s.start[1] - s.start[0]) for s in sequences.values())
    spread = {
        name: measurement_covariance(sequence, models[name], noise, gravity)
        for name, sequence in sequences.items()
    }
    return carried_estimate(
        NAME,
        session,
        lambda change: composed(model, SavageErrors.from_vector(change[:24], change[24:])),
        block_diag(inversion_covariance(spread, gravity, asymmetry=asymmetry), white * np.eye(3)),
        frame="mean-gyro",
        terms=["accelerometer_asymmetry", *(["gyro_asymmetry"] if asymmetry else [])],
    )


def nominal_model(sequence: RecordedSequence, gravity: float) -> SequenceModel:
    """Return the first-order model of a sequence as it was to be turned.

    Parameters
    ----------
    sequence : as it was cut.
    gravity : m/s².
    """
    step, (first, last) = sequence.time_step, sequence.start
    angle = sum(abs(turned) for _, turned in sequence.rotations)
    return sequence_model(
        sequence.rotations,
        sequence.down_start,
        gravity,
        rate=angle / (step * max(sequence.end[0] - last, 1)),
        seconds=step * (last - first),
    )


def rough_model(
    sequences: Sequence[RecordedSequence], models: Sequence[SequenceModel], gravity: float
) -> ImuModel:
    """Return both triads by least squares from the nominal attitudes and angles, good to the fixture's errors.

    Parameters
    ----------
    sequences, models : of each sequence.
    gravity : m/s².
    """
    downs = np.array([down for one in models for down in (one.down_start, one.down_end)])
    forces = np.array([s.force[a:b].mean(axis=0) for s in sequences for a, b in (s.start, s.end)])
    design = np.column_stack([-gravity * downs, np.ones(len(downs))])
    force = np.asarray(np.linalg.lstsq(design, forces)[0], dtype=np.float64)
    rests = np.array([s.rate[slice(*s.start)].mean(axis=0) for s in sequences])
    summed = np.array(
        [s.time_step * (s.rate - rest).sum(axis=0) for s, rest in zip(sequences, rests, strict=True)]
    )
    turned = np.array([sum(angle * np.eye(3)[axis] for axis, angle in s.rotations) for s in sequences])
    rate = np.asarray(np.linalg.lstsq(turned, summed)[0].T, dtype=np.float64)
    return ImuModel(Triad(force[:3].T.copy(), force[3]), Triad(rate.copy(), rests.mean(axis=0)))


def _measure(sequence: RecordedSequence, model: ImuModel, gravity: float) -> SequenceMeasurement:
    """(1), (2) of the corrected recording."""
    force, rate = model.correct(sequence.force, sequence.rate)
    return measure_sequence(
        rate,
        force,
        sequence.time_step,
        sequence.earth_rate_start,
        sequence.start,
        sequence.end,
        gravity,
        sequence.down_start,
    )


def measurement_covariance(
    sequence: RecordedSequence, model: SequenceModel, noise: WhiteNoise, gravity: float
) -> Square:
    """Return (5, 5) of a sequence's measurement: walks of the angle, the start's bias, both accelerations.

    Parameters
    ----------
    sequence, model : the sequence, and its first-order model.
    noise : of both triads.
    gravity : m/s².
    """
    step = sequence.time_step
    window = step * min(sequence.start[1] - sequence.start[0], sequence.end[1] - sequence.end[0])
    turning = step * (sequence.end[0] - sequence.start[1])
    towards, spread = gravity * skew(model.down_start), np.zeros((5, 5))
    # The walk of the angle: through the turns, and as the means of both windows see it, a third of each.
    spread[:3, :3] = noise.angle * (turning + 2.0 * window / 3.0) * towards @ towards.T
    # The start's bias is made of the same noise as the walk in the start's window, and takes half of it back.
    by_bias, both = model.bias_coefficients, np.zeros((5, 5))
    both[:3] = towards @ by_bias.T
    spread += noise.angle * (by_bias @ by_bias.T / window - 0.5 * (both + both.T))
    return spread + noise.force / window * np.diag([2.0, 2.0, 2.0, 1.0, 1.0])


def inversion_covariance(spread: Mapping[str, Square], gravity: float, *, asymmetry: bool) -> Square:
    """Return (24, 24) of the errors, which (13) and (14) have as linear functions of the measurements.

    Parameters
    ----------
    spread : (5, 5) of each sequence's measurement.
    gravity : m/s².
    asymmetry : as for `invert_measurements`.
    """
    nothing = {name: np.zeros(5) for name in spread}
    covariance = np.zeros((24, 24))
    for name, own in spread.items():
        slope: Table = np.column_stack(
            [invert_measurements({**nothing, name: unit}, gravity, asymmetry=asymmetry) for unit in np.eye(5)]
        )
        covariance += slope @ own @ slope.T
    return covariance


ESTIMATORS: dict[str, Estimator] = {
    NAME: Estimator(
        NAME,
        "each error of both triads from the rotation sequence that was made for it",
        "Savage 2018, (1) to (14)",
        calibrate_savage,
        needs_protocol=True,
    )
}
"""What the entry point offers."""
