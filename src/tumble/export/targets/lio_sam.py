"""LIO-SAM: the noise of the IMU.

Read in imuPreintegration.cpp: gtsam's continuous covariances are ``imuAccNoise²`` and ``imuGyrNoise²``, so they are N;
between two scans a bias may move by ``sqrt(deltaTij) imuAccBiasN``, so that this is K. It takes no matrix and no
bias: play it a corrected bag.
"""

from __future__ import annotations

from tumble.export.filters import gravity_of, noise_of
from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.words import commented, head, number, yaml_text

_NO_VECTOR: list[str] = []


def write(subject: Subject) -> dict[str, str]:
    """Return the IMU part of ``params.yaml``."""
    noise = noise_of(subject)
    formula = (
        "imuAccNoise, imuGyrNoise: N, continuous; imuAccBiasN, imuGyrBiasN: K, for a bias moves by K sqrt(time)",
        "LIO-SAM takes no matrix and no bias: play it a corrected bag (tumble apply)",
    )
    lines = [
        "lio_sam:",
        f"  imuTopic: {yaml_text(subject.topic)}",
        f"  imuAccNoise: {number(noise.accelerometer.density)}  # m/s^2/sqrt(Hz)",
        f"  imuGyrNoise: {number(noise.gyroscope.density)}  # rad/s/sqrt(Hz)",
        f"  imuAccBiasN: {number(noise.accelerometer.walk)}  # m/s^3/sqrt(Hz)",
        f"  imuGyrBiasN: {number(noise.gyroscope.walk)}  # rad/s^2/sqrt(Hz)",
        f"  imuGravity: {number(gravity_of(subject))}  # m/s^2",
    ]
    return {
        "lio_sam_imu.yaml": commented(head(subject, TARGET.title, formula, _NO_VECTOR))
        + "\n".join(lines)
        + "\n"
    }


TARGET = Target(
    "lio-sam",
    "LIO-SAM (IMU noise)",
    frozenset({NOISE}),
    "lio_sam_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
