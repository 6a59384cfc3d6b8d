"""The numbers of a document as one vector with its covariance, and what people call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table
from tumble.document.result import Calibration, ParameterBlock, RawUnits
from tumble.parameters.family import triad_labels
from tumble.sensor import ImuModel, Triad, propagate
from tumble.sensor.triad import CURVES
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]

# Where each term stands in the vector, and its shape.
PLACES: dict[str, tuple[slice, tuple[int, ...]]] = {
    "accelerometer.matrix": (slice(0, 9), (3, 3)),
    "accelerometer.bias": (slice(9, 12), (3,)),
    "accelerometer.asymmetry": (slice(12, 15), (3,)),
    "accelerometer.quadratic": (slice(15, 18), (3,)),
    "gyroscope.matrix": (slice(18, 27), (3, 3)),
    "gyroscope.bias": (slice(27, 30), (3,)),
    "gyroscope.asymmetry": (slice(30, 33), (3,)),
    "gyroscope.quadratic": (slice(33, 36), (3,)),
    "gyroscope.g_sensitivity": (slice(36, 45), (3, 3)),
}
SIZE = 45


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


def part(values: Complex, name: str) -> Complex:
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
            part(values, f"{kind}.matrix").copy(),
            part(values, f"{kind}.bias").copy(),
            **{name: part(values, f"{kind}.{name}").copy() for name, _, _ in known.curves()},
        )

    return ImuModel(
        triad("accelerometer", like.accelerometer),
        triad("gyroscope", like.gyroscope),
        None if like.g_sensitivity is None else part(values, "gyroscope.g_sensitivity").copy(),
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
        matrix = part(x, f"{kind}.matrix")
        length = np.sqrt(np.sum(matrix * matrix, axis=1))
        scale = length if factor is None else length * factor - 1.0
        angles = [np.arcsin(matrix[i, j] / length[i]) for i in range(3) for j in range(3) if i != j]
        return np.concatenate([part(x, f"{kind}.bias"), scale, np.array(angles)])

    return evaluate
