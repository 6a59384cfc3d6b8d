"""Savage's error parameters of an IMU in the mean-gyro (MARS) frame (2018, (6) to (11)).

    measured rate  = (I + κ_lin + κ_mis) ω + κ_asym |ω| + bias
    measured force = (I + λ_lin + μ) a + λ_asym |a| + λ

The body frame is the orthogonal one that fits best around the gyros' axes: there the gyros' matrix is
symmetric, κij = κji = υij / 2 (8) to (10), and the accelerometers have six misalignments μij (11). The
asymmetry acts on each sensor's *own* input ``u`` of the one model, as in all of tumble: it belongs to the
sensor and does not change with the frame. Dimensionless numbers are of raw units that are SI; a
`factor` of other units is divided out.

From any other frame the way is exact: with M_g = P U the left polar decomposition, P is the symmetric
matrix and U turns the frame into the mean-gyro one.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from tumble.arrays import Matrix, Series, Vector
from tumble.records import dataclass
from tumble.sensor.gauge import mean_gyro_rotation
from tumble.sensor.imu import ImuModel, Triad

PAIRS = ((1, 2), (2, 0), (0, 1))
"""Axes of υ in order: yz, zx, xy."""

OFF_DIAGONAL = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Axes of μ in order: xy, xz, yx, yz, zx, zy."""

NAMES = (
    *(f"kappa {i}{i}" for i in "xyz"),
    *(f"kappa {i}{i}{i}" for i in "xyz"),
    *(f"upsilon {'xyz'[i]}{'xyz'[j]}" for i, j in PAIRS),
    *(f"lambda {i}" for i in "xyz"),
    *(f"lambda {i}{i}" for i in "xyz"),
    *(f"lambda {i}{i}{i}" for i in "xyz"),
    *(f"mu {'xyz'[i]}{'xyz'[j]}" for i, j in OFF_DIAGONAL),
)
"""The 24 parameters that the strapdown rotation test determines, in the order of `SavageErrors.vector`."""

GROUPS = {
    "kappa_lin": slice(0, 3),
    "kappa_asym": slice(3, 6),
    "upsilon": slice(6, 9),
    "lambda_bias": slice(9, 12),
    "lambda_lin": slice(12, 15),
    "lambda_asym": slice(15, 18),
    "mu": slice(18, 24),
}


@dataclass(frozen=True)
class SavageErrors:
    """The errors of a unit in the mean-gyro frame.

    Attributes
    ----------
    kappa : (3,) linear scale factor errors of the gyros.
    kappa_asymmetry : (3,) their asymmetry.
    upsilon : (3,) orthogonality errors yz, zx, xy between gyros, rad.
    bias : (3,) accelerometer biases, m/s².
    scale : (3,) linear scale factor errors of the accelerometers.
    scale_asymmetry : (3,) their asymmetry.
    mu : (6,) misalignments xy, xz, yx, yz, zx, zy of the accelerometers against the frame, rad.
    gyro_bias : (3,) rad/s; the test takes it as constant through a sequence and does not determine it.
    """

    kappa: Vector
    kappa_asymmetry: Vector
    upsilon: Vector
    bias: Vector
    scale: Vector
    scale_asymmetry: Vector
    mu: Series
    gyro_bias: Vector

    @staticmethod
    def from_vector(values: Series, gyro_bias: Vector | None = None) -> SavageErrors:
        """Return the errors of 24 numbers in the order of `NAMES`.

        Parameters
        ----------
        values : (24,).
        gyro_bias : (3,) rad/s; zero by default.
        """
        parts = [np.array(values[at], dtype=np.float64) for at in GROUPS.values()]
        return SavageErrors(*parts, gyro_bias=np.zeros(3) if gyro_bias is None else gyro_bias)

    @property
    def vector(self) -> Series:
        """(24,) in the order of `NAMES`."""
        return np.concatenate([getattr(self, each.name) for each in fields(self)[: len(GROUPS)]])

    def model(self) -> ImuModel:
        """Return the one sensor model, raw units SI, in the mean-gyro frame."""
        gyro = np.eye(3) + np.diag(self.kappa)
        for value, (i, j) in zip(self.upsilon, PAIRS, strict=True):
            gyro[i, j] = gyro[j, i] = 0.5 * value
        force = np.eye(3) + np.diag(self.scale)
        for value, (i, j) in zip(self.mu, OFF_DIAGONAL, strict=True):
            force[i, j] = value
        return ImuModel(
            Triad(force, self.bias.copy(), self.scale_asymmetry.copy()),
            Triad(gyro, self.gyro_bias.copy(), self.kappa_asymmetry.copy()),
        )


def savage_from_model(model: ImuModel) -> tuple[SavageErrors, Matrix]:
    """Return the errors of a model in any frame, and U from its frame to the mean-gyro one.

    Parameters
    ----------
    model : both triads, raw units SI.

    Raises
    ------
    ValueError
        If a triad is missing.
    UsageError
        If the gyros are left-handed.
    """
    if model.accelerometer is None or model.gyroscope is None:
        raise ValueError("the model has one triad only")
    U = mean_gyro_rotation(model.gyroscope.matrix)
    turned = model.turned(U)
    assert turned.accelerometer is not None
    assert turned.gyroscope is not None
    gyro = turned.gyroscope.matrix - np.eye(3)
    force = turned.accelerometer.matrix - np.eye(3)
    asymmetries = [
        np.zeros(3) if triad.asymmetry is None else triad.asymmetry.copy()
        for triad in (turned.gyroscope, turned.accelerometer)
    ]
    errors = SavageErrors(
        kappa=np.diag(gyro).copy(),
        kappa_asymmetry=asymmetries[0],
        upsilon=np.array([gyro[i, j] + gyro[j, i] for i, j in PAIRS]),
        bias=turned.accelerometer.bias.copy(),
        scale=np.diag(force).copy(),
        scale_asymmetry=asymmetries[1],
        mu=np.array([force[i, j] for i, j in OFF_DIAGONAL]),
        gyro_bias=turned.gyroscope.bias.copy(),
    )
    return errors, U
