"""The strapdown rotation test on a two-axis fixture (Savage 2018, improved).

The unit rests, is turned about its own axes, and rests again. Its own gyros carry the attitude over the
turns: what their errors have made of it, gravity shows at the end. The fixture need not be exact, for what it
is off by is the same before and after; only where north is has to be known, as well as the Earth rate asks
for.

Beyond the paper:

- All components of all sequences are solved for by least squares, each weighed by its noise; the formulas
  (13) take one component of each. A sequence that is missing leaves undetermined only what no other tells.
- The gyros' bias is what they show before each sequence beyond the Earth rate (9.4); where all rests together
  show a g-sensitivity, it is taken out too.
- Down is gravity less the length of the acceleration, not its projection on the nominal vertical.
- The start is rough values from the nominal attitudes and angles, so that counts converge; the recording is
  then played back until nothing changes (8).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.attitude import skew
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.closed_forms.rest_rates import SENSITIVITY, RestSolution, solve_rests
from tumble.calibration.closed_forms.rotation_sequences import SequenceModel, sequence_model
from tumble.calibration.closed_forms.sequence_inversion import SequenceSolution, solve_measurements
from tumble.calibration.closed_forms.sequence_measurements import SequenceMeasurement, measure_sequence
from tumble.calibration.equations.placement import is_excessive
from tumble.calibration.equations.placement_bias import G_SENSITIVITY_FALSE_ALARM
from tumble.calibration.estimate import Estimate, TermTest
from tumble.calibration.procedure import Procedure
from tumble.calibration.session import Session
from tumble.calibration.strapdown.estimate import (
    BELIEVED_ASYMMETRY,
    StrapdownOutcome,
    apply_errors,
    strapdown_estimate,
)
from tumble.calibration.strapdown.recorded_sequences import RecordedSequence, check_rotations, cut_sequences
from tumble.calibration.strapdown.start_earth import earth_as_sensitivity, find_earth
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.protocol import Protocol
from tumble.protocol.strapdown_rotation import AXES
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, Timeline
from tumble.segmentation.matching import Matching
from tumble.sensor import ImuModel, Triad

# Converged where no error moves by more than this share of its standard uncertainty.
SETTLED = 0.01
LARGEST_PASSES = 8
# A sensor that shows so much less of the motion than the others shows none.
DEAD = 0.01


@dataclass(slots=True)
class _Noise:
    """What a second of white noise does: rad²/s of an angle, (m/s²)² of a mean over a second."""

    angle: float
    force: float


def calibrate_strapdown_rotation(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    matching: Matching,
    protocol: Protocol,
    site: Site,
) -> Estimate:
    """Calibrate both triads from rotation sequences.

    Parameters
    ----------
    recording, timeline, means : samples and holds.
    matching, protocol : which holds are a sequence's start and end; the start attitudes tell down and, with
        their headings, the Earth rate.
    site : gravity and latitude.

    Returns
    -------
    estimate : in the frame ``mean-gyro``, with asymmetries.

    Raises
    ------
    ObservabilityError
        If a triad or all sequences are missing, or too few are left for rough values.
    ConvergenceError
        If play-back does not settle.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: the strapdown rotation test needs one.")
    if means.angular_rate is None or means.angular_rate_covariance is None:
        raise ObservabilityError("The recording has no gyro: the strapdown rotation test needs one.")
    sequences, words = cut_sequences(protocol, recording, timeline, matching, site)
    if not sequences:
        raise ObservabilityError(
            f"No rotation sequence of the protocol {protocol.name} was found whole. {' '.join(words[:3])}"
        )
    start = _rough_model(sequences, site)
    assert start.gyroscope is not None
    kept, more = check_rotations(sequences, inverted(start.gyroscope.matrix), start.gyroscope.bias)
    words += more
    if more and kept:
        start = _rough_model(kept, site)
    if not kept:
        raise ObservabilityError(
            f"No rotation sequence was turned as the protocol says. {' '.join(more[:3])}"
        )
    outcome = _play_back(kept, start, means, site)
    outcome.words = words
    return strapdown_estimate(recording, means, site, outcome)


