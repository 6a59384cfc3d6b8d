"""Which sensor errors a filter estimates, how large they are at its start and how they wander."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Table, inverted
from tumble.errors import UsageError
from tumble.noise.terms import NoiseModel
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
    word = {"accelerometer": "accelerometer", "gyroscope": "gyroscope", "g-sensitivity": "gyroscope"}[
        state.kind
    ]
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
