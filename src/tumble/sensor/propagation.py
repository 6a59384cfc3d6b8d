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
    step = 1e-30
    columns: list[npt.NDArray[Any]] = []
    for index in range(values.size):
        moved = values.astype(complex)
        moved[index] += 1j * step
        columns.append(np.imag(function(moved)) / step)
    return np.column_stack(columns)


def propagate(function: Function, values: Series, covariance: Square) -> tuple[Series, Table]:
    """Return ``function(values)`` and its covariance to first order (GUM 5.1.2, JCGM 102 6.2)."""
    derivatives = jacobian(function, values)
    return np.real(function(values.astype(complex))), derivatives @ covariance @ derivatives.T
