"""Basalt's ``calibration.json``: its IMU keys.

Read in basalt-headers (calib_bias.hpp, calibration.hpp): ``x = (I + S) u - b``, the bias in the output;
accelerometers nine numbers b, S00 S10 S20 S11 S21 S22 (S lower triangular, so frame ``accelerometer-x``),
gyros twelve, b and S by columns. Noise is continuous-time: it multiplies by the root of ``imu_update_rate``
itself.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import CalibrationFileError
from tumble.export.reading import entry, invertible, json_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, NOISE, SCALE, Imported, Target
from tumble.sensor import FRAMES, ImuModel, Triad
from tumble.sensor.gauge import inverse

_LOWER = ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2))


def write(subject: Subject) -> dict[str, str]:
    """Return ``value0`` with the IMU keys alone: they go into a calibration that has cameras."""
    force, rate = (inverse(triad.matrix) for triad in (subject.accelerometer, subject.gyroscope))
    S_a, S_g = force - np.eye(3), rate - np.eye(3)
    value: dict[str, Any] = {
        "calib_accel_bias": [
            *(force @ subject.accelerometer.bias).tolist(),
            *(float(S_a[i, j]) for i, j in _LOWER),
        ],
        "calib_gyro_bias": [*(rate @ subject.gyroscope.bias).tolist(), *S_g.ravel(order="F").tolist()],
    }
    noise = subject.noise
    if noise is not None:
        value["imu_update_rate"] = noise.rate
        for key, number in (
            ("accel_noise_std", noise.accelerometer.density),
            ("gyro_noise_std", noise.gyroscope.density),
            ("accel_bias_std", noise.accelerometer.walk),
            ("gyro_bias_std", noise.gyroscope.walk),
        ):
            value[key] = [number] * 3
    return {"basalt_imu.json": json.dumps({"value0": value}, indent=1) + "\n"}


def read(path: Path) -> Imported:
    """Read the IMU keys.

    Raises
    ------
    CalibrationFileError
        If it is no calibration of Basalt.
    """
    document = json_of(path, "Basalt")
    nine = vector_of(entry(document, "value0.calib_accel_bias", path), "calib_accel_bias", path, 9)
    twelve = vector_of(entry(document, "value0.calib_gyro_bias", path), "calib_gyro_bias", path, 12)
    S_a = np.zeros((3, 3))
    for number, (i, j) in enumerate(_LOWER):
        S_a[i, j] = nine[3 + number]
    force = invertible(np.eye(3) + S_a, "calib_accel_bias", path)
    rate = invertible(np.eye(3) + twelve[3:].reshape(3, 3, order="F"), "calib_gyro_bias", path)
    triads = [
        Triad(inverse(matrix), inverse(matrix) @ bias)
        for matrix, bias in ((force, nine[:3]), (rate, twelve[:3]))
    ]
    if any(np.linalg.det(triad.matrix) <= 0.0 for triad in triads):
        raise CalibrationFileError(f"{path} turns the axes into a left-handed triad: it is damaged.")
    return Imported(
        ImuModel(triads[0], triads[1]),
        ("m/s^2", "rad/s"),
        "accelerometer-x",
        FRAMES["accelerometer-x"],
        (path,),
    )


TARGET = Target(
    "basalt",
    "Basalt calibration.json (IMU keys)",
    frozenset({MATRIX, SCALE, BIAS, NOISE}),
    "basalt_imu.json",
    write,
    read,
    frame="accelerometer-x",
    comment="",
)
