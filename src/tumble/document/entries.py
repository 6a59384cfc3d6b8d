"""The numbers of a document as one vector with its covariance, what people call them, and in another frame.

All 45 numbers (matrices, biases, asymmetries, quadratic terms, g-sensitivity) stand in one vector; the turn to another
frame is an analytic function of it, so that the covariance is carried exactly to first order by the complex step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table
from tumble.document.imported import test_vectors, triad_blocks
from tumble.document.part import rows_of
from tumble.document.result import Calibration, FrameBlock, ParameterBlock, RawUnits
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.parameters import triad_labels
from tumble.sensor import CURVES, FRAMES, ImuModel, Triad, frame_rotation, polar_rotation, propagate
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]

_SHAPES: dict[str, tuple[int, ...]] = {"matrix": (3, 3), "bias": (3,)} | dict.fromkeys(CURVES, (3,))
_TERMS = {f"{of}.{term}": shape for of in ("accelerometer", "gyroscope") for term, shape in _SHAPES.items()}
_TERMS["gyroscope.g_sensitivity"] = (3, 3)
_ENDS = np.cumsum([3 ** len(shape) for shape in _TERMS.values()]).tolist()
# Where each term stands in the vector, and its shape.
PLACES = {
    name: (slice(end - 3 ** len(shape), end), shape)
    for (name, shape), end in zip(_TERMS.items(), _ENDS, strict=True)
}
SIZE: int = _ENDS[-1]


def entry_names() -> list[str]:
    """Return the names of the vector's 45 entries, as ``covariance_parameters`` has them."""
    names: list[str] = []
    for name, (_, shape) in PLACES.items():
        names += [f"{name}[{','.join(map(str, index))}]" for index in np.ndindex(*shape)]
    return names


def stacked(calibration: Calibration) -> tuple[Series, Table]:
    """Return the (45,) numbers of a document and their covariance; what is not there is zero and certain.

    Raises
    ------
    CalibrationFileError
        If the document has no matrix of either triad.
    """
    values, covariance = vector_of_model(calibration.model), np.zeros((SIZE, SIZE))
    order = {name: at for at, name in enumerate(entry_names())}
    known = [k for k, name in enumerate(calibration.covariance_parameters) if name in order]
    at = [order[calibration.covariance_parameters[k]] for k in known]
    if at:
        covariance[np.ix_(at, at)] = calibration.covariance_matrix[np.ix_(known, known)]
    return values, covariance


def vector_of_model(model: ImuModel) -> Series:
    """Return the (45,) numbers of a model."""
    values = np.zeros(SIZE)
    for kind, triad in (("accelerometer", model.accelerometer), ("gyroscope", model.gyroscope)):
        for term in ("matrix", "bias", *CURVES):
            given = None if triad is None else getattr(triad, term)
            if given is not None:
                values[PLACES[f"{kind}.{term}"][0]] = np.ravel(given)
    if model.g_sensitivity is not None:
        values[PLACES["gyroscope.g_sensitivity"][0]] = model.g_sensitivity.ravel()
    return values


def term_of(values: Complex, name: str) -> Complex:
    """Return a term of the vector in its own shape."""
    place, shape = PLACES[name]
    return values[place].reshape(shape)


def put(values: Complex, name: str, term: Complex) -> None:
    """Write a term into the vector."""
    values[PLACES[name][0]] = term.ravel()


def model_of_vector(values: Series, like: ImuModel) -> ImuModel:
    """Return the model of a vector, with the terms that another model has."""

    def triad(kind: str, known: Triad | None) -> Triad | None:
        if known is None:
            return None
        return Triad(
            term_of(values, f"{kind}.matrix").copy(),
            term_of(values, f"{kind}.bias").copy(),
            **{name: term_of(values, f"{kind}.{name}").copy() for name, _, _ in known.curves()},
        )

    return ImuModel(
        triad("accelerometer", like.accelerometer),
        triad("gyroscope", like.gyroscope),
        None if like.g_sensitivity is None else term_of(values, "gyroscope.g_sensitivity").copy(),
    )


def named_parameters(model: ImuModel, covariance: Square, units: RawUnits) -> list[ParameterBlock]:
    """Return biases, scale factors and misalignments of both triads against the frame's axes, with uncertainties.

    Parameters
    ----------
    model : with the terms that there are.
    covariance : (45, 45), of `vector_of_model`.
    units : of raw numbers.
    """
    labels, values, spread = parameter_vector(model, covariance, units)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    return [
        ParameterBlock(name=name, value=float(value), standard_uncertainty=float(sigma), unit=unit)
        for (name, unit), value, sigma in zip(labels, values, sigmas, strict=True)
    ]


def parameter_vector(
    model: ImuModel, covariance: Square, units: RawUnits
) -> tuple[list[tuple[str, str]], Series, Table]:
    """Return names with units, values (n,) and covariance (n, n) of what `named_parameters` lists.

    Parameters
    ----------
    model : with the terms that there are.
    covariance : (45, 45), of `vector_of_model`.
    units : of raw numbers.
    """
    labels: list[tuple[str, str]] = []
    functions: list[Callable[[Complex], Complex]] = []
    for kind, triad, unit, factor_of in (
        ("accelerometer", "accelerometer", units.specific_force, specific_force_factor),
        ("gyroscope", "gyro", units.angular_rate, angular_rate_factor),
    ):
        if getattr(model, kind) is not None:
            factor = factor_of(unit)
            labels += triad_labels(triad, unit, "misalignment", (), si=factor is not None)
            functions.append(_triad_parameters(kind, factor))
    if not labels:
        return [], np.zeros(0), np.zeros((0, 0))

    def evaluate(x: Complex) -> Complex:
        return np.concatenate([function(x) for function in functions])

    values, spread = propagate(evaluate, vector_of_model(model), covariance)
    return labels, np.real(values), spread


