"""From an adjustment's unknowns to canonical parameters and to named ones, covariance carried.

The unknowns are the 36 of `turn_conditions`. Canonical parameters are what `calibration.json` lists:
the entries of both matrices and biases, and of the optional terms that were estimated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table
from tumble.attitude.rotations import analytic_rotation_vector
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, QUADRATIC, SCALE
from tumble.calibration.estimate import Described, NamedValue, correlation_matrix
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.sensor import ImuModel, Triad, propagate
from tumble.sensor.conventions.shin import matrix_from_shin, shin_from_matrix
from tumble.sensor.gauge import inverse, lower_factor
from tumble.sensor.propagation import Function
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]

GYRO_MATRIX, GYRO_BIAS, G_SENSITIVITY = slice(12, 21), slice(21, 24), slice(24, 33)


def _entries(name: str) -> list[str]:
    return [f"{name}[{i},{j}]" for i in range(3) for j in range(3)]


def _axes(name: str) -> list[str]:
    return [f"{name}[{i}]" for i in range(3)]


def canonical_names(terms: frozenset[str], gyro: str) -> list[str]:
    """Return the names of the canonical parameters, in order.

    Parameters
    ----------
    terms : optional terms that were estimated, of "quadratic" and "g_sensitivity".
    gyro : "full" (matrix and bias), "bias" or "none".
    """
    names = _entries("accelerometer.matrix") + _axes("accelerometer.bias")
    if "quadratic" in terms:
        names += _axes("accelerometer.quadratic")
    if gyro == "full":
        names += _entries("gyroscope.matrix")
    if gyro != "none":
        names += _axes("gyroscope.bias")
    if "g_sensitivity" in terms:
        names += _entries("gyroscope.g_sensitivity")
    return names


def canonical_parameters(unknowns: Complex, terms: frozenset[str], gyro: str) -> Complex:
    """Return the canonical parameters of the 36 unknowns (analytic, for complex steps)."""
    parts: list[Complex] = [matrix_from_shin(unknowns[SCALE], unknowns[ANGLE]).ravel(), unknowns[BIAS]]
    if "quadratic" in terms:
        parts.append(unknowns[QUADRATIC])
    if gyro == "full":
        parts.append(unknowns[GYRO_MATRIX])
    if gyro != "none":
        parts.append(unknowns[GYRO_BIAS])
    if "g_sensitivity" in terms:
        parts.append(unknowns[G_SENSITIVITY])
    return np.concatenate(parts)


def canonical_covariance(unknowns: Series, covariance: Square, terms: frozenset[str], gyro: str) -> Table:
    """Return the covariance of the canonical parameters from that of the 36 unknowns."""
    return propagate(lambda x: canonical_parameters(x, terms, gyro), unknowns, covariance)[1]


def _model_from_unknowns(unknowns: Series, terms: frozenset[str], gyro: str) -> ImuModel:
    """Return the sensor model of the 36 unknowns; a gyro of which only the bias is known is SI 1:1."""
    accelerometer = Triad(
        np.real(matrix_from_shin(unknowns[SCALE], unknowns[ANGLE])),
        unknowns[BIAS].copy(),
        None,
        unknowns[QUADRATIC].copy() if "quadratic" in terms else None,
    )
    gyroscope = None
    if gyro != "none":
        gyroscope = Triad(unknowns[GYRO_MATRIX].reshape(3, 3).copy(), unknowns[GYRO_BIAS].copy())
    sensitivity = unknowns[G_SENSITIVITY].reshape(3, 3).copy() if "g_sensitivity" in terms else None
    return ImuModel(accelerometer, gyroscope, sensitivity)


def named_values(
    unknowns: Series,
    covariance: Square,
    *,
    terms: frozenset[str],
    gyro: str,
    units: tuple[str, str],
    factors: tuple[float | None, float | None],
) -> tuple[list[NamedValue], Table]:
    """Return the parameters in Shin and El-Sheimy's convention, and their covariance.

    The gyro's matrix is split into its own lower-triangular factor (scale, non-orthogonality) and
    the rotation between the triads, given as a rotation vector from b to the gyro's own frame.

    Parameters
    ----------
    units : raw units of specific force and angular rate.
    factors : SI per raw unit, or None for counts. With one, the scale is a dimensionless error.
    """
    labels, evaluate = named_parameters(terms=terms, gyro=gyro, units=units, factors=factors)
    values, spread = propagate(evaluate, unknowns, covariance)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    named = [
        NamedValue(name, float(value), float(sigma), unit)
        for (name, unit), value, sigma in zip(labels, values, sigmas, strict=True)
    ]
    return named, spread


def named_parameters(
    *, terms: frozenset[str], gyro: str, units: tuple[str, str], factors: tuple[float | None, float | None]
) -> tuple[list[tuple[str, str]], Function]:
    """Return names and units of the parameters of `named_values`, and the (analytic) function of the 36 unknowns.

    Parameters
    ----------
    terms, gyro, units, factors : as for `named_values`.
    """
    labels: list[tuple[str, str]] = []

    def triad(prefix: str, unit: str, factor: float | None, si: str) -> None:
        labels.extend((f"{prefix} bias {axis}", unit) for axis in "xyz")
        kind = "scale factor error" if factor else "scale factor"
        labels.extend((f"{prefix} {kind} {axis}", "1" if factor else f"{unit}/({si})") for axis in "xyz")
        labels.extend((f"{prefix} non-orthogonality {angle}", "rad") for angle in ("yz", "zx", "zy"))

    triad("accelerometer", units[0], factors[0], "m/s²")
    if "quadratic" in terms:
        labels.extend((f"accelerometer quadratic {axis}", f"1/({units[0]})") for axis in "xyz")
    if gyro == "full":
        triad("gyro", units[1], factors[1], "rad/s")
        labels.extend((f"rotation between the triads {axis}", "rad") for axis in "xyz")
    elif gyro == "bias":
        labels.extend((f"gyro bias {axis}", units[1]) for axis in "xyz")
    if "g_sensitivity" in terms:
        pairs = [(a, b) for a in "xyz" for b in "xyz"]
        labels.extend((f"g-sensitivity of gyro {a} to force {b}", f"{units[1]}/(m/s²)") for a, b in pairs)

    def evaluate(x: Complex) -> Complex:
        parts: list[Complex] = [x[BIAS], _scale(x[SCALE], factors[0]), x[ANGLE]]
        if "quadratic" in terms:
            parts.append(x[QUADRATIC])
        if gyro == "full":
            matrix = x[GYRO_MATRIX].reshape(3, 3)
            own = lower_factor(matrix)
            scale, angles = shin_from_matrix(own)
            parts += [
                x[GYRO_BIAS],
                _scale(scale, factors[1]),
                angles,
                analytic_rotation_vector(inverse(own) @ matrix),
            ]
        elif gyro == "bias":
            parts.append(x[GYRO_BIAS])
        if "g_sensitivity" in terms:
            parts.append(x[G_SENSITIVITY])
        return np.concatenate(parts)

    return labels, evaluate


def describe_unknowns(
    unknowns: Series,
    covariance: Square,
    site: Site,
    recording: Recording,
    *,
    terms: frozenset[str],
    gyro: str,
) -> Described:
    """Return model, canonical and named parameters, with gravity's own uncertainty in the covariance.

    Parameters
    ----------
    unknowns, covariance : (36,), (36, 36) of the adjustment.
    site : how well gravity is known.
    recording : for its units.
    terms, gyro : as for `canonical_names`.
    """
    everything = covariance + gravity_covariance(unknowns, site)
    named, spread = named_values(
        unknowns,
        everything,
        terms=terms,
        gyro=gyro,
        units=(recording.specific_force_unit, recording.angular_rate_unit),
        factors=(
            specific_force_factor(recording.specific_force_unit),
            angular_rate_factor(recording.angular_rate_unit),
        ),
    )
    return Described(
        model=_model_from_unknowns(unknowns, terms, gyro),
        names=canonical_names(terms, gyro),
        covariance=canonical_covariance(unknowns, everything, terms, gyro),
        parameters=named,
        correlations=correlation_matrix(spread),
    )


_FIXTURE_MATRIX, _FIXTURE_BIAS = slice(0, 9), slice(9, 12)
_FIXTURE_TERMS = {"asymmetry": slice(12, 15), "quadratic": slice(15, 18)}


def gravity_covariance(unknowns: Series, site: Site) -> Square:
    """Return what the uncertainty of gravity adds: all accelerometer scales move together.

    d scale / d gravity = -scale / gravity; the g-sensitivity moves the same way.
    """
    slope = np.zeros(unknowns.size)
    slope[SCALE] = -unknowns[SCALE] / site.gravity
    slope[G_SENSITIVITY] = -unknowns[G_SENSITIVITY] / site.gravity
    return np.outer(slope, slope) * site.gravity_sigma**2


def _scale(scale: Complex, factor: float | None) -> Complex:
    """Return scale factors as errors against SI where the raw unit is known."""
    return scale if factor is None else scale * factor - 1.0
