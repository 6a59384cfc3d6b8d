"""imucal: ``FerrarisCalibrationInfo`` as JSON, format 2.0.

Read in its source (ferraris_calibration_info.py): ``a = inverse(R_a) inverse(K_a) (u_a - b_a)``, ``w =
inverse(R_g) inverse(K_g) (u_g - K_ga a - b_g)``, a the corrected acceleration, w in deg/s.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import CalibrationFileError
from tumble.export.reading import entry, invertible, json_of, matrix_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, G_SENSITIVITY, MATRIX, SCALE, Imported, Target
from tumble.export.words import head
from tumble.files import shown
from tumble.sensor import ImuModel, Triad
from tumble.units import DEGREE


def write(subject: Subject) -> dict[str, str]:
    """Return imucal's JSON; raw units are the calibration's own."""
    accelerometer, gyroscope = subject.accelerometer, subject.gyroscope
    document: dict[str, Any] = {
        "cal_type": "Ferraris",
        "acc_unit": "m/s^2",
        "gyr_unit": "deg/s",
        "from_acc_unit": _unit(subject.units[0]),
        "from_gyr_unit": _unit(subject.units[1]),
        "comment": shown("; ".join(head(subject, TARGET.title, (), None))),
    }
    for letter, matrix, bias in (
        ("a", accelerometer.matrix, accelerometer.bias),
        ("g", gyroscope.matrix * DEGREE, gyroscope.bias),
    ):
        scale = np.linalg.norm(matrix, axis=1)
        document[f"K_{letter}"] = np.diag(scale).tolist()
        document[f"R_{letter}"] = (matrix / scale[:, None]).tolist()
        document[f"b_{letter}"] = bias.tolist()
    sensitivity = subject.model.g_sensitivity
    document["K_ga"] = (np.zeros((3, 3)) if sensitivity is None else sensitivity).tolist()
    document["_format_version"] = "2.0"
    return {"imucal.json": json.dumps(document, indent=1, ensure_ascii=False) + "\n"}


def _unit(unit: str) -> str:
    return {"counts": "a.u."}.get(unit, unit)


def read(path: Path) -> Imported:
    """Read imucal's JSON of either type.

    Raises
    ------
    CalibrationFileError
        If it is none, or its corrected units are others than m/s² and deg/s.
    """
    document = json_of(path, "imucal")
    units = (document.get("acc_unit"), document.get("gyr_unit"))
    if units != ("m/s^2", "deg/s"):
        raise CalibrationFileError(
            f"{path} corrects to {units[0]} and {units[1]}, not to m/s^2 and deg/s as imucal does."
        )
    parts = {
        key: matrix_of(entry(document, key, path), key, path) for key in ("K_a", "R_a", "K_g", "R_g", "K_ga")
    }
    triads = [
        Triad(
            factor * invertible(parts[f"K_{letter}"] @ parts[f"R_{letter}"], f"K_{letter} R_{letter}", path),
            vector_of(entry(document, f"b_{letter}", path), f"b_{letter}", path),
        )
        for letter, factor in (("a", 1.0), ("g", 1.0 / DEGREE))
    ]
    raw = tuple(str(document.get(key) or "counts") for key in ("from_acc_unit", "from_gyr_unit"))
    sensitivity = parts["K_ga"] if np.any(parts["K_ga"]) else None
    return Imported(
        ImuModel(triads[0], triads[1], sensitivity),
        ("counts" if raw[0] == "a.u." else raw[0], "counts" if raw[1] == "a.u." else raw[1]),
        "output of imucal",
        "the axes of imucal's corrected output, those of the Ferraris protocol",
        (path,),
    )


TARGET = Target(
    "imucal",
    "imucal JSON (Ferraris)",
    frozenset({MATRIX, SCALE, BIAS, G_SENSITIVITY}),
    "imucal.json",
    write,
    read,
    units=None,
    comment="",
)
