"""imu_tk ``*.calib`` files, one a triad, and OpenICC's ``static_calib_result.json`` with the same numbers.

Read in their source (calibration.h: ``unbiasNormalize``, ``load``, ``save``; static_imu_calibration.cc):
backward, ``corrected = T K (raw - B)``. The paper (ICRA 2014) adds the bias; the code and its files subtract
it. T has a unit diagonal and of accelerometers zeros below it (frame ``accelerometer-z``).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import CalibrationFileError
from tumble.export.reading import entry, invertible, json_of, text_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, SCALE, Imported, Target
from tumble.export.words import number
from tumble.sensor import FRAMES, ImuModel, Triad
from tumble.sensor.gauge import inverse

_FILES = ("accelerometer.calib", "gyroscope.calib")
_WORDS = FRAMES["accelerometer-z"]


def factors(triad: Triad) -> tuple[Matrix, Matrix]:
    """Return imu_tk's T and K of a triad: ``inverse(matrix) = T K``, T of unit diagonal, K diagonal."""
    corrected = inverse(triad.matrix)
    scale = np.diag(np.diag(corrected))
    T = corrected @ inverse(scale)
    np.fill_diagonal(T, 1.0)
    return T, scale


def write(subject: Subject) -> dict[str, str]:
    """Return two files of 9 + 9 + 3 numbers, by rows; the format has no comments."""
    texts: dict[str, str] = {}
    for name, triad in zip(_FILES, (subject.accelerometer, subject.gyroscope), strict=True):
        T, scale = factors(triad)
        shown = np.triu(T) if name == _FILES[0] else T
        rows = [" ".join(number(v) for v in line) for line in (*shown, *scale)]
        texts[name] = "\n".join([*rows[:3], "", *rows[3:], "", "\n".join(number(v) for v in triad.bias), ""])
    return texts


def read(path: Path) -> Imported:
    """Read both triads' files of a folder, or one file, of the triad that its name tells.

    Raises
    ------
    CalibrationFileError
        If a file is not 21 numbers, or which triad it is of cannot be told.
    """
    files = sorted(path.glob("*.calib")) if path.is_dir() else [path]
    if not files:
        raise CalibrationFileError(f"The folder {path} has no .calib file of imu_tk.")
    found: dict[str, Triad] = {}
    for file in files:
        kind = _kind(file)
        if kind in found:
            raise CalibrationFileError(
                f"{path} has several files of the {kind}: give one of them, or clear the folder."
            )
        words = text_of(file).split()
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError:
            raise CalibrationFileError(f"{file} holds words: imu_tk's file is 21 numbers.") from None
        if numbers.size != 21:
            raise CalibrationFileError(f"{file} has {numbers.size} numbers: imu_tk's file is 21, T, K and B.")
        found[kind] = _triad(numbers[:9], numbers[9:18], numbers[18:], file)
    return Imported(
        ImuModel(found.get("accelerometer"), found.get("gyroscope")),
        ("counts", "counts"),
        "accelerometer-z",
        _WORDS,
        tuple(files),
        ("imu_tk's file does not say its raw unit: counts is taken, or what --units says",),
    )


def _kind(file: Path) -> str:
    name = file.stem.lower()
    kinds = [kind for kind, mark in (("accelerometer", "acc"), ("gyroscope", "gyr")) if mark in name]
    if len(kinds) != 1:
        raise CalibrationFileError(
            f"Which triad {file} is of cannot be told: its name must hold acc or gyr, as accelerometer.calib."
        )
    return kinds[0]


def _triad(T: Any, K: Any, B: Any, file: Path) -> Triad:
    misalignment = invertible(T, "the misalignment matrix", file)
    scale = invertible(K, "the scale matrix", file)
    if np.any(scale - np.diag(np.diag(scale))):
        raise CalibrationFileError(f"The scale matrix in {file} is not diagonal: it is no file of imu_tk.")
    return Triad(inverse(misalignment @ scale), vector_of(B, "the bias", file))


def write_openicc(subject: Subject) -> dict[str, str]:
    """Return OpenICC's JSON."""
    document: dict[str, Any] = {}
    for name, triad in (("accelerometer", subject.accelerometer), ("gyroscope", subject.gyroscope)):
        T, scale = factors(triad)
        document[name] = {
            "misalignment_matrix": (np.triu(T) if name == "accelerometer" else T).tolist(),
            "scale_matrix": scale.tolist(),
            "bias": triad.bias.tolist(),
        }
    return {"static_calib_result.json": json.dumps(document, indent=1) + "\n"}


def read_openicc(path: Path) -> Imported:
    """Read OpenICC's JSON.

    Raises
    ------
    CalibrationFileError
        If it is none.
    """
    document = json_of(path, "OpenICC")
    triads = [
        _triad(
            entry(document, f"{name}.misalignment_matrix", path),
            entry(document, f"{name}.scale_matrix", path),
            entry(document, f"{name}.bias", path),
            path,
        )
        for name in ("accelerometer", "gyroscope")
    ]
    return Imported(ImuModel(triads[0], triads[1]), ("m/s^2", "rad/s"), "accelerometer-z", _WORDS, (path,))


TARGET = Target(
    "imu-tk",
    "imu_tk .calib files",
    frozenset({MATRIX, SCALE, BIAS}),
    "imu-tk",
    write,
    read,
    units=None,
    frame="accelerometer-z",
    comment="",
)
OPENICC = Target(
    "openicc",
    "OpenICC static_calib_result.json",
    frozenset({MATRIX, SCALE, BIAS}),
    "static_calib_result.json",
    write_openicc,
    read_openicc,
    frame="accelerometer-z",
    comment="",
)
