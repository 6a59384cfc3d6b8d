"""OKVIS: ``imu_params``, continuous-time densities and the accelerometers' bias.

Read in its configuration files.
"""

from __future__ import annotations

from tumble.export.filters import gravity_of, noise_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, NOISE, Target
from tumble.export.words import commented, head, number, row

_NO_VECTOR: list[str] = []


def write(subject: Subject) -> dict[str, str]:
    """Return the ``imu_params`` of an TARGET configuration; a0 is the accelerometers' bias."""
    noise = noise_of(subject)
    lines = [
        "imu_params:",
        f"  sigma_g_c: {number(noise.gyroscope.density)}  # rad/s/sqrt(Hz)",
        f"  sigma_a_c: {number(noise.accelerometer.density)}  # m/s^2/sqrt(Hz)",
        f"  sigma_gw_c: {number(noise.gyroscope.walk)}  # rad/s^2/sqrt(Hz)",
        f"  sigma_aw_c: {number(noise.accelerometer.walk)}  # m/s^3/sqrt(Hz)",
        f"  tau: {number(subject.wishes.correlation_time)}  # s",
        f"  g: {number(gravity_of(subject))}  # m/s^2",
        f"  imu_rate: {number(noise.rate)}",
    ]
    formula = ("continuous-time densities; a0 is subtracted from the raw specific force",)
    if subject.calibration is not None:
        lines.append(f"  a0: {row(subject.accelerometer.bias)}  # m/s^2")
    lines.append("  # a_max, g_max, sigma_ba, sigma_bg and T_BS are yours to set")
    return {
        "okvis_imu.yaml": commented(head(subject, TARGET.title, formula, _NO_VECTOR))
        + "\n".join(lines)
        + "\n"
    }


TARGET = Target(
    "okvis",
    "OKVIS imu_params",
    frozenset({NOISE, BIAS}),
    "okvis_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
