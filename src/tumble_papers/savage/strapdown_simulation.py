"""Savage's strapdown rotation test simulated: units with errors on a two-axis fixture that is not exact.

A run is one unit with errors at random, in a place and on a heading at random, through all seventeen
sequences of table 1. The fixture is off in its installation, in the unit's mounting, between its axes and
wherever it stops. The raw increments of both triads are made sample by sample: the gyros' exactly, of what
each turns about its own axis with the Earth, with asymmetry, bias, random walk and whole pulses of the
integrated output. The test knows the site, the heading and the angles as they are meant to be, and plays
the same increments back with better compensation each time (section 8).

Chosen, because the paper does not print it: all errors normal, with the standard deviations given here;
rotations at an even rate without ramps or pauses; pulses that begin anywhere; the lever arm is zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Matrix, Series, Vector, Vectors
from tumble.attitude import matrix_from_rotation_vector, skew
from tumble.earth import EARTH_RATE, Site
from tumble.protocol import SEQUENCES, RotationSequence, fixture_rotation, start_down
from tumble.sensor import GROUPS, ImuModel, SavageErrors, Triad, savage_from_model
from tumble.units import ARCSECOND, DEGREE_PER_HOUR, MICRO_G, STANDARD_GRAVITY
from tumble_papers.savage.sequences import (
    SequenceModel,
    invert_measurements,
    measure_sequence,
    sequence_model,
    solve_measurements,
    window_weights,
)
from tumble_papers.study import in_threads

DEGREE_PER_ROOT_HOUR = np.pi / 180.0 / 60.0
LARGEST_LATITUDE = 75.0 * np.pi / 180.0
"""Beyond it a place has hardly a heading."""

UNITS_SI = np.ones(24) * 1e-6
UNITS_SI[GROUPS["lambda_bias"]] = MICRO_G
"""ppm, µrad and µg, in the order of `savage.NAMES`."""


@dataclass(frozen=True)
class Grade:
    """A kind of unit.

    Attributes
    ----------
    name : what it is called.
    angle_random_walk, velocity_random_walk : rad/√s and m/s/√s.
    angle_pulse, velocity_pulse : rad and m/s of the integrated outputs, 0 for none.
    scale, asymmetry, angle, bias : standard deviations of the errors before the test: of scale factors, of their
        asymmetry, of misalignments (rad), of accelerometer biases (m/s²).
    gyro_bias : rad/s, the same.
    """

    name: str
    angle_random_walk: float
    velocity_random_walk: float
    angle_pulse: float = 0.0
    velocity_pulse: float = 0.0
    scale: float = 1e-3
    asymmetry: float = 3e-4
    angle: float = 1e-3
    bias: float = 1e3 * MICRO_G
    gyro_bias: float = 0.0


GRADES = {
    "nav": Grade(
        "nav", 0.002 * DEGREE_PER_ROOT_HOUR, 3.0 * MICRO_G, 0.5 * ARCSECOND, 1e-5, gyro_bias=0.02 * DEGREE_PER_HOUR
    ),
    "tactical": Grade(
        "tactical", 0.05 * DEGREE_PER_ROOT_HOUR, 30.0 * MICRO_G, gyro_bias=1.0 * DEGREE_PER_HOUR
    ),
    "MEMS": Grade(
        "MEMS", 0.3 * DEGREE_PER_ROOT_HOUR, 100.0 * MICRO_G, scale=5e-3, asymmetry=1.5e-3, angle=5e-3,
        bias=5e3 * MICRO_G, gyro_bias=30.0 * DEGREE_PER_HOUR,
    ),
}  # fmt: skip
"""Navigation grade and MEMS as in the paper's section 9 and for its section 1, and one between."""

EXACT = Grade("exact", 0.0, 0.0)
"""Navigation grade's errors before the test, and outputs without noise and pulses."""


