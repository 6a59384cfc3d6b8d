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
from tumble.records import dataclass
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


FIXTURE_UNKNOWNS = 18
_FIXTURE_MATRIX, _FIXTURE_BIAS = slice(0, 9), slice(9, 12)
_FIXTURE_TERMS = {"asymmetry": slice(12, 15), "quadratic": slice(15, 18)}


@dataclass(frozen=True, slots=True)
class DescribedTriad:
    """One triad in the axes of a fixture: canonical names with their covariance, and named values with theirs."""

    triad: Triad
    names: list[str]
    covariance: Square
    parameters: list[NamedValue]
    spread: Table


def describe_apart(accelerometer: DescribedTriad, gyro: DescribedTriad | None) -> Described:
    """Return two triads that were estimated one without the other.

    Parameters
    ----------
    accelerometer : described.
    gyro : described; None without one.
    """
    from scipy.linalg import block_diag

    parts = [accelerometer] if gyro is None else [accelerometer, gyro]
    return Described(
        ImuModel(accelerometer.triad, None if gyro is None else gyro.triad),
        [name for part in parts for name in part.names],
        block_diag(*(part.covariance for part in parts)),
        [value for part in parts for value in part.parameters],
        correlation_matrix(block_diag(*(part.spread for part in parts))),
    )


def describe_fixture_triad(
    kind: str,
    unknowns: Series,
    covariance: Square,
    *,
    known: np.ndarray,
    unit: str,
    factor: float | None,
    terms: frozenset[str] = frozenset(),
) -> DescribedTriad:
    """Return a triad's canonical and named parameters in the frame ``fixture``.

    Named are biases, scale factors (the length of a sensor's row) and misalignments: ``xy`` is the
    angle by which the sensing axis of x leans towards the fixture's y axis.

    Parameters
    ----------
    kind : "accelerometer" or "gyroscope".
    unknowns, covariance : (18,), (18, 18): matrix by rows, bias, asymmetry, quadratic; raw units.
    known : (3, 3) of bool, the elements of the matrix that were estimated; others have no name and no
        uncertainty.
    unit, factor : raw unit, and SI per raw unit or None for counts.
    terms : of "asymmetry" and "quadratic", those that were estimated.
    """
    short, si = ("accelerometer", "m/s²") if kind == "accelerometer" else ("gyro", "rad/s")
    at = [*np.flatnonzero(known.ravel()).tolist(), *range(9, 12)]
    entries = _entries(f"{kind}.matrix")
    names = [entries[i] for i in at[:-3]] + _axes(f"{kind}.bias")
    labels = [(f"{short} bias {axis}", unit) for axis in "xyz"]
    rows = [i for i in range(3) if known[i, i]]
    scale_name = "scale factor error" if factor else "scale factor"
    labels += [(f"{short} {scale_name} {'xyz'[i]}", "1" if factor else f"{unit}/({si})") for i in rows]
    # Of counts a sensor's angle needs its scale factor; in SI the nominal one will do.
    sized = [i for i in range(3) if factor or known[i, i]]
    leans = [(i, j) for i in sized for j in range(3) if i != j and known[i, j]]
    labels += [(f"{short} misalignment {'xyz'[i]}{'xyz'[j]}", "rad") for i, j in leans]
    for term in sorted(terms):
        place = _FIXTURE_TERMS[term]
        at += range(place.start, place.stop)
        names += _axes(f"{kind}.{term}")
        labels += [
            (f"{short} {term} {axis}", "1" if term == "asymmetry" else f"1/({unit})") for axis in "xyz"
        ]

    def evaluate(x: Complex) -> Complex:
        matrix = x[_FIXTURE_MATRIX].reshape(3, 3)
        # A sensor that counts backwards has a negative scale factor.
        length = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
        parts: list[Complex] = [x[_FIXTURE_BIAS], _scale(length, factor)[rows]]
        parts += [np.array([np.arcsin(matrix[i, j] / length[i]) for i, j in leans])] if leans else []
        parts += [x[_FIXTURE_TERMS[term]] for term in sorted(terms)]
        return np.concatenate(parts)

    values, spread = propagate(evaluate, unknowns, covariance)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    named = [
        NamedValue(name, float(value), float(sigma), of)
        for (name, of), value, sigma in zip(labels, values, sigmas, strict=True)
    ]
    triad = Triad(
        unknowns[_FIXTURE_MATRIX].reshape(3, 3).copy(),
        unknowns[_FIXTURE_BIAS].copy(),
        unknowns[_FIXTURE_TERMS["asymmetry"]].copy() if "asymmetry" in terms else None,
        unknowns[_FIXTURE_TERMS["quadratic"]].copy() if "quadratic" in terms else None,
    )
    return DescribedTriad(triad, names, covariance[np.ix_(at, at)], named, spread)


def describe_bias(bias: Series, covariance: Square, *, unit: str, nominal: float) -> DescribedTriad:
    """Return gyros of which only the bias is known; their matrix is the `nominal` raw per SI unit.

    Parameters
    ----------
    bias, covariance : (3,), (3, 3) raw.
    unit : as for `describe_fixture_triad`.
    """
    sigmas = np.sqrt(np.diag(covariance))
    named = [
        NamedValue(f"gyro bias {axis}", float(value), float(sigma), unit)
        for axis, value, sigma in zip("xyz", bias, sigmas, strict=True)
    ]
    triad = Triad(nominal * np.eye(3), bias.copy())
    return DescribedTriad(triad, _axes("gyroscope.bias"), covariance, named, covariance)


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
