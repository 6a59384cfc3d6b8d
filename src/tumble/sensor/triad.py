"""A triad: three sensors of one kind on three roughly perpendicular axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Vector, Vectors
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
