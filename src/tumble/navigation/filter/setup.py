"""What a filter is told before it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Table, Vector, inverted
from tumble.errors import UsageError
from tumble.noise import NoiseModel
from tumble.records import dataclass
from tumble.sensor import ImuModel

AXES = "xyz"
KINDS = ("accelerometer", "gyroscope", "g-sensitivity", "lever arm", "time offset")
# Kind -> where its matrix and its bias begin among the parameters, the outputs that it acts on, the inputs' first.
_PLACES = {
    "accelerometer": (0, 27, 0, 4),
    "gyroscope": (9, 30, 9, 1),
    "g-sensitivity": (18, 18, 9, 4),
    "lever arm": (33, 33, -1, 0),
    "time offset": (36, 36, -1, 0),
}


@dataclass(frozen=True)
class SensorState:
    """One state of a filter beside position, velocity and attitude.

    The corrected samples that the filter is given are taken as ``(1 + E) true + bias`` (and a rate's
    ``+ G specific_force``): a state is an entry of E, of G, or a part of a bias; or of the lever arm, or the
    time offset.

    Attributes
    ----------
    kind : of `KINDS`.
    row : axis (0 to 2) of the sensor.
    column : axis of the input, for an entry of a matrix; -1 for a bias.
    sigma : one standard deviation at the start: m/s² or rad/s, 1, (rad/s)/(m/s²), m, s.
    decay : 1/s, one over the correlation time of a Gauss-Markov process; zero for what stays or walks.
    drive : two-sided density of the white noise that drives it, unit² / s.
    name : in words.
    """

    kind: str
    row: int
    column: int
    sigma: float
    decay: float = 0.0
    drive: float = 0.0
    name: str = ""

    @property
    def place(self) -> tuple[int, int, int]:
        """Which of the samples' parameters it adds to, which output it acts on, by what (the compiled loops say)."""
        of_matrix, of_bias, output, by = _PLACES[self.kind]
        if self.column < 0:
            return of_bias + self.row, output + self.row if output >= 0 else -1, 0
        return of_matrix + 3 * self.row + self.column, output + self.row, by + self.column


@dataclass(frozen=True)
class TriadSpread:
    """How well a triad is known, one sigma an axis; at zero the filter has no such states.

    Attributes
    ----------
    bias : m/s² or rad/s.
    scale_factor : 1.
    non_orthogonality : rad, of the axes y and z against x, and of z against y: three states.
    misalignment : rad, of each axis about each other one: six states, instead of `non_orthogonality`.
    """

    bias: float = 0.0
    scale_factor: float = 0.0
    non_orthogonality: float = 0.0
    misalignment: float = 0.0


def sensor_states(
    accelerometer: TriadSpread,
    gyroscope: TriadSpread,
    *,
    accelerometer_noise: Sequence[NoiseModel],
    gyroscope_noise: Sequence[NoiseModel],
    g_sensitivity: float = 0.0,
    lever_arm: float = 0.0,
    time_offset: float = 0.0,
) -> tuple[SensorState, ...]:
    """Return a filter's sensor states: 18 of both triads, and what else is asked for.

    Parameters
    ----------
    accelerometer, gyroscope : what is known at the start.
    accelerometer_noise, gyroscope_noise : of each axis (three), whose rate random walk drives the bias. Each of
        its Gauss-Markov processes becomes a state; bias instability is left out.
    g_sensitivity : (rad/s)/(m/s²), one sigma of nine states, or zero for none.
    lever_arm : m, one sigma of three states, or zero for none.
    time_offset : s, one sigma of a state, or zero for none.

    Raises
    ------
    UsageError
        If there are not three noise models a triad, or a sigma is negative.
    """
    states: list[SensorState] = []
    triads = ((accelerometer, accelerometer_noise), (gyroscope, gyroscope_noise))
    for kind, (spread, noise) in zip(KINDS, triads, strict=False):
        if len(noise) != 3:
            raise UsageError(
                f"A triad has three axes, and noise was given of {len(noise)}: give one model each."
            )
        states += _triad_states(kind, spread, noise)
    for r in range(3):
        for c in range(3):
            name = f"g-sensitivity {AXES[r]}{AXES[c]}"
            states.append(SensorState("g-sensitivity", r, c, g_sensitivity, name=name))
    states += [SensorState("lever arm", r, -1, lever_arm, name=f"lever arm {AXES[r]}") for r in range(3)]
    states.append(SensorState("time offset", 0, -1, time_offset, name="time offset"))
    if any(state.sigma < 0.0 for state in states):
        raise UsageError("A standard deviation of a filter's state is negative: give zero or more.")
    return tuple(state for state in states if state.sigma > 0.0 or state.drive > 0.0)


