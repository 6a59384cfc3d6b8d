"""From the unknowns of a thermal adjustment to a thermal model in raw units, with its covariance."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.calibration.canonical import G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, SCALE
from tumble.calibration.equations.turn import TOTAL
from tumble.calibration.thermal.evidence import BiasCurve
from tumble.calibration.thermal.layout import ENTRIES, Layout, ThermalTerms
from tumble.calibration.thermal.turns import TurnedMatrix
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.propagation import propagate
from tumble.sensor.thermal import ThermalModel

Complex = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class ThermalSolution:
    """A thermal model and how well everything in it is known.

    Attributes
    ----------
    model : raw units.
    names, covariance : of `model.names`, raw units.
    unknowns, unknowns_covariance : (36,), (36, 36) of the reference, as `describe_unknowns` takes them.
    lag_sigma, width_sigma : s and K; NaN for what was not estimated.
    """

    model: ThermalModel
    names: list[str]
    covariance: Table
    unknowns: Series
    unknowns_covariance: Table
    lag_sigma: float
    width_sigma: float


def thermal_solution(
    values: Series,
    covariance: Square,
    layout: Layout,
    *,
    lag: float,
    width: float,
    factors: tuple[float, float],
    span: tuple[float, float],
    largest_rate: float,
) -> ThermalSolution:
    """Return the model of an adjustment's unknowns.

    Parameters
    ----------
    values, covariance, layout : of the adjustment in near SI.
    lag, width : s and K that it ended with.
    factors : near SI per raw unit, of the accelerometers and of the gyros.
    span, largest_rate : °C and K/s of the calibration.
    """
    shared = layout.shared
    inner, spread = values[:shared], covariance[:shared, :shared]
    unknowns, unknowns_covariance = propagate(lambda x: _reference(x, layout, factors), inner, spread)
    moved = _thermal_matrix(layout, factors)
    model = _model(inner, layout, lag, width, factors, span, largest_rate)
    covariance_of_names = moved @ spread @ moved.T
    sigma = np.sqrt(np.maximum(np.diag(spread), 0.0))

    def sigma_of(name: str) -> float:
        place = layout.places[name]
        return float(sigma[place][0]) if place.stop > place.start else float("nan")

    return ThermalSolution(
        model,
        model.names,
        covariance_of_names,
        unknowns,
        unknowns_covariance,
        sigma_of("lag"),
        sigma_of("width"),
    )


def with_turned_matrix(
    values: Series, covariance: Square, layout: Layout, turned: TurnedMatrix
) -> tuple[Series, Table, Layout]:
    """Return the unknowns that the placements share, with the gyros' matrix behind them.

    Parameters
    ----------
    values, covariance, layout : of the rests' adjustment.
    turned : from the turns.
    """
    shared = layout.shared
    added = np.concatenate([turned.nominal.ravel(), turned.changes.ravel()])
    whole = np.zeros((shared + added.size, shared + added.size))
    whole[:shared, :shared] = covariance[:shared, :shared]
    whole[shared:, shared:] = turned.covariance
    whole[shared:, :shared], whole[:shared, shared:] = turned.shared, turned.shared.T
    longer = Layout(layout.terms, layout.has_force, layout.has_rate, 0)
    longer.places["N0"] = slice(shared, shared + 9)
    longer.places["N"] = slice(shared + 9, shared + added.size)
    for name in ("directions", "earth"):
        longer.places.pop(name, None)
    longer.size = shared + added.size
    return np.concatenate([values[:shared], added]), whole, longer


def _reference(x: Complex, layout: Layout, factors: tuple[float, float]) -> Complex:
    """Return the 36 unknowns of the reference, raw (analytic)."""
    places, terms = layout.places, layout.terms
    result = np.zeros(TOTAL, dtype=x.dtype)
    if layout.has_force:
        matrix = np.eye(3, dtype=x.dtype)
        for k, (i, j) in enumerate(ENTRIES[: layout.entries]):
            matrix[i, j] = x[places["M0"]][k]
        scale, angles = shin_from_matrix(matrix / factors[0])
        result[SCALE], result[ANGLE] = scale, angles
        if terms.poses:
            result[BIAS] = x[places["b0"]] / factors[0]
    if layout.has_rate:
        gyro = np.eye(3, dtype=x.dtype)
        if "N0" in places:
            gyro = gyro + x[places["N0"]].reshape(3, 3)
        result[GYRO_MATRIX] = (gyro / factors[1]).ravel()
        result[GYRO_BIAS] = x[places["gb0"]] / factors[1]
        if terms.g_sensitivity:
            result[G_SENSITIVITY] = x[places["G"]] / factors[1]
    return result


def _names(layout: Layout) -> list[tuple[str, str, int]]:
    """Return (name in the model, kind of unknown, triad) of what is in the model, in the order of its names."""
    terms = layout.terms
    found: list[tuple[str, str, int]] = []
    if layout.has_force:
        found.append(("accelerometer.bias", "b", 0))
        if layout.entries and terms.matrix_functions:
            found.append(("accelerometer.matrix", "M", 0))
    if layout.has_rate:
        found.append(("gyroscope.bias", "gb", 1))
        if "N" in layout.places and layout.places["N"].stop > layout.places["N"].start:
            found.append(("gyroscope.matrix", "N", 1))
    for used, force, rate in ((terms.rate, "r", "gr"), (terms.hysteresis, "h", "gh")):
        if used:
            found += [("accelerometer.bias", force, 0)] if layout.has_force else []
            found += [("gyroscope.bias", rate, 1)] if layout.has_rate else []
    return found


def _thermal_matrix(layout: Layout, factors: tuple[float, float]) -> Table:
    """Return (thermal names, shared unknowns): how the model's numbers follow from the unknowns."""
    rows: list[AnyArray] = []
    size, functions = layout.shared, layout.terms.basis.size
    for name, kind, triad in _names(layout):
        place = layout.places[kind]
        if kind == "N":
            block = np.zeros((9 * functions, size))
            count = place.stop - place.start
            block[:count, place] = np.eye(count) / factors[triad]
            rows.append(block)
        elif name.endswith("matrix"):
            block = np.zeros((functions, 3, 3, size))
            for f in range(layout.terms.matrix_functions):
                for k, (i, j) in enumerate(ENTRIES[: layout.entries]):
                    block[f, i, j, place.start + f * layout.entries + k] = 1.0 / factors[triad]
            rows.append(block.reshape(-1, size))
        else:
            block = np.zeros((place.stop - place.start, size))
            block[:, place] = np.eye(place.stop - place.start) / factors[triad]
            rows.append(block)
    return np.concatenate(rows)


