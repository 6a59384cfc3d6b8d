"""SVO: ``imu_params`` and ``imu_initialization``, continuous-time densities and initial biases.

Read on its pages and in its imu_handler.cpp.
"""

from __future__ import annotations

from tumble.export.filters import gravity_of, noise_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, NOISE, Target
from tumble.export.words import commented, head, number, row

_NO_VECTOR: list[str] = []


def write(subject: Subject) -> dict[str, str]:
    """Return ``imu_params`` and, of a calibration, the initial biases of ``imu_initialization``."""
    noise = noise_of(subject)
    lines = [
        "imu_params:",
        "  delay_imu_cam: 0.0",
        f"  sigma_omega_c: {number(noise.gyroscope.density)}  # rad/s/sqrt(Hz)",
        f"  sigma_acc_c: {number(noise.accelerometer.density)}  # m/s^2/sqrt(Hz)",
        f"  sigma_omega_bias_c: {number(noise.gyroscope.walk)}  # rad/s^2/sqrt(Hz)",
        f"  sigma_acc_bias_c: {number(noise.accelerometer.walk)}  # m/s^3/sqrt(Hz)",
        "  sigma_integration: 0.0",
        f"  g: {number(gravity_of(subject))}  # m/s^2",
        f"  imu_rate: {number(noise.rate)}",
        "  # acc_max, omega_max and max_imu_delta_t are yours to set",
    ]
    if subject.calibration is not None:
        lines += [
            "imu_initialization:",
            "  velocity: [0.0, 0.0, 0.0]",
            f"  omega_bias: {row(subject.gyroscope.bias)}  # rad/s, raw at rest",
            f"  acc_bias: {row(subject.accelerometer.bias)}  # m/s^2",
        ]
    formula = ("continuous-time densities; the biases are subtracted from raw numbers",)
    return {
        "svo_imu.yaml": commented(head(subject, TARGET.title, formula, _NO_VECTOR)) + "\n".join(lines) + "\n"
    }


TARGET = Target(
    "svo",
    "SVO imu_params",
    frozenset({NOISE, BIAS}),
    "svo_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
