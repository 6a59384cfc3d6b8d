"""Vectors and matrices of three as a document has them: tuples of numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

Row = tuple[float, float, float]
Rows = tuple[Row, Row, Row]


def row_of(vector: ArrayLike) -> Row:
    """Return three numbers as a document has them."""
    x, y, z = np.asarray(vector, dtype=float).tolist()
    return x, y, z


def rows_of(matrix: ArrayLike) -> Rows:
    """Return a (3, 3) matrix as a document has it."""
    a, b, c = np.asarray(matrix, dtype=float)
    return row_of(a), row_of(b), row_of(c)
