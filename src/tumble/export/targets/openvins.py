"""OpenVINS ``kalibr_imu_chain.yaml``, model ``kalibr``.

Read in its documentation (docs/propagation.dox) and options (VioManagerOptions.h): forward, ``w_m = Tw
R_IMUtoGYRO w + Tg a + b_g`` and ``a_m = Ta R_IMUtoACC a + b_a`` with the specific force a in the IMU frame.
In the model ``kalibr`` Tw and Ta are lower triangular and R_IMUtoACC is one. Its comments map Tg to Kalibr's
A, which acts on the force in the gyros' frame: exact is ``Tg = A C_gyro_i``, which is what is written. Its
estimator starts from zero biases; they stand here under ``bias_acc`` and ``bias_gyro``, keys that OpenVINS
does not read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tumble.errors import CalibrationFileError
from tumble.export.filters import noise_lines
from tumble.export.reading import check_rotation, entry, invertible, matrix_of, vector_of, yaml_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, G_SENSITIVITY, MATRIX, NOISE, SCALE, Imported, Target
from tumble.export.words import commented, head, number, row, yaml_rows, yaml_text
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import lower_factor

FORMULA = (
    "w_m = Tw R_IMUtoGYRO w + Tg f + b_g;  a_m = Ta R_IMUtoACC f + b_a   (forward; f specific force in the IMU frame)",
    "to correct: f = R_IMUtoACC^T inverse(Ta) (a_m - b_a);  w = R_IMUtoGYRO^T inverse(Tw) (w_m - b_g - Tg f)",
)


def write(subject: Subject) -> dict[str, str]:
    """Return the configuration's IMU file."""
    own = lower_factor(subject.gyroscope.matrix)
    sensitivity = np.zeros((3, 3)) if subject.model.g_sensitivity is None else subject.model.g_sensitivity
    lines = ["imu0:", "  T_i_b:", yaml_rows(np.eye(4), 4)]
    if subject.noise is not None:
        lines += noise_lines(subject.noise, 2)
        lines.append(f"  update_rate: {number(subject.noise.rate)}")
    lines += [
        f"  rostopic: {yaml_text(subject.topic)}",
        "  time_offset: 0.0",
        '  model: "kalibr"',
        f"  bias_acc: {row(subject.accelerometer.bias)}",
        f"  bias_gyro: {row(subject.gyroscope.bias)}",
    ]
    for key, matrix in (
        ("Tw", own),
        ("R_IMUtoGYRO", np.linalg.solve(own, subject.gyroscope.matrix)),
        ("Ta", subject.accelerometer.matrix),
        ("R_IMUtoACC", np.eye(3)),
        ("Tg", sensitivity),
    ):
        lines += [f"  {key}:", yaml_rows(matrix, 4)]
    text = "%YAML:1.0\n" + commented(head(subject, TARGET.title, FORMULA)) + "\n".join(lines) + "\n"
    return {"kalibr_imu_chain.yaml": text}


def read(path: Path) -> Imported:
    """Read a configuration's IMU file of any of OpenVINS' models.

    Raises
    ------
    CalibrationFileError
        If it is none.
    """
    document = yaml_of(path, "OpenVINS")
    imu = document.get("imu0")
    if not isinstance(imu, dict):
        raise CalibrationFileError(f"{path} has no imu0: it is no kalibr_imu_chain.yaml.")
    if "accelerometers" in imu:
        raise CalibrationFileError(
            f"{path} has Kalibr's keys (accelerometers.M): read it with --from kalibr."
        )
    Tw = invertible(entry(document, "imu0.Tw", path), "Tw", path)
    Ta = invertible(entry(document, "imu0.Ta", path), "Ta", path)
    Tg = matrix_of(entry(document, "imu0.Tg", path), "Tg", path)
    turned = [
        check_rotation(matrix_of(entry(document, f"imu0.{key}", path), key, path), key, path)
        for key in ("R_IMUtoGYRO", "R_IMUtoACC")
    ]
    biases: list[np.ndarray] = []
    remarks: list[str] = []
    for key in ("bias_acc", "bias_gyro"):
        given = document["imu0"].get(key)
        if given is None:
            remarks.append(f"OpenVINS' file has no {key}: it is taken as zero")
        biases.append(np.zeros(3) if given is None else vector_of(given, key, path))
    return Imported(
        ImuModel(
            Triad(np.asarray(Ta @ turned[1]), biases[0]),
            Triad(np.asarray(Tw @ turned[0]), biases[1]),
            Tg if np.any(Tg) else None,
        ),
        ("m/s^2", "rad/s"),
        "IMU of OpenVINS",
        "the IMU frame of the OpenVINS configuration",
        (path,),
        tuple(remarks),
    )


TARGET = Target(
    "openvins",
    "OpenVINS kalibr_imu_chain.yaml",
    frozenset({MATRIX, SCALE, BIAS, G_SENSITIVITY, NOISE}),
    "kalibr_imu_chain.yaml",
    write,
    read,
    frame="accelerometer-x",
)
