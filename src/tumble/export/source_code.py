"""What the source files that correct have in common: the whole model of one temperature, and test vectors."""

from __future__ import annotations

import numpy as np

from tumble.export.subject import Subject
from tumble.export.target import BIAS, G_SENSITIVITY, MAGNETOMETER, MATRIX, NONLINEAR, SCALE
from tumble.export.words import number
from tumble.sensor import Triad

HOLDS = frozenset({MATRIX, SCALE, BIAS, G_SENSITIVITY, NONLINEAR, MAGNETOMETER})
FORMULA = (
    "own input u of each sensor: u + asymmetry |u| + quadratic u^2 = raw - bias - g_sensitivity f",
    "corrected = inverse u, with the inverse of the calibration's matrix; f: corrected specific force, gyros only",
)


def braces(values: object) -> str:
    """Return numbers as C has them, with all their digits."""
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        return "{" + ", ".join(number(v) for v in array) + "}"
    return "{" + ",\n     ".join(braces(line) for line in array) + "}"


def triad_numbers(triad: Triad) -> dict[str, np.ndarray]:
    """Return what corrects a triad, zeros for what it does not have."""
    zero = np.zeros(3)
    return {
        "inverse": np.linalg.inv(triad.matrix),
        "bias": triad.bias,
        "asymmetry": zero if triad.asymmetry is None else triad.asymmetry,
        "quadratic": zero if triad.quadratic is None else triad.quadratic,
    }


def sensitivity(subject: Subject) -> np.ndarray:
    """Return the g-sensitivity, zeros without one."""
    return (
        np.zeros((3, 3)) if subject.model.g_sensitivity is None else np.asarray(subject.model.g_sensitivity)
    )


def tests_of(subject: Subject) -> list[list[np.ndarray]]:
    """Return the test vectors, each raw force, raw rate, force and rate."""
    return [list(four) for four in zip(*subject.vectors(), strict=True)]