@dataclass(frozen=True)
class Setting:
    """What one study simulates.

    Attributes
    ----------
    grade : of the unit.
    fixture : rad, standard deviation of installation (about three axes, north among them), mounting (three),
        non-orthogonality, and of each angle that an axis stops at.
    heading : rad, of the installation about the vertical; None for as much as `fixture`.
    seconds : s of a measurement at rest.
    rate : rad/s of the rotations.
    sampling : Hz.
    earth : whether the Earth turns.
    sequences : rows of table 1.
    """

    grade: Grade
    fixture: float = 1e-3
    heading: float | None = None
    seconds: float = 10.0
    rate: float = 1.0
    sampling: float = 100.0
    earth: bool = True
    sequences: tuple[RotationSequence, ...] = SEQUENCES

    @property
    def window(self) -> int:
        """Samples of a measurement at rest."""
        return round(self.seconds * self.sampling)


@dataclass(frozen=True)
class Recordings:
    """The raw outputs of one run, sequence by sequence, and what the test knows.

    Attributes
    ----------
    truth : of the unit.
    rate, force : (samples, 3) raw, as means over each step; force at rest alone.
    starts : (sequences + 1,) first sample of each sequence.
    earth : (sequences, 3) rad/s, nominal Earth rate in the frame of each start.
    gravity : m/s².
    setting : that it was simulated with.
    """

    truth: SavageErrors
    rate: Vectors
    force: Vectors
    starts: npt.NDArray[np.int64]
    earth: Vectors
    gravity: float
    setting: Setting


@dataclass(frozen=True)
class Variant:
    """A way to evaluate the test.

    Attributes
    ----------
    name : in words.
    start_bias, norm, averaging : as in `measure_sequence`.
    asymmetry : estimate that of the gyros (13), or not (14).
    common_bias : subtract the mean of all first windows beyond the Earth rate, one bias for all sequences.
    printed_signs : take λiii with the sign that (13) prints.
    all_components : least squares over all that was measured, instead of (13).
    matched : horizontal averages with the weights of the least noise; those down stay plain.
    """

    name: str
    start_bias: bool = True
    norm: bool = True
    averaging: str = "plain"
    asymmetry: bool = True
    common_bias: bool = False
    printed_signs: bool = False
    all_components: bool = False
    matched: bool = False

    def weights(self, setting: Setting) -> Series:
        """Return the weights of the average before the rotations; that after them has them the other way round.

        Parameters
        ----------
        setting : whose samples and noise.
        """
        if not self.matched:
            return window_weights(setting.window, self.averaging)
        return matched_weights(setting)


def matched_weights(setting: Setting) -> Series:
    """Return the weights of the average with the least noise of both triads before the rotations.

    The gyros' random walk turns the computed frame away while the accelerometers' noise is averaged: what lies
    farther from the rotations than the one over the other determines less and less.

    Parameters
    ----------
    setting : whose samples and noise.
    """
    grade = setting.grade
    distance = (np.arange(setting.window)[::-1] + 0.5) / setting.sampling
    time = grade.velocity_random_walk / max(STANDARD_GRAVITY * grade.angle_random_walk, 1e-300)
    time = min(max(time, 1e-3), 1e3 * setting.seconds)
    left = (setting.seconds - distance) / time
    weights = np.exp(left - left.max()) + np.exp(-left - left.max())
    return weights / weights.sum()


AS_PRINTED = Variant("as printed, signs corrected", start_bias=False, norm=False)
START_NORM = Variant("start bias and norm")
VARIANTS = (
    AS_PRINTED,
    Variant("as printed, its signs too", start_bias=False, norm=False, printed_signs=True),
    Variant("norm", start_bias=False),
    START_NORM,
    Variant("start bias and norm, average of averages", averaging="average-of-averages"),
    Variant("start bias and norm, without asymmetry (14)", asymmetry=False),
    Variant("start bias and norm, all components", all_components=True),
    Variant("common bias and norm", start_bias=False, common_bias=True),
    Variant("common bias and norm, all components", start_bias=False, common_bias=True, all_components=True),
    Variant(
        "common bias and norm, all components, matched averages",
        start_bias=False,
        common_bias=True,
        all_components=True,
        matched=True,
    ),
)


