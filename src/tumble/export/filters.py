"""What the filters' noise files have in common."""

from __future__ import annotations

from tumble.export.noise import SensorNoise
from tumble.export.subject import Subject
from tumble.units import STANDARD_GRAVITY


def noise_of(subject: Subject) -> SensorNoise:
    """Return the noise that is there, for a target that needs it."""
    assert subject.noise is not None
    return subject.noise


def gravity_of(subject: Subject) -> float:
    """Return gravity where the unit was calibrated, m/s²; the standard value without a calibration."""
    return STANDARD_GRAVITY if subject.calibration is None else subject.calibration.site.gravity
