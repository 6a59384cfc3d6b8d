"""Biases over temperature as autopilots keep them, read back: polynomials about temperatures of their own."""

from __future__ import annotations

from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import CalibrationFileError
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.sensor.thermal import TemperatureBasis, ThermalModel


@dataclass(frozen=True, slots=True)
class Curve:
    """A triad's bias as a polynomial of temperature.

    Attributes
    ----------
    coefficients : (order + 1, 3), raw units per K^k, powers from 0.
    reference : °C that they are about.
    span : °C, lowest and highest.
    """

    coefficients: AnyArray
    reference: float
    span: tuple[float, float]

    def about(self, other: float) -> AnyArray:
        """Return the coefficients of the same polynomial about another temperature, °C."""
        order = self.coefficients.shape[0] - 1
        moved = np.zeros_like(self.coefficients)
        for j in range(order + 1):
            for k in range(j, order + 1):
                moved[j] += self.coefficients[k] * comb(k, j) * (other - self.reference) ** (k - j)
        return moved


def thermal_of(
    model: ImuModel, curves: dict[str, Curve], path: Path
) -> tuple[ThermalModel | None, list[str]]:
    """Return the model with its biases' curves about one temperature, None without any, and what is to be said.

    Parameters
    ----------
    model : at no particular temperature; the biases of the triads with a curve are replaced.
    curves : by triad, ``accelerometer`` and ``gyroscope``.
    path : of the file, for messages.

    Raises
    ------
    CalibrationFileError
        If a curve is not finite, or its span is none.
    """
    if not curves:
        return None, []
    for name, curve in curves.items():
        if not (
            np.all(np.isfinite(curve.coefficients)) and np.all(np.isfinite((curve.reference, *curve.span)))
        ):
            raise CalibrationFileError(
                f"{path}: the {name}'s temperature compensation holds no finite number."
            )
    low, high = max(c.span[0] for c in curves.values()), min(c.span[1] for c in curves.values())
    if not low < high:
        raise CalibrationFileError(
            f"{path}: the temperature compensation spans nothing ({low:g} to {high:g} °C)."
        )
    reference = next(iter(curves.values())).reference
    order = max(c.coefficients.shape[0] for c in curves.values()) - 1
    coefficients: dict[str, AnyArray] = {}
    for name, curve in curves.items():
        moved = curve.about(reference)
        model = replace(model, **{name: replace(getattr(model, name), bias=moved[0])})
        rows = np.zeros((order, 3))
        rows[: moved.shape[0] - 1] = moved[1:]
        coefficients[f"{name}.bias"] = rows
    said = [f"the temperature compensation holds from {low:g} to {high:g} °C"]
    if len({c.span for c in curves.values()}) > 1:
        said[0] += ", where both triads have one"
    basis = TemperatureBasis("polynomial", reference, order=order)
    # The autopilot takes the thermometer's number as it is.
    return ThermalModel(model, basis, coefficients, span_celsius=(low, high), smoothing=0.0), said
