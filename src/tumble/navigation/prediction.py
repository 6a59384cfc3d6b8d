"""What a calibration's covariance and the noise become in free navigation, and which states a filter should carry.

Errors go through the filter's own transition along a trajectory whose true specific force and rate are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.navigation.filter import FilterSetup, run_filter
from tumble.navigation.gnss.track import make_track
from tumble.navigation.samples import InertialSamples
from tumble.navigation.trajectory import NavigationState
from tumble.records import dataclass

# A filter carries a state that makes more than this share of the variance of an error.
_SHARE = 0.01
# Errors of which a state may make a share: horizontal and vertical position, tilt, heading.
_JUDGED = ([0, 1], [2], [6, 7], [8])


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class PredictedErrors:
    """Covariances of errors of free navigation; nine of them are position (m), velocity (m/s), attitude (rad), in n.

    Attributes
    ----------
    seconds : (lengths,) s, ascending.
    calibration : (lengths, 9, 9) of what the sensor states' uncertainty at the start does.
    noise : (lengths, 9, 9) of what the noise does, wandering biases included.
    states : advice on every sensor state, in the filter's order.
    """

    seconds: Series
    calibration: AnyArray
    noise: AnyArray
    states: list[StateAdvice]


def predict_errors(
    samples: InertialSamples, start: NavigationState, setup: FilterSetup, seconds: Sequence[float]
) -> PredictedErrors:
    """Return the covariances of free navigation's errors after some times, and which states make them.

    Parameters
    ----------
    samples : true specific force and rate along a trajectory, in b.
    start : of the trajectory, known exactly: what its own uncertainty does comes on top.
    setup : with all candidates as states, their covariance at the start, and the noise.
    seconds : s after the start, inside the trajectory.
    """
    lengths = np.sort(np.asarray(seconds, dtype=float))
    noise, by_state = _propagated(samples, start, setup, lengths)
    sigma = np.sqrt(np.maximum(np.diag(setup.sensor_covariance), 0.0))
    calibration = by_state @ setup.sensor_covariance @ by_state.transpose(0, 2, 1)
    shares = _shares(by_state * sigma, calibration + noise)
    states: list[StateAdvice] = []
    for state, own, share in zip(setup.states, sigma.tolist(), shares.tolist(), strict=True):
        walk = float(np.sqrt(state.drive)) if state.decay == 0.0 else 0.0
        carry = share > _SHARE or walk > 0.0
        states.append(StateAdvice(state.name, state.kind, state.row, state.column, own, walk, share, carry))
    return PredictedErrors(lengths, calibration, noise, states)


def _shares(alone: AnyArray, total: AnyArray) -> Series:
    """(states,) largest share of an error's variance, of (lengths, 9, states) and (lengths, 9, 9)."""
    parts, wholes = alone**2, np.einsum("kii->ki", total)
    each = [
        parts[:, rows].sum(axis=1) / np.maximum(wholes[:, rows].sum(axis=1), 1e-300)[:, None]
        for rows in _JUDGED
    ]
    return np.max(each, axis=(0, 1))


def _propagated(
    samples: InertialSamples, start: NavigationState, setup: FilterSetup, seconds: Series
) -> tuple[AnyArray, AnyArray]:
    """(lengths, 9, 9) covariances of what noise does, and (lengths, 9, states) what sensor states do."""
    count = len(setup.states)
    known = setup.with_sensor_covariance(np.zeros((count, count)))
    own = replace(known, navigation_covariance=np.zeros((9, 9)))
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
