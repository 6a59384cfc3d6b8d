"""Rotation sequences in time: the integrals over each by which errors reach its measurements (Savage 2018, (17)).

An average at the end less one at the start sees an error of the attitude's rate, n(t), as ∫ h(t) n(t) dt: h
climbs from 0 to 1 over the first average, stays, and falls over the second. All integrals here are of h with
the attitude C(t) from the body frame to that of the sequence's start.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from tumble.arrays import Matrix, Series, Table, Vector
from tumble.attitude import matrix_from_rotation_vector, skew
from tumble.calibration.closed_forms.rotation_sequences import SequenceModel, sequence_model
from tumble.design.strapdown_setup import StrapdownSetup, Timing
from tumble.protocol.strapdown_rotation import (
    SEQUENCES,
    RotationSequence,
    fixture_rotation,
    start_down,
)
from tumble.records import dataclass
from tumble.sensor.conventions.savage import PAIRS

# Of one rotation: exact for a turn to rounding.
_NODES = 24
_GYRO_ERRORS = 9


@dataclass(frozen=True, slots=True)
class TimedSequence:
    """A sequence of the test with its integrals.

    Attributes
    ----------
    row : of table 1.
    model : coefficients of its measurements.
    towards : (3, 3) m/s² per rad: what an attitude error at the end does to Δa.
    seconds : s, ∫h, from the middle of one average to that of the other.
    square_seconds : s, ∫h², for white noise.
    attitude_integral : (3, 3) s, ∫h C: what a bias in the body does.
    earth_rate : (3,) rad/s, nominal, in the frame of the start.
    earth_by_gyro : (3, 9) rad per κ, κ asymmetry and υ: gyro errors on the Earth rate, bias at the start left in.
    rest_by_gyro : (3, 9) rad/s: the same errors' share of what the gyros show at rest before the rotations.
    force_integral : (3, 9) rad per g-sensitivity element, by rows: ∫h C G f.
    rest_force : (3,) m/s², specific force at the start.
    fixture_axes : (2, 3) inner and outer axis in the frame of the start.
    C_start_t : (3, 3) from the fixture's frame (y its outer axis, z down) to that of the start.
    """

    row: RotationSequence
    model: SequenceModel
    towards: Matrix
    seconds: float
    square_seconds: float
    attitude_integral: Matrix
    earth_rate: Vector
    earth_by_gyro: Table
    rest_by_gyro: Table
    force_integral: Table
    rest_force: Vector
    fixture_axes: Table
    C_start_t: Matrix


def timed_sequences(setup: StrapdownSetup) -> list[TimedSequence]:
    """Return the sequences of table 1 with the integrals of a planned test.

    Parameters
    ----------
    setup : site, timing and azimuth count; without asymmetry sequences 1a to 3a are left out.
    """
    rows = [row for row in SEQUENCES if setup.asymmetry or not row.name.endswith("a")]
    return [_timed(row, setup) for row in rows]


def _timed(row: RotationSequence, setup: StrapdownSetup) -> TimedSequence:
    timing, gravity = setup.timing, setup.site.gravity
    down = start_down(row)
    # From the fixture's frame t to the body's at the start; t is turned against north, east, down by the azimuth.
    C_start_t = np.asarray(fixture_rotation(row.inner, row.outer).inv().as_matrix(), dtype=np.float64)
    C_tn = matrix_from_rotation_vector(np.array([0.0, 0.0, 0.5 * np.pi - setup.azimuth]))
    earth = C_start_t @ C_tn @ setup.site.earth_rate_n
    model = sequence_model(row.rotations, down, gravity, rate=timing.rate, seconds=timing.seconds)
    nodes = _nodes(row.rotations, timing)
    attitude = np.zeros((3, 3))
    by_gyro, by_force = np.zeros((3, _GYRO_ERRORS)), np.zeros((3, 9))
    for weight, C, tilt, signs in nodes:
        attitude += weight * C
        by_gyro += weight * (C @ _gyro_errors(C.T @ earth, signs) - skew(earth) @ tilt)
        by_force += weight * np.einsum("ij,k->ijk", C, -gravity * C.T @ down).reshape(3, 9)
    between = sum(weight for weight, *_ in nodes) - timing.seconds
    return TimedSequence(
        row=row,
        model=model,
        towards=np.asarray(gravity * skew(down), dtype=np.float64),
        seconds=between + timing.seconds,
        square_seconds=between + 2.0 * timing.seconds * timing.square_share,
        attitude_integral=attitude,
        earth_rate=np.asarray(earth, dtype=np.float64),
        earth_by_gyro=by_gyro,
        rest_by_gyro=_gyro_errors(earth, np.zeros(3)),
        force_integral=by_force,
        rest_force=np.asarray(-gravity * down, dtype=np.float64),
        fixture_axes=np.array([C_start_t @ _inner_axis(row), C_start_t @ np.array([0.0, 1.0, 0.0])]),
        C_start_t=C_start_t,
    )


def _inner_axis(row: RotationSequence) -> Vector:
    """The inner axis in the fixture's frame at the start."""
    return np.asarray(fixture_rotation(0.0, row.outer).apply([0.0, 0.0, 1.0]), dtype=np.float64)