def _triad_parameters(kind: str, factor: float | None) -> Callable[[Complex], Complex]:
    def evaluate(x: Complex) -> Complex:
        matrix = term_of(x, f"{kind}.matrix")
        length = np.sqrt(np.sum(matrix * matrix, axis=1))
        scale = length if factor is None else length * factor - 1.0
        angles = [np.arcsin(matrix[i, j] / length[i]) for i in range(3) for j in range(3) if i != j]
        return np.concatenate([term_of(x, f"{kind}.bias"), scale, np.array(angles)])

    return evaluate


def turned_to(calibration: Calibration, frame: str) -> Calibration:
    """Return the calibration in another frame, covariance and temperature included: nothing is lost.

    Corrected vectors are turned; the turn depends on the matrix that fixes the frame, which the covariance
    counts. Of a thermal block the coefficients are turned with it (the turn's own uncertainty is not counted
    there). A magnetometer is turned, too; of its covariance the turn's own uncertainty is not counted.

    Parameters
    ----------
    calibration : with a matrix of the triad that fixes the frame.
    frame : a name of `FRAMES`.

    Raises
    ------
    UsageError
        If the frame is unknown, the triad that fixes it is missing or left-handed.
    CalibrationFileError
        If the document has no matrix of either triad.
    """
    if frame not in FRAMES:
        raise UsageError(f"There is no frame {frame!r}: choose one of {', '.join(FRAMES)}.")
    model = calibration.model
    fixed_by = "gyroscope" if frame == "mean-gyro" else "accelerometer"
    triad = getattr(model, fixed_by)
    if triad is None:
        raise UsageError(f"The frame {frame!r} is fixed by the {fixed_by}, which is not calibrated.")
    if np.linalg.det(triad.matrix) <= 0.0:
        raise UsageError(
            f"The {fixed_by} matrix is left-handed: an axis is reversed; put its sign right first."
        )

    def rotation(x: Complex) -> Complex:
        matrix = term_of(x, f"{fixed_by}.matrix")
        return polar_rotation(matrix) if frame == "mean-gyro" else frame_rotation(matrix, frame)

    def turn(x: Complex) -> Complex:
        C = rotation(x)
        moved = x.copy()
        for name in ("accelerometer.matrix", "gyroscope.matrix", "gyroscope.g_sensitivity"):
            put(moved, name, term_of(x, name) @ C.T)
        return moved

    values, covariance = stacked(calibration)
    moved, spread = propagate(turn, values, covariance)
    C, turned = np.real(rotation(values.astype(complex))), model_of_vector(moved, like=model)
    kept = [
        at
        for term, (place, _) in PLACES.items()
        for at in range(place.start, place.stop)
        if _has(turned, term) and np.any(np.diag(spread)[place] > 0.0)
    ]
    names, units = entry_names(), calibration.raw_units
    accelerometer, gyroscope = triad_blocks(turned)
    remark = f"Turned from the frame {calibration.frame.name} to {frame}, covariance carried."
    field, arms = calibration.magnetometer, calibration.lever_arms
    return msgspec.structs.replace(
        calibration,
        frame=FrameBlock(name=frame, description=FRAMES[frame]),
        accelerometer=accelerometer,
        gyroscope=gyroscope,
        parameters=named_parameters(turned, spread, units),
        limits=None,
        covariance_parameters=[names[at] for at in kept],
        covariance=(0.5 * (spread + spread.T))[np.ix_(kept, kept)].tolist(),
        test_vectors=test_vectors(turned, (units.specific_force, units.angular_rate)),
        remarks=[*calibration.remarks, remark],
        thermal=_turned_thermal(calibration, C, turned),
        lever_arms=None if arms is None else rows_of(np.array(arms) @ C.T),
        magnetometer=None if field is None else field.turned(C),
        turn_ons=None,
    )


def _turned_thermal(calibration: Calibration, C: Table, reference: ImuModel) -> Any:
    """The thermal block with coefficients of matrices turned; biases are the sensors' own."""
    thermal = calibration.thermal_model
    if thermal is None or calibration.thermal is None:
        return None
    other = replace(thermal.turned(C), reference=reference)
    names = list(calibration.thermal.covariance_parameters)
    effect = np.eye(len(names))
    place = {name: at for at, name in enumerate(names)}
    for name, at in place.items():
        stem, _, index = name.rstrip("]").rpartition("[")
        if ("matrix" in stem or "g_sensitivity" in stem) and index.count(",") == 2:
            k, i, j = index.split(",")
            effect[at, at] = 0.0
            for m in range(3):
                effect[at, place[f"{stem}[{k},{i},{m}]"]] = C[int(j), m]
    covariance = effect @ np.array(calibration.thermal.covariance) @ effect.T
    return thermal_block(other, names, covariance)


def _has(model: ImuModel, term: str) -> bool:
    if term == "gyroscope.g_sensitivity":
        return model.g_sensitivity is not None
    kind, _, name = term.partition(".")
    triad = getattr(model, kind)
    return triad is not None and getattr(triad, name) is not None
