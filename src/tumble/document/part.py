"""What every part of a document is: a model that refuses what is no number, and passes over what it does not know.

Vectors and matrices of three are tuples of numbers in it.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict


class DocumentPart(BaseModel):
    """A part of a document; its validator is built when it is first needed, as most are within another's."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)


Part = TypeVar("Part", bound=DocumentPart)


def part_of(kind: type[Part], record: object, **others: Any) -> Part:
    """Return the part of a record: what is not given beside it are the record's fields of the same names."""
    same = {name: getattr(record, name) for name in kind.model_fields if name not in others}
    return kind(**same, **others)


Row = tuple[float, float, float]
Rows = tuple[Row, Row, Row]


def finite(value: float) -> float | None:
    """Return a number as a document has it: null where there is none."""
    return float(value) if np.isfinite(value) else None


def row_of(vector: ArrayLike) -> Row:
    """Return three numbers as a document has them."""
    x, y, z = np.asarray(vector, dtype=float).tolist()
    return x, y, z


def rows_of(matrix: ArrayLike) -> Rows:
    """Return a (3, 3) matrix as a document has it."""
    a, b, c = np.asarray(matrix, dtype=float)
    return row_of(a), row_of(b), row_of(c)
