"""DLIO: ``imu/intrinsics``, the accelerometers' matrix and both biases.

Read in its source (odom.cc, callbackImu and getParams): ``x = sm u - bias`` of the accelerometers, sm by rows, and
``x = u - bias`` of the gyros. Both act on what transformImu has turned to the axes of the base link, so that numbers in
the sensor's axes hold where ``baselink2imu/R`` is the identity. With ``imu/calibration: true`` they are not read.
"""

from __future__ import annotations

import numpy as np

from tumble.export import losses
from tumble.export.subject import Subject, with_losses
from tumble.export.target import BIAS, MATRIX, SCALE, Target
from tumble.export.words import commented, head, number, row
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import inverse

FORMULA = (
    "accelerometers: x = sm u - bias, sm by rows; gyros: x = u - bias",
    "u is what baselink2imu/R has turned: with another R than the identity take R sm R^T and R bias",
    "set imu/calibration to false: with true DLIO estimates biases at the start and reads none of these",
)


def write(subject: Subject) -> dict[str, str]:
    """Return the part ``imu`` of ``dlio.yaml``.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow.
    """
    gyroscope = subject.gyroscope
    lost = losses.of_matrix(gyroscope, np.eye(3), "gyros", "scale factors and misalignments")
    kept = ImuModel(subject.accelerometer, Triad(np.eye(3), gyroscope.bias))
    reduced = with_losses(subject, kept, lost, TARGET.title)
    sm = inverse(subject.accelerometer.matrix)
    rows = ",\n                ".join(", ".join(number(v) for v in line) for line in sm)
    lines = [
        "dlio:",
        "  imu:",
        "    calibration: false",
        "    intrinsics:",
        "      accel:",
        f"        bias: {row(sm @ subject.accelerometer.bias)}  # m/s^2",
        f"        sm:   [ {rows} ]",
        "      gyro:",
        f"        bias: {row(gyroscope.bias)}  # rad/s",
    ]
    return {"dlio_imu.yaml": commented(head(reduced, TARGET.title, FORMULA)) + "\n".join(lines) + "\n"}


TARGET = Target("dlio", "DLIO intrinsics", frozenset({MATRIX, SCALE, BIAS}), "dlio_imu.yaml", write)
