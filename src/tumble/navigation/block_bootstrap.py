"""Statistics of errors that overlap in time, with uncertainties by drawing blocks of them."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.records import dataclass


@dataclass(frozen=True)
class Statistic:
    """A number with its standard uncertainty; NaN where there are too few errors to tell it.

    Attributes
    ----------
    value, standard_uncertainty : in one unit.
    """

    value: float
    standard_uncertainty: float

    def times(self, factor: float) -> Statistic:
        """Return the number in a unit so many times smaller."""
        return Statistic(factor * self.value, factor * self.standard_uncertainty)


_RESAMPLES = 1000


def _drawn_blocks(count: int, block: int, rng: np.random.Generator) -> np.ndarray | None:
    """Return (resamples, count) indices of blocks drawn with replacement, or None where one block is all."""
    if count <= block or count < 2:
        return None
    blocks = -(-count // block)
    starts = rng.integers(0, count - block + 1, (_RESAMPLES, blocks))
    return (starts[:, :, None] + np.arange(block)).reshape(_RESAMPLES, -1)[:, :count]


def rms_of(squares: Series, block: int, rng: np.random.Generator) -> Statistic:
    """Return the root of the mean of squared errors.

    Parameters
    ----------
    squares : (errors,) in time order.
    block : errors that go together.
    rng : source of all numbers.
    """
    return ratio_of(squares, np.ones(squares.size), block, rng)


def ratio_of(squares: Series, reference: Series, block: int, rng: np.random.Generator) -> Statistic:
    """Return the ratio of two root mean squares of errors at the same instants, drawn in pairs.

    What both have in common, such as a stretch that is hard to navigate, cancels.

    Parameters
    ----------
    squares, reference : (errors,) of both, in time order.
    block : errors that go together.
    rng : source of all numbers.
    """
    if not squares.size or not reference.mean() > 0.0:
        return Statistic(float("nan"), float("nan"))
    value = float(np.sqrt(squares.mean() / reference.mean()))
    rows = _drawn_blocks(squares.size, block, rng)
    if rows is None:
        return Statistic(value, float("nan"))
    spread = np.sqrt(squares[rows].mean(axis=1) / np.maximum(reference[rows].mean(axis=1), 1e-300))
    return Statistic(value, float(np.std(spread, ddof=1)))