def draw_truth(setting: Setting, rng: np.random.Generator, *, asymmetry: bool = True) -> SavageErrors:
    """Return the errors of one unit.

    Parameters
    ----------
    setting : whose grade says how large they are.
    rng : source of all numbers.
    asymmetry : whether the gyros have any.
    """
    grade = setting.grade
    sigma = np.full(24, grade.scale)
    sigma[GROUPS["upsilon"]] = sigma[GROUPS["mu"]] = grade.angle
    sigma[GROUPS["lambda_bias"]] = grade.bias
    sigma[GROUPS["kappa_asym"]] = grade.asymmetry if asymmetry else 0.0
    sigma[GROUPS["lambda_asym"]] = grade.asymmetry
    values = sigma * rng.standard_normal(24)
    return SavageErrors.from_vector(values, gyro_bias=grade.gyro_bias * rng.standard_normal(3))


def simulate_run(
    setting: Setting, rng: np.random.Generator, *, truth: SavageErrors | None = None, asymmetry: bool = True
) -> Recordings:
    """Simulate one unit through all sequences.

    Parameters
    ----------
    setting : what to simulate.
    rng : source of all numbers.
    truth : the unit's errors; None draws them.
    asymmetry : whether drawn gyros have any.
    """
    truth = truth or draw_truth(setting, rng, asymmetry=asymmetry)
    site = Site.from_latitude(float(rng.uniform(-LARGEST_LATITUDE, LARGEST_LATITUDE)), 0.0)
    earth_n = site.earth_rate_n if setting.earth else np.zeros(3)
    fixture = _Fixture.drawn(setting, float(rng.uniform(-np.pi, np.pi)), rng)
    play = partial(_played, setting, truth.model(), np.array([earth_n, [0.0, 0.0, -site.gravity]]), rng)
    played = [play(*sequence) for sequence in fixture.sequences(setting, rng)]
    rate, force = (np.concatenate(parts) for parts in zip(*played, strict=True))
    starts = np.cumsum([0, *(len(own) for own, _ in played)])
    earth = np.array([fixture.nominal_nb(sequence).T @ earth_n for sequence in setting.sequences])
    return Recordings(truth, rate, force, starts, earth, site.gravity, setting)


def _played(
    setting: Setting,
    model: ImuModel,
    seen_n: Vectors,
    rng: np.random.Generator,
    C_bn: Matrix,
    turns: list[_Turn],
) -> tuple[Vectors, Vectors]:
    """Return the raw rates and forces (samples, 3) of a sequence in which the triads see `seen_n` (2, 3) at rest."""
    grade, step = setting.grade, 1.0 / setting.sampling
    walks = np.sqrt(step) * np.array([grade.angle_random_walk, grade.velocity_random_walk])
    pulses = grade.angle_pulse, grade.velocity_pulse
    begun, none = rng.random((2, 3)), np.zeros((setting.window, 3))
    increments: tuple[list[Vectors], list[Vectors]] = [], []

    def rest() -> None:
        shown = model.distort((C_bn @ seen_n[1])[None], (C_bn @ seen_n[0])[None])[::-1]
        for own, raw, walk, pulse in zip(increments, shown, walks, pulses, strict=True):
            drawn = rng.standard_normal((3, setting.window)).T if walk or pulse else none
            own.append(step * raw + walk * drawn)

    rest()
    for axis, angle, count in turns:
        rate, nothing = _turning(C_bn @ seen_n[0], axis, angle, count, step), np.zeros((count, 3))
        drawn = rng.standard_normal((count, 3)) if walks[0] else 0.0
        increments[0].append(step * model.distort(nothing, rate)[1] + walks[0] * drawn)
        increments[1].append(nothing)
        C_bn = matrix_from_rotation_vector(-angle * axis) @ C_bn
    rest()
    rate, force = (
        _in_pulses(np.concatenate(own), pulse, first) / step
        for own, pulse, first in zip(increments, pulses, begun, strict=True)
    )
    return rate, force


def _turning(earth_b: Vector, axis: Vector, angle: float, count: int, step: float) -> Vectors:
    """Return the mean rates (count, 3) of a turn at an even rate, which begins with the Earth rate so."""
    delta, along = angle / count, float(axis @ earth_b)
    turned = delta * (np.arange(count) + 0.5)[:, None]
    level = np.cos(turned) * (earth_b - along * axis) - np.sin(turned) * np.cross(axis, earth_b)
    # The level part of the Earth rate turns during a sample.
    return (delta / step + along) * axis + np.sin(0.5 * delta) / (0.5 * delta) * level