def _rough_model(sequences: list[RecordedSequence], site: Site) -> ImuModel:
    """Return both triads from the nominal attitudes and angles: least squares, good to the fixture's errors."""
    downs = np.array([d for s in sequences for d in (s.down_start, _nominal(s, site.gravity).down_end)])
    forces = np.array([np.mean(s.force[a:b], axis=0) for s in sequences for a, b in (s.start, s.end)])
    design = np.column_stack([-site.gravity * downs, np.full(len(downs), site.gravity)])
    solution, _, rank, _ = np.linalg.lstsq(design, forces, rcond=1e-3)
    if rank < 4:
        raise ObservabilityError(
            "The sequences found do not show each axis of the unit up and down: too few are left for a calibration. "
            "Those with x, y and z down at the start are needed at least."
        )
    force = np.asarray(solution[:3].T, dtype=np.float64)
    rest = np.array([np.mean(s.rate[s.start[0] : s.start[1]], axis=0) for s in sequences])
    turned = np.array([s.vector for s in sequences])
    bias = np.asarray(rest.mean(axis=0), dtype=np.float64)
    matrix = np.eye(3)
    for _ in range(2):
        shown = np.array([s.turned(bias) for s in sequences])
        answer, rank = _least_absolute(turned, shown)
        if rank < 3:
            raise ObservabilityError(
                "The sequences found do not turn the unit about all three of its axes: too few are left for a "
                "calibration."
            )
        matrix = np.asarray(answer.T, dtype=np.float64)
        earth = np.array([s.earth_rate_start for s in sequences])
        bias = np.asarray(np.mean(rest - earth @ matrix.T, axis=0), dtype=np.float64)
    for what, found in (("accelerometer", force), ("gyro", matrix)):
        sizes = np.linalg.norm(found, axis=1)
        if np.min(sizes) < DEAD * np.max(sizes):
            raise ObservabilityError(
                f"The {what} {AXES[int(np.argmin(sizes))]} shows nothing of what the fixture did. Is the sensor dead, "
                "or its column another one (--columns)?"
            )
        wrong = _mistaken_axes(found)
        if wrong:
            listed = ", ".join(f"{what} {axis} senses {sensed}" for axis, sensed in wrong)
            raise ObservabilityError(
                f"By the protocol {listed}. An axis is reversed or two are swapped, or the protocol has the axes of "
                f"the fixture wrong. If it is the columns, name the {what}'s {_mended_columns(found, what[0])} with "
                "--columns."
            )
    offset = np.asarray(solution[3] * site.gravity, dtype=np.float64)
    return ImuModel(Triad(force, offset, np.zeros(3)), Triad(matrix, bias, np.zeros(3)))


def _mended_columns(matrix: Matrix, letter: str) -> str:
    """Names of a triad's columns, in their order, by the axis that each senses most."""
    most = np.argmax(np.abs(matrix), axis=1)
    signs = ["-" if matrix[row, axis] < 0.0 else "" for row, axis in enumerate(most)]
    return ", ".join(f"{sign}{letter}{'xyz'[axis]}" for sign, axis in zip(signs, most, strict=True))


def _mistaken_axes(matrix: Matrix) -> list[tuple[str, str]]:
    """Sensors that sense another axis than their own most, and that axis with its sign."""
    sensed = np.argmax(np.abs(matrix), axis=1).tolist()
    return [
        (AXES[k], f"{'-' if matrix[k, axis] < 0.0 else ''}{AXES[axis]}")
        for k, axis in enumerate(sensed)
        if axis != k or matrix[k, k] < 0.0
    ]


def _least_absolute(design: Vectors, shown: Vectors) -> tuple[Matrix, int]:
    """Least absolute lengths of the residuals by reweighting: a sequence turned another way does not bend it."""
    weight = np.ones(len(design))
    answer, rank = np.eye(3), 0
    for _ in range(20):
        answer, _, rank, _ = np.linalg.lstsq(design * weight[:, None], shown * weight[:, None], rcond=1e-3)
        left = np.linalg.norm(shown - design @ answer, axis=1)
        weight = 1.0 / np.sqrt(np.maximum(left, 1e-3 * float(np.max(np.abs(shown)))))
    return np.asarray(answer, dtype=np.float64), int(rank)


