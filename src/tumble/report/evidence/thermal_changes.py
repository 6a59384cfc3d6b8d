"""What a thermal calibration comes to, for the terminal: how far each bias moves with temperature.

The coefficients themselves, dozens of them, are in the document and in the report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.report.page import Table
from tumble.report.parameters import TEMPERATURE, parameter_rows, plain_unit
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.document.result import Calibration
    from tumble.document.thermal_block import ThermalBlock

# Degrees per radian, and millis: what biases are read in.
_SHOWN = {"m/s^2": (1e3, "mm/s²"), "rad/s": (float(np.degrees(1.0)), "°/s")}
# Temperatures in a table for a wide terminal, and for another.
WIDE, MOST_POINTS, FEWEST_POINTS = 118, 5, 3
_TRIADS = (("accelerometer", "specific_force"), ("gyroscope", "angular_rate"))


def thermal_changes(calibration: Calibration, *, width: int) -> Table | None:
    """Return each bias's change from the reference at temperatures over the span; None without a thermal block.

    Parameters
    ----------
    calibration : with the block.
    width : characters of the terminal.
    """
    block = calibration.thermal
    if block is None:
        return None
    celsius = _temperatures(block, MOST_POINTS if width >= WIDE else FEWEST_POINTS)
    rows: list[list[str]] = []
    for triad, quantity in _TRIADS:
        unit = getattr(calibration.raw_units, quantity)
        factor, shown = _SHOWN.get(unit, (1.0, plain_unit(unit)))
        name = "gyro" if triad == "gyroscope" else "acc."
        for axis in range(3):
            found = _changes(block, f"{triad}.bias", axis, celsius)
            if found is not None:
                changes = zip(*found, strict=True)
                words = [with_uncertainty(factor * value, factor * sigma) for value, sigma in changes]
                rows.append([f"{name} {'xyz'[axis]} / {shown}", *words])
    reference = f"change from {block.basis.reference_celsius:g} °C"
    heads = (reference, *(f"{at:.0f} °C" for at in celsius.tolist()))
    return Table(heads, rows, right=range(1, len(heads)))


def thermal_lines(calibration: Calibration) -> list[str]:
    """Return sentences on what else changes with temperature, and where its numbers are."""
    if calibration.thermal is None:
        return []
    rows = [row for row in parameter_rows(calibration) if row.group == TEMPERATURE]
    beside = [row for row in rows if "lag" in row.name or "width" in row.name]
    lines = [f"{row.label[0].upper()}{row.label[1:]}: {row.shown.text}." for row in beside]
    count = len(rows) - len(beside)
    what = "coefficient" if count == 1 else "coefficients"
    where = "report.html and calibration.json"
    return [*lines, f"{count} {what} of temperature with their uncertainties stand in {where}."]


def _temperatures(block: ThermalBlock, points: int) -> Series:
    """Return °C over the span, without those near the reference, where nothing has changed."""
    low, high = block.span_celsius
    at = np.linspace(low, high, points)
    return at[np.abs(at - block.basis.reference_celsius) > 0.05 * (high - low)]


def _changes(block: ThermalBlock, name: str, axis: int, celsius: Series) -> tuple[Series, Series] | None:
    """Return the changes of one axis's bias and their standard uncertainties, raw; None if it has none."""
    values = block.basis_values(celsius)
    names = [f"{name}.temperature[{k},{axis}]" for k in range(values.shape[1])]
    place = {parameter: k for k, parameter in enumerate(block.covariance_parameters)}
    if any(parameter not in place for parameter in names):
        return None
    at = [place[parameter] for parameter in names]
    covariance = np.array(block.covariance)[np.ix_(at, at)]
    coefficients = np.array(getattr(block.coefficients, name.replace(".", "_")), dtype=float)[:, axis]
    variance = np.einsum("tp,pq,tq->t", values, covariance, values)
    return values @ coefficients, np.sqrt(np.maximum(variance, 0.0))