def _in_pulses(increments: Vectors, pulse: float, begun: Vector) -> Vectors:
    """Return increments as whole pulses of their sum, which begins inside one."""
    if not pulse:
        return increments
    inside = np.cumsum(np.vstack([pulse * begun, increments]), axis=0)
    return pulse * np.diff(np.floor(inside / pulse), axis=0)


def _about(axis: int, angle: float) -> Matrix:
    """Rotation matrix about x, y or z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    found = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[i, i] = found[j, j] = cosine
    found[i, j], found[j, i] = -sine, sine
    return found


def _small(angles: AnyArray) -> Matrix:
    return _about(2, float(angles[2])) @ _about(1, float(angles[1])) @ _about(0, float(angles[0]))


@dataclass(frozen=True)
class _Fixture:
    azimuth: float
    room: Matrix
    orthogonality: Matrix
    mounting: Matrix

    @staticmethod
    def drawn(setting: Setting, azimuth: float, rng: np.random.Generator) -> _Fixture:
        chance = setting.fixture * rng.standard_normal(7)
        if setting.heading is not None:
            chance[2] = setting.heading * rng.standard_normal()
        room = _small(chance[:3]) @ _about(2, azimuth)
        return _Fixture(azimuth, room, _about(0, float(chance[3])), _small(chance[4:]))

    def nominal_nb(self, sequence: RotationSequence) -> Matrix:
        """The attitude at the start of a sequence as it is meant to be."""
        return _about(2, self.azimuth) @ _nominal_tb(sequence.inner, sequence.outer)

    def sequences(self, setting: Setting, rng: np.random.Generator) -> Iterator[tuple[Matrix, list[_Turn]]]:
        """Yield of each sequence C_bn at the start, and the rotations."""
        most = max(len(s.rotations) for s in setting.sequences)
        errors = setting.fixture * rng.standard_normal((len(setting.sequences), most + 1, 2))
        for sequence, off in zip(setting.sequences, errors, strict=True):
            planned, turns = _fixture_angles(sequence), list[_Turn]()
            at = np.array(planned[0]) + off[0]
            C_bn = (self.room @ _about(1, float(at[1])) @ self._from_outer(float(at[0]))).T
            for turn, (axis, angle) in enumerate(sequence.rotations):
                which = 0 if axis == 2 else 1
                turned = self.mounting if axis == 2 else self._from_outer(float(at[0]))
                reached = planned[turn + 1][which] + off[turn + 1, which]
                samples = round(abs(angle) / setting.rate * setting.sampling)
                turns.append((turned[2 - which], float(reached - at[which]), samples))
                at[which] = reached
            yield C_bn, turns

    def _from_outer(self, inner: float) -> Matrix:
        return self.orthogonality @ _about(2, inner) @ self.mounting


@cache
def _nominal_tb(inner: float, outer: float) -> Matrix:
    return np.asarray(fixture_rotation(inner, outer).as_matrix(), dtype=np.float64)


_down = cache(start_down)
_fixture_angles = cache(RotationSequence.fixture_angles)
_Turn = tuple[Vector, float, int]
Models = tuple[list[SequenceModel], list[AnyArray]]


def _evaluate_run(
    recordings: Recordings, variant: Variant, iterations: int, models: Models | None
) -> AnyArray:
    """Play a run back: compensate, measure, invert, better the compensation, again. Errors (iterations, 24), SI."""
    truth = recordings.truth.vector
    current = ImuModel.ideal()
    errors = np.empty((iterations, 24))
    for k in range(iterations):
        measurements, gyro_bias = _measure(recordings, current, variant)
        found = _invert(measurements, recordings, variant, models)
        # A bias that is known is taken off before the asymmetry is, which needs the sign of the input alone.
        current = composed(current, SavageErrors.from_vector(found, gyro_bias=gyro_bias))
        errors[k] = savage_from_model(current)[0].vector - truth
    return errors


def measure_run(recordings: Recordings, current: ImuModel, variant: Variant) -> dict[str, Series]:
    """Return (5,) of each sequence, of raw outputs compensated by a model.

    Parameters
    ----------
    recordings : one run.
    current : what is known of the unit.
    variant : how to measure.
    """
    return _measure(recordings, current, variant)[0]


def _measure(recordings: Recordings, current: ImuModel, variant: Variant) -> tuple[dict[str, Series], Vector]:
    """The measurements, and the gyros' mean bias where the variant looks at any."""
    setting = recordings.setting
    force, rate = current.correct(recordings.force, recordings.rate)
    window, step = setting.window, 1.0 / setting.sampling
    starts = recordings.starts
    gyro_bias = np.zeros(3)
    if variant.common_bias or variant.start_bias:
        for first, earth in zip(starts[:-1], recordings.earth, strict=True):
            gyro_bias += (rate[first : first + window].mean(axis=0) - earth) / len(recordings.earth)
    if variant.common_bias:
        rate -= gyro_bias
    found: dict[str, Series] = {}
    for number, sequence in enumerate(setting.sequences):
        first, last = int(starts[number]), int(starts[number + 1])
        measured = partial(
            measure_sequence,
            rate[first:last],
            force[first:last],
            step,
            recordings.earth[number],
            (0, window),
            (last - first - window, last - first),
            recordings.gravity,
            _down(sequence),
            start_bias=variant.start_bias,
            norm=variant.norm,
            averaging=variant.averaging,
        )
        found[sequence.name] = measured().vector
        if variant.matched:
            found[sequence.name][:3] = measured(weights=variant.weights(setting)).horizontal
    return found, gyro_bias


