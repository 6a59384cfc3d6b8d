"""The truth of a unit in the frames that the conventions' page documents, and what of it people name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sensors import Unit


@dataclass(frozen=True)
class Truth:
    """A unit's true errors over one recording.

    Attributes
    ----------
    unit : in SI, along the axes of its case; its biases are the means over the recording.
    force_unit, rate_unit : raw numbers per m/s² and per rad/s.
    bias_range : (2, 6); how low and how high the six biases went, in raw units.
    thermal : how the unit changes with temperature, for the thermal test alone.
    """

    unit: Unit
    force_unit: float
    rate_unit: float
    bias_range: np.ndarray
    thermal: Thermal | None = None

    def terms(self, frame: str) -> dict[str, np.ndarray]:
        """Return all terms in raw units, in one of the documented frames."""
        unit, c = self.unit, rotation_to(self.unit, frame)
        return {
            "accelerometer.matrix": self.force_unit * unit.accelerometer_matrix @ c.T,
            "accelerometer.bias": self.force_unit * unit.accelerometer_bias,
            "accelerometer.asymmetry": unit.accelerometer_asymmetry,
            "accelerometer.quadratic": unit.accelerometer_quadratic / self.force_unit,
            "gyroscope.matrix": self.rate_unit * unit.gyro_matrix @ c.T,
            "gyroscope.bias": self.rate_unit * unit.gyro_bias,
            "gyroscope.asymmetry": unit.gyro_asymmetry,
            "gyroscope.quadratic": unit.gyro_quadratic / self.rate_unit,
            "gyroscope.g_sensitivity": self.rate_unit * unit.g_sensitivity @ c.T,
        }


@dataclass(frozen=True)
class Thermal:
    """Biases as polynomials of T − reference, (order, 6) in raw units, and scale factors' shares per kelvin, (6,)."""

    reference: float
    bias: np.ndarray
    scale: np.ndarray

    def bias_change(self, celsius: float) -> np.ndarray:
        """Return how the six biases differ from those at the reference."""
        powers = (celsius - self.reference) ** np.arange(1, len(self.bias) + 1)
        return powers @ self.bias


def triangular(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a matrix as lower triangle with positive diagonal times a rotation (Gram-Schmidt of its rows)."""
    x = matrix[0] / np.linalg.norm(matrix[0])
    y = matrix[1] - (matrix[1] @ x) * x
    y /= np.linalg.norm(y)
    rotation = np.stack((x, y, np.cross(x, y)))
    return matrix @ rotation.T, rotation


def rotation_to(unit: Unit, frame: str) -> np.ndarray:
    """Return the matrix that brings vectors of the case into a frame."""
    if frame == "fixture":
        return np.eye(3)
    if frame == "accelerometer-x":
        return triangular(unit.accelerometer_matrix)[1]
    if frame == "accelerometer-z":
        # The same with the order of axes turned round: z first, then y, then x.
        backwards = unit.accelerometer_matrix[::-1]
        z = backwards[0] / np.linalg.norm(backwards[0])
        y = backwards[1] - (backwards[1] @ z) * z
        y /= np.linalg.norm(y)
        return np.stack((np.cross(y, z), y, z))
    if frame == "mean-gyro":
        left, _, right = np.linalg.svd(unit.gyro_matrix)
        return left @ right
    raise ValueError(f"there is no frame {frame}")


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vector of a rotation matrix below half a turn."""
    axis = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(matrix) - 1)))
    return axis * (angle / sine if sine > 1e-12 else 1.0)


def named(terms: dict[str, np.ndarray], *, diagonal: bool = False) -> dict[str, np.ndarray]:
    """Return what people name of the terms: scale factors, angles, the rotation between the triads.

    `diagonal`: take it for scale factors, for tests that know nothing of the angles.

    Notes
    -----
    A scale factor is the length of a row. Non-orthogonalities are the angles among sensing axes less 90°, which no
    rotation of the frame changes, with the sign that the angle's sine product has: arcsin(row_i · row_j). The frame's
    own direction in a fixture is the rotation of the triangular decomposition.
    """
    found: dict[str, np.ndarray] = {}
    turned: dict[str, np.ndarray] = {}
    for triad in ("accelerometer", "gyroscope"):
        if f"{triad}.bias" in terms:
            found[f"{triad} bias"] = terms[f"{triad}.bias"]
        if f"{triad}.matrix" not in terms:
            continue
        matrix = terms[f"{triad}.matrix"]
        length = np.linalg.norm(matrix, axis=1)
        rows = matrix / length[:, None]
        found[f"{triad} scale"] = np.diag(matrix) if diagonal else length
        found[f"{triad} non-orthogonality"] = np.arcsin(
            np.clip([rows[0] @ rows[1], rows[0] @ rows[2], rows[1] @ rows[2]], -1, 1)
        )
        turned[triad] = triangular(matrix)[1]
        found[f"{triad} alignment"] = rotation_vector(turned[triad])
    if len(turned) == 2:
        found["between triads"] = rotation_vector(turned["gyroscope"] @ turned["accelerometer"].T)
    for name, group in (
        ("gyroscope.g_sensitivity", "g-sensitivity"),
        ("accelerometer.asymmetry", "accelerometer asymmetry"),
        ("gyroscope.asymmetry", "gyroscope asymmetry"),
        ("accelerometer.quadratic", "accelerometer quadratic"),
        ("gyroscope.quadratic", "gyroscope quadratic"),
    ):
        if name in terms:
            found[group] = np.ravel(terms[name])
    return found