def _model(
    x: Series,
    layout: Layout,
    lag: float,
    width: float,
    factors: tuple[float, float],
    span: tuple[float, float],
    largest_rate: float,
) -> ThermalModel:
    terms = layout.terms
    reference = _reference(x, layout, factors)
    accelerometer = gyroscope = sensitivity = None
    if layout.has_force:
        matrix = np.eye(3)
        for k, (i, j) in enumerate(ENTRIES[: layout.entries]):
            matrix[i, j] = x[layout.places["M0"]][k]
        accelerometer = Triad(matrix / factors[0], reference[BIAS].copy())
    if layout.has_rate:
        gyroscope = Triad(reference[GYRO_MATRIX].reshape(3, 3).copy(), reference[GYRO_BIAS].copy())
        if terms.g_sensitivity:
            sensitivity = reference[G_SENSITIVITY].reshape(3, 3).copy()
    numbers = _thermal_matrix(layout, factors) @ x
    coefficients: dict[str, AnyArray] = {}
    rates: dict[str, Series] = {}
    loops: dict[str, Series] = {}
    at, functions = 0, terms.basis.size
    for name, kind, _ in _names(layout):
        shape = (functions, 3, 3) if name.endswith("matrix") else (functions, 3)
        if kind.endswith(("r", "h")) and kind not in ("b", "gb"):
            (rates if kind.endswith("r") else loops)[name] = numbers[at : at + 3]
            at += 3
            continue
        count = int(np.prod(shape))
        coefficients[name] = numbers[at : at + count].reshape(shape)
        at += count
    return ThermalModel(
        ImuModel(accelerometer, gyroscope, sensitivity),
        terms.basis,
        coefficients,
        rates,
        loops,
        hysteresis_width=width,
        lag=lag,
        span_celsius=span,
        largest_rate=largest_rate,
    )


def bias_curve(
    triad: str,
    values: Series,
    covariance: Square,
    layout: Layout,
    factor: float,
    celsius: Series,
) -> BiasCurve:
    """Return a triad's bias over temperature with its standard uncertainty.

    Parameters
    ----------
    triad : "force" or "rate".
    values, covariance, layout : of the adjustment.
    factor : near SI per raw unit.
    celsius : where.
    """
    terms: ThermalTerms = layout.terms
    mark = "" if triad == "force" else "g"
    functions = terms.basis.values(celsius)
    bias, sigma = np.zeros((celsius.size, 3)), np.zeros((celsius.size, 3))
    loop = np.zeros(3)
    if terms.hysteresis:
        loop = values[layout.places[f"{mark}h"]] / factor
    for axis in range(3):
        row = np.zeros((celsius.size, layout.size))
        place = layout.places[f"{mark}b0"]
        if place.stop > place.start:
            row[:, place.start + axis] = 1.0
        for k in range(terms.basis.size):
            row[:, layout.places[f"{mark}b"].start + 3 * k + axis] = functions[:, k]
        bias[:, axis] = row @ values / factor
        sigma[:, axis] = np.sqrt(np.maximum(np.einsum("np,pq,nq->n", row, covariance, row), 0.0)) / factor
    return BiasCurve(celsius, bias, sigma, bias + loop, bias - loop)
