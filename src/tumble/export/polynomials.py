"""Biases as cubic polynomials of temperature, which is all that autopilots take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix
from tumble.errors import UsageError
from tumble.export.losses import Loss
from tumble.export.subject import Subject
from tumble.records import dataclass
from tumble.sensor.thermal import ThermalModel
from tumble.units import STANDARD_GRAVITY

_NAMES = ("accelerometer", "gyroscope")


@dataclass(frozen=True, slots=True)
class Polynomials:
    """Both biases about a temperature.

    Attributes
    ----------
    coefficients : for each triad (order + 1, 3), raw units per K^k.
    used : whether the triad's bias changes with temperature at all.
    reference : °C that they are about.
    span : °C, lowest and highest.
    subject : with what the polynomials leave out among its losses.
    """

    coefficients: tuple[AnyArray, AnyArray]
    used: tuple[bool, bool]
    reference: float
    span: tuple[float, float]
    subject: Subject


def polynomials_of(subject: Subject, order: int, title: str) -> Polynomials:
    """Return the biases' polynomials: exact for a polynomial basis up to `order`, else fitted over the span.

    Parameters
    ----------
    subject : with or without a thermal model.
    order : highest power.
    title : of the target, for the sentence.

    Raises
    ------
    UsageError
        If the matrices' changes, which no autopilot takes, are larger than the wishes allow.
    """
    thermal = subject.thermal
    if thermal is None:
        zero = np.zeros((order + 1, 3))
        return Polynomials((zero, zero), (False, False), 0.0, (0.0, 0.0), subject)
    reference, span = thermal.basis.reference_celsius, thermal.span_celsius
    grid = np.linspace(*span, 201)
    functions = thermal.basis.values(grid)
    exact = thermal.basis.kind == "polynomial" and thermal.basis.order <= order
    fitted: list[AnyArray] = []
    used: list[bool] = []
    wrong: list[float] = []
    for name, triad in zip(_NAMES, (subject.accelerometer, subject.gyroscope), strict=True):
        rows = thermal.coefficients.get(f"{name}.bias")
        coefficients = np.zeros((order + 1, 3))
        coefficients[0] = triad.bias
        misfit = 0.0
        if rows is not None and exact:
            coefficients[1 : rows.shape[0] + 1] = rows
        elif rows is not None:
            powers = (grid - reference)[:, None] ** np.arange(order + 1)
            truth = triad.bias + functions @ rows
            coefficients = np.linalg.lstsq(powers, truth, rcond=None)[0]
            misfit = float(np.max(np.abs(powers @ coefficients - truth)))
        fitted.append(np.asarray(coefficients, dtype=np.float64))
        used.append(rows is not None)
        wrong.append(misfit)
    lost = [*_misfits(wrong), *_rest(thermal)]
    limit = subject.wishes.largest_loss
    for loss in lost:
        if loss.size is not None and loss.size > limit:
            raise UsageError(
                f"{title} cannot hold this calibration: {loss.text}; accept it with --largest-loss PPM above "
                f"{1e6 * loss.size:.0f}."
            )
    return Polynomials(
        (fitted[0], fitted[1]),
        (used[0], used[1]),
        reference,
        (float(span[0]), float(span[1])),
        replace(subject, losses=(*subject.losses, *lost)),
    )


def _misfits(wrong: list[float]) -> list[Loss]:
    if not any(wrong):
        return []
    return [
        Loss(
            "the curves of temperature are cubic polynomials here: off by up to "
            f"{1e6 * wrong[0] / STANDARD_GRAVITY:.0f} µg and {np.degrees(wrong[1]) * 3600:.3g} deg/h"
        )
    ]


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
    force = thermal.hysteresis.get("accelerometer.bias")
    rate = thermal.hysteresis.get("gyroscope.bias")
    if force is not None or rate is not None:
        lost.append(
            Loss(
                "hysteresis of temperature is left out: up to "
                f"{_largest(force) * 1e6 / STANDARD_GRAVITY:.0f} µg and {np.degrees(_largest(rate)) * 3600:.3g} deg/h"
            )
        )
    if thermal.rate_coefficients or thermal.lag > 0.0:
        lost.append(Loss("the dependence on the rate of temperature and the thermometer's lag are left out"))
    return lost


def _largest(values: AnyArray | None) -> float:
    return 0.0 if values is None else float(np.max(np.abs(values)))
