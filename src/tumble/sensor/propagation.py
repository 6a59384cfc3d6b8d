"""Carrying a covariance through a change of parameters, by complex-step derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table

Function = Callable[[npt.NDArray[Any]], npt.NDArray[Any]]


def jacobian(function: Function, values: Series) -> Table:
    """Return the derivatives of an analytic `function` at `values`, exact to round-off.

    The imaginary part of ``f(x + 1e-30 i)`` over 1e-30 has no cancellation (Squire and Trapp 1998);
    `function` must accept complex arrays and use no conjugate, absolute value or comparison of them.
    """
    return np.column_stack([_derivative(function, values, index) for index in range(values.size)])


def propagate(function: Function, values: Series, covariance: Square) -> tuple[Series, Table]:
    """Return ``function(values)`` and its covariance to first order (GUM 5.1.2, JCGM 102 6.2)."""
    made = np.real(function(values.astype(complex)))
    slope = np.zeros((made.size, values.size))
    # What has no covariance moves nothing.
    for index in np.flatnonzero(np.any(covariance, axis=0)).tolist():
        slope[:, index] = _derivative(function, values, index)
    return made, slope @ covariance @ slope.T


def _derivative(function: Function, values: Series, index: int) -> Series:
    step = 1e-30
    moved = values.astype(complex)
    moved[index] += 1j * step
    return np.asarray(np.imag(function(moved)) / step, dtype=np.float64)