def _nominal(sequence: RecordedSequence, gravity: float) -> SequenceModel:
    seconds = sequence.time_step * (sequence.start[1] - sequence.start[0])
    angle = sum(abs(a) for _, a in sequence.rotations)
    between = sequence.time_step * (sequence.end[0] - sequence.start[1])
    rate = angle / max(between, sequence.time_step)
    return sequence_model(sequence.rotations, sequence.down_start, gravity, rate=rate, seconds=seconds)


def _play_back(
    sequences: list[RecordedSequence], model: ImuModel, means: HoldMeans, site: Site
) -> StrapdownOutcome:
    """Play the recording back through the model and mend the model, until nothing changes."""
    models = [_nominal(s, site.gravity) for s in sequences]
    earth = find_earth(sequences, models, model, _noise(model, means).angle)
    passes: list[Series] = []
    term: TermTest | None = None
    solution: SequenceSolution | None = None
    measured: list[SequenceMeasurement] = []
    for _ in range(LARGEST_PASSES):
        noise = _noise(model, means)
        model, term = _with_rests(sequences, model, noise, term)
        measured = [_measure(s, model, site.gravity) for s in sequences]
        spreads = [_covariance(s, m, noise, site.gravity) for s, m in zip(sequences, models, strict=True)]
        vectors = [m.vector for m in measured]
        assert model.gyroscope is not None
        now = np.zeros(3) if model.gyroscope.asymmetry is None else model.gyroscope.asymmetry
        solution = solve_measurements(models, vectors, spreads, believed=(-now, BELIEVED_ASYMMETRY))
        if is_excessive(solution.square_sum, solution.degrees):
            factor = solution.square_sum / solution.degrees
            solution = replace(solution, covariance=factor * solution.covariance)
        passes.append(solution.errors)
        model = apply_errors(model, solution.errors)
        sigma = np.sqrt(np.diag(solution.covariance))
        known = solution.determined & (sigma > 0.0)
        if np.all(np.abs(solution.errors[known]) < SETTLED * sigma[known] + 1e-12):
            break
    else:
        raise ConvergenceError(
            f"Playing the recording back does not settle within {LARGEST_PASSES} passes: the sequences were not what "
            "the protocol says, or the unit moved while it was to rest."
        )
    assert solution is not None
    return StrapdownOutcome(
        sequences=sequences,
        models=models,
        measurements=measured,
        model=model,
        solution=solution,
        passes=passes,
        term=term,
        noise_angle=_noise(model, means).angle,
        earth=earth,
    )


def _noise(model: ImuModel, means: HoldMeans) -> _Noise:
    """The densities that the holds show, in SI."""
    assert model.gyroscope is not None
    assert model.accelerometer is not None
    assert means.angular_rate_covariance is not None
    assert means.specific_force_covariance is not None

    def density(matrix: Matrix, covariance: AnyArray) -> float:
        inverse = inverted(matrix)
        variance = np.einsum("ij,kjl,il->k", inverse, covariance, inverse) / 3.0
        return float(np.median(variance * means.duration))

    return _Noise(
        density(model.gyroscope.matrix, means.angular_rate_covariance),
        density(model.accelerometer.matrix, means.specific_force_covariance),
    )


