"""What the types of a document's fields cannot show: sizes, singular matrices, unknown units, false test vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Vectors
from tumble.document.soundness import covariance_fault
from tumble.document.thermal_block import contradiction as thermal_contradiction
from tumble.errors import TumbleError
from tumble.files import HIDDEN
from tumble.sensor import ImuModel
from tumble.units import angular_rate_factor, specific_force_factor

if TYPE_CHECKING:
    from tumble.document.result import Calibration, TestVector

# Of sensing axes as unit vectors; three within a degree of one plane have 0.017.
SMALLEST_DETERMINANT = 1e-6
# Of the corrected vector: the numbers are written with all digits, and a corrector's round-off is 1e-12 or so.
_SAME = 1e-6


def contradiction_in(calibration: Calibration) -> str | None:
    """Return what in a document contradicts itself, in words that begin with the key, or None."""
    size = len(calibration.covariance_parameters)
    if len(calibration.covariance) != size or any(len(row) != size for row in calibration.covariance):
        return f"covariance: it is not {size} by {size}, as covariance_parameters has it"
    if fault := covariance_fault(calibration.covariance_matrix, calibration.covariance_parameters):
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
        specific_force_factor(calibration.raw_units.specific_force)
        angular_rate_factor(calibration.raw_units.angular_rate)
    except TumbleError as error:
        return f"raw_units: {str(error).rstrip('.')}"
    if calibration.magnetometer is not None:
        found = calibration.magnetometer.contradiction()
        if found is not None:
            return found
    if calibration.thermal is not None:
        found = thermal_contradiction(calibration.thermal, calibration.model)
        if found is not None:
            return found
    return _false_vector(calibration)


def is_invertible(matrix: np.ndarray) -> bool:
    """Say whether three sensing axes, the rows of a finite matrix, are not in one plane."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        length = np.linalg.norm(matrix, axis=1, keepdims=True)
        if not (np.all(np.isfinite(length)) and np.all(length > 0.0)):
            return False
        return abs(float(np.linalg.det(matrix / length))) >= SMALLEST_DETERMINANT


def _false_vector(calibration: Calibration) -> str | None:
    """Compare the test vectors with what the document's own numbers make of them."""
    if calibration.accelerometer is None and calibration.gyroscope is None:
        return None
    for number, vector in enumerate(calibration.test_vectors, 1):
        model = _model_of(calibration)
        if model is None:
            return None
        with np.errstate(all="ignore"):
            force, rate = _corrected(model, vector)
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


def _model_of(calibration: Calibration) -> ImuModel | None:
    blocks = (calibration.accelerometer, calibration.gyroscope)
    return None if all(block is None or block.matrix is None for block in blocks) else calibration.model


def _corrected(model: ImuModel, vector: TestVector) -> tuple[Vectors | None, Vectors | None]:
    """Correct one test vector, each triad that the model and the vector have."""
    force = rate = None
    if model.accelerometer is not None and vector.raw_specific_force is not None:
        force = model.accelerometer.correct(np.array([vector.raw_specific_force], dtype=float))
    if model.gyroscope is not None and vector.raw_angular_rate is not None:
        raw = np.array([vector.raw_angular_rate], dtype=float)
        if model.g_sensitivity is not None:
            # Without a specific force beside it the g-sensitivity was left alone.
            raw = raw if force is None else raw - force @ model.g_sensitivity.T
        rate = model.gyroscope.correct(raw)
    return force, rate
