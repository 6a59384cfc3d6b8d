"""The joint estimator's unknowns as parameters: any subset, in the frame that the procedure's result is in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square
from tumble.calibration.canonical import canonical_names, gravity_covariance, named_parameters
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
from tumble.sensor.conventions.shin import matrix_from_shin
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
    gyro : "full" or "none".
    frame : "accelerometer-x", "fixture" or "mean-gyro".
    all_told : name every parameter, however uncertain.
    """
    values, spread = unknowns, covariance + gravity_covariance(unknowns, site)
    units = (recording.specific_force_unit, recording.angular_rate_unit)
    factors = (specific_force_factor(units[0]), angular_rate_factor(units[1]))
    names = _canonical_names(terms, gyro)
    numbers, own = propagate(_canonical(terms, gyro, frame), values, spread)
    keep = _worth_naming(names, numbers, own, values, all_told=all_told)
    labels, evaluate = named_function(terms, gyro, frame, units, factors)
    shown, told = propagate(evaluate, values, spread)
    sigmas = np.sqrt(np.maximum(np.diag(told), 0.0))
    named = np.ones(len(labels), dtype=bool)
    for term in _kept(terms, "parameters"):
        assert term.parameters is not None
        named &= True if term.parameters.told is None else term.parameters.told(labels, sigmas)
    rows = [i for i in np.flatnonzero(named) if all_told or _is_told(labels[i], shown[i], sigmas[i], values)]
    parameters = [NamedValue(*_pair(labels[i], shown[i], sigmas[i])) for i in rows]
    return Described(
        _model(values, terms, gyro, frame),
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


def _canonical(terms: frozenset[str], gyro: str, frame: str) -> Callable[[Complex], Complex]:
    def evaluate(x: Complex) -> Complex:
        C_bf = rotation_of_frame(x, frame)
        parts: list[Complex] = [
            (_force_matrix(x) @ C_bf).ravel(),
            x[LAYOUT["force.bias"]],
        ]
        parts += [x[LAYOUT["force.quadratic"]]] if "quadratic" in terms else []
        if gyro == "full":
            parts += [(x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf).ravel(), x[LAYOUT["gyro.bias"]]]
        if "g_sensitivity" in terms:
            parts.append((x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf).ravel())
        parts += [x[LAYOUT[term.block.name]] for term in _kept(terms, "curve")]
        return np.concatenate(parts)

    return evaluate


def _kept(terms: frozenset[str], what: Literal["curve", "parameters"]) -> list[Term]:
    """Terms that were kept and have a curve or parameters of their own, without the one among the first unknowns."""
    found = [term for term in TERMS.values() if term.name in terms and term.name != "quadratic"]
    return [term for term in found if getattr(term, what)]


def _canonical_names(terms: frozenset[str], gyro: str) -> list[str]:
    names = canonical_names(terms, gyro)
    return names + [f"{t.of}.{t.curve}[{i}]" for t in _kept(terms, "curve") for i in range(3)]


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
    terms: frozenset[str],
    gyro: str,
    frame: str,
    units: tuple[str, str],
    factors: tuple[float | None, float | None],
) -> tuple[list[tuple[str, str]], Callable[[Complex], Complex]]:
    """Return names and units of the parameters, and the (analytic) function of all unknowns that gives them.

    Parameters
    ----------
    terms, gyro, frame : as for `describe_wide`.
    units, factors : raw units, and SI per raw unit or None for counts.
    """
    curves, others = (
        _kept(terms, "curve"),
        [(LAYOUT[t.block.name], t.parameters) for t in _kept(terms, "parameters") if t.parameters],
    )
    extra = [label for term in curves for label in term.curve_labels(units)]
    extra += [label for _, own in others for label in own.labels(frame)]

    def further(x: Complex) -> list[Complex]:
        C_bf = rotation_of_frame(x, frame)
        own = [x[LAYOUT[term.block.name]] for term in curves]
        return own + [parameters.values(x[place], C_bf, frame) for place, parameters in others]

    if frame == "accelerometer-x":
        labels, own = named_parameters(terms=terms, gyro=gyro, units=units, factors=factors)
        return [*labels, *extra], lambda x: np.concatenate([own(x[:36]), *further(x)])
    savage = frame == "mean-gyro"
    labels = _labels("accelerometer", units[0], factors[0], "m/s²")
    if "quadratic" in terms:
        labels += [(f"accelerometer quadratic {axis}", f"1/({units[0]})") for axis in "xyz"]
    if gyro == "full":
        labels += _labels("gyro", units[1], factors[1], "rad/s", symmetric=savage)
    if "g_sensitivity" in terms:
        pairs = [(a, b) for a in "xyz" for b in "xyz"]
        labels += [(f"g-sensitivity of gyro {a} to force {b}", f"{units[1]}/(m/s²)") for a, b in pairs]
    values = _savage_values if savage else _fixture_values

    def evaluate(x: Complex) -> Complex:
        C_bf = rotation_of_frame(x, frame)
        parts = values(_force_matrix(x) @ C_bf, x[LAYOUT["force.bias"]], factors[0], symmetric=False)
        parts += [x[LAYOUT["force.quadratic"]]] if "quadratic" in terms else []
        if gyro == "full":
            matrix = x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf
            parts += values(matrix, x[LAYOUT["gyro.bias"]], factors[1], symmetric=savage)
        if "g_sensitivity" in terms:
            parts.append((x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf).ravel())
        return np.concatenate([*parts, *further(x)])

    return [*labels, *extra], evaluate


