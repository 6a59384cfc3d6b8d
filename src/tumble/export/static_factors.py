"""The product T K that imu_tk and its followers have for the inverse of a triad's matrix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import CalibrationFileError
from tumble.export.reading import invertible, vector_of
from tumble.sensor import Triad
from tumble.sensor.gauge import inverse


def factors(triad: Triad) -> tuple[Matrix, Matrix]:
    """Return imu_tk's T and K of a triad: ``inverse(matrix) = T K``, T of unit diagonal, K diagonal."""
    corrected = inverse(triad.matrix)
    scale = np.diag(np.diag(corrected))
    T = corrected @ inverse(scale)
    np.fill_diagonal(T, 1.0)
    return T, scale


def triad_of(T: Any, K: Any, B: Any, file: Path) -> Triad:
    """Return the triad of imu_tk's numbers.

    Parameters
    ----------
    T, K, B : misalignment (3, 3), scale (3, 3), diagonal, and bias (3,), as read.
    file : that they are from.

    Raises
    ------
    CalibrationFileError
        If they are no such numbers.
    """
    misalignment = invertible(T, "the misalignment matrix", file)
    scale = invertible(K, "the scale matrix", file)
    if np.any(scale - np.diag(np.diag(scale))):
        raise CalibrationFileError(f"The scale matrix in {file} is not diagonal: it is no file of imu_tk.")
    return Triad(inverse(misalignment @ scale), vector_of(B, "the bias", file))
