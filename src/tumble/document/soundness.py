"""Whether numbers can stand in a document: finite, and a covariance that some random numbers could have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Square, Table

ROUND_OFF = 1e-8
"""Half of a float's digits: how far a covariance may be from symmetric, and its correlations below zero."""
# Of sensing axes as unit vectors; three within a degree of one plane have 0.017.
SMALLEST_DETERMINANT = 1e-6


def stated_covariance_fault(rows: Sequence[Sequence[float]], names: Sequence[str]) -> str | None:
    """Return what is wrong with a covariance that was read, None if it can be one.

    Parameters
    ----------
    rows, names : as the document has them.
    """
    size = len(names)
    if len(rows) != size or any(len(row) != size for row in rows):
        return f"it is not {size} by {size}, as its covariance_parameters has it"
    return covariance_fault(np.array(rows, dtype=float).reshape(size, size), names)


def covariance_fault(covariance: Table, names: Sequence[str]) -> str | None:
    """Return what is wrong with a covariance in words, None if it can be one.

    Variances are compared each in its own unit: rows and columns are divided by the standard uncertainties first.

    Parameters
    ----------
    covariance : (n, n), in any units.
    names : of the n parameters.

    Examples
    --------
    >>> covariance_fault(np.array([[1.0, 2.0], [2.0, 1.0]]), ["bias x", "bias y"])
    'bias x and bias y are correlated by 2.00'
    """
    matrix = np.asarray(covariance, dtype=float)
    if matrix.size == 0 and not names:
        return None
    if matrix.shape != (len(names), len(names)):
        return f"{len(names)} parameters have a covariance of shape {matrix.shape}"
    if fault := not_finite("the covariance", matrix, names):
        return fault
    variance = np.diag(matrix)
    if np.any(variance < 0.0):
        return f"{names[int(np.argmin(variance))]} has a variance below zero"
    sigma = np.sqrt(variance)
    known = sigma == 0.0
    if np.any(matrix[known]) or np.any(matrix[:, known]):
        return f"{names[int(np.argmax(known))]} has no variance and is correlated"
    told = ~known
    correlation = matrix[np.ix_(told, told)] / sigma[told, None] / sigma[told]
    return _correlation_fault(correlation, [name for name, kept in zip(names, told, strict=True) if kept])


def _correlation_fault(correlation: Square, names: Sequence[str]) -> str | None:
    if correlation.size == 0:
        return None
    if np.abs(correlation - correlation.T).max() > ROUND_OFF:
        return "the covariance is not symmetric"
    beyond = np.abs(correlation - np.diag(np.diag(correlation)))
    i, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[i, j] > 1.0 + ROUND_OFF:
        return f"{names[int(i)]} and {names[int(j)]} are correlated by {correlation[i, j]:.2f}"
    smallest = float(np.linalg.eigvalsh(0.5 * (correlation + correlation.T))[0])
    if smallest < -ROUND_OFF * len(names):
        return f"a combination of its parameters has a variance below zero ({smallest:.1e} of the largest)"
    return None


def not_finite(what: str, numbers: AnyArray, names: Sequence[str] = ()) -> str | None:
    """Return a sentence's end on numbers that are not finite, None if all are.

    Parameters
    ----------
    what : the numbers are.
    numbers : of any shape.
    names : of the first axis, if there are any.
    """
    bad = np.argwhere(~np.isfinite(np.asarray(numbers, dtype=float)))
    if not bad.size:
        return None
    where = f" at {names[int(bad[0][0])]}" if names else ""
    return f"{what} holds numbers that are not finite{where}"


def is_invertible(matrix: np.ndarray) -> bool:
    """Say whether three sensing axes, the rows of a finite matrix, are not in one plane."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        length = np.linalg.norm(matrix, axis=1, keepdims=True)
        if not (np.all(np.isfinite(length)) and np.all(length > 0.0)):
            return False
        return abs(float(np.linalg.det(matrix / length))) >= SMALLEST_DETERMINANT
