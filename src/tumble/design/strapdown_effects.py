"""What each source does to the measurements of the strapdown rotation test, to first order (Savage 2018, (17) to (21)).

A source is a covariance a sequence, where it is drawn anew in each, or columns that all sequences share, where
it stays the same through the test.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.attitude import skew
from tumble.design.error_budget import ErrorSource
from tumble.design.strapdown_sequences import TimedSequence
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.records import dataclass

PULSE = float(np.sqrt(1.0 / 12.0))
"""Rms of what a pulse leaves over, in pulses."""
# Flicker spreads with the logarithm of the time: over a test a hundred times as long as an average, twice as far.
_WHOLE_TEST = 2.0


@dataclass(slots=True)
class Effect:
    """What one source does to the measurements: covariances, or columns that all sequences share.

    Attributes
    ----------
    source : which.
    covariances : by sequence, (5, 5), independent from sequence to sequence; or None.
    columns : by sequence, (5, n) for n independent unit errors that are the same in all of them; or None.
    """

    source: ErrorSource
    covariances: list[Square] | None = None
    columns: list[Table] | None = None


def noise_effects(setup: StrapdownSetup, sequences: list[TimedSequence]) -> list[Effect]:
    """Return what is drawn anew in each sequence: noise, pulses, wandering biases.

    Parameters
    ----------
    setup, sequences : the test.
    """
    sensors, timing = setup.sensors, setup.timing
    window = timing.seconds
    walk = [_walk_covariance(s, setup) for s in sequences]
    one_mean = timing.noise_share / window
    pulses = [_pulse_covariance(s, setup) for s in sequences]
    wandering = [
        _horizontal(s, s.attitude_integral @ s.attitude_integral.T if setup.start_bias else np.zeros((3, 3)))
        for s in sequences
    ]

    def of(name: str, words: str, magnitude: float, unit: str, covariances: list[Square]) -> Effect:
        source = ErrorSource(name, words, magnitude, unit, "sensors")
        return Effect(source, covariances=[magnitude**2 * c for c in covariances])

    force = [_force_covariance(s) for s in sequences]
    return [
        of(
            "gyro noise",
            "the gyros' random walk while the attitude is carried",
            sensors.gyro_walk,
            "rad/√s",
            walk,
        ),
        of("gyro pulses", "angle of pulses not yet sent", sensors.gyro_pulse, "rad", pulses),
        of(
            "gyro bias wander",
            "the gyros' bias is another over the rotations than in the rest before",
            sensors.gyro_instability,
            "rad/s",
            wandering,
        ),
        of(
            "accelerometer noise",
            "the accelerometers' random walk in the two averages",
            sensors.force_walk,
            "(m/s)/√s",
            [one_mean * c for c in force],
        ),
        of(
            "accelerometer pulses",
            "velocity of pulses not yet sent",
            sensors.force_pulse,
            "m/s",
            [2.0 * PULSE**2 / window**2 * c for c in force],
        ),
        of(
            "accelerometer bias wander",
            "the accelerometers' biases are others in each average",
            sensors.force_instability,
            "m/s²",
            force,
        ),
    ]


def _walk_covariance(sequence: TimedSequence, setup: StrapdownSetup) -> Square:
    """Of white noise of unit density: ∫h C n, less what the same noise makes of the bias of the start window."""
    spread = sequence.square_seconds * np.eye(3)
    if setup.start_bias:
        integral = sequence.attitude_integral
        spread = spread + integral @ integral.T / setup.timing.seconds - 0.5 * (integral + integral.T)
    return _horizontal(sequence, spread)


def _pulse_covariance(sequence: TimedSequence, setup: StrapdownSetup) -> Square:
    """Of pulses of unit size: what is left over at start and end, and at both ends of the start window."""
    spread = 2.0 * PULSE**2 * np.eye(3)
    if setup.start_bias:
        integral = sequence.attitude_integral / setup.timing.seconds
        spread = spread + 2.0 * PULSE**2 * integral @ integral.T
    return _horizontal(sequence, spread)


def _horizontal(sequence: TimedSequence, attitude: Table) -> Square:
    """(5, 5) of an attitude error's covariance: gravity tilted."""
    found = np.zeros((5, 5))
    found[:3, :3] = sequence.towards @ attitude @ sequence.towards.T
    return found


