"""The joint estimator's unknowns as parameters: any subset, in the frame that the procedure's result is in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square
from tumble.attitude import analytic_rotation_vector
from tumble.calibration.equations.imu_unknowns import (
    LAYOUT,
    NAME_PLATE_FORCE,
    NAME_PLATE_RATE,
    NAME_PLATE_SHARE,
)
from tumble.calibration.estimate import Described, NamedValue, correlation_matrix
from tumble.calibration.terms import TERMS, WORTH_NAMING, Term
from tumble.calibration.terms.term import KINDS
from tumble.earth import Site
from tumble.parameters import ANGLES, FAMILIES, parameter_of, triad_labels
from tumble.recording import Recording
from tumble.sensor import (
    OFF_DIAGONAL,
    PAIRS,
    ImuModel,
    Triad,
    inverse,
    lower_factor,
    matrix_from_shin,
    polar_rotation,
    propagate,
    shin_from_matrix,
)
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
    spread = covariance + np.outer(off, off)
    names = canonical_names(terms, gyro)
    _, own = propagate(canonical_function(terms, gyro, frame), unknowns, spread)
    keep = list(range(len(names))) if all_told else _worth_naming(names, own, unknowns)
    labels, evaluate = named_function(
        terms, gyro, frame, (recording.specific_force_unit, recording.angular_rate_unit)
    )
    shown, told = propagate(evaluate, unknowns, spread)
    sigmas = np.sqrt(np.maximum(np.diag(told), 0.0))
    named = np.ones(len(labels), dtype=bool)
    for wanted in (term.parameters.told for term in _kept(terms, "parameters") if term.parameters):
        named &= wanted is None or wanted(labels, sigmas)
    rows = [
        i for i in np.flatnonzero(named) if all_told or _is_told(labels[i][0], shown[i], sigmas[i], unknowns)
    ]
    parameters = [NamedValue(labels[i][0], float(shown[i]), float(sigmas[i]), labels[i][1]) for i in rows]
    return Described(
        model_of(unknowns, terms, gyro, frame),
        [names[i] for i in keep],
        own[np.ix_(keep, keep)],
        parameters,
        correlation_matrix(told[np.ix_(rows, rows)]),
    )


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
    return lambda x: np.concatenate([group.ravel() for group in _groups(x, terms, gyro, frame).values()])


def _groups(x: Complex, terms: frozenset[str], gyro: str, frame: str) -> dict[str, Complex]:
    """Canonical parameters by group, each (3,) or (3, 3), analytic in all unknowns."""
    C_bf = rotation_of_frame(x, frame)
    M_a = matrix_from_shin(x[LAYOUT["force.scale"]], x[LAYOUT["force.angle"]])
    found = {"accelerometer.matrix": M_a @ C_bf, "accelerometer.bias": x[LAYOUT["force.bias"]]}
    if "quadratic" in terms:
        found["accelerometer.quadratic"] = x[LAYOUT["force.quadratic"]]
    if gyro == "full":
        found["gyroscope.matrix"] = x[LAYOUT["gyro.matrix"]].reshape(3, 3) @ C_bf
    if gyro != "none":
        found["gyroscope.bias"] = x[LAYOUT["gyro.bias"]]
    if "g_sensitivity" in terms:
        found["gyroscope.g_sensitivity"] = x[LAYOUT["gyro.g_sensitivity"]].reshape(3, 3) @ C_bf
    return found | {f"{term.of}.{term.curve}": x[LAYOUT[term.block.name]] for term in _kept(terms, "curve")}


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
    groups = _groups(np.zeros(LAYOUT.size), terms, gyro, "accelerometer-x")
    places = [(name, at) for name, group in groups.items() for at in np.ndindex(group.shape)]
    return [f"{name}[{','.join(map(str, at))}]" for name, at in places]


def _plates(values: Series) -> dict[str, dict[str, float]]:
    """What any name plate promises of each triad's matrix and biases, one sigma: raw, and of shares."""
    force = float(np.mean(np.abs(values[LAYOUT["force.scale"]])))
    rate = float(np.linalg.norm(values[LAYOUT["gyro.matrix"]])) / np.sqrt(3.0)
    sizes = {"accelerometer": (force, NAME_PLATE_FORCE), "gyroscope": (rate, NAME_PLATE_RATE)}
    return {
        kind: {"matrix": NAME_PLATE_SHARE * size, "bias": bias * size} for kind, (size, bias) in sizes.items()
    }


def _worth_naming(names: list[str], covariance: Square, values: Series) -> list[int]:
    plates, sigmas = _plates(values), np.sqrt(np.maximum(np.diag(covariance), 0.0))
    keys = [name.partition("[")[0].split(".") for name in names]
    promised = np.array([plates[kind].get(term, np.inf) for kind, term in keys])
    return np.flatnonzero(sigmas < WORTH_NAMING * promised).tolist()


