"""Shape-typed names of arrays: `Vectors` is an array of shape (samples, 3), and so on.

The shapes stand in every public signature. They are checked while the tests run (jaxtyping with
beartype, switched on in ``tests/conftest.py``); in use they cost nothing.
"""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    Vector: TypeAlias = npt.NDArray[np.float64]
    Vectors: TypeAlias = npt.NDArray[np.float64]
    Matrix: TypeAlias = npt.NDArray[np.float64]
    Matrices: TypeAlias = npt.NDArray[np.float64]
    Quaternion: TypeAlias = npt.NDArray[np.float64]
    Quaternions: TypeAlias = npt.NDArray[np.float64]
    Series: TypeAlias = npt.NDArray[np.float64]
    Table: TypeAlias = npt.NDArray[np.float64]
    Square: TypeAlias = npt.NDArray[np.float64]
    AnyArray: TypeAlias = npt.NDArray[np.float64]
else:
    from os import environ

    if environ.get("TUMBLE_CHECK_SHAPES"):
        from jaxtyping import Float

        Vector = Float[np.ndarray, "3"]
        # How many rows is left open: one signature often has samples, holds and unknowns side by side.
        Vectors = Float[np.ndarray, "_ 3"]
        Matrix = Float[np.ndarray, "3 3"]
        Matrices = Float[np.ndarray, "_ 3 3"]
        Quaternion = Float[np.ndarray, "4"]
        Quaternions = Float[np.ndarray, "_ 4"]
        Series = Float[np.ndarray, "_"]
        Table = Float[np.ndarray, "_ _"]
        Square = Float[np.ndarray, "size size"]
        AnyArray = Float[np.ndarray, "..."]
    else:
        # jaxtyping costs 50 ms to import: outside the tests the names are plain arrays.
        Vector = Vectors = Matrix = Matrices = Quaternion = Quaternions = np.ndarray
        Series = Table = Square = AnyArray = np.ndarray


def inverted(matrix: Square) -> Square:
    """Return the inverse of a square matrix, typed as what it is: 64-bit floats.

    Raises
    ------
    numpy.linalg.LinAlgError
        If it is singular.
    """
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def range_means(samples: Vectors, ranges: np.ndarray) -> Vectors:
    """Return (ranges, 3) means over half-open ranges (ranges, 2) of samples; none of them is empty."""
    sums = np.array([np.add.reduce(samples[a:b]) for a, b in ranges.tolist()], dtype=np.float64)
    return sums.reshape(-1, samples.shape[1]) / (ranges[:, 1] - ranges[:, 0])[:, None]


def extremes(vectors: Vectors) -> tuple[Vector, Vector]:
    """Return the smallest and the largest value of each axis, one axis at a time: that is many times as fast."""
    low, high = ([float(bound(axis)) for axis in vectors.T] for bound in (np.min, np.max))
    return np.array(low), np.array(high)


def median(values: Vectors) -> Vector:
    """Return the median of each axis of finite numbers: np.median without its checks, which cost four times as much."""
    low, high = (values.shape[0] - 1) // 2, values.shape[0] // 2
    ordered = np.partition(values, (low, high), axis=0)
    return 0.5 * (ordered[low] + ordered[high])


def block_means(values: AnyArray, size: int) -> AnyArray:
    """Return the means of consecutive blocks of `size` rows, by products with ones: many times as fast as numpy's mean.

    Parameters
    ----------
    values : (samples, ...) of which what is left over at the end is dropped.
    size : samples in a block.
    """
    count = len(values) // size
    blocks = values[: count * size].reshape(count, size, prod(values.shape[1:]))
    return (np.ones(size) @ blocks / size).reshape(count, *values.shape[1:])


__all__ = [
    "AnyArray",
    "Matrices",
    "Matrix",
    "Quaternion",
    "Quaternions",
    "Series",
    "Square",
    "Table",
    "Vector",
    "Vectors",
    "block_means",
    "extremes",
    "inverted",
    "median",
    "range_means",
]
