"""A unit as one vector: biases, scale factors and misalignments of both triads in one frame, with their covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.document import Calibration, parameter_vector, stacked, turned_to
from tumble.errors import TumbleError
from tumble.records import dataclass
from tumble.sensor import FRAMES

FRAME = "accelerometer-x"
"""In which units are compared: calibrations in other gauges are turned to it."""
# Of a variance: below it a parameter is held by the frame and not estimated.
HELD = 1e-24


@dataclass(frozen=True)
class UnitVector:
    """Parameters of one unit.

    Attributes
    ----------
    names : of the parameters that were estimated.
    units : SI, or counts where raw numbers are counts.
    values, covariance : (n,) and (n, n).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Series
    covariance: Square


@dataclass(frozen=True)
class Units:
    """Units that can be compared.

    Attributes
    ----------
    names : of the parameters.
    units : of these.
    which : (m,) numbers of the units among those given.
    values : (m, n).
    covariances : (m, n, n).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    which: tuple[int, ...]
    values: Table
    covariances: np.ndarray


def unit_vector(calibration: Calibration) -> UnitVector | None:
    """Return a calibration as a vector, in SI where its raw units have a factor; None where it cannot be compared.

    Parameters
    ----------
    calibration : with a covariance; of a thermal one the parameters at its reference temperature.
    """
    if not calibration.covariance_parameters:
        return None
    if calibration.frame.name != FRAME and calibration.frame.name in FRAMES:
        try:
            calibration = turned_to(calibration, FRAME)
        except TumbleError:
            return None
    try:
        values, covariance = stacked(calibration)
    except TumbleError:
        return None
    labels, values, spread = parameter_vector(calibration.model, covariance, calibration.raw_units)
    given = calibration.raw_units
    si = zip(given.factors, ("m/s^2", "rad/s"), strict=True)
    raw = dict(zip((given.specific_force, given.angular_rate), si, strict=True))
    told = np.flatnonzero(np.diag(spread) > HELD * (1e-12 + values**2))
    scale = np.array([(raw.get(unit, (1.0, ""))[0] or 1.0) for _, unit in labels])[told]
    units = [raw[unit][1] if unit in raw and raw[unit][0] is not None else unit for _, unit in labels]
    return UnitVector(
        tuple(labels[i][0] for i in told),
        tuple(units[i] for i in told),
        values[told] * scale,
        spread[np.ix_(told, told)] * np.outer(scale, scale),
    )


def stack(vectors: Sequence[UnitVector | None]) -> Units | None:
    """Return the units that have the same parameters in the same units, the most that there are; None for none.

    Parameters
    ----------
    vectors : of units; None for one without.
    """
    counted: dict[tuple[tuple[str, ...], tuple[str, ...]], list[int]] = {}
    for number, vector in enumerate(vectors):
        if vector is not None and np.all(np.isfinite(vector.values)):
            counted.setdefault((vector.names, vector.units), []).append(number)
    if not counted:
        return None
    (names, units), which = max(counted.items(), key=lambda item: len(item[1]))
    chosen = [vector for number in which if (vector := vectors[number]) is not None]
    values = np.array([vector.values for vector in chosen])
    covariances = np.array([vector.covariance for vector in chosen])
    return Units(names, units, tuple(which), values, covariances)
