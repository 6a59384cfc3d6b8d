"""ROS: the covariances of ``sensor_msgs/Imu``.

Read in common_interfaces: 3x3 by rows, the variance of one sample, N² times the rate; -1 first: absent.
"""

from __future__ import annotations

import numpy as np

from tumble.export.filters import noise_of
from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.words import commented, head, row

_NO_VECTOR: list[str] = []


def _covariance(densities: np.ndarray, rate: float) -> np.ndarray:
    return np.diag(densities**2 * rate).ravel()


def write(subject: Subject) -> dict[str, str]:
    """Return the covariances of ``sensor_msgs/Imu`` as YAML; orientation is said not to be there."""
    noise = noise_of(subject)
    formula = (
        "diagonal: variance of one sample, N^2 rate, axis by axis; row-major 3x3; (m/s^2)^2 and (rad/s)^2",
        "orientation_covariance[0] = -1: the message has no orientation; all zeros would say: unknown",
    )
    lines = [
        f"orientation_covariance: {row([-1.0] + [0.0] * 8)}",
        f"angular_velocity_covariance: {row(_covariance(noise.gyroscope.densities, noise.rate))}",
        f"linear_acceleration_covariance: {row(_covariance(noise.accelerometer.densities, noise.rate))}",
    ]
    return {
        "imu_covariances.yaml": commented(head(subject, TARGET.title, formula, _NO_VECTOR))
        + "\n".join(lines)
        + "\n"
    }


TARGET = Target(
    "ros",
    "ROS sensor_msgs/Imu covariances",
    frozenset({NOISE}),
    "imu_covariances.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