def _invert(
    measurements: dict[str, Series], recordings: Recordings, variant: Variant, models: Models | None
) -> Series:
    if variant.all_components:
        told, covariances = models or model_sequences(recordings.setting, variant)
        measured = list(measurements.values())
        return solve_measurements(told, measured, covariances, asymmetry=variant.asymmetry)
    found = invert_measurements(measurements, recordings.gravity, asymmetry=variant.asymmetry)
    if variant.printed_signs:
        bias, gravity = found[GROUPS["lambda_bias"]], recordings.gravity
        # printed: -(end - start - 2 λ) / 2g
        found[GROUPS["lambda_asym"]] += 2.0 * bias / gravity
    return found


def composed(current: ImuModel, found: SavageErrors) -> ImuModel:
    """Return the model of a unit whose outputs, compensated by `current`, have the errors `found`.

    The asymmetry is added, which is right to the first order.

    Parameters
    ----------
    current : what the outputs were compensated by.
    found : errors of what is left.
    """
    rest = found.model()
    parts: list[Triad] = []
    for known, more in ((current.accelerometer, rest.accelerometer), (current.gyroscope, rest.gyroscope)):
        assert known is not None
        assert more is not None
        a, b = (np.zeros(3) if t.asymmetry is None else t.asymmetry for t in (known, more))
        parts.append(Triad(known.matrix @ more.matrix, known.bias + known.matrix @ more.bias, a + b))
    return ImuModel(parts[0], parts[1])


