"""Attitude integration over turns, with the sensitivities that an adjustment needs.

The rate is taken as linear in time between samples, which makes each step's rotation vector the
mean rate times the step plus the coning term ``step**2 / 12 * cross(rate_before, rate_now)``
(Bortz 1971; third order in the step). Steps are composed exactly.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
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


def integrate_turns(
    time: Series,
    raw_rate: Vectors,
    raw_force: Vectors,
    starts: np.ndarray,
    stops: np.ndarray,
    *,
    gyro_inverse: Matrix,
    gyro_bias: Vector,
    force_inverse: Matrix,
    force_bias: Vector,
    g_sensitivity: Matrix | None = None,
) -> IntegratedTurns:
    """Integrate the corrected angular rate over each turn.

    Parameters
    ----------
    time : (samples,) s.
    raw_rate, raw_force : (samples, 3) raw units.
    starts, stops : (turns,) half-open sample ranges; a turn runs from the first to the last sample.
    gyro_inverse : (3, 3) rad/s per raw unit; corrected rate = gyro_inverse @ (raw - bias - G f).
    gyro_bias : (3,) raw units.
    force_inverse, force_bias : (3, 3) m/s² per raw unit and (3,) raw units.
    g_sensitivity : (3, 3) raw gyro units per m/s², acting on the corrected specific force.

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
    integrate_segments(
        np.ascontiguousarray(time),
        np.ascontiguousarray(raw_rate),
        np.ascontiguousarray(raw_force),
        np.ascontiguousarray(gyro_inverse),
        np.ascontiguousarray(gyro_bias),
        np.zeros((3, 3)) if g_sensitivity is None else np.ascontiguousarray(g_sensitivity),
        np.ascontiguousarray(force_inverse),
        np.ascontiguousarray(force_bias),
        first,
        last,
        C,
        sums,
    )
    return IntegratedTurns(C, sums, time[last - 1] - time[first])


def average_at_edge(
    time: Series,
    raw_rate: Vectors,
    raw_force: Vectors,
    starts: np.ndarray,
    stops: np.ndarray,
    *,
    edge: str,
    gyro_inverse: Matrix,
    gyro_bias: Vectors,
    force_inverse: Matrix,
    force_bias: Vector,
) -> Vectors:
    """Return the mean corrected specific force of each window, each sample turned to its edge.

    Parameters
    ----------
    starts, stops : (windows,) half-open sample ranges at rest.
    edge : "first" or "last": the sample in whose body frame the mean is given.
    gyro_bias : (windows, 3) raw; a window's own mean rate turns by the deviations from it only.
    gyro_inverse, force_inverse, force_bias : as in `integrate_turns`.

    Raises
    ------
    IndexError
        If a range is empty or leaves the samples.
    ValueError
        If `edge` is neither "first" nor "last", if time, rates and forces are not equally long, or if
        there is not one gyro bias a window.
    """
    from tumble.attitude.kernels import average_windows

    if edge not in ("first", "last"):
        raise ValueError(f"edge is {edge!r}, not 'first' or 'last'")
    first, last = _ranges(starts, stops, time, raw_rate, raw_force)
    if gyro_bias.shape != (first.size, 3):
        raise ValueError(f"{first.size} windows want as many gyro biases, not shape {gyro_bias.shape}")
    means = np.empty((first.size, 3))
    average_windows(
        np.ascontiguousarray(time),
        np.ascontiguousarray(raw_rate),
        np.ascontiguousarray(raw_force),
        np.ascontiguousarray(gyro_inverse),
        np.ascontiguousarray(gyro_bias),
        np.ascontiguousarray(force_inverse),
        np.ascontiguousarray(force_bias),
        first,
        last,
        edge == "first",
        means,
    )
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
