"""Attitude integration over turns, with the sensitivities that an adjustment needs.

The rate is taken as linear in time between samples, which makes each step's rotation vector the
mean rate times the step plus the coning term ``step**2 / 12 * cross(rate_before, rate_now)``
(Bortz 1971; third order in the step). Steps are composed exactly.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors
from tumble.records import dataclass


@dataclass(frozen=True)
class IntegratedTurns:
    """Rotations over a set of turns and what moves them.

    Attributes
    ----------
    C_start_end : (turns, 3, 3) from the body frame at a turn's end to that at its start.
    sums : (turns, 3, 3, 7) integrals of ``C_start_t`` times a regressor: the corrected rate
        (0 to 2), one (3), the corrected specific force (4 to 6). A rate error ``E @ x(t)`` turns
        ``C_start_end`` by the rotation vector ``sums[..., j] @ E[:, j]``, in the start frame.
    duration : (turns,) seconds between the first and the last sample.
    """

    C_start_end: Matrices
    sums: AnyArray
    duration: Series


class Inverse(NamedTuple):
    """What makes true numbers of raw ones, ``gyro @ (raw - gyro_bias - G f)`` and alike; as it is, they are true.

    Attributes
    ----------
    gyro, gyro_bias : (3, 3) rad/s per raw unit, and (3,) raw units, or (windows, 3).
    force, force_bias : (3, 3) m/s² per raw unit, and (3,) raw units.
    g_sensitivity : (3, 3) raw gyro units per m/s², acting on the corrected specific force.
    """

    gyro: Matrix = np.eye(3)
    gyro_bias: Vector | Vectors = np.zeros(3)
    force: Matrix = np.eye(3)
    force_bias: Vector = np.zeros(3)
    g_sensitivity: Matrix = np.zeros((3, 3))


def integrate_turns(
    time: Series,
    raw_rate: Vectors,
    raw_force: Vectors,
    starts: np.ndarray,
    stops: np.ndarray,
    inverse: Inverse,
) -> IntegratedTurns:
    """Integrate the corrected angular rate over each turn.

    Parameters
    ----------
    time : (samples,) s.
    raw_rate, raw_force : (samples, 3) raw units.
    starts, stops : (turns,) half-open sample ranges; a turn runs from the first to the last sample.
    inverse : what makes true numbers of them.

    Raises
    ------
    IndexError
        If a range is empty or leaves the samples.
    ValueError
        If time, rates and forces are not equally long.
    """
    from tumble.attitude.kernels import integrate_segments

    first, last = _ranges(starts, stops, time, raw_rate, raw_force)
    C = np.empty((first.size, 3, 3))
    sums = np.empty((first.size, 3, 3, 7))
    gyro, bias, force, force_bias, sensitivity = map(np.ascontiguousarray, inverse)
    t, w, f = map(np.ascontiguousarray, (time, raw_rate, raw_force))
    integrate_segments(t, w, f, gyro, bias, sensitivity, force, force_bias, first, last, C, sums)
    return IntegratedTurns(C, sums, time[last - 1] - time[first])


def average_at_edge(
    time: Series,
    raw_rate: Vectors,
    raw_force: Vectors,
    windows: np.ndarray,
    inverse: Inverse,
    edge: Literal["first", "last"],
) -> Vectors:
    """Return the mean corrected specific force of each window, each sample turned to its edge.

    Parameters
    ----------
    windows : (windows, 2) half-open sample ranges at rest.
    inverse : with (windows, 3) gyro biases: a window's own mean rate turns by the deviations from it only.
    edge : the sample in whose body frame the mean is given.

    Raises
    ------
    IndexError
        If a range is empty or leaves the samples.
    ValueError
        If time, rates and forces are not equally long, or if there is not one gyro bias a window.
    """
    from tumble.attitude.kernels import average_windows

    first, last = _ranges(windows[:, 0], windows[:, 1], time, raw_rate, raw_force)
    if inverse.gyro_bias.shape != (*windows.shape[:1], 3):
        raise ValueError(
            f"{first.size} windows want as many gyro biases, not shape {inverse.gyro_bias.shape}"
        )
    means = np.empty((first.size, 3))
    t, w, f = map(np.ascontiguousarray, (time, raw_rate, raw_force))
    gyro, bias, force, force_bias, _ = map(np.ascontiguousarray, inverse)
    average_windows(t, w, f, gyro, bias, force, force_bias, first, last, edge == "first", means)
    return means


def _ranges(
    starts: np.ndarray, stops: np.ndarray, time: Series, raw_rate: Vectors, raw_force: Vectors
) -> tuple[np.ndarray, np.ndarray]:
    """Return both index arrays as int64, refusing what a kernel would read outside of."""
    samples = time.shape[0]
    if raw_rate.shape != (samples, 3) or raw_force.shape != (samples, 3):
        raise ValueError(
            f"{samples} stamps want as many rates and forces, "
            f"not shapes {raw_rate.shape} and {raw_force.shape}"
        )
    first, last = np.asarray(starts, dtype=np.int64), np.asarray(stops, dtype=np.int64)
    if first.shape != last.shape:
        raise ValueError(f"{first.size} starts and {last.size} stops of sample ranges do not pair up")
    if np.any(first < 0) or np.any(last > samples) or np.any(last <= first):
        raise IndexError(f"sample ranges must be non-empty and inside 0 to {samples}")
    return first, last
