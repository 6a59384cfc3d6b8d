"""FAST-LIO2: the noise of the IMU.

Read in esekfom.hpp and IMU_Processing.hpp: each sample adds ``(dt G) Q (dt G)^T`` with acc_cov, gyr_cov, b_acc_cov and
b_gyr_cov on Q's diagonal. Of white noise that is to be N² dt, of a bias K² dt, so that they are N² rate and K² rate. It
takes no matrix and no bias: play it a corrected bag. The specific force is divided by its mean norm at the start.
"""

from __future__ import annotations

from tumble.export.filters import noise_of
from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.words import commented, head, number, quoted

_NO_VECTOR: list[str] = []


def write(subject: Subject) -> dict[str, str]:
    """Return the IMU part of a configuration."""
    noise = noise_of(subject)
    formula = (
        "each sample adds dt^2 acc_cov and dt^2 b_acc_cov to variances: acc_cov = N^2 rate, b_acc_cov = K^2 rate",
        "FAST-LIO takes no matrix and no bias: play it a corrected bag (tumble apply)",
        "it scales the specific force by its norm at the start, which takes out a common scale factor and no other",
    )
    rate = noise.rate
    lines = [
        "common:",
        f"  imu_topic: {quoted(subject.topic)}",
        "mapping:",
        f"  acc_cov: {number(noise.accelerometer.density**2 * rate)}  # (m/s^2)^2, one sample",
        f"  gyr_cov: {number(noise.gyroscope.density**2 * rate)}  # (rad/s)^2, one sample",
        f"  b_acc_cov: {number(noise.accelerometer.walk**2 * rate)}  # (m/s^3)^2",
        f"  b_gyr_cov: {number(noise.gyroscope.walk**2 * rate)}  # (rad/s^2)^2",
    ]
    return {
        "fast_lio_imu.yaml": commented(head(subject, TARGET.title, formula, _NO_VECTOR))
        + "\n".join(lines)
        + "\n"
    }


TARGET = Target(
    "fast-lio",
    "FAST-LIO2 (IMU noise)",
    frozenset({NOISE}),
    "fast_lio_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
