"""What the types of a document's fields cannot show: sizes, singular matrices, unknown units, false test vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Vectors
from tumble.document.magnetometer_block import MagnetometerBlock
from tumble.document.part import Row
from tumble.document.soundness import is_invertible, stated_covariance_fault
from tumble.document.thermal_block import contradiction as thermal_contradiction
from tumble.errors import TumbleError
from tumble.files import HIDDEN
from tumble.sensor import ImuModel
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.document.result import Calibration

# Of the corrected vector: the numbers are written with all digits, and a corrector's round-off is 1e-12 or so.
_SAME = 1e-6


def contradiction_in(calibration: Calibration) -> str | None:
    """Return what in a document contradicts itself, in words that begin with the key, or None."""
    if fault := stated_covariance_fault(calibration.covariance, calibration.covariance_parameters):
        return f"covariance: {fault}"
    for key in ("model", "serial_number"):
        if HIDDEN.search(getattr(calibration.imu, key) or ""):
            return f"imu.{key}: it holds a line break or another control character, which no name has"
    for key, value in calibration.notes.items():
        if HIDDEN.search(key) or HIDDEN.search(value):
            return f"notes.{key!r}: it holds a line break or another control character"
    for name, block in (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)):
        if (
            block is not None
            and block.matrix is not None
            and not is_invertible(np.array(block.matrix, dtype=float))
        ):
            return f"{name}.matrix: it cannot be inverted"
    try:
        _ = calibration.raw_units.factors
    except TumbleError as error:
        return f"raw_units: {str(error).rstrip('.')}"
    if calibration.magnetometer is not None and (found := _of_magnetometer(calibration.magnetometer)):
        return f"magnetometer.{found}"
    if calibration.thermal is not None and (
        found := thermal_contradiction(calibration.thermal, calibration.model)
    ):
        return found
    return _false_vector(calibration)


def _of_magnetometer(block: MagnetometerBlock) -> str | None:
    try:
        magnetic_field_factor(block.raw_unit)
    except TumbleError as error:
        return f"raw_unit: {str(error).rstrip('.')}"
    if fault := stated_covariance_fault(block.covariance, block.covariance_parameters):
        return f"covariance: {fault}"
    triad = block.triad
    if triad is None:
        return None
    if not is_invertible(triad.matrix):
        return "matrix: it cannot be inverted"
    for number, one in enumerate(block.test_vectors, 1):
        found = triad.correct(np.array([one.raw_magnetic_field]))[0]
        told = np.array(one.magnetic_field)
        if not np.all(np.abs(found - told) <= _SAME * float(np.linalg.norm(told)) + 1e-300):
            return f"test_vectors: number {number} contradicts its matrix and bias"
    return None


def _false_vector(calibration: Calibration) -> str | None:
    """Compare the test vectors with what the document's own numbers make of them."""
    if calibration.accelerometer is None and calibration.gyroscope is None:
        return None
    for number, vector in enumerate(calibration.test_vectors, 1):
        model = _model_of(calibration)
        if model is None:
            return None
        with np.errstate(all="ignore"):
            force, rate = corrected(model, _one(vector.raw_specific_force), _one(vector.raw_angular_rate))
        for name, found, told in (
            ("accelerometer", force, vector.specific_force),
            ("gyroscope", rate, vector.angular_rate),
        ):
            if found is None or told is None:
                continue
            with np.errstate(all="ignore"):
                size = 1.0 + float(np.linalg.norm(told))
                same = np.all(np.abs(found - np.array([told])) <= _SAME * size) and size < np.inf
            if not same:
                return (
                    f"test_vectors: number {number} contradicts the {name}'s matrix and bias: a number was changed "
                    "after the file was written. Write it anew by `tumble calibrate`"
                )
    return None


def _one(row: Row | None) -> Vectors | None:
    return None if row is None else np.array([row], dtype=float)


def _model_of(calibration: Calibration) -> ImuModel | None:
    blocks = (calibration.accelerometer, calibration.gyroscope)
    return None if all(block is None or block.matrix is None for block in blocks) else calibration.model


def corrected(
    model: ImuModel, raw_force: Vectors | None, raw_rate: Vectors | None
) -> tuple[Vectors | None, Vectors | None]:
    """Return both triads corrected by one model; None for a triad that it lacks, or of which there are no numbers.

    Parameters
    ----------
    model, raw_force, raw_rate : without a specific force beside it the gyros' g-sensitivity is left alone.
    """
    force = rate = None
    if model.accelerometer is not None and raw_force is not None:
        force = model.accelerometer.correct(raw_force)
    if model.gyroscope is not None and raw_rate is not None:
        if model.g_sensitivity is not None and force is not None:
            raw_rate = raw_rate - force @ model.g_sensitivity.T
        rate = model.gyroscope.correct(raw_rate)
    return force, rate
