"""Intel RealSense ``calibration.json``.

Read in rs-imu-calibration.py: rows, ``x^T = u^T S - bias^T`` with S by rows in ``scale_and_alignment``: the
transpose of the usual matrix, and the bias in the output. Its own script writes the identity for gyros; the
form holds a matrix.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

from tumble.errors import CalibrationFileError
from tumble.export.reading import entry, invertible, json_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, NOISE, SCALE, Imported, Target
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import inverse


def write(subject: Subject) -> dict[str, str]:
    """Return the ``imus`` of RealSense's ``calibration.json``."""
    imu: dict[str, Any] = {}
    noise = subject.noise
    for name, triad, own in (
        ("accelerometer", subject.accelerometer, None if noise is None else noise.accelerometer),
        ("gyroscope", subject.gyroscope, None if noise is None else noise.gyroscope),
    ):
        corrected = inverse(triad.matrix)
        imu[name] = {
            "scale_and_alignment": corrected.T.ravel().tolist(),
            "bias": (corrected @ triad.bias).tolist(),
        }
        if own is not None and noise is not None:
            imu[name]["noise_variance"] = own.density**2 * noise.rate
    return {"calibration.json": json.dumps({"imus": [imu]}, indent=1) + "\n"}


def read(path: Path) -> Imported:
    """Read the first of ``imus``.

    Raises
    ------
    CalibrationFileError
        If it is no such file.
    """
    document = json_of(path, "RealSense")
    imus: Any = entry(document, "imus", path)
    if not isinstance(imus, list) or not imus:
        raise CalibrationFileError(f"{path} has no imus: it is no calibration of RealSense.")
    first: Any = cast("list[Any]", imus)[0]
    triads: list[Triad] = []
    for name in ("accelerometer", "gyroscope"):
        rows = invertible(
            entry(first, f"{name}.scale_and_alignment", path), f"{name}.scale_and_alignment", path
        )
        bias = vector_of(entry(first, f"{name}.bias", path), f"{name}.bias", path)
        corrected = rows.T
        triads.append(Triad(inverse(corrected), inverse(corrected) @ bias))
    return Imported(
        ImuModel(triads[0], triads[1]),
        ("m/s^2", "rad/s"),
        "output of RealSense",
        "the axes of the corrected output",
        (path,),
    )


TARGET = Target(
    "realsense",
    "Intel RealSense calibration.json",
    frozenset({MATRIX, SCALE, BIAS, NOISE}),
    "calibration.json",
    write,
    read,
    comment="",
)
