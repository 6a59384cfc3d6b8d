"""Reading other tools' files: texts, JSON, YAML and matrices in them, each fault one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.errors import CalibrationFileError

_LARGEST = 4_000_000


def text_of(path: Path) -> str:
    """Return a file's text.

    Raises
    ------
    CalibrationFileError
        If it is not there, no text, or far too long for parameters.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise CalibrationFileError(
                f"{path} is {path.stat().st_size} bytes long: that is no file of parameters."
            )
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise CalibrationFileError(f"There is no file {path}.") from None
    except UnicodeDecodeError:
        raise CalibrationFileError(f"{path} is no text: it cannot be a file of parameters.") from None
    except OSError as error:
        raise CalibrationFileError(f"{path} cannot be read: {error.strerror or error}.") from error


def json_of(path: Path, tool: str) -> dict[str, Any]:
    """Return a JSON object.

    Raises
    ------
    CalibrationFileError
        If the file is none.
    """
    try:
        document: Any = json.loads(text_of(path))
    except json.JSONDecodeError as error:
        raise CalibrationFileError(f"{path} is no JSON, as {tool}'s file is: {error}.") from error
    if not isinstance(document, dict):
        raise CalibrationFileError(f"{path} holds no object, as {tool}'s file does.")
    return cast("dict[str, Any]", document)


def yaml_of(path: Path, tool: str) -> dict[str, Any]:
    """Return a YAML mapping; OpenCV's first line ``%YAML:1.0`` is let pass.

    Raises
    ------
    CalibrationFileError
        If the file is none.
    """
    import yaml

    text = text_of(path)
    if text.startswith("%YAML"):
        text = text.partition("\n")[2]
    try:
        document: Any = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        where = getattr(error, "problem_mark", None)
        line = f" in line {where.line + 1}" if where is not None else ""
        raise CalibrationFileError(f"{path} is no YAML, as {tool}'s file is: a mistake{line}.") from error
    if not isinstance(document, dict):
        raise CalibrationFileError(f"{path} holds no keys, as {tool}'s file does.")
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
    length = np.linalg.norm(matrix, axis=1, keepdims=True)
    if not np.all(length > 0) or abs(float(np.linalg.det(matrix / length))) < 1e-6:
        raise CalibrationFileError(f"{name} in {path} cannot be inverted: it is no calibration's matrix.")
    return matrix


def vector_of(value: Any, name: str, path: Path, size: int = 3) -> Vector:
    """Return `size` numbers.

    Raises
    ------
    CalibrationFileError
        If they are not that many finite numbers.
    """
    return _numbers(value, name, path, size)


def _numbers(value: Any, name: str, path: Path, size: int) -> Any:
    try:
        array = np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        raise CalibrationFileError(f"{name} in {path} is not {size} numbers.") from None
    if array.size != size:
        raise CalibrationFileError(f"{name} in {path} is {array.size} numbers, not {size}.")
    if not np.all(np.isfinite(array)):
        raise CalibrationFileError(
            f"{name} in {path} holds a number that is not finite: that calibration diverged."
        )
    return array


def check_rotation(matrix: Matrix, name: str, path: Path) -> Matrix:
    """Return a matrix that is a rotation.

    Raises
    ------
    CalibrationFileError
        If it is not, to 1e-3.
    """
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0.0:
        raise CalibrationFileError(
            f"{name} in {path} is no rotation; older OpenVINS configurations had another matrix there: check the file."
        )
    return matrix