def _nodes(
    rotations: Sequence[tuple[int, float]], timing: Timing
) -> list[tuple[float, Matrix, Table, Vector]]:
    """Weights ∫h dt, attitudes, attitude errors per gyro error (3, 9), and signs of the rotation about each axis."""
    at, share = np.polynomial.legendre.leggauss(_NODES)
    still = np.zeros(3)
    attitude, tilt = np.eye(3), np.zeros((3, _GYRO_ERRORS))
    found = [(0.5 * timing.seconds + timing.pause, attitude, tilt, still)]
    for axis, angle in rotations:
        unit = np.eye(3)[axis]
        duration = abs(angle) / timing.rate
        for x, w in zip(at, share, strict=True):
            part = 0.5 * (x + 1.0) * angle
            here = attitude @ matrix_from_rotation_vector(part * unit)
            found.append(
                (0.5 * w * duration, here, tilt + attitude @ _turned(axis, part), np.sign(angle) * unit)
            )
        tilt = tilt + attitude @ _turned(axis, angle)
        attitude = attitude @ matrix_from_rotation_vector(angle * unit)
        found.append((timing.pause, attitude, tilt, still))
    found.append((0.5 * timing.seconds, attitude, tilt, still))
    return found


@lru_cache(maxsize=1024)
def _turned(axis: int, angle: float) -> Table:
    """(3, 9): the attitude error after so much of a rotation, by κ, κ asymmetry and υ (3)."""
    unit_model = sequence_model([(axis, angle)], np.array([0.0, 0.0, 1.0]), 1.0)
    across = sequence_model([(axis, angle)], np.array([1.0, 0.0, 0.0]), 1.0)
    # u x φ of two directions u determines all of φ: z x φ = (-φy, φx, 0), x x φ = (0, -φz, φy)
    one, other = unit_model.coefficients[:3, :_GYRO_ERRORS], across.coefficients[:3, :_GYRO_ERRORS]
    return np.array([one[1], -one[0], -other[1]])


def _gyro_errors(rate: Vector, signs: Series) -> Table:
    """(3, 9): what κ, κ asymmetry and υ make of a slow rate; the asymmetry with the sign of a rotation, if any."""
    found = np.zeros((3, _GYRO_ERRORS))
    found[:, :3] = np.diag(rate)
    found[:, 3:6] = np.diag(np.where(signs == 0.0, np.abs(rate), signs * rate))
    for number, (i, j) in enumerate(PAIRS):
        found[i, 6 + number], found[j, 6 + number] = 0.5 * rate[j], 0.5 * rate[i]
    return found
