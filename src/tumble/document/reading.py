"""A document read, and what the types of its fields cannot show: singular matrices, unknown units, false vectors."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from tumble.arrays import Vectors
from tumble.border import border
from tumble.document.corrector import corrected
from tumble.document.magnetometer_block import MagnetometerBlock
from tumble.document.part import Row, read_part, refusal
from tumble.document.result import FORMAT, VERSION, Calibration
from tumble.document.soundness import is_invertible, stated_covariance_fault
from tumble.document.thermal_block import contradiction as thermal_contradiction
from tumble.errors import CalibrationFileError, TumbleError
from tumble.files import HIDDEN, read_json, reading
from tumble.sensor import ImuModel
from tumble.units import magnetic_field_factor

LARGEST = 32 << 20
"""Bytes of a document; one with a hundred turn-ons has a tenth of a megabyte."""

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


@border
def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a ``calibration.json``, or a folder that holds one.

    Raises
    ------
    CalibrationFileError
        If there is no such file, or it is not a calibration of a version that this tumble knows.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "calibration.json"
    hint = "give the calibration.json that `tumble calibrate` wrote"
    with reading(file, "a calibration", CalibrationFileError, hint):
        document: Any = read_json(file, LARGEST)
    if not isinstance(document, dict) or cast("dict[str, Any]", document).get("format") != FORMAT:
        raise CalibrationFileError(
            f'{file} is not a calibration of tumble: it does not say "format": "{FORMAT}".'
        )
    version: Any = cast("dict[str, Any]", document).get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise CalibrationFileError(
            f"{file} is damaged: its version is {version!r:.40}, which is no whole number from 1 on."
        )
    if version > VERSION:
        raise CalibrationFileError(
            f"{file} is of version {version!r} and this tumble reads up to {VERSION}: update tumble."
        )
    if cast("dict[str, Any]", document).get("composed_with") is not None:
        raise CalibrationFileError(
            f"{file} holds a calibration after another (composed_with), which is no longer read. Apply the two files "
            "that it was made of, one after the other."
        )
    try:
        calibration = read_part(Calibration, document)
    except msgspec.ValidationError as error:
        raise CalibrationFileError(f"{file} is damaged: {refusal(error)}.") from error
    contradiction = contradiction_in(calibration)
    if contradiction is not None:
        raise CalibrationFileError(f"{file} is damaged: {contradiction}.")
    return calibration
