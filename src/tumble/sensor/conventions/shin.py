"""Shin and El-Sheimy's nine parameters of a triad, with exact trigonometry (Hayal 2010, 3.8, 3.13).

``raw = bias + diag(scale_factor) @ N @ true`` with the sensing axes as rows of

    N = [[1,             0,                        0                      ],
         [-sin(yz),      cos(yz),                  0                      ],
         [ sin(zy),     -sin(zx) cos(zy),          cos(zx) cos(zy)        ]]

in the frame ``accelerometer-x``. `scale_factor` is raw units per SI unit: 1 + s where the raw unit
is SI. Hayal's 3.7, 3.9 and 3.10 print the x component of the last row with the wrong sign.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[Any]


def matrix_from_shin(scale_factor: Complex, angles: Complex) -> Complex:
    """Return the lower-triangular matrix for scale factors and angles (yz, zx, zy) in rad."""
    yz, zx, zy = angles
    zero = yz * 0.0
    axes = np.array(
        [
            [zero + 1.0, zero, zero],
            [-np.sin(yz), np.cos(yz), zero],
            [np.sin(zy), -np.sin(zx) * np.cos(zy), np.cos(zx) * np.cos(zy)],
        ]
    )
    return scale_factor[:, None] * axes


def shin_derivatives(values: Complex) -> Complex:
    """Return (3, 3, 6) the matrix's derivatives by three scale factors and three angles; see `propagation.jacobian`."""
    step = 1e-30
    moved = values[:, None] + 1j * step * np.eye(6)
    return np.imag(matrix_from_shin(moved[:3], moved[3:])) / step


def shin_from_matrix(matrix: Complex) -> tuple[Complex, Complex]:
    """Return (scale factors, angles yz, zx, zy) of a lower-triangular matrix: the exact inverse.

    A negative diagonal element, a sensor that counts backwards, is a negative scale factor.

    Raises
    ------
    ValueError
        If the matrix is not lower triangular: turn it to the frame ``accelerometer-x`` first.
    """
    upper = np.abs(np.real(matrix[[0, 0, 1], [1, 2, 2]]))
    # 1e-9 of the diagonal: a frame change leaves round-off there, a forgotten one 1e-4 and more.
    if np.any(upper > 1e-9 * np.max(np.abs(np.real(matrix)))):
        raise ValueError("the matrix is not lower triangular: change the frame to accelerometer-x first")
    scale_factor = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
    axes = matrix / scale_factor[:, None]
    yz = -np.arctan(axes[1, 0] / axes[1, 1])
    zy = np.arcsin(axes[2, 0])
    zx = -np.arctan(axes[2, 1] / axes[2, 2])
    return scale_factor, np.array([yz, zx, zy])