def _force_covariance(sequence: TimedSequence) -> Square:
    """(5, 5) of a unit variance of each axis in each of the two averages."""
    down = sequence.model.down_start
    found = np.zeros((5, 5))
    found[:3, :3] = 2.0 * (np.eye(3) - np.outer(down, down))
    found[3, 3] = found[4, 4] = 1.0
    return found


def attitude_axes(sequence: TimedSequence) -> Table:
    """Return (3, 8): the attitude's error at the start, in b, by the fixture's errors.

    Heading, lean about the fixture's x and y, mounting (3), and the stops of inner and outer axis.

    Parameters
    ----------
    sequence : of the test.
    """
    lean_and_down = sequence.C_start_t
    return np.column_stack(
        [
            lean_and_down[:, 2],
            lean_and_down[:, :2],
            np.eye(3),
            sequence.fixture_axes[0],
            sequence.fixture_axes[1],
        ]
    )


def _rate_effect(sequence: TimedSequence, setup: StrapdownSetup) -> Table:
    """(5, 3): what a constant rate in the frame of the start does that the gyros show and nobody takes out."""
    span = sequence.seconds * np.eye(3)
    if setup.start_bias:
        span = span - sequence.attitude_integral
    return np.vstack([sequence.towards @ span, np.zeros((2, 3))])


def earth_by_attitude(sequence: TimedSequence, setup: StrapdownSetup) -> Table:
    """Return (5, 3) by an error of the attitude at the start: the Earth rate is elsewhere than believed.

    Parameters
    ----------
    sequence, setup : of the test.
    """
    return _rate_effect(sequence, setup) @ skew(sequence.earth_rate)


def fixture_effects(setup: StrapdownSetup, sequences: list[TimedSequence]) -> list[Effect]:
    """Return the first-order effect of a fixture: the Earth rate is taken out in a wrong direction.

    Parameters
    ----------
    setup, sequences : the test.
    """
    fixture = setup.fixture
    by_axis = [earth_by_attitude(s, setup) @ attitude_axes(s) for s in sequences]

    def shared(name: str, words: str, magnitude: float, at: slice) -> Effect:
        source = ErrorSource(name, words, magnitude, "rad", "fixture")
        return Effect(source, columns=[magnitude * columns[:, at] for columns in by_axis])

    stops = [fixture.execution**2 * columns[:, 6:] @ columns[:, 6:].T for columns in by_axis]
    execution = ErrorSource(
        "execution × Earth rate",
        "a sequence starts beside its attitude: the Earth rate is taken out in a wrong direction",
        fixture.execution,
        "rad",
        "fixture",
    )
    return [
        shared(
            "heading × Earth rate", "north is not where it is believed to be", fixture.heading, slice(0, 1)
        ),
        shared(
            "installation × Earth rate",
            "the fixture leans against the vertical",
            fixture.installation,
            slice(1, 3),
        ),
        shared("mounting × Earth rate", "the unit sits askew on the fixture", fixture.mounting, slice(3, 6)),
        Effect(execution, covariances=stops),
    ]


def used_constant_effects(setup: StrapdownSetup, sequences: list[TimedSequence]) -> list[Effect]:
    """Return those of `constant_effects` that there are.

    Parameters
    ----------
    setup, sequences : the test.
    """
    return [effect for effect in constant_effects(setup, sequences) if effect.source.magnitude > 0.0]