def covariance_of(states: Sequence[SensorState]) -> Table:
    """Return the diagonal covariance of states at their own sigmas."""
    return np.diag([state.sigma**2 for state in states]).astype(float).reshape(len(states), len(states))


def covariance_from_calibration(
    states: Sequence[SensorState],
    model: ImuModel,
    names: Sequence[str],
    covariance: Table,
) -> Table:
    """Return the covariance of a filter's states at its start, as a calibration leaves them.

    The samples are corrected by the model, of whose entries the covariance is known: with ``raw = M true + b``
    the errors left are ``E = inverse(M) (M_true - M)`` and ``bias = inverse(M) (b_true - b)``. States that the
    calibration does not know keep their own sigma.

    Parameters
    ----------
    states : of the filter.
    model : with which the samples are corrected.
    names, covariance : as `calibration.json` has them: "accelerometer.matrix[0,1]", "gyroscope.bias[2]", ...

    Raises
    ------
    UsageError
        If the covariance is not of as many parameters as there are names.
    """
    if covariance.shape != (len(names), len(names)):
        raise UsageError(
            f"A covariance of shape {covariance.shape} does not belong to {len(names)} parameters: give a square one."
        )
    derivatives = np.zeros((len(states), len(names)))
    known = np.zeros(len(states), dtype=bool)
    index = {name: at for at, name in enumerate(names)}
    for at, state in enumerate(states):
        if state.decay > 0.0 or state.kind not in ("accelerometer", "gyroscope", "g-sensitivity"):
            continue
        for name, slope in _entries_of(state, model):
            if name in index:
                derivatives[at, index[name]] = slope
                known[at] = True
    result = derivatives @ covariance @ derivatives.T
    own = covariance_of(states)
    result[~known, ~known] = np.diag(own)[~known]
    return result


def _entries_of(state: SensorState, model: ImuModel) -> list[tuple[str, float]]:
    """The parameters that a state depends on, with its derivatives by them."""
    triad = model.accelerometer if state.kind == "accelerometer" else model.gyroscope
    if triad is None:
        return []
    inverse = inverted(triad.matrix)
    word = "accelerometer" if state.kind == "accelerometer" else "gyroscope"
    what = "g_sensitivity" if state.kind == "g-sensitivity" else "matrix"
    slopes = inverse[state.row]
    if state.column < 0:
        return [(f"{word}.bias[{k}]", float(slopes[k])) for k in range(3)]
    return [(f"{word}.{what}[{k},{state.column}]", float(slopes[k])) for k in range(3)]


def _triad_states(kind: str, spread: TriadSpread, noise: Sequence[NoiseModel]) -> list[SensorState]:
    states: list[SensorState] = []
    for r in range(3):
        walk = noise[r].rate_random_walk
        states.append(SensorState(kind, r, -1, spread.bias, 0.0, walk**2, f"{kind} bias {AXES[r]}"))
    for r in range(3):
        for process in noise[r].gauss_markov:
            time, sigma = process.correlation_time, process.sigma
            name = f"{kind} bias {AXES[r]}, {time:.3g} s"
            states.append(SensorState(kind, r, -1, sigma, 1.0 / time, 2.0 * sigma**2 / time, name))
    for r in range(3):
        states.append(SensorState(kind, r, r, spread.scale_factor, name=f"{kind} scale {AXES[r]}"))
    full = spread.misalignment > 0.0
    pairs = [(r, c) for r in range(3) for c in range(3) if (r != c if full else r > c)]
    sigma = spread.misalignment if full else spread.non_orthogonality
    word = "misalignment" if full else "non-orthogonality"
    states += [SensorState(kind, r, c, sigma, name=f"{kind} {word} {AXES[r]}{AXES[c]}") for r, c in pairs]
    return states


Noise = NoiseModel | tuple[NoiseModel, NoiseModel, NoiseModel]
"""Of all three axes alike, or of each."""


