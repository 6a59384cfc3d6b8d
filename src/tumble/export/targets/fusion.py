"""x-io Fusion: initialisers of C for ``FusionModelInertial``.

Read in Fusion/FusionModel.h and its README: ``x = M diag(s) (u - b)``, gyros in deg/s, accelerometers in g.
Magnetometers ``x = S (u - h)`` in any unit (FusionCalibrationMagnetic: the offset is subtracted first).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tumble.arrays import Vector
from tumble.errors import CalibrationFileError
from tumble.export.magnetometer import field_lines
from tumble.export.reading import finite, invertible, matrix_of, text_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MAGNETOMETER, MATRIX, SCALE, Imported, Target
from tumble.export.words import commented, example_lines, head
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import inverse
from tumble.units import STANDARD_GRAVITY

_HOLDS = frozenset({MATRIX, SCALE, BIAS, MAGNETOMETER})
_DEGREES = 180.0 / np.pi


def write(subject: Subject) -> dict[str, str]:
    """Return initialisers of C for ``FusionModelInertial``; raw gyros in deg/s, accelerometers in g, out the same."""
    formula = ("x = misalignment * diag(sensitivity) * (u - offset); gyros in deg/s, accelerometers in g",)
    vectors = example_lines(subject, (1.0 / STANDARD_GRAVITY, _DEGREES), "g, deg/s")
    lines = ["#pragma once", "", '#include "Fusion.h"', ""]
    for name, triad, factor in (
        ("gyroscope", subject.gyroscope, _DEGREES),
        ("accelerometer", subject.accelerometer, 1.0 / STANDARD_GRAVITY),
    ):
        corrected = factor * inverse(triad.matrix)
        sensitivity = np.diag(corrected)
        misalignment = corrected / sensitivity
        body = ", ".join(
            f"{v:.9g}f" if "." in f"{v:.9g}" or "e" in f"{v:.9g}" else f"{v:.9g}.0f"
            for v in misalignment.ravel()
        )
        lines += [
            f"static const FusionMatrix {name}Misalignment = {{.array = {{{body}}}}};",
            f"static const FusionVector {name}Sensitivity = {{.array = {_floats(sensitivity)}}};",
            f"static const FusionVector {name}Offset = {{.array = {_floats(triad.bias)}}};",
        ]
    field = subject.magnetometer
    if field is not None:
        lines += [f"// {line}" for line in field_lines(field, "x = softIronMatrix * (u - hardIronOffset)")]
        body = ", ".join(_float(v) for v in field.soft_iron.ravel())
        lines += [
            f"static const FusionMatrix softIronMatrix = {{.array = {{{body}}}}};",
            f"static const FusionVector hardIronOffset = {{.array = {_floats(field.hard_iron)}}};",
        ]
    return {
        "fusion_calibration.h": commented(head(subject, TARGET.title, formula, vectors), "//")
        + "\n".join(lines)
        + "\n"
    }


def _float(value: float) -> str:
    text = f"{value:.9g}"
    return (text if "." in text or "e" in text else text + ".0") + "f"


def _floats(values: Vector) -> str:
    return "{" + ", ".join(_float(v) for v in values) + "}"


def read(path: Path) -> Imported:
    """Read the initialisers of a header, this module's or by hand in the same names.

    Raises
    ------
    CalibrationFileError
        If one is missing.
    """
    text = re.sub(r"//.*", "", text_of(path))
    parts: dict[str, list[float]] = {}
    for name in ("gyroscope", "accelerometer"):
        for what, size in (("Misalignment", 9), ("Sensitivity", 3), ("Offset", 3)):
            match = re.search(rf"{name}{what}\s*=\s*{{(.*?)}}\s*;", text, re.S)
            numbers = re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", match[1]) if match else []
            if len(numbers) != size:
                raise CalibrationFileError(
                    f"{path} has no {name}{what} of {size} numbers: it is no Fusion calibration."
                )
            parts[name + what] = [finite(n, name + what, path) for n in numbers]
    triads: list[Triad] = []
    for name, factor in (("accelerometer", 1.0 / STANDARD_GRAVITY), ("gyroscope", _DEGREES)):
        matrix = matrix_of(parts[f"{name}Misalignment"], f"{name}Misalignment", path) * np.array(
            parts[f"{name}Sensitivity"]
        )
        triads.append(
            Triad(factor * inverse(invertible(matrix, name, path)), np.array(parts[f"{name}Offset"]))
        )
    return Imported(
        ImuModel(triads[0], triads[1]),
        ("g", "deg/s"),
        "output of Fusion",
        "the axes of Fusion's corrected output",
        (path,),
    )


TARGET = Target(
    "fusion",
    "x-io Fusion (C initialisers)",
    _HOLDS,
    "fusion_calibration.h",
    write,
    read,
    ("g", "deg/s"),
    comment="//",
)
