"""MATLAB: the arguments of ``accelcal``'s correction for both triads, and of ``magcal``'s for a magnetometer.

Read on its help page (R2023b): ``C = U A + b``, a sample a row: A is the transpose of the usual matrix, b is
added after. ``magcal`` (R2023b): ``C = (U - b) A``, b is subtracted first.
"""

from __future__ import annotations

import re
from pathlib import Path

from tumble.errors import CalibrationFileError
from tumble.export.magnetometer import field_lines
from tumble.export.reading import invertible, text_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MAGNETOMETER, MATRIX, SCALE, Imported, Target
from tumble.export.words import commented, head, number
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import inverse

_HOLDS = frozenset({MATRIX, SCALE, BIAS, MAGNETOMETER})


def write(subject: Subject) -> dict[str, str]:
    """Return a MATLAB script with the arguments of ``accelcal``'s correction, for both triads."""
    formula = (
        "C = U*A + b; U and C have a sample a row; A is the transpose of the usual matrix, b is added after",
    )
    lines: list[str] = []
    for name, triad in (("accel", subject.accelerometer), ("gyro", subject.gyroscope)):
        corrected = inverse(triad.matrix)
        rows = "; ".join(" ".join(number(v) for v in line) for line in corrected.T)
        lines += [
            f"{name}_A = [{rows}];",
            f"{name}_b = [{' '.join(number(v) for v in -(corrected @ triad.bias))}];",
        ]
    field = subject.magnetometer
    if field is not None:
        # As magcal has it: the offset first, and samples are rows.
        rows = "; ".join(" ".join(number(v) for v in line) for line in field.soft_iron.T)
        told = field_lines(
            field, "C = (U-b)*A, as magcal has it; U and C have a sample a row, |C| is mag_expmfs"
        )
        lines += [
            *(f"% {line}" for line in told),
            f"mag_A = [{rows}];",
            f"mag_b = [{' '.join(number(v) for v in field.hard_iron)}];",
            f"mag_expmfs = {number(field.norm)};",
        ]
    said = commented(head(subject, TARGET.title, formula), "%")
    return {"imu_calibration.m": said + "\n".join(lines) + "\n"}


def read(path: Path) -> Imported:
    """Read a script with ``accel_A``, ``accel_b``, ``gyro_A`` and ``gyro_b``.

    Raises
    ------
    CalibrationFileError
        If one is missing.
    """
    text = re.sub(r"%.*", "", text_of(path))
    triads: list[Triad] = []
    for name in ("accel", "gyro"):
        values: list[list[str]] = []
        for what in ("A", "b"):
            match = re.search(rf"\b{name}_{what}\s*=\s*\[([^\]]*)\]", text)
            if match is None:
                raise CalibrationFileError(
                    f"{path} has no {name}_{what} = [...]: it is no script of this form."
                )
            values.append(re.split(r"[\s,;]+", match[1].strip()))
        matrix = invertible(values[0], f"{name}_A", path).T
        bias = vector_of(values[1], f"{name}_b", path)
        triads.append(Triad(inverse(matrix), -inverse(matrix) @ bias))
    return Imported(
        ImuModel(triads[0], triads[1]),
        ("m/s^2", "rad/s"),
        "output of MATLAB",
        "the axes of the corrected output",
        (path,),
    )


TARGET = Target("matlab", "MATLAB accelcal (script)", _HOLDS, "imu_calibration.m", write, read, comment="%")
