"""What a calibration's covariance and the noise become in free navigation, parameter by parameter.

The errors of a calibration's parameters are carried along a trajectory by the mechanisation itself: samples are
corrected with one parameter moved a little to either side, and navigated. That is the error-state transition to the
first order, for every term that the sensor model has. Noise goes through the filter's transition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.errors import UsageError
from tumble.navigation.filter import FilterSetup, run_filter
from tumble.navigation.gnss.track import make_track
from tumble.navigation.mechanisation import navigate
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import NavigationState, Trajectory
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad

# Of a parameter's sigma, by which it is moved: small against what bends, large against round-off.
_STEP = 0.01
# A filter carries a state that makes more than this share of the variance of an error.
_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class PredictedErrors:
    """Covariances of errors of free navigation; nine of them are position (m), velocity (m/s), attitude (rad), in n.

    Attributes
    ----------
    seconds : (lengths,) s.
    names : of the parameters.
    by_parameter : (lengths, 9, parameters) error for an error of one unit of each.
    covariance : (parameters, parameters) of the calibration.
    noise : (lengths, 9, 9) of what the noise does, wandering biases included.
    """

    seconds: Series
    names: tuple[str, ...]
    by_parameter: AnyArray
    covariance: Square
    noise: AnyArray

    @property
    def calibration(self) -> AnyArray:
        """(lengths, 9, 9) of what the calibration's uncertainty does."""
        return self.by_parameter @ self.covariance @ self.by_parameter.transpose(0, 2, 1)

    @property
    def total(self) -> AnyArray:
        """(lengths, 9, 9) of both."""
        return self.calibration + self.noise

    def of_each(self) -> AnyArray:
        """Return (lengths, 9, parameters) error of each parameter's own sigma."""
        return self.by_parameter * np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, slots=True)
class StateAdvice:
    """Whether a filter should carry a sensor state.

    Attributes
    ----------
    name, kind, row, column : as `SensorState` has them.
    sigma : at the start, SI.
    walk : SI/√s, of a bias that wanders; zero for none.
    share : largest share of the variance of an error (horizontal or vertical position, tilt, heading) that it makes,
        over all lengths; without a filter's help.
    carry : whether that is enough to be worth a state.
    """

    name: str
    kind: str
    row: int
    column: int
    sigma: float
    walk: float
    share: float
    carry: bool


def predict_errors(
    samples: InertialSamples,
    start: NavigationState,
    model: ImuModel,
    names: Sequence[str],
    covariance: Square,
    setup: FilterSetup,
    seconds: Sequence[float],
) -> PredictedErrors:
    """Return the covariances of free navigation's errors after some times.

    Parameters
    ----------
    samples : true specific force and rate along a trajectory, in b.
    start : of the trajectory, known exactly: what its own uncertainty does comes on top.
    model : of the unit, both triads.
    names, covariance : parameters as `calibration.json` has them, with turn-on and all.
    setup : of a filter without sensor states but those of wandering biases, for its noise.
    seconds : s after the start.

    Raises
    ------
    UsageError
        If a time lies outside the trajectory, or a parameter's name is unknown.
    """
    lengths = np.sort(np.asarray(seconds, dtype=float))
    if not lengths[0] > 0.0 or start.time + lengths[-1] > samples.time[-1] + 1e-6:
        raise UsageError(
            f"The trajectory lasts {samples.time[-1] - start.time:.0f} s, and errors were asked for after "
            f"{lengths[0]:g} to {lengths[-1]:g} s: give times inside it."
        )
    raw = model.distort(samples.specific_force_b, samples.angular_rate_ib_b)
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    found = np.zeros((len(lengths), 9, len(names)))
    for at, (name, sigma) in enumerate(zip(names, sigmas, strict=True)):
        if sigma == 0.0:
            continue
        step = _STEP * float(sigma)
        ends = [
            _navigated(samples, raw, moved(model, name, sign * step), start, lengths) for sign in (1.0, -1.0)
        ]
        position, velocity, attitude = ends[0].errors_against(ends[1])
        # the corrected samples err by the negative of the parameter's error: model less truth is what is asked
        found[:, :, at] = np.hstack([position, velocity, attitude]) / (2.0 * step)
    noise = propagated_noise(samples, start, setup, lengths)[0]
    return PredictedErrors(lengths, tuple(names), found, covariance, noise)


