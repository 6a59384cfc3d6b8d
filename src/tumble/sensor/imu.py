"""The error model of a whole IMU: its triads and what couples them.

A triad: three sensors of one kind on three roughly perpendicular axes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Vector, Vectors
from tumble.records import dataclass


@dataclass(frozen=True)
class Curve:
    """What a sensor shows beside a straight line: a coefficient times a function of its own input.

    Attributes
    ----------
    of, slope : the function and its derivative.
    power : of the raw unit by which the coefficient is divided.
    """

    of: Callable[[AnyArray], AnyArray]
    slope: Callable[[AnyArray], AnyArray]
    power: int


CURVES = {"asymmetry": Curve(np.abs, np.sign, 0), "quadratic": Curve(np.square, lambda u: 2.0 * u, 1)}
"""The curves that a triad may have, by the names of its attributes."""


@dataclass(frozen=True)
class Triad:
    """Three accelerometers or three gyros: how true values become raw ones.

    Attributes
    ----------
    matrix : (3, 3) raw units per SI unit; row i is sensor i's sensitivity to the true vector in b.
    bias : (3,) raw units, the output at zero input.
    asymmetry : (3,) dimensionless or None: scale-factor difference of positive and negative input.
    quadratic : (3,) 1 / raw unit or None.
    """

    matrix: Matrix
    bias: Vector
    asymmetry: Vector | None = None
    quadratic: Vector | None = None

    def distort(self, true: Vectors) -> Vectors:
        """Return the raw output for the true input in frame b (SI), without noise."""
        own_input = true @ self.matrix.T
        raw = own_input + self.bias
        for _, curve, size in self.curves():
            raw = raw + size * curve.of(own_input)
        return raw

    def curves(self) -> Iterator[tuple[str, Curve, Vector]]:
        """Yield the curves that it has: name, function, and each sensor's coefficient (3,)."""
        for name, curve in CURVES.items():
            size: Vector | None = getattr(self, name)
            if size is not None:
                yield name, curve, size

    @property
    def is_straight(self) -> bool:
        """Whether each sensor shows its own input and its bias, and no curve beside."""
        return not any(self.curves())

    def slope(self, own_input: AnyArray) -> AnyArray:
        """Return by how much the raw output moves with each sensor's own input (..., 3)."""
        rises = np.ones(np.shape(own_input))
        for _, curve, size in self.curves():
            rises = rises + size * curve.slope(own_input)
        return rises

    def correct(self, raw: Vectors) -> Vectors:
        """Return the true input in frame b (SI) for the raw output: the inverse of `distort`.

        The sign that asymmetry needs is the sign of each sensor's own input, which the output
        without bias has as long as the asymmetry is below 1 and the quadratic term is a correction.

        Raises
        ------
        ValueError
            If the matrix cannot be inverted.
        """
        try:
            return np.asarray(self.own_input(raw) @ np.linalg.inv(self.matrix).T, dtype=np.float64)
        except np.linalg.LinAlgError as error:
            raise ValueError("the triad's matrix is singular: it cannot be corrected") from error

    def in_raw_unit(self, factor: float) -> Triad:
        """Return the same triad with raw numbers `factor` times as large, such as counts instead of SI."""
        curves = {name: size / factor**curve.power for name, curve, size in self.curves()}
        return replace(self, matrix=factor * self.matrix, bias=factor * self.bias, **curves)

    def own_input(self, raw: Vectors) -> Vectors:
        """Return each sensor's own input ``u`` in raw units, before cross-coupling is removed."""
        output = raw - self.bias
        if self.is_straight:
            return output
        slope = 1.0 if self.asymmetry is None else 1.0 + self.asymmetry * np.sign(output)
        if self.quadratic is None:
            return output / slope
        # output = slope u + q u²: the root that tends to output / slope as q does to zero.
        root = np.sqrt(np.maximum(slope**2 + 4.0 * self.quadratic * output, 0.0))
        return 2.0 * output / (slope + root)


@dataclass(frozen=True)
class ImuModel:
    """Accelerometer, gyro and magnetometer triads in one body frame b.

    Attributes
    ----------
    accelerometer, gyroscope : the triads; either may be None if the unit has none or the data did
        not tell it.
    g_sensitivity : (3, 3) raw gyro units per m/s², acting on the true specific force in b, or None.
    magnetometer : raw units per tesla (or per local field): its bias is the hard iron, its matrix holds soft iron,
        scale factors, non-orthogonality and the rotation to b; None without one.
    """

    accelerometer: Triad | None
    gyroscope: Triad | None
    g_sensitivity: Matrix | None = None
    magnetometer: Triad | None = None

    @staticmethod
    def ideal() -> ImuModel:
        """Return a unit without errors whose raw numbers are SI."""
        return ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))

    def distort(self, specific_force_b: Vectors, angular_rate_ib_b: Vectors) -> tuple[Vectors, Vectors]:
        """Return the raw (specific force, angular rate) for true ones in b, m/s² and rad/s.

        Raises
        ------
        ValueError
            If a triad is missing.
        """
        accelerometer, gyroscope = self._both()
        raw_rate = gyroscope.distort(angular_rate_ib_b)
        if self.g_sensitivity is not None:
            raw_rate = raw_rate + specific_force_b @ self.g_sensitivity.T
        return accelerometer.distort(specific_force_b), raw_rate

    def correct(self, raw_force: Vectors, raw_rate: Vectors) -> tuple[Vectors, Vectors]:
        """Return the true (specific force, angular rate) in b for raw ones: inverse of `distort`.

        Raises
        ------
        ValueError
            If a triad is missing or its matrix is singular.
        """
        accelerometer, gyroscope = self._both()
        force = accelerometer.correct(raw_force)
        if self.g_sensitivity is not None:
            raw_rate = raw_rate - force @ self.g_sensitivity.T
        return force, gyroscope.correct(raw_rate)

    def turned(self, C_new_b: Matrix) -> ImuModel:
        """Return the same unit described in another body frame: ``true_new = C_new_b @ true_b``."""
        return ImuModel(
            accelerometer=_turned(self.accelerometer, C_new_b),
            gyroscope=_turned(self.gyroscope, C_new_b),
            g_sensitivity=None if self.g_sensitivity is None else self.g_sensitivity @ C_new_b.T,
            magnetometer=_turned(self.magnetometer, C_new_b),
        )

    def _both(self) -> tuple[Triad, Triad]:
        if self.accelerometer is None or self.gyroscope is None:
            missing = "accelerometer" if self.accelerometer is None else "gyroscope"
            raise ValueError(f"the model has no {missing}")
        return self.accelerometer, self.gyroscope


def _turned(triad: Triad | None, C_new_b: Matrix) -> Triad | None:
    if triad is None:
        return None
    return replace(triad, matrix=np.asarray(triad.matrix @ C_new_b.T))
