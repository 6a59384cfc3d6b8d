"""Kalibr's ``imu.yaml``: the noise that its calibrations ask for, read in its source (ConfigReader.py)."""

from __future__ import annotations

from tumble.export.filters import noise_lines
from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.words import commented, head, number, yaml_text


def write(subject: Subject) -> dict[str, str]:
    """Return the noise input of Kalibr's calibrations."""
    assert subject.noise is not None
    said = head(
        subject, TARGET.title, ("sigma of a sample = density sqrt(update_rate), continuous time",), []
    )
    lines = [
        *noise_lines(subject.noise),
        f"rostopic: {yaml_text(subject.topic)}",
        f"update_rate: {number(subject.noise.rate)}  # Hz",
    ]
    return {"imu.yaml": commented(said) + "\n".join(lines) + "\n"}


TARGET = Target(
    "kalibr-noise",
    "Kalibr imu.yaml (noise)",
    frozenset({NOISE}),
    "imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
