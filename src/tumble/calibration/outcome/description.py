"""The joint estimator's unknowns as parameters: any subset, in the frame that the procedure's result is in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square
from tumble.attitude.rotations import analytic_rotation_vector
from tumble.calibration.equations.imu_unknowns import (
    LAYOUT,
    NAME_PLATE_FORCE,
    NAME_PLATE_RATE,
    NAME_PLATE_SHARE,
)
from tumble.calibration.estimate import Described, NamedValue, correlation_matrix
from tumble.calibration.terms import TERMS, Term
from tumble.calibration.terms.lever_arms import WORTH_NAMING
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.sensor import ImuModel, Triad, polar_rotation, propagate
from tumble.sensor.conventions.savage import OFF_DIAGONAL, PAIRS
from tumble.sensor.conventions.shin import matrix_from_shin, shin_from_matrix
from tumble.sensor.gauge import inverse, lower_factor
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]


def describe(
    unknowns: Series,
    covariance: Square,
    site: Site,
    recording: Recording,
    *,
    terms: frozenset[str],
    gyro: str,
    frame: str = "accelerometer-x",
    all_told: bool = False,
) -> Described:
    """Return model and parameters of the unknowns, without those that are hardly better known than beforehand.

    Parameters
    ----------
    unknowns, covariance : all of `LAYOUT`.
    site, recording : how well gravity is known; units.
    terms : optional terms that were kept.
    gyro : "full" (matrix and bias), "bias" or "none".
    frame : "accelerometer-x", "fixture" or "mean-gyro".
    all_told : name every parameter, however uncertain.
    """
    # All accelerometer scale factors, and what gyros show of gravity, are as wrong as it is.
    off = site.gravity_sigma * gravity_slope(unknowns, site)
    values, spread = unknowns, covariance + np.outer(off, off)
    names = canonical_names(terms, gyro)
    numbers, own = propagate(canonical_function(terms, gyro, frame), values, spread)
    keep = _worth_naming(names, numbers, own, values, all_told=all_told)
    labels, evaluate = named_function(
        terms, gyro, frame, (recording.specific_force_unit, recording.angular_rate_unit)
    )
    shown, told = propagate(evaluate, values, spread)
    sigmas = np.sqrt(np.maximum(np.diag(told), 0.0))
    named = np.ones(len(labels), dtype=bool)
    for term in _kept(terms, "parameters"):
        assert term.parameters is not None
        named &= True if term.parameters.told is None else term.parameters.told(labels, sigmas)
    rows = [i for i in np.flatnonzero(named) if all_told or _is_told(labels[i], shown[i], sigmas[i], values)]
    parameters = [NamedValue(*_pair(labels[i], shown[i], sigmas[i])) for i in rows]
    return Described(
        model_of(values, terms, gyro, frame),
        [names[i] for i in keep],
        own[np.ix_(keep, keep)],
        parameters,
        correlation_matrix(told[np.ix_(rows, rows)]),
    )


def _pair(label: tuple[str, str], value: float, sigma: float) -> tuple[str, float, float, str]:
    return label[0], float(value), float(sigma), label[1]


def rotation_of_frame(x: Complex, frame: str) -> Complex:
    """Return C_bf from the frame of the result to the sensors' own, analytic in the unknowns.

    Parameters
    ----------
    x, frame : all unknowns, and "accelerometer-x" (the sensors' own), "fixture" or "mean-gyro".
    """
    if frame == "mean-gyro":
        return polar_rotation(x[LAYOUT["gyro.matrix"]].reshape(3, 3)).T
    if frame != "fixture":
        return np.eye(3)
    v = x[LAYOUT["fixture"]]
    square = v @ v
    if abs(square) < 1e-6:
        one, two = 1.0 - square / 6.0 + square**2 / 120.0, 0.5 - square / 24.0 + square**2 / 720.0
    else:
        angle = np.sqrt(square)
        one, two = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    zero = square * 0.0
    cross = np.array([[zero, -v[2], v[1]], [v[2], zero, -v[0]], [-v[1], v[0], zero]])
    return np.eye(3) + one * cross + two * (cross @ cross)


def _force_matrix(x: Complex) -> Complex:
    return matrix_from_shin(x[LAYOUT["force.scale"]], x[LAYOUT["force.angle"]])


def gravity_slope(unknowns: Series, site: Site) -> Series:
    """Return (unknowns,) by how much they move per m/s² of gravity: ``-scale / gravity``, and g-sensitivity alike.

    Parameters
    ----------
    unknowns, site : all of `LAYOUT`, and where.
    """
    slope = np.zeros(unknowns.size)
    for at in (LAYOUT["force.scale"], LAYOUT["gyro.g_sensitivity"]):
        slope[at] = -unknowns[at] / site.gravity
    return slope


def canonical_function(terms: frozenset[str], gyro: str, frame: str) -> Callable[[Complex], Complex]:
    """Return the (analytic) function of all unknowns that gives the numbers of `canonical_names`.

    Parameters
    ----------
    terms, gyro, frame : as for `describe`.
    """

    def evaluate(x: Complex) -> Complex:
        C_bf = rotation_of_frame(x, frame)
        parts: list[Complex] = [
            (_force_matrix(x) @ C_bf).ravel(),
            x[LAYOUT["force.bias"]],
        ]
        parts += [x[LAYOUT["force.quadratic"]]] if "quadratic" in terms else []
        parts += [(x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf).ravel()] if gyro == "full" else []
        parts += [x[LAYOUT["gyro.bias"]]] if gyro != "none" else []
        if "g_sensitivity" in terms:
            parts.append((x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf).ravel())
        parts += [x[LAYOUT[term.block.name]] for term in _kept(terms, "curve")]
        return np.concatenate(parts)

    return evaluate


def _kept(terms: frozenset[str], what: Literal["curve", "parameters"]) -> list[Term]:
    """Terms that were kept and have a curve or parameters of their own, without the one among the first unknowns."""
    found = [term for term in TERMS.values() if term.name in terms and term.name != "quadratic"]
    return [term for term in found if getattr(term, what)]


def canonical_names(terms: frozenset[str], gyro: str) -> list[str]:
    """Return the names of the canonical parameters, as `calibration.json` lists them.

    Parameters
    ----------
    terms, gyro : as for `describe`.
    """
    groups = ["accelerometer.matrix", "accelerometer.bias"]
    groups += ["accelerometer.quadratic"] if "quadratic" in terms else []
    groups += ["gyroscope.matrix"] if gyro == "full" else []
    groups += ["gyroscope.bias"] if gyro != "none" else []
    groups += ["gyroscope.g_sensitivity"] if "g_sensitivity" in terms else []
    groups += [f"{term.of}.{term.curve}" for term in _kept(terms, "curve")]
    square = [f"{i},{j}" for i in range(3) for j in range(3)]
    of_square = ("matrix", "sensitivity")
    return [f"{group}[{i}]" for group in groups for i in (square if group.endswith(of_square) else range(3))]


def _worth_naming(
    names: list[str], numbers: Series, covariance: Square, values: Series, *, all_told: bool
) -> list[int]:
    if all_told:
        return list(range(len(names)))
    sizes = {
        "accelerometer": float(np.mean(np.abs(values[LAYOUT["force.scale"]]))),
        "gyroscope": float(np.linalg.norm(values[LAYOUT["gyro.matrix"]])) / np.sqrt(3.0),
    }
    of_bias = {"accelerometer": NAME_PLATE_FORCE, "gyroscope": NAME_PLATE_RATE}
    kept: list[int] = []
    for i, name in enumerate(names):
        kind, key = name.split(".", 1)
        promise = {"matrix": NAME_PLATE_SHARE * sizes[kind], "bias": of_bias[kind] * sizes[kind]}.get(
            key.split("[")[0], np.inf
        )
        if float(np.sqrt(max(covariance[i, i], 0.0))) < WORTH_NAMING * promise:
            kept.append(i)
    return kept


def _is_told(label: tuple[str, str], value: float, sigma: float, values: Series) -> bool:
    name = label[0]
    size = float(np.mean(np.abs(values[LAYOUT["force.scale"]])))
    if name.startswith(("gyro", "g-")):
        size = float(np.linalg.norm(values[LAYOUT["gyro.matrix"]])) / np.sqrt(3.0)
    promise = np.inf
    if " bias " in name:
        promise = size * (NAME_PLATE_RATE if name.startswith("gyro") else NAME_PLATE_FORCE)
    elif "scale factor" in name:
        promise = NAME_PLATE_SHARE * (1.0 if "error" in name else abs(value))
    elif any(word in name for word in ("orthogonality", "misalignment", "rotation")):
        promise = NAME_PLATE_SHARE
    return bool(sigma < WORTH_NAMING * promise)


def named_function(
    terms: frozenset[str], gyro: str, frame: str, units: tuple[str, str]
) -> tuple[list[tuple[str, str]], Callable[[Complex], Complex]]:
    """Return names and units of the parameters, and the (analytic) function of all unknowns that gives them.

    Scale factors are errors where the raw unit is known, and raw per SI of counts. In ``accelerometer-x`` they are
    Shin and El-Sheimy's: the gyros' matrix is split into its own lower-triangular factor and the rotation between the
    triads, given as a rotation vector from b to the gyros' own frame.

    Parameters
    ----------
    terms, gyro, frame : as for `describe`.
    units : raw units of specific force and angular rate.
    """
    factors = specific_force_factor(units[0]), angular_rate_factor(units[1])
    curves = _kept(terms, "curve")
    others = [(LAYOUT[t.block.name], t.parameters) for t in _kept(terms, "parameters") if t.parameters]
    shin, savage = frame == "accelerometer-x", frame == "mean-gyro"
    labels = _labels("accelerometer", units[0], factors[0], "m/s²", SHIN if shin else LEANS)
    if "quadratic" in terms:
        labels += [(f"accelerometer quadratic {axis}", f"1/({units[0]})") for axis in "xyz"]
    if gyro != "none":
        own = _labels("gyro", units[1], factors[1], "rad/s", SHIN if shin else SYMMETRIC if savage else LEANS)
        labels += own if gyro == "full" else own[:3]
    if gyro == "full" and shin:
        labels += [(f"rotation between the triads {axis}", "rad") for axis in "xyz"]
    if "g_sensitivity" in terms:
        pairs = [(a, b) for a in "xyz" for b in "xyz"]
        labels += [(f"g-sensitivity of gyro {a} to force {b}", f"{units[1]}/(m/s²)") for a, b in pairs]
    labels += [label for term in curves for label in term.curve_labels(units)]
    labels += [label for _, parameters in others for label in parameters.labels(frame)]
    values = _savage_values if savage else _fixture_values

    def evaluate(x: Complex) -> Complex:
        C_bf = rotation_of_frame(x, frame)
        if shin:
            parts = [_scaled(x[LAYOUT["force.scale"]], factors[0]), x[LAYOUT["force.angle"]]]
        else:
            parts = values(_force_matrix(x) @ C_bf, factors[0], symmetric=False)
        parts = [x[LAYOUT["force.bias"]], *parts]
        parts += [x[LAYOUT["force.quadratic"]]] if "quadratic" in terms else []
        parts += [x[LAYOUT["gyro.bias"]]] if gyro != "none" else []
        if gyro == "full":
            matrix = x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf
            parts += (
                _shin_values(matrix, factors[1]) if shin else values(matrix, factors[1], symmetric=savage)
            )
        if "g_sensitivity" in terms:
            parts.append((x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf).ravel())
        parts += [x[LAYOUT[term.block.name]] for term in curves]
        parts += [parameters.values(x[place], C_bf, frame) for place, parameters in others]
        return np.concatenate(parts)

    return labels, evaluate


# Angles of a triad: of its own axes one by one, of a symmetric matrix by pairs of axes, or where each axis leans.
SHIN = tuple(f"non-orthogonality {angle}" for angle in ("yz", "zx", "zy"))
SYMMETRIC = tuple(f"non-orthogonality {'xyz'[i]}{'xyz'[j]}" for i, j in PAIRS)
LEANS = tuple(f"misalignment {'xyz'[i]}{'xyz'[j]}" for i, j in OFF_DIAGONAL)


def _labels(
    short: str, unit: str, factor: float | None, si: str, angles: tuple[str, ...]
) -> list[tuple[str, str]]:
    """Names and units of a triad."""
    kind = "scale factor error" if factor else "scale factor"
    return [
        *((f"{short} bias {axis}", unit) for axis in "xyz"),
        *((f"{short} {kind} {axis}", "1" if factor else f"{unit}/({si})") for axis in "xyz"),
        *((f"{short} {angle}", "rad") for angle in angles),
    ]


def _scaled(scale: Complex, factor: float | None) -> Complex:
    """Scale factors as errors against SI where the raw unit is known."""
    return scale if factor is None else scale * factor - 1.0


def _shin_values(matrix: Complex, factor: float | None) -> list[Complex]:
    """Of `_labels`, and the rotation between the triads."""
    own = lower_factor(matrix)
    scale, angles = shin_from_matrix(own)
    return [_scaled(scale, factor), angles, analytic_rotation_vector(inverse(own) @ matrix)]


def _savage_values(matrix: Complex, factor: float | None, *, symmetric: bool) -> list[Complex]:
    """Of `_labels` as Savage (2018, (6) to (11)) has them, to first order of his small angles."""
    scale = np.diag(matrix)
    # Of counts each sensor's angle is against its own scale factor.
    angle = matrix * factor if factor else (matrix.T / scale).T
    told = (
        [angle[i, j] + angle[j, i] for i, j in PAIRS] if symmetric else [angle[i, j] for i, j in OFF_DIAGONAL]
    )
    return [_scaled(scale, factor), np.array(told)]


def _fixture_values(matrix: Complex, factor: float | None, *, symmetric: bool) -> list[Complex]:
    """Of `_labels`, by each axis's length and where it leans."""
    length = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
    leans = [np.arcsin(matrix[i, j] / length[i]) for i, j in OFF_DIAGONAL]
    return [_scaled(length, factor), np.array(leans)]


def model_of(x: Series, terms: frozenset[str], gyro: str, frame: str) -> ImuModel:
    """Return the sensor model of all unknowns.

    Parameters
    ----------
    x, terms, gyro, frame : as for `describe`.
    """
    C_bf = np.real(rotation_of_frame(x, frame))
    curves = {"accelerometer": dict[str, Series](), "gyroscope": dict[str, Series]()}
    for term in TERMS.values():
        if term.curve and term.name in terms:
            curves[term.of][term.curve] = x[LAYOUT[term.block.name]].copy()
    accelerometer = Triad(
        np.real(_force_matrix(x)) @ C_bf, x[LAYOUT["force.bias"]].copy(), **curves["accelerometer"]
    )
    gyroscope = None
    if gyro != "none":
        matrix = x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf
        gyroscope = Triad(matrix, x[LAYOUT["gyro.bias"]].copy(), **curves["gyroscope"])
    sensitivity = x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf if "g_sensitivity" in terms else None
    return ImuModel(accelerometer, gyroscope, sensitivity)
