"""VINS-Mono and VINS-Fusion: the noise of the IMU.

Read in integration_base.h: it adds (acc_w dt)² to a bias's variance each sample, so acc_w = K sqrt(rate);
acc_n is the sigma of a sample, N sqrt(rate).
"""

from __future__ import annotations

import numpy as np

from tumble.export.filters import gravity_of, noise_of
from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.words import commented, head, number, quoted

_NO_VECTOR: list[str] = []


def write(subject: Subject) -> dict[str, str]:
    """Return the IMU part of a TARGET-Mono or TARGET-Fusion configuration."""
    noise = noise_of(subject)
    root = float(np.sqrt(noise.rate))
    formula = (
        "integration_base.h adds (acc_w dt)^2 to a bias's variance each sample: acc_w = K sqrt(rate)",
        "and acc_n, gyr_n are the sigma of one sample: N sqrt(rate). It takes a sample's half steps as independent,",
        "which halves the white noise: for the variance that the samples have, multiply acc_n and gyr_n by sqrt(2)",
    )
    lines = [
        f"acc_n: {number(noise.accelerometer.density * root)}  # m/s^2, one sample",
        f"gyr_n: {number(noise.gyroscope.density * root)}  # rad/s, one sample",
        f"acc_w: {number(noise.accelerometer.walk * root)}",
        f"gyr_w: {number(noise.gyroscope.walk * root)}",
        f"g_norm: {number(gravity_of(subject))}  # m/s^2",
        f"imu_topic: {quoted(subject.topic)}",
    ]
    text = commented(head(subject, TARGET.title, formula, _NO_VECTOR)) + "\n".join(lines) + "\n"
    return {"vins_imu.yaml": "%YAML:1.0\n" + text}


TARGET = Target(
    "vins",
    "VINS-Mono and VINS-Fusion (IMU noise)",
    frozenset({NOISE}),
    "vins_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