@dataclass(frozen=True)
class FilterSetup:
    """A filter's states, their covariance at the start, and its noise.

    Attributes
    ----------
    states : beyond the nine of position, velocity and attitude, in order.
    sensor_covariance : (states, states) at the start, in the states' units.
    navigation_covariance : (9, 9) of position (m), velocity (m/s) and attitude (rad), in n.
    angle_random_walk, velocity_random_walk : (3,) rad/√s and m/s/√s, root of the two-sided density, an axis each.
    lever_arm_b : (3,) m, from the IMU to the antenna.
    gate : probability below which a fix's innovation is taken for an outlier's (chi-square of three).
    patience : fixes in a row that may be refused; the next is taken for as good as it fits.
    block : s over which the transition is gathered before the covariance is carried on.
    whole_covariance : (9 + states, 9 + states) at the start with the correlations between navigation and sensors,
        as a fine alignment leaves it; None for what the two others say.
    """

    states: tuple[SensorState, ...]
    sensor_covariance: Table
    navigation_covariance: Table
    angle_random_walk: Vector
    velocity_random_walk: Vector
    lever_arm_b: Vector = field(default_factory=lambda: np.zeros(3))
    gate: float = 1e-5
    patience: int = 3
    block: float = 0.1
    whole_covariance: Table | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Every state in words, the nine of navigation first."""
        nine = [f"{what} {axis}" for what in ("position", "velocity") for axis in ("north", "east", "down")]
        nine += [f"attitude {axis}" for axis in ("north", "east", "down")]
        return (*nine, *(state.name for state in self.states))

    @property
    def places(self) -> np.ndarray:
        """(states, 3) of each sensor state: which of the samples' parameters it adds to, for the compiled loops."""
        return np.array([state.place for state in self.states], np.int64).reshape(-1, 3)

    @property
    def nominal(self) -> Series:
        """(37,) parameters of samples that are right as they are, with the lever arm, for the compiled loops."""
        unit = np.eye(3).ravel()
        return np.concatenate([unit, unit, np.zeros(15), self.lever_arm_b, [0.0]], dtype=np.float64)

    @property
    def covariance(self) -> Table:
        """Of all states at the start; without `whole_covariance` navigation and sensors are independent there."""
        if self.whole_covariance is not None:
            return self.whole_covariance.copy()
        count = 9 + len(self.states)
        whole = np.zeros((count, count))
        whole[:9, :9] = self.navigation_covariance
        whole[9:, 9:] = self.sensor_covariance
        return whole

    def with_start(
        self, position: float | Vector, velocity: float | Vector, attitude: float | Vector
    ) -> FilterSetup:
        """Return the setup with the start's standard deviations: m, m/s, rad; one number or three in n each."""
        sigmas = np.concatenate([np.broadcast_to(x, 3) for x in (position, velocity, attitude)])
        return replace(self, navigation_covariance=np.diag(sigmas.astype(float) ** 2), whole_covariance=None)

    def with_sensor_covariance(self, covariance: Table) -> FilterSetup:
        """Return the setup with another covariance of its sensor states at the start.

        Raises
        ------
        UsageError
            If it has another size than there are states.
        """
        if covariance.shape != self.sensor_covariance.shape:
            raise UsageError(
                f"{len(self.states)} sensor states take a covariance of as many rows, not {len(covariance)}."
            )
        return replace(self, sensor_covariance=covariance, whole_covariance=None)


def plan_filter(
    accelerometer_noise: Noise,
    gyroscope_noise: Noise,
    *,
    accelerometer: TriadSpread | None = None,
    gyroscope: TriadSpread | None = None,
    lever_arm_b: Vector | None = None,
    lever_arm_sigma: float = 0.0,
    time_offset_sigma: float = 0.0,
    g_sensitivity: float = 0.0,
) -> FilterSetup:
    """Return a filter's setup from what is known of the unit's noise and errors.

    Parameters
    ----------
    accelerometer_noise, gyroscope_noise : of whose terms white noise, rate random walk, Gauss-Markov processes
        are used.
    accelerometer, gyroscope : what is known of each triad at the start; None for no states of its matrix, and a
        bias only where the noise drives one.
    lever_arm_b : (3,) m from the IMU to the antenna; None for zero.
    lever_arm_sigma, time_offset_sigma, g_sensitivity : as for `sensor_states`.

    Raises
    ------
    UsageError
        If a sigma is negative.
    """
    forces = (
        (accelerometer_noise,) * 3 if isinstance(accelerometer_noise, NoiseModel) else accelerometer_noise
    )
    rates = (gyroscope_noise,) * 3 if isinstance(gyroscope_noise, NoiseModel) else gyroscope_noise
    states = sensor_states(
        accelerometer or TriadSpread(),
        gyroscope or TriadSpread(),
        accelerometer_noise=forces,
        gyroscope_noise=rates,
        g_sensitivity=g_sensitivity,
        lever_arm=lever_arm_sigma,
        time_offset=time_offset_sigma,
    )
    return FilterSetup(
        states=states,
        sensor_covariance=covariance_of(states),
        navigation_covariance=np.diag([1.0] * 3 + [0.1] * 3 + [0.01, 0.01, 0.1]) ** 2,
        angle_random_walk=np.array([model.random_walk for model in rates]),
        velocity_random_walk=np.array([model.random_walk for model in forces]),
        lever_arm_b=np.zeros(3) if lever_arm_b is None else lever_arm_b,
    )