def propagated_noise(
    samples: InertialSamples, start: NavigationState, setup: FilterSetup, seconds: Series
) -> tuple[AnyArray, AnyArray]:
    """Return (lengths, 9, 9) covariances of what noise does, and (lengths, 9, states) what sensor states do.

    Parameters
    ----------
    samples, start : of the trajectory.
    setup : whose states start known exactly.
    seconds : (lengths,) s after the start.
    """
    count = len(setup.states)
    own = replace(
        setup.with_sensor_covariance(np.zeros((count, count))), navigation_covariance=np.zeros((9, 9))
    )
    instants = start.time + seconds
    far = np.array([float(samples.time[-1])])
    here = (np.array([start.latitude]), np.array([start.longitude]), np.array([start.height]))
    nowhere = make_track(far, here, np.ones((1, 3)))
    run = run_filter(samples, nowhere, start, own, positions=False, instants=instants, keep_covariances=True)
    rows = [int(np.argmin(np.abs(run.time - instant))) for instant in instants]
    whole = np.eye(9 + count)
    carried: list[Table] = []
    for row in range(len(run.time)):
        whole = run.transitions[row] @ whole
        carried.append(whole[:9, 9:])
    return run.covariances[rows][:, :9, :9], np.array([carried[row] for row in rows])


def advise_states(
    samples: InertialSamples,
    start: NavigationState,
    setup: FilterSetup,
    seconds: Sequence[float],
) -> list[StateAdvice]:
    """Return which sensor states a filter should carry, with their sigmas at the start.

    Parameters
    ----------
    samples, start : of a trajectory.
    setup : with all candidates as states, their covariance at the start, and the noise.
    seconds : s over which the filter may be left alone.
    """
    lengths = np.sort(np.asarray(seconds, dtype=float))
    noise, by_state = propagated_noise(samples, start, setup, lengths)
    sigma = np.sqrt(np.maximum(np.diag(setup.sensor_covariance), 0.0))
    alone = by_state * sigma
    total = by_state @ setup.sensor_covariance @ by_state.transpose(0, 2, 1) + noise
    result: list[StateAdvice] = []
    groups = ([0, 1], [2], [6, 7], [8])
    for at, state in enumerate(setup.states):
        share = 0.0
        for rows in groups:
            part = np.sum(alone[:, rows, at] ** 2, axis=1)
            whole = np.sum([total[:, row, row] for row in rows], axis=0)
            share = max(share, float(np.max(part / np.maximum(whole, 1e-300))))
        walk = float(np.sqrt(state.drive)) if state.decay == 0.0 else 0.0
        carry = share > _SHARE or walk > 0.0
        result.append(
            StateAdvice(state.name, state.kind, state.row, state.column, float(sigma[at]), walk, share, carry)
        )
    return result


def moved(model: ImuModel, name: str, by: float) -> ImuModel:
    """Return a model with one of its parameters changed.

    Parameters
    ----------
    model : with the term.
    name : as `calibration.json` has it, such as "gyroscope.matrix[0,2]".
    by : in the parameter's unit.

    Raises
    ------
    UsageError
        If there is no such parameter.
    """
    word, _, inside = name.rstrip("]").partition("[")
    kind, _, what = word.partition(".")
    triad = {"accelerometer": model.accelerometer, "gyroscope": model.gyroscope}.get(kind)
    try:
        at = tuple(int(part) for part in inside.split(","))
        if triad is None:
            raise KeyError(kind)
        if what == "g_sensitivity" and kind == "gyroscope":
            before = np.zeros((3, 3)) if model.g_sensitivity is None else model.g_sensitivity
            return replace(model, g_sensitivity=_changed(before, at, by))
        before = {"matrix": triad.matrix, "bias": triad.bias}.get(what)
        if what in ("asymmetry", "quadratic"):
            before = getattr(triad, what)
            before = np.zeros(3) if before is None else before
        if before is None:
            raise KeyError(what)
        other: Triad = replace(triad, **{what: _changed(before, at, by)})
    except (KeyError, ValueError, IndexError) as error:
        raise UsageError(f"There is no parameter {name!r} in a calibration's covariance.") from error
    if kind == "accelerometer":
        return replace(model, accelerometer=other)
    return replace(model, gyroscope=other)


def _changed(values: AnyArray, at: tuple[int, ...], by: float) -> AnyArray:
    result = np.array(values, dtype=float)
    result[at] += by
    return result


def _navigated(
    samples: InertialSamples,
    raw: tuple[AnyArray, AnyArray],
    model: ImuModel,
    start: NavigationState,
    seconds: Series,
) -> Trajectory:
    force, rate = model.correct(*raw)
    run = navigate(InertialSamples(samples.time, force, rate, samples.means), start)
    return run.rows(np.array([int(np.argmin(np.abs(run.time - start.time - t))) for t in seconds]))
