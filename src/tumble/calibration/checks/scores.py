"""How well a calibration does on holds and turns, its own or others': norms and carried gravity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrices, Matrix, Series, Vectors, inverted, range_means
from tumble.attitude import Inverse, angle_between, integrate_turns
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns, window_directions
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad

# A turn smaller than this says nothing of scale factors.
SMALLEST_TURN = np.radians(5.0)


@dataclass(frozen=True)
class TurnScores:
    """Scores of turns, one row a hold (the turn after it); nan where there is none to judge.

    Attributes
    ----------
    angle : (holds,) rad between gravity carried by the corrected gyro and gravity seen.
    size : (holds,) rad, how far the turn went.
    duration : (holds,) s.
    """

    angle: Series
    size: Series
    duration: Series


def hold_norm_errors(model: ImuModel, means: Vectors, gravity: float) -> Series:
    """Return (holds,) the corrected mean's norm minus gravity, m/s².

    Raises
    ------
    ValueError
        If the model has no accelerometer.
    """
    if model.accelerometer is None:
        raise ValueError("the model has no accelerometer")
    return np.linalg.norm(model.accelerometer.correct(means), axis=1) - gravity


def hold_norm_variances(triad: Triad, means: Vectors, covariance: Matrices) -> Series:
    """Return (holds,) (m/s²)², variances of the corrected means' norms by what the means are uncertain by.

    Parameters
    ----------
    triad, means, covariance : as for `holds_evidence`.
    """
    corrected = triad.correct(means)
    along = (corrected / np.linalg.norm(corrected, axis=1, keepdims=True)) @ inverted(triad.matrix)
    return np.einsum("ka,kab,kb->k", along, covariance, along)


def angle_off(angle: float) -> str:
    """Return in words by what angle a turn misses; one under `SMALLEST_TURN` has none.

    Parameters
    ----------
    angle : rad, or not a number.
    """
    if np.isfinite(angle):
        return f"{np.degrees(angle):.2f}° off"
    return f"elsewhere after less than {np.degrees(SMALLEST_TURN):.0f}°"


def score_turns(model: ImuModel, data: HoldsAndTurns) -> TurnScores:
    """Carry gravity over each turn with the model's own constant bias and compare.

    Each end is the mean of a window at the hold's edge (`gathering.EDGE_WINDOW`), every sample turned
    to the edge by the corrected gyro; the gyro is integrated between the edges. Turns under 5 degrees
    are not scored.

    Raises
    ------
    ValueError
        If the model lacks a triad.
    """
    if model.accelerometer is None or model.gyroscope is None:
        raise ValueError("turns need both triads in the model")
    accelerometer, gyroscope = model.accelerometer, model.gyroscope
    gyro_inverse: Matrix = inverted(gyroscope.matrix)
    sensitivity = np.zeros((3, 3)) if model.g_sensitivity is None else model.g_sensitivity

    angle, size, duration = (np.full(data.holds, np.nan) for _ in range(3))
    turns = np.flatnonzero(data.turn_start >= 0)
    if turns.size == 0:
        return TurnScores(angle, size, duration)
    # Quadratic terms and asymmetries are taken out of the raw numbers first: the kernels know matrix and bias.
    force, rate = _straight(accelerometer, data.raw_force), _straight(gyroscope, data.raw_rate)
    start, stop = data.turn_start[turns], data.turn_stop[turns]
    inverse = Inverse(
        gyro_inverse, gyroscope.bias, inverted(accelerometer.matrix), accelerometer.bias, sensitivity
    )
    integrated = integrate_turns(data.time, rate, force, start, stop, inverse)
    rest = gyroscope.bias + accelerometer.correct(data.force_mean) @ sensitivity.T
    straight = replace(data, raw_force=force, raw_rate=rate, rate_mean=rest)
    heads, tails = window_directions(straight, accelerometer.matrix, accelerometer.bias, gyro_inverse)
    C_se = integrated.C_start_end
    rates = (range_means(rate, np.column_stack([start, stop])) - gyroscope.bias) @ gyro_inverse.T
    duration[turns] = integrated.duration
    # A full circle ends where it began.
    size[turns] = np.maximum(
        np.arccos(np.clip(0.5 * (np.trace(C_se, axis1=1, axis2=2) - 1.0), -1.0, 1.0)),
        np.linalg.norm(rates, axis=1) * integrated.duration,
    )
    at_end = (C_se @ heads[turns + 1, :, None])[:, :, 0]
    for turn in np.flatnonzero(size[turns] >= SMALLEST_TURN).tolist():
        angle[turns[turn]] = angle_between(tails[turns[turn]], at_end[turn])
    return TurnScores(angle, size, duration)


def _straight(triad: Triad, raw: Vectors) -> Vectors:
    """Raw numbers as a triad of the same matrix and bias without asymmetry and quadratic terms would show them."""
    return raw if triad.is_straight else triad.own_input(raw) + triad.bias