def _is_told(name: str, value: float, sigma: float, values: Series) -> bool:
    family, promise = parameter_of(name).family, np.inf
    if family.kind == "bias":
        promise = _plates(values)["gyroscope" if family.triad == "gyro" else "accelerometer"]["bias"]
    elif family.kind in ("scale factor error", *ANGLES):
        promise = NAME_PLATE_SHARE
    elif family.kind == "scale factor":
        promise = NAME_PLATE_SHARE * abs(value)
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
    labels = triad_labels("accelerometer", units[0], *(SHIN if shin else LEANS), si=factors[0] is not None)
    if "quadratic" in terms:
        labels += FAMILIES["accelerometer quadratic"].labels(units[0])
    if gyro != "none":
        angles = SHIN if shin else SYMMETRIC if savage else LEANS
        own = triad_labels("gyro", units[1], *angles, si=factors[1] is not None)
        labels += own if gyro == "full" else own[:3]
    if gyro == "full" and shin:
        labels += FAMILIES["rotation between the triads"].labels()
    if "g_sensitivity" in terms:
        labels += FAMILIES["gyro g-sensitivity"].labels(units[1])
    labels += [label for term in curves for label in term.curve_labels(units)]
    labels += [label for _, parameters in others for label in parameters.labels(frame)]
    split = _shin_values if shin else _savage_values if savage else _fixture_values
    own_terms = zip(KINDS, factors, ("quadratic", "g_sensitivity"), strict=True)
    order = [(kind, term, factor) for kind, factor, last in own_terms for term in ("bias", "matrix", last)]

    def evaluate(x: Complex) -> Complex:
        told, C_bf = _groups(x, terms, gyro, frame), rotation_of_frame(x, frame)
        parts: list[Complex] = []
        for kind, term, factor in order:
            own = told.get(f"{kind}.{term}", np.zeros(0))
            parts += split(own, factor, kind) if own.size and term == "matrix" else [own.ravel()]
        parts += [x[LAYOUT[term.block.name]] for term in curves]
        parts += [parameters.values(x[place], C_bf, frame) for place, parameters in others]
        return np.concatenate(parts)

    return labels, evaluate


# Angles of a triad: of its own axes one by one, of a symmetric matrix by pairs of axes, or where each axis leans.
SHIN = ("non-orthogonality", ("yz", "zx", "zy"))
SYMMETRIC = ("non-orthogonality", tuple("xyz"[i] + "xyz"[j] for i, j in PAIRS))
LEANS = ("misalignment", tuple("xyz"[i] + "xyz"[j] for i, j in OFF_DIAGONAL))


def _scaled(scale: Complex, factor: float | None) -> Complex:
    """Scale factors as errors against SI where the raw unit is known."""
    return scale if factor is None else scale * factor - 1.0


def _shin_values(matrix: Complex, factor: float | None, kind: str) -> list[Complex]:
    """Of `triad_labels`, and of gyros the rotation between the triads."""
    own = lower_factor(matrix)
    scale, angles = shin_from_matrix(own)
    turned = [analytic_rotation_vector(inverse(own) @ matrix)] if kind == "gyroscope" else []
    return [_scaled(scale, factor), angles, *turned]


def _savage_values(matrix: Complex, factor: float | None, kind: str) -> list[Complex]:
    """Of `triad_labels` as Savage (2018, (6) to (11)) has them, to first order of his small angles."""
    scale = np.diag(matrix)
    # Of counts each sensor's angle is against its own scale factor.
    angle = matrix * factor if factor else (matrix.T / scale).T
    symmetric = kind == "gyroscope"
    told = (
        [angle[i, j] + angle[j, i] for i, j in PAIRS] if symmetric else [angle[i, j] for i, j in OFF_DIAGONAL]
    )
    return [_scaled(scale, factor), np.array(told)]


def _fixture_values(matrix: Complex, factor: float | None, kind: str) -> list[Complex]:
    """Of `triad_labels`, by each axis's length and where it leans."""
    length = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
    leans = [np.arcsin(matrix[i, j] / length[i]) for i, j in OFF_DIAGONAL]
    return [_scaled(length, factor), np.array(leans)]


def model_of(x: Series, terms: frozenset[str], gyro: str, frame: str) -> ImuModel:
    """Return the sensor model of all unknowns.

    Parameters
    ----------
    x, terms, gyro, frame : as for `describe`.
    """
    told = _groups(x, terms, "none" if gyro == "none" else "full", frame)
    triads: dict[str, dict[str, Series]] = {}
    for name, group in told.items():
        kind, _, term = name.partition(".")
        triads.setdefault(kind, {})[term] = np.real(group).copy()
    gyroscope = triads.get("gyroscope")
    sensitivity = None if gyroscope is None else gyroscope.pop("g_sensitivity", None)
    return ImuModel(
        Triad(**triads["accelerometer"]), None if gyroscope is None else Triad(**gyroscope), sensitivity
    )
