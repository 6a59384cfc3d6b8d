"""What the filters' noise files have in common."""

from __future__ import annotations

from tumble.export.noise import SensorNoise
from tumble.export.subject import Subject
from tumble.export.words import number
from tumble.units import STANDARD_GRAVITY


def noise_of(subject: Subject) -> SensorNoise:
    """Return the noise that is there, for a target that needs it."""
    assert subject.noise is not None
    return subject.noise


def gravity_of(subject: Subject) -> float:
    """Return gravity where the unit was calibrated, m/s²; the standard value without a calibration."""
    return STANDARD_GRAVITY if subject.calibration is None else subject.calibration.site.gravity


def noise_lines(noise: SensorNoise, indent: int = 0) -> list[str]:
    """Return Kalibr's four noise keys: continuous time, SI.

    Parameters
    ----------
    noise : coefficients N and K.
    indent : spaces before each.
    """
    pairs = (
        ("accelerometer_noise_density", noise.accelerometer.density, "m/s^2/sqrt(Hz)"),
        ("accelerometer_random_walk", noise.accelerometer.walk, "m/s^3/sqrt(Hz)"),
        ("gyroscope_noise_density", noise.gyroscope.density, "rad/s/sqrt(Hz)"),
        ("gyroscope_random_walk", noise.gyroscope.walk, "rad/s^2/sqrt(Hz)"),
    )
    return [f"{' ' * indent}{key}: {number(value)}  # {unit}" for key, value, unit in pairs]
