"""GVINS: the noise of the IMU, as VINS-Mono has it, from which its estimator comes.

Of its source only the configuration was read, whose keys are those of VINS-Mono (see `vins`).
"""

from __future__ import annotations

from tumble.export.subject import Subject
from tumble.export.target import NOISE, Target
from tumble.export.targets import vins


def write(subject: Subject) -> dict[str, str]:
    """Return the IMU part of a configuration."""
    text = next(iter(vins.write(subject).values()))
    return {TARGET.file: text.replace(vins.TARGET.title, TARGET.title)}


TARGET = Target(
    "gvins",
    "GVINS (IMU noise)",
    frozenset({NOISE}),
    "gvins_imu.yaml",
    write,
    needs_calibration=False,
    needs_noise=True,
)
