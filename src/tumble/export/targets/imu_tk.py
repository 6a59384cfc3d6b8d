"""imu_tk ``*.calib`` files, one a triad.

Read in their source (calibration.h: ``unbiasNormalize``, ``load``, ``save``):
backward, ``corrected = T K (raw - B)``. The paper (ICRA 2014) adds the bias; the code and its files subtract
it. T has a unit diagonal and of accelerometers zeros below it (frame ``accelerometer-z``).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tumble.errors import CalibrationFileError
from tumble.export.reading import text_of
from tumble.export.static_factors import factors, triad_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, SCALE, Imported, Target
from tumble.export.words import number
from tumble.sensor import FRAMES, ImuModel, Triad

_FILES = ("accelerometer.calib", "gyroscope.calib")
_WORDS = FRAMES["accelerometer-z"]


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
    """Read both triads' files of a folder, or one file, of the triad that its name says.

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
        found[kind] = triad_of(numbers[:9], numbers[9:18], numbers[18:], file)
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
            f"Which triad {file} is of cannot be seen: its name must hold acc or gyr, as accelerometer.calib."
        )
    return kinds[0]


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
