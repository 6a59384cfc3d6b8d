"""KF-GINS and OB_GINS configurations: initial biases and scale factors, noise.

Read in KF-GINS (its gi_engine: ``imuCompensate``; its loading of the configuration): ``x = (u - b) / (1 +
s)``, axis by axis, in deg/h, mGal and ppm there; arw deg/sqrt(h), vrw m/s/sqrt(h); biases are Gauss-Markov
processes of corrtime (h) with driving density 2 sigma^2 / corrtime, so that a random walk K has sigma = K
sqrt(corrtime / 2). OB_GINS' yaml has the noise keys under the same names and units.
"""

from __future__ import annotations

import numpy as np

from tumble.export import losses
from tumble.export.subject import Subject, with_losses
from tumble.export.target import BIAS, NOISE, SCALE, Target
from tumble.export.words import commented, example_lines, head, number, row
from tumble.sensor import ImuModel, Triad

DEG_PER_H = 180.0 / np.pi * 3600.0
FORMULA = (
    "x = (u - bias) / (1 + scale), axis by axis; initgyrbias deg/h, initaccbias mGal (1e-5 m/s^2), scales ppm",
    "KF-GINS takes increments, front-right-down: these numbers are per second and along the calibration's own axes",
)


def write(subject: Subject) -> dict[str, str]:
    """Return the IMU part of the configuration.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow.
    """
    accelerometer, gyroscope = subject.accelerometer, subject.gyroscope
    kept = [np.diag(np.diag(triad.matrix)) for triad in (accelerometer, gyroscope)]
    lost = losses.of_matrix(accelerometer, kept[0], "accelerometers", "misalignments (off-diagonals)")
    lost += losses.of_matrix(gyroscope, kept[1], "gyros", "misalignments (off-diagonals)")
    model = ImuModel(Triad(kept[0], accelerometer.bias), Triad(kept[1], gyroscope.bias))
    reduced = with_losses(subject, model, lost, TARGET.title)
    lines = [
        f"initgyrbias: {row(DEG_PER_H * gyroscope.bias)}  # deg/h",
        f"initaccbias: {row(1e5 * accelerometer.bias)}  # mGal",
        f"initgyrscale: {row(1e6 * (np.diag(kept[1]) - 1.0))}  # ppm",
        f"initaccscale: {row(1e6 * (np.diag(kept[0]) - 1.0))}  # ppm",
    ]
    if subject.noise is not None:
        noise, time = subject.noise, subject.wishes.correlation_time
        lines += [
            "imunoise:",
            f"  arw: {_three(noise.gyroscope.density * 60.0 * 180.0 / np.pi)}  # deg/sqrt(h)",
            f"  vrw: {_three(noise.accelerometer.density * 60.0)}  # m/s/sqrt(h)",
            f"  gbstd: {_three(DEG_PER_H * noise.gyroscope.walk * np.sqrt(time / 2.0))}  # deg/h",
            f"  abstd: {_three(1e5 * noise.accelerometer.walk * np.sqrt(time / 2.0))}  # mGal",
            f"  corrtime: {number(time / 3600.0)}  # h",
            "  # gsstd and asstd (ppm) are yours to set: a recording at rest says nothing of scale factors",
        ]
    text = commented(head(reduced, TARGET.title, FORMULA, example_lines(reduced))) + "\n".join(lines) + "\n"
    return {"kf-gins.yaml": text}


def _three(value: float) -> str:
    return row([value] * 3)


TARGET = Target(
    "kf-gins",
    "KF-GINS and OB_GINS (IMU errors and noise)",
    frozenset({SCALE, BIAS, NOISE}),
    "kf-gins.yaml",
    write,
)