def _labels(
    short: str, unit: str, factor: float | None, si: str, *, symmetric: bool = False
) -> list[tuple[str, str]]:
    """Names and units of a triad; of a symmetric matrix by its pairs of axes, of any other by where each axis leans."""
    if symmetric:
        angles = [f"{short} non-orthogonality {'xyz'[i]}{'xyz'[j]}" for i, j in PAIRS]
    else:
        angles = [f"{short} misalignment {'xyz'[i]}{'xyz'[j]}" for i, j in OFF_DIAGONAL]
    kind = "scale factor error" if factor else "scale factor"
    return [
        *((f"{short} bias {axis}", unit) for axis in "xyz"),
        *((f"{short} {kind} {axis}", "1" if factor else f"{unit}/({si})") for axis in "xyz"),
        *((angle, "rad") for angle in angles),
    ]


def _savage_values(matrix: Complex, bias: Complex, factor: float | None, *, symmetric: bool) -> list[Complex]:
    """Of `_labels` as Savage (2018, (6) to (11)) has them, to first order of his small angles."""
    scale = np.diag(matrix)
    # Of counts each sensor's angle is against its own scale factor.
    angle = matrix * factor if factor else (matrix.T / scale).T
    told = (
        [angle[i, j] + angle[j, i] for i, j in PAIRS] if symmetric else [angle[i, j] for i, j in OFF_DIAGONAL]
    )
    return [bias, scale * factor - 1.0 if factor else scale, np.array(told)]


def _fixture_values(
    matrix: Complex, bias: Complex, factor: float | None, *, symmetric: bool
) -> list[Complex]:
    """Of `_labels`, by each axis's length and where it leans."""
    length = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
    scale = length if factor is None else length * factor - 1.0
    leans = [np.arcsin(matrix[i, j] / length[i]) for i, j in OFF_DIAGONAL]
    return [bias, scale, np.array(leans)]


def _model(x: Series, terms: frozenset[str], gyro: str, frame: str) -> ImuModel:
    C_bf = np.real(rotation_of_frame(x, frame))
    curves = {"accelerometer": dict[str, Series](), "gyroscope": dict[str, Series]()}
    for term in TERMS.values():
        if term.curve and term.name in terms:
            curves[term.of][term.curve] = x[LAYOUT[term.block.name]].copy()
    accelerometer = Triad(
        np.real(_force_matrix(x)) @ C_bf, x[LAYOUT["force.bias"]].copy(), **curves["accelerometer"]
    )
    gyroscope = None
    if gyro == "full":
        matrix = x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf
        gyroscope = Triad(matrix, x[LAYOUT["gyro.bias"]].copy(), **curves["gyroscope"])
    sensitivity = x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf if "g_sensitivity" in terms else None
    return ImuModel(accelerometer, gyroscope, sensitivity)