def _with_rests(
    sequences: list[RecordedSequence], model: ImuModel, noise: _Noise, term: TermTest | None
) -> tuple[ImuModel, TermTest | None]:
    """Return the model with the bias, and the g-sensitivity if there is one, that all rests together show."""
    assert model.gyroscope is not None
    assert model.accelerometer is not None
    rates: list[Vector] = []
    forces: list[Vector] = []
    spreads: list[Square] = []
    matrix = model.gyroscope.matrix
    for s in sequences:
        down_end_rotation = _nominal(s, 1.0).C_start_end
        for (a, b), earth in (
            (s.start, s.earth_rate_start),
            (s.end, down_end_rotation.T @ s.earth_rate_start),
        ):
            seconds = s.time_step * (b - a)
            rates.append(np.mean(s.rate[a:b], axis=0) - matrix @ earth)
            forces.append(np.mean(model.accelerometer.correct(s.force[a:b]), axis=0))
            spread = noise.angle / seconds + (s.unknown_rate**2 + (s.sigma * EARTH_RATE) ** 2) / 2.0
            spreads.append(spread * matrix @ matrix.T)
    rest, force_b = np.array(rates), np.array(forces)

    def solve(*, with_sensitivity: bool) -> RestSolution:
        return solve_rests(
            matrix, rest, np.array(spreads), force_b, 0.0, 0.0, with_sensitivity=with_sensitivity
        )

    if term is None and len(rest) >= 9:
        full = solve(with_sensitivity=True)
        factor = max(1.0, full.square_sum / full.degrees)
        unknown = max(s.unknown_rate for s in sequences)
        to_raw = np.kron(matrix, np.eye(3))
        earth_like = earth_as_sensitivity(unknown, float(np.linalg.norm(force_b)) / len(force_b) ** 0.5)
        term = wald_test(
            "g_sensitivity",
            full.sensitivity.ravel(),
            factor * full.covariance[SENSITIVITY, SENSITIVITY] + to_raw @ earth_like @ to_raw.T,
            full.degrees,
            G_SENSITIVITY_FALSE_ALARM,
        )
    told = solve(with_sensitivity=term is not None and term.kept)
    gyroscope = replace(model.gyroscope, bias=told.bias)
    sensitivity = told.sensitivity if term is not None and term.kept else None
    return ImuModel(model.accelerometer, gyroscope, sensitivity), term


def _measure(sequence: RecordedSequence, model: ImuModel, gravity: float) -> SequenceMeasurement:
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


def _covariance(sequence: RecordedSequence, model: SequenceModel, noise: _Noise, gravity: float) -> Square:
    """(5, 5) of a measurement: walks of the angle, the start's bias, both accelerations, and the Earth's direction."""
    window = sequence.time_step * (sequence.start[1] - sequence.start[0])
    window = min(window, sequence.time_step * (sequence.end[1] - sequence.end[0]))
    turning = sequence.time_step * (sequence.end[0] - sequence.start[1])
    towards = gravity * skew(model.down_start)
    spread = np.zeros((5, 5))
    earth = (sequence.sigma * EARTH_RATE + sequence.unknown_rate) * sequence.seconds
    # The walk of the angle: through the turns, and as the means of both windows see it, a third of each.
    spread[:3, :3] = (noise.angle * (turning + 2.0 * window / 3.0) + earth**2) * towards @ towards.T
    # The start's bias is made of the same noise as the walk in the start's window, and takes half of it back.
    by_bias = model.bias_coefficients
    both = np.zeros((5, 5))
    both[:3] = towards @ by_bias.T
    spread += noise.angle * (by_bias @ by_bias.T / window - 0.5 * (both + both.T))
    mean = noise.force / window
    spread[:3, :3] += 2.0 * mean * np.eye(3)
    spread[3, 3] += mean
    spread[4, 4] += mean
    return spread


def _run(session: Session) -> Estimate:
    protocol, matching = session.matched
    return calibrate_strapdown_rotation(
        session.recording, session.timeline, session.means, matching, protocol, session.site
    )


PROCEDURE = Procedure(
    "strapdown-rotation",
    _run,
    "mean-gyro",
    "a fixture with two axes, good to 0.1°",
    "17 sequences of rotations, at rest before and after each; roughly where north is",
    "both triads in full with the asymmetry of their scale factors, and what is between them",
    "strapdown-rotation.md",
    example="strapdown-rotation",
    remedy="repeat the sequences, and turn faster: gyros with less noise are what would help most",
    gyros_from="turns",
    seeks=frozenset({"accelerometer_asymmetry", "gyro_asymmetry"}),
)
