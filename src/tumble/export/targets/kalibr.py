"""Kalibr: the intrinsics of its model ``scale-misalignment``.

Read in its source (IccSensors.py, the accelerometer and gyroscope error terms). The model
is forward, true to measured, in the accelerometers' frame i whose forward matrix is lower triangular
(``accelerometer-x``)::

    a_m = M_a f + b_a
    w_m = M_g C_gyro_i w + A (C_gyro_i f) + b_g

M_g is lower triangular too, C_gyro_i the rotation from i to the gyros' own frame, and A acts on the specific
force in *that* frame. Kalibr's result file holds no biases (they are splines, shown in its PDF); this one
holds them under ``bias``, a key that Kalibr does not read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import CalibrationFileError
from tumble.export.filters import noise_lines
from tumble.export.reading import check_rotation, entry, invertible, matrix_of, vector_of, yaml_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, G_SENSITIVITY, MATRIX, NOISE, SCALE, Imported, Target
from tumble.export.words import commented, head, number, row, yaml_rows, yaml_text
from tumble.sensor import FRAMES, ImuModel, Triad
from tumble.sensor.gauge import lower_factor

FORMULA = (
    "a_m = M_a f + b_a;  w_m = M_g C_gyro_i w + A (C_gyro_i f) + b_g   (forward: true to measured)",
    "to correct: f = inverse(M_a) (a_m - b_a);  w = C_gyro_i^T inverse(M_g) (w_m - b_g - A C_gyro_i f)",
)


def write(subject: Subject) -> dict[str, str]:
    """Return the intrinsics as Kalibr's result file has them, with biases."""
    accelerometer, gyroscope = subject.accelerometer, subject.gyroscope
    own = lower_factor(gyroscope.matrix)
    C_gyro_i = np.linalg.solve(own, gyroscope.matrix)
    sensitivity = np.zeros((3, 3)) if subject.model.g_sensitivity is None else subject.model.g_sensitivity
    lines = [
        "imu0:",
        "  T_i_b:",
        yaml_rows(np.eye(4), 2),
        "  accelerometers:",
        "    M:",
        yaml_rows(accelerometer.matrix, 4),
        f"    bias: {row(accelerometer.bias)}  # m/s^2",
        "  gyroscopes:",
        "    M:",
        yaml_rows(own, 4),
        "    A:",
        yaml_rows(sensitivity @ C_gyro_i.T, 4),
        "    C_gyro_i:",
        yaml_rows(C_gyro_i, 4),
        f"    bias: {row(gyroscope.bias)}  # rad/s",
        "  model: scale-misalignment",
    ]
    if subject.noise is not None:
        lines += noise_lines(subject.noise, 2)
        lines.append(f"  update_rate: {number(subject.noise.rate)}")
    lines += [f"  rostopic: {yaml_text(subject.topic)}", "  time_offset: 0.0"]
    return {"imu-intrinsics.yaml": commented(head(subject, TARGET.title, FORMULA)) + "\n".join(lines) + "\n"}


def read(path: Path) -> Imported:
    """Read a result file of Kalibr, or one of this module.

    Raises
    ------
    CalibrationFileError
        If it is none, or of the model ``calibrated`` or ``scale-misalignment-size-effect`` without matrices.
    """
    document = yaml_of(path, "Kalibr")
    if "imu0" not in document:
        if "accelerometer_noise_density" in document:
            raise CalibrationFileError(f"{path} holds Kalibr's noise parameters and no calibration.")
        raise CalibrationFileError(f"{path} has no imu0: it is no result file of Kalibr.")
    imu = document["imu0"]
    if isinstance(imu, dict) and "Tw" in imu:
        raise CalibrationFileError(f"{path} has OpenVINS' keys (Tw, Ta): read it with --from openvins.")
    model = entry(document, "imu0.model", path)
    if model == "calibrated":
        raise CalibrationFileError(
            f"{path} is of Kalibr's model 'calibrated', which has no matrices to read."
        )
    M_a = invertible(entry(document, "imu0.accelerometers.M", path), "accelerometers.M", path)
    M_g = invertible(entry(document, "imu0.gyroscopes.M", path), "gyroscopes.M", path)
    A = matrix_of(entry(document, "imu0.gyroscopes.A", path), "gyroscopes.A", path)
    C = matrix_of(entry(document, "imu0.gyroscopes.C_gyro_i", path), "gyroscopes.C_gyro_i", path)
    check_rotation(C, "gyroscopes.C_gyro_i", path)
    remarks: list[str] = []
    biases: list[np.ndarray] = []
    for name in ("accelerometers", "gyroscopes"):
        given: Any = document["imu0"][name].get("bias")
        if given is None:
            remarks.append(f"Kalibr's file has no bias of the {name}: it is taken as zero")
        biases.append(np.zeros(3) if given is None else vector_of(given, f"{name}.bias", path))
    if model == "scale-misalignment-size-effect":
        remarks.append("Kalibr's lever arms of the accelerometers are left out")
    sensitivity = np.asarray(A @ C)
    return Imported(
        ImuModel(
            Triad(M_a, biases[0]),
            Triad(np.asarray(M_g @ C), biases[1]),
            sensitivity if np.any(sensitivity) else None,
        ),
        ("m/s^2", "rad/s"),
        "accelerometer-x",
        FRAMES["accelerometer-x"],
        (path,),
        tuple(remarks),
    )


TARGET = Target(
    "kalibr",
    "Kalibr intrinsics (scale-misalignment)",
    frozenset({MATRIX, SCALE, BIAS, G_SENSITIVITY, NOISE}),
    "imu-intrinsics.yaml",
    write,
    read,
    frame="accelerometer-x",
)
