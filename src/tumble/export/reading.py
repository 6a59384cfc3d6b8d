"""Reading other tools' files: texts, YAML and matrices in them, each fault one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.document.soundness import is_invertible
from tumble.errors import CalibrationFileError
from tumble.files import number_of, read_text, read_yaml, reading
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.sensor.thermal import ThermalModel
from tumble.units import angular_rate_factor, specific_force_factor

LARGEST = 4 << 20
"""Bytes of another tool's file of parameters."""
# Of an SI unit: a scale factor that no sensor has, and a bias that is more than any range.
_SCALES = (0.1, 10.0)
_LARGEST_BIAS = 1e3

# Readers multiply up to three numbers of a file.
_LARGEST_NUMBER = 1e60


@dataclass(frozen=True, slots=True)
class Imported:
    """What a target's file says of a unit.

    Attributes
    ----------
    model : raw numbers in `units`.
    units : of specific force and angular rate that the file's numbers take.
    frame, frame_words : name of the frame of its corrected vectors, and what it is.
    files : that were read.
    remarks : sentences: what the file does not hold, what was assumed.
    thermal : how `model`'s biases change with temperature, or None.
    """

    model: ImuModel
    units: tuple[str, str]
    frame: str
    frame_words: str
    files: tuple[Path, ...]
    remarks: tuple[str, ...] = ()
    thermal: ThermalModel | None = None


def text_of(path: Path) -> str:
    """Return a file's text.

    Raises
    ------
    CalibrationFileError
        If it is not there, no text, or far too long for parameters.
    """
    with reading(path, "a file of parameters", CalibrationFileError):
        return read_text(path, LARGEST)


def yaml_of(path: Path) -> dict[str, Any]:
    """Return the YAML mapping of a Kalibr file; OpenCV's first line ``%YAML:1.0`` is let pass.

    Raises
    ------
    CalibrationFileError
        If the file is none.
    """
    with reading(path, "a Kalibr file", CalibrationFileError):
        document: Any = read_yaml(path)
    if not isinstance(document, dict):
        raise CalibrationFileError(f"{path} holds no keys, as Kalibr's file does.")
    return cast("dict[str, Any]", document)


def entry(document: Any, keys: str, path: Path) -> Any:
    """Return what stands at dotted keys.

    Raises
    ------
    CalibrationFileError
        If a key is not there.
    """
    value: Any = document
    for key in keys.split("."):
        if not isinstance(value, dict) or key not in value:
            raise CalibrationFileError(f"{path} has no {keys}: it is of another kind, or cut short.")
        value = cast("dict[str, Any]", value)[key]
    return value


def matrix_of(value: Any, name: str, path: Path) -> Matrix:
    """Return nine numbers, in rows or one after another by rows, as a matrix.

    Raises
    ------
    CalibrationFileError
        If they are no nine finite numbers.
    """
    return _numbers(value, name, path, 9).reshape(3, 3)


def invertible(value: Any, name: str, path: Path) -> Matrix:
    """Return nine numbers as a matrix that can be inverted.

    Raises
    ------
    CalibrationFileError
        If they are not.
    """
    matrix = matrix_of(value, name, path)
    if not is_invertible(matrix):
        raise CalibrationFileError(f"{name} in {path} cannot be inverted: it is no calibration's matrix.")
    return matrix


def vector_of(value: Any, name: str, path: Path) -> Vector:
    """Return three numbers.

    Raises
    ------
    CalibrationFileError
        If they are not three finite numbers.
    """
    return _numbers(value, name, path, 3)


def _numbers(value: Any, name: str, path: Path, size: int) -> Any:
    entries = _flat(value.tolist() if isinstance(value, np.ndarray) else value)
    if len(entries) != size:
        raise CalibrationFileError(f"{name} in {path} is {len(entries)} numbers, not {size}.")
    try:
        numbers = np.array([number_of(entry) for entry in entries])
    except ValueError as error:
        raise CalibrationFileError(f"{name} in {path} cannot be used: {error}.") from None
    if np.abs(numbers).max() > _LARGEST_NUMBER:
        raise CalibrationFileError(
            f"{name} in {path} is {np.abs(numbers).max():g}: it is no calibration's number."
        )
    return numbers


def _flat(value: Any) -> list[Any]:
    """Return a value, a list, or a list of lists as one list."""
    if not isinstance(value, list | tuple):
        return [value]
    return [entry for part in cast("list[Any]", value) for entry in _flat(part)]


def check_plausible(model: ImuModel, units: tuple[str, str], path: Path) -> None:
    """Refuse numbers that no calibration of a sensor has, which a damaged file or another unit leaves.

    Parameters
    ----------
    model : as read.
    units : raw units of specific force and angular rate; in counts any scale may be.

    Raises
    ------
    CalibrationFileError
        If a matrix cannot be inverted, a scale factor is below 0.1 or above 10, or a bias above 1000 m/s² or rad/s.
    """
    factors = (specific_force_factor(units[0]), angular_rate_factor(units[1]))
    for name, triad, factor in zip(
        ("accelerometer", "gyroscope"), (model.accelerometer, model.gyroscope), factors, strict=True
    ):
        if triad is None:
            continue
        if not is_invertible(triad.matrix):
            raise CalibrationFileError(f"The {name}'s matrix in {path} cannot be inverted.")
        low, high = (float(np.linalg.norm(triad.matrix, -2)), float(np.linalg.norm(triad.matrix, 2)))
        scale = 1.0 if factor is None else factor
        if not (low > 0.0 and high < np.inf) or (
            factor is not None and not (_SCALES[0] <= scale * low and scale * high <= _SCALES[1])
        ):
            raise CalibrationFileError(
                f"The {name}'s scale factors in {path} are {scale * low:.3g} to {scale * high:.3g}: no sensor has "
                "such, so the file is damaged or in another unit."
            )
        if factor is not None and not np.all(np.abs(scale * triad.bias) <= _LARGEST_BIAS):
            raise CalibrationFileError(
                f"The {name}'s bias in {path} is {scale * float(np.abs(triad.bias).max()):.3g} SI units: no sensor has "
                "such, so the file is damaged or in another unit."
            )


def check_rotation(matrix: Matrix, path: Path) -> Matrix:
    """Return the gyros' matrix C_gyro_i that is a rotation.

    Raises
    ------
    CalibrationFileError
        If it is not, to 1e-3.
    """
    # No entry of a rotation is beyond one; the squares of others may be beyond any number.
    possible = bool(np.all(np.abs(matrix) < 2.0))
    if (
        not possible
        or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3)
        or np.linalg.det(matrix) < 0.0
    ):
        raise CalibrationFileError(f"gyroscopes.C_gyro_i in {path} is no rotation.")
    return matrix
