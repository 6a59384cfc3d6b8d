"""Biases over temperature as autopilots keep them: cubic polynomials, written and read back."""

from __future__ import annotations

from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np

from tumble.arrays import AnyArray, Matrix
from tumble.errors import CalibrationFileError
from tumble.export.losses import Loss
from tumble.parameters import amount
from tumble.records import dataclass
from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel

_NAMES = ("accelerometer", "gyroscope")


_ORDER = 3


@dataclass(frozen=True)
class Polynomials:
    """Both biases about a temperature.

    Attributes
    ----------
    coefficients : for each triad (4, 3), raw units per K^k.
    used : whether the triad's bias changes with temperature at all.
    reference : °C that they are about.
    span : °C, lowest and highest.
    """

    coefficients: tuple[AnyArray, AnyArray]
    used: tuple[bool, bool]
    reference: float
    span: tuple[float, float]

    def at(self, celsius: float, model: ImuModel) -> ImuModel:
        """Return a model with the biases of a temperature, where they change."""
        for name, used, rows in zip(_NAMES, self.used, self.coefficients, strict=True):
            if used:
                bias = (celsius - self.reference) ** np.arange(_ORDER + 1) @ rows
                model = replace(model, **{name: replace(getattr(model, name), bias=bias)})
        return model

    def about(self, other: float, number: int) -> AnyArray:
        """Return a triad's polynomial about another temperature, °C."""
        return Curve(self.coefficients[number], self.reference, self.span).about(other)


NO_CURVES = Polynomials(
    (np.zeros((_ORDER + 1, 3)), np.zeros((_ORDER + 1, 3))), (False, False), 0.0, (0.0, 0.0)
)


def polynomials_of(thermal: ThermalModel) -> tuple[Polynomials, list[Loss]]:
    """Return the biases' cubics, exact for a polynomial basis up to that order and else fitted, and what they lose.

    They are about the reference temperature, or the end of the span that is next to it.
    """
    reference, span = thermal.basis.reference_celsius, thermal.span_celsius
    grid = np.linspace(*span, 201)
    functions = thermal.basis.values(grid)
    exact = thermal.basis.kind == "polynomial" and thermal.basis.order <= _ORDER
    fitted: list[AnyArray] = []
    wrong: list[float] = []
    for name in _NAMES:
        rows = thermal.coefficients.get(f"{name}.bias")
        triad = getattr(thermal.reference, name)
        bias = np.zeros(3) if triad is None else triad.bias
        coefficients = np.zeros((_ORDER + 1, 3))
        coefficients[0] = bias
        misfit = 0.0
        if rows is not None and exact:
            coefficients[1 : rows.shape[0] + 1] = rows
        elif rows is not None:
            powers = (grid - reference)[:, None] ** np.arange(_ORDER + 1)
            truth = bias + functions @ rows
            coefficients = np.linalg.lstsq(powers, truth, rcond=None)[0]
            misfit = float(np.max(np.abs(powers @ coefficients - truth)))
        fitted.append(np.asarray(coefficients, dtype=np.float64))
        wrong.append(misfit)
    used = [f"{name}.bias" in thermal.coefficients for name in _NAMES]
    # ArduPilot holds the temperature of its offsets within the span, too.
    within = float(np.clip(reference, *span))
    first, second = (Curve(rows, reference, span).about(within) for rows in fitted)
    made = Polynomials((first, second), (used[0], used[1]), within, span)
    lost = _rest(thermal)
    if any(wrong):
        off = f"{amount(wrong[0], 'm/s^2')} and {amount(wrong[1], 'rad/s')}"
        lost.insert(0, Loss(f"the curves of temperature are cubic polynomials here: off by up to {off}"))
    return made, lost


def _rest(thermal: ThermalModel) -> list[Loss]:
    """What changes with temperature besides the biases' functions."""
    lost: list[Loss] = []
    low, high = thermal.span_celsius
    size = 0.0
    for name in _NAMES:
        if f"{name}.matrix" in thermal.coefficients:
            known: Matrix = getattr(thermal.reference, name).matrix
            for celsius in np.linspace(low, high, 9).tolist():
                there: Matrix = getattr(thermal.at(celsius), name).matrix
                size = max(size, float(np.linalg.norm(np.linalg.solve(known, there) - np.eye(3), 2)))
    if size > 0.0:
        lost.append(
            Loss(
                f"matrices that change with temperature are left out: up to {1e6 * size:.0f} ppm over the span",
                size,
            )
        )
    sizes = [float(np.max(np.abs(thermal.hysteresis.get(f"{name}.bias", 0.0)))) for name in _NAMES]
    if thermal.hysteresis:
        lost.append(
            Loss(
                "hysteresis of temperature is left out: up to "
                f"{amount(sizes[0], 'm/s^2')} and {amount(sizes[1], 'rad/s')}"
            )
        )
    if thermal.rate_coefficients or thermal.lag > 0.0:
        lost.append(Loss("the dependence on the rate of temperature and the thermometer's lag are left out"))
    return lost


@dataclass(frozen=True)
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
        If the span is none.
    """
    if not curves:
        return None, []
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