def constant_effects(setup: StrapdownSetup, sequences: list[TimedSequence]) -> list[Effect]:
    """Return what stays the same through the test and no pass mends: gyro bias, g-sensitivity, gravity.

    Parameters
    ----------
    setup, sequences : the test.
    """
    sensors, site = setup.sensors, setup.site
    left_words, left = _left_sensitivity(setup, len(sequences))
    bias = [
        np.zeros((5, 3))
        if setup.start_bias
        else np.vstack([s.towards @ s.attitude_integral, np.zeros((2, 3))])
        for s in sequences
    ]
    sensitive: list[Table] = []
    for s in sequences:
        integral = s.force_integral
        if setup.start_bias:
            at_start = np.einsum("ij,k->ijk", s.attitude_integral, s.rest_force).reshape(3, 9)
            integral = integral - at_start
        sensitive.append(np.vstack([s.towards @ integral, np.zeros((2, 9))]))
    # A gravity believed too large by so much makes both ends look as much too short.
    gravity = [np.array([[0.0], [0.0], [0.0], [1.0], [1.0]]) for _ in sequences]
    return [
        Effect(ErrorSource(name, words, magnitude, unit, kind), columns=[magnitude * c for c in columns])
        for name, words, magnitude, unit, kind, columns in (
            ("gyro bias", "constant through a sequence", 0.0 if setup.start_bias else sensors.gyro_bias, "rad/s",
             "sensors", bias),
            ("g-sensitivity", left_words, left, "(rad/s)/(m/s²)", "sensors", sensitive),
            ("gravity", "gravity at the site is not what it is taken for", site.gravity_sigma, "m/s²", "site",
             gravity),
        )
    ]  # fmt: skip


def _left_sensitivity(setup: StrapdownSetup, count: int) -> tuple[str, float]:
    """In words and (rad/s)/(m/s²): g-sensitivity, or what the gyros at all rests leave unknown of it."""
    sensors = setup.sensors
    words = "the gyros' bias changes with the attitude"
    if setup.method == "formulas":
        return words, sensors.g_sensitivity
    # Each axis is up or down at a third of the rests, of which each sequence has two.
    rest = np.hypot(sensors.gyro_walk / np.sqrt(setup.timing.seconds), _WHOLE_TEST * sensors.gyro_instability)
    told = float(rest / (setup.site.gravity * np.sqrt(2.0 * count / 3.0)))
    if told < sensors.g_sensitivity:
        return f"{words}, by what the rests leave unknown of it", told
    return words, sensors.g_sensitivity


def earth_by_gyro(sequence: TimedSequence, setup: StrapdownSetup) -> Table:
    """Return (5, 9) by κ, κ asymmetry and υ: the Earth rate is measured wrong, and taken out of a wrong attitude.

    Parameters
    ----------
    sequence, setup : of the test.
    """
    effect = sequence.earth_by_gyro
    if setup.start_bias:
        effect = effect - sequence.attitude_integral @ sequence.rest_by_gyro
    return np.vstack([sequence.towards @ effect, np.zeros((2, 9))])


def gyro_earth_effects(setup: StrapdownSetup, sequences: list[TimedSequence], left: Series) -> list[Effect]:
    """Return what gyro errors do by way of the Earth rate.

    Parameters
    ----------
    setup, sequences : the test.
    left : (24,) one sigma of the sensor errors in the pass.
    """
    size = float(np.sqrt(np.mean(left[:9] ** 2)))
    words = "gyros with errors measure the Earth rate wrong" + after_play_back(setup)
    source = ErrorSource("gyro errors × Earth rate", words, size, "1", "method")
    return [Effect(source, columns=[earth_by_gyro(s, setup) * left[:9] for s in sequences])]


def after_play_back(setup: StrapdownSetup) -> str:
    """Return the words for sources that a play-back makes smaller.

    Parameters
    ----------
    setup : the test.
    """
    if setup.iterations == 0:
        return ""
    return ", with what play-back leaves of the errors"
