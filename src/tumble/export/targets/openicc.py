"""OpenICC's ``static_calib_result.json``: imu_tk's numbers as JSON, read in its source (static_imu_calibration.cc).

Backward, ``corrected = T K (raw - B)``, T of unit diagonal and of accelerometers zeros below it (frame
``accelerometer-z``).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tumble.export.reading import entry, json_of
from tumble.export.static_factors import factors, triad_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, SCALE, Imported, Target
from tumble.sensor import FRAMES, ImuModel


def write(subject: Subject) -> dict[str, str]:
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


def read(path: Path) -> Imported:
    """Read OpenICC's JSON.

    Raises
    ------
    CalibrationFileError
        If it is none.
    """
    document = json_of(path, "OpenICC")
    triads = [
        triad_of(
            entry(document, f"{name}.misalignment_matrix", path),
            entry(document, f"{name}.scale_matrix", path),
            entry(document, f"{name}.bias", path),
            path,
        )
        for name in ("accelerometer", "gyroscope")
    ]
    return Imported(
        ImuModel(triads[0], triads[1]),
        ("m/s^2", "rad/s"),
        "accelerometer-z",
        FRAMES["accelerometer-z"],
        (path,),
    )


TARGET = Target(
    "openicc",
    "OpenICC static_calib_result.json",
    frozenset({MATRIX, SCALE, BIAS}),
    "static_calib_result.json",
    write,
    read,
    frame="accelerometer-z",
    comment="",
)