def model_sequences(setting: Setting, variant: Variant) -> Models:
    """Return the error models of a setting's sequences at a nominal gravity, and covariances of their measurements.

    The noise is that of the random walks, of the pulses, and of what a start attitude that is off makes of the
    Earth rate; taken as independent from sequence to sequence.

    Parameters
    ----------
    setting, variant : of what.
    """
    grade, seconds, step = setting.grade, setting.seconds, 1.0 / setting.sampling
    heading = setting.fixture if setting.heading is None else setting.heading
    weights = variant.weights(setting)
    # What of the first average is taken before a moment: the part of its turn that the change of averages has.
    before = np.cumsum(weights)
    share = float(np.sum(before)) * step / seconds
    noise = (
        float(np.sum(weights**2)),
        (1.0 / setting.window if variant.matched else float(np.sum(weights**2))),
    )
    walk = grade.velocity_random_walk**2 / step
    # A pulse of the velocity counts once at either end of a plain average, less for one that begins gently.
    pulse = (grade.velocity_pulse / seconds) ** 2 / 6.0
    force, down_force = (max(walk * n + pulse, (1e-3 * MICRO_G) ** 2) for n in noise)
    made: Models = ([], [])
    for sequence in setting.sequences:
        down = start_down(sequence)
        rotations = list(sequence.rotations)
        model = sequence_model(
            rotations, down, STANDARD_GRAVITY, rate=setting.rate, seconds=seconds, share=share
        )
        turning = model.angle / setting.rate
        integral = _integral(sequence, setting, share)
        squared = float(np.sum(before**2)) * step
        tilt = (turning + 2.0 * squared) * np.eye(3)
        pulses = grade.angle_pulse**2 / 6.0 * np.eye(3)
        # A start that is off by an angle turns the Earth rate, by less than the Earth rate times the angle.
        earth = (turning + 2.0 * seconds * share) * np.eye(3)
        if variant.start_bias:
            tilt += -share * (integral + integral.T) + integral @ integral.T / seconds
            pulses += (grade.angle_pulse / seconds) ** 2 / 6.0 * integral @ integral.T
            earth -= integral
        off = (3.0 * setting.fixture**2 + heading**2) / 3.0
        size = (EARTH_RATE if setting.earth else 0.0) ** 2 * off
        tilt = grade.angle_random_walk**2 * tilt + pulses + size * earth @ earth.T
        across = STANDARD_GRAVITY * skew(down)
        covariance = np.zeros((5, 5))
        covariance[:3, :3] = across @ tilt @ across.T + 2.0 * force * np.eye(3)
        covariance[3, 3] = covariance[4, 4] = down_force
        made[0].append(model)
        made[1].append(covariance)
    return made


def _integral(sequence: RotationSequence, setting: Setting, share: float) -> Matrix:
    """What a constant rate in b adds to the attitude between the two averages, s."""
    rotations = list(sequence.rotations)
    by_x, by_y = (
        sequence_model(
            rotations, np.eye(3)[k], 1.0, rate=setting.rate, seconds=setting.seconds, share=share
        ).bias_coefficients
        for k in range(2)
    )
    # rows are e_k × tilt: x gives -z and y, y gives z and -x
    return np.array([-by_y[2], by_x[2], -by_x[1]])


def run_study(
    setting: Setting,
    variants: Sequence[Variant],
    runs: int,
    rng: np.random.Generator,
    *,
    iterations: int = 3,
    threads: int | None = None,
) -> AnyArray:
    """Simulate many units and evaluate each in every way; return (variants, runs, iterations, 24) errors, SI.

    Parameters
    ----------
    setting : what to simulate.
    variants : ways to evaluate; a variant without the gyros' asymmetry has units of its own that have none.
    runs : how many.
    rng : source of all numbers; every run has a stream of its own, so that threads change nothing.
    iterations : passes.
    threads : at once; None for as many as the machine has.
    """
    streams = rng.spawn(runs)
    models = [model_sequences(setting, v) if v.all_components else None for v in variants]
    errors = np.empty((len(variants), runs, iterations, 24))

    def play(run: int) -> None:
        with_asymmetry = simulate_run(setting, streams[run]) if any(v.asymmetry for v in variants) else None
        without: Recordings | None = None
        for number, variant in enumerate(variants):
            if not variant.asymmetry and without is None:
                without = simulate_run(setting, streams[run], asymmetry=False)
            recordings = with_asymmetry if variant.asymmetry else without
            assert recordings is not None
            errors[number, run] = _evaluate_run(recordings, variant, iterations, models[number])

    list(in_threads(play, runs, threads))
    return errors


def group_rms(errors: AnyArray) -> dict[str, AnyArray]:
    """Return each run's root mean square of each group, in ppm, µrad and µg.

    Parameters
    ----------
    errors : (..., 24) SI, as `savage.NAMES`.
    """
    scaled = np.asarray(errors, dtype=np.float64) / UNITS_SI
    return {
        name: np.asarray(np.sqrt(np.mean(scaled[..., at] ** 2, axis=-1)), dtype=np.float64)
        for name, at in GROUPS.items()
    }
