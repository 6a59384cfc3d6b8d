"""iKalibr: IMU intrinsics.

Read in its source (imu_intrinsic.hpp): forward, ``m = Map x + BIAS``, Map upper triangular v1 v4 v5 / v2 v6 /
v3 (frame ``accelerometer-z``), gyros ``m = Map SO3_AtoG x + BIAS``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.errors import CalibrationFileError
from tumble.export.reading import check_rotation, entry, invertible, vector_of, yaml_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, SCALE, Imported, Target
from tumble.export.words import commented, head, number, row
from tumble.sensor import FRAMES, ImuModel, Triad
from tumble.sensor.gauge import upper_factor

_HOLDS = frozenset({MATRIX, SCALE, BIAS})


def write(subject: Subject) -> dict[str, str]:
    """Return iKalibr's ``Intrinsics``."""
    own = upper_factor(subject.gyroscope.matrix)
    turned = np.linalg.solve(own, subject.gyroscope.matrix)
    formula = (
        "m_a = Map_a f + BIAS_a;  m_g = Map_g SO3_AtoG w + BIAS_g   (forward)",
        "Map = [v1 v4 v5; 0 v2 v6; 0 0 v3], MAP_COEFF = [v1 ... v6]; SO3_AtoG a quaternion, x y z w",
    )
    lines = ["Intrinsics:"]
    for name, matrix, bias in (
        ("ACCE", subject.accelerometer.matrix, subject.accelerometer.bias),
        ("GYRO", own, subject.gyroscope.bias),
    ):
        six = [matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]]
        lines += [f"  {name}:", f"    BIAS: {row(bias)}", f"    MAP_COEFF: {row(six)}"]
    x, y, z, w = _quaternion(np.asarray(turned, dtype=np.float64))
    lines += [
        "  SO3_AtoG:",
        f"    qx: {number(x)}",
        f"    qy: {number(y)}",
        f"    qz: {number(z)}",
        f"    qw: {number(w)}",
    ]
    return {"ikalibr_imu.yaml": commented(head(subject, TARGET.title, formula)) + "\n".join(lines) + "\n"}


def _quaternion(matrix: Matrix) -> Vector:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_quat(canonical=True))


def read(path: Path) -> Imported:
    """Read iKalibr's ``Intrinsics``.

    Raises
    ------
    CalibrationFileError
        If it is none.
    """
    from scipy.spatial.transform import Rotation

    document = yaml_of(path, "iKalibr")
    triads: list[Triad] = []
    for name in ("ACCE", "GYRO"):
        v = vector_of(entry(document, f"Intrinsics.{name}.MAP_COEFF", path), f"{name}.MAP_COEFF", path, 6)
        matrix = invertible(
            [[v[0], v[3], v[4]], [0.0, v[1], v[5]], [0.0, 0.0, v[2]]], f"{name}.MAP_COEFF", path
        )
        triads.append(
            Triad(matrix, vector_of(entry(document, f"Intrinsics.{name}.BIAS", path), f"{name}.BIAS", path))
        )
    four = [entry(document, f"Intrinsics.SO3_AtoG.q{axis}", path) for axis in "xyzw"]
    quaternion = vector_of(four, "SO3_AtoG", path, 4)
    if abs(np.linalg.norm(quaternion) - 1.0) > 1e-3:
        raise CalibrationFileError(f"SO3_AtoG in {path} is no unit quaternion.")
    turned = check_rotation(Rotation.from_quat(quaternion).as_matrix(), "SO3_AtoG", path)
    gyroscope = Triad(np.asarray(triads[1].matrix @ turned), triads[1].bias)
    return Imported(
        ImuModel(triads[0], gyroscope),
        ("m/s^2", "rad/s"),
        "accelerometer-z",
        FRAMES["accelerometer-z"],
        (path,),
    )


TARGET = Target(
    "ikalibr", "iKalibr IMU intrinsics", _HOLDS, "ikalibr_imu.yaml", write, read, frame="accelerometer-z"
)
