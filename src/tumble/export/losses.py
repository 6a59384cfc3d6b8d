"""What a target cannot hold, as sentences with sizes in ppm, µg and deg/h."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import ThermalModel
from tumble.units import STANDARD_GRAVITY

_DEG_PER_H = 180.0 / np.pi * 3600.0


@dataclass(frozen=True, slots=True)
class Loss:
    """Something that is not written.

    Attributes
    ----------
    text : what, and how large, without a full stop.
    size : of the true vector's length, where a limit makes sense.
    """

    text: str
    size: float | None = None


def of_matrix(triad: Triad, kept: Matrix, name: str, what: str) -> list[Loss]:
    """Return the loss of a matrix that is replaced by another one.

    Parameters
    ----------
    triad : the true one.
    kept : (3, 3) forward matrix that the target's correction takes out.
    name : of the sensors, in the plural.
    what : is left out.
    """
    wrong = np.linalg.solve(kept, triad.matrix) - np.eye(3)
    size = float(np.linalg.norm(wrong, 2))
    if size < 1e-9:
        return []
    where = f"{1e6 * size:.0f} µg in 1 g" if name == "accelerometers" else f"{size:.2g} rad/s at 1 rad/s"
    return [Loss(f"the {name}' {what} are left out: up to {1e6 * size:.0f} ppm, {where}", size)]


def of_g_sensitivity(gyroscope: Triad, sensitivity: Matrix) -> Loss:
    """Return the loss of a g-sensitivity."""
    size = float(np.linalg.norm(np.linalg.solve(gyroscope.matrix, sensitivity), 2)) * STANDARD_GRAVITY
    return Loss(
        f"the gyros' g-sensitivity is left out: up to {_DEG_PER_H * size:.3g} deg/h ({size:.2g} rad/s) in 1 g"
    )


def of_nonlinearity(triad: Triad, name: str) -> list[Loss]:
    """Return the loss of asymmetry and quadratic terms, at 1 g or 1 rad/s."""
    at = STANDARD_GRAVITY if name == "accelerometers" else 1.0
    size = 0.0
    if triad.asymmetry is not None:
        size += float(np.max(np.abs(triad.asymmetry)))
    if triad.quadratic is not None:
        size += float(np.max(np.abs(triad.quadratic) * np.linalg.norm(triad.matrix, axis=1))) * at
    if size == 0.0:
        return []
    where = "1 g" if name == "accelerometers" else "1 rad/s"
    return [
        Loss(
            f"the {name}' asymmetry and quadratic terms are left out: up to {1e6 * size:.0f} ppm at {where}",
            size,
        )
    ]


def of_lever_arms(lever_arms: Matrix) -> Loss:
    """Return the loss of lever arms, at 1 rad/s."""
    apart = float(np.max(np.linalg.norm(lever_arms[:, None] - lever_arms[None], axis=2)))
    return Loss(
        f"the accelerometers' lever arms are left out: they are up to {1e3 * apart:.2g} mm apart, which is "
        f"{1e3 * apart:.2g} mm/s² at 1 rad/s"
    )


def of_temperature(thermal: ThermalModel, there: ImuModel, celsius: float) -> Loss:
    """Return the loss of everything that changes with temperature, over the calibrated span."""
    low, high = thermal.span_celsius
    force = rate = 0.0
    for other in np.linspace(low, high, 9).tolist():
        for state in (-1.0, 1.0):
            model = thermal.at(other, 0.0, state)
            force = max(force, _moved(model.accelerometer, there.accelerometer, STANDARD_GRAVITY))
            rate = max(rate, _moved(model.gyroscope, there.gyroscope, 0.0))
    return Loss(
        f"what changes with temperature is left out, the numbers hold at {celsius:g} °C: "
        f"over {low:g} to {high:g} °C up to {1e6 * force / STANDARD_GRAVITY:.0f} µg and {_DEG_PER_H * rate:.3g} deg/h"
    )


def _moved(one: Triad | None, other: Triad | None, at: float) -> float:
    """How far a corrected vector of length `at` is off if one triad is corrected as the other."""
    if one is None or other is None:
        return 0.0
    bias = np.linalg.norm(np.linalg.solve(other.matrix, one.bias - other.bias))
    matrix = np.linalg.norm(np.linalg.solve(other.matrix, one.matrix) - np.eye(3), 2) * at
    return float(bias + matrix)
